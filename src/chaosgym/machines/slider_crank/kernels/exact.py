r"""Exact motion of a slider crank whose joints rattle in their clearance.

Coordinates p are small motions about the nominal motion of the crank. A contact channel j measures row_j . p against
its clearance c_j on one side or on both; closed on side s = +-1 it pushes with

    |N| = k (s row.p - c) + d s row.p'    while the penetration s row.p - c and |N| are positive

so it pushes and never pulls: beyond the surface it detaches when spring and damper together would pull. The matrices
are held over each bin of crank angle, the forcing is continuous, and between two changes of contact the motion is
propagated exactly (``crank_propagator``).

A step is quiet if a bound by its two ends shows that no contact changes and no force exceeds the peak of the
revolution. Any other step is expanded in its Taylor series and looked at piece by piece (``crank_contact``). Recording
only reads: a time history does not change the motion by a bit.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from chaosgym.core import status
from chaosgym.core.cycle import LOWER, UPPER, note_touch
from chaosgym.core.kernel import leaf
from chaosgym.machines.slider_crank.kernels.contact import (
    GAP,
    REACH,
    STIFFNESS,
    TWO_SIDED,
    UP,
    find_sides,
    find_suspects,
    first_change,
    polynomial,
    surfaces,
)
from chaosgym.machines.slider_crank.kernels.propagator import FORCING_TERMS, evaluate, expand, order_for, propagate
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

PIECES = 2
"""Pieces of a whole step that are searched for changes of contact one by one."""


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
    acceleration: np.ndarray
    curvature: np.ndarray
    propagator: np.ndarray


class Motion(NamedTuple):
    """Where the motion is, and space to move it: n coordinates, m channels.

    Attributes
    ----------
    z, moved : (2n + 4 + m,)
        Augmented states of ``crank_propagator``: now, and after the step.
    side : (m,)
        Closed side of each channel, +1 or -1, or 0.
    start, end, spare : (3, m)
        Displacement, velocity and acceleration of the channels: now, after the step or a piece of it, and anywhere.
    series : (order + 1, n + m)
        Taylor coefficients of coordinates and channels about the state now.
    until, towards : (m,)
        Of ``crank_contact.find_suspects``.
    peak : (2, 5)
        Of ``crank_record.note_peak``.
    """

    z: np.ndarray
    moved: np.ndarray
    side: np.ndarray
    start: np.ndarray
    end: np.ndarray
    spare: np.ndarray
    series: np.ndarray
    until: np.ndarray
    towards: np.ndarray
    peak: np.ndarray


@njit(cache=True)
def motion_of(model):
    """Space for a motion."""
    size, n = model.acceleration.shape[3], model.acceleration.shape[2]
    m, order = model.row.shape[0], model.order
    return Motion(
        np.zeros(size),
        np.zeros(size),
        np.zeros(m),
        np.zeros((3, m)),
        np.zeros((3, m)),
        np.zeros((3, m)),
        np.zeros((order + 1, n + m)),
        np.zeros(m),
        np.zeros(m),
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
def put_sides(surface, side, z):
    """Write the clearance columns of z."""
    first = z.shape[0] - side.shape[0]
    for j in range(side.shape[0]):
        z[first + j] = side[j] * surface[j, GAP]


@leaf
def put_time(z, n, x):
    """Write the forcing columns of z for time x as a share of the bin."""
    z[2 * n] = 1.0
    for k in range(1, FORCING_TERMS):
        z[2 * n + k] = z[2 * n + k - 1] * x


@leaf
def read_channels(row, curvature, z, reading):
    """Fill ``reading`` (3, m): displacement, velocity and acceleration of the channels in the state z.

    ``row`` and ``curvature`` are those of the model, the latter of one contact set and bin.
    """
    m, n = row.shape
    for j in range(m):
        y, v, a = 0.0, 0.0, 0.0
        for i in range(n):
            y += row[j, i] * z[i]
            v += row[j, i] * z[n + i]
        for c in range(z.shape[0]):
            a += curvature[j, c] * z[c]
        reading[0, j], reading[1, j], reading[2, j] = y, v, a


@leaf
def read_series(series, last, t, reading):
    """Fill ``reading`` at t from the channels' Taylor series up to order ``last``."""
    m = reading.shape[1]
    for j in range(m):
        reading[0, j], reading[1, j], reading[2, j] = polynomial(series, series.shape[1] - m + j, last, t)


