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
from numba import njit

from chaosgym.core.lanes import LANES, padded
from chaosgym.core.propagator import block, bound, derivative, steady_response

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

SHORTEST, DRIFTING = 0, 1
"""Numbers at the beginning of a row: the shortest interval [s]; 1 if a coordinate may drift, else 0."""

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
def tabulate(at, generator, to_modal, from_modal, shape, lag, shortest, omega, drive, rest, drift, constants):
    """Row (at[ROW],) of a set of pressed surfaces.

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
    shortest, omega
        Shortest interval [s]; rate of the drive [rad/s].
    drive : (H, 2, n)
        Modal forces that go with cosine and sine of each harmonic.
    rest, drift : (1 + m, 2n)
        Of the modal coordinates under the constant force, and per unit position of each pressed surface.
    constants : (m, 1 + m)
        As in ``layout``.
    """
    n, harmonics, m, blocks, width = at[MODES], at[HARMONICS], at[JOINTS], at[BLOCKS], at[WIDTH]
    values = np.zeros(at[ROW])
    drifts = np.any(drift != 0.0)
    for j in range(n):
        drifts = drifts or (generator[1, j] != 0.0 and generator[2, j] == 0.0)
    values[SHORTEST], values[DRIFTING] = shortest, 1.0 if drifts else 0.0
    whole, steady = np.zeros((4, blocks)), np.zeros((2 * n, 2 * harmonics))
    whole[:, :n] = generator
    response, cosine, sine = np.empty((2 * n, 2)), np.empty(2 * n), np.empty(2 * n)
    for h in range(harmonics):
        rate = (h + 1) * omega
        whole[1, n + h], whole[2, n + h] = -rate, rate
        for i in range(2 * n):
            cosine[i], sine[i] = 0.0, 0.0
            for k in range(n):
                cosine[i] += to_modal[i, n + k] * drive[h, 0, k]
                sine[i] += to_modal[i, n + k] * drive[h, 1, k]
        steady_response(generator, cosine, sine, rate, response)
        steady[:, h], steady[:, harmonics + h] = response[:, 0], response[:, 1]
    _put_blocks(at, whole, shortest, values)
    for j in range(m):
        _put_joint(at, whole, shape[j] @ np.ascontiguousarray(from_modal[:n]), steady, lag[j], shortest, j, values)
    states = at[STATES]
    back = from_modal @ steady
    resting = from_modal @ np.ascontiguousarray(rest.T)
    for i in range(2 * n):
        for c in range(2 * n):
            values[at[FROM] + ((c // n) * width + c % n) * states + i] = from_modal[i, c]
            values[at[TO] + c * 2 * width + (i // n) * width + i % n] = to_modal[i, c]
        for c in range(2 * harmonics):
            lane = (c // harmonics) * width + n + c % harmonics
            values[at[FROM] + lane * states + i] = back[i, c]
            values[at[TO] + (2 * n + c) * 2 * width + (i // n) * width + i % n] = -steady[i, c]
        for c in range(1 + m):
            values[at[FROM] + (2 * width + c) * states + i] = resting[i, c]
            values[at[TO] + (2 * blocks + c) * 2 * width + (i // n) * width + i % n] = -rest[c, i]
            values[at[DRIFTS] + c * 2 * width + (i // n) * width + i % n] = drift[c, i]
    for c in range(2 * harmonics):
        lane = (c // harmonics) * width + n + c % harmonics
        values[at[TO] + (2 * n + c) * 2 * width + lane] = 1.0
    for j in range(m):
        for c in range(1 + m):
            values[at[CONSTANTS] + j * (1 + m) + c] = constants[j, c]
    return values


@njit(cache=True)
def _put_blocks(at, whole, shortest, values):
    """Fill TURN, FINER and GENERATOR."""
    width = at[WIDTH]
    for j in range(at[BLOCKS]):
        for k in range(4):
            values[at[GENERATOR] + k * width + j] = whole[k, j]
        for f in range(FINE + 1):
            for k, entry in enumerate(block(whole, j, shortest * f / FINE)):
                values[at[FINER] + (4 * f + k) * width + j] = entry
        for level in range(at[LEVELS]):
            for i in range(LANES):
                for k, entry in enumerate(block(whole, j, math.ldexp(shortest, level) * (i + 1))):
                    values[at[TURN] + (4 * (LANES * level + i) + k) * width + j] = entry


@njit(cache=True)
def _put_joint(at, whole, output, steady, lag, shortest, j, values):
    """Fill AHEAD, TAYLOR, NOW_ROWS and bounds of joint j; ``output`` (2n,) is its displacement in modes."""
    n, harmonics, m, blocks, width = at[MODES], at[HARMONICS], at[JOINTS], at[BLOCKS], at[WIDTH]
    rows, reading, size = np.zeros((DEGREE + 1, 2 * blocks)), np.zeros((5, 2 * blocks)), np.empty(2 * blocks)
    rows[0, :n], rows[0, blocks : blocks + n] = output[:n], output[n:]
    for h in range(harmonics):
        for i in range(2 * n):
            rows[0, n + h] += output[i] * steady[i, h]
            rows[0, blocks + n + h] += output[i] * steady[i, harmonics + h]
    for p in range(DEGREE):
        derivative(whole, rows[p], rows[p + 1])
    for p in range(5):
        reading[p] = rows[p] + lag * rows[p + 1]
    factorial = 1.0
    for p in range(DEGREE + 1):
        factorial *= max(p, 1)
        for i in range(2 * blocks):
            values[at[TAYLOR] + ((4 * j + 2 * (p // LANES)) * blocks + i) * LANES + p % LANES] = rows[p, i] / factorial
    for i in range(2 * blocks):
        lane = (i // blocks) * width + i % blocks
        for q in range(4):
            row = rows[q] if q <= V else reading[q - E]
            values[at[NOW_ROWS] + (4 * j + q) * 2 * width + lane] = row[i]
    for which in range(3):
        bound(whole, reading[4] if which == 0 else reading[2] if which == 1 else rows[0], size)
        first = at[BOUNDS + which] + j * 2 * width
        for i in range(2 * blocks):
            values[first + (i // blocks) * width + i % blocks] = size[i]
    for level in range(at[LEVELS]):
        first = at[AHEAD] + (level * m + j) * 4 * blocks * LANES
        for b in range(blocks):
            for i in range(LANES):
                instant = at[TURN] + 4 * (LANES * level + i) * width + b
                e11, e12 = values[instant], values[instant + width]
                e21, e22 = values[instant + 2 * width], values[instant + 3 * width]
                for q in range(2):
                    one, two = reading[q, b], reading[q, blocks + b]
                    place = first + (2 * q * blocks + b) * LANES + i
                    values[place] = one * e11 + two * e21
                    values[place + blocks * LANES] = one * e12 + two * e22
