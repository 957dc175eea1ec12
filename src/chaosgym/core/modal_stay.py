"""How long a tip stays in a state between, on or beyond the stops, and what ends that; states as in ``modal_impact``.

Constant tables (``event_tables``) give what ends a state at eight instants ahead. An interval between two of them is
passed only if the cubic through its ends and the bound of the rest, or a bound of the second derivative, prove that
nothing ends. One that remains is cut into eight, and again, until it is as short as the fastest mode requires; there
what is shown is a polynomial of degree 15, whose first zero ``first_fall`` finds.
"""

import math

import numpy as np

from chaosgym.core.cubic import cubic, cubic_extremum
from chaosgym.core.event_tables import BOUND2, BOUND4, LEVELS, PULL2, PULL4, SHOWN, SHOWN_RATE, A, V, X
from chaosgym.core.first_fall import DEGREE, first_fall
from chaosgym.core.kernel import leaf, part
from chaosgym.core.lanes import first_doubt, largest
from chaosgym.core.modal_model import FREE, LOWER_STOP, UPPER_STOP
from chaosgym.core.modal_run import (
    DAMPING,
    POSITION,
    STIFFNESS,
    expand,
    jump,
    look,
    number,
    place,
    read,
    regime_of,
    size_of,
    travel,
)
from chaosgym.core.propagator import safe_time

END, FIRST, SECOND, EXHAUSTED = 0, 1, 2, 3
"""How a stay in a state ends: with the cycle, with the first or second of its events, or with the budget of steps."""

GAP_DOUBT = 0.1
"""Largest distance of the tip from the cubics of the intervals, as a share of its distance from the nearer stop."""

CONTACT_DOUBT = 1e-3
"""The same of the force, as a share of the largest force so far: its crest is found on a cubic."""

ZOOM = 3
"""Levels from an interval to the eight into which it is cut."""


@part
def choose_level(here, most, left, room):
    """Level up to ``most`` at which intervals are longest, their length, and how far the cubic through the ends of one
    may be from what the regime of g shows: at most ``room``, unless it is level 0.

    Four intervals are to fit in what is left of the cycle, unless it is level 0.
    """
    level, h, most = 0, here.shortest, min(most, here.levels - 1)
    error = size_of(here, BOUND4) * (h * h * h * h / 384.0)
    while level < most and 16.0 * error <= room and 8.0 * h <= left:
        level += 1
        h *= 2.0
        error *= 16.0
    return level, h, error


@part
def passed(here, h, low, high, doubt, most):
    """Number of intervals, up to ``most``, in which the quantity in ``values`` surely stays within (low, high)."""
    own, values, slopes = here.own, here.values, here.slopes
    i = first_doubt(own, values, slopes, h, low, high, doubt, 0)
    if i >= most:
        return most
    curvature = size_of(here, BOUND2)
    while i < most:
        value, slope = own[values + i], own[slopes + i]
        if not min(safe_time(high - value, -slope, curvature), safe_time(value - low, slope, curvature)) > h:
            return i
        i = first_doubt(own, values, slopes, h, low, high, doubt, i + 1)
    return most


@part
def fly(run, here, time, steps, sample, history):
    """Stay in the gap: (how it ends, instant, steps, next sample); FIRST is the upper stop, SECOND the lower.

    ``here`` is the free regime.
    """
    period = run.period
    own, u, shortest, series = here.own, here.u, here.shortest, here.series
    resolution = run.resolution * shortest
    high, low = number(run, UPPER_STOP, POSITION) - here.shown, number(run, LOWER_STOP, POSITION) - here.shown
    x, v = read(here, SHOWN, u), read(here, SHOWN_RATE, u) + here.shown_rate
    most = LEVELS
    while steps > 0:
        steps -= 1
        left = period - time
        level, h, doubt = choose_level(here, most, left, GAP_DOUBT * min(high - x, x - low))
        if h < left:
            look(here, level, 1.0, x, v)
            count = int(min(8.0, left / h))
            i = passed(here, h, low, high, doubt, count)
            if i > 0:
                if sample < history.shape[0]:
                    sample = write_samples(run, FREE, time, i * h, sample, history)
                jump(here, level, i, u, u)
                time += i * h
                x, v = own[here.values + i], own[here.slopes + i]
            if i == count:
                most = LEVELS
                continue
            if level > 0:
                most = max(level - ZOOM, 0)
                continue
        # the shortest interval, or the rest of the cycle
        until = min(shortest, period - time)
        curvature = size_of(here, BOUND2)
        safe_upper, safe_lower = safe_time(high - x, -v, curvature), safe_time(x - low, v, curvature)
        ends, instant = END, until
        if min(safe_upper, safe_lower) < until:
            bound4 = size_of(here, BOUND4)
            expand(here, 1.0)
            constant, inverse = own[series], 1.0 / shortest
            if safe_upper < until:
                own[series] = constant - high
                t = first_fall(own, series, -1.0, inverse, safe_upper, until, curvature, bound4, resolution)
                if t < math.inf:
                    ends, instant = FIRST, t
            if safe_lower < instant:
                own[series] = constant - low
                t = first_fall(own, series, 1.0, inverse, safe_lower, instant, curvature, bound4, resolution)
                if t < math.inf:
                    ends, instant = SECOND, t
        if sample < history.shape[0]:
            sample = write_samples(run, FREE, time, instant, sample, history)
        if ends == END and instant < period - time:
            jump(here, 0, 1, u, u)
            time += instant
            x, v = read(here, SHOWN, u), read(here, SHOWN_RATE, u) + here.shown_rate
            most = LEVELS
            continue
        place(here, instant, u, u)
        return ends, time + instant, steps, sample
    return EXHAUSTED, time, steps, sample


