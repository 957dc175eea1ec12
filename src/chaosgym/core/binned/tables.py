r"""Tables of the exact motion of a mechanism with held matrices while its contacts stay as they are.

Over one bin of the angle of the drive, and for one set of closed contacts, the n coordinates obey

    (1)  p'' = A_p p + A_v p' + sum_k F_k x^k + sum_j s_j c_j B_j,      x = time in the bin / duration of the bin

with constant A_p, A_v, F_k (a cubic: the inertia forces of the nominal motion) and one column B_j for each contact
channel j, closed on side s_j = +-1 with clearance c_j. With z = (p, p', 1, x, x^2, x^3, s_1 c_1, ...) this is
(2) p'' = A z, and the Taylor series of p follows from A alone.

A bin is cut into looks of eight intervals. The propagator of an interval is the series for all columns of z at once,
summed to round-off; squared three times it is that of a look. Eight bins are worked on side by side.
"""

from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable

from chaosgym.core.binned.lanes import add_rows, copy, deal, keep_largest, multiply_eight, next_terms_of_eight
from chaosgym.core.binned.model import FORCING_TERMS
from chaosgym.core.binned.series import SHARES
from chaosgym.core.kernel import leaf, njit, part
from chaosgym.core.lanes import LANES, aligned, item, padded, put, unset

BOUND_TERMS = 16
"""Terms of the series that bounds a propagator over half an interval."""


class TablePlaces(NamedTuple):
    """Where the tables of a bin and a contact set begin in their row, and its length.

    ahead (columns, m, 2, 8)
        Reading and slope of every channel after 1 to 8 intervals per unit z: y + lag y' where it is closed, else y.
    look, interval (columns, 2n)
        p and p' after a look, and after an interval.
    acceleration (columns, n + m or more)
        p'' and the second derivatives of the channels' displacements.
    now (m, 2, columns or more)
        Reading and slope of every channel.
    bound (m, columns or more)
        Largest fourth derivative of each reading over a look per unit of |z|, places from the anchor.
    """

    ahead: int
    look: int
    interval: int
    acceleration: int
    now: int
    bound: int
    length: int


@register_jitable
def table_places(n: int, m: int) -> TablePlaces:
    """Places for n coordinates and m channels."""
    columns = 2 * n + FORCING_TERMS + m
    look = columns * 2 * LANES * m
    interval = look + columns * 2 * n
    acceleration = padded(interval + columns * 2 * n)
    now = acceleration + columns * padded(n + m)
    bound = now + 2 * m * padded(columns)
    return TablePlaces(0, look, interval, acceleration, now, bound, bound + m * padded(columns))


class _Space(NamedTuple):
    """Work space for the tables of eight bins at once: each of its numbers is a vector.

    Attributes
    ----------
    n, columns, width : int
        Coordinates, numbers of z, the same times 8.
    held : int
        Acceleration, and below it the second derivatives of the channels' displacements, (n + m, width).
    readings : int
        Reading, slope and its second derivative, at the ends of nine successive intervals, (9, 3, width).
    largest : int
        Largest fourth derivative of each reading (m, width).
    spare : int
        Two rows (2, width).
    one, twice : int
        Propagators (2n, width).
    terms : int
        Three successive terms (3, n, width) of a series.
    """

    own: np.ndarray
    n: int
    columns: int
    width: int
    held: int
    readings: int
    largest: int
    spare: int
    one: int
    twice: int
    terms: int


@njit(cache=True)
def _space_of(n, m):
    columns = 2 * n + FORCING_TERMS + m
    width = LANES * columns
    readings = (n + m) * width
    largest = readings + 3 * (LANES + 1) * width
    spare = largest + m * width
    one = spare + 2 * width
    twice = one + 2 * n * width
    terms = twice + 2 * n * width
    own = aligned(terms + 3 * n * width)
    return _Space(own, n, columns, width, 0, readings, largest, spare, one, twice, terms)


@part
def _fill(space, at, width, value):
    """Write a value (width,) times."""
    for i in range(width):
        put(space.own, at + i, value)


