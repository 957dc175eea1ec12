r"""How does a mechanism with held matrices move, exactly, while its contacts stay as they are?

Over one bin of crank angle, and for one set of closed contacts, the n coordinates obey

    p'' = A_p p + A_v p' + sum_k F_k x^k + sum_j s_j c_j B_j,      x = time in the bin / duration of the bin

with constant A_p, A_v, F_k (a cubic: the inertia forces of the nominal motion) and one column B_j for each contact
channel j, closed on side s_j = +-1 with clearance c_j. With z = (p, p', 1, x, x^2, x^3, s_1 c_1, ...) this is
p'' = A z, and the Taylor series of p follows from A alone. Summed to round-off over a fixed step it gives the
propagator of that step; summed at any other time it gives the state in between, with the same error: none.
"""

import numpy as np
from numba import njit

FORCING_TERMS = 4
"""Coefficients of the forcing polynomial: a cubic."""


@njit(cache=True)
def series_order(phase):
    """Terms that sum the Taylor series of a motion with angular frequency w over a time t to round-off, phase = w t."""
    order, term = 2, 0.5 * phase * phase
    while term > 1e-18 and order < 60:
        order += 1
        term *= phase / order
    return order + 2


@njit(cache=True)
def expand(a, z, duration, series):
    """Taylor coefficients of p about the instant of z, in seconds: series[k] = p^(k) / k!, (order + 1, n).

    ``a`` is the acceleration matrix (n, 2n + 4 + channels) of one bin and contact set.
    """
    n, size = a.shape
    for i in range(n):
        series[0, i] = z[i]
        series[1, i] = z[n + i]
    scale = 1.0
    for k in range(series.shape[0] - 2):
        share = 1.0 / ((k + 1) * (k + 2))
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += a[i, j] * series[k, j] + a[i, n + j] * ((k + 1) * series[k + 1, j])
            if k < FORCING_TERMS:
                # coefficient of t^k of sum_j F_j (x + t / duration)^j
                binomial = scale
                for j in range(k, FORCING_TERMS):
                    total += a[i, 2 * n + j] * binomial * z[2 * n + j - k]
                    binomial *= (j + 1.0) / (j + 1 - k)
            if k == 0:
                for j in range(2 * n + FORCING_TERMS, size):
                    total += a[i, j] * z[j]
            series[k + 2, i] = share * total
        scale /= duration


@njit(cache=True)
def evaluate(series, time, z):
    """Write p and p' at ``time`` after the instant of expansion into the head of z."""
    last = series.shape[0] - 1
    n = series.shape[1]
    for i in range(n):
        x, v = series[last, i], 0.0
        for k in range(last - 1, -1, -1):
            v = v * time + x
            x = x * time + series[k, i]
        z[i] = x
        z[n + i] = v


@njit(cache=True, nogil=True)
def propagator_table(acceleration, duration, step, order):
    """Propagators of one step for every contact set and bin: (sets, bins, 2n + 4 + channels, 2n), by columns."""
    sets, bins, n, size = acceleration.shape
    table = np.empty((sets, bins, size, 2 * n))
    series = np.empty((order + 1, n))
    z, moved = np.empty(size), np.empty(size)
    for s in range(sets):
        for b in range(bins):
            for column in range(size):
                z[:] = 0.0
                z[column] = 1.0
                expand(acceleration[s, b], z, duration, series)
                evaluate(series, step, moved)
                for i in range(2 * n):
                    table[s, b, column, i] = moved[i]
    return table


@njit(cache=True)
def propagate(table, z, moved):
    """Write p and p' one step later into the head of ``moved``; ``table`` is the propagator of one bin and set."""
    size, states = table.shape
    for i in range(states):
        moved[i] = table[0, i] * z[0]
    for c in range(1, size):
        factor = z[c]
        for i in range(states):
            moved[i] += table[c, i] * factor
