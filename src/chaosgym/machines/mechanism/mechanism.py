"""A planar mechanism: links, joints, and what pulls at them; its functions of all links' coordinates.

    driver      turn of the crank - theta = 0
    ideal       c(z) = 0        what a joint holds
    clearance   c(z) = p        what a joint leaves open: the gap itself is a coordinate
    elastic     q = p           likewise

There are as many functions as coordinates z, so that A = dc/dz is square. The columns of its inverse that belong to p
are the compatibility matrix of the thesis (2.3): dz = B dp.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.core.matrices import product
from chaosgym.errors import ParameterError
from chaosgym.machines.loads import Cycle
from chaosgym.machines.mechanism.forces import Force, Spring, TorsionSpring
from chaosgym.machines.mechanism.joints import ACROSS, ALONG, FREE, GROUND, MESH, TURN, LinkJoint, Row
from chaosgym.machines.mechanism.links import Link, LinkPlaces, fixed, quarter_after, rotation


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
    forces, springs, torsion
        What else pulls and, in the plane, turns.

    Raises
    ------
    ParameterError
        If no joint or more than one is driven, a point is unknown, or the mobility is not one; names it.
    """

    links: tuple[Link, ...]
    joints: tuple[LinkJoint, ...]
    ground: Mapping[str, tuple[float, ...]]
    gravity: tuple[float, ...] = (0.0, 0.0)
    forces: tuple[Force, ...] = ()
    springs: tuple[Spring, ...] = ()
    torsion: tuple[TorsionSpring, ...] = ()
    dimensions: ClassVar[int] = 2
    motions_of_a_link: ClassVar[int] = 3
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
        if len(drivers) != 1 and (drivers or not any(joint.moves for joint in self.joints)):
            which = ", ".join(joint.name for joint in drivers) or "none"
            raise ParameterError(f"{len(drivers)} joints are driven ({which}); allowed: one")
        if drivers and drivers[0].kind != "revolute":
            raise ParameterError(
                f"joint {drivers[0].name} is driven and {drivers[0].kind}; allowed: revolute, or a [[motion]] of it"
            )
        for joint in self.joints:
            self._check(joint)
        self._count()

    def _check(self, joint: LinkJoint) -> None:
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
        mobility = self.motions_of_a_link * len(self.links) - sum(held.values())
        if mobility != self.lead:
            listed = ", ".join(f"{name} {rows}" for name, rows in held.items())
            raise ParameterError(
                f"the mechanism has mobility {mobility}: {len(self.links)} links with {self.motions_of_a_link} "
                f"motions each, less what the joints hold ({listed}); allowed: {self.lead}{self._idle_spins()}"
            )

    def _idle_spins(self) -> str:
        """What to do about links that turn about the line between two spherical joints, which nothing holds."""
        told = ""
        for link in self.links:
            held = [joint for joint in self.joints if link.name in (joint.first[0], joint.second[0])]
            if [joint.kind for joint in held] == ["spherical"] * 2:
                first, second = (joint.name for joint in held)
                told += (
                    f". Nothing holds the spin of {link.name} about the line from {first} to {second}: "
                    'give one of them kind = "universal"'
                )
        return told

    @cached_property
    def size(self) -> int:
        """Number of coordinates of all links."""
        return sum(link.size for link in self.links)

    @property
    def driver(self) -> LinkJoint:
        """The driven joint, or the first one whose motion is prescribed."""
        return next(
            (joint for joint in self.joints if joint.driven), next(j for j in self.joints if j.driven or j.moves)
        )

    @property
    def lead(self) -> int:
        """How many functions of the driven joint stand before ``rows``: 1, or 0 where none is driven."""
        return sum(joint.driven for joint in self.joints)

    @cached_property
    def prescribed(self) -> tuple[tuple[int, Cycle], ...]:
        """Which functions are a motion over the crank angle, and that motion."""
        rows = enumerate(self.rows(), self.lead)
        return tuple((k, row.joint.moves) for k, row in rows if row.joint.moves and row.motion == FREE[row.joint.kind])

    def pace(self, theta: Array) -> Array:
        """Derivatives (B, z) of the functions' values by the crank angle, at crank angles (B,)."""
        found = np.zeros((len(theta), self.size))
        found[:, : self.lead] = 1.0
        for k, cycle in self.prescribed:
            found[:, k] = cycle.slope(theta)
        return found

    def led(self, inverse: Array, theta: Array) -> Array:
        """Derivatives (B, z) of the coordinates by the crank angle, of the inverse (B, z, z) of A."""
        if not self.prescribed:
            return np.asarray(inverse[:, :, 0])
        return np.asarray(product(inverse, self.pace(theta)[:, :, None])[:, :, 0])

    def spin(self, name: str) -> int:
        """The coordinate of a link in which it may turn right round."""
        return int(self.at[name].start + self.dimensions)

    def moved(self, z: Array, step: Array) -> Array:
        """Coordinates after a small step of them all, (B, z)."""
        return z + step

    def rates(self, z: Array, rate: Array) -> Array:
        """Rates of the coordinates at z, from those of small steps, (B, z)."""
        return rate

    def refuse_turned_over(self, z: Array) -> None:
        """Refuse coordinates (1, z) in which a link has turned by half a turn about an axis that allows no more."""

    def link(self, name: str) -> Link:
        """Link of a name."""
        return next(link for link in self.links if link.name == name)

    def rows(self) -> list[Row]:
        """What the joints hold, then the gaps."""
        every = [Row(joint, motion) for joint in self.joints for motion in joint.rows]
        return [row for row in every if not row.opened] + [row for row in every if row.opened]

    @cached_property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates p of the small motion: gaps, then what bends."""
        gaps = [str(row) for row in self.rows() if row.opened]
        return (*gaps, *(f"{link.name} {name}" for link in self.links for name in link.elastic))

    @cached_property
    def elastic(self) -> NDArray[np.int64]:
        """Columns (e,) of the elastic coordinates of all links."""
        every = [np.arange(self.at[link.name].start + link.rigid, self.at[link.name].stop) for link in self.links]
        return np.concatenate(every).astype(np.int64)

    @cached_property
    def rigid(self) -> NDArray[np.int64]:
        """Columns of places and turns of all links."""
        return np.delete(np.arange(self.size), self.elastic)

    def places(self, end: tuple[str, str]) -> LinkPlaces:
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
        return self._still(point) if name == GROUND else self.link(name).points[point]

    def _still(self, point: str) -> LinkPlaces:
        """A point of the ground."""
        return fixed(np.array(self.ground[point]))

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

    def turn_of(self, end: tuple[str, str]) -> Array:
        """Derivatives (z,) of the turn of a link, at a point, by all coordinates: in the plane they are constant."""
        slope = np.zeros(self.size)
        if end[0] != GROUND:
            own = self.at[end[0]]
            slope[own.start + 2] = 1.0
            slope[own.start + 3 : own.stop] = self.places(end).slope[0]
        return slope

    def axes(self, z: Array, joint: LinkJoint) -> Array:
        """Axes (B, 2, 2) along which the point of a joint is measured, in columns."""
        frame = joint.measured_in
        angle = np.zeros(len(z)) if frame == GROUND else z[:, self.at[frame].start + 2]
        return rotation(angle + joint.axis)

    @cached_property
    def _ends(self) -> "_Ends":
        return _ends_of(self)

    def along(self, z: Array, joint: LinkJoint) -> tuple[Array, Array]:
        """How far [m] the second point lies along a joint's axis, (B,), and its derivatives (B, z)."""
        which = self.joints.index(joint)
        value, slope = self.motions(z)
        return value[:, which, 0], slope[:, which, 0]

    def motions(self, z: Array) -> tuple[Array, Array]:
        """Value (B, J, 3) and derivatives (B, J, 3, z) of every joint: along, across and turn, held or not."""
        ends = self._ends
        base = z[:, ends.base] * ends.moves
        turn = rotation(base[:, :, 2])
        apart, gradient = np.zeros((len(z), len(ends.turn), 2)), np.tile(ends.shift, (len(z), 1, 1, 1))
        which = np.arange(len(ends.turn))
        for sign, link, place, shape in zip((-1.0, 1.0), ends.link, ends.place, ends.shape, strict=True):
            own = turn[:, link]
            apart += sign * (base[:, link, :2] + product(own, place[..., None])[..., 0])
            gradient[..., : self.size] += sign * product(own, shape)
            gradient[:, which, :, ends.spin[link]] += (
                sign * np.swapaxes(product(quarter_after(own), place[..., None]), 0, 1)[..., 0]
            )
        axes = product(turn[:, ends.frame], ends.axes)
        value, slope = np.empty((*apart.shape[:2], 3)), np.empty((*apart.shape[:2], 3, self.size + 1))
        back = np.swapaxes(axes, -1, -2)
        value[..., :2], slope[..., :2, :] = product(back, apart[..., None])[..., 0], product(back, gradient)
        across = product(np.swapaxes(quarter_after(axes), -1, -2), apart[..., None])
        slope[:, which, :2, ends.spin[ends.frame]] += np.swapaxes(across, 0, 1)[..., 0]
        value[..., 2], slope[..., 2, : self.size] = product(z, ends.slope.T) - ends.turn, ends.slope
        return value, slope[..., : self.size]

    def functions(self, z: Array, theta: Array) -> tuple[Array, Array]:
        """Functions c (B, z) of coordinates (B, z) at crank angles (B,), and A = dc/dz (B, z, z).

        The driver is first, then come ``rows`` and the elastic coordinates.
        """
        ends, (every, slopes) = self._ends, self.motions(z)
        count = len(ends.picked)
        value, slope = np.empty_like(z), np.empty((len(z), self.size, self.size))
        value[:, :count] = every.reshape(len(z), -1)[:, ends.picked]
        if self.lead:
            value[:, 0] -= theta
        for k, cycle in self.prescribed:
            value[:, k] -= cycle.at(theta)
        slope[:, :count] = slopes.reshape(len(z), -1, self.size)[:, ends.picked]
        value[:, count:], slope[:, count:] = z[:, self.elastic], np.eye(self.size)[self.elastic]
        return value, slope

    def add_bent_rows(self, z: Array, forces: Array, total: Array) -> None:
        """Add the second derivatives of the functions times forces (..., B, z) to ``total`` (..., B, z, z)."""
        rows = self.rows()
        for joint in self.joints:
            pulled = np.zeros((*forces.shape[:-1], 2))
            for k, row in enumerate(rows, self.lead):
                if row.joint is joint and row.motion != TURN:
                    pulled[..., (ALONG, ACROSS).index(row.motion)] += forces[..., k]
            turn, frame = self.axes(z, joint), joint.measured_in
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


