"""Constant tables of a machine of a few modes and one gap: what its coordinates are, and show, at instants ahead.

The tables of the structure depend on neither speed, force nor gap and are made once. Those of the drive add the
columns of its harmonics at one speed. Both look ahead by intervals of ``shortest`` 2^level; at level 0 the fastest mode
turns by ``step_phase`` in one.

What a regime shows is the tip displacement where no surface acts, and the force of a surface where one presses.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from chaosgym.core.lanes import LANES
from chaosgym.core.propagator import block, bound, derivative, steady_response

LEVELS = 16
"""Lengths of an interval: shortest 2^level."""

FINE = 16
"""Instants within the shortest interval from which a Taylor series goes on."""

X, V, A, SHOWN, SHOWN_RATE = 0, 1, 2, 3, 4
BOUND2, BOUND4, PULL2, PULL4 = 0, 1, 2, 3


class Tables(NamedTuple):
    """Tables of the structure, for R regimes of n blocks, padded to L lanes (a multiple of 8).

    Attributes
    ----------
    step_phase : float
        Angle [rad] by which the fastest mode of a regime turns in its shortest interval.
    shortest : (R,)
        Its length [s].
    ahead : (R, LEVELS, 2, 2, n, 8)
        What the regime shows, and its rate, after 1 to 8 intervals, per coordinate: [quantity, coordinate, block].
    turn : (R, LEVELS, 8, 4, L)
        Blocks of exp(B t) at the same instants.
    fine : (R, FINE + 1, 4, L)
        The same within the shortest interval.
    generator : (R, 4, L)
        B.
    taylor : (R, 2, 2, n, 8)
        Taylor coefficients of what the regime shows, of time in shortest intervals: [half, coordinate, block].
    now : (R, 5, 2L)
        Tip displacement, velocity and acceleration, what the regime shows, and its rate.
    bounds : (R, 4, 2L)
        Bounds of the second and fourth derivative of what the regime shows, and, for a tip beyond a surface that does
        not press, the third and fifth derivative of the displacement.
    switch : (R, 2, 2, n, 2L)
        Columns of the change from regime 0 to this one and back: [which, coordinate, block].
    """

    step_phase: float
    shortest: np.ndarray
    ahead: np.ndarray
    turn: np.ndarray
    fine: np.ndarray
    generator: np.ndarray
    taylor: np.ndarray
    now: np.ndarray
    bounds: np.ndarray
    switch: np.ndarray


class Drive(NamedTuple):
    """What H harmonics of the drive add, at one speed; W is 2L + 2H, rounded up to a multiple of 8.

    ``steady`` (R, 2n, 2H) steady modal response; ``ahead`` (R, LEVELS, 2, 2, H, 8), ``taylor`` (R, 2, 2, H, 8) and
    ``switch`` (R, 2, 2, H, 2L) as for ``Tables``; ``turn`` (R, LEVELS, 8, 2, H) cosine and sine of the angle by which
    each harmonic turns; ``now`` (R, 5, W) and ``bounds`` (R, 4, W) those of ``Tables`` and the drive together.
    ``levels`` (R,): how many of the levels are filled in, as many as a cycle needs.
    """

    steady: np.ndarray
    ahead: np.ndarray
    turn: np.ndarray
    taylor: np.ndarray
    now: np.ndarray
    bounds: np.ndarray
    switch: np.ndarray
    levels: np.ndarray


@njit(cache=True)
def padded(count):
    """Count, rounded up to a multiple of 8."""
    return LANES * ((count + LANES - 1) // LANES)


@njit(cache=True)
def shown(rows, contact_stiffness, contact_damping, result):
    """Row of what a regime shows from the rows of displacement, velocity and so on: itself, or the pressing force."""
    for p in range(result.shape[0]):
        for i in range(result.shape[1]):
            if contact_stiffness > 0.0:
                result[p, i] = contact_stiffness * rows[p, i] + contact_damping * rows[p + 1, i]
            else:
                result[p, i] = rows[p, i]


@njit(cache=True)
def derivatives_of_tip(generator, output, rows):
    """Rows (orders, 2n) of the tip displacement and its derivatives."""
    rows[0] = output
    for p in range(1, rows.shape[0]):
        derivative(generator, rows[p - 1], rows[p])


@njit(cache=True)
def make_tables(regimes, contact_stiffness, contact_damping, step_phase, shortest):
    """Tables of R regimes; ``contact_stiffness``, ``contact_damping`` (R,) of the surface that presses, 0 where none.

    ``shortest`` (R,) [s] are the shortest intervals; no rate of what moves may exceed step_phase / shortest.
    """
    count, n = regimes.generator.shape[0], regimes.generator.shape[2]
    lanes = padded(n)
    ahead = np.zeros((count, LEVELS, 2, 2, n, LANES))
    turn = np.zeros((count, LEVELS, LANES, 4, lanes))
    fine = np.zeros((count, FINE + 1, 4, lanes))
    generator = np.zeros((count, 4, lanes))
    taylor = np.zeros((count, 2, 2, n, LANES))
    now = np.zeros((count, 5, 2 * lanes))
    bounds = np.zeros((count, 4, 2 * lanes))
    switch = np.zeros((count, 2, 2, n, 2 * lanes))
    rows, force = np.empty((7, 2 * n)), np.empty((6, 2 * n))
    size = np.empty(2 * n)
    for r in range(count):
        own, h = regimes.generator[r], shortest[r]
        generator[r, :, :n] = own
        derivatives_of_tip(own, regimes.output[r], rows)
        shown(rows, contact_stiffness[r], contact_damping[r], force)
        for q in range(5):
            row = rows[q] if q <= A else force[q - SHOWN]
            now[r, q, :n], now[r, q, lanes : lanes + n] = row[:n], row[n:]
        for q in range(4):
            row = force[2 + 2 * q] if q <= BOUND4 else rows[3 + 2 * (q - PULL2)]
            bound(own, row, size)
            bounds[r, q, :n], bounds[r, q, lanes : lanes + n] = size[:n], size[n:]
        for j in range(n):
            for f in range(FINE + 1):
                entries = block(own, j, h * f / FINE)
                for k in range(4):
                    fine[r, f, k, j] = entries[k]
            for level in range(LEVELS):
                for i in range(LANES):
                    e11, e12, e21, e22 = block(own, j, math.ldexp(h, level) * (i + 1))
                    turn[r, level, i, 0, j], turn[r, level, i, 1, j] = e11, e12
                    turn[r, level, i, 2, j], turn[r, level, i, 3, j] = e21, e22
                    for q in range(2):
                        first, second = force[q, j], force[q, n + j]
                        ahead[r, level, q, 0, j, i] = first * e11 + second * e21
                        ahead[r, level, q, 1, j, i] = first * e12 + second * e22
            first, second = force[0, j], force[0, n + j]
            for p in range(2 * LANES):
                taylor[r, p // LANES, 0, j, p % LANES], taylor[r, p // LANES, 1, j, p % LANES] = first, second
                share = h / (p + 1)
                first, second = (
                    share * (first * own[0, j] + second * own[2, j]),
                    share * (first * own[1, j] + second * own[3, j]),
                )
        if r > 0:
            forth, back = regimes.to_modal[r] @ regimes.from_modal[0], regimes.to_modal[0] @ regimes.from_modal[r]
            for k in range(2):
                for j in range(n):
                    for q in range(2):
                        switch[r, 0, k, j, q * lanes : q * lanes + n] = forth[q * n : q * n + n, k * n + j]
                        switch[r, 1, k, j, q * lanes : q * lanes + n] = back[q * n : q * n + n, k * n + j]
    return Tables(step_phase, shortest, ahead, turn, fine, generator, taylor, now, bounds, switch)


@njit(cache=True)
def with_drive(tables, regimes, contact_stiffness, contact_damping, drive, w):
    """Columns of the drive: modal forces ``drive`` (H, 2, n) with the cosine and sine of 1, 2 ... H times w [rad/s]."""
    count, n, lanes = tables.shortest.shape[0], drive.shape[2], tables.turn.shape[4]
    harmonics = drive.shape[0]
    width = 2 * lanes + padded(2 * harmonics)
    steady = np.zeros((count, 2 * n, 2 * harmonics))
    ahead = np.empty((count, LEVELS, 2, 2, harmonics, LANES))
    turn = np.empty((count, LEVELS, LANES, 2, harmonics))
    taylor = np.empty((count, 2, 2, harmonics, LANES))
    now, bounds = np.zeros((count, 5, width)), np.zeros((count, 4, width))
    switch = np.zeros((count, 2, 2, harmonics, 2 * lanes))
    levels = np.empty(count, np.int64)
    cosine, sine, response = np.empty(2 * n), np.empty(2 * n), np.empty((2 * n, 2))
    rows, force = np.empty((7, 2)), np.empty((6, 2))
    for r in range(count):
        now[r, :, : 2 * lanes], bounds[r, :, : 2 * lanes] = tables.now[r], tables.bounds[r]
        cycle = 2.0 * math.pi / (w * tables.shortest[r])
        levels[r] = min(LEVELS, max(1, int(math.log2(cycle)) + 1))
        for g in range(harmonics):
            rate = (g + 1) * w
            for i in range(2 * n):
                cosine[i], sine[i] = 0.0, 0.0
                for j in range(n):
                    cosine[i] += regimes.to_modal[r, i, n + j] * drive[g, 0, j]
                    sine[i] += regimes.to_modal[r, i, n + j] * drive[g, 1, j]
            steady_response(regimes.generator[r], cosine, sine, rate, response)
            rows[0] = 0.0
            for k in range(2):
                for i in range(2 * n):
                    steady[r, i, k * harmonics + g] = response[i, k]
                    rows[0, k] += regimes.output[r, i] * response[i, k]
            for p in range(1, 7):
                rows[p, 0], rows[p, 1] = rate * rows[p - 1, 1], -rate * rows[p - 1, 0]
            shown(rows, contact_stiffness[r], contact_damping[r], force)
            for k in range(2):
                at = 2 * lanes + k * harmonics + g
                for q in range(5):
                    now[r, q, at] = rows[q, k] if q <= A else force[q - SHOWN, k]
                for q in range(4):
                    p = 2 + 2 * q if q <= BOUND4 else 3 + 2 * (q - PULL2)
                    row = force[p] if q <= BOUND4 else rows[p]
                    bounds[r, q, at] = math.hypot(row[0], row[1])
            _look_ahead(force, rate, tables.shortest[r], levels[r], ahead[r, :, :, :, g], turn[r, :, :, :, g])
            first, second = force[0, 0], force[0, 1]
            for p in range(2 * LANES):
                taylor[r, p // LANES, 0, g, p % LANES], taylor[r, p // LANES, 1, g, p % LANES] = first, second
                share = rate * tables.shortest[r] / (p + 1)
                first, second = share * second, -share * first
    for r in range(1, count):
        for which in range(2):
            before, after = (0, r) if which == 0 else (r, 0)
            for k in range(2):
                for g in range(harmonics):
                    column = switch[r, which, k, g]
                    for i in range(2 * n):
                        change = steady[before, i, k * harmonics + g]
                        columns = tables.switch[r, which, i // n, i % n]
                        for lane in range(2 * lanes):
                            column[lane] += columns[lane] * change
                    for i in range(2 * n):
                        column[(i // n) * lanes + i % n] -= steady[after, i, k * harmonics + g]
    return Drive(steady, ahead, turn, taylor, now, bounds, switch, levels)


@njit(cache=True)
def _look_ahead(force, rate, shortest, levels, ahead, turn):
    """Columns of one harmonic: ``ahead`` (LEVELS, 2, 2, 8), ``turn`` (LEVELS, 8, 2)."""
    for level in range(levels):
        for i in range(LANES):
            if level > 0 and i < LANES // 2:
                c, s = turn[level - 1, 2 * i + 1, 0], turn[level - 1, 2 * i + 1, 1]
            else:
                angle = rate * math.ldexp(shortest, level) * (i + 1)
                c, s = math.cos(angle), math.sin(angle)
            turn[level, i, 0], turn[level, i, 1] = c, s
            for q in range(2):
                ahead[level, q, 0, i] = force[q, 0] * c + force[q, 1] * s
                ahead[level, q, 1, i] = force[q, 1] * c - force[q, 0] * s


@njit(cache=True)
def shortest_intervals(regimes, step_phase, drive_rate):
    """Shortest interval of each regime [s], in which neither its fastest mode nor the drive turns by more."""
    return step_phase / np.maximum(regimes.fastest, drive_rate)
