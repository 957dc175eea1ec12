r"""Exact motion of a few modes whose tip rattles between two stops, eight instants at a time.

Between contact events the machine is linear (``modal_model``), and the tip is in one of three states, each with its
own quantities e(t) > 0 that end it:

    GAP        between the stops, no force         e = upper - x     and   e = x - lower
    CONTACT    a stop pushes with N > 0            e = N
    DETACHED   beyond a stop that would pull       e = penetration   and   e = -N

GAP and DETACHED share the free regime. In CONTACT the stop's spring and damper act at the tip. Motion is propagated
exactly within a regime, so the only error is in the instant at which e vanishes, and that is polished to
``event_tolerance``.

Constant tables (``event_tables``) give what e needs at eight instants ahead. An interval between two of them is passed
only if the cubic through its ends and the bound of the rest, or a bound of e'', prove that e keeps its sign. One that
remains is cut into eight, and again, until it is as short as the fastest mode requires; there e is a polynomial of
degree 15, whose first zero ``first_fall`` finds. A change of state is one product of a matrix and the coordinates.
"""

import math

from numba import njit

from chaosgym.core import status
from chaosgym.core.contact import pressing_force
from chaosgym.core.cubic import cubic, cubic_extremum
from chaosgym.core.cycle import LOWER, UPPER, note_touch
from chaosgym.core.event_tables import BOUND2, BOUND4, LEVELS, PULL2, PULL4, SHOWN, SHOWN_RATE, A, V, X
from chaosgym.core.first_fall import DEGREE, first_fall
from chaosgym.core.kernel import inlined, leaf
from chaosgym.core.lanes import first_doubt, largest
from chaosgym.core.modal_model import FREE, LOWER_STOP, UPPER_STOP
from chaosgym.core.modal_run import (
    DAMPING,
    FORCE,
    POSITION,
    SERIES,
    SLOPES,
    STIFFNESS,
    VALUES,
    change,
    enter,
    expand,
    jump,
    leave,
    look,
    make_run,
    place,
    read,
    size_of,
    travel,
)
from chaosgym.core.propagator import safe_time
from chaosgym.core.tangent import carry, orthonormalise, touch

GAP, CONTACT, DETACHED = 0, 1, 2
END, FIRST, SECOND, EXHAUSTED = 0, 1, 2, 3
"""How a stay in a state ends: with the cycle, with the first or second of its events, or with the budget of steps."""

STEPS_PER_EVENT = 1000
"""Looks ahead that one cycle may take for each event that it may have."""

GAP_DOUBT = 0.1
"""Largest distance of the tip from the cubics of the intervals, as a share of its distance from the nearer stop."""

CONTACT_DOUBT = 1e-3
"""The same of the force, as a share of the largest force so far: its crest is found on a cubic."""

ZOOM = 3
"""Levels from an interval to the eight into which it is cut."""


@njit(cache=True, inline="always")
def tip_of_state(model, state):
    """Tip displacement and velocity of a modal state (2n,)."""
    n = model.tip_shape.shape[0]
    x, v = 0.0, 0.0
    for i in range(n):
        x += model.tip_shape[i] * state[i]
        v += model.tip_shape[i] * state[n + i]
    return x, v


@njit(cache=True, inline="always")
def tip_state_of(model, x, v):
    """Which of the three states holds, and the stop it concerns, for tip displacement x and velocity v."""
    if model.stops[1] <= x <= model.stops[0]:
        return GAP, UPPER_STOP
    stop = UPPER_STOP if x > model.stops[0] else LOWER_STOP
    side = 1.0 if stop == UPPER_STOP else -1.0
    k, d = model.contact_stiffness[stop - 1], model.contact_damping[stop - 1]
    force = pressing_force(side * (x - model.stops[stop - 1]), side * v, k, d)
    return (CONTACT, stop) if force > 0.0 else (DETACHED, stop)


@inlined
def choose_level(run, g, most, left, room):
    """Level up to ``most`` at which intervals are longest, their length, and how far the cubic through the ends of one
    may be from what the regime of g shows: at most ``room``, unless it is level 0.

    Four intervals are to fit in what is left of the cycle, unless it is level 0.
    """
    r = run.pressed[g]
    level, h, most = 0, run.shortest[r], min(most, run.levels[r] - 1)
    error = size_of(run, g, BOUND4) * (h * h * h * h / 384.0)
    while level < most and 16.0 * error <= room and 8.0 * h <= left:
        level += 1
        h *= 2.0
        error *= 16.0
    return level, h, error