class _Ends(NamedTuple):
    """Both ends of J joints as arrays; the ground is the last of the links, and stands still.

    ``base`` (links + 1, 3) columns of the places and turns of the links in z, times ``moves`` (links + 1, 1); ``spin``
    (links + 1,) column of the turn, that of the ground behind all; of first and second ends ``link`` (2, J), ``place``
    (2, J, 2) and ``shape`` (2, J, 2, z); ``shift`` (J, 2, z + 1) derivatives by places of links; ``frame`` (J,) link of
    the axes and ``axes`` (J, 2, 2) in it; ``turn`` (J,) and its derivatives ``slope`` (J, z); ``picked`` rows of all
    motions that are functions.
    """

    base: NDArray[np.int64]
    moves: Array
    spin: NDArray[np.int64]
    link: NDArray[np.int64]
    place: Array
    shape: Array
    shift: Array
    frame: NDArray[np.int64]
    axes: Array
    turn: Array
    slope: Array
    picked: NDArray[np.int64]


def _mesh(mechanism: Mechanism, joint: LinkJoint) -> Array:
    """Path [m] of one pitch circle on the other, by all coordinates (z,)."""
    first, second = joint.radii
    first *= MESH[joint.kind]
    turns = [mechanism.turn_of(end) for end in (joint.first, joint.second)]
    path = first * turns[0] + second * turns[1]
    if joint.carrier != GROUND:
        path[mechanism.at[joint.carrier].start + 2] -= first + second
    return np.asarray(path)


