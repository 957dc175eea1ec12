r"""The Taylor series of a mechanism between two changes of contact: its coordinates, and the forces of closed joints.

Each coefficient follows from those before it, the force's by the recurrences of products, quotients and powers (Jorba
and Zou, 2005). A series serves for a span, whose length its last coefficients tell.

References
----------
A. Jorba, M. Zou, A software package for the numerical integration of ODEs by means of high-order Taylor methods,
Experimental Mathematics 14 (2005) 99-117.
"""

import math
from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable

from chaosgym.core.binned.lanes import next_term
from chaosgym.core.binned.model import FORCING_TERMS, HERTZ, LINEAR
from chaosgym.core.binned.series import SHARES, shift_forcing
from chaosgym.core.kernel import leaf, part
from chaosgym.core.lanes import LANES, add_columns

ORDER = 16
"""Last power of time in a series: fewer cost more spans, more cost more than they save."""

LEAST_DEPTH = 1e-12
"""Least penetration [m] of the series of a Hertzian force, which has none at the surface; a force of some nN."""


class Series(NamedTuple):
    """Taylor coefficients of a motion, in seconds.

    ``lanes`` (ORDER + 1, lanes) of readings and coordinates; (J, ORDER + 1) of each closed joint: ``distance`` |e|,
    ``power`` x^n, ``force`` N and ``weight`` N / |e|. ``side`` (J,) is the sign of e where the force does not turn,
    else 0; ``factors`` (4 + R + S,) of the columns of ``acceleration`` after those of the state; ``powers`` (4,) of x.
    """

    lanes: np.ndarray
    distance: np.ndarray
    power: np.ndarray
    force: np.ndarray
    weight: np.ndarray
    side: np.ndarray
    factors: np.ndarray
    powers: np.ndarray


@register_jitable
def new_series(model):
    """Return a series that begins at rest."""
    joints, columns = model.gap.shape[0], model.acceleration.shape[1] - 2 * model.row.shape[1]
    lanes = np.zeros((ORDER + 1, model.acceleration.shape[2]))
    distance, power, force, weight = np.zeros((4, joints, ORDER + 1))
    factors, powers = np.zeros(columns), np.ones(FORCING_TERMS)
    return Series(lanes, distance, power, force, weight, np.zeros(joints), factors, powers)


@leaf
def begin(model, z, series):
    """Write the state z (2n,) into the first two terms of a series."""
    rows, n = model.row.shape
    for order in range(2):
        lanes = series.lanes[order]
        for i in range(n):
            lanes[rows + i] = z[order * n + i]
        for r in range(rows):
            total = 0.0
            for i in range(n):
                total += model.row[r, i] * z[order * n + i]
            lanes[r] = total


