"""Constant tables of a machine of a few modes and one gap: what its coordinates are, and show, at instants ahead.

The tables of the structure depend on neither speed, force nor gap and are made once. Those of the drive add the
columns of its harmonics at one speed. Both look ahead by intervals of ``shortest`` 2^level; at level 0 the fastest mode
turns by ``step_phase`` in one.

What a regime shows is the tip displacement where no surface acts, and the force of a surface where one presses.

All tables of a regime lie in one row of numbers, where ``table_places`` and ``drive_places`` tell their beginnings.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from chaosgym.core.lanes import LANES, aligned, padded
from chaosgym.core.propagator import block, bound, derivative, steady_response

LEVELS = 16
"""Lengths of an interval: shortest 2^level."""

FINE = 16
"""Instants within the shortest interval from which a Taylor series goes on."""

X, V, A, SHOWN, SHOWN_RATE = 0, 1, 2, 3, 4
"""Rows of ``now``."""

BOUND2, BOUND4, PULL2, PULL4 = 0, 1, 2, 3
"""Rows of ``bounds``."""


class Tables(NamedTuple):
    """Tables of the structure, for R regimes of n blocks, padded to L lanes (a multiple of 8).

    Attributes
    ----------
    step_phase : float
        Angle [rad] by which the fastest mode of a regime turns in its shortest interval.
    shortest : (R,)
        Its length [s].
    values : (R, ...)
        Those of ``table_places``.
    """

    step_phase: float
    shortest: np.ndarray
    values: np.ndarray


@njit(cache=True)
def table_places(n):
    """Where the tables of a structure of n blocks begin in a row, and its length.

    ahead (LEVELS, 2, 2, n, 8)
        What the regime shows, and its rate, after 1 to 8 intervals, per coordinate: [quantity, coordinate, block].
    turn (LEVELS, 8, 4, L)
        Blocks of exp(B t) at the same instants.
    fine (FINE + 1, 4, L)
        The same within the shortest interval.
    generator (4, L)
        B.
    taylor (2, 2, n, 8)
        Taylor coefficients of what the regime shows, of time in shortest intervals: [half, coordinate, block].
    now (5, 2L)
        Tip displacement, velocity and acceleration, what the regime shows, and its rate.
    bounds (4, 2L)
        Bounds of the second and fourth derivative of what the regime shows, and, for a tip beyond a surface that does
        not press, the third and fifth derivative of the displacement.
    switch (2, 2, n, 2L)
        Columns of the change from regime 0 to this one and back: [which, coordinate, block].
    """
    lanes = padded(n)
    turn = LEVELS * 4 * n * LANES
    fine = turn + LEVELS * LANES * 4 * lanes
    generator = fine + (FINE + 1) * 4 * lanes
    taylor = generator + 4 * lanes
    now = taylor + 4 * n * LANES
    bounds = now + 10 * lanes
    switch = bounds + 8 * lanes
    return 0, turn, fine, generator, taylor, now, bounds, switch, switch + 8 * n * lanes


@njit(cache=True)
def drive_places(n, harmonics):
    """Where that which H harmonics of the drive add begins in a row, and its length; W is 2L + 2H, padded.

    ahead (LEVELS, 2, 2, H, 8), taylor (2, 2, H, 8), switch (2, 2, H, 2L)
        As in ``table_places``; levels longer than a cycle are left out.
    turn (LEVELS, 8, 2, H)
        Cosine and sine of the angle by which each harmonic turns.
    now (5, W), bounds (4, W)
        Those of ``table_places`` and the drive together.
    steady (2n, 2H)
        Steady modal response.
    """
    lanes = padded(n)
    width = 2 * lanes + padded(2 * harmonics)
    taylor = LEVELS * 4 * harmonics * LANES
    switch = taylor + 4 * harmonics * LANES
    turn = switch + 8 * harmonics * lanes
    now = turn + LEVELS * LANES * 2 * harmonics
    bounds = now + 5 * width
    steady = bounds + 4 * width
    return 0, taylor, switch, turn, now, bounds, steady, padded(steady + 4 * n * harmonics)


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
def tabulate(regimes, contact_stiffness, contact_damping, shortest):
    """``Tables.values`` of R regimes.

    ``contact_stiffness``, ``contact_damping`` (R,) are those of the surface that presses, 0 where none.
    ``shortest`` (R,) [s] are the shortest intervals; no rate of what moves may exceed ``Tables.step_phase`` / shortest.
    """
    count, n = regimes.generator.shape[0], regimes.generator.shape[2]
    places = table_places(n)
    values = aligned(count * places[8]).reshape((count, places[8]))
    rows, force = np.empty((7, 2 * n)), np.empty((6, 2 * n))
    for r in range(count):
        own = regimes.generator[r]
        for i in range(2 * n):
            rows[0, i] = regimes.output[r, i]
        for p in range(1, 7):
            derivative(own, rows[p - 1], rows[p])
        shown(rows, contact_stiffness[r], contact_damping[r], force)
        _tabulate(own, shortest[r], places, rows, force, values[r])
        if r > 0:
            switch, lanes = places[7], padded(n)
            forth, back = regimes.to_modal[r] @ regimes.from_modal[0], regimes.to_modal[0] @ regimes.from_modal[r]
            for column in range(2 * n):
                for i in range(2 * n):
                    at = switch + 2 * lanes * column + (i // n) * lanes + i % n
                    values[r, at], values[r, at + 4 * n * lanes] = forth[i, column], back[i, column]
    return values


@njit(cache=True)
def _tabulate(own, h, places, rows, force, values):
    """Fill a row of a structure but for ``switch``; ``rows`` (7, 2n), ``force`` (6, 2n) are what it shows."""
    ahead, turn, fine, generator, taylor, now, bounds = places[:7]
    n = own.shape[1]
    lanes = padded(n)
    size = np.empty(2 * n)
    for q in range(5):
        for i in range(2 * n):
            values[now + (2 * q + i // n) * lanes + i % n] = rows[q, i] if q <= A else force[q - SHOWN, i]
    for q in range(4):
        bound(own, force[2 + 2 * q] if q <= BOUND4 else rows[3 + 2 * (q - PULL2)], size)
        for i in range(2 * n):
            values[bounds + (2 * q + i // n) * lanes + i % n] = size[i]
    for j in range(n):
        for k in range(4):
            values[generator + k * lanes + j] = own[k, j]
        for f in range(FINE + 1):
            for k, entry in enumerate(block(own, j, h * f / FINE)):
                values[fine + (4 * f + k) * lanes + j] = entry
        for level in range(LEVELS):
            for i in range(LANES):
                e11, e12, e21, e22 = block(own, j, math.ldexp(h, level) * (i + 1))
                for k, entry in enumerate((e11, e12, e21, e22)):
                    values[turn + (4 * (LANES * level + i) + k) * lanes + j] = entry
                for q in range(2):
                    first, second = force[q, j], force[q, n + j]
                    at = ahead + ((4 * level + 2 * q) * n + j) * LANES + i
                    values[at], values[at + n * LANES] = first * e11 + second * e21, first * e12 + second * e22
        first, second = force[0, j], force[0, n + j]
        for p in range(2 * LANES):
            at = taylor + ((p // LANES) * 2 * n + j) * LANES + p % LANES
            values[at], values[at + n * LANES] = first, second
            share = h / (p + 1)
            first, second = (
                share * (first * own[0, j] + second * own[2, j]),
                share * (first * own[1, j] + second * own[3, j]),
            )


@njit(cache=True)
def put_drive(tables, regimes, contact_stiffness, contact_damping, drive, w, values):
    """Fill ``values`` (R, ...) with the columns of the drive; those of the regimes' levels (R,) that a cycle needs.

    The drive is modal forces (H, 2, n) that go with the cosine and sine of 1, 2 ... H times w [rad/s].
    """
    count, harmonics, n = values.shape[0], drive.shape[0], drive.shape[2]
    places = drive_places(n, harmonics)
    levels = np.empty(count, np.int64)
    cosine, sine, response = np.empty(2 * n), np.empty(2 * n), np.empty((2 * n, 2))
    rows, force = np.empty((7, 2)), np.empty((6, 2))
    for r in range(count):
        levels[r] = min(LEVELS, max(1, int(math.log2(2.0 * math.pi / (w * tables.shortest[r]))) + 1))
        for g in range(harmonics):
            rate = (g + 1) * w
            for i in range(2 * n):
                cosine[i], sine[i] = 0.0, 0.0
                for j in range(n):
                    cosine[i] += regimes.to_modal[r, i, n + j] * drive[g, 0, j]
                    sine[i] += regimes.to_modal[r, i, n + j] * drive[g, 1, j]
            steady_response(regimes.generator[r], cosine, sine, rate, response)
            for k in range(2):
                rows[0, k] = 0.0
                for i in range(2 * n):
                    values[r, places[6] + 2 * harmonics * i + k * harmonics + g] = response[i, k]
                    rows[0, k] += regimes.output[r, i] * response[i, k]
            for p in range(1, 7):
                rows[p, 0], rows[p, 1] = rate * rows[p - 1, 1], -rate * rows[p - 1, 0]
            shown(rows, contact_stiffness[r], contact_damping[r], force)
            _tabulate_harmonic(rows, force, g, rate, tables.shortest[r], levels[r], places, n, harmonics, values[r])
        _put_now(tables.values[r], table_places(n), places, padded(n), padded(2 * harmonics), values[r])
        if r > 0:
            _put_switch(tables.values[r], table_places(n)[7], places, n, harmonics, values, r)
    return levels


@njit(cache=True)
def _put_now(table, structure, places, lanes, more, values):
    """Fill the structure's part of ``now`` and ``bounds`` in a row of the drive, which has ``more`` coordinates."""
    for source, target, quantities in ((structure[5], places[4], 5), (structure[6], places[5], 4)):
        for q in range(quantities):
            for lane in range(2 * lanes):
                values[target + q * (2 * lanes + more) + lane] = table[source + q * 2 * lanes + lane]