@leaf
def bend(h, start, end, j):
    """How far channel j may stray in a step of length h from the cubic through both ends of it.

    The polynomial of fifth order that has the right accelerations too differs from it by t^2 (h - t)^2 / (2 h^2) times
    what the cubic's second derivative lacks at the ends.
    """
    chord = (end[0, j] - start[0, j]) / h
    first = start[2, j] - (6.0 * chord - 4.0 * start[1, j] - 2.0 * end[1, j]) / h
    second = end[2, j] - (2.0 * start[1, j] + 4.0 * end[1, j] - 6.0 * chord) / h
    return h * h / 32.0 * max(abs(first), abs(second))


@leaf
def quiet_steps(
    table,
    row,
    curvature,
    surface,
    side,
    z,
    moved,
    start,
    end,
    duration,
    step,
    first,
    limit,
    peak,
    channel_peak,
    contact_time,
):
    """Take up to ``limit`` whole steps in which no contact changes and no force passes its peak; how many.

    ``first`` steps of the bin have been taken. ``peak`` (2, 5) are those of the resultant, ``channel_peak`` (m, 2)
    those of the channels, or has no rows.

    Stops before a step that could do either, judged by its ends: between them, a cubic exceeds the larger end by no
    more than 4/27 of the step times the sum of both slopes, and the motion the cubic by ``bend``.
    """
    m, n = row.shape
    swing = 4.0 / 27.0 * step
    for c in range(2 * n + FORCING_TERMS, z.shape[0]):
        moved[c] = z[c]
    for count in range(limit):
        propagate(table, z, moved)
        put_time(moved, n, (first + count + 1) * step / duration)
        read_channels(row, curvature, moved, end)
        upward, total = 0.0, 0.0
        for j in range(m):
            gap = surface[j, GAP]
            doubt = bend(step, start, end, j)
            if side[j] == 0.0:
                reach = max(start[0, j], end[0, j])
                if surface[j, TWO_SIDED] != 0.0:
                    reach = max(abs(start[0, j]), abs(end[0, j]))
                if start[1, j] * end[1, j] < 0.0:
                    reach += swing * (abs(start[1, j]) + abs(end[1, j]))
                if reach + doubt >= gap:
                    return count
                continue
            s = side[j]
            f0, r0 = channel_force(surface, s, start, j)
            f1, r1 = channel_force(surface, s, end, j)
            turn = surface[j, STIFFNESS] * doubt
            if r0 * r1 < 0.0:
                turn += swing * (abs(r0) + abs(r1))
            if min(f0, f1) - turn <= 0.0:
                return count
            if channel_peak.shape[0] > 0 and max(f0, f1) + turn > channel_peak[j, 0 if s > 0.0 else 1]:
                return count
            upward += surface[j, UP] * s * f1
            total += surface[j, REACH] * (max(f0, f1) + turn)
        column = UPPER if upward > 0.0 else LOWER
        if total > peak[column, 0]:
            return count
        if total > 0.0:
            contact_time[column] += step
        for j in range(m):
            start[0, j], start[1, j], start[2, j] = end[0, j], end[1, j], end[2, j]
        for c in range(2 * n + FORCING_TERMS):
            z[c] = moved[c]
    return limit


@leaf
def write_samples(display, surface, side, z, spare, series, last, since, until, spacing, sample, history):
    """Write the samples of a revolution that fall into the expanded step [since, until); the number of the next one.

    ``history`` (samples, 3) is that of the revolution; z and ``spare`` are overwritten.
    """
    while sample < history.shape[0] and sample * spacing < until:
        at = max(sample * spacing - since, 0.0)
        evaluate(series, display.shape[0], last, at, z)
        read_series(series, last, at, spare)
        write_sample(display, z, joint_force(surface, side, spare), history[sample])
        sample += 1
    return sample


