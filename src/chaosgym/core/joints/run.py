"""One run of a machine of a few modes and several joints: its work space, and how coordinates move within a set."""

from typing import NamedTuple

import numpy as np
from numba import njit

from chaosgym.core.joints.tables import (
    AHEAD,
    BLOCKS,
    BOUNDS,
    CONSTANTS,
    DEGREE,
    DRIFTING,
    DRIFTS,
    E_RATE,
    FINE,
    FINER,
    FROM,
    GENERATOR,
    HARMONICS,
    JOINTS,
    MODES,
    NOW_ROWS,
    PLACES,
    SHORTEST,
    SIZES,
    STATES,
    TAYLOR,
    TO,
    TURN,
    WIDTH,
    E,
    V,
    Y,
)
from chaosgym.core.kernel import leaf, part
from chaosgym.core.lanes import LANES, add_columns, aligned, dot, dot_of_sizes, padded, sample, turn, turn_and_expand
from chaosgym.core.propagator import exponential

UPPER_GAP, LOWER_GAP, UPPER_STIFFNESS, LOWER_STIFFNESS, UPPER_LAG, LOWER_LAG = range(6)
"""Numbers of a joint: distance [m] of its surfaces from where it rests; spring [N/m]; damper over spring [s]."""

SIDE, AWAKE, BASE, RATE, BEND, READING_REST, READING_RATE, READING_BEND, FOURTH = range(6, 15)
"""More of them: the surface that presses, +1 or -1, or 0; 1 unless the joint surely reaches no surface in this set;
where it rests [m]; first and second derivative of a drift; what the drift adds to the reading, and to its derivatives;
bound of the reading's fourth derivative."""

NUMBERS = 16

READINGS = 4 * LANES
"""Numbers of what a joint reads: seven to spare, now, after 1 to 8 intervals; and as many rates."""

NOW, RATES = LANES - 1, 2 * LANES

U, SPARE, STATE, JOINT, READING, SERIES, TOTALS, OWN = range(PLACES, PLACES + 8)
"""Where coordinates and the constants after them, room for others, the state with what follows it, ``NUMBERS`` and
``READINGS`` of the joints, their Taylor series and room for eight numbers begin in ``own``; its length."""


class JointRun(NamedTuple):
    """All that a run reads, and its work space.

    Attributes
    ----------
    tables : (...,)
        Rows of ``joints.tables`` one after the other.
    rows : (radix^m,) int
        Where the row of each set of pressed surfaces begins, -1 where there is none yet.
    radix : (m,) int
        3 where the surfaces of a joint differ in spring or damper, else 2.
    shape : (m, n)
        Displacement of each joint per unit modal coordinate.
    stops, stiffness, damping : (m, 2)
        Position [m], infinite where there is none, spring and damper of the upper and the lower surface.
    weights : (n,)
        Of displacements in ``orthonormalise``.
    own : (...,)
        Work space.
    at : (...,) int
        Sizes, and what lies where in a row and in ``own``.
    period : float
        Of the cycle [s].
    resolution : float
        Error of an event's instant, in shortest intervals.
    """

    tables: np.ndarray
    rows: np.ndarray
    radix: np.ndarray
    shape: np.ndarray
    stops: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    weights: np.ndarray
    own: np.ndarray
    at: np.ndarray
    period: float
    resolution: float


@njit(cache=True, nogil=True)
def work_space(layout):
    """``JointRun.at``, the ``layout`` (PLACES,) of a row and then that of the work space."""
    at = np.zeros(OWN + 1, np.int64)
    at[:PLACES] = layout
    m, width = at[JOINTS], 2 * at[WIDTH]
    at[U] = 0
    at[SPARE] = width + padded(1 + m)
    at[STATE] = 2 * at[SPARE]
    at[JOINT] = at[STATE] + at[STATES] + padded(2 * at[HARMONICS] + 1 + m)
    at[READING] = at[JOINT] + NUMBERS * m
    at[SERIES] = at[READING] + READINGS * m
    at[TOTALS] = at[SERIES] + (DEGREE + 1) * m
    at[OWN] = at[TOTALS] + LANES
    return at


@njit(cache=True, nogil=True)
def new_space(at):
    """Zeros for ``JointRun.own``."""
    return aligned(at[OWN])


