r"""Contacts of the slider crank: when they begin and end.

A channel's margin is positive as long as it keeps its contact state. Whether it may have fallen to zero within a step
is judged by the cubic through both ends; when it did is found on the Taylor series of the motion. The cubic is off by
(w h)^4 / 384 of the motion's amplitude for a mode of angular frequency w and a step h; shorter touches can escape.
"""

import math

import numpy as np
from numba import njit

from chaosgym.core.cubic import cubic, cubic_extremum
from chaosgym.core.kernel import leaf

GAP, STIFFNESS, DAMPING, TWO_SIDED, ALONG, UP, SIDEWAYS, REACH = range(8)
"""Columns of ``surfaces``."""

POLISH = 60
"""Iterations to locate one event; safeguarded Newton needs two to four, bisection about fifty."""


@njit(cache=True)
def surfaces(model):
    """All that is known of the m channels of a model, (m, 8): fewer arrays to hand on make a faster kernel."""
    surface = np.empty((model.gap.shape[0], 8))
    for j in range(surface.shape[0]):
        surface[j, GAP], surface[j, STIFFNESS], surface[j, DAMPING] = model.gap[j], model.stiffness[j], model.damping[j]
        surface[j, TWO_SIDED] = 1.0 if model.two_sided[j] else 0.0
        surface[j, ALONG:REACH] = model.reading[j]
        surface[j, REACH] = model.reach[j]
    return surface


@leaf
def closes(surface, j, side, y, v):
    """True if channel j at displacement y and velocity v presses on ``side``."""
    depth = side * y - surface[j, GAP]
    return depth > 0.0 and surface[j, STIFFNESS] * depth + surface[j, DAMPING] * side * v > 0.0


@leaf
def find_sides(surface, reading, side):
    """Write which side of every channel is closed, from displacements and velocities ``reading`` (3, m)."""
    for j in range(side.shape[0]):
        y, v = reading[0, j], reading[1, j]
        side[j] = 0.0
        if closes(surface, j, 1.0, y, v):
            side[j] = 1.0
        elif surface[j, TWO_SIDED] != 0.0 and closes(surface, j, -1.0, y, v):
            side[j] = -1.0


@leaf
def polynomial(series, column, last, t):
    """Value, first and second derivative at t of a column of Taylor coefficients up to order ``last``."""
    value, slope, bend = series[last, column], 0.0, 0.0
    for k in range(last - 1, -1, -1):
        bend = bend * t + slope
        slope = slope * t + value
        value = value * t + series[k, column]
    return value, slope, 2.0 * bend


@leaf
def margin(surface, j, side, closed, series, column, last, t):
    """(value, slope) of what is positive as long as a channel keeps its contact state on ``side``.

    Closed: the contact force. Open: how much is missing until the surface pushes, a penetration without force
    included.
    """
    y, v, a = polynomial(series, column, last, t)
    k, d = surface[j, STIFFNESS], surface[j, DAMPING]
    spring, damper = k * (side * y - surface[j, GAP]), d * side * v
    if closed:
        return spring + damper, side * (k * v + d * a)
    if damper < 0.0:
        return -spring - damper, -side * (k * v + d * a)
    return -spring, -side * k * v


@leaf
def locate(surface, j, side, closed, series, column, last, low, until, tolerance):
    """Instant in [low, until] at which the margin of channel j has fallen to zero, or inf if it has not."""
    high = until
    value, slope = margin(surface, j, side, closed, series, column, last, until)
    if value > 0.0:
        return math.inf
    t = until
    for _ in range(POLISH):
        guess = t - value / slope if slope < 0.0 else math.inf
        change = guess - t
        if not low <= guess <= high:
            guess = 0.5 * (low + high)
            change = high - low
        t = guess
        if abs(change) <= tolerance:
            break
        value, slope = margin(surface, j, side, closed, series, column, last, t)
        if value > 0.0:
            low = t
        else:
            high = t
    return t


@leaf
def suspect_closed(surface, j, side, h, start, end):
    """Instant in (0, h] until which a closed channel may have lost its force, or -1."""
    k, d, c = surface[j, STIFFNESS], surface[j, DAMPING], surface[j, GAP]
    f1 = k * (side * end[0, j] - c) + d * side * end[1, j]
    if f1 <= 0.0:
        return h
    r0, r1 = side * (k * start[1, j] + d * start[2, j]), side * (k * end[1, j] + d * end[2, j])
    if r0 >= 0.0 or r1 <= 0.0:
        return -1.0
    f0 = k * (side * start[0, j] - c) + d * side * start[1, j]
    dip = cubic_extremum(f0, r0, f1, r1, h, 1.0)
    return dip if dip > 0.0 and cubic(f0, r0, f1, r1, h, dip)[0] <= 0.0 else -1.0


@leaf
def suspect_open(surface, j, side, h, start, end):
    """Instant in (0, h] until which an open channel may have begun to push on ``side``, or -1."""
    if closes(surface, j, side, end[0, j], end[1, j]):
        return h
    v0, v1 = side * start[1, j], side * end[1, j]
    if v0 <= 0.0 or v1 >= 0.0:
        return -1.0
    depth0, depth1 = side * start[0, j] - surface[j, GAP], side * end[0, j] - surface[j, GAP]
    top = cubic_extremum(depth0, v0, depth1, v1, h, -1.0)
    return top if top > 0.0 and cubic(depth0, v0, depth1, v1, h, top)[0] > 0.0 else -1.0


@leaf
def find_suspects(surface, side, h, start, end, until, towards):
    """How many channels may have changed their contact in a step; writes until when (or -1) and on which side."""
    count = 0
    for j in range(side.shape[0]):
        if side[j] != 0.0:
            towards[j] = side[j]
            until[j] = suspect_closed(surface, j, side[j], h, start, end)
        else:
            towards[j] = 1.0
            until[j] = suspect_open(surface, j, 1.0, h, start, end)
            if until[j] < 0.0 and surface[j, TWO_SIDED] != 0.0:
                towards[j] = -1.0
                until[j] = suspect_open(surface, j, -1.0, h, start, end)
        if until[j] >= 0.0:
            count += 1
    return count


@leaf
def first_change(surface, side, series, last, low, until, towards, tolerance):
    """(Channel or -1, instant) of the first change among the suspects.

    The last columns of ``series`` are the channels' Taylor coefficients up to order ``last``; ``until`` counts from
    ``low``.
    """
    first, instant = -1, math.inf
    column = series.shape[1] - side.shape[0]
    for j in range(side.shape[0]):
        if until[j] >= 0.0:
            found = locate(
                surface, j, towards[j], side[j] != 0.0, series, column + j, last, low, low + until[j], tolerance
            )
            if found < instant:
                first, instant = j, found
    return first, instant
