r"""How does a slider crank move whose joints rattle in their clearance?

Coordinates p are small motions about the nominal motion of the crank. A contact channel j measures row_j . p against
its clearance c_j on one side or on both; closed on side s = +-1 it pushes with

    |N| = k (s row.p - c) + d s row.p'    while the penetration s row.p - c and |N| are positive

so it pushes and never pulls: beyond the surface it detaches when spring and damper together would pull. The matrices
are held over each bin of crank angle, the forcing is continuous, and between two changes of contact the motion is
propagated exactly (``crank_propagator``). Changes of contact are located on the Taylor series of the motion. They are
looked for once a step by a cubic through both ends of it, whose error is (w h)^4 / 384 of the motion's amplitude
for a mode of angular frequency w and a step h; shorter touches than that can escape.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from chaosgym.core import status
from chaosgym.core.crank_propagator import FORCING_TERMS, evaluate, expand, propagate
from chaosgym.core.impact_beam import LOWER, UPPER, cubic, cubic_extremum, note_touch

RUNAWAY = 1e3
"""Coordinate [m] that counts as divergence."""

POLISH = 60
"""Iterations to locate one event; safeguarded Newton needs two to four, bisection about fifty."""


class SliderCrankModel(NamedTuple):
    """All that the kernels know of a slider crank with n coordinates and m contact channels.

    Attributes
    ----------
    bin_duration : float
        Time [s] in which the crank turns through one bin.
    steps : int
        Exact steps in a bin without events.
    contact_rate : float
        Angular frequency of the masses next to the closed contacts [rad/s].
    order : int
        Order of the Taylor series that sums a step to round-off.
    row : (m, n)
        Displacement of each channel per unit coordinate.
    gap, stiffness, damping : (m,)
        Clearance [m], contact stiffness [N/m] and damping [N s/m] of each channel.
    two_sided : (m,) bool
        True if the channel has a surface on either side, False if only where row . p is positive.
    radix : int
        2 where both sides of a channel share their matrices, 3 where friction sets them apart.
    reading : (m, 3)
        Contact force of the monitored joint (along, upward or across, sideways) per newton on a channel's positive
        side; zero for the channels of another joint.
    reach : (m,)
        Length of each channel's reading.
    display : (n,)
        Displacement of the monitored joint per unit coordinate.
    acceleration : (radix^m, bins, 2n + 4 + m, n)
        p'' per unit z, by columns, for every contact set and bin.
    curvature : (radix^m, bins, m, 2n + 4 + m)
        Second derivative of each channel's displacement per unit z.
    propagator : (radix^m, bins, 2n + 4 + m, 2n)
        p and p' one step later.
    """

    bin_duration: float
    steps: int
    contact_rate: float
    order: int
    row: np.ndarray
    gap: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    two_sided: np.ndarray
    radix: int
    reading: np.ndarray
    reach: np.ndarray
    display: np.ndarray
    acceleration: np.ndarray
    curvature: np.ndarray
    propagator: np.ndarray


@njit(cache=True, inline="always")
def closes(model, j, side, y, v):
    """True if channel j at displacement y and velocity v presses on ``side``."""
    depth = side * y - model.gap[j]
    return depth > 0.0 and model.stiffness[j] * depth + model.damping[j] * side * v > 0.0


@njit(cache=True, inline="always")
def contact_set(model, side):
    """Index of the matrices of a contact set: closed sides as digits."""
    index, place = 0, 1
    for j in range(side.shape[0]):
        if side[j] > 0.0:
            index += place
        elif side[j] < 0.0:
            index += place * (model.radix - 1)
        place *= model.radix
    return index


@njit(cache=True, inline="always")
def put_sides(model, side, z):
    """Write the clearance columns of z."""
    m = side.shape[0]
    first = z.shape[0] - m
    for j in range(m):
        z[first + j] = side[j] * model.gap[j]


@njit(cache=True, inline="always")
def put_time(z, n, x):
    """Write the forcing columns of z for time x as a share of the bin."""
    z[2 * n] = 1.0
    for k in range(1, FORCING_TERMS):
        z[2 * n + k] = z[2 * n + k - 1] * x


@njit(cache=True, inline="always")
def read_channels(model, z, y, v):
    """Displacement y and velocity v of every channel."""
    m, n = model.row.shape
    for j in range(m):
        y[j], v[j] = 0.0, 0.0
        for i in range(n):
            y[j] += model.row[j, i] * z[i]
            v[j] += model.row[j, i] * z[n + i]


@njit(cache=True)
def polynomial(coefficients, t):
    """Value, first and second derivative at t."""
    last = coefficients.shape[0] - 1
    value, slope, bend = coefficients[last], 0.0, 0.0
    for k in range(last - 1, -1, -1):
        bend = bend * t + slope
        slope = slope * t + value
        value = value * t + coefficients[k]
    return value, slope, 2.0 * bend


@njit(cache=True, inline="always")
def margin(stiffness, damping, gap, side, closed, coefficients, t):
    """(value, slope) of what is positive as long as a channel keeps its contact state on ``side``.

    Closed: the contact force. Open: how much is missing until the surface pushes, a penetration without force
    included.
    """
    y, v, a = polynomial(coefficients, t)
    spring, damper = stiffness * (side * y - gap), damping * side * v
    if closed:
        return spring + damper, side * (stiffness * v + damping * a)
    if damper < 0.0:
        return -spring - damper, -side * (stiffness * v + damping * a)
    return -spring, -side * stiffness * v


@njit(cache=True)
def locate(stiffness, damping, gap, side, closed, coefficients, until, tolerance):
    """Instant in [0, until] at which the margin of a channel has fallen to zero, or inf if it has not."""
    low, high = 0.0, until
    value, slope = margin(stiffness, damping, gap, side, closed, coefficients, until)
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
        value, slope = margin(stiffness, damping, gap, side, closed, coefficients, t)
        if value > 0.0:
            low = t
        else:
            high = t
    return t


@njit(cache=True, inline="always")
def suspect_closed(model, j, side, h, y0, v0, a0, y1, v1, a1):
    """Instant in (0, h] until which a closed channel may have lost its force, or -1."""
    k, d, c = model.stiffness[j], model.damping[j], model.gap[j]
    f1 = k * (side * y1 - c) + d * side * v1
    if f1 <= 0.0:
        return h
    r0, r1 = side * (k * v0 + d * a0), side * (k * v1 + d * a1)
    if r0 >= 0.0 or r1 <= 0.0:
        return -1.0
    f0 = k * (side * y0 - c) + d * side * v0
    dip = cubic_extremum(f0, r0, f1, r1, h, 1.0)
    return dip if dip > 0.0 and cubic(f0, r0, f1, r1, h, dip)[0] <= 0.0 else -1.0


@njit(cache=True, inline="always")
def suspect_open(model, j, side, h, y0, v0, y1, v1):
    """Instant in (0, h] until which an open channel may have begun to push on ``side``, or -1."""
    if closes(model, j, side, y1, v1):
        return h
    c = model.gap[j]
    if side * v0 <= 0.0 or side * v1 >= 0.0:
        return -1.0
    dip = cubic_extremum(side * y0 - c, side * v0, side * y1 - c, side * v1, h, -1.0)
    return dip if dip > 0.0 and cubic(side * y0 - c, side * v0, side * y1 - c, side * v1, h, dip)[0] > 0.0 else -1.0


@njit(cache=True, inline="always")
def monitored(model, j):
    """True if channel j belongs to the joint that is recorded."""
    return model.reach[j] > 0.0


@njit(cache=True, inline="always")
def column_of(model, j, side):
    """Side of the record on which a touch of channel j counts: UPPER where the force points up."""
    return UPPER if model.reading[j, 1] * side > 0.0 else LOWER


@njit(cache=True, inline="always")
def resultant(fx, fy, fz, rx, ry, rz):
    """(Upward part, size, rate of the size) of a force with components f and rates r."""
    size = math.sqrt(fx * fx + fy * fy + fz * fz)
    growth = (fx * rx + fy * ry + fz * rz) / size if size > 0.0 else 0.0
    return fy, size, growth


@njit(cache=True, inline="always")
def note_share(force, time, contact_time):
    """Add ``time`` to the side of the record (2,) towards which the resultant points."""
    if force[1] > 0.0:
        contact_time[UPPER if force[0] > 0.0 else LOWER] += time


@njit(cache=True, inline="always")
def note_peak(peak, force):
    """Raise ``peak`` (2,) to the size of the resultant."""
    column = UPPER if force[0] > 0.0 else LOWER
    peak[column] = max(peak[column], force[1])


@njit(cache=True, inline="always")
def crest_instant(h, start, end):
    """(Instant, size) of the crest of the resultant in a step, by the cubic through both ends; (-1, 0) if none."""
    if start[1] == 0.0 or end[1] == 0.0 or start[2] <= 0.0 or end[2] >= 0.0:
        return -1.0, 0.0
    crest = cubic_extremum(start[1], start[2], end[1], end[2], h, -1.0)
    if crest <= 0.0:
        return -1.0, 0.0
    return crest, cubic(start[1], start[2], end[1], end[2], h, crest)[0]


@njit(cache=True, inline="always")
def curve(curvature, z, j):
    """Second derivative of the displacement of channel j."""
    total = 0.0
    for c in range(z.shape[0]):
        total += curvature[j, c] * z[c]
    return total


@njit(cache=True)
def quiet_steps(model, chosen, b, side, z, moved, y, v, a, time, limit, peak):
    """Take up to ``limit`` whole steps in which no contact changes and no force passes ``peak`` (2,); how many.

    Stops before a step that could do either, judged by its ends: between them, a cubic exceeds the larger end by no
    more than 4/27 of the step times the sum of both slopes. z and the channels' motion y, v, a go along.
    """
    n2 = 2 * model.row.shape[1]
    m = side.shape[0]
    step = model.bin_duration / model.steps
    table = model.propagator[chosen, b]
    curvature = model.curvature[chosen, b]
    swing = 4.0 / 27.0 * step
    for c in range(n2 + FORCING_TERMS, z.shape[0]):
        moved[c] = z[c]
    for count in range(limit):
        propagate(table, z, moved)
        put_time(moved, n2 // 2, (time + (count + 1) * step) / model.bin_duration)
        fy, total = 0.0, 0.0
        for j in range(m):
            y1, v1 = 0.0, 0.0
            for i in range(n2 // 2):
                y1 += model.row[j, i] * moved[i]
                v1 += model.row[j, i] * moved[n2 // 2 + i]
            gap = model.gap[j]
            if side[j] == 0.0:
                reach = max(abs(y[j]), abs(y1))
                if v[j] * v1 < 0.0:
                    reach += swing * (abs(v[j]) + abs(v1))
                if reach >= gap:
                    return count
                continue
            k, d, s = model.stiffness[j], model.damping[j], side[j]
            r0 = s * (k * v[j] + d * a[j])
            r1 = s * (k * v1 + d * curve(curvature, moved, j))
            f0, f1 = k * (s * y[j] - gap) + d * s * v[j], k * (s * y1 - gap) + d * s * v1
            turn = swing * (abs(r0) + abs(r1)) if r0 * r1 < 0.0 else 0.0
            if min(f0, f1) - turn <= 0.0:
                return count
            fy += model.reading[j, 1] * s * f1
            total += model.reach[j] * (max(f0, f1) + turn)
        if total > peak[UPPER if fy > 0.0 else LOWER]:
            return count
        for j in range(m):
            y[j], v[j] = 0.0, 0.0
            for i in range(n2 // 2):
                y[j] += model.row[j, i] * moved[i]
                v[j] += model.row[j, i] * moved[n2 // 2 + i]
            if side[j] != 0.0:
                a[j] = curve(curvature, moved, j)
        for c in range(n2 + FORCING_TERMS):
            z[c] = moved[c]
    return limit


@njit(cache=True, nogil=True)
def advance(model, state, episode, arrays, event_tolerance, event_budget):
    """Advance ``state`` (2n,) and ``episode`` in place by whole revolutions, one for each row of ``arrays``.

    Every revolution starts at crank angle zero. ``event_tolerance`` is the error [s] of an event's instant.

    Returns
    -------
    (status, cycle) : the cycle is the first one not finished.
    """
    _, bins, size, n = model.acceleration.shape
    m = model.row.shape[0]
    duration = model.bin_duration
    step = duration / model.steps
    samples = arrays.history.shape[1]
    period = bins * duration
    z, moved, at_sample, at_crest = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    series = np.empty((model.order + 1, n))
    channel = np.empty(model.order + 1)
    side = np.empty(m)
    y0, v0, a0, y1, v1, a1 = np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(m)

    for cycle in range(arrays.section.shape[0]):
        for i in range(2 * n):
            z[i] = state[i]
        read_channels(model, z, y0, v0)
        for j in range(m):
            side[j] = 0.0
            if closes(model, j, 1.0, y0[j], v0[j]):
                side[j] = 1.0
            elif model.two_sided[j] and closes(model, j, -1.0, y0[j], v0[j]):
                side[j] = -1.0
        put_sides(model, side, z)
        arrays.section[cycle] = state
        arrays.tip[cycle, 0], arrays.tip[cycle, 1] = 0.0, 0.0
        for i in range(n):
            arrays.tip[cycle, 0] += model.display[i] * state[i]
            arrays.tip[cycle, 1] += model.display[i] * state[n + i]
        for column in range(2):
            arrays.peak_force[cycle, column] = 0.0
            arrays.impacts[cycle, column] = 0
            arrays.contact_time[cycle, column] = 0.0
            arrays.bounce_time[cycle, column] = 0.0
        events = 0
        sample = 0
        chosen = contact_set(model, side)

        for b in range(bins):
            a = model.acceleration[chosen, b]
            put_time(z, n, 0.0)
            closed = False
            for j in range(m):
                if side[j] != 0.0:
                    closed = True
                    a0[j] = curve(model.curvature[chosen, b], z, j)
            start = joint_force(model, side, y0, v0, a0)
            origin, count = 0.0, 0
            while True:
                time = origin + count * step
                left = duration - time
                whole = int(left / step + 1e-9)
                if whole > 0 and sample == samples:
                    quiet = quiet_steps(
                        model, chosen, b, side, z, moved, y0, v0, a0, time, whole, arrays.peak_force[cycle]
                    )
                    if quiet > 0:
                        count += quiet
                        time = origin + count * step
                        left = duration - time
                        start = joint_force(model, side, y0, v0, a0)
                        note_share(start, quiet * step, arrays.contact_time[cycle])
                if left <= 1e-12 * duration:
                    break
                expanded = False
                if left >= (1.0 - 1e-9) * step:
                    h = step
                    propagate(model.propagator[chosen, b], z, moved)
                else:
                    h = left
                    expand(a, z, duration, series)
                    expanded = True
                    evaluate(series, h, moved)
                for c in range(2 * n + FORCING_TERMS, size):
                    moved[c] = z[c]
                put_time(moved, n, (time + h) / duration)
                read_channels(model, moved, y1, v1)

                # did a contact begin or end on the way?
                first, instant, towards = -1, math.inf, 0.0
                for j in range(m):
                    if side[j] != 0.0:
                        a1[j] = curve(model.curvature[chosen, b], moved, j)
                        until = suspect_closed(model, j, side[j], h, y0[j], v0[j], a0[j], y1[j], v1[j], a1[j])
                        if until < 0.0:
                            continue
                        looked = side[j]
                    else:
                        looked = 1.0
                        until = suspect_open(model, j, 1.0, h, y0[j], v0[j], y1[j], v1[j])
                        if until < 0.0 and model.two_sided[j]:
                            looked = -1.0
                            until = suspect_open(model, j, -1.0, h, y0[j], v0[j], y1[j], v1[j])
                        if until < 0.0:
                            continue
                    if not expanded:
                        expand(a, z, duration, series)
                        expanded = True
                    for k in range(channel.shape[0]):
                        channel[k] = 0.0
                        for i in range(n):
                            channel[k] += model.row[j, i] * series[k, i]
                    found = locate(
                        model.stiffness[j], model.damping[j], model.gap[j], looked, side[j] != 0.0, channel, until,
                        event_tolerance,
                    )  # fmt: skip
                    if found < instant:
                        first, instant, towards = j, found, looked
                if first >= 0:
                    h = instant
                    evaluate(series, h, moved)
                    put_time(moved, n, (time + h) / duration)
                    read_channels(model, moved, y1, v1)
                    for j in range(m):
                        if side[j] != 0.0:
                            a1[j] = curve(model.curvature[chosen, b], moved, j)

                # record the step
                if sample < samples:
                    now = b * duration + time
                    while sample < samples and sample * period < (now + h) * samples:
                        if not expanded:
                            expand(a, z, duration, series)
                            expanded = True
                        evaluate(series, max(sample * period / samples - now, 0.0), at_sample)
                        take_sample(model, side, at_sample, y1, v1, a1, arrays.history[cycle, sample])
                        sample += 1
                    read_channels(model, moved, y1, v1)
                if closed:
                    end = joint_force(model, side, y1, v1, a1)
                    note_peak(arrays.peak_force[cycle], end)
                    crest, size_there = crest_instant(h, start, end)
                    if size_there > 0.99 * arrays.peak_force[cycle, UPPER if end[0] > 0.0 else LOWER]:
                        if not expanded:
                            expand(a, z, duration, series)
                        evaluate(series, crest, at_crest)
                        put_time(at_crest, n, (time + crest) / duration)
                        for c in range(2 * n + FORCING_TERMS, size):
                            at_crest[c] = z[c]
                        read_channels(model, at_crest, y0, v0)
                        for j in range(m):
                            if side[j] != 0.0:
                                a0[j] = curve(model.curvature[chosen, b], at_crest, j)
                        top = joint_force(model, side, y0, v0, a0)
                        note_peak(arrays.peak_force[cycle], top)
                    start = end
                    note_share(end, h, arrays.contact_time[cycle])
                z, moved = moved, z
                y0, y1 = y1, y0
                v0, v1 = v1, v0
                a0, a1 = a1, a0
                if first < 0:
                    if h < step:
                        break
                    count += 1
                    continue

                # a contact changes
                events += 1
                if events > event_budget:
                    return status.EVENT_BUDGET, cycle
                if side[first] != 0.0:
                    side[first] = 0.0
                else:
                    side[first] = towards
                    if monitored(model, first):
                        column = column_of(model, first, towards)
                        arrays.impacts[cycle, column] += 1
                        upward = 1.0 if column == UPPER else -1.0
                        note_touch(episode, upward, b * duration + time + h, arrays.bounce_time[cycle])
                put_sides(model, side, z)
                chosen = contact_set(model, side)
                a = model.acceleration[chosen, b]
                closed = False
                for j in range(m):
                    if side[j] != 0.0:
                        closed = True
                        a0[j] = curve(model.curvature[chosen, b], z, j)
                start = joint_force(model, side, y0, v0, a0)
                note_peak(arrays.peak_force[cycle], start)
                origin, count = time + h, 0

        arrays.events[cycle] = events
        for i in range(2 * n):
            state[i] = z[i]
            if not abs(state[i]) < RUNAWAY:
                return status.DIVERGED, cycle
        episode.touch[0] -= period
        episode.touch[1] -= period
    return status.OK, arrays.section.shape[0]


@njit(cache=True, inline="always")
def joint_force(model, side, y, v, a):
    """``resultant`` of the monitored joint from the channels' displacement, velocity and acceleration."""
    fx, fy, fz, rx, ry, rz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(side.shape[0]):
        if side[j] != 0.0:
            force = model.stiffness[j] * (y[j] - side[j] * model.gap[j]) + model.damping[j] * v[j]
            rate = model.stiffness[j] * v[j] + model.damping[j] * a[j]
            fx += model.reading[j, 0] * force
            fy += model.reading[j, 1] * force
            fz += model.reading[j, 2] * force
            rx += model.reading[j, 0] * rate
            ry += model.reading[j, 1] * rate
            rz += model.reading[j, 2] * rate
    return resultant(fx, fy, fz, rx, ry, rz)


@njit(cache=True)
def take_sample(model, side, z, y, v, a, sample):
    """Write displacement, velocity and signed resultant (positive where it points up) of the monitored joint."""
    n = model.display.shape[0]
    read_channels(model, z, y, v)
    force = joint_force(model, side, y, v, a)
    sample[0], sample[1] = 0.0, 0.0
    for i in range(n):
        sample[0] += model.display[i] * z[i]
        sample[1] += model.display[i] * z[n + i]
    sample[2] = math.copysign(force[1], force[0])