@part
def known(run, j, which):
    """One of the ``NUMBERS`` of joint j."""
    return run.own[run.at[JOINT] + j * NUMBERS + which]


@part
def gap_of(run, j, side):
    """How far the surface on a side of joint j is from where the joint rests, towards that side [m]."""
    return known(run, j, UPPER_GAP if side > 0.0 else LOWER_GAP)


@part
def lag_of(run, j, side):
    """Damper over spring [s] of the surface on a side of joint j."""
    return known(run, j, UPPER_LAG if side > 0.0 else LOWER_LAG)


@part
def spring_of(run, j, side):
    """Spring [N/m] of the surface on a side of joint j."""
    return known(run, j, UPPER_STIFFNESS if side > 0.0 else LOWER_STIFFNESS)


@leaf
def prepare(run):
    """Write what is known of the joints whatever presses."""
    for j in range(run.at[JOINTS]):
        own = run.own[run.at[JOINT] + j * NUMBERS : run.at[JOINT] + (j + 1) * NUMBERS]
        for which in range(2):
            own[UPPER_STIFFNESS + which] = run.stiffness[j, which]
            own[UPPER_LAG + which] = run.damping[j, which] / run.stiffness[j, which]


@leaf
def joint_motion(run, state, j):
    """Displacement and velocity of joint j in a state (2n,)."""
    n = run.shape.shape[1]
    x, v = 0.0, 0.0
    for i in range(n):
        x += run.shape[j, i] * state[i]
        v += run.shape[j, i] * state[n + i]
    return x, v


@leaf
def find_sides(run, state):
    """Write which surface of every joint presses in a state (2n,)."""
    for j in range(run.at[JOINTS]):
        x, v = joint_motion(run, state, j)
        side = 0.0
        if x > run.stops[j, 0] and x - run.stops[j, 0] + known(run, j, UPPER_LAG) * v > 0.0:
            side = 1.0
        elif x < run.stops[j, 1] and run.stops[j, 1] - x - known(run, j, LOWER_LAG) * v > 0.0:
            side = -1.0
        run.own[run.at[JOINT] + j * NUMBERS + SIDE] = side


@leaf
def pressed_set(run):
    """Number of the set of surfaces that press: a digit for each joint."""
    code, place = 0, 1
    for j in range(run.at[JOINTS]):
        side = known(run, j, SIDE)
        if side > 0.0:
            code += place
        elif side < 0.0:
            code += place * (run.radix[j] - 1)
        place *= run.radix[j]
    return code


@leaf
def enter(run, row):
    """Set u, and what is known of the joints, to the state in a set; the state is followed by cosines and sines."""
    own, at, tables = run.own, run.at, run.tables
    n, harmonics, m, width = at[MODES], at[HARMONICS], at[JOINTS], 2 * at[WIDTH]
    more = at[STATE] + 2 * n + 2 * harmonics
    own[more] = 1.0
    for j in range(m):
        side = known(run, j, SIDE)
        own[more + 1 + j] = 0.0 if side == 0.0 else run.stops[j, 0 if side > 0.0 else 1]
    add_columns(tables, row + at[TO], width, 2 * at[BLOCKS] + 1 + m, own, at[STATE], own, at[U], LANES)
    for c in range(1 + m):
        own[at[U] + width + c] = own[more + c]
    for j in range(m):
        _settle(run, row, j)


