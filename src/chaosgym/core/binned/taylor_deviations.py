r"""Small deviations of a mechanism that moves by its Taylor series: the series' own derivative, and touches.

A deviation of the motion has a Taylor series too. Its coefficients follow from those of the motion by the derivatives
of the recurrences of ``taylor_series``, for the distance D, the force N and the weight W = N / D of each closed joint:

    sum e_r de_r = D dD        dN = k dD + d dD'        dN = D dW + W dD        d(W e_r) = e_r dW + W de_r

Where a joint is touched its damper pushes at once, each deviation at its own time (saltation, ``core.tangent``).
Contacts are linear: the derivative of a Hertzian force is singular at the surface.
"""

from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable

from chaosgym.core.binned.lanes import add_rows, add_sums, next_term
from chaosgym.core.binned.model import FORCING_TERMS
from chaosgym.core.binned.series import SHARES
from chaosgym.core.binned.taylor_series import ORDER
from chaosgym.core.binned.taylor_view import DEPTH, RATE
from chaosgym.core.kernel import leaf, part
from chaosgym.core.lanes import LANES, add_columns, aligned, padded

TERMS = ORDER + 1
"""Coefficients of a series."""

DISTANCE, FORCE, WEIGHT = range(3)
"""Series of a closed joint."""


class Deviations(NamedTuple):
    """Taylor coefficients of some deviations, rows of ``width`` numbers, and what they are multiplied with.

    In ``own`` begin: ``motion`` (TERMS, n) rows of the coordinates, ``readings`` (R, TERMS) rows, ``joints``
    (3, J, TERMS) rows, ``pushes`` (R + S) rows of one order in each direction and of each friction, ``loads`` (n)
    rows of what they accelerate, ``fresh`` (2n) rows to work in. Numbers: ``matrix`` (n, 2n) and ``answer``
    (n, R + S) of the bin, ``rows`` (R, n), ``known`` (R + 2J, TERMS) series of the motion, last terms first, and
    ``powers`` (2, TERMS) of time.
    """

    own: np.ndarray
    width: int
    motion: int
    readings: int
    joints: int
    pushes: int
    loads: int
    fresh: int
    matrix: int
    answer: int
    rows: int
    known: int
    powers: int


@register_jitable
def new_deviations(model, count):
    """Return ``count`` deviations of a model, all zero."""
    width, joints = padded(count), model.gap.shape[0]
    rows, n = model.row.shape
    pushed = model.acceleration.shape[1] - 2 * n - FORCING_TERMS
    readings = width * TERMS * n
    series = readings + width * TERMS * rows
    pushes = series + width * TERMS * 3 * joints
    loads = pushes + width * pushed
    fresh = loads + width * n
    matrix = fresh + width * 2 * n
    answer = matrix + 2 * n * n
    read = answer + n * pushed
    known = read + rows * n
    powers = known + TERMS * (rows + 2 * joints)
    own = aligned(powers + 2 * TERMS if width > 0 else 0)
    if width > 0:
        for r in range(rows):
            for i in range(n):
                own[read + r * n + i] = model.row[r, i]
    return Deviations(own, width, 0, readings, series, pushes, loads, fresh, matrix, answer, read, known, powers)


@part
def series_at(model, d, kind, j):
    """Where a series of deviations of joint j begins."""
    return d.joints + (kind * model.gap.shape[0] + j) * TERMS * d.width


@part
def known_at(model, d, kind, j):
    """Where a series of joint j's motion begins, last terms first."""
    return d.known + (model.row.shape[0] + kind * model.gap.shape[0] + j) * TERMS


@part
def clear(d, at):
    """Set a row to zero."""
    for c in range(at, at + d.width):
        d.own[c] = 0.0


@part
def add_product(d, known, at, last, k, factor, total):
    """Add ``factor`` times coefficient k of a series of the motion times one of deviations, its terms up to ``last``.

    ``known`` and ``at`` are where both begin.
    """
    add_sums(d.own, at, d.width, last + 1, known + ORDER - k, factor, total)


