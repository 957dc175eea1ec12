r"""Exact motion of a mechanism whose joints rattle in their clearance.

Coordinates p are small motions about the nominal motion of the drive. A contact channel j measures row_j . p against
its clearance c_j on one side or on both; closed on side s = +-1 it pushes with

    (1)  |N| = k (s row.p - c) + d s row.p'    while the penetration s row.p - c and |N| are positive

so it pushes and never pulls: beyond the surface it detaches when spring and damper together would pull. The matrices
are held over each bin of the angle of the drive, the forcing is continuous, and between two changes of contact the
motion is propagated exactly (``tables``).

Readings of the channels are looked at eight intervals ahead, and the motion goes on through those in which it is proven
that no contact changes and that no force exceeds the peak of the revolution unseen (``look``). The next one is expanded
in its Taylor series, on which changes of contact and crests are found. Recording only reads: a time history does not
change the motion by a bit.
"""

import numpy as np

from chaosgym.core import status
from chaosgym.core.binned.deviations import carry, carry_expanded, jump
from chaosgym.core.binned.look import joint_force, note_channels, note_joint, quiet_intervals
from chaosgym.core.binned.motion import (
    NOW,
    READINGS,
    SLOPES,
    SPARE,
    bound_fourth,
    contact_set,
    evaluate,
    expand_from,
    find_sides,
    look_ahead,
    motion_of,
    move,
    places,
    put_evaluated,
    put_sides,
    put_stiffness,
    read_after,
    read_now,
)
from chaosgym.core.binned.record import begin_cycle, note_peak, write_peaks, write_sample
from chaosgym.core.binned.series import order_for, put_time
from chaosgym.core.binned.step import careful_step, change_side
from chaosgym.core.binned.tables import table_places
from chaosgym.core.events import let_pass
from chaosgym.core.kernel import leaf, njit
from chaosgym.core.lanes import LANES
from chaosgym.core.tangent import orthonormalise

RUNAWAY = 1e3
"""Coordinate [m] that counts as divergence."""

STEP_BUDGET = 5_000_000
"""Looks that a revolution may have: some seconds of processor time."""

NOTHING = 1e-12
"""Share of an interval that is too short to be a step."""


@leaf
def write_expanded(motion, display, last, since, h, spacing, sample, history):
    """Write the samples of a revolution that fall into the expanded step [since, since + h); the number of the next.

    ``history`` (samples, 3) is that of the revolution.
    """
    z = places(motion.n, motion.m).sampled
    while sample < history.shape[0] and sample * spacing < since + h:
        evaluate(motion, last, max(sample * spacing - since, 0.0), SPARE)
        put_evaluated(motion, z)
        state = motion.own[z : z + 2 * motion.n]
        write_sample(display, state, joint_force(motion, SPARE), history[sample])
        sample += 1
    return sample


@leaf
def write_samples(model, motion, at, begin, done, count, spacing, sample, history):
    """As ``write_expanded``, for ``count`` intervals of the bin that starts at ``begin``, after those ``done``."""
    own, here, duration = motion.own, places(motion.n, motion.m), model.bin_duration
    z = here.sampled
    share = 1.0 / (model.steps * LANES)
    interval = share * duration
    for k in range(count):
        since = begin + (done + k) * interval
        if sample == history.shape[0] or sample * spacing >= since + (count - k) * interval:
            break
        if sample * spacing < since + interval:
            # the state at the start of the interval, anew for each: samples overwrite it
            for c in range(here.width):
                own[z + c] = own[here.z + c]
            for i in range(k):
                move(motion, at, z, 1, (done + i) * share, share)
            expand_from(motion, at, model.row, z, duration, model.order)
            sample = write_expanded(motion, model.display, model.order, since, interval, spacing, sample, history)
    return sample


