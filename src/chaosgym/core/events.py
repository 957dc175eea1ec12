r"""Contacts of surfaces along one row of displacement: when they begin and end.

A channel has displacement y and velocity v. On side s = +-1 its depth is s y - c beyond the clearance c, and it presses
with k times the pressure s (y + lag v) - c, lag = d / k. A closed channel opens when its pressure falls to zero, an
open one closes when depth and pressure are both positive. Either is a reading e = y + lag v, or y, with the slope e'.

Nothing is taken for granted between two instants h apart: the cubic through both ends lies within the hull of its
Bezier points e0, e0 + h e0' / 3, e1 - h e1' / 3, e1, and the motion within h^4 / 384 times the largest fourth
derivative of that cubic. Its slope lies likewise within e0', 3 (e1 - e0) / h - e0' - e1', e1', but for sqrt(3) / 216
h^3 times the same. A reading that is neither sure to keep its sign nor to cross zero once is looked at in two halves.

References
----------
G. Birkhoff, A. Priver, Hermite interpolation errors for derivatives, J. Math. and Phys. 46 (1967) 440-447.
"""

import math

from chaosgym.core.cycle import LOWER, UPPER
from chaosgym.core.kernel import leaf, njit, part
from chaosgym.core.lanes import fma, item

VALUE_DOUBT, SLOPE_DOUBT = 1.0 / 384.0, math.sqrt(3.0) / 216.0
"""What h^4 and h^3 times the fourth derivative are multiplied by to bound the error of the cubic and of its slope."""

ROUNDING = 1e-12
"""Share of a reading that is rounding: a contact that has just changed is at zero within it."""

MOST_PIECES = 2_000
"""Pieces that one search may look at; a graze needs some hundred. What is no number ends none by itself."""

POLISH = 60
"""Iterations to locate one event; safeguarded Newton needs two to four, bisection about fifty."""

KEEPS, CROSSES, UNSURE = range(3)
"""What a reading does between two instants: not reach zero, cross it once, or what can't be told."""


@njit(cache=True, inline="always")
def cubic(e0, d0, e1, d1, h, t):
    """Value and slope at t of the cubic with values e0, e1 and slopes d0, d1 at 0 and h."""
    s = t / h
    b = 3.0 * (e1 - e0) - h * (2.0 * d0 + d1)
    c = 2.0 * (e0 - e1) + h * (d0 + d1)
    return e0 + s * (h * d0 + s * (b + s * c)), d0 + s * (2.0 * b + 3.0 * s * c) / h


@leaf
def cubic_extremum(e0, d0, e1, d1, h, sign):
    """Instant in (0, h) of the cubic's minimum (sign +1) or maximum (sign -1), or -1 if it has none there."""
    b = sign * (3.0 * (e1 - e0) - h * (2.0 * d0 + d1))
    c = sign * (2.0 * (e0 - e1) + h * (d0 + d1))
    d = sign * h * d0
    discriminant = b * b - 3.0 * c * d
    if discriminant < 0.0:
        return -1.0
    denominator = b + math.sqrt(discriminant)
    if denominator <= 0.0:
        return -1.0
    s = -d / denominator
    return s * h if 0.0 < s < 1.0 else -1.0


@leaf
def hull(h, e0, d0, e1, d1):
    """(Lowest, highest) Bezier point of the cubic with values e0, e1 and slopes d0, d1 at both ends of h."""
    first, second = e0 + h / 3.0 * d0, e1 - h / 3.0 * d1
    return min(min(e0, e1), min(first, second)), max(max(e0, e1), max(first, second))


@leaf
def trend(h, e0, d0, e1, d1, fourth):
    """1 if a reading rises all through h, -1 if it falls, 0 if that is not sure."""
    middle = 3.0 * (e1 - e0) / h - d0 - d1
    doubt = SLOPE_DOUBT * h * h * h * fourth
    if min(min(d0, d1), middle) > doubt:
        return 1
    if max(max(d0, d1), middle) < -doubt:
        return -1
    return 0


