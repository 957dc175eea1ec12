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
    acceleration : (radix^m, bins, n, 2n + 4 + m)
        p'' per unit z for every contact set and bin.
    curvature : (radix^m, bins, m, 2n + 4 + m)
        Second derivative of each channel's displacement per unit z.
    propagator : (radix^m, bins, 2n + 4 + m, 2n)
        p and p' one step later, by columns.
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
def read_channels(row, curvature, side, z, reading):
    """Fill ``reading`` (3, m): displacement, velocity and, where closed, acceleration of the channels in the state z.

    ``row`` and ``curvature`` are those of the model, the latter of one contact set and bin.
    """
    m, n = row.shape
    for j in range(m):
        y, v = 0.0, 0.0
        for i in range(n):
            y += row[j, i] * z[i]
            v += row[j, i] * z[n + i]
        reading[0, j], reading[1, j] = y, v
        if side[j] != 0.0:
            a = 0.0
            for c in range(z.shape[0]):
                a += curvature[j, c] * z[c]
            reading[2, j] = a


@njit(cache=True, inline="always")
def find_sides(model, z, side):
    """Write which side of every channel is closed in the state z."""
    m, n = model.row.shape
    for j in range(m):
        y, v = 0.0, 0.0
        for i in range(n):
            y += model.row[j, i] * z[i]
            v += model.row[j, i] * z[n + i]
        side[j] = 0.0
        if closes(model, j, 1.0, y, v):
            side[j] = 1.0
        elif model.two_sided[j] and closes(model, j, -1.0, y, v):
            side[j] = -1.0


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
def suspect_closed(model, j, side, h, start, end):
    """Instant in (0, h] until which a closed channel may have lost its force, or -1."""
    k, d, c = model.stiffness[j], model.damping[j], model.gap[j]
    f1 = k * (side * end[0, j] - c) + d * side * end[1, j]
    if f1 <= 0.0:
        return h
    r0, r1 = side * (k * start[1, j] + d * start[2, j]), side * (k * end[1, j] + d * end[2, j])
    if r0 >= 0.0 or r1 <= 0.0:
        return -1.0
    f0 = k * (side * start[0, j] - c) + d * side * start[1, j]
    dip = cubic_extremum(f0, r0, f1, r1, h, 1.0)
    return dip if dip > 0.0 and cubic(f0, r0, f1, r1, h, dip)[0] <= 0.0 else -1.0


@njit(cache=True, inline="always")
def suspect_open(model, j, side, h, start, end):
    """Instant in (0, h] until which an open channel may have begun to push on ``side``, or -1."""
    if closes(model, j, side, end[0, j], end[1, j]):
        return h
    v0, v1 = side * start[1, j], side * end[1, j]
    if v0 <= 0.0 or v1 >= 0.0:
        return -1.0
    depth0, depth1 = side * start[0, j] - model.gap[j], side * end[0, j] - model.gap[j]
    top = cubic_extremum(depth0, v0, depth1, v1, h, -1.0)
    return top if top > 0.0 and cubic(depth0, v0, depth1, v1, h, top)[0] > 0.0 else -1.0


@njit(cache=True, inline="always")
def find_suspects(model, side, h, start, end, until, towards):
    """How many channels may have changed their contact in a step; writes until when (or -1) and on which side."""
    count = 0
    for j in range(side.shape[0]):
        if side[j] != 0.0:
            towards[j] = side[j]
            until[j] = suspect_closed(model, j, side[j], h, start, end)
        else:
            towards[j] = 1.0
            until[j] = suspect_open(model, j, 1.0, h, start, end)
            if until[j] < 0.0 and model.two_sided[j]:
                towards[j] = -1.0
                until[j] = suspect_open(model, j, -1.0, h, start, end)
        if until[j] >= 0.0:
            count += 1
    return count


@njit(cache=True, inline="always")
def first_change(model, side, series, until, towards, channel, tolerance):
    """(Channel or -1, instant) of the first change among the suspects, on the Taylor series of the step."""
    first, instant = -1, math.inf
    for j in range(side.shape[0]):
        if until[j] < 0.0:
            continue
        for k in range(channel.shape[0]):
            channel[k] = 0.0
            for i in range(series.shape[1]):
                channel[k] += model.row[j, i] * series[k, i]
        found = locate(
            model.stiffness[j], model.damping[j], model.gap[j], towards[j], side[j] != 0.0, channel, until[j], tolerance
        )
        if found < instant:
            first, instant = j, found
    return first, instant


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
    """(Upward part, size, rate of the size, other two parts) of a force with components f and rates r."""
    size = math.sqrt(fx * fx + fy * fy + fz * fz)
    growth = (fx * rx + fy * ry + fz * rz) / size if size > 0.0 else 0.0
    return fy, size, growth, fx, fz


