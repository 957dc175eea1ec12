"""The gap of a joint: its size and its surfaces, the fields that a machine has of them, and what it lets move."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from chaosgym.errors import ParameterError
from chaosgym.machines.mechanism.joints import ACROSS, ALONG, PITCH, SIDEWAYS, TURN, YAW

ROUND = ("revolute", "cylindrical", "spherical")
"""Joints whose gap is a circle or a ball."""

CLEARANCE_FIELDS: Mapping[str, dict[str, Any]] = {
    "clearance": {"unit": "m", "low": 0.0, "high": 1.0},
    "stiffness": {"unit": "N/m", "low": 1.0, "high": 1e13},
    "damping": {"unit": "N s/m", "low": 0.0, "high": 1e9},
    "hertz_stiffness": {"unit": "N/m^1.5", "low": 1.0, "high": 1e16},
    "hertz_damping": {"unit": "s/m", "low": 0.0, "high": 1e3},
    "friction": {"unit": "-", "low": 0.0, "high": 0.5},
    "radius": {"unit": "m", "low": 0.0, "high": 10.0},
}


def surface_fields(hertz: bool) -> tuple[str, str, str]:
    """Fields of clearance, stiffness and damping of a joint, without its name."""
    law = "hertz_" if hertz else ""
    return "clearance", f"{law}stiffness", f"{law}damping"


class Clearance(NamedTuple):
    """The gap of a joint.

    Attributes
    ----------
    gap
        Half of it, or how far a pin may leave the middle of its hole [m].
    stiffness, damping
        Spring [N/m] and damper [N s/m] of a surface; of each station.
    stations
        Places [m] along a guide from the joint's point at which it can touch; none where it can't tilt.
    friction
        Coulomb coefficient along the guide or slot, or around the pin; None for a joint without.
    hertz
        True for Hertzian surfaces, whose stiffness is K [N/m^1.5] and whose damping is chi [s/m]; see ``Contact``.
    radius
        Of a pin with friction [m].
    """

    gap: float
    stiffness: float
    damping: float
    stations: tuple[float, ...] = ()
    friction: float | None = None
    hertz: bool = False
    radius: float | None = None

    @property
    def fields(self) -> Mapping[str, tuple[float, dict[str, Any]]]:
        """Value and description of the machine's fields, without the joint's name."""
        named = dict(zip(surface_fields(self.hertz), (self.gap, self.stiffness, self.damping), strict=True))
        if self.friction is not None:
            named["friction"] = self.friction
        if self.radius is not None:
            named["radius"] = self.radius
        return {name: (value, CLEARANCE_FIELDS[name]) for name, value in named.items()}


def opened_by(kind: str, clearance: Clearance, spatial: bool = False) -> tuple[str, ...]:
    """Motions that the clearance of a joint of some kind leaves open, in the plane or in space.

    Raises
    ------
    ParameterError
        If such a joint has no gap, or its clearance no stations.
    """
    if kind in ("weld", "universal"):
        allowed = "revolute, cylindrical, spherical or prismatic" if spatial else "revolute, prismatic or slot"
        raise ParameterError(f"a {kind} joint has no clearance; allowed: {allowed}")
    pin = clearance.friction is not None and kind in ROUND
    if pin and spatial:
        raise ParameterError("friction of a pin in its hole is modelled in the plane; allowed: in a prismatic joint")
    if clearance.radius is not None and kind not in ROUND:
        raise ParameterError(f"radius has no meaning in a {kind} joint; leave it out")
    if pin != (clearance.radius is not None):
        raise ParameterError("friction of a pin needs its radius, and a radius has no other meaning; allowed: both")
    if clearance.stations and kind != "prismatic":
        raise ParameterError(f"stations have no meaning in a {kind} joint; leave them out")
    if kind == "spherical":
        return (ALONG, ACROSS, SIDEWAYS)
    if spatial:
        return (ACROSS, SIDEWAYS, YAW, PITCH) if clearance.stations else (ACROSS, SIDEWAYS)
    if kind == "revolute":
        return (ALONG, ACROSS)
    return (ACROSS, TURN) if clearance.stations else (ACROSS,)
