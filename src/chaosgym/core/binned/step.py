"""One step of a mechanism on its Taylor series: up to the first change of contact, with the crests on the way."""

from chaosgym.core.binned.look import force_at, joint_force
from chaosgym.core.binned.motion import (
    GAP,
    LAG,
    NOW,
    REACH,
    READINGS,
    SLOPES,
    SPARE,
    TWO_SIDED,
    UP,
    evaluate,
    expand_from,
    known,
    places,
    put_evaluated,
    side_of,
)
from chaosgym.core.binned.record import channel_crest, crest_instant, note_peak, note_share
from chaosgym.core.cycle import LOWER, UPPER
from chaosgym.core.events import CROSSES, KEEPS, closing, crossing, note_touch, opening, settled
from chaosgym.core.kernel import leaf, part

CREST_SEARCHES = 2
"""Times that a crest is placed on a cubic; each leaves the fourth power of the error before."""

NEAR_PEAK = 0.99
"""Share of the peak so far that the cubic must reach for a crest to be worth a search."""


@part
def first_change(motion, last, h, tolerance):
    """(Channel or -1, its new side, instant) of the first change of contact within h, which is expanded.

    ``NOW`` and the reading after it are those at both ends.
    """
    own, here = motion.own, places(motion.n, motion.m)
    lanes = here.lanes
    first, towards, instant = -1, 0.0, h
    for j in range(motion.m):
        place, side = here.readings + j * READINGS + NOW, side_of(motion, j)
        gap, lag, two_sided = known(motion, j, GAP), known(motion, j, LAG), known(motion, j, TWO_SIDED)
        e0, d0, e1, d1 = own[place], own[place + SLOPES], own[place + 1], own[place + SLOPES + 1]
        verdict, to = settled(side, gap, two_sided, e0, d0, e1, d1, h, own[here.fourth + j])
        series = here.series + motion.n + j
        if verdict == KEEPS:
            continue
        if verdict == CROSSES:
            to_lag, facing = own[here.lags + j], side if side != 0.0 else to
            e0, d0, e1, d1 = facing * e0 - gap, facing * d0, facing * e1 - gap, facing * d1
            found = crossing(own, series, lanes, last, facing, gap, to_lag, 0.0, h, e0, d0, e1, d1, tolerance)
            if found <= instant:
                first, towards, instant = j, to, found
        elif side != 0.0:
            found = opening(own, series, lanes, last, side, gap, lag, 0.0, instant, tolerance, 1.0)
            if found <= instant:
                first, towards, instant = j, 0.0, found
        else:
            found = closing(own, series, lanes, last, 1.0, gap, lag, 0.0, instant, tolerance)
            if found <= instant:
                first, towards, instant = j, 1.0, found
            if two_sided != 0.0:
                found = closing(own, series, lanes, last, -1.0, gap, lag, 0.0, instant, tolerance)
                if found <= instant:
                    first, towards, instant = j, -1.0, found
    return first, towards, instant


@leaf
def note_crest(motion, last, now, h, before, after, peak):
    """Raise the peaks (2, 5) to the crest of the resultant within h, which is expanded: ``before`` to ``after``."""
    since, length = 0.0, h
    for _ in range(CREST_SEARCHES):
        crest, size = crest_instant(length, before, after)
        if size <= NEAR_PEAK * peak[UPPER if after[0] > 0.0 else LOWER, 0]:
            return
        evaluate(motion, last, since + crest, SPARE)
        there = joint_force(motion, SPARE)
        note_peak(peak, now + since + crest, there)
        if there[2] > 0.0:
            before, since, length = there, since + crest, length - crest
        else:
            after, length = there, crest


@leaf
def note_channel_crests(motion, last, h, channel_peak):
    """Raise the peaks (m, 2) of the closed channels to their crests within h, which is expanded, and at its ends."""
    for j in range(channel_peak.shape[0]):
        side = side_of(motion, j)
        column = 0 if side > 0.0 else 1
        if side == 0.0:
            continue
        f0, r0 = force_at(motion, j, NOW)
        f1, r1 = force_at(motion, j, NOW + 1)
        channel_peak[j, column] = max(channel_peak[j, column], max(f0, f1))
        since, length = 0.0, h
        for _ in range(CREST_SEARCHES):
            crest, top = channel_crest(length, f0, r0, f1, r1)
            if crest <= 0.0 or top <= NEAR_PEAK * channel_peak[j, column]:
                break
            evaluate(motion, last, since + crest, SPARE)
            force, rate = force_at(motion, j, SPARE)
            channel_peak[j, column] = max(channel_peak[j, column], force)
            if rate > 0.0:
                f0, r0, since, length = force, rate, since + crest, length - crest
            else:
                f1, r1, length = force, rate, crest


@part
def careful_step(motion, at, closed, row, duration, last, now, h, tolerance, peak, channel_peak, contact_time):
    """Follow the motion for at most h, up to the first change of contact, and record what happens.

    ``closed`` tells if a contact is; ``now`` is the time in the revolution. Moves the state, puts the readings at its
    end after those of ``NOW``, and leaves the series.

    Returns
    -------
    (changed, towards, h) : the channel whose contact changes or -1, its new side, and how long the step was.
    """
    z = places(motion.n, motion.m).z
    expand_from(motion, at, row, z, duration, last)
    evaluate(motion, last, h, NOW + 1)
    changed, towards, h = first_change(motion, last, h, tolerance)
    if changed >= 0:
        evaluate(motion, last, h, NOW + 1)
    put_evaluated(motion, z)
    if closed:
        before, after = joint_force(motion, NOW), joint_force(motion, NOW + 1)
        note_share(before, after, h, contact_time)
        note_peak(peak, now + h, after)
        if before[2] > 0.0 and after[2] < 0.0:
            note_crest(motion, last, now, h, before, after, peak)
        if channel_peak.shape[0] > 0:
            note_channel_crests(motion, last, h, channel_peak)
    return changed, towards, h


@part
def change_side(motion, changed, towards, now, bouncing, impacts, bounce_time):
    """Close a channel on the side ``towards`` or open it at ``now`` in the revolution, and record a touch."""
    motion.own[places(motion.n, motion.m).sides + changed] = towards
    if towards != 0.0 and known(motion, changed, REACH) > 0.0:
        up = known(motion, changed, UP) * towards > 0.0
        impacts[UPPER if up else LOWER] += 1
        note_touch(bouncing, 1, 0, 1.0 if up else -1.0, now, bounce_time)
