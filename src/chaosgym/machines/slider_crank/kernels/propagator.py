r"""Tables of the exact motion of a mechanism with held matrices while its contacts stay as they are.

Over one bin of crank angle, and for one set of closed contacts, the n coordinates obey

    p'' = A_p p + A_v p' + sum_k F_k x^k + sum_j s_j c_j B_j,      x = time in the bin / duration of the bin

with constant A_p, A_v, F_k (a cubic: the inertia forces of the nominal motion) and one column B_j for each contact
channel j, closed on side s_j = +-1 with clearance c_j. With z = (p, p', 1, x, x^2, x^3, s_1 c_1, ...) this is
p'' = A z, and the Taylor series of p follows from A alone.

A bin is cut into looks of eight intervals. The propagator of an interval is the series for all columns of z at once,
summed to round-off; squared three times it is that of a look. Matrices here are stored by rows of z's length, padded to
a multiple of 8, in one array of work space.
"""

import math

import numpy as np
from numba import njit
from numba.extending import register_jitable

from chaosgym.core.kernel import leaf
from chaosgym.core.lanes import LANES, add_columns, aligned, next_term, padded
from chaosgym.machines.slider_crank.kernels.series import FORCING_TERMS, SHARES

BOUND_TERMS = 16
"""Terms of the series that bounds a propagator over half an interval."""


@register_jitable
def table_places(n: int, m: int) -> tuple[int, ...]:
    """Where the tables of a bin and a contact set begin in their row, and its length.

    ahead (columns, m, 2, 8)
        Reading and slope of every channel after 1 to 8 intervals per unit z: y + lag y' where it is closed, else y.
    look, interval (columns, 2n or more)
        p and p' after a look, and after an interval.
    acceleration (columns, n + m or more)
        p'' and the second derivatives of the channels' displacements.
    now (m, 2, columns or more)
        Reading and slope of every channel.
    bound (m, columns or more)
        Largest fourth derivative of each reading over a look per unit of |z|, places from the anchor.
    """
    columns = 2 * n + FORCING_TERMS + m
    look = columns * 2 * LANES * m
    interval = look + columns * padded(2 * n)
    acceleration = interval + columns * padded(2 * n)
    now = acceleration + columns * padded(n + m)
    bound = now + 2 * m * padded(columns)
    return 0, look, interval, acceleration, now, bound, bound + m * padded(columns)


@leaf
def _short_propagator(work, held, n, columns, duration, time, order, loads, terms, answer):
    """Write the propagator (2n, width) over a time for which ``order`` terms of the series suffice.

    ``held`` (n, width) is the acceleration; ``loads`` (width,) and ``terms`` (order + 1, n, width) are work space.
    """
    width = padded(columns)
    size = n * width
    for i in range(size):
        work[terms + i], work[terms + size + i] = 0.0, 0.0
    for i in range(n):
        work[terms + i * width + i], work[terms + size + i * width + n + i] = 1.0, time
    scale = 1.0
    for k in range(order - 1):
        older, old, new = terms + k * size, terms + (k + 1) * size, terms + (k + 2) * size
        share = time * time * SHARES[k]
        for i in range(n):
            row, own = new + i * width, held + i * width
            for c in range(width):
                work[loads + c] = 0.0
            if k < FORCING_TERMS:
                binomial = scale
                for j in range(k, FORCING_TERMS):
                    work[loads + 2 * n + j - k] = binomial * work[own + 2 * n + j]
                    binomial *= (j + 1.0) / (j + 1 - k)
            if k == 0:
                for c in range(2 * n + FORCING_TERMS, columns):
                    work[loads + c] = work[own + c]
            next_term(work, older, old, width, n, work, own, own + n, loads, (k + 1.0) / time, share, row)
        scale *= time / duration
    for i in range(size):
        work[answer + i], work[answer + size + i] = work[terms + i], 0.0
    for k in range(1, order + 1):
        slope = k / time
        for i in range(size):
            work[answer + i] += work[terms + k * size + i]
            work[answer + size + i] += slope * work[terms + k * size + i]