@leaf
def fourth_of(own, series, lanes, last, lag, h):
    """Bound of the fourth derivative of y + lag y' over h, by the Taylor coefficients of y."""
    total, power = 0.0, 1.0
    for k in range(4, last + 1):
        size = abs(own[series + k * lanes]) * (k * (k - 1) * (k - 2) * (k - 3))
        total += power * size
        if lag != 0.0 and k > 4:
            total += lag * (k - 4) * size * power / h
        power *= h
    return total


@leaf
def judge(h, e0, d0, e1, d1, fourth):
    """What a reading that is positive, or at zero by rounding, does over h: KEEPS, CROSSES or UNSURE."""
    if hull(h, e0, d0, e1, d1)[0] - VALUE_DOUBT * h * h * h * h * fourth > 0.0:
        return KEEPS
    way = trend(h, e0, d0, e1, d1, fourth)
    if way > 0:
        return KEEPS
    if way < 0 and e1 <= 0.0:
        return CROSSES
    # it falls, and still is above zero at the end
    return KEEPS if way < 0 else UNSURE


@part
def reading_at(own, series, lanes, last, t):
    """Value and first three derivatives at t of Taylor coefficients up to order ``last``, every ``lanes`` numbers."""
    value, slope, bend, third = 0.0, 0.0, 0.0, 0.0
    for k in range(last, -1, -1):
        third = fma(third, t, bend)
        bend = fma(bend, t, slope)
        slope = fma(slope, t, value)
        value = fma(value, t, item(own, series + k * lanes))
    return value, slope, 2.0 * bend, 6.0 * third


@leaf
def crossing(own, series, lanes, last, side, gap, lag, low, high, e0, d0, e1, d1, tolerance):
    """Instant in [low, high] at which side (y + lag y') - gap, which changes its sign there once, is zero.

    It is ``e0`` and ``e1`` at both ends, with slopes ``d0`` and ``d1``. Halley's method from the root of the cubic
    through these, kept inside by bisection.
    """
    h, begin = high - low, low
    t = h * e0 / (e0 - e1) if e0 != e1 else 0.5 * h
    for _ in range(3):
        value, slope = cubic(e0, d0, e1, d1, h, t)
        if slope != 0.0:
            t = min(max(t - value / slope, 0.0), h)
    t += begin
    for _ in range(POLISH):
        y, v, a, third = reading_at(own, series, lanes, last, t)
        value, slope, bend = side * (y + lag * v) - gap, side * (v + lag * a), side * (a + lag * third)
        if (value > 0.0) == (e1 > 0.0):
            high = t
        else:
            low = t
        divisor = 2.0 * slope * slope - value * bend
        change = -2.0 * value * slope / divisor if divisor != 0.0 else math.inf
        if abs(change) <= tolerance:
            return min(max(t + change, low), high)
        t = t + change if low < t + change < high else 0.5 * (low + high)
    return t


@part
def settled(side, gap, two_sided, e0, d0, e1, d1, h, fourth):
    """What a channel does over h by what it reads at both ends: (KEEPS, CROSSES or UNSURE, side of a crossing)."""
    if side != 0.0:
        return judge(h, side * e0 - gap, side * d0, side * e1 - gap, side * d1, fourth), 0.0
    if gap - e0 < 0.0:
        return UNSURE, 1.0
    verdict = judge(h, gap - e0, -d0, gap - e1, -d1, fourth)
    if verdict != KEEPS or two_sided == 0.0:
        return verdict, 1.0
    if gap + e0 < 0.0:
        return UNSURE, -1.0
    return judge(h, gap + e0, d0, gap + e1, d1, fourth), -1.0