@leaf
def note_channels(surface, side, start, end, spare, series, last, since, h, channel_peak):
    """Raise the peaks (m, 2) of the closed channels, or of none if there are no rows, over h of an expanded step.

    ``since`` is where the piece begins in the step; ``spare`` is overwritten.
    """
    for j in range(channel_peak.shape[0]):
        s = side[j]
        if s != 0.0:
            f0, r0 = channel_force(surface, s, start, j)
            f1, r1 = channel_force(surface, s, end, j)
            crest, top = channel_crest(h, f0, r0, f1, r1)
            column = 0 if s > 0.0 else 1
            if crest > 0.0 and top > 0.99 * channel_peak[j, column]:
                read_series(series, last, since + crest, spare)
                top = channel_force(surface, s, spare, j)[0]
            channel_peak[j, column] = max(channel_peak[j, column], top)


@leaf
def careful_step(
    surface,
    side,
    start,
    end,
    spare,
    series,
    last,
    until,
    towards,
    now,
    h,
    pieces,
    tolerance,
    peak,
    channel_peak,
    contact_time,
):
    """Follow the expanded motion for at most h, up to the first change of contact, and record what happens.

    ``now`` is the time in the revolution. Leaves the reading ``start`` somewhere in the step.

    Returns
    -------
    (changed, h) : the channel whose contact changes or -1, and how long the step was.
    """
    force = joint_force(surface, side, start)
    done = 0.0
    for k in range(pieces):
        high = h if k == pieces - 1 else (k + 1) * (h / pieces)
        read_series(series, last, high, end)
        changed = -1
        if find_suspects(surface, side, high - done, start, end, until, towards) > 0:
            changed, instant = first_change(surface, side, series, last, done, until, towards, tolerance)
            if changed >= 0:
                high = instant
                read_series(series, last, high, end)
        length = high - done
        before, force = force, joint_force(surface, side, end)
        if before[1] + force[1] > 0.0:
            note_share(before, force, length, contact_time)
            note_peak(peak, now + high, force)
            crest, size = crest_instant(length, before, force)
            if size > 0.99 * peak[UPPER if force[0] > 0.0 else LOWER, 0]:
                read_series(series, last, done + crest, spare)
                note_peak(peak, now + done + crest, joint_force(surface, side, spare))
        note_channels(surface, side, start, end, spare, series, last, done, length, channel_peak)
        done = high
        if changed >= 0:
            return changed, done
        for i in range(3):
            for j in range(start.shape[1]):
                start[i, j] = end[i, j]
    return -1, done


@leaf
def change_side(surface, side, changed, towards, z, now, episode, impacts, bounce_time):
    """Close or open a channel at the time ``now`` in the revolution, and record a touch."""
    side[changed] = towards[changed] if side[changed] == 0.0 else 0.0
    if side[changed] != 0.0 and monitored(surface, changed):
        column = column_of(surface, changed, side[changed])
        impacts[column] += 1
        note_touch(episode, 1.0 if column == UPPER else -1.0, now, bounce_time)
    put_sides(surface, side, z)


