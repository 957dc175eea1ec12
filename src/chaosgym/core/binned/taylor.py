r"""Motion of a mechanism without a table of propagators, by its Taylor series.

The equations of ``cycle`` between contacts, and joints for which there is no table: a ball in a spherical shell, whose
force turns with the ball; Hertzian contact; contacts too many for a table of all sets (forces (1) and (2) of
``taylor_view``). Until a contact changes, p is its Taylor series. Contacts and forces are read from it piece by piece,
and the instant of a change is found on it. Matrices are held over each bin of the angle, the forcing is continuous.
"""

import math

import numpy as np

from chaosgym.core import status
from chaosgym.core.binned.cycle import RUNAWAY, STEP_BUDGET
from chaosgym.core.binned.record import (
    begin_cycle,
    channel_crest,
    crest_instant,
    note_peak,
    note_share,
    write_peaks,
    write_sample,
)
from chaosgym.core.binned.taylor_deviations import (
    expand_deviations,
    jump_at_touch,
    move_deviations,
    new_deviations,
    put_deviations,
    take_deviations,
)
from chaosgym.core.binned.taylor_series import ORDER, begin, expand, new_series, span
from chaosgym.core.binned.taylor_view import (
    CHANGE,
    DEPTH,
    FORCE,
    MARGIN,
    RATE,
    look_at,
    look_first,
    lowest_margin,
    new_view,
    read,
    read_state,
)
from chaosgym.core.cycle import LOWER, UPPER
from chaosgym.core.events import cubic, cubic_extremum, let_pass, note_touch
from chaosgym.core.kernel import leaf, njit, part
from chaosgym.core.lanes import padded
from chaosgym.core.tangent import orthonormalise

POLISH = 50
"""Instants tried to locate one event; the secant method needs three to six."""

CLOSER = 1e-3
"""Share of the tolerance within which an event is placed: a series is read fast, and chaos magnifies what is left."""

ROUNDING = 1e-15
"""Least share of a time within which an event in it can be placed."""

SHORTEST = 1e-9
"""Shortest span, as a share of a piece: a motion that runs away must come to its end."""

LEAST_SHARE = 0.1
"""Share of a contact force that a bound must leave: its series is cut off."""


@leaf
def first_change(model, series, low, until, closed, view, f_low, tolerance):
    """Instant in (low, until] just after which a joint changes its contact state, or ``until``, and the resultant.

    Regula falsi on the series, an end halved when it was kept twice (Illinois). Leaves ``view`` at that instant.
    """
    tolerance = max(CLOSER * tolerance, ROUNDING * until)
    f_low = max(f_low, 0.0)
    high, f_high = until, 0.0
    t, kept = until, 0
    for _ in range(POLISH):
        force = look_at(model, series, t, closed, view)
        f = lowest_margin(view)
        if f > 0.0:
            if t == until:
                break
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
    return t, force


@part
def grazes(h, closed, before, after):
    """Instant in (0, h) at which an open joint may touch and leave again, or h."""
    instant = h
    for j in range(closed.shape[0]):
        if not closed[j]:
            depth0, rate0 = before.joint[j, DEPTH], before.joint[j, RATE]
            depth1, rate1 = after.joint[j, DEPTH], after.joint[j, RATE]
            if depth1 < 0.0 and rate0 > 0.0 and rate1 < 0.0:
                top = cubic_extremum(depth0, rate0, depth1, rate1, h, -1.0)
                if top > 0.0 and cubic(depth0, rate0, depth1, rate1, h, top)[0] > 0.0:
                    instant = min(instant, top)
    return instant


@part
def stays_open(model, j, series, h):
    """Whether a bound of its series proves that an open joint does not touch in (0, h)."""
    lanes, begin, end, rest = series.lanes, 0.0, 0.0, 0.0
    for r in range(model.first[j], model.first[j + 1]):
        ahead = lanes[0, r] + h * (lanes[1, r] + h * lanes[2, r])
        begin += lanes[0, r] * lanes[0, r]
        end += ahead * ahead
        # a parabola leaves its chord by a quarter of its last term
        rest += 0.25 * h * h * abs(lanes[2, r])
        power = h * h
        for k in range(3, ORDER + 1):
            power *= h
            rest += power * abs(lanes[k, r])
    return math.sqrt(max(begin, end)) + rest < model.gap[j]


