r"""Exact motion of a slider crank whose joints rattle in their clearance.

Coordinates p are small motions about the nominal motion of the crank. A contact channel j measures row_j . p against
its clearance c_j on one side or on both; closed on side s = +-1 it pushes with

    |N| = k (s row.p - c) + d s row.p'    while the penetration s row.p - c and |N| are positive

so it pushes and never pulls: beyond the surface it detaches when spring and damper together would pull. The matrices
are held over each bin of crank angle, the forcing is continuous, and between two changes of contact the motion is
propagated exactly (``propagator``).

A step is taken if it is proven by both ends that no contact changes (``contact``) and that no force exceeds the peak
of the revolution between them. Otherwise a shorter one is tried, and a tick is expanded in its Taylor series, on which
events and crests are found. Recording only reads: a time history does not change the motion by a bit.

The file is long because these kernels call one another in a ring of state that only they know: where the motion is,
which step was proven, and what is left of the bin.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from chaosgym.core import status
from chaosgym.core.cycle import LOWER, UPPER, note_touch
from chaosgym.core.kernel import leaf
from chaosgym.core.tangent import orthonormalise
from chaosgym.machines.slider_crank.kernels.contact import (
    CROSSES,
    GAP,
    KEEPS,
    LAG,
    REACH,
    STIFFNESS,
    TWO_SIDED,
    UP,
    VALUE_DOUBT,
    closing,
    crossing,
    find_sides,
    hull,
    opening,
    settled,
    surfaces,
    trend,
)
from chaosgym.machines.slider_crank.kernels.propagator import (
    FORCING_TERMS,
    RUNGS,
    TICKS,
    combine,
    evaluate,
    expand,
    order_for,
    put_time,
)
from chaosgym.machines.slider_crank.kernels.record import (
    begin_cycle,
    channel_crest,
    channel_force,
    column_of,
    crest_instant,
    joint_force,
    monitored,
    note_peak,
    note_share,
    write_peaks,
    write_sample,
)

RUNAWAY = 1e3
"""Coordinate [m] that counts as divergence."""

STEP_BUDGET = 5_000_000
"""Steps without events that a revolution may have: some seconds of processor time."""

SWING = 3.0
"""Longest step of a closed contact that is worth a trial, as an angle [rad] of its motion."""

NOTHING = 1e-12
"""Share of a tick that is too short to be a step."""

DOUBTFUL, FREE, PUSHES_UP, PUSHES_DOWN, NEW_PEAK = range(5)
"""What ``judge_step`` proves."""

RUNG_TICKS = np.array([4 ** (RUNGS - 1 - rung) for rung in range(RUNGS)])
"""Ticks of the steps for which there are propagators."""


class SliderCrankModel(NamedTuple):
    """All that the kernels know of a slider crank with n coordinates and m contact channels.

    Columns are those of z in ``propagator``, 2n + 4 + m; lanes and columns that fill up a multiple are zero.

    Attributes
    ----------
    bin_duration : float
        Time [s] in which the crank turns through one bin.
    steps : int
        Longest steps in a bin, of ``TICKS`` ticks each.
    contact_rate : float
        Angular frequency of the masses next to the closed contacts [rad/s].
    order : int
        Order of the Taylor series that sums a tick to round-off.
    spectrum : float
        Largest modulus of an eigenvalue of the motion [1/s].
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
    anchor : (radix^m, n, m)
        Places of the coordinates, per unit of clearance, at which the closed channels just touch.
    acceleration : (radix^m, bins, columns, n + m)
        p'' and the second derivatives of the channels' displacements per unit z for every contact set and bin.
    propagator : (radix^m, bins, RUNGS, columns, 2n + 2m)
        p and p' a step later, then reading and slope of every channel: y + lag y' where it is closed, y where not.
    bound : (radix^m, bins, m, columns)
        Largest fourth derivative of each reading over the longest step per unit of |z|, places from the anchor.
    """

    bin_duration: float
    steps: int
    contact_rate: float
    order: int
    spectrum: float
    row: np.ndarray
    gap: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    two_sided: np.ndarray
    radix: int
    reading: np.ndarray
    reach: np.ndarray
    display: np.ndarray
    anchor: np.ndarray
    acceleration: np.ndarray
    propagator: np.ndarray
    bound: np.ndarray


class Motion(NamedTuple):
    """Where the motion is, and space to move it: n coordinates, m channels.

    Attributes
    ----------
    z : (columns,)
        Augmented state of ``propagator``.
    moved : (2n + 2m or more,)
        State, readings and slopes after a step.
    side : (m,)
        Closed side of each channel, +1 or -1, or 0.
    start, end, spare : (2, m)
        Reading and slope of the channels: now, after the step, and anywhere.
    fourth : (m,)
        Bounds of the readings' fourth derivatives.
    series : (order + 1, n + m or more)
        Taylor coefficients of coordinates and channels about the state now.
    factors, powers, values
        Work space of ``propagator.expand`` and ``evaluate``.
    sampled : (columns,)
        State from which samples are taken.
    peak : (2, 5)
        Of ``record.note_peak``.
    """

    z: np.ndarray
    moved: np.ndarray
    side: np.ndarray
    start: np.ndarray
    end: np.ndarray
    spare: np.ndarray
    fourth: np.ndarray
    series: np.ndarray
    factors: np.ndarray
    powers: np.ndarray
    values: np.ndarray
    sampled: np.ndarray
    peak: np.ndarray


@njit(cache=True)
def motion_of(model):
    """Space for a motion."""
    columns, lanes = model.acceleration.shape[2:]
    m, order = model.row.shape[0], model.order
    return Motion(
        np.zeros(columns),
        np.zeros(model.propagator.shape[4]),
        np.zeros(m),
        np.zeros((2, m)),
        np.zeros((2, m)),
        np.zeros((2, m)),
        np.zeros(m),
        np.zeros((order + 1, lanes)),
        np.zeros(columns),
        np.zeros((3, order + 1)),
        np.zeros((3, lanes)),
        np.zeros(columns),
        np.zeros((2, 5)),
    )


@leaf
def contact_set(side, radix):
    """Index of the matrices of a contact set: closed sides as digits."""
    index, place = 0, 1
    for j in range(side.shape[0]):
        if side[j] > 0.0:
            index += place
        elif side[j] < 0.0:
            index += place * (radix - 1)
        place *= radix
    return index


@leaf
def put_sides(surface, side, n, z):
    """Write the clearance columns of z."""
    for j in range(side.shape[0]):
        z[2 * n + FORCING_TERMS + j] = side[j] * surface[j, GAP]


@leaf
def read_state(surface, side, row, a, z, values, reading):
    """Fill ``reading`` (2, m) in the state z; ``a`` is the acceleration of its bin and contact set."""
    m, n = row.shape
    combine(a, a.shape[0], z, values[2])
    for j in range(m):
        y, v = 0.0, 0.0
        for i in range(n):
            y += row[j, i] * z[i]
            v += row[j, i] * z[n + i]
        lag = surface[j, LAG] if side[j] != 0.0 else 0.0
        reading[0, j], reading[1, j] = y + lag * v, v + lag * values[2, n + j]


@leaf
def read_values(surface, side, n, values, reading):
    """Fill ``reading`` (2, m) from ``values`` (3, n + m) of ``propagator.evaluate``."""
    for j in range(side.shape[0]):
        lag = surface[j, LAG] if side[j] != 0.0 else 0.0
        reading[0, j] = values[0, n + j] + lag * values[1, n + j]
        reading[1, j] = values[1, n + j] + lag * values[2, n + j]


@leaf
def bound_fourth(bound, anchor, n, z, fourth):
    """Write bounds of the fourth derivative of the readings over the longest step from z on."""
    m, columns = bound.shape
    for j in range(m):
        by_place, by_speed, by_load = 0.0, 0.0, 0.0
        for i in range(n):
            place = z[i]
            for q in range(m):
                place -= anchor[i, q] * z[2 * n + FORCING_TERMS + q]
            by_place += bound[j, i] * abs(place)
            by_speed += bound[j, n + i] * abs(z[n + i])
        for c in range(2 * n, columns):
            by_load += bound[j, c] * abs(z[c])
        fourth[j] = by_place + by_speed + by_load


@leaf
def reaches(surface, side, start, h, rate):
    """True if a channel that goes on at its present speed changes its contact within h, or soon after.

    Closed ones swing back after half a turn at ``rate``.
    """
    for j in range(side.shape[0]):
        e, d = start[0, j], start[1, j]
        if side[j] != 0.0:
            if h * rate > SWING or -side[j] * d * h > side[j] * e - surface[j, GAP]:
                return True
        elif d * h > 0.95 * (surface[j, GAP] - e) or (
            surface[j, TWO_SIDED] != 0.0 and -d * h > 0.95 * (surface[j, GAP] + e)
        ):
            return True
    return False


@leaf
def judge_step(surface, side, start, end, fourth, h, peak, channel_peak):
    """What is proven of a step: DOUBTFUL, or that no contact changes and its peaks are at its ends or lower.

    FREE: nothing pushes; PUSHES_UP, PUSHES_DOWN: the resultant does, below its peak; NEW_PEAK: its largest is at an end
    of the step. ``peak`` (2, 5) are those of the resultant, ``channel_peak`` (m, 2) those of the channels, or has no
    rows.
    """
    closed, total, upward, rises = 0, 0.0, 0.0, True
    h4 = VALUE_DOUBT * h * h * h * h
    for j in range(side.shape[0]):
        e0, d0, e1, d1 = start[0, j], start[1, j], end[0, j], end[1, j]
        low, high = hull(h, e0, d0, e1, d1)
        doubt = h4 * fourth[j]
        gap, s = surface[j, GAP], side[j]
        if s == 0.0:
            if high + doubt >= gap or (surface[j, TWO_SIDED] != 0.0 and doubt - low >= gap):
                return DOUBTFUL
            continue
        if s < 0.0:
            low, high = -high, -low
        if low - doubt <= gap:
            return DOUBTFUL
        top = surface[j, STIFFNESS] * (high + doubt - gap)
        steady = trend(h, e0, d0, e1, d1, fourth[j]) != 0
        if channel_peak.shape[0] > 0 and not steady and top > channel_peak[j, 0 if s > 0.0 else 1]:
            return DOUBTFUL
        if surface[j, REACH] > 0.0:
            closed += 1
            rises = steady
            total += surface[j, REACH] * top
            upward += surface[j, UP] * surface[j, STIFFNESS] * (0.5 * (e0 + e1) - s * gap)
    if closed == 0:
        return FREE
    if total <= peak[UPPER if upward > 0.0 else LOWER, 0]:
        return PUSHES_UP if upward > 0.0 else PUSHES_DOWN
    return NEW_PEAK if closed == 1 and rises else DOUBTFUL


@leaf
def note_step(surface, side, now, h, start, end, judged, peak, channel_peak, contact_time):
    """Record a step of length h at ``now`` in the revolution as it is ``judged``."""
    if judged == NEW_PEAK:
        before, after = joint_force(surface, side, start), joint_force(surface, side, end)
        note_share(before, after, h, contact_time)
        note_peak(peak, now, before)
        note_peak(peak, now + h, after)
    elif judged != FREE:
        contact_time[UPPER if judged == PUSHES_UP else LOWER] += h
    note_channels(surface, side, start, end, channel_peak)


@leaf
def note_channels(surface, side, start, end, channel_peak):
    """Raise the peaks (m, 2) of the closed channels, or of none if there are no rows, to those of a step's ends."""
    for j in range(channel_peak.shape[0]):
        s = side[j]
        if s != 0.0:
            top = max(channel_force(surface, s, start, j)[0], channel_force(surface, s, end, j)[0])
            column = 0 if s > 0.0 else 1
            channel_peak[j, column] = max(channel_peak[j, column], top)


