r"""Motion of a mechanism without a table of propagators, by its Taylor series.

The equations of ``cycle`` between contacts, and joints for which there is no table: a ball in a spherical shell, whose
force turns with the ball; Hertzian contact; contacts too many for a table of all sets. Joint j reads
e = (row_1 . p, row_2 . p, ...) and pushes along e / |e| with a force N of penetration x = |e| - c:

    (1)  linear                     N = k x + d x'
    (2)  Hertz with dissipation     N = K x^(3/2) (1 + chi x')          (Hunt and Crossley, 1975)

as long as x and N are positive. Until a contact changes, p is its Taylor series: each coefficient follows from those
before it, the force's by the recurrences of products, quotients and powers (Jorba and Zou, 2005). A series serves for
a span, whose length its last coefficients tell. Contacts and forces are read from it piece by piece, and the instant
of a change is found on it. Matrices are held over each bin of the angle, the forcing is continuous.

References
----------
A. Jorba, M. Zou, A software package for the numerical integration of ODEs by means of high-order Taylor methods,
Experimental Mathematics 14 (2005) 99-117.
"""

import math
from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable

from chaosgym.core import status
from chaosgym.core.binned.cycle import RUNAWAY, STEP_BUDGET
from chaosgym.core.binned.model import FORCING_TERMS, LINEAR
from chaosgym.core.binned.record import (
    begin_cycle,
    channel_crest,
    crest_instant,
    note_peak,
    note_share,
    resultant,
    write_peaks,
    write_sample,
)
from chaosgym.core.binned.series import SHARES, shift_forcing
from chaosgym.core.contact import let_pass, note_touch
from chaosgym.core.cubic import cubic, cubic_extremum
from chaosgym.core.cycle import LOWER, UPPER
from chaosgym.core.kernel import leaf, njit, part
from chaosgym.core.lanes import LANES, add_columns, next_term, padded, sum_series

ORDER = 16
"""Last power of time in a series: fewer cost more spans, more cost more than they save."""

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

LEAST_DEPTH = 1e-12
"""Least penetration [m] of the series of a Hertzian force, which has none at the surface; a force of some nN."""

DEPTH, RATE, MARGIN, FORCE, CHANGE = range(5)
"""Columns of ``View.joint``."""


class Series(NamedTuple):
    """Taylor coefficients of a motion, in seconds.

    ``lanes`` (ORDER + 1, lanes) of readings and coordinates; (J, ORDER + 1) of each closed joint: ``distance`` |e|,
    ``power`` x^(3/2), ``force`` N and ``weight`` N / |e|. ``side`` (J,) is the sign of e where the force does not turn,
    else 0; ``factors`` (4 + R + 1,) of the columns of ``acceleration`` after those of the state; ``powers`` (4,) of x.
    """

    lanes: np.ndarray
    distance: np.ndarray
    power: np.ndarray
    force: np.ndarray
    weight: np.ndarray
    side: np.ndarray
    factors: np.ndarray
    powers: np.ndarray


class View(NamedTuple):
    """What the joints do at an instant.

    ``lanes`` (3, all or those of the readings): values and their first two derivatives; ``direction`` (R,): unit
    vector of each joint's force on its surface; ``joint`` (J, 5): penetration and its rate, ``margin``, and of closed
    joints the force and its rate.
    """

    lanes: np.ndarray
    direction: np.ndarray
    joint: np.ndarray


@register_jitable
def new_series(model):
    """Return a series that begins at rest."""
    joints, rows = model.gap.shape[0], model.row.shape[0]
    lanes = np.zeros((ORDER + 1, model.acceleration.shape[2]))
    distance, power, force, weight = np.zeros((4, joints, ORDER + 1))
    factors, powers = np.zeros(FORCING_TERMS + rows + 1), np.ones(FORCING_TERMS)
    return Series(lanes, distance, power, force, weight, np.zeros(joints), factors, powers)