def _ends_of(mechanism: Mechanism) -> _Ends:
    joints, size = mechanism.joints, mechanism.size
    names = [*mechanism.at, GROUND]
    starts = np.array([own.start for own in mechanism.at.values()])
    link = np.array([[names.index(end[0]) for end in (joint.first, joint.second)] for joint in joints]).T
    place, shape = np.zeros((2, len(joints), 2)), np.zeros((2, len(joints), 2, size))
    shift, slope = np.zeros((len(joints), 2, size + 1)), np.zeros((len(joints), size))
    for j, joint in enumerate(joints):
        for side, (end, sign) in enumerate(((joint.first, -1.0), (joint.second, 1.0))):
            places = mechanism.places(end)
            place[side, j] = places.place[0]
            if end[0] == GROUND:
                continue
            own = mechanism.at[end[0]]
            shape[side, j, :, own.start + 3 : own.stop] = places.shape[0]
            shift[j, [0, 1], [own.start, own.start + 1]] += sign
            slope[j, own.start + 2] += sign
            slope[j, own.start + 3 : own.stop] += sign * places.slope[0]
        if joint.radii:
            slope[j] = _mesh(mechanism, joint)
    numbers = {joint.name: 3 * j for j, joint in enumerate(joints)}
    motions = (ALONG, ACROSS, TURN)
    picked = [numbers[mechanism.driver.name] + 2] * mechanism.lead
    picked += [numbers[row.joint.name] + motions.index(row.motion) for row in mechanism.rows()]
    # teeth mesh where links stand as stated at crank angle 0; the crank itself stands at 0
    stated = np.zeros(size)
    for each in mechanism.links:
        stated[mechanism.spin(each.name)] = each.angle
    for joint in joints:
        if joint.driven and joint.second[0] != GROUND:
            stated[mechanism.spin(joint.second[0])] = 0.0
    moving = np.append(np.ones(len(starts)), 0.0)
    return _Ends(
        base=np.append(starts, 0)[:, None] + np.arange(3),
        moves=moving[:, None],
        spin=np.append(starts + 2, size),
        link=link,
        place=place,
        shape=shape,
        shift=shift,
        frame=np.array([names.index(joint.measured_in) for joint in joints]),
        axes=rotation(np.array([joint.axis for joint in joints])),
        turn=np.array(
            [joint.turn if not joint.radii else product(row, stated) for joint, row in zip(joints, slope, strict=True)]
        ),
        slope=slope,
        picked=np.array(picked),
    )
