"""A mechanism in space: its joints as functions of how all links lie, for the same nominal motion and equations.

Every joint has axes in its first link: its own axis first, ``along`` it, and two across it. What a joint holds, or
opens, are the coordinates of the second link's point in these axes, and small turns of the second link's axes.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.errors import ParameterError
from chaosgym.machines.mechanism.joints import ALONG, GROUND, PITCH, PLACES, ROLL, SKEW, YAW, Joint
from chaosgym.machines.mechanism.links import Link
from chaosgym.machines.mechanism.mechanism import Mechanism
from chaosgym.machines.mechanism.space import RIGID, Lie, SpatialPlaces, axes_of, cross, skew

Array = NDArray[np.float64]

TURNS = {ROLL: (1, 2, 1.0), YAW: (0, 2, -1.0), PITCH: (0, 1, 1.0), SKEW: (0, 0, 1.0)}
"""Axis of the second link, that of the first and sign, whose product is a small turn; it is zero in the middle."""

MOST_SWING = 0.97 * np.pi
"""Angle [rad] by which a link may swing about axes across its own."""

STILL = Lie(np.eye(3), np.eye(3))


class _Ends(NamedTuple):
    """Axes of a joint in its first and its second link, in columns, and those in which its point is measured."""

    first: Array
    second: Array
    frame: Array


def _axes(axis: tuple[float, ...]) -> Array:
    """Axes in columns: the joint's own, across it as near to y as may be (else to z), and sideways."""
    own = np.array(axis)
    unit = own / np.linalg.norm(own)
    wanted = np.eye(3)[1] if abs(unit[1]) < 0.9 else np.eye(3)[2]
    across, sideways, along = axes_of(unit, wanted).T
    return np.stack([along, across, sideways], axis=1)