@register_jitable
def new_view(model, width):
    """Return a view of some lanes."""
    return View(np.zeros((3, width)), np.zeros(model.row.shape[0]), np.zeros((model.gap.shape[0], 5)))


@part
def measure(model, j, view):
    """Penetration and its rate of joint j; writes the direction of its force."""
    lanes, direction = view.lanes, view.direction
    low, high = model.first[j], model.first[j + 1]
    if not model.two_sided[j]:
        # one row: e counts with its sign
        direction[low] = 1.0
        return lanes[0, low] - model.gap[j], lanes[1, low]
    size, along = 0.0, 0.0
    for r in range(low, high):
        size += lanes[0, r] * lanes[0, r]
        along += lanes[0, r] * lanes[1, r]
    size = math.sqrt(size)
    if size == 0.0:
        for r in range(low, high):
            direction[r] = 1.0 if r == low else 0.0
        return -model.gap[j], 0.0
    for r in range(low, high):
        direction[r] = lanes[0, r] / size
    return size - model.gap[j], along / size


@part
def margin(model, j, closed, depth, rate):
    """What is positive as long as joint j keeps its contact state; its sign is that of the force, or of the gap."""
    if model.law == LINEAR:
        force = depth + model.damping[j] / model.stiffness[j] * rate
    else:
        force = depth * (1.0 + model.damping[j] * rate)
    return force if closed else -min(depth, force)


@part
def push(model, j, view):
    """Force (1) or (2) of a closed joint and its rate, continued beyond its end so that an event can be located."""
    depth, rate = view.joint[j, DEPTH], view.joint[j, RATE]
    bend = 0.0
    for r in range(model.first[j], model.first[j + 1]):
        bend += view.direction[r] * view.lanes[2, r]
    stiffness, damping = model.stiffness[j], model.damping[j]
    if model.law == LINEAR:
        return stiffness * depth + damping * rate, stiffness * rate + damping * bend
    root = math.sqrt(abs(depth))
    growth = 1.5 * rate * (1.0 + damping * rate) + max(depth, 0.0) * damping * bend
    return stiffness * depth * root * (1.0 + damping * rate), stiffness * root * growth


@part
def look(model, closed, view):
    """Write directions and joints of a view from its readings; returns the ``resultant`` of the monitored joint."""
    fx, fy, fz, rx, ry, rz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(closed.shape[0]):
        depth, rate = measure(model, j, view)
        view.joint[j, DEPTH], view.joint[j, RATE] = depth, rate
        view.joint[j, MARGIN] = margin(model, j, closed[j], depth, rate)
        if not closed[j]:
            continue
        force, change = push(model, j, view)
        view.joint[j, FORCE], view.joint[j, CHANGE] = force, change
        if model.monitored[j]:
            for r in range(model.first[j], model.first[j + 1]):
                direction = view.direction[r]
                fx += model.reading[r, 0] * direction * force
                fy += model.reading[r, 1] * direction * force
                fz += model.reading[r, 2] * direction * force
                rx += model.reading[r, 0] * direction * change
                ry += model.reading[r, 1] * direction * change
                rz += model.reading[r, 2] * direction * change
    return resultant(fx, fy, fz, rx, ry, rz)


@part
def read(series, time, view):
    """Write the lanes of a view at a time in the span of a series."""
    sum_series(series.lanes, 0, series.lanes.shape[1], ORDER, time, view.lanes, 0, view.lanes.shape[1])


@part
def look_at(model, series, time, closed, view):
    """As ``look``, at a time in the span of a series."""
    read(series, time, view)
    return look(model, closed, view)


@part
def look_first(model, series, closed, view):
    """As ``look_at``, at the beginning of a series."""
    for k in range(3):
        for i in range(view.lanes.shape[1]):
            view.lanes[k, i] = series.lanes[k, i] if k < 2 else 2.0 * series.lanes[k, i]
    return look(model, closed, view)


