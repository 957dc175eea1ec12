"""A planar mechanism: links, joints, and what pulls at them; its functions of all links' coordinates.

    driver      turn of the crank - theta = 0
    ideal       c(z) = 0        what a joint holds
    clearance   c(z) = p        what a joint leaves open: the gap itself is a coordinate
    elastic     q = p           likewise

There are as many functions as coordinates z, so that A = dc/dz is square. The columns of its inverse that belong to p
are the compatibility matrix of the thesis (2.3): dz = B dp.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.errors import ParameterError
from chaosgym.machines.mechanism.joints import ACROSS, ALONG, GROUND, TURN, Joint
from chaosgym.machines.mechanism.links import Link, Places, fixed, quarter_after, rotation

Array = NDArray[np.float64]


class Force(NamedTuple):
    """A force on a point of a link: ``at`` gives it in ground axes, (B, 2) [N], at crank angles (B,) [rad]."""

    point: tuple[str, str]
    at: Callable[[Array], Array]


class Spring(NamedTuple):
    """A spring and damper between two points: stiffness [N/m], free length [m], damping [N s/m]."""

    first: tuple[str, str]
    second: tuple[str, str]
    stiffness: float
    free_length: float
    damping: float = 0.0


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


@dataclass(frozen=True, eq=False)
class Mechanism:
    """Links and joints with mobility one, whose drive turns a revolute joint.

    Attributes
    ----------
    links, joints
        In any order.
    ground
        Points of the ground [m].
    gravity
        Acceleration [m/s^2].
    forces, springs
        What else pulls.

    Raises
    ------
    ParameterError
        If no joint or more than one is driven, a point is unknown, or the mobility is not one; names it.
    """

    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    ground: Mapping[str, tuple[float, float]]
    gravity: tuple[float, float] = (0.0, 0.0)
    forces: tuple[Force, ...] = ()
    springs: tuple[Spring, ...] = ()
    at: Mapping[str, slice] = field(init=False, repr=False)
    """Coordinates of each link among all."""

    def __post_init__(self) -> None:
        at, start = {}, 0
        for link in self.links:
            if link.name in at or link.name == GROUND:
                raise ParameterError(f"two links have the name {link.name!r}; allowed: a name of its own for each")
            at[link.name] = slice(start, start + link.size)
            start += link.size
        object.__setattr__(self, "at", at)
        drivers = [joint for joint in self.joints if joint.driven]
        if len(drivers) != 1:
            which = ", ".join(joint.name for joint in drivers) or "none"
            raise ParameterError(f"{len(drivers)} joints are driven ({which}); allowed: one")
        if drivers[0].kind != "revolute":
            raise ParameterError(f"joint {drivers[0].name} is driven and {drivers[0].kind}; allowed: revolute")
        for joint in self.joints:
            self._check(joint)
        self._count()

    def _check(self, joint: Joint) -> None:
        for end in (joint.first, joint.second):
            self.places(end)
        if joint.measured_in not in (*self.at, GROUND):
            raise ParameterError(f"joint {joint.name}: no link is named {joint.frame!r}; known: {self._names()}")
        if joint.first[0] == joint.second[0]:
            raise ParameterError(f"joint {joint.name} joins {joint.first[0]} to itself; allowed: two links")

    def _names(self) -> str:
        return ", ".join([*self.at, GROUND])

    def _count(self) -> None:
        """Refuse what does not have mobility one."""
        held = {joint.name: len(joint.rows) for joint in self.joints}
        mobility = 3 * len(self.links) - sum(held.values())
        if mobility != 1:
            listed = ", ".join(f"{name} {rows}" for name, rows in held.items())
            raise ParameterError(
                f"the mechanism has mobility {mobility}: {len(self.links)} links with 3 motions each, less what the "
                f"joints hold ({listed}); allowed: 1"
            )

    @property
    def size(self) -> int:
        """Number of coordinates of all links."""
        return sum(link.size for link in self.links)

    @property
    def driver(self) -> Joint:
        """The driven joint."""
        return next(joint for joint in self.joints if joint.driven)

    def link(self, name: str) -> Link:
        """Link of a name."""
        return next(link for link in self.links if link.name == name)

    def rows(self) -> list[Row]:
        """What the joints hold, then the gaps."""
        every = [Row(joint, motion) for joint in self.joints for motion in joint.rows]
        return [row for row in every if not row.opened] + [row for row in every if row.opened]

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates p of the small motion: gaps, then what bends."""
        gaps = [str(row) for row in self.rows() if row.opened]
        return (*gaps, *(f"{link.name} {name}" for link in self.links for name in link.elastic))

    def places(self, end: tuple[str, str]) -> Places:
        """A point of a link or of the ground.

        Raises
        ------
        ParameterError
            If there is none of that name.
        """
        name, point = end
        known: Mapping[str, object] = self.ground if name == GROUND else {}
        if name in self.at:
            known = self.link(name).points
        elif name != GROUND:
            raise ParameterError(f"no link is named {name!r}; known: {self._names()}")
        if point not in known:
            raise ParameterError(f"{name} has no point {point!r}; known: {', '.join(known) or 'none'}")
        return fixed(np.array(self.ground[point])) if name == GROUND else self.link(name).points[point]

    def point(self, z: Array, end: tuple[str, str]) -> tuple[Array, Array]:
        """Place (B, 2) of a point and its derivatives by all coordinates, (B, 2, z)."""
        places, gradient = self.places(end), np.zeros((len(z), 2, self.size))
        if end[0] == GROUND:
            return np.broadcast_to(places.place[0], (len(z), 2)), gradient
        own = self.at[end[0]]
        gradient[:, :, own] = places.gradient(z[:, own])[:, 0]
        return places.moved(z[:, own])[:, 0], gradient

    def add_bent(self, z: Array, end: tuple[str, str], force: Array, total: Array) -> None:
        """Add the second derivatives of a point times forces (..., B, 2) to ``total`` (..., B, z, z)."""
        if end[0] != GROUND:
            own = self.at[end[0]]
            total[..., own, own] += self.places(end).bent(z[:, own], force[..., None, :])

    def apart(self, z: Array, first: tuple[str, str], second: tuple[str, str]) -> tuple[Array, Array]:
        """Vector (B, 2) from one point to another and its derivatives (B, 2, z)."""
        (a, da), (b, db) = self.point(z, first), self.point(z, second)
        return b - a, db - da

    def _turn_of(self, joint: Joint, z: Array) -> Array:
        """Turn (B, 2, 2) of the joint's axes."""
        frame = joint.measured_in
        angle = np.zeros(len(z)) if frame == GROUND else z[:, self.at[frame].start + 2]
        return rotation(angle + joint.axis)

    def motions(self, z: Array, joint: Joint) -> dict[str, tuple[Array, Array]]:
        """Value (B,) and derivatives (B, z) of each motion of a joint, whether it holds it or not."""
        apart, gradient = self.apart(z, joint.first, joint.second)
        turn, frame = self._turn_of(joint, z), joint.measured_in
        value = np.einsum("bji,bj->bi", turn, apart)
        slope = np.swapaxes(turn, -1, -2) @ gradient
        if frame != GROUND:
            slope[:, :, self.at[frame].start + 2] += np.einsum("bji,bj->bi", quarter_after(turn), apart)
        turned, by = np.full(len(z), -joint.turn), np.zeros((len(z), self.size))
        for end, sign in ((joint.first, -1.0), (joint.second, 1.0)):
            if end[0] != GROUND:
                own = self.at[end[0]]
                by[:, own.start + 2] += sign
                by[:, own.start + 3 : own.stop] += sign * self.places(end).slope[0]
                turned += sign * z[:, own.start + 2]
        return {ALONG: (value[:, 0], slope[:, 0]), ACROSS: (value[:, 1], slope[:, 1]), TURN: (turned, by)}

    def functions(self, z: Array, theta: Array) -> tuple[Array, Array]:
        """Functions c (B, z) of coordinates (B, z) at crank angles (B,), and A = dc/dz (B, z, z).

        The driver is first, then come ``rows`` and the elastic coordinates.
        """
        motions = {joint.name: self.motions(z, joint) for joint in self.joints}
        turned, slope = motions[self.driver.name][TURN]
        rows = [(turned - theta, slope), *(motions[row.joint.name][row.motion] for row in self.rows())]
        unit = np.eye(self.size)
        for link in self.links:
            for at in range(self.at[link.name].start + 3, self.at[link.name].stop):
                rows.append((z[:, at], np.broadcast_to(unit[at], z.shape)))
        return np.stack([row[0] for row in rows], 1), np.stack([row[1] for row in rows], 1)

    def add_bent_rows(self, z: Array, forces: Array, total: Array) -> None:
        """Add the second derivatives of the functions times forces (..., B, z) to ``total`` (..., B, z, z)."""
        rows = self.rows()
        for joint in self.joints:
            pulled = np.zeros((*forces.shape[:-1], 2))
            for k, row in enumerate(rows, 1):
                if row.joint is joint and row.motion != TURN:
                    pulled[..., (ALONG, ACROSS).index(row.motion)] += forces[..., k]
            turn, frame = self._turn_of(joint, z), joint.measured_in
            ground = np.einsum("bij,...bj->...bi", turn, pulled)
            self.add_bent(z, joint.second, ground, total)
            self.add_bent(z, joint.first, -ground, total)
            if frame != GROUND:
                f = self.at[frame].start + 2
                apart, gradient = self.apart(z, joint.first, joint.second)
                across = np.einsum("bij,...bj->...bi", quarter_after(turn), pulled)
                cross = np.einsum("...bi,biz->...bz", across, gradient)
                total[..., f, :] += cross
                total[..., :, f] += cross
                total[..., f, f] -= np.einsum("...bi,bi->...b", ground, apart)
