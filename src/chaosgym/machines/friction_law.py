"""How surfaces rub, in files of gaps and of mechanisms alike: Coulomb's friction, mu N.

Surfaces of a mechanism slide as its nominal motion makes them, with a speed v. There mu may fall with it:

    mu(v) = (mu_c + (mu_s - mu_c) exp(-(v / v_S)^2)) clip(v / v_R, -1, 1)

with the static mu_s, Stribeck's speed v_S and the speed v_R below which friction fades, its regularisation. In files of
gaps a slider in series with a tangential spring sticks and slides.

References
----------
E. Pennestri, V. Rossi, P. Salvini, P. P. Valentini, Nonlinear Dyn. 83 (2016) 1785; J. A. C. Ambrosio, in: Virtual
Nonlinear Multibody Systems, Kluwer 2003, 57, on the ramp through zero.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.errors import ParameterError
from chaosgym.machines.file_keys import Key, needed
from chaosgym.machines.parameters import Parameter
from chaosgym.numbers import number

POISSON = 0.3
"""Poisson's ratio of steel."""

MINDLIN = 2.0 * (1.0 - POISSON) / (2.0 - POISSON)
"""Tangential over normal stiffness of two like bodies in contact that do not slip (R. D. Mindlin, Compliance of elastic
bodies in contact, J. Appl. Mech. 16 (1949) 259)."""

OF_FRICTION = {
    "friction": Parameter("-", 0.0, 100.0, (), "assumed", "default"),
    "tangential_factor": Parameter("-", 1e-6, 1e4, (), "assumed", "Mindlin 1949, steel"),
    "sliding_speed": Parameter("m/s", -1e4, 1e4, (), "assumed", "default"),
}
"""What is known beside that of a joint with a ``tangent``."""


RAMP = 0.02
"""Sliding speed below which friction fades by default, as a share of the largest in a revolution."""

FRICTION_FIELDS: Mapping[str, dict[str, Any]] = {
    "friction": {"unit": "-", "low": 0.0, "high": 0.5},
    "radius": {"unit": "m", "low": 0.0, "high": 10.0},
    "static_friction": {"unit": "-", "low": 0.0, "high": 1.0},
    "stribeck_speed": {"unit": "m/s", "low": 1e-9, "high": 1e3},
    "regularisation_speed": {"unit": "m/s", "low": 1e-9, "high": 1e3},
}
"""Fields of a joint of a mechanism, after its name and in the order of ``Friction``."""

LAW_OF_SLIDING = {
    "static_friction": Key("coefficient at slow sliding, from which it falls to friction with the speed"),
    "stribeck_speed": Key("of that fall: at this speed 37 % of it are left", "m/s"),
    "regularisation_speed": Key("below which friction fades; 2 % of the fastest sliding by default", "m/s"),
}
"""Keys of a joint of a mechanism beside ``friction``."""


class Friction(NamedTuple):
    """Friction of a joint of a mechanism; None where a part is not stated.

    ``coefficient`` and ``static`` of Coulomb's law, ``radius`` [m] of a pin, ``stribeck_speed`` and
    ``regularisation_speed`` [m/s].

    Examples
    --------
    >>> from chaosgym.machines.friction_law import Friction
    >>> Friction(0.1, None, 0.2, 0.05, 0.001).at(np.array([-2.0, 0.0005, 0.05])).round(4)
    array([-0.1   ,  0.1   ,  0.1368])
    """

    coefficient: float
    radius: float | None = None
    static: float | None = None
    stribeck_speed: float | None = None
    regularisation_speed: float | None = None

    @property
    def lever(self) -> float:
        """Radius [m] of a pin, whose turning is told; 1 of surfaces whose sliding is."""
        return 1.0 if self.radius is None else self.radius

    @property
    def acts(self) -> bool:
        """Whether there is any."""
        return max(self.coefficient, self.static or 0.0) > 0.0

    @property
    def is_steady(self) -> bool:
        """Whether its coefficients over a revolution are the same at any speed of the drive."""
        return self.static is None and self.regularisation_speed is None

    def at(self, speed: Array) -> Array:
        """Coefficients at sliding speeds (..., B) [m/s] of a revolution, with the sign of the speed."""
        fades = self.regularisation_speed or max(RAMP * float(np.abs(speed).max()), 1e-300)
        signed = np.clip(speed / fades, -1.0, 1.0)
        if self.static is None or self.stribeck_speed is None:
            return np.asarray(self.coefficient * signed)
        fallen = matrices.exp(-((speed / self.stribeck_speed) ** 2))
        return np.asarray((self.coefficient + (self.static - self.coefficient) * fallen) * signed)


def friction_of(where: str, row: Mapping[str, Any]) -> Friction | None:
    """Friction that a joint of a mechanism's file states, if any.

    Raises
    ------
    ParameterError
        If a key does not go with the others, or a value is out of range.
    """
    stated = {key: float(row[key]) for key in FRICTION_FIELDS if key in row}
    for key, needs in (
        *((key, "friction") for key in ("static_friction", "stribeck_speed", "regularisation_speed")),
        ("static_friction", "stribeck_speed"),
        ("stribeck_speed", "static_friction"),
    ):
        if key in stated and needs not in stated:
            raise ParameterError(f"joint {where}.{key} needs {needs}; allowed: both, or neither")
    for key, value in stated.items():
        about = FRICTION_FIELDS[key]
        number(f"{where}_{key}", value, about["low"], about["high"], about["unit"].strip("-"))
    if stated.get("static_friction", math.inf) < stated.get("friction", 0.0):
        raise ParameterError(
            f"{where}_static_friction = {stated['static_friction']:g} is out of range; allowed: "
            f"{stated['friction']:g}, its friction, to 1"
        )
    return Friction(*(stated.get(key) for key in FRICTION_FIELDS)) if stated else None  # type: ignore[arg-type]


def with_friction(joint: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return the stated values of a joint, its tangential spring as a factor of the stop's.

    Raises
    ------
    ParameterError
        If something has no meaning without friction, friction has no direction or the stop's, or the spring is not
        above 0.

    Examples
    --------
    >>> from chaosgym.machines.friction_law import with_friction
    >>> stated = {"stiffness": 2e6, "friction": 0.1, "tangent": "side", "tangential_stiffness": 1e6}
    >>> with_friction(stated, "joint")["tangential_factor"]
    0.5
    """
    for key, needs in (
        ("slides", "friction"),
        ("tangent", "friction"),
        ("tangential_stiffness", "tangent"),
        ("sliding_speed", "tangent"),
    ):
        if key in joint and needs not in joint:
            raise ParameterError(f"{name}.{key} has no meaning without {name}.{needs}; leave it out")
    if "friction" in joint and not {"slides", "tangent"} & set(joint):
        raise ParameterError(
            f"{name}.friction needs {name}.tangent, the point that moves along the surfaces (or {name}.slides, where "
            "they slide past one way all the time)"
        )
    across = ("", str(joint.get("at", "")).strip("+- "))
    if "tangent" in joint and joint["tangent"].strip("+- ") in across:
        raise ParameterError(
            f"{name}.tangent = {joint['tangent']!r} is no point that moves along the surfaces; allowed: another one "
            f"than {name}.at, which moves across them"
        )
    found = dict(joint)
    if "tangential_stiffness" in found:
        spring = number(f"{name}.tangential_stiffness", found.pop("tangential_stiffness"), 0.0, inside=True)
        (stiffness,) = needed(name, joint, "stiffness")
        found["tangential_factor"] = spring / stiffness if stiffness > 0.0 else math.inf
    return found