@leaf
def _through(work, propagator, n, columns, share, row, answer):
    """Write a row over z one step earlier: row P.

    The powers of x become those of x + ``share``, the step over the duration of the bin; the clearances stay.
    """
    width, states = padded(columns), 2 * n
    add_columns(work, propagator, width, states, work, row, work, answer, LANES)
    for k in range(FORCING_TERMS):
        binomial = work[row + states + k]
        for c in range(k, -1, -1):
            work[answer + states + c] += binomial
            binomial *= share * c / (k - c + 1)
    for c in range(states + FORCING_TERMS, columns):
        work[answer + c] += work[row + c]


@leaf
def _derivative(work, held, n, columns, duration, row, answer):
    """Write the time derivative of a row over z: row B, with z' = B z; ``held`` (n, width) is the acceleration."""
    add_columns(work, held, padded(columns), n, work, row + n, work, answer, LANES)
    for i in range(n):
        work[answer + n + i] += work[row + i]
    for k in range(1, FORCING_TERMS):
        work[answer + 2 * n + k - 1] += work[row + 2 * n + k] * k / duration


@leaf
def _from_anchor(work, anchor, n, row):
    """Let the columns of the clearances of a row count places from the anchor (n, m)."""
    for j in range(anchor.shape[1]):
        for i in range(n):
            work[row + 2 * n + FORCING_TERMS + j] += work[row + i] * anchor[i, j]


@leaf
def _keep_largest(work, anchor, n, columns, row, spare, largest):
    """Raise ``largest`` to the absolute values of a row, places from the anchor."""
    for c in range(columns):
        work[spare + c] = work[row + c]
    _from_anchor(work, anchor, n, spare)
    for c in range(columns):
        work[largest + c] = max(work[largest + c], abs(work[spare + c]))


@leaf
def _spread_bound(work, sizes, n, columns, duration, time, rows, bound):
    """Multiply a bound (columns,) at an instant by exp(|B| time), which makes it one for all times up to there."""
    width = padded(columns)
    term, derived = rows, rows + width
    for c in range(columns):
        work[term + c] = work[bound + c]
    for k in range(1, BOUND_TERMS):
        _derivative(work, sizes, n, columns, duration, term, derived)
        for c in range(columns):
            work[derived + c] *= time / k
            work[bound + c] += work[derived + c]
        term, derived = derived, term
    # the terms left out shrink at least by half each
    for c in range(columns):
        work[bound + c] += work[term + c]


@leaf
def _put_channels(work, held, propagator, row, lag, anchor, n, columns, duration, interval, rows, table, at):
    """Fill ``ahead``, ``now`` and ``bound`` of a row of tables: what the channels read in a look.

    With z' = B z and the row e of a reading, its fourth derivative is e B^4 exp(B t) z. The row of that is computed
    at the ends of all intervals, and between them differs from the nearer of them by exp(B t), |t| up to half an
    interval, whose elements those of exp(|B| |t|) bound. Closed channels pull the state to where they just touch:
    places count from the anchor, so that what cancels does not count.

    ``propagator`` is that of an interval; ``rows`` (8, width) is work space. Overwrites ``held`` (n, width).
    """
    m = row.shape[0]
    width, share = padded(columns), interval / duration
    ahead, now, bound = table_places(n, m)[0] + at, table_places(n, m)[4] + at, table_places(n, m)[5] + at
    spare, largest = rows + 6 * width, rows + 7 * width
    for i in range(8 * width):
        work[rows + i] = 0.0
    for j in range(m):
        # reading, slope and fourth derivative, and the same one interval later
        first, then = rows, rows + 3 * width
        for c in range(6 * width):
            work[rows + c] = 0.0
        for i in range(n):
            work[first + i], work[first + n + i] = row[j, i], lag[j] * row[j, i]
        _derivative(work, held, n, columns, duration, first, first + width)
        _derivative(work, held, n, columns, duration, first + width, then)
        _derivative(work, held, n, columns, duration, then, then + width)
        _derivative(work, held, n, columns, duration, then + width, first + 2 * width)
        for c in range(columns):
            table[now + 2 * j * width + c] = work[first + c]
            table[now + (2 * j + 1) * width + c] = work[first + width + c]
            work[largest + c] = 0.0
        _keep_largest(work, anchor, n, columns, first + 2 * width, spare, largest)
        for k in range(LANES):
            for q in range(3):
                _through(work, propagator, n, columns, share, first + q * width, then + q * width)
            first, then = then, first
            for c in range(columns):
                place = ahead + (c * m + j) * 2 * LANES + k
                table[place], table[place + LANES] = work[first + c], work[first + width + c]
            _keep_largest(work, anchor, n, columns, first + 2 * width, spare, largest)
        for c in range(columns):
            table[bound + j * width + c] = work[largest + c]
    for i in range(n):
        _from_anchor(work, anchor, n, held + i * width)
        for c in range(columns):
            work[held + i * width + c] = abs(work[held + i * width + c])
    for j in range(m):
        for c in range(columns):
            work[largest + c] = table[bound + j * width + c]
        _spread_bound(work, held, n, columns, duration, 0.5 * interval, rows, largest)
        for c in range(columns):
            table[bound + j * width + c] = work[largest + c]


