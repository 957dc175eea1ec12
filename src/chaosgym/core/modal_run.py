"""One run of a machine of a few modes: what its tables become at one speed, force and gap, and how coordinates move.

Modal coordinates u (W,) are those of ``lanes``: first and second coordinate of each block, then the drive's harmonics.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from chaosgym.core.event_tables import (
    FINE,
    SHOWN,
    SHOWN_RATE,
    A,
    V,
    X,
    make_tables,
    shortest_intervals,
    with_drive,
)
from chaosgym.core.kernel import inlined, leaf
from chaosgym.core.lanes import combine, dot, dot_of_sizes, sample, turn, turn_and_expand
from chaosgym.core.modal_model import FREE, LOAD, LOWER_STOP, STOP, UPPER_STOP
from chaosgym.core.propagator import block

SHOWN_BEND, POSITION, STIFFNESS, DAMPING = 5, 6, 7, 8
"""Columns of ``Run.numbers`` after the rows of ``now``: rate of SHOWN_RATE; position, spring, damper of the stop."""

REST, DRIFT, BEND, INTO, BACK = 0, 1, 2, 3, 4
"""Rows of ``Run.constants``."""

VALUES, SLOPES, SERIES, FORCE = 0, 1, 2, 3
"""Rows of ``Run.space``."""


class Run(NamedTuple):
    """All that a run reads, and its work space.

    Attributes
    ----------
    ahead, turn, taylor, switch : arrays
        As in ``Tables``; with ``driven_`` in front, as in ``Drive``.
    shortest, fine, generator : arrays
        As in ``Tables``.
    now, bounds, levels : arrays
        As in ``Drive``.
    pressed : (3,) int
        Regime of FREE, UPPER_STOP and LOWER_STOP.
    constants : (3, 5, 2L)
        Of the same three, in modal coordinates: position of rest; rate of the coordinates that have none, and half of
        its own rate; constants of the change from FREE to a stop and back.
    numbers : (3, 9)
        Of the same three: what to add to what coordinates show, by row of ``now``, and the columns named above.
    u, spare : (W,)
        Modal coordinates, and room for others.
    space : (4, 16)
        What a regime shows, and its rate, now (7) and at eight instants ahead (8 to 15); Taylor coefficients of it, and
        of the force of a stop that does not press.
    period, omega : float
        Of the cycle [s], [rad/s].
    resolution : float
        Error of an event's instant, in shortest intervals.
    drifts : float
        1 if a coordinate has no position of rest, else 0.
    """

    ahead: np.ndarray
    turn: np.ndarray
    taylor: np.ndarray
    switch: np.ndarray
    driven_ahead: np.ndarray
    driven_turn: np.ndarray
    driven_taylor: np.ndarray
    driven_switch: np.ndarray
    shortest: np.ndarray
    fine: np.ndarray
    generator: np.ndarray
    now: np.ndarray
    bounds: np.ndarray
    levels: np.ndarray
    pressed: np.ndarray
    constants: np.ndarray
    numbers: np.ndarray
    u: np.ndarray
    spare: np.ndarray
    space: np.ndarray
    period: float
    omega: float
    resolution: float
    drifts: float


@njit(cache=True)
def make_run(model, step_phase, event_tolerance):
    """Run of a model, and the steady response (R, 2n, 2H) to its drive.

    Tables are made anew if the model's are for another ``step_phase`` or too slow for the drive."""
    omega = 2.0 * math.pi * model.excitation_frequency
    regimes = model.regimes
    count, harmonics = regimes.fastest.shape[0], model.drive.shape[1]
    stiffness, damping = np.zeros(count), np.zeros(count)
    for stop in (UPPER_STOP, LOWER_STOP):
        stiffness[model.pressed[stop]] = model.contact_stiffness[stop - 1]
        damping[model.pressed[stop]] = model.contact_damping[stop - 1]
    tables = model.tables
    if tables.step_phase != step_phase or np.max(tables.shortest) * harmonics * omega > step_phase:
        shortest = shortest_intervals(regimes, step_phase, harmonics * omega)
        tables = make_tables(regimes, stiffness, damping, step_phase, shortest)
    forces = model.drive[0] + omega * omega * model.drive[1]
    drive = with_drive(tables, regimes, stiffness, damping, forces, omega)
    width, lanes = drive.now.shape[2], tables.turn.shape[4]
    constants, numbers = np.zeros((3, 5, 2 * lanes)), np.zeros((3, 9))
    drifts = _settle(model, tables.switch, constants, numbers)
    run = Run(
        tables.ahead,
        tables.turn,
        tables.taylor,
        tables.switch,
        drive.ahead,
        drive.turn,
        drive.taylor,
        drive.switch,
        tables.shortest,
        tables.fine,
        tables.generator,
        drive.now,
        drive.bounds,
        drive.levels,
        model.pressed,
        constants,
        numbers,
        np.zeros(width),
        np.zeros(width),
        np.zeros((4, 16)),
        1.0 / model.excitation_frequency,
        omega,
        event_tolerance / step_phase,
        drifts,
    )
    return run, drive.steady