@leaf
def note_crests(surface, side, n, start, end, spare, series, last, h, powers, values, channel_peak):
    """Raise the peaks (m, 2) of the closed channels, or of none if there are no rows, to crests in an expanded step."""
    for j in range(channel_peak.shape[0]):
        s = side[j]
        if s != 0.0:
            f0, r0 = channel_force(surface, s, start, j)
            f1, r1 = channel_force(surface, s, end, j)
            crest, top = channel_crest(h, f0, r0, f1, r1)
            column = 0 if s > 0.0 else 1
            if crest > 0.0 and top > 0.99 * channel_peak[j, column]:
                evaluate(series, last, crest, powers, values)
                read_values(surface, side, n, values, spare)
                top = channel_force(surface, s, spare, j)[0]
                channel_peak[j, column] = max(channel_peak[j, column], top)


@leaf
def first_change(surface, side, start, end, fourth, series, n, last, h, tolerance):
    """(Channel or -1, its new side, instant) of the first change of contact within h."""
    first, towards, instant = -1, 0.0, h
    for j in range(side.shape[0]):
        verdict, s = settled(surface, j, side[j], start, end, h, fourth[j])
        if verdict == KEEPS:
            continue
        if verdict == CROSSES:
            lag = surface[j, LAG] if side[j] != 0.0 else 0.0
            facing = side[j] if side[j] != 0.0 else s
            found = crossing(series, n + j, last, facing, surface[j, GAP], lag, 0.0, h, tolerance)
            if found <= instant:
                first, towards, instant = j, s, found
        elif side[j] != 0.0:
            found = opening(surface, j, side[j], series, n + j, last, instant, tolerance)
            if found <= instant:
                first, towards, instant = j, 0.0, found
        else:
            found = closing(surface, j, 1.0, series, n + j, last, instant, tolerance)
            if found <= instant:
                first, towards, instant = j, 1.0, found
            if surface[j, TWO_SIDED] != 0.0:
                found = closing(surface, j, -1.0, series, n + j, last, instant, tolerance)
                if found <= instant:
                    first, towards, instant = j, -1.0, found
    return first, towards, instant


