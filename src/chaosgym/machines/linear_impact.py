r"""Closed-form restitution of an impact on a spring and damper that never pull.

A mass m meets the surface at speed v. While the force N = k x + d x' pushes, with w = sqrt(k / m) and
z = d / (2 sqrt(k m)) = cos(a), 0 < a <= pi / 2 below critical damping:

    N = m v w / sin(a) exp(-z w t) sin(2 a - w t sin(a))

It ends at w t sin(a) = 2 a with the speed e v, e = exp(-2 a z / sin(a)). Above critical damping a / sin(a) becomes
arcosh(z) / sqrt(z^2 - 1).

References
----------
T. Schwager, T. Poeschel, Granular Matter 9 (2007) 465-469.
"""

import math


def damping_for(restitution: float, mass: float, stiffness: float) -> float:
    """Damper [N s/m] of a surface that leaves a mass [kg] a share of its speed, from 0.001 to 1."""
    low, high = 0.0, 1e3
    for _ in range(200):
        ratio = 0.5 * (low + high)
        if restitution_of(ratio) > restitution:
            low = ratio
        else:
            high = ratio
    return 2.0 * low * math.sqrt(stiffness * mass)


def restitution_of(ratio: float) -> float:
    """Speed after an impact over the speed before it, of a damping ratio z."""
    if abs(ratio - 1.0) < 1e-8:
        return math.exp(-2.0 * ratio)
    if ratio < 1.0:
        return math.exp(-2.0 * ratio * (math.acos(ratio) / math.sqrt(1.0 - ratio**2)))
    return math.exp(-2.0 * ratio * (math.acosh(ratio) / math.sqrt(ratio**2 - 1.0)))