@leaf
def turn(model, motion, peak, bouncing, arrays, cycle, tolerance, budget, vectors):
    """Move through one revolution; how many changes of contact it had.

    Looks begin at the ends of intervals; what is left of one after a change of contact is a careful step.
    """
    own, row, bins, anchors, here = motion.own, model.row, model.bins, model.anchor, places(motion.n, motion.m)
    z, tables = here.z, table_places(motion.n, motion.m)
    history, impacts, bounce_time = arrays.history[cycle], arrays.impacts[cycle], arrays.bounce_time[cycle]
    channel_peak, contact_time = arrays.channel_peak[cycle], arrays.contact_time[cycle]
    peak[:] = 0.0
    time_at, length = z + 2 * motion.n, tables.length
    duration, most = model.bin_duration, model.steps * LANES
    share = 1.0 / most
    interval = share * duration
    spacing = bins * duration / max(history.shape[0], 1)
    events, sample, carries = 0, np.int64(0), vectors.shape[0] > 0
    chosen = contact_set(motion, model.radix)
    put_sides(motion, anchors[chosen])
    for b in range(bins):
        begin = b * duration
        at = (chosen * bins + b) * length
        put_time(own, time_at, 0.0)
        if model.share.shape[0] > 0:
            put_stiffness(motion, model.stiffness, model.share[b])
        if b == 0 or chosen > 0:
            # damping reads the acceleration, which jumps with the matrices
            read_now(motion, at)
        if b == 0:
            note_peak(peak, 0.0, joint_force(motion, NOW))
        done, since = np.int64(0), 0.0
        while done < most:
            # ``since``: what has passed of the interval, where a contact has changed in it
            if since == 0.0:
                look_ahead(motion, at)
                bound_fourth(motion, at)
                most_now = min(LANES, most - done)
                count = quiet_intervals(motion, interval, most_now)
                if chosen > 0 and count > 0:
                    if channel_peak.shape[0] > 0:
                        count = note_channels(motion, interval, count, channel_peak)
                    now = begin + done * interval
                    count = note_joint(motion, now, interval, count, peak, contact_time)
                if count > 0:
                    if sample < history.shape[0]:
                        sample = write_samples(model, motion, at, begin, done, count, spacing, sample, history)
                    move(motion, at, z, count, done * share, share)
                    if carries:
                        if count == LANES:
                            carry(motion, at + tables.look, np.int64(1), vectors)
                        else:
                            carry(motion, at + tables.interval, count, vectors)
                    read_after(motion, count)
                    done += count
                if count == most_now:
                    continue
                h, last = interval, model.order
            else:
                bound_fourth(motion, at)
                h = interval - since
                last = order_for(model.spectrum * h, model.order)
            time = begin + done * interval + since
            changed, towards, h = careful_step(
                motion, at, chosen > 0, row, duration, last, time, h, tolerance, peak, channel_peak, contact_time
            )
            if sample < history.shape[0]:
                sample = write_expanded(motion, model.display, last, time, h, spacing, sample, history)
            if carries:
                carry_expanded(motion, at, row, duration, last, h, vectors)
            if changed >= 0:
                events += 1
                if events > budget:
                    return events
                since += h
                time += h
                change_side(motion, changed, towards, time, bouncing, impacts, bounce_time)
                touches = towards * own[here.readings + changed * READINGS + NOW + 1 + SLOPES] > 0.0
                chosen, before = contact_set(motion, model.radix), at
                at = (chosen * bins + b) * length
                put_sides(motion, anchors[chosen])
                if carries and touches:
                    jump(motion, before + tables.acceleration, at + tables.acceleration, vectors)
                put_time(own, time_at, (time - begin) / duration)
                read_now(motion, at)
                note_peak(peak, time, joint_force(motion, NOW))
                if since < interval * (1.0 - NOTHING):
                    continue
            else:
                read_after(motion, 1)
            since = 0.0
            done += 1
            put_time(own, time_at, done * share)
    write_peaks(peak, arrays, cycle)
    return events


@njit(cache=True, nogil=True)
def advance(model, state, bouncing, arrays, event_tolerance, event_budget, tangents):
    """Advance ``state`` (2n,) and ``bouncing`` in place by whole revolutions, one for each row of ``arrays``.

    Every revolution starts at angle zero of the drive. ``event_tolerance`` is the error [s] of an event's instant.
    ``tangents`` are ``core.tangent.Tangents``, of no vectors if none are wanted.

    Returns
    -------
    (status, cycle) : the cycle is the first one not finished.
    """
    if model.steps * model.bins > STEP_BUDGET:
        return status.STEP_BUDGET, 0
    period = model.bins * model.bin_duration
    m, n = model.row.shape
    motion, z = motion_of(model), places(n, m).z
    peak, metric = np.zeros((2, 5)), np.full(n, model.contact_rate**2)
    for cycle in range(arrays.section.shape[0]):
        begin_cycle(model, state, arrays, cycle)
        for i in range(2 * n):
            motion.own[z + i] = state[i]
            if not abs(state[i]) < RUNAWAY:
                return status.DIVERGED, cycle
        find_sides(motion, model.row)
        arrays.events[cycle] = turn(
            model, motion, peak, bouncing, arrays, cycle, event_tolerance, event_budget, tangents.vectors
        )
        if arrays.events[cycle] > event_budget:
            return status.EVENT_BUDGET, cycle
        for i in range(2 * n):
            state[i] = motion.own[z + i]
            if not abs(state[i]) < RUNAWAY:
                return status.DIVERGED, cycle
        if tangents.log_growth.shape[1] > 0:
            tangents.log_growth[cycle] = 0.0
            orthonormalise(metric, tangents, cycle)
        let_pass(bouncing, 1, period)
    return status.OK, arrays.section.shape[0]