@leaf
def expand_all(row, duration, a, z, order, factors, series):
    """Expand coordinates and channels about the state z of a bin of some duration."""
    m, n = row.shape
    for j in range(m):
        series[0, n + j], series[1, n + j] = 0.0, 0.0
        for i in range(n):
            series[0, n + j] += row[j, i] * z[i]
            series[1, n + j] += row[j, i] * z[n + i]
    expand(a, n, z, duration, order, factors, series)


@leaf
def write_expanded(model, surface, motion, last, since, h, spacing, sample, history):
    """Write the samples of a revolution that fall into the expanded step [since, since + h); the number of the next.

    ``history`` (samples, 3) is that of the revolution.
    """
    side, values, state, spare = motion.side, motion.values, motion.sampled, motion.spare
    n = model.row.shape[1]
    while sample < history.shape[0] and sample * spacing < since + h:
        evaluate(motion.series, last, max(sample * spacing - since, 0.0), motion.powers, values)
        read_values(surface, side, n, values, spare)
        for i in range(n):
            state[i], state[n + i] = values[0, i], values[1, i]
        write_sample(model.display, state, joint_force(surface, side, spare), history[sample])
        sample += 1
    return sample


@leaf
def write_samples(model, surface, motion, chosen, b, time, width, spacing, sample, history):
    """As ``write_expanded``, for a step of ``width`` ticks from z at ``time`` in bin b, tick by tick."""
    z, moved = motion.sampled, motion.moved
    n, duration = model.row.shape[1], model.bin_duration
    tick = duration / (model.steps * TICKS)
    for k in range(width):
        since = b * duration + time + k * tick
        if sample == history.shape[0] or sample * spacing >= since + (width - k) * tick:
            break
        # the state at the tick, anew for each: samples overwrite it
        for c in range(z.shape[0]):
            z[c] = motion.z[c]
        done = 0
        for rung in range(RUNGS):
            while k - done >= RUNG_TICKS[rung]:
                combine(model.propagator[chosen, b, rung], z.shape[0], z, moved)
                for i in range(2 * n):
                    z[i] = moved[i]
                done += RUNG_TICKS[rung]
                put_time(z, n, (time + done * tick) / duration)
        if sample * spacing < since + tick:
            expand_all(
                model.row, duration, model.acceleration[chosen, b], z, model.order, motion.factors, motion.series
            )
            sample = write_expanded(model, surface, motion, model.order, since, tick, spacing, sample, history)
    return sample