@leaf
def turn(model, surface, motion, episode, arrays, cycle, tolerance, budget):
    """Move through one revolution; how many changes of contact it had.

    Within a bin, steps end on a grid of ``model.steps``; what is left of one after a change of contact is a careful
    step.
    """
    z, moved, side, start, end, spare = motion.z, motion.moved, motion.side, motion.start, motion.end, motion.spare
    series, until, towards = motion.series, motion.until, motion.towards
    row, display, acceleration = model.row, model.display, model.acceleration
    propagator, curvatures = model.propagator, model.curvature
    history, impacts, bounce_time = arrays.history[cycle], arrays.impacts[cycle], arrays.bounce_time[cycle]
    channel_peak, contact_time = arrays.channel_peak[cycle], arrays.contact_time[cycle]
    peak = motion.peak
    peak[:] = 0.0
    n, duration, steps, order = row.shape[1], model.bin_duration, model.steps, model.order
    step = duration / steps
    bins = acceleration.shape[1]
    spacing = bins * duration / max(history.shape[0], 1)
    events, sample = 0, 0
    chosen = contact_set(side, model.radix)
    for b in range(bins):
        begin = b * duration
        curvature = curvatures[chosen, b]
        put_time(z, n, 0.0)
        read_channels(row, curvature, z, start)
        time, done, on_grid = 0.0, 0, True
        while done < steps:
            if on_grid:
                limit = steps - done
                sampled = False
                if sample < history.shape[0]:
                    # up to the step into which the next sample falls, or only that one
                    ahead = int((sample * spacing - begin - time) / step)
                    sampled = ahead < 1
                    limit = min(limit, max(ahead, 1))
                if sampled:
                    expand(acceleration[chosen, b], row, z, duration, order, series)
                taken = quiet_steps(
                    propagator[chosen, b],
                    row,
                    curvature,
                    surface,
                    side,
                    z,
                    moved,
                    start,
                    end,
                    duration,
                    step,
                    done,
                    limit,
                    peak,
                    channel_peak,
                    contact_time,
                )
                if sampled and taken == 1:
                    sample = write_samples(
                        display,
                        surface,
                        side,
                        moved,
                        spare,
                        series,
                        order,
                        begin + time,
                        begin + (done + 1) * step,
                        spacing,
                        sample,
                        history,
                    )
                done += taken
                time = done * step
                if taken == limit:
                    continue
            h = (done + 1) * step - time
            last = order_for(model.spectrum * h, order)
            expand(acceleration[chosen, b], row, z, duration, last, series)
            changed, h = careful_step(
                surface,
                side,
                start,
                end,
                spare,
                series,
                last,
                until,
                towards,
                begin + time,
                h,
                PIECES if PIECES * h > step else 1,
                tolerance,
                peak,
                channel_peak,
                contact_time,
            )
            if sample < history.shape[0]:
                sample = write_samples(
                    display,
                    surface,
                    side,
                    moved,
                    spare,
                    series,
                    last,
                    begin + time,
                    begin + time + h,
                    spacing,
                    sample,
                    history,
                )
            evaluate(series, n, last, h, z)
            if changed < 0:
                done += 1
                time, on_grid = done * step, True
            else:
                time, on_grid = time + h, False
                events += 1
                if events > budget:
                    return events
                change_side(surface, side, changed, towards, z, begin + time, episode, impacts, bounce_time)
                chosen = contact_set(side, model.radix)
                curvature = curvatures[chosen, b]
            put_time(z, n, time / duration)
            read_channels(row, curvature, z, start)
            if changed >= 0:
                note_peak(peak, begin + time, joint_force(surface, side, start))
    write_peaks(peak, arrays, cycle)
    return events


@njit(cache=True, nogil=True)
def advance(model, state, episode, arrays, event_tolerance, event_budget):
    """Advance ``state`` (2n,) and ``episode`` in place by whole revolutions, one for each row of ``arrays``.

    Every revolution starts at crank angle zero. ``event_tolerance`` is the error [s] of an event's instant.

    Returns
    -------
    (status, cycle) : the cycle is the first one not finished.
    """
    period = model.acceleration.shape[1] * model.bin_duration
    motion, surface = motion_of(model), surfaces(model)
    for cycle in range(arrays.section.shape[0]):
        begin_cycle(model, state, arrays, cycle)
        for i in range(state.shape[0]):
            motion.z[i] = state[i]
        read_channels(model.row, model.curvature[0, 0], motion.z, motion.start)
        find_sides(surface, motion.start, motion.side)
        put_sides(surface, motion.side, motion.z)
        arrays.events[cycle] = turn(model, surface, motion, episode, arrays, cycle, event_tolerance, event_budget)
        if arrays.events[cycle] > event_budget:
            return status.EVENT_BUDGET, cycle
        for i in range(state.shape[0]):
            state[i] = motion.z[i]
            if not abs(state[i]) < RUNAWAY:
                return status.DIVERGED, cycle
        episode.touch[0] -= period
        episode.touch[1] -= period
    return status.OK, arrays.section.shape[0]