@part
def half(model, j, series, h):
    """Column of the peaks to which a bound proves the force of joint j to belong all through (0, h), or -1, and what a
    newton of it reads at most."""
    left, power, up, size = 0.0, 1.0, 0.0, 0.0
    for k in range(ORDER + 1):
        along = 0.0
        for r in range(model.first[j], model.first[j + 1]):
            along += model.reading[r, 1] * series.lanes[k, r]
        up, left = (along, abs(along)) if k == 0 else (up, left - power * abs(along))
        power *= h
    for r in range(model.first[j], model.first[j + 1]):
        for axis in range(3):
            size += model.reading[r, axis] ** 2
    return (-1 if left < 0.0 else UPPER if up > 0.0 else LOWER), math.sqrt(size)


@part
def still(model, series, h, closed, peak):
    """Whether bounds of a series prove that no contact changes and no peak (2, 5) is raised in (0, h).

    The peak of a force that only rises or only falls there lies at an end, where it is read. More than one force on the
    record, or one that turns from one half of it into the other, is not still.
    """
    pushing = 0
    for j in range(closed.shape[0]):
        if not closed[j]:
            if not stays_open(model, j, series, h):
                return False
            continue
        force = series.force[j]
        end, rest = force[0] + h * (force[1] + h * force[2]), 0.25 * h * h * abs(force[2])
        bend, power = 2.0 * h * abs(force[2]), h
        for k in range(3, ORDER - 1):
            power *= h
            rest += h * power * abs(force[k])
            bend += k * power * abs(force[k])
        if min(force[0], end) - rest <= LEAST_SHARE * force[0]:
            return False
        if model.monitored[j]:
            pushing += 1
            column, size = half(model, j, series, h)
            largest = size * (max(force[0], end) + rest)
            if pushing > 1 or column < 0 or (abs(force[1]) < bend and largest > peak[column, 0]):
                return False
    return True


@leaf
def note_touch_of(model, j, direction, bouncing, time, impacts, bounce_time):
    """Record a touch of joint j at ``time`` in the revolution if it is monitored."""
    if model.monitored[j]:
        up = 0.0
        for r in range(model.first[j], model.first[j + 1]):
            up += model.reading[r, 1] * direction[r]
        impacts[UPPER if up > 0.0 else LOWER] += 1
        note_touch(bouncing, 1, 0, 1.0 if up > 0.0 else -1.0, time, bounce_time)


@leaf
def change_contacts(model, closed, view, bouncing, time, impacts, bounce_time):
    """Open and close the joints whose margin is used up at ``time`` in the revolution; how many."""
    changes = 0
    for j in range(closed.shape[0]):
        if view.joint[j, MARGIN] > 0.0:
            continue
        changes += 1
        closed[j] = not closed[j]
        if closed[j]:
            note_touch_of(model, j, view.direction, bouncing, time, impacts, bounce_time)
    return changes


@part
def note_joints(model, h, closed, before, after, channel_peak):
    """Raise the peaks (J, 2) of the closed joints over a piece of length h."""
    for j in range(channel_peak.shape[0]):
        if closed[j]:
            f0, r0 = before.joint[j, FORCE], before.joint[j, CHANGE]
            f1, r1 = after.joint[j, FORCE], after.joint[j, CHANGE]
            positive = not model.two_sided[j] or after.direction[model.first[j]] > 0.0
            column = UPPER if positive else LOWER
            channel_peak[j, column] = max(channel_peak[j, column], channel_crest(h, f0, r0, f1, r1)[1])


@leaf
def judge(model, series, closed, view):
    """Write which joints push at the beginning of a series."""
    for j in range(closed.shape[0]):
        closed[j] = False
    look_first(model, series, closed, view)
    for j in range(closed.shape[0]):
        closed[j] = view.joint[j, MARGIN] < 0.0


@leaf
def take_sample(model, series, time, closed, view, z, sample):
    """Write displacement, velocity and signed resultant (positive where it points up) at a time in a span."""
    force = look_at(model, series, time, closed, view)
    read_state(model, view, z)
    write_sample(model.display, z, force, sample)


