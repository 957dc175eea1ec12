"""A mechanism in space: its joints as functions of how all links lie, for the same nominal motion and equations.

Every joint has axes in its first link: its own axis first, ``along`` it, and two across it. What a joint holds, or
opens, are the coordinates of the second link's point in these axes, and small turns of the second link's axes. Each of
them is the scalar product of two vectors,

    c = a . v,    v = x_2 + R_2 s - x_1 - R_1 r    of a place,    v = R_2 s    of a turn

with an axis a that turns with a link, points s and r of the second and the first link, or an axis s of the second.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.errors import ParameterError
from chaosgym.machines.mechanism.joints import ALONG, GROUND, PITCH, PLACES, ROLL, SKEW, YAW, Joint
from chaosgym.machines.mechanism.links import Link
from chaosgym.machines.mechanism.mechanism import Mechanism
from chaosgym.machines.mechanism.space import RIGID, Lie, SpatialPlaces, axes_of, cross, skew

TURNS = {ROLL: (1, 2, 1.0), YAW: (0, 2, -1.0), PITCH: (0, 1, 1.0), SKEW: (0, 0, 1.0)}
"""Axis of the second link, that of the first and sign, whose product is a small turn; it is zero in the middle."""

MOST_SWING = 0.97 * np.pi
"""Angle [rad] by which a link may swing about axes across its own."""

STILL = Lie(np.eye(3), np.eye(3))


class _Rows(NamedTuple):
    """Constants of R functions of joints.

    ``frame``, ``first`` and ``second`` (R,) numbers of the links with which a, r and s turn, the ground behind all;
    ``axis``, ``start`` and ``end`` (R, 3) these vectors in axes of their links; ``moves`` (R, 1) 1 of a place, 0 of a
    turn.
    """

    frame: NDArray[np.int64]
    first: NDArray[np.int64]
    second: NDArray[np.int64]
    axis: Array
    start: Array
    end: Array
    moves: Array


class _Vectors(NamedTuple):
    """a, R_1 r, R_2 s and v of R functions in axes of the ground, (B, R, 3)."""

    axis: Array
    start: Array
    end: Array
    apart: Array


def axes_of_joint(axis: tuple[float, ...]) -> Array:
    """Axes (3, 3) of a joint, in columns: its own, across it as near to y as may be (else to z), and sideways."""
    unit = np.array(axis) / np.linalg.norm(axis)
    wanted = np.eye(3)[1] if abs(unit[1]) < 0.9 else np.eye(3)[2]
    return np.roll(axes_of(unit, wanted), 1, axis=1)


@dataclass(frozen=True, eq=False)
class SpatialMechanism(Mechanism):
    """Rigid links in space with mobility one, whose drive turns a revolute joint on the ground; see ``Mechanism``."""

    dimensions: ClassVar[int] = 3
    motions_of_a_link: ClassVar[int] = RIGID

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.driver.first[0] != GROUND:
            raise ParameterError(
                f"joint {self.driver.name} is driven on {self.driver.first[0]}; allowed in space: on the ground"
            )

    def places(self, end: tuple[str, str]) -> Any:
        """A point of a link or of the ground, ``SpatialPlaces``; see ``Mechanism.places``."""
        return super().places(end)

    def _still(self, point: str) -> Any:
        return SpatialPlaces(np.array([self.ground[point]]), STILL)

    def _number(self, name: str) -> int:
        """Number of a link, or of the ground behind all."""
        return [*self.at, GROUND].index(name)

    def _spin(self, link: int) -> slice:
        """Columns of the turns of a link."""
        return slice(RIGID * link + 3, RIGID * (link + 1))

    @cached_property
    def _lies(self) -> Lie:
        """How all links lie, and the ground, (links + 1, 3, 3)."""
        lies = [*(link.masses.lie for link in self.links), STILL]
        return Lie(np.stack([lie.before for lie in lies]), np.stack([lie.after for lie in lies]))

    def _each(self, z: Array) -> Array:
        """Coordinates (B, links + 1, 6) of every link, and of the ground."""
        return np.concatenate([z.reshape(len(z), -1, RIGID), np.zeros((len(z), 1, RIGID))], axis=1)

    def moved(self, z: Array, step: Array) -> Array:
        """Coordinates after a step in which links turn about the axes of the world."""
        return self._lies.moved(self._each(z), self._each(step))[:, :-1].reshape(z.shape)

    def rates(self, z: Array, rate: Array) -> Array:
        """Rates of the coordinates from those of places and angular velocities."""
        return self._lies.rates(self._each(z), self._each(rate))[:, :-1].reshape(z.shape)

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
        gradient, link, places = np.zeros((len(z), 3, self.size)), self._number(end[0]), self.places(end)
        each = self._each(z)[:, link]
        if end[0] != GROUND:
            own = self._spin(link)
            gradient[:, :, own.start - 3 : own.start] = np.eye(3)
            gradient[:, :, own] = -skew(places.arms(each)[:, 0])
        return places.moved(each)[:, 0], gradient

    def add_bent(self, z: Array, end: tuple[str, str], force: Array, total: Array) -> None:
        """Add the second derivatives of a point times forces (..., B, 3) to ``total`` (..., B, z, z)."""
        if end[0] != GROUND:
            arm = self.places(end).arms(z[:, self.at[end[0]]])[:, 0]
            self._add_turned(self._number(end[0]), force[..., :, None] * arm[:, None, :], total)

    def _add_turned(self, link: int, product: Array, total: Array) -> None:
        """Add the second derivatives of vectors w that turn with a link, times forces F: ``product`` sum F w^T."""
        if link < len(self.links):
            own = self._spin(link)
            total[..., own, own] += 0.5 * (product + np.swapaxes(product, -1, -2))
            total[..., own, own] -= np.einsum("...ii->...", product)[..., None, None] * np.eye(3)

    def add_particles(self, z: Array, link: Link, force: Array, total: Array) -> None:
        """Add the second derivatives of the particles of a link times forces (..., B, k, 3)."""
        arms = link.masses.arms(z[:, self.at[link.name]])
        self._add_turned(self._number(link.name), np.einsum("...bki,bkj->...bij", force, arms), total)

    def particles(self, z: Array, link: Link) -> tuple[Array, Array]:
        """Places (B, k, 3) of the particles of a link and their derivatives (B, k, 3, 6) by its own coordinates."""
        own = z[:, self.at[link.name]]
        arms = link.masses.arms(own)
        gradient = np.zeros((*arms.shape, RIGID))
        gradient[..., :3], gradient[..., 3:] = np.eye(3), -skew(arms)
        return own[:, None, :3] + arms, gradient

    def _frame_of(self, joint: Joint) -> Array:
        """Axes in which the point of a joint is measured, in the link that bears them."""
        return axes_of_joint(joint.first_axis if joint.measured_in == joint.first[0] else joint.second_axis)

    def _table(self, motions: Sequence[tuple[Joint, str]]) -> _Rows:
        """Constants of some motions of joints."""
        rows = []
        for joint, motion in motions:
            first, second = (self._number(end[0]) for end in (joint.first, joint.second))
            if motion in PLACES:
                axis, frame = self._frame_of(joint)[:, PLACES[motion]], self._number(joint.measured_in)
                start, end = (self.places(each).place[0] for each in (joint.first, joint.second))
                rows.append((frame, first, second, axis, start, end, [1.0]))
            else:
                turning, fixed, sign = TURNS[motion]
                axis, end = (axes_of_joint(each) for each in (joint.first_axis, joint.second_axis))
                rows.append((first, first, second, sign * axis[:, fixed], np.zeros(3), end[:, turning], [0.0]))
        return _Rows(*map(np.array, zip(*rows, strict=True)))

    @cached_property
    def _rows(self) -> _Rows:
        return self._table([(row.joint, row.motion) for row in self.rows()])

    def _vectors(self, z: Array, rows: _Rows) -> _Vectors:
        each = self._each(z)
        turn = self._lies.turn(each)
        axis, start, end = (
            (turn[:, link] @ vector[:, :, None])[..., 0]
            for link, vector in ((rows.frame, rows.axis), (rows.first, rows.start), (rows.second, rows.end))
        )
        apart = end + rows.moves * (each[:, rows.second, :3] - each[:, rows.first, :3] - start)
        return _Vectors(axis, start, end, apart)

    def _filled(self, z: Array, rows: _Rows) -> tuple[Array, Array]:
        """Values (B, R) and derivatives (B, R, z) of functions."""
        axis, start, end, apart = self._vectors(z, rows)
        every = np.arange(len(rows.frame))
        slope = np.zeros((len(z), len(every), len(self.links) + 1, RIGID))
        slope[:, every, rows.second, :3] += rows.moves * axis
        slope[:, every, rows.second, 3:] += cross(end, axis)
        slope[:, every, rows.first, :3] -= rows.moves * axis
        slope[:, every, rows.first, 3:] -= rows.moves * cross(start, axis)
        slope[:, every, rows.frame, 3:] += cross(axis, apart)
        return np.sum(axis * apart, axis=-1), slope[:, :, :-1].reshape(len(z), len(every), -1)

    def functions(self, z: Array, theta: Array) -> tuple[Array, Array]:
        """Functions c (B, z) at crank angles (B,), and their derivatives by places and turns; see ``Mechanism``."""
        value, slope = np.empty_like(z), np.zeros((len(z), self.size, self.size))
        value[:, 1:], slope[:, 1:] = self._filled(z, self._rows)
        (along, across, sideways), arrow = self._drive
        crank = self.driver.second[0]
        pointer = self.link(crank).masses.lie.turn(z[:, self.at[crank]]) @ arrow
        turned = np.arctan2(pointer @ sideways, pointer @ across)
        value[:, 0] = np.mod(turned - theta + np.pi, 2.0 * np.pi) - np.pi
        slope[:, 0, self._spin(self._number(crank))] = along
        return value, slope

    @cached_property
    def _drive(self) -> tuple[Array, Array]:
        """Axes (3, 3) of the driven joint on the ground, in rows, and that of the crank (3,) that lies across it."""
        return axes_of_joint(self.driver.first_axis).T, axes_of_joint(self.driver.second_axis)[:, 1]

    def along(self, z: Array, joint: Joint) -> tuple[Array, Array]:
        """How far [m] the second point lies along a joint's axis, (B,), and its derivatives (B, z)."""
        value, slope = self._filled(z, self._table([(joint, ALONG)]))
        return value[:, 0], slope[:, 0]

    def axes(self, z: Array, joint: Joint) -> Array:
        """Axes (B, 3, 3) along which the point of a joint is measured, in columns."""
        turn = self._lies.turn(self._each(z))[:, self._number(joint.measured_in)]
        return np.asarray(turn @ self._frame_of(joint))

    def add_bent_rows(self, z: Array, forces: Array, total: Array) -> None:
        """Add the second derivatives of the functions times forces (..., B, z) to ``total`` (..., B, z, z)."""
        rows = self._rows
        vectors = self._vectors(z, rows)
        for k, (frame, first, second) in enumerate(zip(rows.frame, rows.first, rows.second, strict=True)):
            axis, start, end, apart = (vector[:, k] for vector in vectors)
            pulled, moves = forces[..., k + 1, None], rows.moves[k, 0]
            self._add_turned(frame, (pulled * apart)[..., :, None] * axis[:, None], total)
            self._add_turned(second, (pulled * axis)[..., :, None] * end[:, None], total)
            self._add_turned(first, -moves * (pulled * axis)[..., :, None] * start[:, None], total)
            if frame == len(self.links):
                continue
            gradient = np.zeros((len(z), 3, len(self.links) + 1, RIGID))
            gradient[:, :, second, :3] += moves * np.eye(3)
            gradient[:, :, second, 3:] -= skew(end)
            gradient[:, :, first, :3] -= moves * np.eye(3)
            gradient[:, :, first, 3:] += moves * skew(start)
            crossed = pulled[..., None] * (skew(axis) @ gradient[:, :, :-1].reshape(len(z), 3, -1))
            total[..., self._spin(frame), :] += crossed
            total[..., :, self._spin(frame)] += np.swapaxes(crossed, -1, -2)
