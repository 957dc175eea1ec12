"""Cubics of a step: value in between, and where they have an extremum."""

import math

from chaosgym.core.kernel import leaf, njit


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
