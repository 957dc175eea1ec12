"""Joints of a mechanism: which relative motions of two links they hold, or leave as a gap."""

from typing import NamedTuple

ALONG, ACROSS, TURN = "along", "across", "turn"
"""Motions of the second link's point from the first one's: along the joint's axis, across it, and the turn."""

KINDS = {
    "revolute": (ALONG, ACROSS),
    "prismatic": (ACROSS, TURN),
    "slot": (ACROSS,),
    "weld": (ALONG, ACROSS, TURN),
}
"""Motions that a joint of each kind holds."""

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


class Joint(NamedTuple):
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

    @property
    def rows(self) -> tuple[str, ...]:
        """Motions that it holds or opens."""
        return (SPATIAL_KINDS if self.first_axis else KINDS)[self.kind]

    @property
    def measured_in(self) -> str:
        """Link in whose axes along and across are measured."""
        return self.frame or (self.second[0] if self.kind in ("revolute", "spherical") else self.first[0])


class Row(NamedTuple):
    """A motion that a joint holds, or opens to a gap."""

    joint: Joint
    motion: str

    @property
    def opened(self) -> bool:
        """True for a gap."""
        return self.motion in self.joint.opened

    def __str__(self) -> str:
        return f"{self.joint.name} {self.motion}"