@leaf
def _put_states(work, propagator, n, columns, table, at):
    """Store a propagator by columns."""
    states, width = padded(2 * n), padded(columns)
    for c in range(columns):
        for i in range(2 * n):
            table[at + c * states + i] = work[propagator + i * width + c]


@leaf
def _put_acceleration(free, forcing, push, rate, row, s, b, work, held, table, at):
    """Sum the acceleration of a bin and contact set at a crank rate: by rows in ``held``, by columns in the table."""
    m, n = row.shape
    columns, lanes = 2 * n + FORCING_TERMS + m, padded(n + m)
    width = padded(columns)
    for i in range(n):
        for c in range(2 * n):
            total = free[0, b, c, i] + rate * free[1, b, c, i] + rate * rate * free[2, b, c, i]
            work[held + i * width + c] = total + push[s, b, c, i]
        for k in range(FORCING_TERMS):
            work[held + i * width + 2 * n + k] = forcing[0, b, k, i] + rate * rate * forcing[1, b, k, i]
        for j in range(m):
            work[held + i * width + 2 * n + FORCING_TERMS + j] = push[s, b, 2 * n + j, i]
    for c in range(columns):
        for i in range(n):
            table[at + c * lanes + i] = work[held + i * width + c]
        for j in range(m):
            total = 0.0
            for i in range(n):
                total += row[j, i] * work[held + i * width + c]
            table[at + c * lanes + n + j] = total


@njit(cache=True, nogil=True)
def tables(free, forcing, push, rate, row, lag, anchor, duration, steps, order):
    """Tables of every contact set and bin.

    Parameters
    ----------
    free : (3, bins, 2n, n)
        Accelerations per unit p and p' without contact, by powers of the crank rate.
    forcing : (2, bins, 4, n)
        Accelerations per unit 1, x, x^2, x^3, and per squared crank rate.
    push : (sets, bins, 2n + m, n)
        What closed contacts add per unit p, p' and clearance.
    rate
        Of the crank [rad/s].
    row : (m, n)
        Displacement of each channel per unit coordinate.
    lag : (sets, m)
        Damping over stiffness [s] of the channels that are closed, 0 for the others.
    anchor : (sets, n, m)
        Places per unit of clearance at which the closed channels just touch.
    duration
        Of a bin [s].
    steps
        Looks in a bin.
    order
        Of the series over an interval.

    Returns
    -------
    (sets * bins * length of ``table_places``,)
    """
    sets, bins = push.shape[:2]
    m, n = row.shape
    columns = 2 * n + FORCING_TERMS + m
    width, interval = padded(columns), duration / (LANES * steps)
    _, look, step, acceleration, _, _, length = table_places(n, m)
    table = aligned(sets * bins * length)
    held, rows = 0, n * width
    one, twice, terms = rows + 8 * width, rows + (8 + 2 * n) * width, rows + (8 + 4 * n) * width
    work = aligned(terms + (order + 1) * n * width)
    for s in range(sets):
        for b in range(bins):
            at = (s * bins + b) * length
            _put_acceleration(free, forcing, push, rate, row, s, b, work, held, table, at + acceleration)
            _short_propagator(work, held, n, columns, duration, interval, order, rows, terms, one)
            _put_states(work, one, n, columns, table, at + step)
            _put_channels(work, held, one, row, lag[s], anchor[s], n, columns, duration, interval, rows, table, at)
            before, after, share = one, twice, interval / duration
            for _ in range(3):
                for i in range(2 * n):
                    _through(work, before, n, columns, share, before + i * width, after + i * width)
                before, after, share = after, before, 2.0 * share
            _put_states(work, before, n, columns, table, at + look)
    return table
