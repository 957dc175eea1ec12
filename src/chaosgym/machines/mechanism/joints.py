"""Joints of a mechanism: which relative motions of two links they hold, and the gap where they leave one open."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from chaosgym.core.binned.model import HERTZ, LINEAR
from chaosgym.errors import ParameterError
from chaosgym.machines.loads import Cycle

ALONG, ACROSS, TURN = "along", "across", "turn"
"""Motions of the second link's point from the first one's: along the joint's axis, across it, and the turn."""

KINDS = {
    "revolute": (ALONG, ACROSS),
    "prismatic": (ACROSS, TURN),
    "slot": (ACROSS,),
    "weld": (ALONG, ACROSS, TURN),
    "gear": (TURN,),
    "belt": (TURN,),
}
"""Motions that a joint of each kind holds; of a gear or belt it is the path [m] of two pitch circles."""

FREE = {"revolute": TURN, "prismatic": ALONG}
"""Motion that a joint of some kinds leaves free, and that may be prescribed."""

MESH = {"gear": 1.0, "belt": -1.0}
"""Sign of the first link's turn where the second one's counts as positive: gears turn against each other."""

SIDEWAYS, ROLL, YAW, PITCH, SKEW = "sideways", "roll", "yaw", "pitch", "skew"
"""Motions in space: across along and across; turns about along, across and sideways; how far two axes are from
crossing at a right angle."""

PLACES = {ALONG: 0, ACROSS: 1, SIDEWAYS: 2}
"""Motions of the point, and the axis of the joint along which each goes."""

SPATIAL_KINDS = {
    "revolute": (ALONG, ACROSS, SIDEWAYS, YAW, PITCH),
    "prismatic": (ACROSS, SIDEWAYS, ROLL, YAW, PITCH),
    "cylindrical": (ACROSS, SIDEWAYS, YAW, PITCH),
    "universal": (ALONG, ACROSS, SIDEWAYS, SKEW),
    "spherical": (ALONG, ACROSS, SIDEWAYS),
    "weld": (ALONG, ACROSS, SIDEWAYS, ROLL, YAW, PITCH),
}
"""Motions that a joint of each kind holds in space."""

GROUND = "ground"
"""Link that stands still."""


class LinkJoint(NamedTuple):
    """A joint between a point of one link and a point of another.

    Attributes
    ----------
    name
        Begins the names of its gap's coordinates.
    kind
        One of ``KINDS``.
    first, second
        Link and point of either side.
    axis
        Angle [rad] of the joint's axis in the frame.
    frame
        Link with whose axes the joint's axis turns; empty for the second link of a revolute joint and else the first.
    opened
        Motions that are a gap: coordinates of the small motion.
    driven
        True for the one revolute joint whose turn is the crank angle.
    turn
        Angle [rad] of the second link from the first one, where the joint holds it.
    first_axis, second_axis
        The joint's axis in axes of the first and of the second link, of a joint in space; empty in the plane.
    moves
        The motion that it leaves free, over the crank angle [m] or [rad], where it is prescribed.
    radii
        Of the pitch circles on the first and on the second link [m], of a gear or belt.
    carrier
        Link on which the axes of a gear or belt lie.
    """

    name: str
    kind: str
    first: tuple[str, str]
    second: tuple[str, str]
    axis: float = 0.0
    frame: str = ""
    opened: tuple[str, ...] = ()
    driven: bool = False
    turn: float = 0.0
    first_axis: tuple[float, ...] = ()
    second_axis: tuple[float, ...] = ()
    moves: Cycle | None = None
    radii: tuple[float, ...] = ()
    carrier: str = GROUND

    @property
    def rows(self) -> tuple[str, ...]:
        """Motions that it holds, prescribes or opens."""
        held = (SPATIAL_KINDS if self.first_axis else KINDS)[self.kind]
        return held if self.moves is None else (FREE[self.kind], *held)

    @property
    def gap(self) -> str:
        """The motion in its gap that is shown."""
        return TURN if self.radii else ACROSS

    @property
    def measured_in(self) -> str:
        """Link in whose axes along and across are measured."""
        return self.frame or (self.second[0] if self.kind in ("revolute", "spherical") else self.first[0])


class Row(NamedTuple):
    """A motion that a joint holds, or opens to a gap."""

    joint: LinkJoint
    motion: str

    @property
    def opened(self) -> bool:
        """True for a gap."""
        return self.motion in self.joint.opened

    def __str__(self) -> str:
        return f"{self.joint.name} {self.motion}"


ROUND = ("revolute", "cylindrical", "spherical")
"""Joints whose gap is a circle or a ball."""

CLEARANCE_FIELDS: Mapping[str, dict[str, Any]] = {
    "clearance": {"unit": "m", "low": 0.0, "high": 1.0},
    "stiffness": {"unit": "N/m", "low": 1.0, "high": 1e13},
    "damping": {"unit": "N s/m", "low": 0.0, "high": 1e9},
    "hertz_stiffness": {"unit": "N/m^1.5", "low": 1e-3, "high": 1e18},
    "hertz_damping": {"unit": "s/m", "low": 0.0, "high": 1e6},
}


def surface_fields(exponent: float) -> tuple[str, str, str]:
    """Fields of clearance, stiffness and damping of a joint, without its name, by the exponent of its law."""
    law = "hertz_" if exponent else ""
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
    exponent
        n of Hertzian surfaces, whose stiffness is K [N/m^n] and whose damping is chi [s/m]; LINEAR else.
    """

    gap: float
    stiffness: float
    damping: float
    stations: tuple[float, ...] = ()
    exponent: float = LINEAR

    @property
    def fields(self) -> Mapping[str, tuple[float, dict[str, Any]]]:
        """Value and description of the machine's fields, without the joint's name."""
        named = dict(zip(surface_fields(self.exponent), (self.gap, self.stiffness, self.damping), strict=True))
        found = {name: (value, CLEARANCE_FIELDS[name]) for name, value in named.items()}
        if self.exponent not in (LINEAR, HERTZ):
            about = {**CLEARANCE_FIELDS["hertz_stiffness"], "unit": f"N/m^{self.exponent:g}"}
            found["hertz_stiffness"] = self.stiffness, about
        return found


def opened_by(kind: str, clearance: Clearance, spatial: bool = False) -> tuple[str, ...]:
    """Motions that the clearance of a joint of some kind leaves open, in the plane or in space.

    Raises
    ------
    ParameterError
        If such a joint has no gap, or its clearance no stations.
    """
    if kind in MESH:
        if clearance.stations:
            raise ParameterError(f"stations have no meaning in a {kind} joint; leave them out")
        if kind == "belt":
            raise ParameterError("a belt has no clearance; allowed: a gear")
        return (TURN,)
    if kind in ("weld", "universal"):
        allowed = "revolute, cylindrical, spherical or prismatic" if spatial else "revolute, prismatic or slot"
        raise ParameterError(f"a {kind} joint has no clearance; allowed: {allowed}")
    if clearance.stations and kind != "prismatic":
        raise ParameterError(f"stations have no meaning in a {kind} joint; leave them out")
    if kind == "spherical":
        return (ALONG, ACROSS, SIDEWAYS)
    if spatial:
        return (ACROSS, SIDEWAYS, YAW, PITCH) if clearance.stations else (ACROSS, SIDEWAYS)
    if kind == "revolute":
        return (ALONG, ACROSS)
    return (ACROSS, TURN) if clearance.stations else (ACROSS,)
