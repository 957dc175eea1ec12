r"""Tables of a machine of a few modes and several joints, for one set of pressed surfaces.

Between two contact events the machine is linear. Its coordinates u are those of N real 2 x 2 blocks: the n modes of the
machine with its pressed surfaces, less their rest and their steady response, and the H harmonics of the drive, each
of which is a block that turns at its own rate. Hence

    u' = B u,      y_j = row_j . u + constant       displacement of joint j
                   e_j = y_j + lag_j y_j'           its reading; lag = damper / spring of a pressed surface, else 0

and e_j at instants ahead, its Taylor series and a bound of its fourth derivative for all time to come are sums over u.
"""

import math

import numpy as np

from chaosgym.core.kernel import leaf, njit
from chaosgym.core.lanes import LANES, padded
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

MODES, HARMONICS, JOINTS, BLOCKS, WIDTH, STATES, LEVELS = range(7)
"""Sizes: n, H, m, N = n + H, L = N padded, 2n padded, lengths of an interval (shortest 2^level)."""

AHEAD, TURN, FINER, GENERATOR, TAYLOR, NOW_ROWS, BOUNDS, BENDS, SIZES, FROM, TO, CONSTANTS, DRIFTS, ROW = range(7, 21)
"""Where the tables of a set begin in its row of numbers, and how long the row is; see ``layout``."""

SHORTEST, DRIFTING, ALWAYS_DRIFTING = 0, 1, 2
"""Numbers at the beginning of a row: the shortest interval [s]; 1 if a coordinate may drift, else 0, under the drive
and whatever the drive."""

PLACES = 21


@njit(cache=True)
def layout(n, harmonics, m, levels):
    """Sizes, and where the tables of a set begin in their row.

    AHEAD (levels, m, 2, 2, N, 8)
        Reading and its rate after 1 to 8 intervals: [joint, quantity, coordinate of the block, block].
    TURN (levels, 8, 4, L), FINER (FINE + 1, 4, L), GENERATOR (4, L)
        Blocks of exp(B t) after 1 to 8 intervals, within the shortest interval, and B.
    TAYLOR (m, 2, 2, N, 8)
        Taylor coefficients of the displacement, of time in seconds: [joint, half, coordinate, block].
    NOW_ROWS (m, 4, 2L), BOUNDS (m, 2L), BENDS (m, 2L), SIZES (m, 2L)
        What a joint shows; bounds of the reading's fourth and second derivative, and of the displacement.
    FROM (2L + 1 + m, 2n padded)
        State (q, q') by columns of u, of 1 and of the positions of the pressed surfaces.
    TO (2n + 2H + 1 + m, 2L)
        u by columns of state, cosines, sines, 1 and positions.
    CONSTANTS (m, 1 + m)
        Reading at rest, from the surface where one presses, per 1 and position.
    DRIFTS (1 + m, 2L)
        Rate of the coordinates without a position of rest, likewise.
    """
    at = np.zeros(PLACES, np.int64)
    blocks = n + harmonics
    width, states, more = padded(blocks), padded(2 * n), 1 + m
    at[MODES], at[HARMONICS], at[JOINTS], at[BLOCKS] = n, harmonics, m, blocks
    at[WIDTH], at[STATES], at[LEVELS] = width, states, levels
    at[AHEAD] = LANES
    at[TURN] = at[AHEAD] + levels * m * 4 * blocks * LANES
    at[FINER] = at[TURN] + levels * LANES * 4 * width
    at[GENERATOR] = at[FINER] + (FINE + 1) * 4 * width
    at[TAYLOR] = at[GENERATOR] + 4 * width
    at[NOW_ROWS] = at[TAYLOR] + m * 4 * blocks * LANES
    at[BOUNDS] = at[NOW_ROWS] + m * 8 * width
    at[BENDS] = at[BOUNDS] + m * 2 * width
    at[SIZES] = at[BENDS] + m * 2 * width
    at[FROM] = at[SIZES] + m * 2 * width
    at[TO] = at[FROM] + (2 * width + more) * states
    at[CONSTANTS] = at[TO] + (2 * blocks + more) * 2 * width
    at[DRIFTS] = at[CONSTANTS] + padded(m * more)
    at[ROW] = at[DRIFTS] + more * 2 * width
    return at


