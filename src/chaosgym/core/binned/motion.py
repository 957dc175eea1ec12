"""State of a mechanism's motion, readings of its channels, and steps by tables and by series."""

from typing import NamedTuple

import numpy as np

from chaosgym.core.binned.lanes import add_some_columns, copy, dot_of_distances, sum_series
from chaosgym.core.binned.model import FORCING_TERMS
from chaosgym.core.binned.series import expand, put_time
from chaosgym.core.binned.tables import table_places
from chaosgym.core.kernel import leaf, njit, part
from chaosgym.core.lanes import LANES, add_columns, aligned, dot, padded

READINGS = 4 * LANES
"""Numbers kept of a channel: eight readings that serve as work space and for now, eight ahead, and as many slopes."""

SLOPES = 2 * LANES
"""How far the slope of a channel lies behind its reading."""

SPARE, NOW = np.int64(0), np.int64(LANES - 1)
"""Which of a channel's readings are those of any state, and of now; those after k intervals are ``NOW`` + k."""


GAP, STIFFNESS, LAG, TWO_SIDED, ALONG, UP, SIDEWAYS, REACH, SURFACE = range(9)
"""What is known of a channel: clearance [m], stiffness [N/m], damping over stiffness [s], 1 if it has two surfaces, and
the reading of the model with its length; how many numbers these are."""


class Motion(NamedTuple):
    """Rows of ``TablePlaces``, state and work space of ``places``, and how many coordinates and channels there are.

    It is handed on by value: the fewer its fields the faster.
    """

    table: np.ndarray
    own: np.ndarray
    n: int
    m: int


class Places(NamedTuple):
    """Where what belongs to n coordinates and m channels begins, and how long it is.

    Attributes
    ----------
    columns, width, states, lanes : int
        Numbers of z, the same padded, 2n padded, n + m padded.
    z, rest : int
        The augmented state (width,) of ``tables``; the part of its places that the anchors of closed channels
        make up.
    sampled : int
        Another state (width,).
    moved : int
        State (states,) after a step.
    readings : int
        ``READINGS`` numbers of each channel.
    totals : int
        Of ``add_tops``.
    surfaces : int
        ``SURFACE`` numbers of each channel.
    sides, lags : int
        Closed side of each channel (m,), +1 or -1, or 0; damping over stiffness of the closed ones, 0 for the others.
    fourth : int
        Bounds (m,) of the readings' fourth derivatives.
    factors, loads, derived, series : int
        Of ``expand`` and ``sum_series``: (4 + m,), (5, lanes), (3, lanes), (order + 1, lanes).
    """

    columns: int
    width: int
    states: int
    lanes: int
    z: int
    rest: int
    sampled: int
    moved: int
    readings: int
    totals: int
    surfaces: int
    sides: int
    lags: int
    fourth: int
    factors: int
    loads: int
    derived: int
    series: int


@part
def places(n, m):
    """Places for n coordinates and m channels."""
    columns = 2 * n + FORCING_TERMS + m
    width, states, lanes, channels = padded(columns), padded(2 * n), padded(n + m), padded(m)
    readings = 3 * width + states
    totals = readings + READINGS * m
    surfaces = totals + LANES
    sides = surfaces + SURFACE * m
    lags = sides + channels
    fourth = lags + channels
    factors = fourth + channels
    loads = factors + padded(FORCING_TERMS + m)
    derived = loads + (FORCING_TERMS + 1) * lanes
    series = derived + 3 * lanes
    return Places(
        columns,
        width,
        states,
        lanes,
        0,
        width,
        2 * width,
        3 * width,
        readings,
        totals,
        surfaces,
        sides,
        lags,
        fourth,
        factors,
        loads,
        derived,
        series,
    )


@njit(cache=True)
def motion_of(model):
    """Space for a motion."""
    m, n = model.row.shape
    here = places(n, m)
    own = aligned(here.series + (model.order + 1) * here.lanes)
    for j in range(m):
        surface = own[here.surfaces + j * SURFACE : here.surfaces + (j + 1) * SURFACE]
        surface[GAP], surface[STIFFNESS] = model.gap[j], model.stiffness[j]
        surface[LAG] = model.damping[j] / model.stiffness[j]
        surface[TWO_SIDED] = 1.0 if model.two_sided[j] else 0.0
        for k in range(REACH - ALONG):
            surface[ALONG + k] = model.reading[j, k]
        surface[REACH] = model.reach[j]
    return Motion(model.table, own, n, m)


@part
def known(motion, j, what):
    """One of the ``SURFACE`` numbers of channel j."""
    return motion.own[places(motion.n, motion.m).surfaces + j * SURFACE + what]


@part
def side_of(motion, j):
    """Closed side of channel j, or 0."""
    return motion.own[places(motion.n, motion.m).sides + j]


@part
def presses(motion, j, side, y, v):
    """True if channel j at displacement y and velocity v presses on ``side``."""
    depth = side * y - known(motion, j, GAP)
    return depth > 0.0 and depth + known(motion, j, LAG) * side * v > 0.0


@leaf
def find_sides(motion, row):
    """Write which side of every channel is closed in z."""
    own, n, here = motion.own, motion.n, places(motion.n, motion.m)
    for j in range(motion.m):
        y, v = 0.0, 0.0
        for i in range(n):
            y += row[j, i] * own[here.z + i]
            v += row[j, i] * own[here.z + n + i]
        side = 0.0
        if presses(motion, j, 1.0, y, v):
            side = 1.0
        elif known(motion, j, TWO_SIDED) != 0.0 and presses(motion, j, -1.0, y, v):
            side = -1.0
        own[here.sides + j] = side


