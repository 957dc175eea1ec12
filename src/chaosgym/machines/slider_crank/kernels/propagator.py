r"""Tables of the exact motion of a mechanism with held matrices while its contacts stay as they are.

Over one bin of crank angle, and for one set of closed contacts, the n coordinates obey

    p'' = A_p p + A_v p' + sum_k F_k x^k + sum_j s_j c_j B_j,      x = time in the bin / duration of the bin

with constant A_p, A_v, F_k (a cubic: the inertia forces of the nominal motion) and one column B_j for each contact
channel j, closed on side s_j = +-1 with clearance c_j. With z = (p, p', 1, x, x^2, x^3, s_1 c_1, ...) this is
p'' = A z, and the Taylor series of p follows from A alone.

A bin is cut into looks of eight intervals. The propagator of an interval is the series for all columns of z at once,
summed to round-off; squared three times it is that of a look.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable

from chaosgym.core.kernel import leaf, part
from chaosgym.core.lanes import (
    LANES,
    add_columns,
    aligned,
    copy,
    item,
    keep_largest,
    next_term,
    padded,
    put,
    scale_and_add,
)
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


class _Space(NamedTuple):
    """Work space for the tables of one bin and contact set, as rows of ``width`` in one array.

    Attributes
    ----------
    n, columns, width : int
        Coordinates, numbers of z, the same padded.
    held : int
        Acceleration (n, width).
    nothing, loads : int
        A row that stays zero, and one for the forcing.
    rows : int
        Eight rows.
    one, twice : int
        Propagators (2n, width).
    terms : int
        Terms (order + 1, n, width) of a series.
    sums : int
        Factors (2, order + 1) that sum them to a place and to a velocity.
    """

    own: np.ndarray
    n: int
    columns: int
    width: int
    held: int
    nothing: int
    loads: int
    rows: int
    one: int
    twice: int
    terms: int
    sums: int


@njit(cache=True)
def _space_of(n, m, interval, order):
    columns = 2 * n + FORCING_TERMS + m
    width = padded(columns)
    nothing = n * width
    one = nothing + 10 * width
    twice = one + 2 * n * width
    terms = twice + 2 * n * width
    sums = terms + (order + 1) * n * width
    own = aligned(sums + 2 * (order + 1))
    for k in range(order + 1):
        own[sums + k], own[sums + order + 1 + k] = 1.0, k / interval
    return _Space(own, n, columns, width, 0, nothing, nothing + width, nothing + 2 * width, one, twice, terms, sums)


@part
def _clear(space, at, width):
    """Write zeros: the sum of no columns."""
    add_columns(space.own, at, width, 0, space.own, at, space.own, at, LANES)


@leaf
def _short_propagator(space, duration, time, order):
    """Write the propagator ``one`` over a time for which ``order`` terms of the series suffice."""
    own, n, width, terms, loads = space.own, space.n, space.width, space.terms, space.loads
    size, forcing = n * width, 2 * n
    _clear(space, terms, 2 * size)
    for i in range(n):
        own[terms + i * width + i], own[terms + size + i * width + n + i] = 1.0, time
    scale = 1.0
    for k in range(order - 1):
        older, old, new = terms + k * size, terms + (k + 1) * size, terms + (k + 2) * size
        weight, share, more = (k + 1.0) / time, time * time * SHARES[k], space.nothing
        for i in range(n):
            row = space.held + i * width
            if k < FORCING_TERMS:
                more, binomial = loads, scale
                _clear(space, loads, width)
                for j in range(k, FORCING_TERMS):
                    own[loads + forcing + j - k] = binomial * own[row + forcing + j]
                    binomial *= (j + 1.0) / (j + 1 - k)
                if k == 0:
                    for c in range(forcing + FORCING_TERMS, space.columns):
                        own[loads + c] = own[row + c]
            next_term(own, older, old, width, n, own, row, row + n, more, weight, share, new + i * width)
        scale *= time / duration
    add_columns(own, terms, size, order + 1, own, space.sums, own, space.one, LANES)
    add_columns(own, terms, size, order + 1, own, space.sums + order + 1, own, space.one + size, LANES)


@leaf
def _through(space, propagator, share, row, answer):
    """Write a row over z one step earlier: row P.

    The powers of x become those of x + ``share``, the step over the duration of the bin; the clearances stay.
    """
    own, states = space.own, 2 * space.n
    add_columns(own, propagator, space.width, states, own, row, own, answer, LANES)
    for k in range(FORCING_TERMS):
        binomial = own[row + states + k]
        for c in range(k, -1, -1):
            own[answer + states + c] += binomial
            binomial *= share * c / (k - c + 1)
    for c in range(states + FORCING_TERMS, space.columns):
        own[answer + c] += own[row + c]


@leaf
def _derivative(space, duration, row, answer):
    """Write the time derivative of a row over z: row B, with z' = B z."""
    own, n = space.own, space.n
    add_columns(own, space.held, space.width, n, own, row + n, own, answer, LANES)
    for i in range(n):
        own[answer + n + i] += own[row + i]
    for k in range(1, FORCING_TERMS):
        own[answer + 2 * n + k - 1] += own[row + 2 * n + k] * k / duration


@part
def _from_anchor(space, anchor, row):
    """Let the columns of the clearances of a row count places from the anchor (n, m)."""
    for j in range(anchor.shape[1]):
        for i in range(space.n):
            space.own[row + 2 * space.n + FORCING_TERMS + j] += space.own[row + i] * anchor[i, j]