@leaf
def careful_step(row, duration, surface, motion, a, last, now, h, tolerance, channel_peak, contact_time):
    """Follow the motion for at most h, up to the first change of contact, and record what happens.

    ``now`` is the time in the revolution. Moves the state and its reading, and leaves the series.

    Returns
    -------
    (changed, towards, h) : the channel whose contact changes or -1, its new side, and how long the step was.
    """
    side, start, end, spare, series = motion.side, motion.start, motion.end, motion.spare, motion.series
    powers, values, z, peak = motion.powers, motion.values, motion.z, motion.peak
    n = row.shape[1]
    expand_all(row, duration, a, z, last, motion.factors, series)
    evaluate(series, last, h, powers, values)
    read_values(surface, side, n, values, end)
    changed, towards, h = first_change(surface, side, start, end, motion.fourth, series, n, last, h, tolerance)
    if changed >= 0:
        evaluate(series, last, h, powers, values)
        read_values(surface, side, n, values, end)
    for i in range(n):
        z[i], z[n + i] = values[0, i], values[1, i]
    before, after = joint_force(surface, side, start), joint_force(surface, side, end)
    if before[1] + after[1] > 0.0:
        note_share(before, after, h, contact_time)
        note_peak(peak, now + h, after)
        crest, size = crest_instant(h, before, after)
        if size > 0.99 * peak[UPPER if after[0] > 0.0 else LOWER, 0]:
            evaluate(series, last, crest, powers, values)
            read_values(surface, side, n, values, spare)
            note_peak(peak, now + crest, joint_force(surface, side, spare))
    if channel_peak.shape[0] > 0:
        note_channels(surface, side, start, end, channel_peak)
        note_crests(surface, side, n, start, end, spare, series, last, h, powers, values, channel_peak)
    return changed, towards, h


