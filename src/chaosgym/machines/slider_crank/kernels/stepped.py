r"""Motion of a slider crank whose contact force turns or is not linear, by steps.

The equations of ``slider_crank`` between contacts, and joints whose force no propagator knows: a ball in a spherical
shell, whose force turns with the ball, and Hertzian contact. Joint j measures e = (row_1 . p, row_2 . p, ...) and
pushes along e / |e| with a force N of penetration x = |e| - c:

    linear                     N = k x + d x'
    Hertz with dissipation     N = K x^(3/2) (1 + chi x')          (Hunt and Crossley, 1975)

as long as x and N are positive. The classical Runge-Kutta method steps from change to change of contact: which joints
push is fixed within a step, and the instant of a change is found by repeating the step with the right length. Matrices
are held over each bin of crank angle, the forcing is continuous.

The file is long because it is a whole second way to run the machine, from the force of a joint to the revolution.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from chaosgym.core import status
from chaosgym.core.cubic import cubic, cubic_extremum
from chaosgym.core.cycle import LOWER, UPPER, note_touch
from chaosgym.machines.slider_crank.kernels.exact import RUNAWAY, STEP_BUDGET
from chaosgym.machines.slider_crank.kernels.record import (
    begin_cycle,
    channel_crest,
    crest_instant,
    note_peak,
    note_share,
    resultant,
    write_peaks,
    write_sample,
)

LINEAR, HERTZ = 0, 1

POLISH = 50
"""Repeated steps to locate one event; the secant method needs three to six."""


class SteppedCrankModel(NamedTuple):
    """All that the kernels know of a slider crank with n coordinates, J joints and R rows.

    Attributes
    ----------
    bin_duration : float
        Time [s] in which the crank turns through one bin.
    steps : int
        Steps in a bin without events.
    contact_rate : float
        Angular frequency of the masses next to the closed contacts [rad/s].
    acceleration : (bins, n, 2n + 4)
        p'' per unit (p, p', 1, x, x^2, x^3) without contact; x is the time in the bin over its duration.
    first : (J + 1,) int
        Joint j owns the rows first[j] to first[j + 1] - 1.
    row : (R, n)
        Displacement in each direction of a joint per unit coordinate.
    answer : (bins, R, n)
        p'' per newton along each row.
    friction : (bins, J, n)
        p'' per newton of a joint's force, from friction.
    gap, stiffness, damping : (J,)
        Clearance [m]; k [N/m] and d [N s/m], or K [N/m^1.5] and chi [s/m].
    law : int
        LINEAR or HERTZ.
    two_sided : (J,) bool
        False if a joint with one row has a surface only where row . p is positive.
    reading : (R, 3)
        Contact force of the monitored joint (along, upward or across, sideways) per newton along each row.
    monitored : (J,) bool
        True for the joints that are recorded.
    display : (n,)
        Displacement of the monitored joint per unit coordinate.
    """

    bin_duration: float
    steps: int
    contact_rate: float
    acceleration: np.ndarray
    first: np.ndarray
    row: np.ndarray
    answer: np.ndarray
    friction: np.ndarray
    gap: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    law: int
    two_sided: np.ndarray
    reading: np.ndarray
    monitored: np.ndarray
    display: np.ndarray


@njit(cache=True, inline="always")
def measure(model, j, z, direction):
    """Penetration and its rate of joint j; writes the unit vector of its force on the surface into ``direction``."""
    n = model.row.shape[1]
    low, high = model.first[j], model.first[j + 1]
    size, along, rate = 0.0, 0.0, 0.0
    for r in range(low, high):
        e, rate = 0.0, 0.0
        for i in range(n):
            e += model.row[r, i] * z[i]
            rate += model.row[r, i] * z[n + i]
        direction[r] = e
        size += e * e
        along += e * rate
    if not model.two_sided[j]:
        # one row: e counts with its sign
        e = direction[low]
        direction[low] = 1.0
        return e - model.gap[j], rate
    size = math.sqrt(size)
    if size == 0.0:
        for r in range(low, high):
            direction[r] = 1.0 if r == low else 0.0
        return -model.gap[j], 0.0
    for r in range(low, high):
        direction[r] /= size
    return size - model.gap[j], along / size


@njit(cache=True, inline="always")
def pressing(model, j, depth, rate):
    """Force of a closed joint, continued beyond its end so that an event can be located."""
    if model.law == LINEAR:
        return model.stiffness[j] * depth + model.damping[j] * rate
    return model.stiffness[j] * depth * math.sqrt(abs(depth)) * (1.0 + model.damping[j] * rate)


@njit(cache=True, inline="always")
def margin(model, j, closed, depth, rate):
    """What is positive as long as joint j keeps its contact state; its sign is that of the force, or of the gap."""
    if model.law == LINEAR:
        force = depth + model.damping[j] / model.stiffness[j] * rate
    else:
        force = depth * (1.0 + model.damping[j] * rate)
    return force if closed else -min(depth, force)


@njit(cache=True, inline="always")
def slope(model, b, time, z, closed, direction, dz):
    """dz = (p', p'') at ``time`` in bin b."""
    n = model.row.shape[1]
    a = model.acceleration[b]
    x = time / model.bin_duration
    for i in range(n):
        dz[i] = z[n + i]
        total = a[i, 2 * n] + x * (a[i, 2 * n + 1] + x * (a[i, 2 * n + 2] + x * a[i, 2 * n + 3]))
        for c in range(2 * n):
            total += a[i, c] * z[c]
        dz[n + i] = total
    for j in range(closed.shape[0]):
        if closed[j]:
            depth, rate = measure(model, j, z, direction)
            force = pressing(model, j, depth, rate)
            for i in range(n):
                dz[n + i] += model.friction[b, j, i] * force
            for r in range(model.first[j], model.first[j + 1]):
                push = force * direction[r]
                for i in range(n):
                    dz[n + i] -= model.answer[b, r, i] * push


@njit(cache=True, inline="always")
def leap(model, b, time, h, z, closed, direction, k, inner, moved):
    """One Runge-Kutta step from z to ``moved``; k (4, 2n) receives the slopes, k[0] must hold the first one."""
    n2 = z.shape[0]
    for stage in range(1, 4):
        share = 0.5 * h if stage < 3 else h
        for i in range(n2):
            inner[i] = z[i] + share * k[stage - 1, i]
        slope(model, b, time + share, inner, closed, direction, k[stage])
    for i in range(n2):
        moved[i] = z[i] + h / 6.0 * (k[0, i] + 2.0 * (k[1, i] + k[2, i]) + k[3, i])


@njit(cache=True, inline="always")
def push_of(model, j, z, dz, direction):
    """Force of a closed joint and its rate; writes ``direction`` as ``measure`` does."""
    n = model.row.shape[1]
    depth, rate = measure(model, j, z, direction)
    force = pressing(model, j, depth, rate)
    bend = 0.0
    for r in range(model.first[j], model.first[j + 1]):
        for i in range(n):
            bend += direction[r] * model.row[r, i] * dz[n + i]
    if model.law == LINEAR:
        return force, model.stiffness[j] * rate + model.damping[j] * bend
    root = math.sqrt(max(depth, 0.0))
    growth = 1.5 * rate * (1.0 + model.damping[j] * rate) + depth * model.damping[j] * bend
    return force, model.stiffness[j] * root * growth


@njit(cache=True, inline="always")
def joint_force(model, z, dz, closed, direction):
    """``resultant`` of the monitored joint."""
    fx, fy, fz, rx, ry, rz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(closed.shape[0]):
        if not closed[j]:
            continue
        force, change = push_of(model, j, z, dz, direction)
        for r in range(model.first[j], model.first[j + 1]):
            fx += model.reading[r, 0] * direction[r] * force
            fy += model.reading[r, 1] * direction[r] * force
            fz += model.reading[r, 2] * direction[r] * force
            rx += model.reading[r, 0] * direction[r] * change
            ry += model.reading[r, 1] * direction[r] * change
            rz += model.reading[r, 2] * direction[r] * change
    return resultant(fx, fy, fz, rx, ry, rz)


@njit(cache=True, inline="always")
def note_joints(model, h, z, dz, moved, dz_moved, closed, direction, channel_peak):
    """Raise the peaks (J, 2) of the closed joints over a step of length h."""
    for j in range(channel_peak.shape[0]):
        if closed[j]:
            f0, r0 = push_of(model, j, z, dz, direction)
            f1, r1 = push_of(model, j, moved, dz_moved, direction)
            positive = not model.two_sided[j] or direction[model.first[j]] > 0.0
            column = 0 if positive else 1
            channel_peak[j, column] = max(channel_peak[j, column], channel_crest(h, f0, r0, f1, r1)[1])


@njit(cache=True, inline="always")
def lowest_margin(model, z, closed, direction):
    """Smallest margin of all joints: positive as long as none changes its contact state."""
    lowest = math.inf
    for j in range(closed.shape[0]):
        depth, rate = measure(model, j, z, direction)
        lowest = min(lowest, margin(model, j, closed[j], depth, rate))
    return lowest


@njit(cache=True)
def first_change(model, b, time, until, z, closed, direction, k, inner, moved, tolerance):
    """Instant in (0, until] just after which a joint changes its contact state, or ``until`` if none does.

    Regula falsi on repeated steps, an end halved when it was kept twice (Illinois). Leaves the state of that instant
    in ``moved``.
    """
    low, f_low = 0.0, max(lowest_margin(model, z, closed, direction), 0.0)
    high, f_high = until, 0.0
    t, kept = until, 0
    for _ in range(POLISH):
        leap(model, b, time, t, z, closed, direction, k, inner, moved)
        f = lowest_margin(model, moved, closed, direction)
        if f > 0.0:
            if t == until:
                return until
            low, f_low = t, f
            if kept > 0:
                f_high *= 0.5
            kept = 1
        else:
            high, f_high = t, f
            if high - low <= tolerance:
                break
            if kept < 0:
                f_low *= 0.5
            kept = -1
        if high - low <= tolerance:
            t = high
        else:
            t = (low * f_high - high * f_low) / (f_high - f_low) if f_low > 0.0 else 0.5 * (low + high)
            t = min(max(t, low + 0.01 * (high - low)), high - 0.01 * (high - low))
    return t


@njit(cache=True, inline="always")
def change_contacts(model, z, closed, direction, episode, time, impacts, bounce_time):
    """Open and close the joints whose margin is used up at ``time`` in the revolution; how many."""
    changes = 0
    for j in range(closed.shape[0]):
        depth, rate = measure(model, j, z, direction)
        if margin(model, j, closed[j], depth, rate) > 0.0:
            continue
        changes += 1
        closed[j] = not closed[j]
        if closed[j]:
            up = 0.0
            for r in range(model.first[j], model.first[j + 1]):
                up += model.reading[r, 1] * direction[r]
            if model.monitored[j]:
                impacts[UPPER if up > 0.0 else LOWER] += 1
                note_touch(episode, 1.0 if up > 0.0 else -1.0, time, bounce_time)
    return changes


@njit(cache=True, inline="always")
def state_within(h, t, z, dz, moved, dz_moved, inner):
    """Write the state at t in a step of length h, by the cubic through both ends."""
    for i in range(inner.shape[0]):
        inner[i] = cubic(z[i], dz[i], moved[i], dz_moved[i], h, t)[0]


@njit(cache=True, inline="always")
def take_sample(model, h, t, z, dz, moved, dz_moved, inner, closed, direction, sample):
    """Write displacement, velocity and signed resultant (positive where it points up) at t in a step of length h."""
    state_within(h, t, z, dz, moved, dz_moved, inner)
    write_sample(model.display, inner, joint_force(model, inner, dz, closed, direction), sample)


@njit(cache=True, inline="always")
def grazes(model, h, closed, direction, z, moved):
    """Instant in (0, h) at which an open joint may touch and leave again, or h."""
    instant = h
    for j in range(closed.shape[0]):
        if not closed[j]:
            depth0, rate0 = measure(model, j, z, direction)
            depth1, rate1 = measure(model, j, moved, direction)
            if depth1 < 0.0 and rate0 > 0.0 and rate1 < 0.0:
                top = cubic_extremum(depth0, rate0, depth1, rate1, h, -1.0)
                if top > 0.0 and cubic(depth0, rate0, depth1, rate1, h, top)[0] > 0.0:
                    instant = min(instant, top)
    return instant


@njit(cache=True, nogil=True)
def advance(model, state, episode, arrays, event_tolerance, event_budget):
    """Advance ``state`` (2n,) and ``episode`` in place by whole revolutions; see ``slider_crank.advance``."""
    bins, n, _ = model.acceleration.shape
    if model.steps * bins > STEP_BUDGET:
        return status.STEP_BUDGET, 0
    joints, n2 = model.gap.shape[0], 2 * n
    duration = model.bin_duration
    step = duration / model.steps
    period = bins * duration
    samples = arrays.history.shape[1]
    z, moved, inner, k = np.empty(n2), np.empty(n2), np.empty(n2), np.empty((4, n2))
    direction = np.empty(model.row.shape[0])
    closed = np.zeros(joints, dtype=np.bool_)
    peak = np.zeros((2, 5))

    for cycle in range(arrays.section.shape[0]):
        z[:] = state
        begin_cycle(model, state, arrays, cycle)
        peak[:] = 0.0
        impacts = arrays.impacts[cycle]
        contact_time, bounce_time = arrays.contact_time[cycle], arrays.bounce_time[cycle]
        for j in range(joints):
            depth, rate = measure(model, j, z, direction)
            closed[j] = margin(model, j, False, depth, rate) < 0.0
        events, sample = 0, 0

        for b in range(bins):
            origin, count = 0.0, 0
            slope(model, b, 0.0, z, closed, direction, k[0])
            start = joint_force(model, z, k[0], closed, direction)
            while True:
                time = origin + count * step
                h = min(step, duration - time)
                if h <= 1e-12 * duration:
                    break
                leap(model, b, time, h, z, closed, direction, k, inner, moved)
                until = grazes(model, h, closed, direction, z, moved)
                if until < h or lowest_margin(model, moved, closed, direction) <= 0.0:
                    h = first_change(model, b, time, until, z, closed, direction, k, inner, moved, event_tolerance)
                slope(model, b, time + h, moved, closed, direction, k[3])
                while sample < samples and sample * period < (b * duration + time + h) * samples:
                    t = max(sample * period / samples - b * duration - time, 0.0)
                    take_sample(
                        model, h, t, z, k[0], moved, k[3], inner, closed, direction, arrays.history[cycle, sample]
                    )
                    sample += 1
                end = joint_force(model, moved, k[3], closed, direction)
                note_share(start, end, h, contact_time)
                note_peak(peak, b * duration + time + h, end)
                crest, size = crest_instant(h, start, end)
                if size > peak[UPPER if end[0] > 0.0 else LOWER, 0]:
                    state_within(h, crest, z, k[0], moved, k[3], inner)
                    there = joint_force(model, inner, k[3], closed, direction)
                    share = size / there[1] if there[1] > 0.0 else 0.0
                    at_crest = (share * there[0], size, 0.0, share * there[3], share * there[4])
                    note_peak(peak, b * duration + time + crest, at_crest)
                note_joints(model, h, z, k[0], moved, k[3], closed, direction, arrays.channel_peak[cycle])
                z, moved = moved, z
                changes = change_contacts(
                    model, z, closed, direction, episode, b * duration + time + h, impacts, bounce_time
                )
                if changes > 0:
                    events += changes
                    if events > event_budget:
                        return status.EVENT_BUDGET, cycle
                    slope(model, b, time + h, z, closed, direction, k[0])
                    end = joint_force(model, z, k[0], closed, direction)
                    note_peak(peak, b * duration + time + h, end)
                else:
                    k[0] = k[3]
                start = end
                if changes > 0 or h < step:
                    origin, count = time + h, 0
                else:
                    count += 1

        write_peaks(peak, arrays, cycle)
        arrays.events[cycle] = events
        state[:] = z
        for i in range(n2):
            if not abs(state[i]) < RUNAWAY:
                return status.DIVERGED, cycle
        episode.touch[0] -= period
        episode.touch[1] -= period
    return status.OK, arrays.section.shape[0]