@njit(cache=True, inline="always")
def note_share(force, time, contact_time):
    """Add ``time`` to the side of the record (2,) towards which the resultant points."""
    if force[1] > 0.0:
        contact_time[UPPER if force[0] > 0.0 else LOWER] += time


@njit(cache=True, inline="always")
def note_peak(arrays, cycle, time, force):
    """Raise the peak of a revolution to the size of the resultant at ``time`` in it, and note when and whereto."""
    column = UPPER if force[0] > 0.0 else LOWER
    if force[1] > arrays.peak_force[cycle, column]:
        arrays.peak_force[cycle, column] = force[1]
        arrays.peak_instant[cycle, column] = time
        vector = arrays.peak_vector[cycle, column]
        vector[0], vector[1], vector[2] = force[3], force[0], force[4]


@njit(cache=True, inline="always")
def note_channel(peak, positive, h, f0, r0, f1, r1):
    """Raise the peak (2,) of a channel to its largest force in a step, by the cubic through both ends of it."""
    crest = cubic_extremum(f0, r0, f1, r1, h, -1.0) if r0 > 0.0 and r1 < 0.0 else -1.0
    top = max(f0, f1) if crest <= 0.0 else cubic(f0, r0, f1, r1, h, crest)[0]
    column = 0 if positive else 1
    peak[column] = max(peak[column], top)


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
def joint_force(model, side, reading):
    """``resultant`` of the monitored joint."""
    fx, fy, fz, rx, ry, rz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(side.shape[0]):
        if side[j] != 0.0:
            k, d = model.stiffness[j], model.damping[j]
            force = k * (reading[0, j] - side[j] * model.gap[j]) + d * reading[1, j]
            rate = k * reading[1, j] + d * reading[2, j]
            fx += model.reading[j, 0] * force
            fy += model.reading[j, 1] * force
            fz += model.reading[j, 2] * force
            rx += model.reading[j, 0] * rate
            ry += model.reading[j, 1] * rate
            rz += model.reading[j, 2] * rate
    return resultant(fx, fy, fz, rx, ry, rz)


@njit(cache=True)
def quiet_steps(model, chosen, b, side, z, moved, start, end, time, limit, peak, channel_peak, contact_time):
    """Take up to ``limit`` whole steps in which no contact changes and no force passes its peak; how many.

    ``peak`` (2,) is that of the resultant, ``channel_peak`` (m, 2) those of the channels, or has no rows.

    Stops before a step that could do either, judged by its ends: between them, a cubic exceeds the larger end by no
    more than 4/27 of the step times the sum of both slopes. z and its reading ``start`` go along.
    """
    n = model.row.shape[1]
    m = side.shape[0]
    step = model.bin_duration / model.steps
    row, table, curvature = model.row, model.propagator[chosen, b], model.curvature[chosen, b]
    swing = 4.0 / 27.0 * step
    for c in range(2 * n + FORCING_TERMS, z.shape[0]):
        moved[c] = z[c]
    for count in range(limit):
        propagate(table, z, moved)
        put_time(moved, n, (time + (count + 1) * step) / model.bin_duration)
        read_channels(row, curvature, side, moved, end)
        upward, total = 0.0, 0.0
        for j in range(m):
            gap = model.gap[j]
            if side[j] == 0.0:
                reach = max(start[0, j], end[0, j])
                if model.two_sided[j]:
                    reach = max(abs(start[0, j]), abs(end[0, j]))
                if start[1, j] * end[1, j] < 0.0:
                    reach += swing * (abs(start[1, j]) + abs(end[1, j]))
                if reach >= gap:
                    return count
                continue
            k, d, s = model.stiffness[j], model.damping[j], side[j]
            r0, r1 = s * (k * start[1, j] + d * start[2, j]), s * (k * end[1, j] + d * end[2, j])
            f0 = k * (s * start[0, j] - gap) + d * s * start[1, j]
            f1 = k * (s * end[0, j] - gap) + d * s * end[1, j]
            turn = swing * (abs(r0) + abs(r1)) if r0 * r1 < 0.0 else 0.0
            if min(f0, f1) - turn <= 0.0:
                return count
            if channel_peak.shape[0] > 0 and max(f0, f1) + turn > channel_peak[j, 0 if s > 0.0 else 1]:
                return count
            upward += model.reading[j, 1] * s * f1
            total += model.reach[j] * (max(f0, f1) + turn)
        column = UPPER if upward > 0.0 else LOWER
        if total > peak[column]:
            return count
        if total > 0.0:
            contact_time[column] += step
        for j in range(m):
            start[0, j], start[1, j], start[2, j] = end[0, j], end[1, j], end[2, j]
        for c in range(2 * n + FORCING_TERMS):
            z[c] = moved[c]
    return limit


