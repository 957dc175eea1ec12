"""Laws of contact, in files of gaps and of mechanisms alike: N = k x + d x', or N = K x^n (1 + chi x').

A restitution stands for the damper that restores this share of the speed of an impact: of a linear surface for any
speed, of a Hertzian one at a stated speed.

References
----------
K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440; H. M. Lankarani, P. E. Nikravesh, J. Mech. Des. 112 (1990)
369; P. Flores, M. Machado, M. T. Silva, J. M. Martins, Multibody Syst. Dyn. 25 (2011) 357.
"""

import math
import re
from collections.abc import Callable, Mapping
from typing import Any

from chaosgym.core.binned.model import HERTZ, LINEAR
from chaosgym.errors import ParameterError
from chaosgym.machines.file_keys import TEXT, Key, needed
from chaosgym.numbers import number, shown

LOSSES: Mapping[str, Callable[[float], float]] = {
    "hunt-crossley": lambda e: 1.5 * (1.0 - e),
    "lankarani-nikravesh": lambda e: 0.75 * (1.0 - e**2),
    "flores": lambda e: 1.6 * (1.0 - e) / e,
}
"""chi times the speed of the impact, of a restitution."""

SOFTEST, HARDEST = 1.0, 3.0
"""Exponents of a Hertzian surface."""

LAW_KEYS = {
    "hertz_stiffness": Key("K of a Hertzian surface, N = K x^1.5 (1 + chi x')", "N/m^1.5"),
    "hertz_damping": Key("chi of it; or restitution, impact_speed and law", "s/m"),
    "exponent": Key("of x in place of 1.5, 1 to 3, also '10/9'; the unit of K follows, as N/m^1.11"),
    "restitution": Key("speed after over speed before an impact, 0.001 to 1, in place of damping or hertz_damping"),
    "impact_speed": Key("speed at which a Hertzian surface restores that share", "m/s"),
    "law": Key("of chi from restitution; hunt-crossley by default", kind=TEXT, choices=tuple(LOSSES)),
}
"""Keys of a joint in all files."""

_RATIO = r"(\d+\.?\d*|\.\d+)(?:/(\d+\.?\d*))?"
_POWER = re.compile(rf"(.*/(?:m|rad))\^\(?{_RATIO}\)?\s*")

SAME_POWER = 0.01
"""Share by which the exponent in a unit may be rounded."""


def with_power(where: str, row: Mapping[str, Any]) -> dict[str, Any]:
    """A joint's row whose Hertzian stiffness has its unit for an exponent of 1.5, and whose exponent is a number.

    Raises
    ------
    ParameterError
        If unit and exponent disagree.
    """
    given, power = row.get("hertz_stiffness"), row.get("exponent", HERTZ)
    if isinstance(power, str):
        ratio = re.fullmatch(_RATIO, power.strip())
        if ratio is None:
            raise ParameterError(f"{where}.exponent = {shown(power)} is no exponent; allowed: such as 1.2 or '10/9'")
        power = _number(*ratio.groups())
        row = {**row, "exponent": power}
    unit = _POWER.fullmatch(given) if isinstance(given, str) else None
    if unit is None or not isinstance(power, int | float):
        return dict(row)
    if abs(_number(*unit.groups()[1:]) - power) > SAME_POWER * power:
        raise ParameterError(
            f"{where}.hertz_stiffness = {shown(given)} does not go with exponent = {power:g}; allowed: a unit such as "
            f"N/m^{power:g}"
        )
    return {**row, "hertz_stiffness": f"{unit[1]}^1.5"}


def _number(above: str, below: str | None) -> float:
    return float(above) / (float(below or 1.0) or math.inf)


def is_hertzian(row: Mapping[str, Any]) -> bool:
    """Whether a joint's row states a Hertzian surface."""
    return bool({"hertz_stiffness", "hertz_damping", "exponent"} & set(row))


