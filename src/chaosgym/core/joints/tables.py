r"""Tables of a machine of a few modes and several joints, for one set of pressed surfaces.

Between two contact events the machine is linear. Its coordinates u are those of N real 2 x 2 blocks: the n modes of the
machine with its pressed surfaces, less their rest and their steady response, and the H harmonics of the drive, each
of which is a block that oscillates at its own rate. Hence

    (1)  u' = B u
    (2)  y_j = row_j . u + constant       displacement of joint j
    (3)  e_j = y_j + lag_j y_j'           its reading; lag = damper / spring of a pressed surface, else 0

and e_j at instants ahead, its Taylor series and a bound of its fourth derivative for all time to come are sums over u.

A joint with friction adds a block, the displacement a of the anchor of its tangential spring, which moves at constant
speed, and two channels that read what must stay positive while it goes on sticking or sliding (``joints.friction``):

    (4)  E = alpha e_j + beta (w_j - a_j)     or E',     w_j the tangential displacement

Friction of a sliding joint may feed energy from one mode to another: bounds then hold for the eight intervals ahead.
"""

import math
from typing import NamedTuple

import numpy as np

from chaosgym.core.kernel import leaf, njit, part
from chaosgym.core.lanes import LANES, padded
from chaosgym.core.linear_algebra import times
from chaosgym.core.propagator import block, bound, derivative, steady_response

MOST_LEVELS = 16
"""Lengths of an interval: the shortest one times 2^level."""

SLOW = 1e-2
"""Angle [rad] by which a coordinate turns, or share by which it decays, in a cycle, below which it drifts: it has no
position of rest under a static force, as that would be thousands of times as far away as it moves."""

FINE = 16
"""Instants within the shortest interval from which a Taylor series goes on."""

DEGREE = 15
"""Of the Taylor series of a displacement."""

Y, V, E, E_RATE = 0, 1, 2, 3
"""Rows of ``NOW_ROWS``: displacement, velocity, reading and its rate."""

MODES, HARMONICS, JOINTS, BLOCKS, WIDTH, STATES, LEVELS, SLIDERS, CHANNELS = range(9)
"""Sizes: n, H, m, N = n + H + f, L = N padded, 2n padded, lengths of an interval (shortest 2^level), f joints with
friction, m + 2f channels."""

AHEAD, PROPAGATORS, FINER, GENERATOR, TAYLOR, NOW_ROWS, BOUNDS, BENDS, SIZES, FROM, TO, CONSTANTS, DRIFTS, ROW = range(
    9, 23
)
"""Where the tables of a set begin in its row of numbers, and how long the row is; see ``layout``."""

SHORTEST, DRIFTING, ALWAYS_DRIFTING, LONGEST = range(4)
"""Numbers at the beginning of a row: the shortest interval [s]; 1 if a coordinate may drift, else 0, under the drive
and whatever the drive; the highest level of an interval."""

MOST_GROWTH = 1.0
"""Logarithm of the growth of a coordinate over eight intervals of the highest level, unless that is the shortest."""

PLACES = 23


class Rubs(NamedTuple):
    """Friction in a set of pressed surfaces: f joints, and two channels of each; see ``joints.friction``.

    Attributes
    ----------
    joint : (f,)
        Number of the joint that rubs.
    shape : (f, n)
        Tangential displacement per unit modal coordinate.
    follow : (2n, 2f)
        What the modal coordinates follow per unit displacement of each anchor, and per unit speed.
    weight : (2f, 2)
        alpha, beta of each channel; zeros of one that has nothing to read.
    rate : (2f,)
        1 where a channel reads E', 0 where it reads E.
    """

    joint: np.ndarray
    shape: np.ndarray
    follow: np.ndarray
    weight: np.ndarray
    rate: np.ndarray


