"""The first instant at which a quantity falls to zero, found on its Taylor polynomial and proved to be the first.

A quantity of a linear system is its Taylor polynomial of degree 15 to rounding over a step in which the fastest mode
turns by an angle of at most one.
"""

import math

from chaosgym.core.kernel import leaf
from chaosgym.core.lanes import fma, item

DEGREE = 15

MAX_POLISH = 100
"""Iterations to polish one event; safeguarded Newton needs two or three, bisection about fifty."""

MAX_PIECES = 500
"""Pieces into which one step is cut at most; a touch needs one or two, a graze some thirty."""

OVERSHOOT = 4.0 / 27.0
"""A cubic of length h exceeds its ends by at most this times h times the slopes that lead beyond."""


@leaf
def polynomial(own, at, s):
    """Value and slope at s of the polynomial whose coefficients begin at a place in an array."""
    value, slope = item(own, at + DEGREE), 0.0
    for k in range(DEGREE - 1, -1, -1):
        slope = fma(slope, s, value)
        value = fma(value, s, item(own, at + k))
    return value, slope


@leaf
def polished(own, at, sign, inverse, low, high, start, bend, resolution):
    """Zero in [low, high] of sign times the polynomial of time * inverse, which falls there, by Newton's method."""
    t = start
    for _ in range(MAX_POLISH):
        value, slope = polynomial(own, at, t * inverse)
        value, slope = sign * value, sign * slope * inverse
        if value > 0.0:
            low = t
        else:
            high = t
        change = -value / slope if slope < 0.0 else math.inf
        converging = low <= t + change <= high
        if not converging:
            change = 0.5 * (low + high) - t
        t += change
        # what is left after a step of Newton's method is bend change^2 / (2 slope)
        if abs(change) <= resolution or (converging and bend * change * change <= -resolution * slope):
            break
    return t


@leaf
def first_fall(own, at, sign, inverse, start, until, bound2, bound4, resolution):
    """First instant in (start, until] at which sign times the polynomial of time * inverse falls to 0, inf if none.

    ``bound2`` and ``bound4`` bound its second and fourth derivative in time. A piece is passed only if the cubic
    through both ends and the bound of the rest keep clear of zero, and holds the first zero only if the quantity falls
    throughout; else it is halved. What happens within ``resolution`` [s] is not resolved.
    """
    a = start
    value, slope = polynomial(own, at, a * inverse)
    value, slope = sign * value, sign * slope * inverse
    length = until - a
    for _ in range(MAX_PIECES):
        length = min(length, until - a)
        b = a + length
        value1, slope1 = polynomial(own, at, b * inverse)
        value1, slope1 = sign * value1, sign * slope1 * inverse
        if value1 > 0.0:
            swing = OVERSHOOT * length * (max(-slope, 0.0) + max(slope1, 0.0))
            swing += bound4 * length * length * length * length / 384.0
            if min(value, value1) > swing or length <= resolution:
                if b >= until:
                    return math.inf
                a, value, slope = b, value1, slope1
                length *= 2.0
                continue
        else:
            if slope + slope1 + bound2 * length < 0.0:
                guess = a - value / slope if slope < 0.0 else a + length * value / (value - value1)
                return polished(own, at, sign, inverse, a, b, min(max(guess, a), b), bound2, resolution)
            if length <= resolution:
                return b
        length *= 0.5
    return b