@part
def force_of(here, side, u):
    """Force without its constant, and its rate, of coordinates in contact."""
    return side * read(here, SHOWN, u), side * read(here, SHOWN_RATE, u) + here.shown_rate


@leaf
def crest(run, g, side, level, i, t, bend, least):
    """Largest force near a time t into interval i, where its rate falls by ``bend`` a second; at least ``least``."""
    here = regime_of(run, g)
    spare = here.spare
    if i > 0:
        jump(here, level, i, here.u, spare)
        travel(run, g, t, spare, spare)
    else:
        travel(run, g, t, here.u, spare)
    force, rate = force_of(here, side, spare)
    step = -rate / bend if bend < 0.0 else math.inf
    if abs(step) < 0.02 * here.shortest:
        place(here, step, spare, spare)
        force, rate = force_of(here, side, spare)
    return max(least, force - 0.5 * rate * rate / bend if bend < 0.0 else force)


@part
def largest_force(here, run, g, side, level, h, doubt, intervals, peak):
    """Largest force in the first intervals of ``values``, or ``peak``."""
    own, values, slopes = here.own, here.values, here.slopes
    peak = largest(own, values + 1, intervals, peak)
    i = first_doubt(own, values, slopes, h, -math.inf, peak, doubt, 0)
    while i < intervals:
        f0, d0, f1, d1 = own[values + i], own[slopes + i], own[values + i + 1], own[slopes + i + 1]
        t = cubic_extremum(f0, d0, f1, d1, h, -1.0)
        if t > 0.0 and cubic(f0, d0, f1, d1, h, t)[0] + doubt > peak:
            before, after = max(t - 1e-3 * h, 0.0), min(t + 1e-3 * h, h)
            turn = cubic(f0, d0, f1, d1, h, after)[1] - cubic(f0, d0, f1, d1, h, before)[1]
            peak = crest(run, g, side, level, i, t, turn / (after - before), peak)
        i = first_doubt(own, values, slopes, h, -math.inf, peak, doubt, i + 1)
    return peak


@part
def press(run, here, g, time, steps, sample, peak, history):
    """Stay in contact with stop g: (how it ends, instant, steps, next sample, largest force); FIRST is the release.

    ``here`` is the regime of g.
    """
    period = run.period
    own, u, spare, shortest, series = here.own, here.u, here.spare, here.shortest, here.series
    side = 1.0 if g == UPPER_STOP else -1.0
    resolution = run.resolution * shortest
    peak -= here.shown
    low = -here.shown
    f, d = force_of(here, side, u)
    most = LEVELS
    while steps > 0:
        steps -= 1
        peak = max(peak, f)
        left = period - time
        level, h, doubt = choose_level(here, most, left, CONTACT_DOUBT * (peak - low))
        if h < left:
            look(here, level, side, f, d)
            count = int(min(8.0, left / h))
            i = passed(here, h, low, math.inf, doubt, count)
            if i > 0:
                peak = largest_force(here, run, g, side, level, h, doubt, i, peak)
                if sample < history.shape[0]:
                    sample = write_samples(run, g, time, i * h, sample, history)
                jump(here, level, i, u, u)
                time += i * h
                f, d = own[here.values + i], own[here.slopes + i]
            if i == count:
                most = LEVELS
                continue
            if level > 0:
                most = max(level - ZOOM, 0)
                continue
        until = min(shortest, period - time)
        curvature = size_of(here, BOUND2)
        safe = safe_time(f - low, d, curvature)
        ends, instant = END, until
        if safe < until:
            bound4 = size_of(here, BOUND4)
            expand(here, side)
            own[series] += here.shown
            t = first_fall(own, series, 1.0, 1.0 / shortest, safe, until, curvature, bound4, resolution)
            if t < math.inf:
                ends, instant = FIRST, t
        if sample < history.shape[0]:
            sample = write_samples(run, g, time, instant, sample, history)
        place(here, instant, u, spare)
        f1, d1 = force_of(here, side, spare)
        if d > 0.0 or d1 < 0.0:
            peak = max(peak, f1)
            t = cubic_extremum(f, d, f1, d1, instant, -1.0)
            if t > 0.0:
                peak = crest(run, g, side, np.int64(0), np.int64(0), t, (d1 - d) / instant, peak)
                place(here, instant, u, spare)
        for i in range(here.width):
            own[u + i] = own[spare + i]
        finished = ends == FIRST or instant >= period - time
        time += instant
        f, d = f1, d1
        if finished:
            return ends, time, steps, sample, max(peak, f) + here.shown
        most = LEVELS
    return EXHAUSTED, time, steps, sample, peak + here.shown