@leaf
def put_deviations(model, vectors, d):
    """Write deviations (m, 2n) of the state into the first two terms of their series."""
    for i in range(vectors.shape[1]):
        for c in range(vectors.shape[0]):
            d.own[d.motion + i * d.width + c] = vectors[c, i]


@leaf
def take_deviations(model, d, vectors):
    """Write the first two terms of the series into deviations (m, 2n) of the state."""
    for i in range(vectors.shape[1]):
        for c in range(vectors.shape[0]):
            vectors[c, i] = d.own[d.motion + i * d.width + c]


@part
def read_rows(model, order, d):
    """Write what the joints read of one order of the coordinates."""
    rows, n = model.row.shape
    at = d.motion + order * n * d.width
    for r in range(rows):
        out = d.readings + (r * TERMS + order) * d.width
        add_columns(d.own, at, d.width, n, d.own, d.rows + r * n, d.own, out, LANES)


@leaf
def put_matrices(model, b, d):
    """Write the matrices of bin b, a row for each coordinate's acceleration."""
    rows, n = model.row.shape
    a, driven, pushed = model.acceleration[b], 2 * n + FORCING_TERMS, (d.loads - d.pushes) // d.width
    for i in range(n):
        for c in range(2 * n):
            d.own[d.matrix + i * 2 * n + c] = a[c, rows + i]
        for p in range(pushed):
            d.own[d.answer + i * pushed + p] = a[driven + p, rows + i]


@leaf
def put_known(model, series, d):
    """Write the series of the motion that deviations are multiplied with, last terms first."""
    rows, joints = model.row.shape[0], model.gap.shape[0]
    for k in range(TERMS):
        for r in range(rows):
            d.own[d.known + r * TERMS + ORDER - k] = series.lanes[k, r]
        for j in range(joints):
            d.own[known_at(model, d, 0, j) + ORDER - k] = series.distance[j, k]
            d.own[known_at(model, d, 1, j) + ORDER - k] = series.weight[j, k]


@leaf
def deviate_distance(model, j, k, series, d):
    """Write coefficient k of the deviations of a closed joint's distance."""
    low, high, w = model.first[j], model.first[j + 1], d.width
    first = series_at(model, d, DISTANCE, j)
    clear(d, first + k * w)
    if series.side[j] != 0.0:
        add_rows(d.own, d.readings + (low * TERMS + k) * w, series.side[j], first + k * w, w)
        return
    share = 1.0 / series.distance[j, 0]
    for r in range(low, high):
        add_product(d, d.known + r * TERMS, d.readings + r * TERMS * w, k, k, share, first + k * w)
    if k > 0:
        add_product(d, known_at(model, d, 0, j), first, k - 1, k, -share, first + k * w)


@leaf
def deviate_force(model, j, k, series, d):
    """Write coefficient k of the deviations of a closed joint's force; its distance is known one order further."""
    stiffness, damping, w = model.stiffness[j], model.damping[j], d.width
    by, first = series_at(model, d, DISTANCE, j), series_at(model, d, FORCE, j)
    clear(d, first + k * w)
    add_rows(d.own, by + k * w, stiffness, first + k * w, w)
    add_rows(d.own, by + (k + 1) * w, damping * (k + 1.0), first + k * w, w)


