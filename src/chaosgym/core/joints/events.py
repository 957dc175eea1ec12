"""Events of several joints: bounds over the intervals ahead, what is recorded of them, and what ends an interval.

A joint's reading and the proofs are those of ``events``, with the gap and the lag of the surface in question. Readings
are taken at the ends of intervals (``joints.run.look``), and within the shortest one on its Taylor series.
"""

import math

import numpy as np

from chaosgym.core.cycle import LOWER, UPPER
from chaosgym.core.events import (
    CROSSES,
    KEEPS,
    UNSURE,
    VALUE_DOUBT,
    closing,
    crossing,
    cubic,
    cubic_extremum,
    judge,
    opening,
    reading_at,
    trend,
)
from chaosgym.core.joints.run import bound_second, expand
from chaosgym.core.joints.space import (
    AWAKE,
    FOURTH,
    JOINT,
    LOWER_GAP,
    NOW,
    NUMBERS,
    PEAKS,
    RATES,
    READING,
    READINGS,
    ROUNDED,
    SERIES,
    SIDE,
    TOTALS,
    UPPER_GAP,
    gap_of,
    known,
    lag_of,
    spring_of,
)
from chaosgym.core.joints.tables import CHANNELS, DEGREE, JOINTS, LONGEST, SHORTEST
from chaosgym.core.kernel import leaf, part
from chaosgym.core.lanes import LANES, add_tops, exponent, first_above, first_doubt, item, power_of_two
from chaosgym.core.propagator import safe_time

GAP_DOUBT = 0.1
"""Largest distance of an open joint from the cubics of the intervals, as a share of its distance from the nearer
surface."""

CONTACT_DOUBT = 1e-3
"""The same of a pressed joint, as a share of the largest force so far."""

CREST_SEARCHES = 2
"""Times that a crest is placed on a cubic; each leaves the fourth power of the error before."""

NEAR_PEAK = 0.99
"""Share of the peak so far that the cubic must reach for a crest to be worth a search."""


@part
def place_of(run, j):
    """Where the reading of now of channel j lies."""
    return run.at[READING] + j * READINGS + NOW


