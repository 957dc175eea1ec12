r"""Exact propagation of a mechanism with held matrices while its contacts stay as they are.

Over one bin of crank angle, and for one set of closed contacts, the n coordinates obey

    p'' = A_p p + A_v p' + sum_k F_k x^k + sum_j s_j c_j B_j,      x = time in the bin / duration of the bin

with constant A_p, A_v, F_k (a cubic: the inertia forces of the nominal motion) and one column B_j for each contact
channel j, closed on side s_j = +-1 with clearance c_j. With z = (p, p', 1, x, x^2, x^3, s_1 c_1, ...) this is
p'' = A z, and the Taylor series of p follows from A alone. Summed to round-off at any time it gives the state there,
with no other error.

The propagator of a fixed step is the series of an eighth of it, for all columns of z at once, squared three times.
"""

import math

import numpy as np
from numba import njit

from chaosgym.core.kernel import leaf

FORCING_TERMS = 4
"""Coefficients of the forcing polynomial: a cubic."""

SQUARINGS = 3
"""Doublings that lead from the series to the propagator of a step."""

LANES = 8
"""Numbers that a processor handles at once; tables are worked on in rows of whole multiples."""

SERIES_PHASE = np.array(
    [0.0] * 3 + [math.exp((math.lgamma(order - 1.0) + math.log(1e-18)) / (order - 2)) for order in range(3, 65)]
)
"""Largest w t, by order, at which the Taylor series of a motion with angular frequency w over a time t is summed to
round-off: (w t)^k / k! < 1e-18 for k = order - 2."""


def series_order(phase: float) -> int:
    """Order that sums the Taylor series of a motion over an angle ``phase`` [rad] to round-off."""
    return min(int(np.searchsorted(SERIES_PHASE, phase)), len(SERIES_PHASE) - 1)


@leaf
def order_for(phase, most):
    """``series_order`` of a phase in a kernel, at most ``most``."""
    order = 4
    while order < most and SERIES_PHASE[order] < phase:
        order += 1
    return order


@leaf
def expand(a, row, z, duration, last, series):
    """Taylor coefficients about the instant of z, in seconds, up to the order ``last``.

    ``series[k, :n]`` is p^(k) / k!, the rest row . p^(k) / k! for the channels. ``a`` is the acceleration matrix
    (n, 2n + 4 + channels) of one bin and contact set.
    """
    n, size = a.shape
    for i in range(n):
        series[0, i] = z[i]
        series[1, i] = z[n + i]
    scale = 1.0
    for k in range(last - 1):
        share = 1.0 / ((k + 1) * (k + 2))
        for i in range(n):
            by_place, by_velocity = 0.0, 0.0
            for j in range(n):
                by_place += a[i, j] * series[k, j]
                by_velocity += a[i, n + j] * series[k + 1, j]
            series[k + 2, i] = share * (by_place + (k + 1) * by_velocity)
        if k < FORCING_TERMS:
            # coefficient of t^k of sum_j F_j (x + t / duration)^j
            for i in range(n):
                total = 0.0
                binomial = scale
                for j in range(k, FORCING_TERMS):
                    total += a[i, 2 * n + j] * binomial * z[2 * n + j - k]
                    binomial *= (j + 1.0) / (j + 1 - k)
                if k == 0:
                    for j in range(2 * n + FORCING_TERMS, size):
                        total += a[i, j] * z[j]
                series[k + 2, i] += share * total
        scale /= duration
    for j in range(row.shape[0]):
        for k in range(last + 1):
            total = 0.0
            for i in range(n):
                total += row[j, i] * series[k, i]
            series[k, n + j] = total


@leaf
def evaluate(series, n, last, time, z):
    """Write p and p' of n coordinates at ``time`` after the instant of expansion into the head of z."""
    for i in range(n):
        x, v = series[last, i], 0.0
        for k in range(last - 1, -1, -1):
            v = v * time + x
            x = x * time + series[k, i]
        z[i] = x
        z[n + i] = v


@leaf
def _next_term(a, older, old, by_place, by_velocity, new):
    """Write by_place A_p older + by_velocity A_v old, two rows at a time: sums are then stored half as often."""
    n, width = new.shape
    for i in range(n):
        x0, v0 = by_place * a[i, 0], by_velocity * a[i, n]
        if n % 2 == 1:
            for c in range(width):
                new[i, c] = x0 * older[0, c] + v0 * old[0, c]
        else:
            x1, v1 = by_place * a[i, 1], by_velocity * a[i, n + 1]
            for c in range(width):
                new[i, c] = (x0 * older[0, c] + v0 * old[0, c]) + (x1 * older[1, c] + v1 * old[1, c])
        for j in range(2 - n % 2, n, 2):
            x0, v0 = by_place * a[i, j], by_velocity * a[i, n + j]
            x1, v1 = by_place * a[i, j + 1], by_velocity * a[i, n + j + 1]
            for c in range(width):
                new[i, c] += (x0 * older[j, c] + v0 * old[j, c]) + (x1 * older[j + 1, c] + v1 * old[j + 1, c])