@leaf
def _settle(run, row, j):
    """Write the numbers of joint j that depend on the set; u and the positions of the pressed surfaces are known."""
    own, at, tables = run.own, run.at, run.tables
    m, width, first = at[JOINTS], 2 * at[WIDTH], at[JOINT] + j * NUMBERS
    more, side, rest = at[U] + width, known(run, j, SIDE), 0.0
    for c in range(1 + m):
        rest += tables[row + at[CONSTANTS] + j * (1 + m) + c] * own[more + c]
    if side == 0.0:
        own[first + UPPER_GAP], own[first + LOWER_GAP] = run.stops[j, 0] - rest, rest - run.stops[j, 1]
        own[first + BASE] = rest
    else:
        own[first + (UPPER_GAP if side > 0.0 else LOWER_GAP)] = -side * rest
        own[first + BASE] = own[more + 1 + j] + rest
    for k in range(RATE, READING_BEND + 1):
        own[first + k] = 0.0
    own[first + AWAKE] = 1.0
    rows = row + at[NOW_ROWS] + 4 * j * width
    if tables[row + DRIFTING] != 0.0:
        for lane in range(width):
            drift, bend = drift_of(run, row, lane)
            own[first + RATE] += tables[rows + Y * width + lane] * drift
            own[first + BEND] += tables[rows + Y * width + lane] * bend
            own[first + READING_RATE] += tables[rows + E * width + lane] * drift
            own[first + READING_BEND] += tables[rows + E * width + lane] * bend
        own[first + READING_REST] = 0.0 if side == 0.0 else lag_of(run, j, side) * own[first + RATE]
    elif side == 0.0:
        reach = dot_of_sizes(tables, row + at[SIZES] + j * width, own, at[U], width)
        if reach < own[first + UPPER_GAP] and reach < own[first + LOWER_GAP]:
            own[first + AWAKE] = 0.0


@leaf
def drift_of(run, row, lane):
    """Rate of a coordinate without a position of rest, and the derivative of the rate."""
    own, at, tables = run.own, run.at, run.tables
    width, block, drift, bend = at[WIDTH], lane % at[WIDTH], 0.0, 0.0
    pair = row + at[GENERATOR] + (2 * width if lane >= width else 0) + block
    for c in range(1 + at[JOINTS]):
        rates, factor = row + at[DRIFTS] + c * 2 * width, own[at[U] + 2 * width + c]
        drift += tables[rates + lane] * factor
        bend += (tables[pair] * tables[rates + block] + tables[pair + width] * tables[rates + width + block]) * factor
    return drift, bend


@leaf
def leave(run, row):
    """Write the state of u in a set, cosines and sines behind it."""
    own, at = run.own, run.at
    n, harmonics, width = at[MODES], at[HARMONICS], at[WIDTH]
    count = 2 * width + 1 + at[JOINTS]
    add_columns(run.tables, row + at[FROM], at[STATES], count, own, at[U], own, at[STATE], LANES)
    for h in range(harmonics):
        own[at[STATE] + 2 * n + h] = own[at[U] + n + h]
        own[at[STATE] + 2 * n + harmonics + h] = own[at[U] + width + n + h]


@leaf
def read_now(run, row):
    """Write what every joint reads in u."""
    own, at = run.own, run.at
    width = 2 * at[WIDTH]
    for j in range(at[JOINTS]):
        rows, place = row + at[NOW_ROWS] + 4 * j * width, at[READING] + j * READINGS + NOW
        own[place] = dot(run.tables, rows + E * width, own, at[U], width) + known(run, j, READING_REST)
        own[place + RATES] = dot(run.tables, rows + E_RATE * width, own, at[U], width) + known(run, j, READING_RATE)


@part
def look(run, row, level, h):
    """Write what every joint that is awake reads after 1 to 8 intervals of a level, of length h."""
    own, at = run.own, run.at
    blocks, m = at[BLOCKS], at[JOINTS]
    for j in range(m):
        if known(run, j, AWAKE) == 0.0:
            continue
        ahead, place = row + at[AHEAD] + (level * m + j) * 4 * blocks * LANES, at[READING] + j * READINGS + NOW + 1
        sample(run.tables, ahead, own, 0, at[U], blocks, at[WIDTH], 0, 1.0, place, place + RATES)
        if run.tables[row + DRIFTING] != 0.0:
            rest, rate, bend = known(run, j, READING_REST), known(run, j, READING_RATE), known(run, j, READING_BEND)
            for i in range(LANES):
                time = (i + 1) * h
                own[place + i] += rest + time * (rate + 0.5 * time * bend)
                own[place + RATES + i] += rate + time * bend


@part
def bound_fourth(run, row):
    """Write bounds of the fourth derivatives of what the joints read, from now on."""
    own, at = run.own, run.at
    width = 2 * at[WIDTH]
    for j in range(at[JOINTS]):
        if known(run, j, AWAKE) != 0.0:
            bound = dot_of_sizes(run.tables, row + at[BOUNDS] + j * width, own, at[U], width)
            own[at[JOINT] + j * NUMBERS + FOURTH] = bound