@njit(cache=True)
def _tabulate_harmonic(rows, force, g, rate, shortest, levels, places, n, harmonics, values):
    """Fill the columns of harmonic g at ``rate`` in a row of the drive but for ``steady`` and ``switch``."""
    ahead, taylor, _, turn, now, bounds = places[:6]
    lanes = padded(n)
    width = 2 * lanes + padded(2 * harmonics)
    for k in range(2):
        at = 2 * lanes + k * harmonics + g
        for q in range(5):
            values[now + q * width + at] = rows[q, k] if q <= A else force[q - SHOWN, k]
        for q in range(4):
            row = force[2 + 2 * q] if q <= BOUND4 else rows[3 + 2 * (q - PULL2)]
            values[bounds + q * width + at] = math.hypot(row[0], row[1])
    for level in range(levels):
        for i in range(LANES):
            at = turn + (LANES * level + i) * 2 * harmonics + g
            if level > 0 and i < LANES // 2:
                before = at + (i + 1 - LANES) * 2 * harmonics
                c, s = values[before], values[before + harmonics]
            else:
                angle = rate * math.ldexp(shortest, level) * (i + 1)
                c, s = math.cos(angle), math.sin(angle)
            values[at], values[at + harmonics] = c, s
            for q in range(2):
                at = ahead + ((4 * level + 2 * q) * harmonics + g) * LANES + i
                values[at] = force[q, 0] * c + force[q, 1] * s
                values[at + harmonics * LANES] = force[q, 1] * c - force[q, 0] * s
    first, second = force[0, 0], force[0, 1]
    for p in range(2 * LANES):
        at = taylor + ((p // LANES) * 2 * harmonics + g) * LANES + p % LANES
        values[at], values[at + harmonics * LANES] = first, second
        share = rate * shortest / (p + 1)
        first, second = share * second, -share * first


@njit(cache=True)
def _put_switch(table, switch, places, n, harmonics, values, r):
    """Fill ``switch`` of regime r, once ``steady`` is known in it and in regime 0."""
    target, steady, lanes = places[2], places[6], padded(n)
    for which in range(2):
        before, after = (0, r) if which == 0 else (r, 0)
        for k in range(2):
            for g in range(harmonics):
                column = target + ((which * 2 + k) * harmonics + g) * 2 * lanes
                for i in range(2 * n):
                    change = values[before, steady + 2 * harmonics * i + k * harmonics + g]
                    source = switch + (which * 2 * n + i) * 2 * lanes
                    for lane in range(2 * lanes):
                        values[r, column + lane] += table[source + lane] * change
                for i in range(2 * n):
                    lane = (i // n) * lanes + i % n
                    values[r, column + lane] -= values[after, steady + 2 * harmonics * i + k * harmonics + g]


@njit(cache=True)
def shortest_intervals(regimes, step_phase, drive_rate):
    """Shortest interval of each regime [s], in which neither its fastest mode nor the drive turns by more.

    Where neither turns, as of a rigid body alone, it is that of the fastest regime.
    """
    fastest = np.max(regimes.fastest)
    shortest = np.empty(regimes.fastest.shape[0])
    for r in range(shortest.shape[0]):
        rate = max(regimes.fastest[r], drive_rate)
        shortest[r] = step_phase / (rate if rate > 0.0 else fastest if fastest > 0.0 else 1.0)
    return shortest