@njit(cache=True, inline="always")
def refined_force(model, chosen, b, side, series, time, at, there, reading):
    """Resultant at time ``at`` in a step that began at ``time``; leaves the state in ``there``.

    The clearance columns of ``there`` must be those of the step.
    """
    evaluate(series, at, there)
    put_time(there, series.shape[1], (time + at) / model.bin_duration)
    read_channels(model.row, model.curvature[chosen, b], side, there, reading)
    return joint_force(model, side, reading)


@njit(cache=True, inline="always")
def write_sample(model, z, force, sample):
    """Write displacement, velocity and signed resultant (positive where it points up) of the monitored joint."""
    n = model.display.shape[0]
    sample[0], sample[1] = 0.0, 0.0
    for i in range(n):
        sample[0] += model.display[i] * z[i]
        sample[1] += model.display[i] * z[n + i]
    sample[2] = math.copysign(force[1], force[0])


@njit(cache=True, inline="always")
def begin_cycle(model, state, arrays, cycle):
    """Write the section of a revolution and clear its row."""
    n = model.display.shape[0]
    for i in range(2 * n):
        arrays.section[cycle, i] = state[i]
    arrays.tip[cycle, 0], arrays.tip[cycle, 1] = 0.0, 0.0
    for i in range(n):
        arrays.tip[cycle, 0] += model.display[i] * state[i]
        arrays.tip[cycle, 1] += model.display[i] * state[n + i]
    for column in range(2):
        arrays.peak_force[cycle, column] = 0.0
        arrays.impacts[cycle, column] = 0
        arrays.contact_time[cycle, column] = 0.0
        arrays.bounce_time[cycle, column] = 0.0
        arrays.peak_instant[cycle, column] = 0.0
        for axis in range(3):
            arrays.peak_vector[cycle, column, axis] = 0.0
        for j in range(arrays.channel_peak.shape[1]):
            arrays.channel_peak[cycle, j, column] = 0.0


@njit(cache=True, inline="always")
def note_channels(model, side, h, start, end, channel_peak):
    """Raise the peaks (m, 2) of the closed channels over a step."""
    for j in range(channel_peak.shape[0]):
        s = side[j]
        if s != 0.0:
            k, d = model.stiffness[j], model.damping[j]
            f0 = k * (s * start[0, j] - model.gap[j]) + d * s * start[1, j]
            f1 = k * (s * end[0, j] - model.gap[j]) + d * s * end[1, j]
            r0, r1 = s * (k * start[1, j] + d * start[2, j]), s * (k * end[1, j] + d * end[2, j])
            note_channel(channel_peak[j], s > 0.0, h, f0, r0, f1, r1)