@leaf
def _note_largest(space, anchor, row, spare, largest):
    """Raise ``largest`` to the absolute values of a row, places from the anchor."""
    copy(space.own, row, spare, space.width)
    _from_anchor(space, anchor, spare)
    keep_largest(space.own, spare, largest, space.width)


@leaf
def _put_channels(space, row, lag, anchor, duration, interval, table, at):
    """Fill ``ahead``, ``now`` and ``bound`` of a row of tables: what the channels read in a look.

    With z' = B z and the row e of a reading, its fourth derivative is e B^4 exp(B t) z. The row of that is computed
    at the ends of all intervals, and between them differs from the nearer of them by exp(B t), |t| up to half an
    interval, whose elements those of exp(|B| |t|) bound. Closed channels pull the state to where they just touch:
    places count from the anchor, so that what cancels does not count.

    Overwrites the acceleration.
    """
    own, n, width = space.own, space.n, space.width
    m, share = row.shape[0], interval / duration
    places = table_places(n, m)
    now, bound = at + places[4], at + places[5]
    spare, largest = space.rows + 6 * width, space.rows + 7 * width
    for j in range(m):
        # reading, slope and fourth derivative, and the same one interval later
        first, then = space.rows, space.rows + 3 * width
        _clear(space, space.rows, 8 * width)
        for i in range(n):
            own[first + i], own[first + n + i] = row[j, i], lag[j] * row[j, i]
        _derivative(space, duration, first, first + width)
        _derivative(space, duration, first + width, then)
        _derivative(space, duration, then, then + width)
        _derivative(space, duration, then + width, first + 2 * width)
        _note_largest(space, anchor, first + 2 * width, spare, largest)
        for c in range(width):
            put(table, now + 2 * j * width + c, item(own, first + c))
            put(table, now + (2 * j + 1) * width + c, item(own, first + width + c))
        for k in range(LANES):
            for q in range(3):
                _through(space, space.one, share, first + q * width, then + q * width)
            first, then = then, first
            for c in range(space.columns):
                place = at + (c * m + j) * 2 * LANES + k
                put(table, place, item(own, first + c))
                put(table, place + LANES, item(own, first + width + c))
            _note_largest(space, anchor, first + 2 * width, spare, largest)
        for c in range(width):
            put(table, bound + j * width + c, item(own, largest + c))
    for i in range(n):
        _from_anchor(space, anchor, space.held + i * width)
        copy(own, space.held + i * width, spare, width)
        keep_largest(own, spare, space.held + i * width, width)
    term, derived = space.rows, space.rows + width
    for j in range(m):
        for c in range(width):
            put(own, term + c, item(table, bound + j * width + c))
        copy(own, term, largest, width)
        for k in range(1, BOUND_TERMS):
            _derivative(space, duration, term, derived)
            scale_and_add(own, derived, 0.5 * interval / k, largest, width)
            term, derived = derived, term
        # the terms left out shrink at least by half each
        scale_and_add(own, term, 1.0, largest, width)
        for c in range(width):
            put(table, bound + j * width + c, item(own, largest + c))


@leaf
def _put_states(space, propagator, table, at):
    """Store a propagator by columns."""
    states = padded(2 * space.n)
    for c in range(space.columns):
        for i in range(2 * space.n):
            put(table, at + c * states + i, item(space.own, propagator + i * space.width + c))


@leaf
def _put_acceleration(space, free, forcing, push, rate, row, s, b, table, at):
    """Sum the acceleration of a bin and contact set at a crank rate: by rows in ``held``, by columns in the table."""
    m, n = row.shape
    own, width, lanes = space.own, space.width, padded(n + m)
    for i in range(n):
        held = space.held + i * width
        for c in range(2 * n):
            total = free[0, b, c, i] + rate * free[1, b, c, i] + rate * rate * free[2, b, c, i]
            put(own, held + c, total + push[s, b, c, i])
        for k in range(FORCING_TERMS):
            put(own, held + 2 * n + k, forcing[0, b, k, i] + rate * rate * forcing[1, b, k, i])
        for j in range(m):
            put(own, held + 2 * n + FORCING_TERMS + j, push[s, b, 2 * n + j, i])
    for c in range(space.columns):
        for i in range(n):
            put(table, at + c * lanes + i, item(own, space.held + i * width + c))
        for j in range(m):
            total = 0.0
            for i in range(n):
                total += row[j, i] * item(own, space.held + i * width + c)
            put(table, at + c * lanes + n + j, total)


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
    interval = duration / (LANES * steps)
    places = table_places(n, m)
    length = places[6]
    table = aligned(sets * bins * length)
    space = _space_of(n, m, interval, order)
    for s in range(sets):
        for b in range(bins):
            at = (s * bins + b) * length
            _put_acceleration(space, free, forcing, push, rate, row, s, b, table, at + places[3])
            _short_propagator(space, duration, interval, order)
            _put_states(space, space.one, table, at + places[2])
            _put_channels(space, row, lag[s], anchor[s], duration, interval, table, at)
            before, after, share = space.one, space.twice, interval / duration
            for _ in range(3):
                for i in range(2 * n):
                    _through(space, before, share, before + i * space.width, after + i * space.width)
                before, after, share = after, before, 2.0 * share
            _put_states(space, before, table, at + places[1])
    return table
