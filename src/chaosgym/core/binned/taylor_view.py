"""What the joints of a mechanism do at an instant of its Taylor series: penetrations, forces and what keeps each state.

Joint j reads e = (row_1 . p, row_2 . p, ...) and pushes along e / |e| with a force N of penetration x = |e| - c:

    (1)  linear                     N = k x + d x'
    (2)  Hertz with dissipation     N = K x^n (1 + chi x'), n = 3/2     (Hunt and Crossley, 1975)

as long as x and N are positive.
"""

import math
from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable

from chaosgym.core.binned.lanes import sum_series
from chaosgym.core.binned.model import LINEAR
from chaosgym.core.binned.record import resultant
from chaosgym.core.binned.taylor_series import ORDER, root_of
from chaosgym.core.kernel import part

DEPTH, RATE, MARGIN, FORCE, CHANGE = range(5)
"""Columns of ``View.joint``."""


class View(NamedTuple):
    """What the joints do at an instant.

    ``lanes`` (3, all or those of the readings): values and their first two derivatives; ``direction`` (R,): unit
    vector of each joint's force on its surface; ``joint`` (J, 5): penetration and its rate, ``margin``, and of closed
    joints the force and its rate.
    """

    lanes: np.ndarray
    direction: np.ndarray
    joint: np.ndarray


@register_jitable
def new_view(model, width):
    """Return a view of some lanes."""
    return View(np.zeros((3, width)), np.zeros(model.row.shape[0]), np.zeros((model.gap.shape[0], 5)))


@part
def measure(model, j, view):
    """Penetration and its rate of joint j; writes the direction of its force."""
    lanes, direction = view.lanes, view.direction
    low, high = model.first[j], model.first[j + 1]
    if not model.two_sided[j]:
        # one row: e counts with its sign
        direction[low] = 1.0
        return lanes[0, low] - model.gap[j], lanes[1, low]
    size, along = 0.0, 0.0
    for r in range(low, high):
        size += lanes[0, r] * lanes[0, r]
        along += lanes[0, r] * lanes[1, r]
    size = math.sqrt(size)
    if size == 0.0:
        for r in range(low, high):
            direction[r] = 1.0 if r == low else 0.0
        return -model.gap[j], 0.0
    for r in range(low, high):
        direction[r] = lanes[0, r] / size
    return size - model.gap[j], along / size


@part
def margin(model, j, closed, depth, rate):
    """What is positive as long as joint j keeps its contact state; its sign is that of the force, or of the gap."""
    if model.exponent[j] == LINEAR:
        force = depth + model.damping[j] / model.stiffness[j] * rate
    else:
        force = depth * (1.0 + model.damping[j] * rate)
    return force if closed else -min(depth, force)


@part
def push(model, j, view):
    """Force (1) or (2) of a closed joint and its rate, continued beyond its end so that an event can be located."""
    depth, rate = view.joint[j, DEPTH], view.joint[j, RATE]
    bend = 0.0
    for r in range(model.first[j], model.first[j + 1]):
        bend += view.direction[r] * view.lanes[2, r]
    stiffness, damping = model.stiffness[j], model.damping[j]
    exponent = model.exponent[j]
    if exponent == LINEAR:
        return stiffness * depth + damping * rate, stiffness * rate + damping * bend
    root = root_of(abs(depth), exponent)
    growth = exponent * rate * (1.0 + damping * rate) + max(depth, 0.0) * damping * bend
    return stiffness * depth * root * (1.0 + damping * rate), stiffness * root * growth


@part
def look(model, closed, view):
    """Write directions and joints of a view from its readings; returns the ``resultant`` of the monitored joint."""
    fx, fy, fz, rx, ry, rz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(closed.shape[0]):
        depth, rate = measure(model, j, view)
        view.joint[j, DEPTH], view.joint[j, RATE] = depth, rate
        view.joint[j, MARGIN] = margin(model, j, closed[j], depth, rate)
        if not closed[j]:
            continue
        force, change = push(model, j, view)
        view.joint[j, FORCE], view.joint[j, CHANGE] = force, change
        if model.monitored[j]:
            for r in range(model.first[j], model.first[j + 1]):
                direction = view.direction[r]
                fx += model.reading[r, 0] * direction * force
                fy += model.reading[r, 1] * direction * force
                fz += model.reading[r, 2] * direction * force
                rx += model.reading[r, 0] * direction * change
                ry += model.reading[r, 1] * direction * change
                rz += model.reading[r, 2] * direction * change
    return resultant(fx, fy, fz, rx, ry, rz)


@part
def read(series, time, view):
    """Write the lanes of a view at a time in the span of a series."""
    sum_series(series.lanes, 0, series.lanes.shape[1], ORDER, time, view.lanes, 0, view.lanes.shape[1])


@part
def look_at(model, series, time, closed, view):
    """As ``look``, at a time in the span of a series."""
    read(series, time, view)
    return look(model, closed, view)


@part
def look_first(model, series, closed, view):
    """As ``look_at``, at the beginning of a series."""
    for k in range(3):
        for i in range(view.lanes.shape[1]):
            view.lanes[k, i] = series.lanes[k, i] if k < 2 else 2.0 * series.lanes[k, i]
    return look(model, closed, view)


@part
def lowest_margin(view):
    """Smallest margin of all joints: positive as long as none changes its contact state."""
    lowest = math.inf
    for j in range(view.joint.shape[0]):
        lowest = min(lowest, view.joint[j, MARGIN])
    return lowest


@part
def read_state(model, view, z):
    """Write the state of a view of all lanes into z (2n,)."""
    rows, n = model.row.shape
    for i in range(n):
        z[i], z[n + i] = view.lanes[0, rows + i], view.lanes[1, rows + i]