@njit(cache=True)
def layout(n, harmonics, m, sliders, levels):
    """Sizes, and where the tables of a set begin in their row.

    AHEAD (levels, c, 2, 2, N, 8)
        Reading and its rate after 1 to 8 intervals: [channel, quantity, coordinate of the block, block].
    PROPAGATORS (levels, 8, 4, L), FINER (FINE + 1, 4, L), GENERATOR (4, L)
        Blocks of exp(B t) after 1 to 8 intervals, within the shortest interval, and B.
    TAYLOR (c, 2, 2, N, 8)
        Taylor coefficients of the displacement, of time in seconds: [channel, half, coordinate, block].
    NOW_ROWS (c, 4, 2L), BOUNDS (c, 2L), BENDS (c, 2L), SIZES (c, 2L)
        What a channel shows; bounds of the reading's fourth and second derivative, and of the displacement. The first m
        channels are the joints; the displacement of others is what they read.
    FROM (2L + 1 + m, 2n padded)
        State (q, q') by columns of u, of 1 and of the positions of the pressed surfaces.
    TO (2n + 2H + 2f + 1 + m, 2L)
        u by columns of state, cosines, sines, anchors, their speeds, 1 and positions.
    CONSTANTS (c, 1 + m)
        Reading at rest, from the surface where one presses, per 1 and position.
    DRIFTS (1 + m, 2L)
        Rate of the coordinates without a position of rest, likewise.
    """
    at = np.zeros(PLACES, np.int64)
    blocks, channels = n + harmonics + sliders, m + 2 * sliders
    width, states, more = padded(blocks), padded(2 * n), 1 + m
    at[MODES], at[HARMONICS], at[JOINTS], at[BLOCKS] = n, harmonics, m, blocks
    at[WIDTH], at[STATES], at[LEVELS] = width, states, levels
    at[SLIDERS], at[CHANNELS] = sliders, channels
    at[AHEAD] = LANES
    at[PROPAGATORS] = at[AHEAD] + levels * channels * 4 * blocks * LANES
    at[FINER] = at[PROPAGATORS] + levels * LANES * 4 * width
    at[GENERATOR] = at[FINER] + (FINE + 1) * 4 * width
    at[TAYLOR] = at[GENERATOR] + 4 * width
    at[NOW_ROWS] = at[TAYLOR] + channels * 4 * blocks * LANES
    at[BOUNDS] = at[NOW_ROWS] + channels * 8 * width
    at[BENDS] = at[BOUNDS] + channels * 2 * width
    at[SIZES] = at[BENDS] + channels * 2 * width
    at[FROM] = at[SIZES] + channels * 2 * width
    at[TO] = at[FROM] + (2 * width + more) * states
    at[CONSTANTS] = at[TO] + (2 * blocks + more) * 2 * width
    at[DRIFTS] = at[CONSTANTS] + padded(channels * more)
    at[ROW] = at[DRIFTS] + more * 2 * width
    return at