@leaf
def _short_propagator(space, duration, time, order):
    """Write the propagator ``one`` of (2) over a time for which ``order`` terms of the series suffice."""
    own, n, width, one = space.own, space.n, space.width, space.one
    size, forcing = n * width, 2 * n * LANES
    _fill(space, space.terms, 2 * size, 0.0)
    _fill(space, one, 2 * size, 0.0)
    for i in range(n):
        row = i * (width + LANES)
        _fill(space, space.terms + row, LANES, 1.0)
        _fill(space, space.terms + size + row + n * LANES, LANES, time)
        _fill(space, one + row, LANES, 1.0)
        _fill(space, one + row + n * LANES, LANES, time)
        _fill(space, one + size + row + n * LANES, LANES, 1.0)
    scale = 1.0
    for k in range(order - 1):
        older, old = space.terms + k % 3 * size, space.terms + (k + 1) % 3 * size
        new = space.terms + (k + 2) % 3 * size
        share = time * time * SHARES[k]
        next_terms_of_eight(own, space.held, older, old, width, n, (k + 1.0) / time, share, new)
        for i in range(n):
            row, term = space.held + i * width, new + i * width
            if k < FORCING_TERMS:
                binomial = share * scale
                for j in range(k, FORCING_TERMS):
                    add_rows(own, row + forcing + j * LANES, binomial, term + forcing + (j - k) * LANES, LANES)
                    binomial *= (j + 1.0) / (j + 1 - k)
            if k == 0:
                clearances = forcing + FORCING_TERMS * LANES
                add_rows(own, row + clearances, share, term + clearances, width - clearances)
        add_rows(own, new, 1.0, one, size)
        add_rows(own, new, (k + 2) / time, one + size, size)
        scale *= time / duration


@leaf
def _through(space, propagator, share, row, answer, rows):
    """Write adjacent rows over z one step earlier: each row times P.

    The powers of x become those of x + ``share``, the step over the duration of the bin; the clearances stay.
    """
    own, width, states = space.own, space.width, 2 * space.n
    multiply_eight(own, row, rows, propagator, width, states, answer)
    forcing, clearances = states * LANES, (states + FORCING_TERMS) * LANES
    for first in range(0, rows * width, width):
        given, written = row + first, answer + first
        for k in range(FORCING_TERMS):
            binomial = 1.0
            for c in range(k, -1, -1):
                add_rows(own, given + forcing + k * LANES, binomial, written + forcing + c * LANES, LANES)
                binomial *= share * c / (k - c + 1)
        add_rows(own, given + clearances, 1.0, written + clearances, width - clearances)


@leaf
def _derivative(space, duration, row, answer):
    """Write the time derivative of a row over z: row B, with z' = B z."""
    own, n = space.own, space.n
    multiply_eight(own, row + n * LANES, 1, space.held, space.width, n, answer)
    add_rows(own, row, 1.0, answer + n * LANES, n * LANES)
    forcing = 2 * n * LANES
    for k in range(1, FORCING_TERMS):
        add_rows(own, row + forcing + k * LANES, k / duration, answer + forcing + (k - 1) * LANES, LANES)


@leaf
def _from_anchor(space, anchor, row):
    """Let the columns of the clearances of a row count places from the anchor (n, m)."""
    for j in range(anchor.shape[1]):
        clearance = row + (2 * space.n + FORCING_TERMS + j) * LANES
        for i in range(space.n):
            add_rows(space.own, row + i * LANES, anchor[i, j], clearance, LANES)


@leaf
def _note_largest(space, anchor, row, largest):
    """Raise ``largest`` to the absolute values of a row, places from the anchor."""
    copy(space.own, row, space.spare, space.width)
    _from_anchor(space, anchor, space.spare)
    keep_largest(space.own, space.spare, largest, space.width)


@part
def _deal_row(space, row, table, at, length, count):
    """Write a row over z into the tables of the bins."""
    for c in range(0, space.columns, LANES):
        full = min(LANES, space.columns - c)
        deal(space.own, row + c * LANES, LANES, full, table, at + c, length, count, LANES)


@part
def _deal_columns(space, matrix, rows, lanes, table, at, length, count):
    """Write a matrix (rows, width) by columns, ``lanes`` apart, into the tables of the bins."""
    own, width = space.own, space.width
    for c in range(space.columns):
        for i in range(0, rows, LANES):
            place, full = at + c * lanes + i, min(LANES, rows - i)
            written = min(LANES, lanes - i)
            deal(own, matrix + i * width + c * LANES, width, full, table, place, length, count, written)