@leaf
def hang(run, g, time, steps, sample, history):
    """Stay beyond stop g, which would pull: (how it ends, instant, steps, next sample).

    FIRST is the return into the gap, SECOND a new contact.
    """
    here, period = regime_of(run, FREE), run.period
    own, u, shortest, series, force = here.own, here.u, here.shortest, here.series, here.series + DEGREE + 1
    side, k, damper = 1.0 if g == UPPER_STOP else -1.0, number(run, g, STIFFNESS), number(run, g, DAMPING)
    stop = number(run, g, POSITION) - here.shown
    inverse, resolution = 1.0 / shortest, run.resolution * shortest
    while steps > 0:
        steps -= 1
        left = period - time
        x, v = read(here, SHOWN, u) - stop, read(here, SHOWN_RATE, u) + here.shown_rate
        a = read(here, A, u) + number(run, FREE, A)
        curvature, pull2 = size_of(here, BOUND2), size_of(here, PULL2)
        pull2 = k * curvature + damper * pull2
        e1, d1 = side * x, side * v
        e2, d2 = -side * (k * x + damper * v), -side * (k * v + damper * a)
        safe1, safe2 = safe_time(e1, d1, curvature), safe_time(e2, d2, pull2)
        safe = min(safe1, safe2)
        if safe >= min(shortest, left):
            level, h = 0, shortest
            while level + 1 < here.levels and 2.0 * h <= min(safe, left):
                level += 1
                h *= 2.0
            span = min(h, left)
            if sample < history.shape[0]:
                sample = write_samples(run, FREE, time, span, sample, history)
            if span < left:
                jump(here, level, 1, u, u)
                time += span
                continue
            travel(run, FREE, span, u, u)
            return END, time + span, steps, sample
        ends, instant = END, min(shortest, left)
        expand(here, 1.0)
        own[series] -= stop
        bound4 = size_of(here, BOUND4)
        if safe1 < instant:
            t = first_fall(own, series, side, inverse, safe1, instant, curvature, bound4, resolution)
            if t < math.inf:
                ends, instant = FIRST, t
        if safe2 < instant:
            for i in range(DEGREE):
                own[force + i] = k * own[series + i] + damper * inverse * (i + 1) * own[series + i + 1]
            own[force + DEGREE] = k * own[series + DEGREE]
            pull4 = k * bound4 + damper * size_of(here, PULL4)
            t = first_fall(own, force, -side, inverse, safe2, instant, pull2, pull4, resolution)
            if t < math.inf:
                ends, instant = SECOND, t
        if sample < history.shape[0]:
            sample = write_samples(run, FREE, time, instant, sample, history)
        finished = ends != END or instant >= left
        place(here, instant, u, u)
        time += instant
        if finished:
            return ends, time, steps, sample
    return EXHAUSTED, time, steps, sample


@leaf
def write_samples(run, g, time, span, sample, history):
    """Write displacement, velocity and contact force (upward force of the tip positive) at the instants in ``span``.

    ``history`` (samples, 3) is that of the cycle, ``sample`` the next one; returns the next one after ``span``. g is
    FREE where no stop presses.
    """
    here, samples = regime_of(run, g), history.shape[0]
    spare = here.spare
    while sample < samples and sample * run.period < (time + span) * samples:
        travel(run, g, sample * run.period / samples - time, here.u, spare)
        history[sample, 0] = read(here, X, spare) + number(run, g, X)
        history[sample, 1] = read(here, V, spare) + number(run, g, V)
        history[sample, 2] = 0.0
        if g != FREE:
            side = 1.0 if g == UPPER_STOP else -1.0
            history[sample, 2] = side * max(0.0, side * read(here, SHOWN, spare) + here.shown)
        sample += 1
    return sample
