r"""Closed-form impact on a spring and damper that never pull: duration, restitution, largest force.

A mass m meets the surface at speed v. While the force N = k x + d x' pushes, with w = sqrt(k / m) and
z = d / (2 sqrt(k m)) = cos(a), 0 < a <= pi / 2 below critical damping:

    N = m v w / sin(a) exp(-z w t) sin(2 a - w t sin(a))

It ends at w t sin(a) = 2 a with the speed e v, e = exp(-2 a z / sin(a)), and is largest at w t sin(a) = 3 a - pi, or
at once if z > 1/2. Above critical damping a / sin(a) becomes arcosh(z) / sqrt(z^2 - 1).

References
----------
T. Schwager, T. Poeschel, Granular Matter 9 (2007) 465-469.
"""

import math
from typing import NamedTuple


class LinearImpact(NamedTuple):
    """Figures of an impact.

    ``restitution`` speed after over speed before; ``duration`` [s]; ``force_per_speed`` largest force over the speed
    before [N s/m].
    """

    restitution: float
    duration: float
    force_per_speed: float


def damping_for(restitution: float, mass: float, stiffness: float) -> float:
    """Damper [N s/m] of a surface that leaves a mass [kg] a share of its speed, from 0.001 to 1."""
    low, high = 0.0, 1e3
    for _ in range(200):
        ratio = 0.5 * (low + high)
        if linear_impact(1.0, 1.0, 2.0 * ratio).restitution > restitution:
            low = ratio
        else:
            high = ratio
    return 2.0 * low * math.sqrt(stiffness * mass)


def linear_impact(mass: float, stiffness: float, damping: float) -> LinearImpact:
    """Impact of a mass [kg] on a surface with a stiffness [N/m] and a damping [N s/m]."""
    rate = math.sqrt(stiffness / mass)
    ratio = damping / (2.0 * mass * rate)
    if abs(ratio - 1.0) < 1e-8:
        turn = 1.0
    elif ratio < 1.0:
        turn = math.acos(ratio) / math.sqrt(1.0 - ratio**2)
    else:
        turn = math.acosh(ratio) / math.sqrt(ratio**2 - 1.0)
    if ratio >= 0.5:
        force = damping
    else:
        force = mass * rate * math.exp(-ratio * (3.0 * turn - math.pi / math.sqrt(1.0 - ratio**2)))
    return LinearImpact(math.exp(-2.0 * ratio * turn), 2.0 * turn / rate, force)