@dataclass(frozen=True, eq=False)
class SpatialMechanism(Mechanism):
    """Rigid links in space with mobility one, whose drive turns a revolute joint on the ground; see ``Mechanism``."""

    dimensions: ClassVar[int] = 3
    motions_of_a_link: ClassVar[int] = 6

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.driver.first[0] != GROUND:
            raise ParameterError(
                f"joint {self.driver.name} is driven on {self.driver.first[0]}; allowed in space: on the ground"
            )

    @cached_property
    def _joint_axes(self) -> dict[str, _Ends]:
        found = {}
        for joint in self.joints:
            first, second = _axes(joint.first_axis), _axes(joint.second_axis)
            found[joint.name] = _Ends(first, second, first if joint.measured_in == joint.first[0] else second)
        return found

    @cached_property
    def _lies(self) -> Lie:
        """How all links lie, (links, 3, 3)."""
        lies = [link.masses.lie for link in self.links]
        return Lie(np.stack([lie.before for lie in lies]), np.stack([lie.after for lie in lies]))

    def places(self, end: tuple[str, str]) -> Any:
        """A point of a link or of the ground, ``SpatialPlaces``; see ``Mechanism.places``."""
        return super().places(end)

    def _still(self, point: str) -> Any:
        return SpatialPlaces(np.array([self.ground[point]]), STILL)

    @cached_property
    def _last(self) -> list[tuple[Array, dict[str, Array]]]:
        """Turns of all links at the coordinates that were asked for last: many rows ask for them."""
        return [(np.empty(0), {})]

    def _turn(self, z: Array, name: str) -> Array:
        """Turn (B, 3, 3) of a link, or of the ground."""
        where, turns = self._last[0]
        if where is not z:
            every = self._lies.turn(z.reshape(len(z), -1, RIGID))
            turns = {link: every[:, k] for k, link in enumerate(self.at)}
            turns[GROUND] = np.broadcast_to(np.eye(3), (len(z), 3, 3))
            self._last[0] = (z, turns)
        return turns[name]

    def _arm(self, z: Array, end: tuple[str, str]) -> Array:
        """Vector (B, 3) from the origin of a link to a point."""
        if end not in self._known:
            self._known[end] = self.places(end).place[0]
        return np.asarray(self._turn(z, end[0]) @ self._known[end])

    @cached_property
    def _known(self) -> dict[tuple[str, str], Array]:
        """Points in axes of their links, as far as they were asked for."""
        return {}

    def _spin(self, name: str) -> slice:
        """Columns of the turns of a link."""
        return slice(self.at[name].start + 3, self.at[name].start + 6)

    def moved(self, z: Array, step: Array) -> Array:
        """Coordinates after a step in which links turn about the axes of the world."""
        shape = (len(z), -1, RIGID)
        return self._lies.moved(z.reshape(shape), step.reshape(shape)).reshape(z.shape)

    def rates(self, z: Array, rate: Array) -> Array:
        """Rates of the coordinates from those of places and angular velocities."""
        shape = (len(z), -1, RIGID)
        return self._lies.rates(z.reshape(shape), rate.reshape(shape)).reshape(z.shape)

    def _place(self, z: Array, end: tuple[str, str]) -> Array:
        """Place (B, 3) of a point."""
        if end[0] == GROUND:
            return self._arm(z, end)
        own = self.at[end[0]]
        return z[:, own.start : own.start + 3] + self._arm(z, end)

    def refuse_turned_over(self, z: Array) -> None:
        """Refuse coordinates (1, z) in which a link has turned by half a turn about an axis that allows no more."""
        for name, own in self.at.items():
            if np.linalg.norm(z[0, own.start + 4 : own.stop]) > MOST_SWING:
                raise ParameterError(
                    f"link {name} turns by half a turn about another axis than its own; allowed: axis of "
                    f"[link.{name}], about which it turns right round"
                )

    def point(self, z: Array, end: tuple[str, str]) -> tuple[Array, Array]:
        """Place (B, 3) of a point and its derivatives (B, 3, z) by places and turns about the axes of the world."""
        gradient = np.zeros((len(z), 3, self.size))
        if end[0] != GROUND:
            own = self._spin(end[0])
            gradient[:, :, own.start - 3 : own.start] = np.eye(3)
            gradient[:, :, own] = -skew(self._arm(z, end))
        return self._place(z, end), gradient

    def add_bent(self, z: Array, end: tuple[str, str], force: Array, total: Array) -> None:
        """Add the second derivatives of a point times forces (..., B, 3) to ``total`` (..., B, z, z)."""
        if end[0] != GROUND:
            self._add_turned(end[0], self._arm(z, end), force, total)

    def _add_turned(self, name: str, arm: Array, force: Array, total: Array) -> None:
        """Add the second derivatives of a vector (B, 3) that turns with a link, times forces (..., B, 3)."""
        if name == GROUND:
            return
        product = force[..., :, None] * arm[:, None, :]
        own = self._spin(name)
        total[..., own, own] += 0.5 * (product + np.swapaxes(product, -1, -2))
        total[..., own, own] -= np.einsum("...ii->...", product)[..., None, None] * np.eye(3)

    def add_particles(self, z: Array, link: Link, force: Array, total: Array) -> None:
        """Add the second derivatives of the particles of a link times forces (..., B, k, 3)."""
        arms = link.masses.arms(z[:, self.at[link.name]])
        product = np.einsum("...bki,bkj->...bij", force, arms)
        own = self._spin(link.name)
        total[..., own, own] += 0.5 * (product + np.swapaxes(product, -1, -2))
        total[..., own, own] -= np.einsum("...ii->...", product)[..., None, None] * np.eye(3)

    def particles(self, z: Array, link: Link) -> tuple[Array, Array]:
        """Places (B, k, 3) of the particles of a link and their derivatives (B, k, 3, 6) by its own coordinates."""
        own = z[:, self.at[link.name]]
        arms = link.masses.arms(own)
        gradient = np.zeros((*arms.shape, 6))
        gradient[..., :3], gradient[..., 3:] = np.eye(3), -skew(arms)
        return own[:, None, :3] + arms, gradient

    def _row(self, z: Array, joint: Joint, motion: str) -> tuple[tuple[str, Array], Any]:
        """Two vectors whose scalar product is a motion: one that turns with a link, and (value, derivatives)."""
        ends = self._joint_axes[joint.name]
        if motion in PLACES:
            frame = joint.measured_in
            axis = self._turn(z, frame) @ ends.frame[:, PLACES[motion]]
            return (frame, axis), self.apart(z, joint.first, joint.second)
        second, first, sign = TURNS[motion]
        fixed = sign * self._turn(z, joint.first[0]) @ ends.first[:, first]
        turning = self._turn(z, joint.second[0]) @ ends.second[:, second]
        gradient = np.zeros((len(z), 3, self.size))
        if joint.second[0] != GROUND:
            gradient[:, :, self._spin(joint.second[0])] = -skew(turning)
        return (joint.first[0], fixed), (turning, gradient)

    def _fill(self, z: Array, joint: Joint, ways: list[str], value: Array, slope: Array) -> None:
        """Fill in values (B, r) and derivatives (B, r, z) of some motions of a joint."""
        ends, (first, second) = self._joint_axes[joint.name], (joint.first[0], joint.second[0])
        held = self._turn(z, first) @ ends.first
        places = [k for k, way in enumerate(ways) if way in PLACES]
        turns = [k for k, way in enumerate(ways) if way in TURNS]

        def add(name: str, rows: list[int], moved: Array | None, turned: Array) -> None:
            if name == GROUND:
                return
            own = self._spin(name)
            slope[:, rows, own] += turned
            if moved is not None:
                slope[:, rows, own.start - 3 : own.start] += moved

        if places:
            axis = np.swapaxes(self.axes(z, joint)[:, :, [PLACES[ways[k]] for k in places]], -1, -2)
            apart = self._place(z, joint.second) - self._place(z, joint.first)
            value[:, places] = (axis @ apart[:, :, None])[..., 0]
            add(second, places, axis, cross(self._arm(z, joint.second)[:, None], axis))
            add(first, places, -axis, cross(axis, self._arm(z, joint.first)[:, None]))
            add(joint.measured_in, places, None, cross(axis, apart[:, None]))
        if turns:
            which = [TURNS[ways[k]] for k in turns]
            turning = np.swapaxes((self._turn(z, second) @ ends.second)[:, :, [one[0] for one in which]], -1, -2)
            fixed = np.swapaxes(held[:, :, [one[1] for one in which]], -1, -2)
            fixed = fixed * np.array([one[2] for one in which])[:, None]
            value[:, turns] = np.sum(fixed * turning, axis=-1)
            add(second, turns, None, cross(turning, fixed))
            add(first, turns, None, cross(fixed, turning))

    def functions(self, z: Array, theta: Array) -> tuple[Array, Array]:
        """Functions c (B, z) at crank angles (B,), and their derivatives by places and turns; see ``Mechanism``."""
        value, slope = np.zeros_like(z), np.zeros((len(z), self.size, self.size))
        joint = self.driver
        ends, own = self._joint_axes[joint.name], self._spin(joint.second[0])
        pointer = self._turn(z, joint.second[0]) @ ends.second[:, 1]
        angle = np.arctan2(pointer @ ends.first[:, 2], pointer @ ends.first[:, 1])
        value[:, 0] = np.mod(angle - theta + np.pi, 2.0 * np.pi) - np.pi
        slope[:, 0, own] = ends.first[:, 0]
        for joint, ways, places in self._rows_of:
            found, gradient = np.zeros((len(z), len(ways))), np.zeros((len(z), len(ways), self.size))
            self._fill(z, joint, ways, found, gradient)
            value[:, places], slope[:, places] = found, gradient
        return value, slope

    @cached_property
    def _rows_of(self) -> list[tuple[Joint, list[str], list[int]]]:
        """Motions of each joint that are functions, and their places among these."""
        rows = self.rows()
        own = {joint.name: [k for k, row in enumerate(rows) if row.joint is joint] for joint in self.joints}
        return [
            (joint, [rows[k].motion for k in own[joint.name]], [k + 1 for k in own[joint.name]])
            for joint in self.joints
        ]

    def along(self, z: Array, joint: Joint) -> tuple[Array, Array]:
        """How far [m] the second point lies along a joint's axis, (B,), and its derivatives (B, z)."""
        value, slope = np.zeros((len(z), 1)), np.zeros((len(z), 1, self.size))
        self._fill(z, joint, [ALONG], value, slope)
        return value[:, 0], slope[:, 0]

    def axes(self, z: Array, joint: Joint) -> Array:
        """Axes (B, 3, 3) along which the point of a joint is measured, in columns."""
        return np.asarray(self._turn(z, joint.measured_in) @ self._joint_axes[joint.name].frame)

    def add_bent_rows(self, z: Array, forces: Array, total: Array) -> None:
        """Add the second derivatives of the functions times forces (..., B, z) to ``total`` (..., B, z, z)."""
        for k, row in enumerate(self.rows(), 1):
            pulled = forces[..., k, None]
            (frame, axis), (vector, gradient) = self._row(z, row.joint, row.motion)
            self._add_turned(frame, axis, pulled * vector, total)
            if row.motion in PLACES:
                self.add_bent(z, row.joint.second, pulled * axis, total)
                self.add_bent(z, row.joint.first, -pulled * axis, total)
            else:
                self._add_turned(row.joint.second[0], vector, pulled * axis, total)
            if frame != GROUND:
                turned = np.zeros_like(gradient)
                turned[:, :, self._spin(frame)] = -skew(axis)
                cross = np.swapaxes(turned, -1, -2) @ gradient
                total += pulled[..., None] * (cross + np.swapaxes(cross, -1, -2))