@leaf
def deviate_joint(model, j, k, series, d):
    """Add coefficient k of the deviations of what a closed joint pushes to ``pushes``."""
    low, high, w = model.first[j], model.first[j + 1], d.width
    if k == 0:
        deviate_distance(model, j, 0, series, d)
    deviate_distance(model, j, k + 1, series, d)
    deviate_force(model, j, k, series, d)
    force = series_at(model, d, FORCE, j) + k * w
    if model.slides[j] >= 0:
        add_rows(d.own, force, 1.0, d.pushes + (model.row.shape[0] + model.slides[j]) * w, w)
    if series.side[j] != 0.0:
        add_rows(d.own, force, series.side[j], d.pushes + low * w, w)
        return
    share, by, weight = 1.0 / series.distance[j, 0], series_at(model, d, DISTANCE, j), series_at(model, d, WEIGHT, j)
    clear(d, weight + k * w)
    add_rows(d.own, force, share, weight + k * w, w)
    add_product(d, known_at(model, d, 1, j), by, k, k, -share, weight + k * w)
    if k > 0:
        add_product(d, known_at(model, d, 0, j), weight, k - 1, k, -share, weight + k * w)
    for r in range(low, high):
        add_product(d, d.known + r * TERMS, weight, k, k, 1.0, d.pushes + r * w)
        add_product(d, known_at(model, d, 1, j), d.readings + r * TERMS * w, k, k, 1.0, d.pushes + r * w)


@leaf
def load(model, k, closed, series, d):
    """Write coefficient k of the deviations of what the closed joints accelerate."""
    n, w = model.row.shape[1], d.width
    pushed = (d.loads - d.pushes) // w
    read_rows(model, k + 1, d)
    for p in range(pushed):
        clear(d, d.pushes + p * w)
    for j in range(closed.shape[0]):
        if closed[j]:
            deviate_joint(model, j, k, series, d)
    for i in range(n):
        at = d.answer + i * pushed
        add_columns(d.own, d.pushes, w, pushed, d.own, at, d.own, d.loads + i * w, LANES)


@leaf
def expand_deviations(model, b, closed, series, d):
    """Continue the series of deviations in bin b from their first two terms, as that of the motion was."""
    n, w, touching = model.row.shape[1], d.width, False
    put_matrices(model, b, d)
    for j in range(closed.shape[0]):
        touching = touching or closed[j]
    if touching:
        put_known(model, series, d)
        read_rows(model, 0, d)
    for i in range(n):
        clear(d, d.loads + i * w)
    for k in range(ORDER - 1):
        older = d.motion + k * n * w
        old, new = older + n * w, older + 2 * n * w
        if touching:
            load(model, k, closed, series, d)
        for i in range(n):
            at = d.matrix + i * 2 * n
            more = d.loads + i * w
            next_term(d.own, older, old, w, n, d.own, at, at + n, more, k + 1.0, SHARES[k], new + i * w)


@leaf
def move_deviations(model, h, d):
    """Advance deviations by a time in the span of their series: its sums become the first two terms."""
    n, power = model.row.shape[1], 1.0
    block = n * d.width
    for k in range(TERMS):
        d.own[d.powers + k], d.own[d.powers + TERMS + k] = power, (k + 1.0) * power
        power *= h
    add_columns(d.own, d.motion, block, TERMS, d.own, d.powers, d.own, d.fresh, LANES)
    add_columns(d.own, d.motion + block, block, ORDER, d.own, d.powers + TERMS, d.own, d.fresh + block, LANES)
    for c in range(2 * block):
        d.own[d.motion + c] = d.own[d.fresh + c]


@leaf
def jump_at_touch(model, b, j, view, d):
    """Saltation where joint j was touched: its damper acts at once. Nothing jumps where its force begins at zero."""
    rows, n = model.row.shape
    rate, damping, w = view.joint[j, RATE], model.damping[j], d.width
    if not model.stiffness[j] * view.joint[j, DEPTH] < 0.5 * damping * rate:
        return
    driven, a = 2 * n + FORCING_TERMS, model.acceleration[b]
    clear(d, d.fresh)
    for r in range(model.first[j], model.first[j + 1]):
        for i in range(n):
            add_rows(d.own, d.motion + i * w, view.direction[r] * model.row[r, i], d.fresh, w)
    for i in range(n):
        push = 0.0
        for r in range(model.first[j], model.first[j + 1]):
            push += view.direction[r] * a[driven + r, rows + i]
        if model.slides[j] >= 0:
            push += a[driven + rows + model.slides[j], rows + i]
        add_rows(d.own, d.fresh, damping * push, d.motion + (n + i) * w, w)