@leaf
def turn(model, closed, series, views, whole, z, peak, bouncing, arrays, cycle, tolerance, budget, deviations):
    """Advance a revolution from the beginning of a series; its events, or a negative status.

    ``views`` are three of the readings; ``whole`` is one of all lanes, left at the end. z (2n,) is work space.
    ``deviations`` travel along from the first two terms of their series.
    """
    before, after, between = views
    bins, duration = model.acceleration.shape[0], model.bin_duration
    step = duration / model.steps
    history, period = arrays.history[cycle], bins * duration
    samples, sensors = history.shape[0], arrays.channel_peak.shape[1]
    impacts, channel_peak = arrays.impacts[cycle], arrays.channel_peak[cycle]
    contact_time, bounce_time = arrays.contact_time[cycle], arrays.bounce_time[cycle]
    events, sample, spans = 0, 0, 0
    for b in range(bins):
        origin, time = b * duration, 0.0
        while duration - time > 1e-12 * duration:
            spans += 1
            if spans > STEP_BUDGET:
                return -status.STEP_BUDGET
            expand(model, b, time, closed, ORDER, series)
            length = max(span(series, model.tolerance, model.longest), SHORTEST * step)
            length = min(length, duration - time)
            pieces = math.ceil(length / step)
            quiet = pieces > 2 and sensors == 0 and still(model, series, length, closed, peak)
            start = look_first(model, series, closed, before)
            note_peak(peak, origin + time, start)
            piece, now, reached, found = pieces - 1 if quiet else 0, 0.0, 0.0, False
            while piece < pieces and not found:
                piece += 1
                now, reached = reached, length * piece / pieces
                end = look_at(model, series, reached, closed, after)
                until = reached if quiet else now + grazes(reached - now, closed, before, after)
                if until < reached or lowest_margin(after) <= 0.0:
                    found = True
                    low = lowest_margin(before)
                    reached, end = first_change(model, series, now, until, closed, after, low, tolerance)
                h = reached - now
                while sample < samples and sample * period < (origin + time + reached) * samples:
                    t = max(sample * period / samples - origin - time, 0.0)
                    take_sample(model, series, t, closed, whole, z, history[sample])
                    sample += 1
                note_share(start, end, h, contact_time)
                note_peak(peak, origin + time + reached, end)
                crest, size = crest_instant(h, start, end)
                if size > peak[UPPER if end[0] > 0.0 else LOWER, 0]:
                    there = look_at(model, series, now + crest, closed, between)
                    note_peak(peak, origin + time + now + crest, there)
                note_joints(model, h, closed, before, after, channel_peak)
                before, after = after, before
                start = end
            time += reached
            if deviations.width > 0:
                expand_deviations(model, b, closed, series, deviations)
                move_deviations(model, reached, deviations)
            read(series, reached, whole)
            for i in range(series.lanes.shape[1]):
                series.lanes[0, i], series.lanes[1, i] = whole.lanes[0, i], whole.lanes[1, i]
            if found:
                events += change_contacts(model, closed, before, bouncing, origin + time, impacts, bounce_time)
                for j in range(closed.shape[0]):
                    if deviations.width > 0 and closed[j] and before.joint[j, MARGIN] <= 0.0:
                        jump_at_touch(model, b, j, before, deviations)
                if events > budget:
                    return -status.EVENT_BUDGET
    return events


@njit(cache=True, nogil=True)
def advance(model, state, bouncing, arrays, event_tolerance, event_budget, tangents):
    """Advance ``state`` (2n,) and ``bouncing`` in place by whole revolutions; see ``cycle.advance``."""
    bins, _, lanes = model.acceleration.shape
    if model.steps * bins > STEP_BUDGET:
        return status.STEP_BUDGET, 0
    period = bins * model.bin_duration
    readings = padded(model.row.shape[0])
    series, whole = new_series(model), new_view(model, lanes)
    views = (new_view(model, readings), new_view(model, readings), new_view(model, readings))
    z, closed, peak = np.empty(state.shape[0]), np.zeros(model.gap.shape[0], dtype=np.bool_), np.zeros((2, 5))
    deviations, metric = new_deviations(model, tangents.vectors.shape[0]), np.full(len(z) // 2, model.contact_rate**2)
    for cycle in range(arrays.section.shape[0]):
        begin_cycle(model, state, arrays, cycle)
        peak[:] = 0.0
        begin(model, state, series)
        put_deviations(model, tangents.vectors, deviations)
        judge(model, series, closed, views[0])
        events = turn(
            model,
            closed,
            series,
            views,
            whole,
            z,
            peak,
            bouncing,
            arrays,
            cycle,
            event_tolerance,
            event_budget,
            deviations,
        )
        if events < 0:
            return -events, cycle
        write_peaks(peak, arrays, cycle)
        arrays.events[cycle] = events
        read_state(model, whole, state)
        for i in range(state.shape[0]):
            if not abs(state[i]) < RUNAWAY:
                return status.DIVERGED, cycle
        take_deviations(model, deviations, tangents.vectors)
        if tangents.log_growth.shape[1] > 0:
            tangents.log_growth[cycle] = 0.0
            orthonormalise(metric, tangents, cycle)
        let_pass(bouncing, 1, period)
    return status.OK, arrays.section.shape[0]