@leaf
def opening(own, series, lanes, last, side, gap, lag, least, h, tolerance, growth):
    """First instant in [0, h] at which a closed channel opens, or inf.

    A force that is zero by rounding and grows does not open it; likewise in ``closing``. Else two channels that open at
    one instant open and close each other without end. ``least`` is what is rounding at least: sums of large terms know
    of more. Pieces that nothing can be told of become longer by ``growth``: a reading that begins at zero without a
    slope stays rounding for a time that has nothing to do with the ``tolerance``.
    """
    if h <= 0.0:
        return math.inf
    fourth = fourth_of(own, series, lanes, last, lag, h)
    y, v, a, _ = reading_at(own, series, lanes, last, 0.0)
    low, length, finest = 0.0, h, tolerance
    e0, d0 = side * (y + lag * v) - gap, side * (v + lag * a)
    for _ in range(MOST_PIECES):
        if low >= h:
            break
        high = min(low + length, h)
        y, v, a, _ = reading_at(own, series, lanes, last, high)
        e1, d1 = side * (y + lag * v) - gap, side * (v + lag * a)
        verdict = judge(high - low, e0, d0, e1, d1, fourth)
        if verdict == CROSSES:
            return crossing(own, series, lanes, last, side, gap, lag, low, high, e0, d0, e1, d1, tolerance)
        if verdict == UNSURE:
            if length > finest:
                length *= 0.5
                continue
            slack = least + ROUNDING * (abs(gap) + abs(y) + lag * abs(v))
            if e1 <= 0.0 and (d1 <= 0.0 or e1 < -slack):
                return high
            finest *= growth
        else:
            finest = tolerance
        length *= 2.0
        low, e0, d0 = high, e1, d1
    return math.inf


@leaf
def closing(own, series, lanes, last, side, gap, lag, least, h, tolerance):
    """First instant in [0, h] at which an open channel closes on ``side``, or inf.

    Depth and pressure count from below here: what must become positive is looked at with its sign changed.
    """
    if h <= 0.0:
        return math.inf
    place_fourth = fourth_of(own, series, lanes, last, 0.0, h)
    fourth = fourth_of(own, series, lanes, last, lag, h)
    y, v, a, _ = reading_at(own, series, lanes, last, 0.0)
    low, length = 0.0, h
    p0, q0, e0, d0 = gap - side * y, -side * v, gap - side * (y + lag * v), -side * (v + lag * a)
    for _ in range(MOST_PIECES):
        if low >= h:
            break
        high = min(low + length, h)
        y, v, a, _ = reading_at(own, series, lanes, last, high)
        p1, q1, e1, d1 = gap - side * y, -side * v, gap - side * (y + lag * v), -side * (v + lag * a)
        # outside, or inside without pressure: within rounding where the contact has just opened
        slack = least + ROUNDING * (abs(gap) + abs(y) + lag * abs(v))
        span = high - low
        place = judge(span, p0, q0, p1, q1, place_fourth) if p0 >= -slack else UNSURE
        if place == CROSSES:
            return crossing(own, series, lanes, last, side, gap, 0.0, low, high, -p0, -q0, -p1, -q1, tolerance)
        force = KEEPS
        if place != KEEPS:
            force = judge(span, e0, d0, e1, d1, fourth) if e0 >= -slack else UNSURE
        if force == CROSSES and p0 < 0.0 and p1 < 0.0 and trend(span, p0, q0, p1, q1, place_fourth) != 0:
            return crossing(own, series, lanes, last, side, gap, lag, low, high, -e0, -d0, -e1, -d1, tolerance)
        if force != KEEPS:
            if length > tolerance:
                length *= 0.5
                continue
            if p1 < 0.0 and e1 < 0.0 and (d1 <= 0.0 or e1 < -slack):
                return high
        length *= 2.0
        low, p0, q0, e0, d0 = high, p1, q1, e1, d1
    return math.inf


@leaf
def note_touch(bouncing, joints, j, side, time, bounce_time):
    """Go on bouncing at joint j, or end it and begin anew when the other surface is touched.

    ``bouncing`` (3m,): of all m joints the surface, +1, -1, or 0 before the first touch; then of each the instants of
    the first and the last touch of it [s], counted from the start of the coming cycle.
    """
    first = joints + 2 * j
    if bouncing[j] != side:
        if bouncing[j] != 0.0:
            column = 2 * j + (UPPER if bouncing[j] > 0.0 else LOWER)
            bounce_time[column] = max(bounce_time[column], bouncing[first + 1] - bouncing[first])
        bouncing[j] = side
        bouncing[first] = time
    bouncing[first + 1] = time


@leaf
def let_pass(bouncing, joints, period):
    """Count the instants of touches from the start of the next cycle."""
    for i in range(joints, bouncing.shape[0]):
        bouncing[i] -= period