@leaf
def begin(model, z, series):
    """Write the state z (2n,) into the first two terms of a series."""
    rows, n = model.row.shape
    for order in range(2):
        lanes = series.lanes[order]
        for i in range(n):
            lanes[rows + i] = z[order * n + i]
        for r in range(rows):
            total = 0.0
            for i in range(n):
                total += model.row[r, i] * z[order * n + i]
            lanes[r] = total


@part
def square(a, k, first):
    """Coefficient k of the square of a series, of its coefficients from ``first`` on."""
    total = 0.0
    for i in range(first, (k + 1) // 2):
        total += a[i] * a[k - i]
    total *= 2.0
    if k % 2 == 0:
        total += a[k // 2] * a[k // 2]
    return total


@part
def product(a, b, k, first):
    """Coefficient k of the product of two series, of the coefficients of the first from ``first`` on."""
    total = 0.0
    for i in range(first, k + 1):
        total += a[i] * b[k - i]
    return total


@part
def extend_distance(model, j, k, series):
    """Write coefficient k > 0 of the distance of a closed joint from the middle of its gap."""
    low, high = model.first[j], model.first[j + 1]
    lanes, distance = series.lanes, series.distance[j]
    if series.side[j] != 0.0:
        distance[k] = series.side[j] * lanes[k, low]
        return
    total = -square(distance, k, 1)
    for r in range(low, high):
        total += square(lanes[:, r], k, 0)
    distance[k] = total * (0.5 / distance[0])


@part
def begin_joint(model, j, series):
    """Write the first coefficient of the distance of a closed joint, and its side."""
    low, high = model.first[j], model.first[j + 1]
    size = 0.0
    for r in range(low, high):
        size += series.lanes[0, r] * series.lanes[0, r]
    if high - low > 1 and size > 0.0:
        series.side[j] = 0.0
        series.distance[j, 0] = math.sqrt(size)
    else:
        series.side[j] = -1.0 if model.two_sided[j] and series.lanes[0, low] < 0.0 else 1.0
        series.distance[j, 0] = series.side[j] * series.lanes[0, low]


@part
def extend_force(model, j, k, series):
    """Write coefficient k of the force (1) or (2) of a closed joint; its distance is known one order further."""
    distance, force, power = series.distance[j], series.force[j], series.power[j]
    stiffness, damping = model.stiffness[j], model.damping[j]
    depth = distance[0] - model.gap[j]
    if model.law == LINEAR:
        force[k] = stiffness * (depth if k == 0 else distance[k]) + damping * (k + 1.0) * distance[k + 1]
        return
    depth = max(depth, LEAST_DEPTH)
    if k == 0:
        power[0] = depth * math.sqrt(depth)
    else:
        total = 0.0
        for i in range(1, k + 1):
            total += (2.5 * i - k) * distance[i] * power[k - i]
        power[k] = total / (k * depth)
    total = power[k]
    for i in range(k + 1):
        total += damping * power[i] * (k - i + 1.0) * distance[k - i + 1]
    force[k] = stiffness * total


@part
def extend_joint(model, j, k, series):
    """Write coefficient k of what a closed joint pushes into ``factors``."""
    low, high = model.first[j], model.first[j + 1]
    extend_distance(model, j, k + 1, series)
    extend_force(model, j, k, series)
    distance, force, weight = series.distance[j], series.force[j], series.weight[j]
    along = series.factors[FORCING_TERMS:]
    along[model.row.shape[0]] += model.slides[j] * force[k]
    if series.side[j] != 0.0:
        along[low] = series.side[j] * force[k]
        return
    weight[k] = (force[k] - product(distance, weight, k, 1)) * (1.0 / distance[0])
    for r in range(low, high):
        along[r] = product(weight, series.lanes[:, r], k, 0)


@leaf
def expand(model, b, time, closed, last, series):
    """Continue a series about ``time`` in bin b from its first two terms up to the order ``last``."""
    lanes, a, factors = series.lanes, model.acceleration[b], series.factors
    rows, n = model.row.shape
    width, driven = lanes.shape[1], a[2 * n :]
    for k in range(1, FORCING_TERMS):
        series.powers[k] = series.powers[k - 1] * time / model.bin_duration
    for i in range(factors.shape[0]):
        factors[i] = 0.0
    for j in range(closed.shape[0]):
        if closed[j]:
            begin_joint(model, j, series)
    scale = 1.0
    for k in range(last - 1):
        skipped = min(k, FORCING_TERMS)
        shift_forcing(series.powers, 0, k, scale, factors, 0)
        scale /= model.bin_duration
        factors[FORCING_TERMS + rows] = 0.0
        for j in range(closed.shape[0]):
            if closed[j]:
                extend_joint(model, j, k, series)
        older, new = k * width + rows, (k + 2) * width
        add_columns(driven, skipped * width, width, driven.shape[0] - skipped, factors, skipped, lanes, new, LANES)
        next_term(a, 0, n * width, width, n, lanes, older, older + width, new, k + 1.0, SHARES[k], new)


@part
def span(series, tolerance, longest):
    """Time [s] at which the last two terms of the velocity reach the tolerance, at most ``longest``."""
    for k in range(ORDER - 1, ORDER + 1):
        largest = 0.0
        for i in range(series.lanes.shape[1]):
            largest = max(largest, k * abs(series.lanes[k, i]))
        if largest > 0.0:
            longest = min(longest, (tolerance / largest) ** (1.0 / (k - 1)))
    return longest


@part
def lowest_margin(view):
    """Smallest margin of all joints: positive as long as none changes its contact state."""
    lowest = math.inf
    for j in range(view.joint.shape[0]):
        lowest = min(lowest, view.joint[j, MARGIN])
    return lowest


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


@part
def read_state(model, view, z):
    """Write the state of a view of all lanes into z (2n,)."""
    rows, n = model.row.shape
    for i in range(n):
        z[i], z[n + i] = view.lanes[0, rows + i], view.lanes[1, rows + i]


@leaf
def turn(model, closed, series, views, whole, z, peak, bouncing, arrays, cycle, tolerance, budget):
    """Advance a revolution from the beginning of a series; its events, or a negative status.

    ``views`` are three of the readings; ``whole`` is one of all lanes, left at the end. z (2n,) is work space.
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
            read(series, reached, whole)
            for i in range(series.lanes.shape[1]):
                series.lanes[0, i], series.lanes[1, i] = whole.lanes[0, i], whole.lanes[1, i]
            if found:
                events += change_contacts(model, closed, before, bouncing, origin + time, impacts, bounce_time)
                if events > budget:
                    return -status.EVENT_BUDGET
    return events


@njit(cache=True, nogil=True)
def advance(model, state, bouncing, arrays, event_tolerance, event_budget):
    """Advance ``state`` (2n,) and ``bouncing`` in place by whole revolutions; see ``cycle.advance``."""
    bins, _, lanes = model.acceleration.shape
    if model.steps * bins > STEP_BUDGET:
        return status.STEP_BUDGET, 0
    period = bins * model.bin_duration
    readings = padded(model.row.shape[0])
    series, whole = new_series(model), new_view(model, lanes)
    views = (new_view(model, readings), new_view(model, readings), new_view(model, readings))
    z, closed, peak = np.empty(state.shape[0]), np.zeros(model.gap.shape[0], dtype=np.bool_), np.zeros((2, 5))
    for cycle in range(arrays.section.shape[0]):
        begin_cycle(model, state, arrays, cycle)
        peak[:] = 0.0
        begin(model, state, series)
        judge(model, series, closed, views[0])
        events = turn(
            model, closed, series, views, whole, z, peak, bouncing, arrays, cycle, event_tolerance, event_budget
        )
        if events < 0:
            return -events, cycle
        write_peaks(peak, arrays, cycle)
        arrays.events[cycle] = events
        read_state(model, whole, state)
        for i in range(state.shape[0]):
            if not abs(state[i]) < RUNAWAY:
                return status.DIVERGED, cycle
        let_pass(bouncing, 1, period)
    return status.OK, arrays.section.shape[0]