@inlined
def passed(run, g, h, low, high, doubt, most):
    """Number of intervals, up to ``most``, in which the quantity in ``values`` surely stays within (low, high)."""
    values, slopes = run.space[VALUES], run.space[SLOPES]
    i = first_doubt(values, slopes, h, low, high, doubt, 0)
    if i >= most:
        return most
    curvature = size_of(run, g, BOUND2)
    while i < most:
        value, slope = values[7 + i], slopes[7 + i]
        if not min(safe_time(high - value, -slope, curvature), safe_time(value - low, slope, curvature)) > h:
            return i
        i = first_doubt(values, slopes, h, low, high, doubt, i + 1)
    return most


@inlined
def fly(run, time, steps, sample, history):
    """Stay in the gap: (how it ends, instant, steps, next sample); FIRST is the upper stop, SECOND the lower."""
    u, period, shift = run.u, run.period, run.numbers
    shortest = run.shortest[FREE]
    resolution = run.resolution * shortest
    high, low = shift[UPPER_STOP, POSITION] - shift[FREE, SHOWN], shift[LOWER_STOP, POSITION] - shift[FREE, SHOWN]
    x, v = read(run, FREE, SHOWN, u), read(run, FREE, SHOWN_RATE, u) + shift[FREE, SHOWN_RATE]
    most = LEVELS
    while steps > 0:
        steps -= 1
        left = period - time
        level, h, doubt = choose_level(run, FREE, most, left, GAP_DOUBT * min(high - x, x - low))
        if h < left:
            look(run, FREE, level, 1.0, x, v)
            count = int(min(8.0, left / h))
            i = passed(run, FREE, h, low, high, doubt, count)
            if i > 0:
                if sample < history.shape[0]:
                    sample = write_samples(run, FREE, time, i * h, sample, history)
                jump(run, FREE, level, i, u, u)
                time += i * h
                x, v = run.space[VALUES][7 + i], run.space[SLOPES][7 + i]
            if i == count:
                most = LEVELS
                continue
            if level > 0:
                most = max(level - ZOOM, 0)
                continue
        # the shortest interval, or the rest of the cycle
        until = min(shortest, period - time)
        curvature = size_of(run, FREE, BOUND2)
        safe_upper, safe_lower = safe_time(high - x, -v, curvature), safe_time(x - low, v, curvature)
        ends, instant = END, until
        if min(safe_upper, safe_lower) < until:
            bound4 = size_of(run, FREE, BOUND4)
            expand(run, FREE, 1.0)
            coefficients = run.space[SERIES]
            constant, inverse = coefficients[0], 1.0 / shortest
            if safe_upper < until:
                coefficients[0] = constant - high
                t = first_fall(coefficients, -1.0, inverse, safe_upper, until, curvature, bound4, resolution)
                if t < math.inf:
                    ends, instant = FIRST, t
            if safe_lower < instant:
                coefficients[0] = constant - low
                t = first_fall(coefficients, 1.0, inverse, safe_lower, instant, curvature, bound4, resolution)
                if t < math.inf:
                    ends, instant = SECOND, t
        if sample < history.shape[0]:
            sample = write_samples(run, FREE, time, instant, sample, history)
        if ends == END and instant < period - time:
            jump(run, FREE, 0, 1, u, u)
            time += instant
            x, v = read(run, FREE, SHOWN, u), read(run, FREE, SHOWN_RATE, u) + shift[FREE, SHOWN_RATE]
            most = LEVELS
            continue
        place(run, FREE, instant, u, u)
        return ends, time + instant, steps, sample
    return EXHAUSTED, time, steps, sample