@leaf
def contact_set(motion, radix):
    """Index of the matrices of a contact set: closed sides as digits."""
    index, place = 0, 1
    for j in range(motion.m):
        side = side_of(motion, j)
        if side > 0.0:
            index += place
        elif side < 0.0:
            index += place * (radix - 1)
        place *= radix
    return index


@leaf
def put_sides(motion, anchor):
    """Write what depends on a contact set with an ``anchor`` (n, m): lags, clearances of z, ``rest`` of the places."""
    own, here = motion.own, places(motion.n, motion.m)
    clearances = here.z + 2 * motion.n + FORCING_TERMS
    for j in range(motion.m):
        side = side_of(motion, j)
        own[clearances + j] = side * known(motion, j, GAP)
        own[here.lags + j] = known(motion, j, LAG) if side != 0.0 else 0.0
    for i in range(motion.n):
        own[here.rest + i] = 0.0
        for j in range(motion.m):
            own[here.rest + i] += anchor[i, j] * own[clearances + j]


@leaf
def put_stiffness(motion, stiffness, share):
    """Write the stiffness of every channel in a bin: its ``share`` (m,) of all. Its lag stays as it is."""
    for j in range(motion.m):
        motion.own[places(motion.n, motion.m).surfaces + j * SURFACE + STIFFNESS] = stiffness[j] * share[j]


@part
def read_now(motion, at):
    """Write what every channel reads in z; the row of tables of its bin and contact set begins at ``at``."""
    own, here = motion.own, places(motion.n, motion.m)
    rows = at + table_places(motion.n, motion.m).now
    for j in range(motion.m):
        place, row = here.readings + j * READINGS + NOW, rows + 2 * j * here.width
        own[place] = dot(motion.table, row, own, here.z, here.width)
        own[place + SLOPES] = dot(motion.table, row + here.width, own, here.z, here.width)


@part
def apply(motion, columns, width, z, out, stride):
    """Write the sum of columns (columns, width) of the table times a state, as in ``add_columns``."""
    own, n, m = motion.own, motion.n, motion.m
    if own[z + 2 * n + 1] == 0.0:
        # at the beginning of a bin, where the powers of x are zero
        add_some_columns(motion.table, columns, width, 2 * n + 1, FORCING_TERMS - 1, m, own, z, own, out, stride)
    else:
        add_columns(motion.table, columns, width, 2 * n + FORCING_TERMS + m, own, z, own, out, stride)


@part
def look_ahead(motion, at):
    """Write what every channel reads after 1 to 8 intervals."""
    here = places(motion.n, motion.m)
    apply(motion, at, 2 * LANES * motion.m, here.z, here.readings + NOW + 1, 2 * LANES)


@part
def bound_fourth(motion, at):
    """Write bounds of the readings' fourth derivatives over a look from z on."""
    own, here = motion.own, places(motion.n, motion.m)
    rows = at + table_places(motion.n, motion.m).bound
    for j in range(motion.m):
        own[here.fourth + j] = dot_of_distances(motion.table, rows + j * here.width, own, here.z, here.rest, here.width)


@part
def read_after(motion, intervals):
    """Set the current readings of the channels to those after some intervals of a look."""
    own, first = motion.own, places(motion.n, motion.m).readings + NOW
    for j in range(motion.m):
        place = first + j * READINGS
        own[place], own[place + SLOPES] = own[place + intervals], own[place + SLOPES + intervals]


@part
def step(motion, propagator, z, x):
    """Move a state by a step whose propagator begins at a place in the table; ``x`` is the share of the bin then."""
    own, n, here = motion.own, motion.n, places(motion.n, motion.m)
    apply(motion, propagator, 2 * n, z, here.moved, LANES)
    copy(own, here.moved, z, 2 * n)
    put_time(own, z + 2 * n, x)


@part
def move(motion, at, z, intervals, x, share):
    """Move a state at share ``x`` of the bin by 1 to 8 intervals, each of which is ``share`` of it."""
    tables = table_places(motion.n, motion.m)
    steps, propagator, length = (
        (1, at + tables.look, LANES) if intervals == LANES else (intervals, at + tables.interval, 1)
    )
    for k in range(steps):
        step(motion, propagator, z, x + (k + 1) * length * share)


@leaf
def expand_from(motion, at, row, z, duration, last):
    """Expand coordinates and channels (``row``) about a state of a bin of some duration."""
    own, n, m, here = motion.own, motion.n, motion.m, places(motion.n, motion.m)
    for j in range(m):
        y, v = 0.0, 0.0
        for i in range(n):
            y += row[j, i] * own[z + i]
            v += row[j, i] * own[z + n + i]
        own[here.series + n + j], own[here.series + here.lanes + n + j] = y, v
    a = at + table_places(n, m).acceleration
    expand(motion.table, a, own, z, n, m, here.lanes, duration, last, here.factors, here.loads, here.series)


@leaf
def evaluate(motion, last, time, which):
    """Evaluate the series at a time, and write what every channel reads there as one of its readings."""
    own, here = motion.own, places(motion.n, motion.m)
    sum_series(own, here.series, here.lanes, last, time, own, here.derived, here.lanes)
    for j in range(motion.m):
        value, place = here.derived + motion.n + j, here.readings + j * READINGS + which
        lag = own[here.lags + j]
        own[place] = own[value] + lag * own[value + here.lanes]
        own[place + SLOPES] = own[value + here.lanes] + lag * own[value + 2 * here.lanes]


@part
def put_evaluated(motion, z):
    """Take over the coordinates of ``evaluate`` into a state."""
    own, n, here = motion.own, motion.n, places(motion.n, motion.m)
    copy(own, here.derived, z, n)
    copy(own, here.derived + here.lanes, z + n, n)