@njit(cache=True, nogil=True)
def put_structure(at, generator, to_modal, from_modal, shape, lag, shortest, rest, drift, constants, values):
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
    constants : (m, m)
        As in ``layout``, without the column of 1.
    """
    n, m, width, states = at[MODES], at[JOINTS], at[WIDTH], at[STATES]
    values[SHORTEST], values[ALWAYS_DRIFTING] = shortest, 0.0
    for j in range(m):
        for i in range(2 * n):
            if drift[j, i] != 0.0:
                values[ALWAYS_DRIFTING] = 1.0
    for j in range(n):
        if generator[1, j] != 0.0 and generator[2, j] == 0.0:
            values[ALWAYS_DRIFTING] = 1.0
    _put_blocks(at, generator, shortest, np.int64(0), at[LEVELS], values)
    rows, reading = np.empty((DEGREE + 1, 2 * n)), np.empty((5, 2 * n))
    for j in range(m):
        moved = shape[j] @ np.ascontiguousarray(from_modal[:n])
        for i in range(2 * n):
            rows[0, i] = moved[i]
        for p in range(DEGREE):
            derivative(generator, rows[p], rows[p + 1])
        _read(rows, lag[j], reading)
        _put_joint(at, generator, rows, reading, j, np.int64(0), at[LEVELS], values)
    resting = from_modal @ np.ascontiguousarray(rest.T)
    for i in range(2 * n):
        for c in range(2 * n):
            values[at[FROM] + ((c // n) * width + c % n) * states + i] = from_modal[i, c]
            values[at[TO] + c * 2 * width + (i // n) * width + i % n] = to_modal[i, c]
        for j in range(m):
            values[at[FROM] + (2 * width + 1 + j) * states + i] = resting[i, j]
            values[at[TO] + (2 * at[BLOCKS] + 1 + j) * 2 * width + (i // n) * width + i % n] = -rest[j, i]
            values[at[DRIFTS] + (1 + j) * 2 * width + (i // n) * width + i % n] = drift[j, i]
    for j in range(m):
        for k in range(m):
            values[at[CONSTANTS] + j * (1 + m) + 1 + k] = constants[j, k]


@njit(cache=True, nogil=True)
def put_drive(at, generator, to_modal, from_modal, shape, lag, omega, drive, rest, load, values):
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
    back = from_modal @ steady
    rows, reading = np.empty((DEGREE + 1, 2 * harmonics)), np.empty((5, 2 * harmonics))
    resting, settling = np.zeros(2 * n), np.zeros(2 * n)
    values[DRIFTING] = values[ALWAYS_DRIFTING]
    for i in range(2 * n):
        lane = at[DRIFTS] + (i // n) * width + i % n
        values[lane] = 0.0
        if _is_slow(generator, i, period):
            values[lane] = load[i]
            values[DRIFTING] = 1.0 if load[i] != 0.0 else values[DRIFTING]
        else:
            settling[i] = rest[i]
    for i in range(2 * n):
        for c in range(2 * n):
            resting[i] += from_modal[i, c] * settling[c]
    for j in range(at[JOINTS]):
        for c in range(2 * harmonics):
            rows[0, c] = 0.0
            for i in range(n):
                rows[0, c] += shape[j, i] * back[i, c]
        for p in range(DEGREE):
            derivative(turning, rows[p], rows[p + 1])
        _read(rows, lag[j], reading)
        _put_joint(at, turning, rows, reading, j, n, levels, values)
        values[at[CONSTANTS] + j * (1 + at[JOINTS])] = 0.0
        for i in range(n):
            values[at[CONSTANTS] + j * (1 + at[JOINTS])] += shape[j, i] * resting[i]
    for i in range(2 * n):
        for c in range(2 * harmonics):
            lane = (c // harmonics) * width + n + c % harmonics
            values[at[FROM] + lane * states + i] = back[i, c]
            values[at[TO] + (2 * n + c) * 2 * width + (i // n) * width + i % n] = -steady[i, c]
        values[at[FROM] + 2 * width * states + i] = resting[i]
        values[at[TO] + 2 * at[BLOCKS] * 2 * width + (i // n) * width + i % n] = -settling[i]
    for c in range(2 * harmonics):
        lane = (c // harmonics) * width + n + c % harmonics
        values[at[TO] + (2 * n + c) * 2 * width + lane] = 1.0


@leaf
def _read(rows, lag, reading):
    """Derivatives ``reading`` (5, 2k) of a joint's reading, of those ``rows`` of its displacement."""
    for p in range(5):
        for i in range(rows.shape[1]):
            reading[p, i] = rows[p, i] + lag * rows[p + 1, i]


@njit(cache=True)
def _is_slow(generator, i, period):
    """True if modal coordinate i turns and decays by less than ``SLOW`` in a cycle."""
    n = generator.shape[1]
    j = i % n
    rate = abs(generator[0 if i < n else 3, j])
    if generator[2, j] != 0.0:
        rate = max(abs(generator[0, j]) + abs(generator[1, j]), abs(generator[2, j]) + abs(generator[3, j]))
    return rate * period < SLOW


@njit(cache=True)
def _put_blocks(at, generator, shortest, first, levels, values):
    """Fill TURN, FINER and GENERATOR of blocks (4, k) from lane ``first`` on."""
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
                place = at[TURN] + 4 * (LANES * level + i) * width + lane
                if level > 0 and i < LANES // 2:
                    # the instants of the first half are every second one of the level before
                    for k in range(4):
                        values[place + k * width] = values[place + (4 * (i + 1 - LANES) + k) * width]
                    continue
                for k, entry in enumerate(block(generator, j, math.ldexp(shortest, level) * (i + 1))):
                    values[place + k * width] = entry


@njit(cache=True)
def _put_joint(at, generator, rows, reading, j, first_block, levels, values):
    """Fill AHEAD, TAYLOR, NOW_ROWS and bounds of joint j for blocks (4, k) from ``first_block`` on.

    ``rows`` (DEGREE + 1, 2k) are the derivatives of its displacement, ``reading`` (5, 2k) those of its reading.
    """
    m, blocks, width, own = at[JOINTS], at[BLOCKS], at[WIDTH], generator.shape[1]
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
            values[begin + (i // own) * width + i % own] = size[i]
    for level in range(levels):
        first = at[AHEAD] + (level * m + j) * 4 * blocks * LANES
        for b in range(own):
            for i in range(LANES):
                instant = at[TURN] + 4 * (LANES * level + i) * width + first_block + b
                e11, e12 = values[instant], values[instant + width]
                e21, e22 = values[instant + 2 * width], values[instant + 3 * width]
                for q in range(2):
                    one, two = reading[q, b], reading[q, own + b]
                    place = first + (2 * q * blocks + first_block + b) * LANES + i
                    values[place] = one * e11 + two * e21
                    values[place + blocks * LANES] = one * e12 + two * e22