@leaf
def crest(run, g, side, level, i, t, bend, least):
    """Largest force near a time t into interval i, where its rate falls by ``bend`` a second; at least ``least``."""
    spare = run.spare
    rate_shift = run.numbers[g, SHOWN_RATE]
    if i > 0:
        jump(run, g, level, i, run.u, spare)
        travel(run, g, t, spare, spare)
    else:
        travel(run, g, t, run.u, spare)
    force, rate = side * read(run, g, SHOWN, spare), side * read(run, g, SHOWN_RATE, spare) + rate_shift
    step = -rate / bend if bend < 0.0 else math.inf
    if abs(step) < 0.02 * run.shortest[run.pressed[g]]:
        place(run, g, step, spare, spare)
        force, rate = side * read(run, g, SHOWN, spare), side * read(run, g, SHOWN_RATE, spare) + rate_shift
    return max(least, force - 0.5 * rate * rate / bend if bend < 0.0 else force)


@inlined
def largest_force(run, g, side, level, h, doubt, intervals, peak):
    """Largest force in the first intervals of ``values``, or ``peak``."""
    values, slopes = run.space[VALUES], run.space[SLOPES]
    peak = largest(values, intervals, peak)
    i = first_doubt(values, slopes, h, -math.inf, peak, doubt, 0)
    while i < intervals:
        f0, d0, f1, d1 = values[7 + i], slopes[7 + i], values[8 + i], slopes[8 + i]
        t = cubic_extremum(f0, d0, f1, d1, h, -1.0)
        if t > 0.0 and cubic(f0, d0, f1, d1, h, t)[0] + doubt > peak:
            before, after = max(t - 1e-3 * h, 0.0), min(t + 1e-3 * h, h)
            turn = cubic(f0, d0, f1, d1, h, after)[1] - cubic(f0, d0, f1, d1, h, before)[1]
            peak = crest(run, g, side, level, i, t, turn / (after - before), peak)
        i = first_doubt(values, slopes, h, -math.inf, peak, doubt, i + 1)
    return peak


@inlined
def press(run, g, time, steps, sample, peak, history):
    """Stay in contact with stop g: (how it ends, instant, steps, next sample, largest force); FIRST is the release."""
    u, period = run.u, run.period
    side = 1.0 if g == UPPER_STOP else -1.0
    constant, constant_rate = run.numbers[g, SHOWN], run.numbers[g, SHOWN_RATE]
    shortest = run.shortest[run.pressed[g]]
    resolution = run.resolution * shortest
    peak -= constant
    low = -constant
    f, d = side * read(run, g, SHOWN, u), side * read(run, g, SHOWN_RATE, u) + constant_rate
    most = LEVELS
    while steps > 0:
        steps -= 1
        peak = max(peak, f)
        left = period - time
        level, h, doubt = choose_level(run, g, most, left, CONTACT_DOUBT * (peak - low))
        if h < left:
            look(run, g, level, side, f, d)
            count = int(min(8.0, left / h))
            i = passed(run, g, h, low, math.inf, doubt, count)
            if i > 0:
                peak = largest_force(run, g, side, level, h, doubt, i, peak)
                if sample < history.shape[0]:
                    sample = write_samples(run, g, time, i * h, sample, history)
                jump(run, g, level, i, u, u)
                time += i * h
                f, d = run.space[VALUES][7 + i], run.space[SLOPES][7 + i]
            if i == count:
                most = LEVELS
                continue
            if level > 0:
                most = max(level - ZOOM, 0)
                continue
        until = min(shortest, period - time)
        curvature = size_of(run, g, BOUND2)
        safe = safe_time(f - low, d, curvature)
        ends, instant = END, until
        if safe < until:
            bound4 = size_of(run, g, BOUND4)
            expand(run, g, side)
            coefficients = run.space[SERIES]
            coefficients[0] += constant
            t = first_fall(coefficients, 1.0, 1.0 / shortest, safe, until, curvature, bound4, resolution)
            if t < math.inf:
                ends, instant = FIRST, t
        if sample < history.shape[0]:
            sample = write_samples(run, g, time, instant, sample, history)
        place(run, g, instant, u, run.spare)
        f1, d1 = read_spare(run, g, side, constant_rate)
        if d > 0.0 or d1 < 0.0:
            peak = max(peak, f1)
            t = cubic_extremum(f, d, f1, d1, instant, -1.0)
            if t > 0.0:
                peak = crest(run, g, side, 0, 0, t, (d1 - d) / instant, peak)
                place(run, g, instant, u, run.spare)
        for i in range(u.shape[0]):
            u[i] = run.spare[i]
        finished = ends == FIRST or instant >= period - time
        time += instant
        f, d = f1, d1
        if finished:
            return ends, time, steps, sample, max(peak, f) + constant
        most = LEVELS
    return EXHAUSTED, time, steps, sample, peak + constant