def hertzian(where: str, row: Mapping[str, Any]) -> tuple[float, float, float]:
    """Stiffness K [N/m^n], damping chi [s/m] and exponent n of a Hertzian surface that a joint's row states.

    Raises
    ------
    ParameterError
        If a key is missing, does not go with another one, or is out of range.

    Examples
    --------
    >>> from chaosgym.machines.contact_law import hertzian
    >>> hertzian("joint", {"hertz_stiffness": 1e10, "restitution": 0.5, "impact_speed": 0.2, "law": "flores"})
    (10000000000.0, 8.0, 1.5)
    """
    for key in ("stiffness", "damping"):
        if key in row:
            raise ParameterError(f"{where} has {key} and is Hertzian; allowed: hertz_{key} in place of {key}")
    (stiffness,) = needed(where, row, "hertz_stiffness")
    number(f"{where}.hertz_stiffness", stiffness, 1e-3, 1e18, "N/m^n")
    exponent = number(f"{where}.exponent", row.get("exponent", HERTZ), SOFTEST, HARDEST)
    if "restitution" not in row:
        for key in ("impact_speed", "law"):
            if key in row:
                raise ParameterError(f"{where}.{key} has no meaning without {where}.restitution; leave it out")
        (damping,) = needed(where, row, "hertz_damping")
        return float(stiffness), number(f"{where}.hertz_damping", damping, 0.0, 1e6, "s/m"), exponent
    if "hertz_damping" in row:
        raise ParameterError(f"{where} has restitution and hertz_damping; allowed: one of them")
    restored, speed = needed(where, row, "restitution", "impact_speed")
    number(f"{where}.restitution", restored, 1e-3, 1.0)
    number(f"{where}.impact_speed", speed, 1e-6, 1e4, "m/s")
    return float(stiffness), LOSSES[row.get("law", "hunt-crossley")](restored) / speed, exponent


def stiffness_at(stiffness: float, exponent: float, force: float) -> float:
    """Stiffness [N/m] of a surface under a force [N]: the derivative of its law.

    Examples
    --------
    >>> from chaosgym.machines.contact_law import stiffness_at
    >>> round(stiffness_at(1e10, 1.5, 100.0))
    32316520
    """
    if exponent == LINEAR:
        return stiffness
    return float(exponent * stiffness ** (1.0 / exponent) * force ** (1.0 - 1.0 / exponent))


def damping_for(restitution: float, mass: float, stiffness: float) -> float:
    """Damper [N s/m] of a linear surface that never pulls and leaves a mass [kg] a share of its speed, 0.001 to 1."""
    low, high = 0.0, 1e3
    for _ in range(200):
        ratio = 0.5 * (low + high)
        if restitution_of(ratio) > restitution:
            low = ratio
        else:
            high = ratio
    return 2.0 * low * math.sqrt(stiffness * mass)


def restitution_of(ratio: float) -> float:
    r"""Speed after an impact over the speed before it, of a damping ratio z, on a linear surface that never pulls.

    A mass m meets the surface at speed v. While the force N = k x + d x' pushes, with w = sqrt(k / m) and
    z = d / (2 sqrt(k m)) = cos(a), 0 < a <= pi / 2 below critical damping:

        N = m v w / sin(a) exp(-z w t) sin(2 a - w t sin(a))

    It ends at w t sin(a) = 2 a with the speed e v, e = exp(-2 a z / sin(a)). Above critical damping a / sin(a) becomes
    arcosh(z) / sqrt(z^2 - 1).

    References
    ----------
    T. Schwager, T. Poeschel, Granular Matter 9 (2007) 465-469.
    """
    if abs(ratio - 1.0) < 1e-8:
        return math.exp(-2.0 * ratio)
    if ratio < 1.0:
        return math.exp(-2.0 * ratio * (math.acos(ratio) / math.sqrt(1.0 - ratio**2)))
    return math.exp(-2.0 * ratio * (math.acosh(ratio) / math.sqrt(ratio**2 - 1.0)))