@part
def choose_level(run, row, most, left):
    """Level up to ``most`` at which intervals are longest, and their length.

    The cubic through the ends of one is near enough to what each channel reads, and four intervals fit into what is
    ``left`` of the cycle, unless it is level 0.
    """
    own, at, h, times = run.own, run.at, run.tables[row + SHORTEST], math.inf
    shortest4 = VALUE_DOUBT * h * h * h * h
    for j in range(at[CHANNELS]):
        if known(run, j, AWAKE) == 0.0:
            continue
        reading, side = item(own, place_of(run, j)), known(run, j, SIDE)
        if side == 0.0:
            room = GAP_DOUBT * min(known(run, j, UPPER_GAP) - reading, reading + known(run, j, LOWER_GAP))
        elif j >= at[JOINTS]:
            room = GAP_DOUBT * (side * reading - gap_of(run, j, side))
        else:
            largest = item(own, at[PEAKS] + 2 * j + (UPPER if side > 0.0 else LOWER)) / spring_of(run, j, side)
            room = CONTACT_DOUBT * max(largest, side * reading - gap_of(run, j, side))
        times = min(times, room / (known(run, j, FOURTH) * shortest4))
    # an interval twice as long has sixteen times the error
    if not (times >= 16.0 and left >= 8.0 * h):
        return np.int64(0), h
    level = min(min(most, int(run.tables[row + LONGEST])), min(exponent(times) // 4, exponent(left / h) - 2))
    return level, h * power_of_two(level)


@part
def quiet_intervals(run, row, h, count):
    """Number of intervals, up to ``count``, in which surely no contact and no friction changes."""
    own, h4 = run.own, VALUE_DOUBT * h * h * h * h
    for j in range(run.at[CHANNELS]):
        if known(run, j, AWAKE) == 0.0:
            continue
        side, place = known(run, j, SIDE), place_of(run, j)
        low, high = -known(run, j, LOWER_GAP), known(run, j, UPPER_GAP)
        if side > 0.0:
            low, high = high, math.inf
        elif side < 0.0:
            low, high = -math.inf, low
        doubt = h4 * known(run, j, FOURTH)
        i = first_doubt(own, place, place + RATES, h, low, high, doubt, 0)
        if i < count:
            bend = bound_second(run.tables, own, run.at, row, j)
            while i < count:
                value, slope = item(own, place + i), item(own, place + RATES + i)
                # an open joint beyond a surface presses as soon as its pressure grows, wherever it goes
                beyond = side == 0.0 and not low <= value <= high
                if beyond or not min(safe_time(high - value, -slope, bend), safe_time(value - low, slope, bend)) > h:
                    count = i
                i = first_doubt(own, place, place + RATES, h, low, high, doubt, i + 1)
    return count


@leaf
def force_at(run, j, which):
    """Force of pressed joint j and its rate, by one of its readings."""
    place, side = run.at[READING] + j * READINGS + which, known(run, j, SIDE)
    spring = spring_of(run, j, side)
    return spring * (side * run.own[place] - gap_of(run, j, side)), spring * side * run.own[place + RATES]


@leaf
def note_now(run):
    """Raise the peaks to the forces of now."""
    own, peak = run.own, run.at[PEAKS]
    for j in range(run.at[JOINTS]):
        side = known(run, j, SIDE)
        if side != 0.0:
            column = 2 * j + (UPPER if side > 0.0 else LOWER)
            own[peak + column] = max(own[peak + column], force_at(run, j, NOW)[0])


@leaf
def note_rounding(run, j, side):
    """Count as rounding what the pressure of joint j, changed just now on a side, shows on the wrong side of zero.

    Coordinates of two sets agree by rounding alone, which grows with their number and size. A pressure that a set sees
    as zero is a little above in the next one; without this the joint closes and opens again without end.
    """
    own, first, place = run.own, run.at[JOINT] + j * NUMBERS, place_of(run, j)
    if own[first + SIDE] == 0.0:
        wrong = side * (own[place] + lag_of(run, j, side) * own[place + RATES]) - gap_of(run, j, side)
    else:
        wrong = gap_of(run, j, side) - side * own[place]
    own[first + ROUNDED] = max(own[first + ROUNDED], 2.0 * wrong)


@leaf
def note_peaks(run, h, count):
    """Raise the peaks of pressed joints; the number of intervals before the first unknown crest."""
    own, at, h4 = run.own, run.at, VALUE_DOUBT * h * h * h * h
    for j in range(at[JOINTS]):
        side = known(run, j, SIDE)
        if side == 0.0:
            continue
        column, place, top = at[PEAKS] + 2 * j + (UPPER if side > 0.0 else LOWER), place_of(run, j), at[TOTALS]
        spring, fourth = spring_of(run, j, side), known(run, j, FOURTH)
        for k in range(LANES):
            own[top + k] = 0.0
        add_tops(own, place, place + RATES, h, side, spring, spring * (h4 * fourth - gap_of(run, j, side)), top)
        k = first_above(own, top, own[column], 0)
        while k < count:
            for end in range(k, k + 2):
                own[column] = max(own[column], force_at(run, j, NOW + end)[0])
            e0, d0, e1, d1 = own[place + k], own[place + RATES + k], own[place + k + 1], own[place + RATES + k + 1]
            if own[top + k] > own[column] and trend(h, e0, d0, e1, d1, fourth) == 0:
                count = k
            k = first_above(own, top, own[column], k + 1)
    return count


@leaf
def note_crests(run, row, h, expanded):
    """Raise the peaks of pressed joints to their crests within h, and at its end; see ``first_change``."""
    own, at = run.own, run.at
    for j in range(at[JOINTS]):
        side = known(run, j, SIDE)
        if side == 0.0:
            continue
        column, series = at[PEAKS] + 2 * j + (UPPER if side > 0.0 else LOWER), at[SERIES] + j * (DEGREE + 1)
        spring, gap, lag = spring_of(run, j, side), gap_of(run, j, side), lag_of(run, j, side)
        f0, r0 = force_at(run, j, NOW)
        f1, r1 = force_at(run, j, NOW + 1)
        own[column] = max(own[column], max(f0, f1))
        since, length = 0.0, h
        for _ in range(CREST_SEARCHES):
            crest = cubic_extremum(f0, r0, f1, r1, length, -1.0) if r0 > 0.0 and r1 < 0.0 else -1.0
            if crest <= 0.0 or cubic(f0, r0, f1, r1, length, crest)[0] <= NEAR_PEAK * own[column]:
                break
            if not expanded:
                expand(run, row)
                expanded = True
            y, v, a, _ = reading_at(own, series, 1, DEGREE, since + crest)
            force, rate = spring * (side * (y + lag * v) - gap), spring * side * (v + lag * a)
            own[column] = max(own[column], force)
            if rate > 0.0:
                f0, r0, since, length = force, rate, since + crest, length - crest
            else:
                f1, r1, length = force, rate, crest


@leaf
def read_series(run, time):
    """Write what every channel that is awake reads at a time of its series as its reading after one interval."""
    for j in range(run.at[CHANNELS]):
        if known(run, j, AWAKE) != 0.0:
            side, place = known(run, j, SIDE), place_of(run, j) + 1
            y, v, a, _ = reading_at(run.own, run.at[SERIES] + j * (DEGREE + 1), 1, DEGREE, time)
            lag = 0.0 if side == 0.0 else lag_of(run, j, side)
            run.own[place], run.own[place + RATES] = y + lag * v, v + lag * a


@leaf
def first_change(run, row, h, expanded, tolerance):
    """(Channel or -1, its new side, instant, ``expanded``) of the first change of contact or friction within h.

    The readings of now and after one interval are those at both ends. Series of the joints are made where they are
    needed, if they are not ``expanded``.
    """
    own, at = run.own, run.at
    first, towards, instant = np.int64(-1), 0.0, h
    for j in range(at[CHANNELS]):
        if known(run, j, AWAKE) == 0.0:
            continue
        place, series, side = place_of(run, j), at[SERIES] + j * (DEGREE + 1), known(run, j, SIDE)
        e0, d0, e1, d1 = own[place], own[place + RATES], own[place + 1], own[place + RATES + 1]
        fourth = known(run, j, FOURTH)
        if side != 0.0:
            gap, lag = gap_of(run, j, side), lag_of(run, j, side)
            e0, d0, e1, d1 = side * e0 - gap, side * d0, side * e1 - gap, side * d1
            verdict = judge(h, e0, d0, e1, d1, fourth)
            if verdict == KEEPS:
                continue
            if not expanded:
                expand(run, row)
                expanded = True
            if verdict == CROSSES:
                found = crossing(own, series, 1, DEGREE, side, gap, lag, 0.0, h, e0, d0, e1, d1, tolerance)
            else:
                # what begins to stick is at its limit, to which its force does not grow yet
                longer = 2.0 if j >= at[JOINTS] else 1.0
                least = known(run, j, ROUNDED)
                found = opening(own, series, 1, DEGREE, side, gap, lag, least, instant, tolerance, longer)
            if found <= instant:
                first, towards, instant = j, 0.0, found
            continue
        for which in range(2):
            way = 1.0 if which == 0 else -1.0
            gap = gap_of(run, j, way)
            if gap == math.inf:
                continue
            p0, q0, p1, q1 = gap - way * e0, -way * d0, gap - way * e1, -way * d1
            verdict = judge(h, p0, q0, p1, q1, fourth) if p0 >= 0.0 else UNSURE
            if verdict == KEEPS:
                continue
            if not expanded:
                expand(run, row)
                expanded = True
            if verdict == CROSSES:
                found = crossing(own, series, 1, DEGREE, way, gap, 0.0, 0.0, h, -p0, -q0, -p1, -q1, tolerance)
            else:
                lag, least = lag_of(run, j, way), known(run, j, ROUNDED)
                found = closing(own, series, 1, DEGREE, way, gap, lag, least, instant, tolerance)
            if found <= instant:
                first, towards, instant = j, way, found
    return first, towards, instant, expanded