@leaf
def change_side(surface, side, changed, towards, now, episode, impacts, bounce_time):
    """Close a channel on the side ``towards`` or open it at ``now`` in the revolution, and record a touch."""
    side[changed] = towards
    if towards != 0.0 and monitored(surface, changed):
        column = column_of(surface, changed, towards)
        impacts[column] += 1
        note_touch(episode, 1.0 if column == UPPER else -1.0, now, bounce_time)


@leaf
def carry(table, n, vectors, moved):
    """Advance deviations (k, 2n) by a step whose propagator is ``table``."""
    for k in range(vectors.shape[0]):
        combine(table, 2 * n, vectors[k], moved)
        for i in range(2 * n):
            vectors[k, i] = moved[i]


@leaf
def carry_expanded(a, n, duration, last, h, motion, vectors):
    """Advance deviations (k, 2n) by h, of which they are expanded as the motion was."""
    z, values = motion.sampled, motion.values
    for k in range(vectors.shape[0]):
        z[:] = 0.0
        for i in range(2 * n):
            z[i] = vectors[k, i]
        expand(a, n, z, duration, last, motion.factors, motion.series)
        evaluate(motion.series, last, h, motion.powers, values)
        for i in range(n):
            vectors[k, i], vectors[k, n + i] = values[0, i], values[1, i]


@leaf
def jump(before, after, n, vectors):
    """Saltation of deviations (k, 2n) where a surface is touched: the damper acts at once, for each at its own time.

    ``before`` and ``after`` are the accelerations on either side of the event. Where a contact ends its force is zero,
    and nothing jumps.
    """
    for k in range(vectors.shape[0]):
        for i in range(n):
            for j in range(n):
                vectors[k, n + i] += (after[n + j, i] - before[n + j, i]) * vectors[k, j]


