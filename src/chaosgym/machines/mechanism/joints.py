"""Joints of a planar mechanism: which relative motions of two links they hold, or leave as a gap."""

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

    @property
    def rows(self) -> tuple[str, ...]:
        """Motions that it holds or opens."""
        return KINDS[self.kind]

    @property
    def measured_in(self) -> str:
        """Link in whose axes along and across are measured."""
        return self.frame or (self.second[0] if self.kind == "revolute" else self.first[0])