@njit(cache=True)
def _settle(model, switch, constants, numbers):
    """Fill ``constants`` and ``numbers``; 1.0 if a coordinate has no position of rest, else 0.0."""
    n, lanes = model.tip_shape.shape[0], switch.shape[4] // 2
    turned, drifts = np.empty(2 * n), 0.0
    for g in range(3):
        r = model.pressed[g]
        stop = 0.0 if g == FREE else model.stops[g - 1]
        numbers[g, POSITION] = stop
        if not math.isfinite(stop):
            continue
        output, generator = model.regimes.output[r], model.regimes.generator[r]
        rest = stop * model.rest[r, STOP] + model.rest[r, LOAD]
        drift = stop * model.drift[r, STOP] + model.drift[r, LOAD]
        for j in range(n):
            turned[j] = generator[0, j] * drift[j] + generator[1, j] * drift[n + j]
            turned[n + j] = generator[2, j] * drift[j] + generator[3, j] * drift[n + j]
        tip = numbers[g]
        for i in range(2 * n):
            lane = (i // n) * lanes + i % n
            constants[g, REST, lane], constants[g, DRIFT, lane] = rest[i], drift[i]
            constants[g, BEND, lane] = 0.5 * turned[i]
            drifts = 1.0 if drift[i] != 0.0 else drifts
            tip[X] += output[i] * model.rest[r, LOAD, i]
            tip[V] += output[i] * drift[i]
            tip[A] += output[i] * turned[i]
        if g == FREE:
            tip[SHOWN], tip[SHOWN_RATE], tip[SHOWN_BEND] = tip[X], tip[V], tip[A]
            continue
        # how far the tip rests beyond a stop is small against how far the stop is away
        side, k, d = 1.0 if g == UPPER_STOP else -1.0, model.contact_stiffness[g - 1], model.contact_damping[g - 1]
        penetration = side * (tip[X] + stop * model.rest_penetration[r])
        tip[X] += stop * (1.0 + model.rest_penetration[r])
        tip[SHOWN], tip[SHOWN_RATE] = k * penetration + d * side * tip[V], side * (k * tip[V] + d * tip[A])
        tip[SHOWN_BEND], tip[STIFFNESS], tip[DAMPING] = k * side * tip[A], k, d
    for g in (UPPER_STOP, LOWER_STOP):
        r = model.pressed[g]
        for which in range(2):
            before, after, row = (FREE, g, INTO) if which == 0 else (g, FREE, BACK)
            for lane in range(2 * lanes):
                total = -constants[after, REST, lane]
                for k in range(2):
                    for j in range(n):
                        total += switch[r, which, k, j, lane] * constants[before, REST, k * lanes + j]
                constants[g, row, lane] = total
    return drifts


@inlined
def enter(run, steady, to_modal, g, state):
    """Set u to a physical state (2n,) at phase zero of the drive."""
    u, lanes, r = run.u, run.turn.shape[4], run.pressed[g]
    n, harmonics = run.ahead.shape[4], run.driven_turn.shape[4]
    for i in range(2 * n):
        lane = (i // n) * lanes + i % n
        total = -run.constants[g, REST, lane]
        for k in range(harmonics):
            total -= steady[r, i, k]
        for j in range(2 * n):
            total += to_modal[r, i, j] * state[j]
        u[lane] = total
    for k in range(harmonics):
        u[2 * lanes + k], u[2 * lanes + harmonics + k] = 1.0, 0.0


@inlined
def leave(run, steady, from_modal, g, state):
    """Physical state (2n,) of u."""
    u, spare, lanes, r = run.u, run.spare, run.turn.shape[4], run.pressed[g]
    n, harmonics = run.ahead.shape[4], run.driven_turn.shape[4]
    for i in range(2 * n):
        lane = (i // n) * lanes + i % n
        total = u[lane] + run.constants[g, REST, lane]
        for k in range(2 * harmonics):
            total += steady[r, i, k] * u[2 * lanes + k]
        spare[i] = total
    for i in range(2 * n):
        total = 0.0
        for j in range(2 * n):
            total += from_modal[r, i, j] * spare[j]
        state[i] = total


@inlined
def change(run, g, which):
    """Take u from FREE to the regime of stop g (``which`` 0), or back (1)."""
    lanes, r = run.turn.shape[4], run.pressed[g]
    combine(
        run.switch[r, which],
        run.driven_switch[r, which],
        run.constants[g, INTO + which],
        run.u,
        run.ahead.shape[4],
        lanes,
        run.driven_turn.shape[4],
        run.spare,
    )
    for lane in range(2 * lanes):
        run.u[lane] = run.spare[lane]


@inlined
def read(run, g, quantity, u):
    """What u shows in the regime of g, by row of ``now``, without what the numbers add."""
    return dot(run.now[run.pressed[g], quantity], u, u.shape[0])


@inlined
def size_of(run, g, which):
    """Bound of a derivative from now on in the regime of g, by row of ``bounds``."""
    return dot_of_sizes(run.bounds[run.pressed[g], which], run.u, run.u.shape[0])


@inlined
def add_drift(run, g, time, u):
    """What a constant force adds to coordinates without a position of rest."""
    for lane in range(run.constants.shape[2]):
        u[lane] += time * (run.constants[g, DRIFT, lane] + time * run.constants[g, BEND, lane])


@inlined
def jump(run, g, level, intervals, u, out):
    """out = u after some intervals (1 to 8) of a level; ``out`` may be u."""
    lanes, harmonics, r = run.turn.shape[4], run.driven_turn.shape[4], run.pressed[g]
    turn(run.turn[r, level, intervals - 1], u, out, lanes)
    if run.drifts != 0.0:
        add_drift(run, g, intervals * math.ldexp(run.shortest[r], level), out)
    for k in range(harmonics):
        c, s = run.driven_turn[r, level, intervals - 1, 0, k], run.driven_turn[r, level, intervals - 1, 1, k]
        cosine, sine = u[2 * lanes + k], u[2 * lanes + harmonics + k]
        out[2 * lanes + k] = cosine * c - sine * s
        out[2 * lanes + harmonics + k] = sine * c + cosine * s


@inlined
def place(run, g, time, u, out):
    """out = u after a time within the shortest interval, or just before now; ``out`` may be u."""
    lanes, harmonics, r = run.turn.shape[4], run.driven_turn.shape[4], run.pressed[g]
    piece = run.shortest[r] / FINE
    number = max(0, int(time / piece + 0.5))
    turn_and_expand(run.fine[r, number], run.generator[r], u, time - number * piece, out, lanes)
    if run.drifts != 0.0:
        add_drift(run, g, time, out)
    turn_drive(run.omega * time, harmonics, 2 * lanes, u, out)


@leaf
def turn_drive(angle, harmonics, start, u, out):
    """Let the harmonics of the drive, coordinates from ``start`` on, turn by once, twice ... an angle [rad]."""
    for k in range(harmonics):
        c, s = math.cos((k + 1) * angle), math.sin((k + 1) * angle)
        cosine, sine = u[start + k], u[start + harmonics + k]
        out[start + k] = cosine * c - sine * s
        out[start + harmonics + k] = sine * c + cosine * s


@leaf
def turn_blocks(generator, blocks, time, u, out):
    """Blocks of exp(B time) times u, for any time."""
    lanes = generator.shape[1]
    for j in range(blocks):
        e11, e12, e21, e22 = block(generator, j, time)
        first, second = u[j], u[lanes + j]
        out[j] = e11 * first + e12 * second
        out[lanes + j] = e21 * first + e22 * second


@inlined
def travel(run, g, time, u, out):
    """out = u after any time; ``out`` may be u."""
    turn_blocks(run.generator[run.pressed[g]], run.ahead.shape[4], time, u, out)
    if run.drifts != 0.0:
        add_drift(run, g, time, out)
    turn_drive(run.omega * time, run.driven_turn.shape[4], 2 * run.turn.shape[4], u, out)


@inlined
def look(run, g, level, scale, value, slope):
    """Fill ``space`` with what the regime of g shows now and after 1 to 8 intervals of a level.

    Times ``scale``, and without the constant that the numbers add; ``value`` and ``slope`` are those of now.
    """
    r, values, slopes = run.pressed[g], run.space[VALUES], run.space[SLOPES]
    blocks, lanes, harmonics = run.ahead.shape[4], run.turn.shape[4], run.driven_turn.shape[4]
    free, driven = run.ahead[r, level], run.driven_ahead[r, level]
    sample(free, driven, run.u, blocks, lanes, harmonics, scale, values, 8, slopes, 8)
    if run.drifts != 0.0:
        rate, bend = run.numbers[g, SHOWN_RATE], run.numbers[g, SHOWN_BEND]
        for i in range(8):
            time = (i + 1) * math.ldexp(run.shortest[r], level)
            values[8 + i] += time * (rate + 0.5 * time * bend)
            slopes[8 + i] += rate + time * bend
    values[7], slopes[7] = value, slope


@inlined
def expand(run, g, scale):
    """Fill ``space`` with the Taylor series of what the regime of g shows times ``scale``, without its constant.

    Time counts in shortest intervals.
    """
    r, series = run.pressed[g], run.space[SERIES]
    blocks, lanes, harmonics = run.ahead.shape[4], run.turn.shape[4], run.driven_turn.shape[4]
    sample(run.taylor[r], run.driven_taylor[r], run.u, blocks, lanes, harmonics, scale, series, 0, series, 8)
    if run.drifts != 0.0:
        shortest = run.shortest[r]
        series[1] += shortest * run.numbers[g, SHOWN_RATE]
        series[2] += 0.5 * shortest * shortest * run.numbers[g, SHOWN_BEND]