@leaf
def turn(model, surface, motion, episode, arrays, cycle, tolerance, budget, vectors):
    """Move through one revolution; how many changes of contact it had.

    Steps begin and end at ticks; what is left of one after a change of contact is a careful step.
    """
    z, moved, side, start, end, fourth = motion.z, motion.moved, motion.side, motion.start, motion.end, motion.fourth
    row, bins = model.row, model.acceleration.shape[1]
    accelerations, propagators, bounds, anchors = model.acceleration, model.propagator, model.bound, model.anchor
    history, impacts, bounce_time = arrays.history[cycle], arrays.impacts[cycle], arrays.bounce_time[cycle]
    channel_peak, contact_time = arrays.channel_peak[cycle], arrays.contact_time[cycle]
    peak = motion.peak
    peak[:] = 0.0
    m, n = row.shape
    duration, most = model.bin_duration, model.steps * TICKS
    tick = duration / most
    spacing = bins * duration / max(history.shape[0], 1)
    events, sample, changed, carries = 0, 0, -1, vectors.shape[0] > 0
    chosen = contact_set(side, model.radix)
    put_time(z, n, 0.0)
    read_state(surface, side, row, accelerations[chosen, 0], z, motion.values, start)
    note_peak(peak, 0.0, joint_force(surface, side, start))
    for b in range(bins):
        begin = b * duration
        a = accelerations[chosen, b]
        put_time(z, n, 0.0)
        if chosen > 0:
            # damping reads the acceleration, which jumps with the matrices
            read_state(surface, side, row, a, z, motion.values, start)
        done, since, known, rung = 0, 0.0, -TICKS, 0
        while done < most:
            # ``since``: what has passed of the tick, where a contact has changed in it
            time = done * tick + since
            judged, width, h = DOUBTFUL, 1, tick
            while since == 0.0:
                while RUNG_TICKS[rung] > most - done:
                    rung += 1
                width = RUNG_TICKS[rung]
                h = width * tick
                if not reaches(surface, side, start, h, model.contact_rate):
                    if done + width > known + TICKS:
                        bound_fourth(bounds[chosen, b], anchors[chosen], n, z, fourth)
                        known = done
                    combine(propagators[chosen, b, rung], z.shape[0], z, moved)
                    for j in range(m):
                        end[0, j], end[1, j] = moved[2 * (n + j)], moved[2 * (n + j) + 1]
                    judged = judge_step(surface, side, start, end, fourth, h, peak, channel_peak)
                if judged != DOUBTFUL or rung == RUNGS - 1:
                    break
                rung += 1
            if judged != DOUBTFUL:
                if sample < history.shape[0]:
                    sample = write_samples(model, surface, motion, chosen, b, time, width, spacing, sample, history)
                    combine(propagators[chosen, b, rung], z.shape[0], z, moved)
                if chosen > 0:
                    note_step(surface, side, begin + time, h, start, end, judged, peak, channel_peak, contact_time)
                for i in range(2 * n):
                    z[i] = moved[i]
                if carries:
                    carry(propagators[chosen, b, rung], n, vectors, moved)
                done += width
                rung = max(rung - 1, 0)
            else:
                h, last = tick, model.order
                if since > 0.0:
                    h = tick - since
                    last = order_for(model.spectrum * h, last)
                if done + 1 > known + TICKS:
                    bound_fourth(bounds[chosen, b], anchors[chosen], n, z, fourth)
                    known = done
                changed, towards, length = careful_step(
                    row, duration, surface, motion, a, last, begin + time, h, tolerance, channel_peak, contact_time
                )
                if sample < history.shape[0]:
                    sample = write_expanded(
                        model, surface, motion, last, begin + time, length, spacing, sample, history
                    )
                if carries:
                    carry_expanded(a, n, duration, last, length, motion, vectors)
                if changed >= 0:
                    events += 1
                    if events > budget:
                        return events
                    since, time, known, rung = since + length, time + length, -TICKS, 1
                    change_side(surface, side, changed, towards, begin + time, episode, impacts, bounce_time)
                    put_sides(surface, side, n, z)
                    chosen = contact_set(side, model.radix)
                    if carries and towards * end[1, changed] > 0.0:
                        jump(a, accelerations[chosen, b], n, vectors)
                    a = accelerations[chosen, b]
                    put_time(z, n, time / duration)
                    read_state(surface, side, row, a, z, motion.values, start)
                    note_peak(peak, begin + time, joint_force(surface, side, start))
                    if since < tick * (1.0 - NOTHING):
                        continue
                since = 0.0
                done += 1
            put_time(z, n, done * tick / duration)
            if changed < 0 or judged != DOUBTFUL:
                for j in range(m):
                    start[0, j], start[1, j] = end[0, j], end[1, j]
    write_peaks(peak, arrays, cycle)
    return events


@njit(cache=True, nogil=True)
def advance(model, state, episode, arrays, event_tolerance, event_budget, tangents):
    """Advance ``state`` (2n,) and ``episode`` in place by whole revolutions, one for each row of ``arrays``.

    Every revolution starts at crank angle zero. ``event_tolerance`` is the error [s] of an event's instant.
    ``tangents`` are ``core.tangent.Tangents``, of no vectors if none are wanted.

    Returns
    -------
    (status, cycle) : the cycle is the first one not finished.
    """
    if model.steps * model.acceleration.shape[1] > STEP_BUDGET:
        return status.STEP_BUDGET, 0
    period = model.acceleration.shape[1] * model.bin_duration
    n = model.row.shape[1]
    motion, surface = motion_of(model), surfaces(model)
    metric = np.full(n, model.contact_rate**2)
    for cycle in range(arrays.section.shape[0]):
        begin_cycle(model, state, arrays, cycle)
        for i in range(state.shape[0]):
            motion.z[i] = state[i]
        find_sides(surface, model.row, motion.z, motion.side)
        put_sides(surface, motion.side, n, motion.z)
        arrays.events[cycle] = turn(
            model, surface, motion, episode, arrays, cycle, event_tolerance, event_budget, tangents.vectors
        )
        if arrays.events[cycle] > event_budget:
            return status.EVENT_BUDGET, cycle
        for i in range(state.shape[0]):
            state[i] = motion.z[i]
            if not abs(state[i]) < RUNAWAY:
                return status.DIVERGED, cycle
        if tangents.log_growth.shape[1] > 0:
            tangents.log_growth[cycle] = 0.0
            orthonormalise(metric, tangents, cycle)
        episode.touch[0] -= period
        episode.touch[1] -= period
    return status.OK, arrays.section.shape[0]
