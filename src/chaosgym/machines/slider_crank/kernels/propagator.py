r"""Exact propagation of a mechanism with held matrices while its contacts stay as they are.

Over one bin of crank angle, and for one set of closed contacts, the n coordinates obey

    p'' = A_p p + A_v p' + sum_k F_k x^k + sum_j s_j c_j B_j,      x = time in the bin / duration of the bin

with constant A_p, A_v, F_k (a cubic: the inertia forces of the nominal motion) and one column B_j for each contact
channel j, closed on side s_j = +-1 with clearance c_j. With z = (p, p', 1, x, x^2, x^3, s_1 c_1, ...) this is
p'' = A z, and the Taylor series of p follows from A alone. Summed to round-off at any time it gives the state there,
with no other error.

Steps are halves of halves of a bin. The propagator of the shortest, a tick, is the series for all columns of z at
once; squared again and again it is that of longer steps, of which every second is kept: a ladder of ``RUNGS`` steps,
each four times as long as the next.

The file is long because the tables, their layout in memory and the bounds of what they leave out go together.
"""

import math

import numpy as np
from numba import njit

from chaosgym.core.kernel import leaf, part
from chaosgym.core.lanes import GROUP, add_columns, next_term, padded

FORCING_TERMS = 4
"""Coefficients of the forcing polynomial: a cubic."""

RUNGS = 3
"""Lengths of step for which there are propagators."""

TICKS = 4 ** (RUNGS - 1)
"""Ticks in the longest step."""

SERIES_PHASE = np.array(
    [0.0] * 3 + [math.exp((math.lgamma(order) + math.log(1e-17)) / (order - 1)) for order in range(3, 65)]
)
"""Largest w t, by order, at which the Taylor series of a motion with angular frequency w over a time t is summed to
round-off, and so are those of its velocity and acceleration: (w t)^k / k! < 1e-17 for k = order - 1."""

SHARES = np.array([1.0 / ((k + 1) * (k + 2)) for k in range(len(SERIES_PHASE))])
"""Factorial of k over that of k + 2."""

BOUND_TERMS = 16
"""Terms of the series that bounds a propagator over an eighth of the longest step."""


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


@part
def combine(table, count, factors, answer):
    """Write the sum over c < ``count`` of ``factors[c] * table[c]`` into the first ``table.shape[1]`` of ``answer``."""
    add_columns(table, 0, table.shape[1], count, factors, 0, answer, 0)


@leaf
def shift_forcing(powers, k, scale, factors):
    """Write the factors of F_j in coefficient k of sum_j F_j (x + t / duration)^j; ``powers`` are those of x.

    ``scale`` is duration^-k.
    """
    binomial = scale
    for j in range(k, FORCING_TERMS):
        factors[j] = binomial * powers[j - k]
        binomial *= (j + 1.0) / (j + 1 - k)


@leaf
def expand(a, n, z, duration, last, factors, series):
    """Taylor coefficients about the instant of z, in seconds, up to the order ``last``.

    ``series[k]`` holds p^(k) / k! of the n coordinates, then that of the channels' displacements, whose first two rows
    the caller writes. ``a`` (columns, lanes) is the acceleration of one bin and contact set; ``factors`` (columns,) is
    work space.
    """
    for i in range(n):
        series[0, i] = z[i]
        series[1, i] = z[n + i]
    forcing, row = a[2 * n :], series.shape[1]
    scale = 1.0
    for k in range(last - 1):
        new = series[k + 2]
        if k < FORCING_TERMS:
            for c in range(FORCING_TERMS, forcing.shape[0]):
                factors[c] = z[2 * n + c]
            shift_forcing(z[2 * n :], k, scale, factors)
            if k == 0:
                combine(forcing, forcing.shape[0], factors, new)
            else:
                combine(forcing[k:], FORCING_TERMS - k, factors[k:], new)
            scale /= duration
        else:
            for i in range(new.shape[0]):
                new[i] = 0.0
        next_term(a, 0, a.shape[1], n, series, k * row, (k + 1) * row, k + 1.0, SHARES[k], (k + 2) * row)


@leaf
def evaluate(series, last, time, powers, values):
    """Write value and first two derivatives at ``time`` of all columns of a series into ``values`` (3, lanes)."""
    power = 1.0
    for k in range(last + 1):
        powers[0, k] = power
        powers[1, k] = (k + 1.0) * power
        powers[2, k] = (k + 2.0) * (k + 1.0) * power
        power *= time
    combine(series, last + 1, powers[0], values[0])
    combine(series[1:], last, powers[1], values[1])
    combine(series[2:], last - 1, powers[2], values[2])


@leaf
def put_time(z, n, x):
    """Write the forcing columns of z for time x as a share of the bin."""
    z[2 * n] = 1.0
    for k in range(1, FORCING_TERMS):
        z[2 * n + k] = z[2 * n + k - 1] * x