@part
def square(a, k, first):
    """Coefficient k of the square of a series, of its coefficients from ``first`` on."""
    total = 0.0
    for i in range(first, (k + 1) // 2):
        total += a[i] * a[k - i]
    total *= 2.0
    if k % 2 == 0:
        total += a[k // 2] * a[k // 2]
    return total


@part
def product(a, b, k, first):
    """Coefficient k of the product of two series, of the coefficients of the first from ``first`` on."""
    total = 0.0
    for i in range(first, k + 1):
        total += a[i] * b[k - i]
    return total


@part
def extend_distance(model, j, k, series):
    """Write coefficient k > 0 of the distance of a closed joint from the middle of its gap."""
    low, high = model.first[j], model.first[j + 1]
    lanes, distance = series.lanes, series.distance[j]
    if series.side[j] != 0.0:
        distance[k] = series.side[j] * lanes[k, low]
        return
    total = -square(distance, k, 1)
    for r in range(low, high):
        total += square(lanes[:, r], k, 0)
    distance[k] = total * (0.5 / distance[0])


@part
def begin_joint(model, j, series):
    """Write the first coefficient of the distance of a closed joint, and its side."""
    low, high = model.first[j], model.first[j + 1]
    size = 0.0
    for r in range(low, high):
        size += series.lanes[0, r] * series.lanes[0, r]
    if high - low > 1 and size > 0.0:
        series.side[j] = 0.0
        series.distance[j, 0] = math.sqrt(size)
    else:
        series.side[j] = -1.0 if model.two_sided[j] and series.lanes[0, low] < 0.0 else 1.0
        series.distance[j, 0] = series.side[j] * series.lanes[0, low]


@leaf
def root_of(depth, exponent):
    """Penetration to the power of an exponent less one; called, since it is rare and would spoil its callers."""
    if exponent == HERTZ:
        return math.sqrt(depth)
    return depth ** (exponent - 1.0)


@part
def extend_force(model, j, k, series):
    """Write coefficient k of the force (1) or (2) of a closed joint; its distance is known one order further."""
    distance, force, power = series.distance[j], series.force[j], series.power[j]
    stiffness, damping = model.stiffness[j], model.damping[j]
    depth = distance[0] - model.gap[j]
    exponent = model.exponent[j]
    if exponent == LINEAR:
        force[k] = stiffness * (depth if k == 0 else distance[k]) + damping * (k + 1.0) * distance[k + 1]
        return
    depth = max(depth, LEAST_DEPTH)
    if k == 0:
        power[0] = depth * root_of(depth, exponent)
    else:
        total = 0.0
        for i in range(1, k + 1):
            total += ((exponent + 1.0) * i - k) * distance[i] * power[k - i]
        power[k] = total / (k * depth)
    total = power[k]
    for i in range(k + 1):
        total += damping * power[i] * (k - i + 1.0) * distance[k - i + 1]
    force[k] = stiffness * total


@part
def extend_joint(model, j, k, series):
    """Write coefficient k of what a closed joint pushes into ``factors``."""
    low, high = model.first[j], model.first[j + 1]
    extend_distance(model, j, k + 1, series)
    extend_force(model, j, k, series)
    distance, force, weight = series.distance[j], series.force[j], series.weight[j]
    along = series.factors[FORCING_TERMS:]
    if model.slides[j] >= 0:
        along[model.row.shape[0] + model.slides[j]] += force[k]
    if series.side[j] != 0.0:
        along[low] = series.side[j] * force[k]
        return
    weight[k] = (force[k] - product(distance, weight, k, 1)) * (1.0 / distance[0])
    for r in range(low, high):
        along[r] = product(weight, series.lanes[:, r], k, 0)


@leaf
def expand(model, b, time, closed, last, series):
    """Continue a series about ``time`` in bin b from its first two terms up to the order ``last``."""
    lanes, a, factors = series.lanes, model.acceleration[b], series.factors
    rows, n = model.row.shape
    width, driven = lanes.shape[1], a[2 * n :]
    for k in range(1, FORCING_TERMS):
        series.powers[k] = series.powers[k - 1] * time / model.bin_duration
    for i in range(factors.shape[0]):
        factors[i] = 0.0
    for j in range(closed.shape[0]):
        if closed[j]:
            begin_joint(model, j, series)
    scale = 1.0
    for k in range(last - 1):
        skipped = min(k, FORCING_TERMS)
        shift_forcing(series.powers, 0, k, scale, factors, 0)
        scale /= model.bin_duration
        for i in range(FORCING_TERMS + rows, factors.shape[0]):
            factors[i] = 0.0
        for j in range(closed.shape[0]):
            if closed[j]:
                extend_joint(model, j, k, series)
        older, new = k * width + rows, (k + 2) * width
        add_columns(driven, skipped * width, width, driven.shape[0] - skipped, factors, skipped, lanes, new, LANES)
        next_term(a, 0, n * width, width, n, lanes, older, older + width, new, k + 1.0, SHARES[k], new)


@part
def span(series, tolerance, longest):
    """Time [s] at which the last two terms of the velocity reach the tolerance, at most ``longest``."""
    for k in range(ORDER - 1, ORDER + 1):
        largest = 0.0
        for i in range(series.lanes.shape[1]):
            largest = max(largest, k * abs(series.lanes[k, i]))
        if largest > 0.0:
            longest = min(longest, (tolerance / largest) ** (1.0 / (k - 1)))
    return longest