@part
def put_structure(at, generator, to_modal, from_modal, shape, lag, shortest, rest, drift, constants, rubs, values):
    """Fill a row (at[ROW],) of zeros with what depends on neither drive nor constant force.

    Parameters
    ----------
    at
        From ``layout``.
    generator : (4, n); to_modal, from_modal : (2n, 2n)
        Blocks of the machine with its pressed surfaces, as in ``Regimes``.
    shape : (m, n)
        Displacement of each joint per unit modal coordinate.
    lag : (m,)
        Damper over spring [s] where a surface presses, else 0.
    shortest
        Shortest interval [s].
    rest, drift : (m, 2n)
        Of the modal coordinates, per unit position of each pressed surface.
    constants : (m + 2f, m)
        As in ``layout``, without the column of 1.
    rubs
        What rubs in this set; None of machines without friction, for which numba compiles none of it.
    """
    n, m, width, states = at[MODES], at[JOINTS], at[WIDTH], at[STATES]
    harmonics, sliders = at[HARMONICS], at[SLIDERS]
    values[SHORTEST], values[ALWAYS_DRIFTING], values[LONGEST] = shortest, 0.0, at[LEVELS] - 1
    for j in range(m):
        for i in range(2 * n):
            if drift[j, i] != 0.0:
                values[ALWAYS_DRIFTING] = 1.0
    growth = 0.0
    for j in range(n):
        if generator[1, j] != 0.0 and generator[2, j] == 0.0:
            values[ALWAYS_DRIFTING] = 1.0
        growth = max(growth, max(generator[0, j], generator[3, j]))
    longest = LANES * shortest
    if growth > 0.0:
        while values[LONGEST] > 0.0 and growth * math.ldexp(longest, int(values[LONGEST])) > MOST_GROWTH:
            values[LONGEST] -= 1.0
        growth *= math.ldexp(longest, int(values[LONGEST]))
    _put_blocks(at, generator, shortest, np.int64(0), at[LEVELS], values)
    shown = strain = times(shape, from_modal)
    if rubs is not None:
        strain = times(rubs.shape, from_modal)
    _put_channels(at, generator, shown, lag, strain, rubs, np.int64(0), at[LEVELS], math.exp(growth), values)
    if rubs is not None and sliders > 0:
        anchors = np.zeros((4, sliders))
        for c in range(sliders):
            anchors[1, c] = 1.0
        _put_blocks(at, anchors, shortest, n + harmonics, at[LEVELS], values)
        back = times(from_modal, rubs.follow)
        shown, strain = times(shape, back), times(rubs.shape, back)
        for c in range(sliders):
            strain[c, c] -= 1.0
        _put_channels(at, anchors, shown, lag, strain, rubs, n + harmonics, at[LEVELS], 1.0, values)
        for c in range(2 * sliders):
            _put_forced(at, back[:, c], rubs.follow[:, c], c, sliders, harmonics, 2 * harmonics, values)
    resting = times(from_modal, np.ascontiguousarray(rest.T))
    for i in range(2 * n):
        for c in range(2 * n):
            values[at[FROM] + ((c // n) * width + c % n) * states + i] = from_modal[i, c]
            values[at[TO] + c * 2 * width + (i // n) * width + i % n] = to_modal[i, c]
        for j in range(m):
            values[at[FROM] + (2 * width + 1 + j) * states + i] = resting[i, j]
            values[at[TO] + (2 * at[BLOCKS] + 1 + j) * 2 * width + (i // n) * width + i % n] = -rest[j, i]
            values[at[DRIFTS] + (1 + j) * 2 * width + (i // n) * width + i % n] = drift[j, i]
    for j in range(at[CHANNELS]):
        for k in range(m):
            values[at[CONSTANTS] + j * (1 + m) + 1 + k] = constants[j, k]


@part
def put_drive(at, generator, to_modal, from_modal, shape, lag, omega, drive, rest, load, rubs, values):
    """Write into a row by ``put_structure`` a drive (H, 2, n) at ``omega`` [rad/s] and a constant force.

    They take the place of others. ``drive`` are modal forces that go with cosine and sine of each harmonic; ``rest``,
    ``load`` (2n,) are position of rest and rate at the origin of the modal coordinates under the constant force. Those
    that are ``SLOW`` drift.
    """
    n, harmonics, width, states = at[MODES], at[HARMONICS], at[WIDTH], at[STATES]
    shortest, period = values[SHORTEST], 2.0 * math.pi / omega
    levels = min(at[LEVELS], max(1, int(math.log2(period / shortest)) + 1))
    turning, steady = np.zeros((4, harmonics)), np.zeros((2 * n, 2 * harmonics))
    response, cosine, sine = np.empty((2 * n, 2)), np.empty(2 * n), np.empty(2 * n)
    for h in range(harmonics):
        rate = (h + 1) * omega
        turning[1, h], turning[2, h] = -rate, rate
        for i in range(2 * n):
            cosine[i], sine[i] = 0.0, 0.0
            for k in range(n):
                cosine[i] += to_modal[i, n + k] * drive[h, 0, k]
                sine[i] += to_modal[i, n + k] * drive[h, 1, k]
        steady_response(generator, cosine, sine, rate, response)
        for i in range(2 * n):
            steady[i, h], steady[i, harmonics + h] = response[i, 0], response[i, 1]
    _put_blocks(at, turning, shortest, n, levels, values)
    back = times(from_modal, steady)
    resting, settling, drifting = np.zeros(2 * n), np.zeros(2 * n), np.zeros(2 * n)
    values[DRIFTING] = values[ALWAYS_DRIFTING]
    for i in range(2 * n):
        lane = at[DRIFTS] + (i // n) * width + i % n
        values[lane] = 0.0
        if _is_slow(generator, i, period):
            drifting[i] = values[lane] = load[i]
            values[DRIFTING] = 1.0 if load[i] != 0.0 else values[DRIFTING]
        else:
            settling[i] = rest[i]
    for i in range(2 * n):
        for c in range(2 * n):
            resting[i] += from_modal[i, c] * settling[c]
    shown, strain = np.empty((at[JOINTS], 2 * harmonics)), np.empty((at[SLIDERS], 2 * harmonics))
    for j in range(at[JOINTS]):
        for c in range(2 * harmonics):
            shown[j, c] = 0.0
            for i in range(n):
                shown[j, c] += shape[j, i] * back[i, c]
        values[at[CONSTANTS] + j * (1 + at[JOINTS])] = 0.0
        for i in range(n):
            values[at[CONSTANTS] + j * (1 + at[JOINTS])] += shape[j, i] * resting[i]
    if rubs is not None:
        strain = times(rubs.shape, back)
    _put_channels(at, turning, shown, lag, strain, rubs, n, levels, 1.0, values)
    if rubs is not None:
        for k in range(2 * at[SLIDERS]):
            reading, slid = (
                np.sum(shape[int(rubs.joint[k // 2])] * resting[:n]),
                np.sum(rubs.shape[k // 2] * resting[:n]),
            )
            constant = read_at_rest(generator, from_modal, shape, lag, rubs, k, reading, slid, drifting)
            values[at[CONSTANTS] + (at[JOINTS] + k) * (1 + at[JOINTS])] = constant
    for c in range(2 * harmonics):
        _put_forced(at, back[:, c], steady[:, c], c, harmonics, np.int64(0), np.int64(0), values)
    for i in range(2 * n):
        values[at[FROM] + 2 * width * states + i] = resting[i]
        values[at[TO] + 2 * at[BLOCKS] * 2 * width + (i // n) * width + i % n] = -settling[i]


@leaf
def _put_forced(at, back, steady, c, group, lanes_before, columns_before, values):
    """Fill FROM and TO of coordinate c of a ``group`` of blocks that force the machine, after others of their kind.

    ``steady`` (2n,) is what the modal coordinates follow per unit of it, ``back`` (2n,) that in the state.
    """
    n, width, states = at[MODES], at[WIDTH], at[STATES]
    lane = (c // group) * width + n + lanes_before + c % group
    column = at[TO] + (2 * n + columns_before + c) * 2 * width
    for i in range(2 * n):
        values[at[FROM] + lane * states + i] = back[i]
        values[column + (i // n) * width + i % n] = -steady[i]
    values[column + lane] = 1.0


@njit(cache=True)
def read_at_rest(generator, from_modal, shape, lag, rubs, k, reading, strain, drift):
    """What channel k reads by (4) at rest, where its joint reads ``reading`` and its tangential spring ``strain``.

    Modal coordinates ``drift`` (2n,) at these rates, which shows as a constant in what has a velocity in it.
    """
    j, after = int(rubs.joint[k // 2]), np.empty(from_modal.shape[0])
    alpha, beta = rubs.weight[k, 0], rubs.weight[k, 1]
    moved, slid = times(shape[j : j + 1], from_modal)[0], times(rubs.shape[k // 2 : k // 2 + 1], from_modal)[0]
    if rubs.rate[k] == 0.0:
        return alpha * (reading + lag[j] * np.sum(moved * drift)) + beta * strain
    derivative(generator, moved, after)
    return np.sum((alpha * (moved + lag[j] * after) + beta * slid) * drift)


@leaf
def _read(rows, lag, reading):
    """Derivatives ``reading`` (5, 2k) of a joint's reading (3), of those ``rows`` of its displacement."""
    for p in range(5):
        for i in range(rows.shape[1]):
            reading[p, i] = rows[p, i] + lag * rows[p + 1, i]


@njit(cache=True)
def _is_slow(generator, i, period):
    """True if modal coordinate i oscillates and decays by less than ``SLOW`` in a cycle."""
    n = generator.shape[1]
    j = i % n
    rate = abs(generator[0 if i < n else 3, j])
    if generator[2, j] != 0.0:
        rate = max(abs(generator[0, j]) + abs(generator[1, j]), abs(generator[2, j]) + abs(generator[3, j]))
    return rate * period < SLOW


@njit(cache=True)
def _put_blocks(at, generator, shortest, first, levels, values):
    """Fill PROPAGATORS, FINER and GENERATOR of (1), of blocks (4, k) from lane ``first`` on."""
    width = at[WIDTH]
    for j in range(generator.shape[1]):
        lane = first + j
        for k in range(4):
            values[at[GENERATOR] + k * width + lane] = generator[k, j]
        for f in range(FINE + 1):
            for k, entry in enumerate(block(generator, j, shortest * f / FINE)):
                values[at[FINER] + (4 * f + k) * width + lane] = entry
        for level in range(levels):
            for i in range(LANES):
                place = at[PROPAGATORS] + 4 * (LANES * level + i) * width + lane
                if level > 0 and i < LANES // 2:
                    # the instants of the first half are every second one of the level before
                    for k in range(4):
                        values[place + k * width] = values[place + (4 * (i + 1 - LANES) + k) * width]
                    continue
                for k, entry in enumerate(block(generator, j, math.ldexp(shortest, level) * (i + 1))):
                    values[place + k * width] = entry


@njit(cache=True)
def _put_channels(at, generator, shown, lag, strain, rubs, first_block, levels, growth, values):
    """Fill what the channels show of blocks (4, k) from ``first_block`` on, whose norm grows by ``growth`` at most.

    ``shown`` (m, 2k) is the displacement of each joint per unit of their coordinates, ``strain`` (f, 2k) that of each
    tangential spring.
    """
    own, m = generator.shape[1], shown.shape[0]
    rows, reading, read = np.empty((DEGREE + 1, 2 * own)), np.empty((5, 2 * own)), np.empty(2 * own)
    for k in range(at[CHANNELS]):
        j, c = np.int64(k), (k - m) // 2
        if rubs is not None and k >= m:
            j = int(rubs.joint[c])
        for i in range(2 * own):
            rows[0, i] = shown[j, i]
        if rubs is not None and k >= m:
            derivative(generator, rows[0], rows[1])
            for i in range(2 * own):
                read[i] = rubs.weight[k - m, 0] * (rows[0, i] + lag[j] * rows[1, i])
                read[i] += rubs.weight[k - m, 1] * strain[c, i]
                rows[0, i] = read[i]
            if rubs.rate[k - m] != 0.0:
                derivative(generator, read, rows[0])
        for p in range(DEGREE):
            derivative(generator, rows[p], rows[p + 1])
        _read(rows, lag[j] if k < m else 0.0, reading)
        _put_joint(at, generator, rows, reading, k, first_block, levels, growth, values)


@njit(cache=True)
def _put_joint(at, generator, rows, reading, j, first_block, levels, growth, values):
    """Fill AHEAD, TAYLOR, NOW_ROWS and bounds of channel j for blocks (4, k) from ``first_block`` on.

    ``rows`` (DEGREE + 1, 2k) are the derivatives of its displacement, ``reading`` (5, 2k) those of its reading.
    """
    channels, blocks, width, own = at[CHANNELS], at[BLOCKS], at[WIDTH], generator.shape[1]
    size = np.empty(2 * own)
    factorial = 1.0
    for p in range(DEGREE + 1):
        factorial *= max(p, 1)
        half = at[TAYLOR] + (4 * j + 2 * (p // LANES)) * blocks * LANES + p % LANES
        for i in range(2 * own):
            place = half + ((i // own) * blocks + first_block + i % own) * LANES
            values[place] = rows[p, i] / factorial
    for i in range(2 * own):
        lane = (i // own) * width + first_block + i % own
        for q in range(4):
            row = rows[q] if q <= V else reading[q - E]
            values[at[NOW_ROWS] + (4 * j + q) * 2 * width + lane] = row[i]
    for which in range(3):
        bound(generator, reading[4] if which == 0 else reading[2] if which == 1 else rows[0], size)
        begin = at[BOUNDS + which] + j * 2 * width + first_block
        for i in range(2 * own):
            values[begin + (i // own) * width + i % own] = growth * size[i]
    for level in range(levels):
        first = at[AHEAD] + (level * channels + j) * 4 * blocks * LANES
        for b in range(own):
            for i in range(LANES):
                instant = at[PROPAGATORS] + 4 * (LANES * level + i) * width + first_block + b
                e11, e12 = values[instant], values[instant + width]
                e21, e22 = values[instant + 2 * width], values[instant + 3 * width]
                for q in range(2):
                    one, two = reading[q, b], reading[q, own + b]
                    place = first + (2 * q * blocks + first_block + b) * LANES + i
                    values[place] = one * e11 + two * e21
                    values[place + blocks * LANES] = one * e12 + two * e22