@leaf
def _next_term(a, n, older, old, by_place, by_velocity, new):
    """Write by_place A_p older + by_velocity A_v old, two rows at a time: sums are then stored half as often."""
    width = new.shape[1]
    for i in range(n):
        x0, v0 = by_place * a[0, i], by_velocity * a[n, i]
        if n % 2 == 1:
            for c in range(width):
                new[i, c] = x0 * older[0, c] + v0 * old[0, c]
        else:
            x1, v1 = by_place * a[1, i], by_velocity * a[n + 1, i]
            for c in range(width):
                new[i, c] = (x0 * older[0, c] + v0 * old[0, c]) + (x1 * older[1, c] + v1 * old[1, c])
        for j in range(2 - n % 2, n, 2):
            x0, v0 = by_place * a[j, i], by_velocity * a[n + j, i]
            x1, v1 = by_place * a[j + 1, i], by_velocity * a[n + j + 1, i]
            for c in range(width):
                new[i, c] += (x0 * older[j, c] + v0 * old[j, c]) + (x1 * older[j + 1, c] + v1 * old[j + 1, c])


@leaf
def _short_propagator(a, n, size, duration, time, order, terms, table):
    """Propagator (2n, width), by rows, over a time for which ``order`` terms of the series suffice.

    ``terms`` (3, n, width) is work space for three successive terms; ``size`` is 2n + 4 + channels.
    """
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
        _next_term(a, n, terms[k % 3], terms[(k + 1) % 3], by_place, time / (k + 2), new)
        if k < FORCING_TERMS:
            for i in range(n):
                binomial = by_place * scale
                for j in range(k, FORCING_TERMS):
                    new[i, 2 * n + j - k] += binomial * a[2 * n + j, i]
                    binomial *= (j + 1.0) / (j + 1 - k)
                if k == 0:
                    for c in range(2 * n + FORCING_TERMS, size):
                        new[i, c] += by_place * a[c, i]
        slope = (k + 2) / time
        for i in range(n):
            for c in range(width):
                table[i, c] += new[i, c]
                table[n + i, c] += slope * new[i, c]
        scale *= time / duration


@leaf
def _shift(row, states, size, share, answer):
    """Add to ``answer`` what a row over z one step earlier gives for the columns that go on without a propagator.

    The powers of x become those of x + share; the clearances stay.
    """
    for k in range(FORCING_TERMS):
        binomial = row[states + k]
        for c in range(k, -1, -1):
            answer[states + c] += binomial
            binomial *= share * c / (k - c + 1)
    for c in range(states + FORCING_TERMS, size):
        answer[c] += row[c]


@leaf
def _square(table, share, size, twice):
    """Write the propagator of twice the time; ``share`` is the time over the duration of the bin."""
    states = table.shape[0]
    for i in range(states):
        combine(table, states, table[i], twice[i])
        _shift(table[i], states, size, share, twice[i])


@leaf
def _add(factor, row, size, answer):
    """Add ``factor`` times a row to another."""
    for c in range(size):
        answer[c] += factor * row[c]


@leaf
def _store(table, held, n, m, size, lag, row, share, rows, answer):
    """Write a propagator by columns, and below the states what the channels read: see ``SliderCrankModel``.

    ``held`` (n, size) is the acceleration by rows, ``rows`` (4, size) work space.
    """
    for c in range(size):
        for i in range(2 * n):
            answer[c, i] = table[i, c]
    for j in range(m):
        reading, slope, bend, here = rows[0], rows[1], rows[2], rows[3]
        for c in range(size):
            reading[c], slope[c] = 0.0, 0.0
        for i in range(n):
            if row[j, i] != 0.0:
                _add(row[j, i], table[i], size, reading)
                _add(row[j, i], table[n + i], size, slope)
        if lag[j] != 0.0:
            _add(lag[j], slope, size, reading)
            for c in range(size):
                here[c] = 0.0
            for i in range(n):
                if row[j, i] != 0.0:
                    _add(row[j, i], held[i], size, here)
            _through(here, table, size, share, bend)
            _add(lag[j], bend, size, slope)
        for c in range(size):
            answer[c, 2 * n + 2 * j] = reading[c]
            answer[c, 2 * n + 2 * j + 1] = slope[c]


@leaf
def _derivative(held, n, size, duration, row, answer):
    """Write the time derivative of a row over z: row B, with z' = B z; ``held`` (n, size) is the acceleration."""
    for c in range(size):
        answer[c] = 0.0
    for i in range(n):
        _add(row[n + i], held[i], size, answer)
    for i in range(n):
        answer[n + i] += row[i]
    for k in range(1, FORCING_TERMS):
        answer[2 * n + k - 1] += row[2 * n + k] * k / duration


