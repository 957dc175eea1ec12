"""Friction of a joint that sticks and slides: its fields, and what a file may state of it."""

import math
from collections.abc import Mapping
from typing import Any

from chaosgym.errors import ParameterError
from chaosgym.machines.file_keys import needed
from chaosgym.machines.parameters import Parameter

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


def with_friction(joint: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return the stated values of a joint, its tangential spring as a factor of the stop's.

    Raises
    ------
    ParameterError
        If something has no meaning without friction, friction has no direction or the stop's, or the spring is not
        above 0.

    Examples
    --------
    >>> from chaosgym.machines.modal_machine.friction import with_friction
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
        spring = found.pop("tangential_stiffness")
        if not spring > 0.0:
            raise ParameterError(f"{name}.tangential_stiffness = {spring:g} is out of range; allowed: above 0")
        (stiffness,) = needed(name, joint, "stiffness")
        found["tangential_factor"] = spring / stiffness if stiffness > 0.0 else math.inf
    return found