@leaf
def _short_propagator(a, duration, time, order, terms, table):
    """Propagator (2n, width), by rows, over a time for which ``order`` terms of the series suffice.

    ``terms`` (3, n, width) is work space for three successive terms; the width is 2n + 4 + channels or more.
    """
    n, size = a.shape
    width = table.shape[1]
    for i in range(n):
        for c in range(width):
            terms[0, i, c] = 1.0 if c == i else 0.0
            terms[1, i, c] = time if c == n + i else 0.0
            table[i, c] = terms[0, i, c] + terms[1, i, c]
            table[n + i, c] = terms[1, i, c] / time
    scale = 1.0
    for k in range(order - 1):
        new = terms[(k + 2) % 3]
        by_place = time * time / ((k + 1) * (k + 2))
        _next_term(a, terms[k % 3], terms[(k + 1) % 3], by_place, time / (k + 2), new)
        if k < FORCING_TERMS:
            for i in range(n):
                binomial = by_place * scale
                for j in range(k, FORCING_TERMS):
                    new[i, 2 * n + j - k] += binomial * a[i, 2 * n + j]
                    binomial *= (j + 1.0) / (j + 1 - k)
                if k == 0:
                    for c in range(2 * n + FORCING_TERMS, size):
                        new[i, c] += by_place * a[i, c]
        slope = (k + 2) / time
        for i in range(n):
            for c in range(width):
                table[i, c] += new[i, c]
                table[n + i, c] += slope * new[i, c]
        scale *= time / duration


@leaf
def _square(table, share, size, twice):
    """Write the propagator of twice the time; ``share`` is the time over the duration of the bin."""
    states, width = table.shape
    for i in range(states):
        first, second = table[i, 0], table[i, 1]
        for c in range(width):
            twice[i, c] = first * table[0, c] + second * table[1, c]
        for j in range(2, states, 2):
            first, second = table[i, j], table[i, j + 1]
            for c in range(width):
                twice[i, c] += first * table[j, c] + second * table[j + 1, c]
        # the powers of x go on: x^k becomes (x + share)^k
        for k in range(FORCING_TERMS):
            binomial = table[i, states + k]
            for c in range(k, -1, -1):
                twice[i, states + c] += binomial
                binomial *= share * c / (k - c + 1)
        for c in range(states + FORCING_TERMS, size):
            twice[i, c] += table[i, c]


@njit(cache=True, nogil=True)
def propagator_table(acceleration, duration, step, order):
    """Propagators of one step for every contact set and bin: (sets, bins, 2n + 4 + channels, 2n), by columns.

    ``order`` is that of the series over ``step`` / 2^SQUARINGS.
    """
    sets, bins, n, size = acceleration.shape
    answer = np.empty((sets, bins, size, 2 * n))
    width = size + (-size) % LANES
    terms, table, twice = np.empty((3, n, width)), np.empty((2 * n, width)), np.empty((2 * n, width))
    for s in range(sets):
        for b in range(bins):
            time = step / 2**SQUARINGS
            _short_propagator(acceleration[s, b], duration, time, order, terms, table)
            for _ in range(SQUARINGS):
                _square(table, time / duration, size, twice)
                table, twice = twice, table
                time *= 2.0
            for c in range(size):
                for i in range(2 * n):
                    answer[s, b, c, i] = table[i, c]
    return answer


@leaf
def propagate(table, z, moved):
    """Write p and p' one step later into the head of ``moved``; ``table`` is the propagator of one bin and set."""
    size, states = table.shape
    for i in range(states):
        moved[i] = table[0, i] * z[0] + table[1, i] * z[1]
    c = 2
    while c + 4 <= size:
        z0, z1, z2, z3 = z[c], z[c + 1], z[c + 2], z[c + 3]
        for i in range(states):
            moved[i] += (table[c, i] * z0 + table[c + 1, i] * z1) + (table[c + 2, i] * z2 + table[c + 3, i] * z3)
        c += 4
    while c < size:
        for i in range(states):
            moved[i] += table[c, i] * z[c]
        c += 1