@njit(cache=True, nogil=True)
def advance(model, state, episode, arrays, event_tolerance, event_budget):
    """Advance ``state`` (2n,) and ``episode`` in place by whole revolutions, one for each row of ``arrays``.

    Every revolution starts at crank angle zero. ``event_tolerance`` is the error [s] of an event's instant.

    Returns
    -------
    (status, cycle) : the cycle is the first one not finished.
    """
    _, bins, n, size = model.acceleration.shape
    row = model.row
    m = row.shape[0]
    duration = model.bin_duration
    step = duration / model.steps
    samples = arrays.history.shape[1]
    period = bins * duration
    z, moved, there, side = np.empty(size), np.empty(size), np.empty(size), np.empty(m)
    until, towards = np.empty(m), np.empty(m)
    series, channel = np.empty((model.order + 1, n)), np.empty(model.order + 1)
    start = np.zeros((3, m))
    end = np.zeros((3, m))
    spare = np.zeros((3, m))

    for cycle in range(arrays.section.shape[0]):
        begin_cycle(model, state, arrays, cycle)
        peak, contact_time = arrays.peak_force[cycle], arrays.contact_time[cycle]
        channel_peak = arrays.channel_peak[cycle]
        for i in range(2 * n):
            z[i] = state[i]
        find_sides(model, z, side)
        put_sides(model, side, z)
        chosen = contact_set(model, side)
        events, sample = 0, 0

        for b in range(bins):
            curvature = model.curvature[chosen, b]
            put_time(z, n, 0.0)
            read_channels(row, curvature, side, z, start)
            force = joint_force(model, side, start)
            # steps are counted from the last event
            origin, count = 0.0, 0
            while True:
                time = origin + count * step
                whole = int((duration - time) / step + 1e-9)
                if whole > 0 and sample == samples:
                    count += quiet_steps(
                        model, chosen, b, side, z, moved, start, end, time, whole, peak, channel_peak, contact_time
                    )
                    time = origin + count * step
                    force = joint_force(model, side, start)
                h = min(step, duration - time)
                if h <= 1e-12 * duration:
                    break
                fits = h >= (1.0 - 1e-9) * step
                expanded = not fits
                for c in range(2 * n, size):
                    moved[c] = z[c]
                if fits:
                    propagate(model.propagator[chosen, b], z, moved)
                else:
                    expand(model.acceleration[chosen, b], z, duration, series)
                    evaluate(series, h, moved)
                put_time(moved, n, (time + h) / duration)
                read_channels(row, curvature, side, moved, end)

                # did a contact begin or end on the way?
                changed = -1
                if find_suspects(model, side, h, start, end, until, towards) > 0:
                    if not expanded:
                        expand(model.acceleration[chosen, b], z, duration, series)
                        expanded = True
                    changed, instant = first_change(model, side, series, until, towards, channel, event_tolerance)
                    if changed >= 0:
                        h = instant
                        evaluate(series, h, moved)
                        put_time(moved, n, (time + h) / duration)
                        read_channels(row, curvature, side, moved, end)

                # record the step
                before, force = force, joint_force(model, side, end)
                note_share(force, h, contact_time)
                note_peak(arrays, cycle, b * duration + time + h, force)
                note_channels(model, side, h, start, end, channel_peak)
                crest, size_there = crest_instant(h, before, force)
                sampled = sample < samples and sample * period < (b * duration + time + h) * samples
                crested = size_there > 0.99 * peak[UPPER if force[0] > 0.0 else LOWER]
                if sampled or crested:
                    if not expanded:
                        expand(model.acceleration[chosen, b], z, duration, series)
                    for c in range(2 * n, size):
                        there[c] = z[c]
                if crested:
                    at_crest = refined_force(model, chosen, b, side, series, time, crest, there, spare)
                    note_peak(arrays, cycle, b * duration + time + crest, at_crest)
                while sample < samples and sample * period < (b * duration + time + h) * samples:
                    at = max(sample * period / samples - b * duration - time, 0.0)
                    at_sample = refined_force(model, chosen, b, side, series, time, at, there, spare)
                    write_sample(model, there, at_sample, arrays.history[cycle, sample])
                    sample += 1
                z, moved = moved, z
                start, end = end, start
                if changed < 0:
                    if not fits:
                        break
                    count += 1
                    continue

                # the contact set changes
                events += 1
                if events > event_budget:
                    return status.EVENT_BUDGET, cycle
                side[changed] = towards[changed] if side[changed] == 0.0 else 0.0
                if side[changed] != 0.0 and monitored(model, changed):
                    column = column_of(model, changed, side[changed])
                    arrays.impacts[cycle, column] += 1
                    upward = 1.0 if column == UPPER else -1.0
                    note_touch(episode, upward, b * duration + time + h, arrays.bounce_time[cycle])
                put_sides(model, side, z)
                chosen = contact_set(model, side)
                curvature = model.curvature[chosen, b]
                read_channels(row, curvature, side, z, start)
                force = joint_force(model, side, start)
                note_peak(arrays, cycle, b * duration + time + h, force)
                origin, count = time + h, 0

        arrays.events[cycle] = events
        for i in range(2 * n):
            state[i] = z[i]
            if not abs(state[i]) < RUNAWAY:
                return status.DIVERGED, cycle
        episode.touch[0] -= period
        episode.touch[1] -= period
    return status.OK, arrays.section.shape[0]