@leaf
def _put_channels(space, row, lag, anchor, s, duration, interval, count, table, at, length):
    """Fill ``ahead``, ``now`` and ``bound``: readings of the channels over a look, with contact set s.

    With z' = B z and the row e of a reading, its fourth derivative is e B^4 exp(B t) z. The row of that is computed
    at the ends of all intervals, and between them differs from the nearer of them by exp(B t), |t| up to half an
    interval, whose elements those of exp(|B| |t|) bound. Closed channels pull the state to where they just touch:
    places count from the anchor, so that what cancels does not count.

    Overwrites the acceleration.
    """
    own, n, width, columns = space.own, space.n, space.width, space.columns
    m, share = row.shape[0], interval / duration
    places = table_places(n, m)
    _fill(space, space.largest, m * width, 0.0)
    for j in range(m):
        largest, first = space.largest + j * width, space.readings
        slope, bend, then = first + width, first + 2 * width, first + 3 * width
        _fill(space, first, 6 * width, 0.0)
        for i in range(n):
            _fill(space, first + i * LANES, LANES, row[j, i])
            _fill(space, first + (n + i) * LANES, LANES, lag[s, j] * row[j, i])
        _derivative(space, duration, first, slope)
        _derivative(space, duration, slope, then)
        _derivative(space, duration, then, then + width)
        _derivative(space, duration, then + width, bend)
        _note_largest(space, anchor[s], bend, largest)
        now = at + places.now + 2 * j * padded(columns)
        _deal_row(space, first, table, now, length, count)
        _deal_row(space, slope, table, now + padded(columns), length, count)
        for k in range(LANES):
            given = first + 3 * k * width
            _fill(space, given + 3 * width, 3 * width, 0.0)
            _through(space, space.one, share, given, given + 3 * width, np.int64(3))
            _note_largest(space, anchor[s], given + 5 * width, largest)
        for c in range(columns):
            for q in range(2):
                place = at + places.ahead + ((c * m + j) * 2 + q) * LANES
                ends = then + q * width + c * LANES
                deal(own, ends, 3 * width, LANES, table, place, length, count, LANES)
    for i in range(n):
        _from_anchor(space, anchor[s], space.held + i * width)
    keep_largest(own, space.held, space.held, n * width)
    for j in range(m):
        largest, term, derived = space.largest + j * width, space.spare, space.spare + width
        copy(own, largest, term, width)
        share = 1.0
        for k in range(1, BOUND_TERMS):
            _derivative(space, duration, term, derived)
            share *= 0.5 * interval / k
            add_rows(own, derived, share, largest, width)
            term, derived = derived, term
        # the terms left out shrink at least by half each
        add_rows(own, term, share, largest, width)
        _deal_row(space, largest, table, at + places.bound + j * padded(columns), length, count)


@leaf
def _put_acceleration(space, free, forcing, push, rate, row, s, group, groups):
    """Sum the accelerations (1) of eight bins at a rate of the drive, and those of the channels."""
    m, n = row.shape
    own, width = space.own, space.width
    for i in range(n):
        held, at = space.held + i * width, (group * n + i) * LANES
        pushed = (s * groups * n + group * n + i) * (2 * n + m) * LANES
        for w in range(2 * n * LANES):
            place, power = at * 2 * n + w, groups * n * 2 * n * LANES
            total = item(free, place) + rate * item(free, place + power)
            total += rate * rate * item(free, place + 2 * power)
            put(own, held + w, total + item(push, pushed + w))
        for w in range(FORCING_TERMS * LANES):
            place, power = at * FORCING_TERMS + w, groups * n * FORCING_TERMS * LANES
            put(own, held + 2 * n * LANES + w, item(forcing, place) + rate * rate * item(forcing, place + power))
        for w in range(m * LANES):
            put(own, held + (2 * n + FORCING_TERMS) * LANES + w, item(push, pushed + 2 * n * LANES + w))
    for j in range(m):
        for w in range(width):
            total = 0.0
            for i in range(n):
                total += row[j, i] * item(own, space.held + i * width + w)
            put(own, space.held + (n + j) * width + w, total)


@njit(cache=True, nogil=True)
def tables(free, forcing, push, bins, rate, row, lag, anchor, duration, steps, order):
    """Tables of every contact set and bin.

    Parameters
    ----------
    free : (3, groups, n, 2n, 8)
        Accelerations per unit p and p' without contact, by powers of the rate, of eight bins side by side.
    forcing : (2, groups, n, 4, 8)
        Accelerations per unit 1, x, x^2, x^3, and per squared rate.
    push : (sets, groups, n, 2n + m, 8)
        What closed contacts add per unit p, p' and clearance.
    bins
        Number of bins; the last ones of a group that is not full are left out.
    rate
        Of the drive [rad/s].
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
    sets, groups = push.shape[:2]
    m, n = row.shape
    interval = duration / (LANES * steps)
    places = table_places(n, m)
    length = places.length
    # memory as it comes: every number that counts is written
    table, space = unset(sets * bins * length), _space_of(n, m)
    free, forcing, push = free.ravel(), forcing.ravel(), push.ravel()
    for s in range(sets):
        for group in range(groups):
            first = LANES * group
            at, count = (s * bins + first) * length, min(LANES, bins - first)
            _put_acceleration(space, free, forcing, push, rate, row, s, group, groups)
            _deal_columns(space, space.held, n + m, padded(n + m), table, at + places.acceleration, length, count)
            _short_propagator(space, duration, interval, order)
            _deal_columns(space, space.one, 2 * n, 2 * n, table, at + places.interval, length, count)
            _put_channels(space, row, lag, anchor, s, duration, interval, count, table, at, length)
            before, after, share = space.one, space.twice, interval / duration
            for _ in range(3):
                _through(space, before, share, before, after, 2 * n)
                before, after, share = after, before, 2.0 * share
            _deal_columns(space, before, 2 * n, 2 * n, table, at + places.look, length, count)
    return table