@inlined
def read_spare(run, g, side, constant_rate):
    """Force without its constant, and its rate, of the spare coordinates."""
    spare = run.spare
    return side * read(run, g, SHOWN, spare), side * read(run, g, SHOWN_RATE, spare) + constant_rate


@inlined
def hang(run, g, time, steps, sample, history):
    """Stay beyond stop g, which would pull: (how it ends, instant, steps, next sample).

    FIRST is the return into the gap, SECOND a new contact.
    """
    u, period, shift = run.u, run.period, run.numbers
    side, k, damper = 1.0 if g == UPPER_STOP else -1.0, shift[g, STIFFNESS], shift[g, DAMPING]
    stop = shift[g, POSITION] - shift[FREE, SHOWN]
    shortest = run.shortest[FREE]
    inverse, resolution = 1.0 / shortest, run.resolution * shortest
    while steps > 0:
        steps -= 1
        left = period - time
        x, v = read(run, FREE, SHOWN, u) - stop, read(run, FREE, SHOWN_RATE, u) + shift[FREE, SHOWN_RATE]
        a = read(run, FREE, A, u) + shift[FREE, A]
        curvature, pull2 = size_of(run, FREE, BOUND2), size_of(run, FREE, PULL2)
        pull2 = k * curvature + damper * pull2
        e1, d1 = side * x, side * v
        e2, d2 = -side * (k * x + damper * v), -side * (k * v + damper * a)
        safe1, safe2 = safe_time(e1, d1, curvature), safe_time(e2, d2, pull2)
        safe = min(safe1, safe2)
        if safe >= min(shortest, left):
            level, h = 0, shortest
            while level + 1 < run.levels[FREE] and 2.0 * h <= min(safe, left):
                level += 1
                h *= 2.0
            span = min(h, left)
            if sample < history.shape[0]:
                sample = write_samples(run, FREE, time, span, sample, history)
            if span < left:
                jump(run, FREE, level, 1, u, u)
                time += span
                continue
            travel(run, FREE, span, u, u)
            return END, time + span, steps, sample
        ends, instant = END, min(shortest, left)
        expand(run, FREE, 1.0)
        coefficients, force = run.space[SERIES], run.space[FORCE]
        coefficients[0] -= stop
        bound4 = size_of(run, FREE, BOUND4)
        if safe1 < instant:
            t = first_fall(coefficients, side, inverse, safe1, instant, curvature, bound4, resolution)
            if t < math.inf:
                ends, instant = FIRST, t
        if safe2 < instant:
            for i in range(DEGREE):
                force[i] = k * coefficients[i] + damper * inverse * (i + 1) * coefficients[i + 1]
            force[DEGREE] = k * coefficients[DEGREE]
            pull4 = k * bound4 + damper * size_of(run, FREE, PULL4)
            t = first_fall(force, -side, inverse, safe2, instant, pull2, pull4, resolution)
            if t < math.inf:
                ends, instant = SECOND, t
        if sample < history.shape[0]:
            sample = write_samples(run, FREE, time, instant, sample, history)
        finished = ends != END or instant >= left
        place(run, FREE, instant, u, u)
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
    samples, number = history.shape[0], run.numbers[g]
    while sample < samples and sample * run.period < (time + span) * samples:
        travel(run, g, sample * run.period / samples - time, run.u, run.spare)
        history[sample, 0] = read(run, g, X, run.spare) + number[X]
        history[sample, 1] = read(run, g, V, run.spare) + number[V]
        history[sample, 2] = 0.0
        if g != FREE:
            side = 1.0 if g == UPPER_STOP else -1.0
            history[sample, 2] = side * max(0.0, side * read(run, g, SHOWN, run.spare) + number[SHOWN])
        sample += 1
    return sample


