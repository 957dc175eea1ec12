"""One run of a machine of a few modes: what its tables become at one speed, force and gap, and how coordinates move.

Modal coordinates u (W,) are those of ``lanes``: first and second coordinate of each block, then the drive's harmonics.
All that a run reads lies in two arrays of numbers and one of places in them.

The file is long because whoever writes these arrays and whoever reads them must agree on every place.
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
    Tables,
    V,
    X,
    drive_places,
    put_drive,
    shortest_intervals,
    table_places,
    tabulate,
)
from chaosgym.core.kernel import leaf, part
from chaosgym.core.lanes import LANES, aligned, combine, dot, dot_of_sizes, padded, sample, turn, turn_and_expand
from chaosgym.core.modal_model import FREE, LOAD, LOWER_STOP, STOP, UPPER_STOP
from chaosgym.core.propagator import exponential
from chaosgym.core.tangent import ABREAST

SLOW = 1e-2
"""Angle [rad] by which a coordinate turns, or share by which it decays, in a cycle, below which it drifts: it has no
position of rest under a static force, as that would be thousands of times as far away as it moves."""

POWERS = 6
"""Powers of time in a drift: what is left out of its series is ``SLOW``^6 / 7! of it, which is rounding."""

POSITION, STIFFNESS, DAMPING, SHORTEST, SHOWN_DRIFT = range(5, 10)
SHOWN_BENDS = SHOWN_DRIFT + POWERS
NUMBERS = SHOWN_BENDS + 4
"""Numbers of FREE, UPPER_STOP and LOWER_STOP after the rows of ``now``, which are added to what coordinates show:
position, spring and damper of the stop; shortest interval [s]; what the drift shows, by powers of time, and its share
in each row of ``bounds``; how many numbers there are."""

REST, INTO, BACK, DRIFT = range(4)
CONSTANTS = DRIFT + POWERS
"""Constants (2L,) of the same three, in modal coordinates: position of rest; of the change from FREE to the stop and
back; of the coordinates that drift by powers of time; how many there are."""

VALUES, SLOPES, SERIES, SPACE = 7, 23, 32, 64
"""Work space: what a regime shows, and its rate, now and at eight instants ahead, 9 numbers each; Taylor coefficients
of it, then of the force of a stop that does not press, 16 each; its size."""

BLOCKS, LANES_OF, HARMONICS, WIDTH, CONSTANT, NUMBER, U, SPARE, WORK, WEIGHTS = range(10)
"""Entries of ``Run.at``: sizes n, L, H and W; where constants, numbers, coordinates, room for others, work space and
weights begin in ``own``."""

AHEAD, TURN, FINER, GENERATOR, TAYLOR, SWITCH = range(10, 16)
"""Where tables begin in a row of the structure."""

DRIVEN_AHEAD, DRIVEN_TAYLOR, DRIVEN_SWITCH, DRIVEN_TURN, NOW, BOUNDS, STEADY = range(16, 23)
"""Where tables begin in a row of the drive."""

TABLE_ROW, DRIVE_ROW, LEVELS_OF, PLACES = 23, 26, 29, 32
"""Where the rows of FREE, UPPER_STOP and LOWER_STOP begin, and their levels; how many entries there are."""


class Run(NamedTuple):
    """All that a run reads, and its work space.

    Attributes
    ----------
    tables : (...,)
        Rows of ``Tables.values``.
    own : (...,)
        Rows of ``put_drive``; constants (3, CONSTANTS, 2L); numbers (3, NUMBERS); coordinates u (W,), room for others
        (W,); work space (SPACE,); weights (n,) of the displacements, as in ``orthonormalise``.
    at : (PLACES,) int
        What lies where.
    period, omega : float
        Of the cycle [s], [rad/s].
    resolution : float
        Error of an event's instant, in shortest intervals.
    drifts : float
        1 if a coordinate drifts, else 0.
    """

    tables: np.ndarray
    own: np.ndarray
    at: np.ndarray
    period: float
    omega: float
    resolution: float
    drifts: float


@njit(cache=True)
def make_run(model, step_phase, event_tolerance):
    """Run of a model; ``step_phase`` is the angle [rad] by which the fastest mode turns in the shortest interval.

    ``event_tolerance`` is the error of an event's instant as such an angle. Tables are made anew if the model's are for
    another ``step_phase`` or too slow for the drive.
    """
    omega = 2.0 * math.pi * model.excitation_frequency
    regimes, tables = model.regimes, model.tables
    count, n, harmonics = regimes.generator.shape[0], regimes.generator.shape[2], model.drive.shape[1]
    stiffness, damping = np.zeros(count), np.zeros(count)
    for stop in (UPPER_STOP, LOWER_STOP):
        stiffness[model.pressed[stop]] = model.contact_stiffness[stop - 1]
        damping[model.pressed[stop]] = model.contact_damping[stop - 1]
    slowest = 0.0
    for r in range(count):
        slowest = max(slowest, tables.shortest[r])
    if tables.step_phase != step_phase or slowest * harmonics * omega > step_phase:
        shortest = shortest_intervals(regimes, step_phase, harmonics * omega)
        tables = Tables(step_phase, shortest, tabulate(regimes, stiffness, damping, shortest))
    at, size = _places(n, harmonics, count, model.pressed)
    own = aligned(size)
    drive = np.empty((harmonics, 2, n))
    for h in range(harmonics):
        for k in range(2):
            for i in range(n):
                drive[h, k, i] = model.drive[0, h, k, i] + omega * omega * model.drive[1, h, k, i]
    rows = own[: at[CONSTANT]].reshape((count, at[CONSTANT] // count))
    levels = put_drive(tables, regimes, stiffness, damping, drive, omega, rows)
    for g in range(3):
        at[LEVELS_OF + g] = levels[model.pressed[g]]
        own[at[NUMBER] + g * NUMBERS + SHORTEST] = tables.shortest[model.pressed[g]]
    for i in range(n):
        own[at[WEIGHTS] + i] = model.stiffness[i] if model.stiffness[i] != 0.0 else omega * omega
    values = tables.values.reshape(tables.values.size)
    period, resolution = 1.0 / model.excitation_frequency, event_tolerance / step_phase
    drifts = _settle(model, values, own, at)
    return Run(values, own, at, period, omega, resolution, drifts)


@njit(cache=True)
def _places(n, harmonics, count, pressed):
    """``at`` of a run, and the size of ``own``."""
    at = np.empty(PLACES, np.int64)
    lanes = padded(n)
    width = 2 * lanes + padded(2 * harmonics)
    structure, drive = table_places(n), drive_places(n, harmonics)
    at[BLOCKS], at[LANES_OF], at[HARMONICS], at[WIDTH] = n, lanes, harmonics, width
    at[CONSTANT] = count * drive[7]
    at[NUMBER] = at[CONSTANT] + 3 * CONSTANTS * 2 * lanes
    at[U] = padded(at[NUMBER] + 3 * NUMBERS)
    at[SPARE] = at[U] + width
    at[WORK] = at[SPARE] + ABREAST * width
    at[WEIGHTS] = at[WORK] + SPACE
    at[AHEAD], at[TURN], at[FINER], at[GENERATOR], at[TAYLOR] = structure[:5]
    at[SWITCH] = structure[7]
    for k in range(7):
        at[DRIVEN_AHEAD + k] = drive[k]
    for g in range(3):
        at[TABLE_ROW + g], at[DRIVE_ROW + g] = pressed[g] * structure[8], pressed[g] * drive[7]
    return at, at[WEIGHTS] + n


@njit(cache=True)
def _drifts(generator, i, period):
    """True if modal coordinate i turns and decays by less than ``SLOW`` in a cycle."""
    n = generator.shape[1]
    j = i % n
    rate = abs(generator[0 if i < n else 3, j])
    if generator[2, j] != 0.0:
        rate = max(abs(generator[0, j]) + abs(generator[1, j]), abs(generator[2, j]) + abs(generator[3, j]))
    return rate * period < SLOW


@njit(cache=True)
def _settle(model, tables, own, at):
    """Fill constants and numbers; 1.0 if a coordinate drifts, else 0.0."""
    n, lanes = at[BLOCKS], at[LANES_OF]
    period, any_drifts = 1.0 / model.excitation_frequency, 0.0
    for g in range(3):
        r = model.pressed[g]
        stop = 0.0 if g == FREE else model.stops[g - 1]
        tip = own[at[NUMBER] + g * NUMBERS : at[NUMBER] + (g + 1) * NUMBERS]
        tip[POSITION] = stop
        if not math.isfinite(stop):
            continue
        output, generator = model.regimes.output[r], model.regimes.generator[r]
        first, drifts = at[CONSTANT] + g * CONSTANTS * 2 * lanes, False
        for i in range(2 * n):
            slow = _drifts(generator, i, period)
            load = 0.0 if slow else model.rest[r, LOAD, i]
            drift = stop * model.drift[r, STOP, i] + (model.drift[r, LOAD, i] if slow else 0.0)
            lane = first + (i // n) * lanes + i % n
            own[lane], own[lane + DRIFT * 2 * lanes] = stop * model.rest[r, STOP, i] + load, drift
            drifts = drifts or drift != 0.0
            tip[X] += output[i] * load
        if drifts:
            any_drifts = 1.0
            _show_drift(output, generator, n, lanes, own, first + DRIFT * 2 * lanes, tip)
        k, d, side = 0.0, 0.0, 1.0
        if g != FREE:
            # how far the tip rests beyond a stop is small against how far the stop is away
            side, k, d = 1.0 if g == UPPER_STOP else -1.0, model.contact_stiffness[g - 1], model.contact_damping[g - 1]
            penetration = side * (tip[X] + stop * model.rest_penetration[r])
            tip[X] += stop * (1.0 + model.rest_penetration[r])
            tip[SHOWN], tip[SHOWN_RATE] = k * penetration + d * side * tip[V], side * (k * tip[V] + d * tip[A])
            tip[STIFFNESS], tip[DAMPING] = k, d
        else:
            tip[SHOWN], tip[SHOWN_RATE] = tip[X], tip[V]
        if drifts:
            _bound_drift(period, k, d, side, tip)
    for g in (UPPER_STOP, LOWER_STOP):
        columns = at[TABLE_ROW + g] + at[SWITCH]
        for which in range(2):
            before, after, row = (FREE, g, INTO) if which == 0 else (g, FREE, BACK)
            rest = at[CONSTANT] + before * CONSTANTS * 2 * lanes
            for lane in range(2 * lanes):
                total = -own[at[CONSTANT] + after * CONSTANTS * 2 * lanes + lane]
                for i in range(2 * n):
                    value = tables[columns + (which * 2 * n + i) * 2 * lanes + lane]
                    total += value * own[rest + (i // n) * lanes + i % n]
                own[at[CONSTANT] + (g * CONSTANTS + row) * 2 * lanes + lane] = total
    return any_drifts


@njit(cache=True)
def _show_drift(output, generator, n, lanes, own, first, tip):
    """Fill the powers of time of coordinates whose rates are known, and of the tip, where they change its numbers."""
    for power in range(POWERS):
        row = first + power * 2 * lanes
        shown = 0.0
        for j in range(n):
            a, b = own[row + j], own[row + lanes + j]
            shown += output[j] * a + output[n + j] * b
            if power + 1 < POWERS:
                share = 1.0 / (power + 2)
                own[row + 2 * lanes + j] = share * (generator[0, j] * a + generator[1, j] * b)
                own[row + 3 * lanes + j] = share * (generator[2, j] * a + generator[3, j] * b)
        tip[SHOWN_DRIFT + power] = shown
    tip[V], tip[A] = tip[SHOWN_DRIFT], 2.0 * tip[SHOWN_DRIFT + 1]


@njit(cache=True)
def _bound_drift(period, k, d, side, tip):
    """Fill what the drift shows, of a force if a spring k and a damper d press, and its share of ``bounds``."""
    powers = tip[SHOWN_DRIFT : SHOWN_DRIFT + POWERS].copy()
    for which in range(4):
        tip[SHOWN_BENDS + which] = 0.0
    for power in range(1, POWERS + 1):
        if k > 0.0:
            beyond = (power + 1) * powers[power] if power < POWERS else 0.0
            tip[SHOWN_DRIFT + power - 1] = side * (k * powers[power - 1] + d * beyond)
        for which in range(4):
            # second and fourth derivative of what is shown, third and fifth of the displacement
            order = 2 + 2 * (which % 2) + which // 2
            size = abs(powers[power - 1] if which >= 2 else tip[SHOWN_DRIFT + power - 1])
            for m in range(order):
                size *= power - m
            if power >= order:
                tip[SHOWN_BENDS + which] += size * period ** (power - order)


class Regime(NamedTuple):
    """A run in the regime of FREE, UPPER_STOP or LOWER_STOP: where everything lies, read from ``Run.at`` once.

    Tables of the structure are in ``tables``, all else in ``own``.
    """

    tables: np.ndarray
    own: np.ndarray
    blocks: int
    lanes: int
    harmonics: int
    width: int
    ahead: int
    turn: int
    fine: int
    generator: int
    taylor: int
    driven_ahead: int
    driven_taylor: int
    driven_turn: int
    now: int
    bounds: int
    steady: int
    constants: int
    numbers: int
    u: int
    spare: int
    values: int
    slopes: int
    series: int
    levels: int
    shortest: float
    shown: float
    shown_rate: float
    omega: float
    drifts: float


@part
def regime_of(run, g):
    """Regime of g."""
    at, own = run.at, run.own
    structure, drive, numbers = at[TABLE_ROW + g], at[DRIVE_ROW + g], at[NUMBER] + g * NUMBERS
    return Regime(
        run.tables,
        own,
        at[BLOCKS],
        at[LANES_OF],
        at[HARMONICS],
        at[WIDTH],
        structure + at[AHEAD],
        structure + at[TURN],
        structure + at[FINER],
        structure + at[GENERATOR],
        structure + at[TAYLOR],
        drive + at[DRIVEN_AHEAD],
        drive + at[DRIVEN_TAYLOR],
        drive + at[DRIVEN_TURN],
        drive + at[NOW],
        drive + at[BOUNDS],
        drive + at[STEADY],
        at[CONSTANT] + g * CONSTANTS * 2 * at[LANES_OF],
        numbers,
        at[U],
        at[SPARE],
        at[WORK] + VALUES,
        at[WORK] + SLOPES,
        at[WORK] + SERIES,
        at[LEVELS_OF + g],
        own[numbers + SHORTEST],
        own[numbers + SHOWN],
        own[numbers + SHOWN_RATE],
        run.omega,
        run.drifts,
    )


@leaf
def enter(run, to_modal, g, r, state):
    """Set u to a physical state (2n,) at phase zero of the drive, in regime r of g."""
    here = regime_of(run, g)
    own, u, n, lanes, harmonics = here.own, here.u, here.blocks, here.lanes, here.harmonics
    for i in range(2 * n):
        lane = (i // n) * lanes + i % n
        total = -own[here.constants + lane]
        for k in range(harmonics):
            total -= own[here.steady + 2 * harmonics * i + k]
        for j in range(2 * n):
            total += to_modal[r, i, j] * state[j]
        own[u + lane] = total
    for k in range(harmonics):
        own[u + 2 * lanes + k], own[u + 2 * lanes + harmonics + k] = 1.0, 0.0


@leaf
def leave(run, from_modal, g, r, state):
    """Physical state (2n,) of u in regime r of g."""
    here = regime_of(run, g)
    own, u, n, lanes, harmonics = here.own, here.u, here.blocks, here.lanes, here.harmonics
    for i in range(2 * n):
        lane = (i // n) * lanes + i % n
        total = own[u + lane] + own[here.constants + lane]
        for k in range(2 * harmonics):
            total += own[here.steady + 2 * harmonics * i + k] * own[u + 2 * lanes + k]
        own[here.spare + i] = total
    for i in range(2 * n):
        total = 0.0
        for j in range(2 * n):
            total += from_modal[r, i, j] * own[here.spare + j]
        state[i] = total


@leaf
def change(run, g, which):
    """Take u from FREE to the regime of stop g (``which`` 0), or back (1)."""
    at, own = run.at, run.own
    n, lanes, harmonics, u, spare = at[BLOCKS], at[LANES_OF], at[HARMONICS], at[U], at[SPARE]
    columns = at[TABLE_ROW + g] + at[SWITCH] + which * 4 * n * lanes
    driven = at[DRIVE_ROW + g] + at[DRIVEN_SWITCH] + which * 4 * harmonics * lanes
    constant = at[CONSTANT] + (g * CONSTANTS + INTO + which) * 2 * lanes
    combine(run.tables, columns, own, driven, constant, u, n, lanes, harmonics, spare)
    for lane in range(2 * lanes):
        own[u + lane] = own[spare + lane]


@part
def number(run, g, which):
    """A number of g."""
    return run.own[run.at[NUMBER] + g * NUMBERS + which]


@part
def read(here, quantity, u):
    """What coordinates show, by row of ``now``, without what the numbers add."""
    return dot(here.own, here.now + quantity * here.width, here.own, u, here.width)


@part
def size_of(here, which):
    """Bound of a derivative from now on, by row of ``bounds``."""
    moving = dot_of_sizes(here.own, here.bounds + which * here.width, here.own, here.u, here.width)
    return moving + here.own[here.numbers + SHOWN_BENDS + which]


@leaf
def add_drift(own, constants, lanes, time, u):
    """What a constant force adds to coordinates that drift; ``constants`` are those of the regime."""
    last = constants + (DRIFT + POWERS - 1) * 2 * lanes
    for lane in range(2 * lanes):
        total = own[last + lane]
        for power in range(1, POWERS):
            total = own[last - power * 2 * lanes + lane] + time * total
        own[u + lane] += time * total


@part
def jump(here, level, intervals, u, out):
    """Put coordinates after some intervals (1 to 8) of a level at ``out``, which may be u."""
    own, lanes, harmonics = here.own, here.lanes, here.harmonics
    instant = LANES * level + intervals - 1
    turn(here.tables, here.turn + instant * 4 * lanes, own, u, out, lanes)
    if here.drifts != 0.0:
        add_drift(own, here.constants, lanes, intervals * math.ldexp(here.shortest, level), out)
    angles, first = here.driven_turn + instant * 2 * harmonics, 2 * lanes
    for k in range(harmonics):
        c, s = own[angles + k], own[angles + harmonics + k]
        cosine, sine = own[u + first + k], own[u + first + harmonics + k]
        own[out + first + k] = cosine * c - sine * s
        own[out + first + harmonics + k] = sine * c + cosine * s


@part
def place(here, time, u, out):
    """Put coordinates after a time within the shortest interval, or just before now, at ``out``, which may be u."""
    own, lanes = here.own, here.lanes
    piece = here.shortest / FINE
    instant = max(0, int(time / piece + 0.5))
    entries = here.fine + instant * 4 * lanes
    turn_and_expand(here.tables, entries, here.generator, own, u, time - instant * piece, out, lanes)
    if here.drifts != 0.0:
        add_drift(own, here.constants, lanes, time, out)
    turn_drive(own, here.omega * time, here.harmonics, u + 2 * lanes, out + 2 * lanes)


@leaf
def turn_drive(own, angle, harmonics, u, out):
    """Let the harmonics of the drive, which begin at ``u``, turn by once, twice ... an angle [rad]."""
    for k in range(harmonics):
        c, s = math.cos((k + 1) * angle), math.sin((k + 1) * angle)
        cosine, sine = own[u + k], own[u + harmonics + k]
        own[out + k] = cosine * c - sine * s
        own[out + harmonics + k] = sine * c + cosine * s


@leaf
def travel(run, g, time, u, out):
    """Put coordinates after any time in the regime of g at ``out``, which may be u."""
    here = regime_of(run, g)
    own, tables, lanes = here.own, here.tables, here.lanes
    for j in range(here.blocks):
        k = here.generator + j
        p, q, r, s = tables[k], tables[k + lanes], tables[k + 2 * lanes], tables[k + 3 * lanes]
        e11, e12, e21, e22 = exponential(p, q, r, s, time)
        first, second = own[u + j], own[u + lanes + j]
        own[out + j] = e11 * first + e12 * second
        own[out + lanes + j] = e21 * first + e22 * second
    if here.drifts != 0.0:
        add_drift(own, here.constants, lanes, time, out)
    turn_drive(own, here.omega * time, here.harmonics, u + 2 * lanes, out + 2 * lanes)


@part
def look(here, level, scale, value, slope):
    """Fill the work space with what the regime shows now and after 1 to 8 intervals of a level.

    Times ``scale``, and without the constant that the numbers add; ``value`` and ``slope`` are those of now.
    """
    own, n, harmonics, values, slopes = here.own, here.blocks, here.harmonics, here.values, here.slopes
    free, driven = here.ahead + level * 4 * n * LANES, here.driven_ahead + level * 4 * harmonics * LANES
    sample(here.tables, free, own, driven, here.u, n, here.lanes, harmonics, scale, values + 1, slopes + 1)
    if here.drifts != 0.0:
        last = here.numbers + SHOWN_DRIFT + POWERS - 1
        for i in range(1, 9):
            time = i * math.ldexp(here.shortest, level)
            moved, rate = own[last], POWERS * own[last]
            for power in range(1, POWERS):
                moved = own[last - power] + time * moved
                rate = (POWERS - power) * own[last - power] + time * rate
            own[values + i] += time * moved
            own[slopes + i] += rate
    own[values], own[slopes] = value, slope


@part
def expand(here, scale):
    """Fill the work space with the Taylor series of what the regime shows times ``scale``, without its constant.

    Time counts in shortest intervals.
    """
    own, n, harmonics, series, shortest = here.own, here.blocks, here.harmonics, here.series, here.shortest
    free, driven, lanes = here.taylor, here.driven_taylor, here.lanes
    sample(here.tables, free, own, driven, here.u, n, lanes, harmonics, scale, series, series + 8)
    if here.drifts != 0.0:
        unit = 1.0
        for power in range(POWERS):
            unit *= shortest
            own[series + power + 1] += unit * own[here.numbers + SHOWN_DRIFT + power]