@part
def read_after(run, intervals):
    """Take over what the joints read after some intervals of a look as what they read now."""
    own = run.own
    for j in range(run.at[JOINTS]):
        place = run.at[READING] + j * READINGS + NOW
        own[place], own[place + RATES] = own[place + intervals], own[place + RATES + intervals]


@leaf
def add_drift(run, row, time, out):
    """Add to coordinates at ``out`` how far those without a position of rest drift in a time."""
    if run.tables[row + DRIFTING] != 0.0:
        for lane in range(2 * run.at[WIDTH]):
            drift, bend = drift_of(run, row, lane)
            run.own[out + lane] += time * (drift + 0.5 * time * bend)


@part
def jump(run, row, level, intervals, h):
    """Move u by 1 to 8 intervals of a level, of length h."""
    at = run.at
    entries = row + at[TURN] + (LANES * level + intervals - 1) * 4 * at[WIDTH]
    turn(run.tables, entries, run.own, at[U], at[U], at[WIDTH])
    add_drift(run, row, intervals * h, at[U])


@part
def place(run, row, time):
    """Move u by a time within the shortest interval."""
    at = run.at
    piece = run.tables[row + SHORTEST] / FINE
    instant = min(max(0, int(time / piece + 0.5)), FINE)
    entries = row + at[FINER] + instant * 4 * at[WIDTH]
    rest = time - instant * piece
    turn_and_expand(run.tables, entries, row + at[GENERATOR], run.own, at[U], rest, at[U], at[WIDTH])
    add_drift(run, row, time, at[U])


@leaf
def travel(run, row, time, u, out):
    """Put coordinates after any time at ``out``, which may be u."""
    own, at, tables = run.own, run.at, run.tables
    width, generator = at[WIDTH], row + at[GENERATOR]
    for j in range(at[BLOCKS]):
        k = generator + j
        p, q, r, s = tables[k], tables[k + width], tables[k + 2 * width], tables[k + 3 * width]
        e11, e12, e21, e22 = exponential(p, q, r, s, time)
        first, second = own[u + j], own[u + width + j]
        own[out + j] = e11 * first + e12 * second
        own[out + width + j] = e21 * first + e22 * second


@leaf
def expand(run, row):
    """Write the Taylor series of the displacement of every joint that is awake, from where it rests, of time in s."""
    own, at = run.own, run.at
    blocks = at[BLOCKS]
    for j in range(at[JOINTS]):
        if known(run, j, AWAKE) == 0.0:
            continue
        series, first = at[SERIES] + j * (DEGREE + 1), row + at[TAYLOR] + 4 * j * blocks * LANES
        sample(run.tables, first, own, 0, at[U], blocks, at[WIDTH], 0, 1.0, series, series + LANES)
        own[series + 1] += known(run, j, RATE)
        own[series + 2] += 0.5 * known(run, j, BEND)


@leaf
def write_samples(run, row, time, span, sample, history):
    """Write displacement, velocity and force (positive from the upper surface) of all joints at the instants in a span.

    ``history`` (samples, 3m) is that of the cycle, ``sample`` the next one; returns the next one after the span.
    """
    own, at, samples = run.own, run.at, history.shape[0]
    spare, width = at[SPARE], 2 * at[WIDTH]
    while sample < samples and sample * run.period < (time + span) * samples:
        since = max(0.0, sample * run.period / samples - time)
        travel(run, row, since, at[U], spare)
        add_drift(run, row, since, spare)
        for j in range(at[JOINTS]):
            rows, side = row + at[NOW_ROWS] + 4 * j * width, known(run, j, SIDE)
            history[sample, 3 * j] = dot(run.tables, rows + Y * width, own, spare, width) + known(run, j, BASE)
            speed = dot(run.tables, rows + V * width, own, spare, width)
            history[sample, 3 * j + 1] = speed + known(run, j, RATE)
            history[sample, 3 * j + 2] = 0.0
            if side != 0.0:
                reading = dot(run.tables, rows + E * width, own, spare, width) + known(run, j, READING_REST)
                depth = side * reading - gap_of(run, j, side)
                history[sample, 3 * j + 2] = side * max(0.0, spring_of(run, j, side) * depth)
        sample += 1
    return sample