@leaf
def run_cycles(run, steady, model, state, episode, arrays, event_budget, weights, tangents):
    """Advance by whole cycles; see ``advance``. ``weights`` (n,) are as in ``orthonormalise``."""
    for cycle in range(arrays.section.shape[0]):
        x, v = tip_of_state(model, state)
        for i in range(state.shape[0]):
            arrays.section[cycle, i] = state[i]
        arrays.tip[cycle, 0], arrays.tip[cycle, 1] = x, v
        for column in range(2):
            arrays.peak_force[cycle, column] = 0.0
            arrays.impacts[cycle, column] = 0
            arrays.contact_time[cycle, column] = 0.0
            arrays.bounce_time[cycle, column] = 0.0
        if tangents is not None:
            for m in range(tangents.log_growth.shape[1]):
                tangents.log_growth[cycle, m] = 0.0
        tip_state, g = tip_state_of(model, x, v)
        enter(run, steady, model.regimes.to_modal, g if tip_state == CONTACT else FREE, state)
        if not math.isfinite(size_of(run, FREE, BOUND2)):
            return status.DIVERGED, cycle
        events, sample, steps = 0, 0, STEPS_PER_EVENT * event_budget
        time, carried = 0.0, 0.0
        while True:
            r = model.pressed[g] if tip_state == CONTACT else FREE
            column = UPPER if g == UPPER_STOP else LOWER
            begun = time
            if tip_state == GAP:
                ends, time, steps, sample = fly(run, time, steps, sample, arrays.history[cycle])
            elif tip_state == CONTACT:
                ends, time, steps, sample, arrays.peak_force[cycle, column] = press(
                    run, g, time, steps, sample, arrays.peak_force[cycle, column], arrays.history[cycle]
                )
                arrays.contact_time[cycle, column] += time - begun
            else:
                ends, time, steps, sample = hang(run, g, time, steps, sample, arrays.history[cycle])
            if ends == EXHAUSTED:
                return status.STEP_BUDGET, cycle
            if ends == END:
                break
            events += 1
            if events > event_budget:
                return status.EVENT_BUDGET, cycle
            if tangents is not None and not (tip_state == DETACHED and ends == FIRST):
                carry(weights, model.regimes, r, time - carried, tangents, cycle, run.spare)
                carried = time
                if tip_state == GAP:
                    touch(model.tip_shape, model.contact_damping[ends - 1], tangents.vectors)
            if tip_state == CONTACT:
                change(run, g, 1)
                tip_state = DETACHED
            elif tip_state == DETACHED and ends == FIRST:
                tip_state = GAP
            else:
                if tip_state == GAP:
                    g = UPPER_STOP if ends == FIRST else LOWER_STOP
                change(run, g, 0)
                tip_state = CONTACT
                arrays.impacts[cycle, UPPER if g == UPPER_STOP else LOWER] += 1
                note_touch(episode, 1.0 if g == UPPER_STOP else -1.0, time, arrays.bounce_time[cycle])
        arrays.events[cycle] = events
        leave(run, steady, model.regimes.from_modal, g if tip_state == CONTACT else FREE, state)
        if tangents is not None:
            carry(weights, model.regimes, r, time - carried, tangents, cycle, run.spare)
            orthonormalise(weights, tangents, cycle)
        for i in range(state.shape[0]):
            if not math.isfinite(state[i]):
                return status.DIVERGED, cycle
        episode.touch[0] -= run.period
        episode.touch[1] -= run.period
    return status.OK, arrays.section.shape[0]


@njit(cache=True, nogil=True)
def advance(model, state, episode, arrays, step_phase, event_tolerance, event_budget, tangents=None):
    """Advance ``state`` (2n,) and ``episode`` in place by whole cycles, one for each row of ``arrays``.

    Every cycle starts at phase zero of the drive. ``step_phase`` is the angle [rad] by which the fastest mode turns in
    the shortest interval, ``event_tolerance`` the error of an event's instant as such an angle. ``tangents`` travel
    with the motion; None compiles to a kernel without them.

    Returns
    -------
    (status, cycle) : the cycle is the first one not finished.
    """
    run, steady = make_run(model, step_phase, event_tolerance)
    weights = model.stiffness.copy()
    for i in range(weights.shape[0]):
        if weights[i] == 0.0:
            weights[i] = run.omega * run.omega
    return run_cycles(run, steady, model, state, episode, arrays, event_budget, weights, tangents)