@leaf
def _through(row, table, size, share, answer):
    """Write a row over z one step earlier: row P."""
    states = table.shape[0]
    for c in range(size):
        answer[c] = 0.0
    for i in range(states):
        _add(row[i], table[i], size, answer)
    _shift(row, states, size, share, answer)


@leaf
def _bound(held, n, m, size, duration, lag, row, anchor, quarter, step, rows, answer):
    """Bounds (m, columns) of the fourth derivative of what the channels read, over the longest step, per unit |z|.

    With z' = B z and the row e of a reading, the derivative is e B^4 exp(B t) z. Its row is computed at the ends of
    the four quarters of the step, and between them differs from the nearer of them by exp(B t), |t| up to an eighth,
    whose elements those of exp(|B| t) bound. Closed channels pull the state to where they just touch: places count
    from ``anchor`` (n, m), per unit of clearance, so that what cancels does not count.

    ``held`` (n, size) and ``quarter`` (2n, size or more), the acceleration and the propagator of a quarter, are
    overwritten.
    """
    share = 0.25 * step / duration
    for j in range(m):
        c = 2 * n + FORCING_TERMS + j
        for i in range(n):
            for k in range(n):
                if anchor[k, j] != 0.0:
                    held[i, c] += held[i, k] * anchor[k, j]
                    quarter[i, c] += quarter[i, k] * anchor[k, j]
                    quarter[n + i, c] += quarter[n + i, k] * anchor[k, j]
            quarter[i, c] -= anchor[i, j]
    for j in range(m):
        now, then, largest = rows[0], rows[1], rows[2]
        for c in range(size):
            now[c] = 0.0
        for i in range(n):
            now[i], now[n + i] = row[j, i], lag[j] * row[j, i]
        for _ in range(4):
            _derivative(held, n, size, duration, now, then)
            now, then = then, now
        for c in range(size):
            largest[c] = abs(now[c])
        for _ in range(4):
            _through(now, quarter, size, share, then)
            now, then = then, now
            for c in range(size):
                largest[c] = max(largest[c], abs(now[c]))
        for c in range(size):
            answer[j, c] = largest[c]
    for i in range(n):
        for c in range(size):
            held[i, c] = abs(held[i, c])
    for j in range(m):
        now, then = rows[0], rows[1]
        for c in range(size):
            now[c] = answer[j, c]
        for k in range(1, BOUND_TERMS):
            _derivative(held, n, size, duration, now, then)
            for c in range(size):
                then[c] *= 0.125 * step / k
                answer[j, c] += then[c]
            now, then = then, now
        # the terms left out shrink at least by half each
        for c in range(size):
            answer[j, c] += now[c]


@njit(cache=True, nogil=True)
def tables(acceleration, row, lag, anchor, duration, step, order):
    """Propagators and bounds for every contact set and bin.

    Parameters
    ----------
    acceleration : (sets, bins, columns, lanes)
        See ``SliderCrankModel``.
    row : (m, n)
        Displacement of each channel per unit coordinate.
    lag : (sets, m)
        Damping over stiffness [s] of the channels that are closed, 0 for the others.
    anchor : (sets, n, m)
        Places per unit of clearance at which the closed channels just touch.
    duration, step
        Of a bin, and of the longest step [s].
    order
        Of the series over a tick.

    Returns
    -------
    (propagator, bound) : (sets, bins, RUNGS, columns, 2n + 2m or more) and (sets, bins, m, columns)
    """
    sets, bins, columns, _ = acceleration.shape
    m, n = row.shape
    size = 2 * n + FORCING_TERMS + m
    propagator = np.zeros((sets, bins, RUNGS, columns, padded(2 * (n + m), GROUP)))
    bound = np.zeros((sets, bins, m, columns))
    width = size + (-size) % 8
    terms, table, twice = np.empty((3, n, width)), np.empty((2 * n, width)), np.empty((2 * n, width))
    held, spare, rows = np.empty((n, size)), np.empty((2 * n, width)), np.empty((4, size))
    for s in range(sets):
        for b in range(bins):
            a = acceleration[s, b]
            for i in range(n):
                for c in range(size):
                    held[i, c] = a[c, i]
            time = step / TICKS
            _short_propagator(a, n, size, duration, time, order, terms, table)
            for rung in range(RUNGS - 1, -1, -1):
                _store(table, held, n, m, size, lag[s], row, time / duration, rows, propagator[s, b, rung])
                if rung == 1:
                    for i in range(2 * n):
                        for c in range(size):
                            spare[i, c] = table[i, c]
                if rung > 0:
                    for _ in range(2):
                        _square(table, time / duration, size, twice)
                        table, twice = twice, table
                        time *= 2.0
            _bound(held, n, m, size, duration, lag[s], row, anchor[s], spare, step, rows, bound[s, b])
    return propagator, bound
