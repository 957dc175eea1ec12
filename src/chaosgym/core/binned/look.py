"""Bounds over eight intervals ahead from the readings at their ends, and what is recorded of them.

Between two ends a reading lies within 4/27 of the interval times the slopes that lead beyond them, and within
``VALUE_DOUBT`` times its fourth power and the bound of the fourth derivative (``events``).
"""

import math

from chaosgym.core.binned.motion import (
    ALONG,
    GAP,
    NOW,
    REACH,
    READINGS,
    SIDEWAYS,
    SLOPES,
    STIFFNESS,
    TWO_SIDED,
    UP,
    known,
    places,
    side_of,
)
from chaosgym.core.binned.record import note_peak, note_share, resultant
from chaosgym.core.cycle import LOWER, UPPER
from chaosgym.core.events import VALUE_DOUBT, trend
from chaosgym.core.kernel import leaf, part
from chaosgym.core.lanes import LANES, add_tops, first_above, first_doubt


@leaf
def joint_force(motion, which):
    """``resultant`` of the monitored joint, by one of the readings of each channel."""
    here = places(motion.n, motion.m)
    own = motion.own
    fx, fy, fz, rx, ry, rz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(motion.m):
        side = side_of(motion, j)
        if side != 0.0:
            place = here.readings + j * READINGS + which
            force = known(motion, j, STIFFNESS) * (own[place] - side * known(motion, j, GAP))
            rate = known(motion, j, STIFFNESS) * own[place + SLOPES]
            fx += known(motion, j, ALONG) * force
            fy += known(motion, j, UP) * force
            fz += known(motion, j, SIDEWAYS) * force
            rx += known(motion, j, ALONG) * rate
            ry += known(motion, j, UP) * rate
            rz += known(motion, j, SIDEWAYS) * rate
    return resultant(fx, fy, fz, rx, ry, rz)


@leaf
def force_at(motion, j, which):
    """Force of closed channel j and its rate, by one of its readings."""
    place, side = places(motion.n, motion.m).readings + j * READINGS + which, side_of(motion, j)
    stiffness, gap = known(motion, j, STIFFNESS), known(motion, j, GAP)
    return stiffness * (side * motion.own[place] - gap), stiffness * side * motion.own[place + SLOPES]


@leaf
def is_steady(motion, j, which, h):
    """True if channel j surely rises all through an interval, or falls, from one of its readings on."""
    here = places(motion.n, motion.m)
    own, place = motion.own, here.readings + j * READINGS + which
    e0, d0, e1, d1 = own[place], own[place + SLOPES], own[place + 1], own[place + SLOPES + 1]
    return trend(h, e0, d0, e1, d1, own[here.fourth + j]) != 0


@part
def quiet_intervals(motion, h, count):
    """Number of intervals, up to ``count``, in which surely no contact changes."""
    here = places(motion.n, motion.m)
    h4 = VALUE_DOUBT * h * h * h * h
    for j in range(motion.m):
        gap, s = known(motion, j, GAP), side_of(motion, j)
        low, high = -math.inf, math.inf
        if s > 0.0:
            low = gap
        elif s < 0.0:
            high = -gap
        else:
            high = gap
            if known(motion, j, TWO_SIDED) != 0.0:
                low = -gap
        place = here.readings + j * READINGS + NOW
        doubt = h4 * motion.own[here.fourth + j]
        count = min(count, first_doubt(motion.own, place, place + SLOPES, h, low, high, doubt, 0))
    return count


@leaf
def note_channels(motion, h, count, channel_peak):
    """Raise the peaks (m, 2) of the closed channels; the number of intervals before the first unknown crest."""
    here = places(motion.n, motion.m)
    h4 = VALUE_DOUBT * h * h * h * h
    for j in range(motion.m):
        s = side_of(motion, j)
        if s == 0.0:
            continue
        column = 0 if s > 0.0 else 1
        place, top = here.readings + j * READINGS + NOW, here.totals
        doubt, stiffness = h4 * motion.own[here.fourth + j], known(motion, j, STIFFNESS)
        for k in range(LANES):
            motion.own[top + k] = 0.0
        more = stiffness * (doubt - known(motion, j, GAP))
        add_tops(motion.own, place, place + SLOPES, h, s, stiffness, more, top)
        k = first_above(motion.own, top, channel_peak[j, column], 0)
        while k < count:
            for end in range(k, k + 2):
                channel_peak[j, column] = max(channel_peak[j, column], force_at(motion, j, NOW + end)[0])
            if motion.own[top + k] > channel_peak[j, column] and not is_steady(motion, j, NOW + k, h):
                count = k
            k = first_above(motion.own, top, channel_peak[j, column], k + 1)
    return count


@part
def note_joint(motion, now, h, count, peak, contact_time):
    """Record the force of the monitored joint; the number of intervals before the first unknown crest.

    ``now`` is the time in the revolution; ``peak`` (2, 5) is that of ``note_peak``.
    """
    here = places(motion.n, motion.m)
    own, h4 = motion.own, VALUE_DOUBT * h * h * h * h
    closed, single, up, down = 0, 0, False, False
    for k in range(LANES):
        own[here.totals + k] = 0.0
    for j in range(motion.m):
        s, weight = side_of(motion, j), known(motion, j, REACH) * known(motion, j, STIFFNESS)
        if s == 0.0 or weight == 0.0:
            continue
        closed, single = closed + 1, j
        up, down = up or known(motion, j, UP) * s > 0.0, down or known(motion, j, UP) * s < 0.0
        place = here.readings + j * READINGS + NOW
        more = weight * (h4 * own[here.fourth + j] - known(motion, j, GAP))
        add_tops(own, place, place + SLOPES, h, s, weight, more, here.totals)
    if closed == 0:
        return count
    limit = _lowest_peak(peak, up, down)
    k = first_above(own, here.totals, limit, 0)
    while k < count:
        note_peak(peak, now + k * h, joint_force(motion, NOW + k))
        note_peak(peak, now + (k + 1) * h, joint_force(motion, NOW + k + 1))
        limit = _lowest_peak(peak, up, down)
        if own[here.totals + k] > limit and not (closed == 1 and is_steady(motion, single, NOW + k, h)):
            count = k
        k = first_above(own, here.totals, limit, k + 1)
    if up and down:
        for k in range(count):
            before = joint_force(motion, NOW + k)
            after = joint_force(motion, NOW + k + 1)
            note_share(before, after, h, contact_time)
    else:
        contact_time[UPPER if up else LOWER] += count * h
    return count


@leaf
def _lowest_peak(peak, up, down):
    """Size of the peak of the side towards which the resultant points, or of the smaller one if it may be either."""
    if up and down:
        return min(peak[UPPER, 0], peak[LOWER, 0])
    return peak[UPPER if up else LOWER, 0]
