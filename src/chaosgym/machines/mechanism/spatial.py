"""A mechanism in space: its joints as functions of how all links lie, for the same nominal motion and equations.

Every joint has axes in its first link: its own axis first, ``along`` it, and two across it. What a joint holds, or
opens, are the coordinates of the second link's point in these axes, and small turns of the second link's axes. Each of
them is the scalar product of two vectors,

    c = a . v,    v = x_2 + R_2 s - x_1 - R_1 r    of a place,    v = R_2 s    of a turn

with an axis a that turns with a link, points s and r of the second and the first link, or an axis s of the second. At
the end of a beam a point moves as the beam bends, and an axis turns with the end.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.matrices import product
from chaosgym.errors import ParameterError
from chaosgym.machines.mechanism.joints import ALONG, GROUND, PLACES, LinkJoint
from chaosgym.machines.mechanism.mechanism import Mechanism
from chaosgym.machines.mechanism.space import RIGID, Lie, cross, skew, spatially_fixed
from chaosgym.machines.mechanism.spatial_rows import TURNS, MovingVectors, Rows, Vectors, axes_of_joint

MOST_SWING = 0.97 * np.pi
"""Angle [rad] by which a link may swing about axes across its own."""

STILL = Lie(np.eye(3), np.eye(3))


@dataclass(frozen=True, eq=False)
class SpatialMechanism(Mechanism):
    """Links in space with mobility one, whose drive turns a revolute joint on the ground; see ``Mechanism``."""

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
        return spatially_fixed(np.array(self.ground[point]), STILL)

    def _number(self, name: str) -> int:
        """Number of a link, or of the ground behind all."""
        return [*self.at, GROUND].index(name)

    def _spin(self, link: int) -> slice:
        """Columns of the turns of a link."""
        start = self.at[self.links[link].name].start
        return slice(start + 3, start + RIGID)

    @cached_property
    def _rigid(self) -> NDArray[np.int64]:
        """Columns (links, 6) of places and turns of the links."""
        return np.array([own.start for own in self.at.values()])[:, None] + np.arange(RIGID)

    def _bends(self, link: int) -> NDArray[np.bool_]:
        """Which of the elastic coordinates (E,) are those of a link."""
        own = self.at[self.links[link].name]
        return np.asarray((self.elastic >= own.start) & (self.elastic < own.stop))

    @cached_property
    def _lies(self) -> Lie:
        """How all links lie, and the ground, (links + 1, 3, 3)."""
        lies = [*(link.masses.lie for link in self.links), STILL]
        return Lie(np.stack([lie.before for lie in lies]), np.stack([lie.after for lie in lies]))

    def _each(self, z: Array) -> Array:
        """Coordinates (B, links + 1, 6) of every link, and of the ground, apart from elastic ones."""
        return np.concatenate([z[:, self._rigid], np.zeros((len(z), 1, RIGID))], axis=1)

    def _all(self, each: Array, elastic: Array) -> Array:
        """All coordinates (B, z) of those of every link and the elastic ones."""
        z = np.empty((len(each), self.size))
        z[:, self._rigid], z[:, self.elastic] = each[:, :-1], elastic
        return z

    def moved(self, z: Array, step: Array) -> Array:
        """Coordinates after a step in which links turn about the axes of the world."""
        bent = (z + step)[:, self.elastic]
        return self._all(self._lies.moved(self._each(z), self._each(step)), bent)

    def rates(self, z: Array, rate: Array) -> Array:
        """Rates of the coordinates from those of places and angular velocities."""
        return self._all(self._lies.rates(self._each(z), self._each(rate)), rate[:, self.elastic])

    def refuse_turned_over(self, z: Array) -> None:
        """Refuse coordinates (1, z) in which a link has turned by half a turn about an axis that allows no more."""
        for name, own in self.at.items():
            if matrices.norm(z[0, own.start + 4 : own.start + RIGID]) > MOST_SWING:
                raise ParameterError(
                    f"link {name} turns by half a turn about another axis than its own; allowed: axis of "
                    f"[link.{name}], about which it turns right round"
                )

    def point(self, z: Array, end: tuple[str, str]) -> tuple[Array, Array]:
        """Place (B, 3) of a point and its derivatives (B, 3, z) by places and turns about the axes of the world."""
        gradient, places = np.zeros((len(z), 3, self.size)), self.places(end)
        if end[0] == GROUND:
            return np.broadcast_to(places.place[0], (len(z), 3)), gradient
        own, turn = self.at[end[0]], self._turn(z, end[0])
        arm = product(turn, places.place[0])
        gradient[:, :, own.start : own.start + 3] = np.eye(3)
        gradient[:, :, own.start + 3 : own.start + RIGID] = -skew(arm)
        gradient[:, :, own.start + RIGID : own.stop] = product(turn, places.shape[0])
        return z[:, own.start : own.start + 3] + arm, gradient

    def _turn(self, z: Array, name: str) -> Array:
        """Turn (B, 3, 3) of a link."""
        return np.asarray(self.link(name).masses.lie.turn(z[:, self.at[name]]))

    def add_bent(self, z: Array, end: tuple[str, str], force: Array, total: Array) -> None:
        """Add the second derivatives of a point times forces (..., B, 3) to ``total`` (..., B, z, z)."""
        if end[0] != GROUND:
            places, link = self.places(end), self._number(end[0])
            carried = self._carried([(link, places.place[0], places.shape[0], places.curve[0])])
            self._add_carried(link, self._turn(z, end[0]), carried, force[..., None, :], total)

    def _carried(self, parts: Sequence[tuple[int, Array, Array, Array]]) -> MovingVectors:
        """Vectors of links, each with its derivatives by the elastic coordinates of its link."""
        count, bends = len(parts), len(self.elastic)
        shape, curve = np.zeros((count, 3, bends)), np.zeros((count, 3, bends, bends))
        for k, (link, _, once, twice) in enumerate(parts):
            if once.shape[-1]:
                own = np.flatnonzero(self._bends(link))
                shape[k][:, own] = once
                curve[k][np.ix_(np.arange(3), own, own)] = twice
        return MovingVectors(np.array([part[0] for part in parts]), np.array([part[1] for part in parts]), shape, curve)

    def _add_carried(self, link: int, turn: Array, carried: MovingVectors, force: Array, total: Array) -> None:
        """Add the second derivatives of vectors that a link carries, times forces (..., B, R, 3)."""
        spin, bends = self._spin(link), self._bends(link)
        arm = product(carried.vector, np.swapaxes(turn, -1, -2))
        outer = product(np.swapaxes(force, -1, -2), arm)
        total[..., spin, spin] += 0.5 * (outer + np.swapaxes(outer, -1, -2))
        total[..., spin, spin] -= np.einsum("...ii->...", outer)[..., None, None] * np.eye(3)
        if not bends.any():
            return
        columns, own = self.elastic[bends], product(force, turn)
        count, flat = len(columns), own.reshape(*own.shape[:-2], 1, -1)
        # a turn d moves what bends by d x N q
        crossed = skew(np.swapaxes(carried.shape[..., bends], 1, 2)).transpose(0, 3, 2, 1)
        mixed = product(turn, (product(flat, crossed.reshape(-1, 3 * count))).reshape(*own.shape[:-2], 3, count))
        total[..., spin, columns] += mixed
        total[..., columns, spin] += np.swapaxes(mixed, -1, -2)
        curve = carried.curve[..., bends, :][..., bends]
        bent = (product(flat, curve.reshape(-1, count**2))).reshape(*own.shape[:-2], count, count)
        total[..., columns[:, None], columns] += bent

    def _frame_of(self, joint: LinkJoint) -> Array:
        """Axes in which the point of a joint is measured, in the link that bears them."""
        return axes_of_joint(joint.first_axis if joint.measured_in == joint.first[0] else joint.second_axis)

    def _point_of(self, end: tuple[str, str]) -> tuple[int, Array, Array, Array]:
        """Number of the link of a point, and where it is there."""
        places = self.places(end)
        return self._number(end[0]), places.place[0], places.shape[0], places.curve[0]

    def _axis_of(self, end: tuple[str, str], axis: Array) -> tuple[int, Array, Array, Array]:
        """Number of the link of a point, and an axis that turns with that point."""
        return self._number(end[0]), axis, *self.places(end).turned(axis)

    def _table(self, motions: Sequence[tuple[LinkJoint, str]]) -> Rows:
        """Constants of some motions of joints."""
        axes, starts, ends, moves = [], [], [], []
        for joint, motion in motions:
            if motion in PLACES:
                bears = joint.first if joint.measured_in == joint.first[0] else joint.second
                axes.append(self._axis_of(bears, self._frame_of(joint)[:, PLACES[motion]]))
                starts.append(self._point_of(joint.first))
                ends.append(self._point_of(joint.second))
            else:
                turning, fixed, sign = TURNS[motion]
                axis, end = (axes_of_joint(each) for each in (joint.first_axis, joint.second_axis))
                axes.append(self._axis_of(joint.first, sign * axis[:, fixed]))
                starts.append(self._axis_of(joint.first, np.zeros(3)))
                ends.append(self._axis_of(joint.second, end[:, turning]))
            moves.append([float(motion in PLACES)])
        return Rows(self._carried(axes), self._carried(starts), self._carried(ends), np.array(moves))

    @cached_property
    def _rows(self) -> Rows:
        return self._table([(row.joint, row.motion) for row in self.rows()])

    def _vectors(self, z: Array, rows: Rows) -> Vectors:
        each = self._each(z)
        turn = self._lies.turn(each)
        axis, start, end = (product(turn[:, one.link], one.vector[:, :, None])[..., 0] for one in rows.vectors)
        apart = end + rows.moves * (each[:, rows.end.link, :3] - each[:, rows.start.link, :3] - start)
        return Vectors(turn, axis, start, end, apart)

    def _slopes(self, vectors: Vectors, rows: Rows) -> Array:
        """Derivatives (B, R, z) of functions."""
        turn, axis, start, end, apart = vectors
        every, size = np.arange(len(rows.moves)), (len(axis), len(rows.moves))
        slope = np.zeros((*size, len(self.links) + 1, RIGID))
        slope[:, every, rows.end.link, :3] += rows.moves * axis
        slope[:, every, rows.end.link, 3:] += cross(end, axis)
        slope[:, every, rows.start.link, :3] -= rows.moves * axis
        slope[:, every, rows.start.link, 3:] -= rows.moves * cross(start, axis)
        slope[:, every, rows.axis.link, 3:] += cross(axis, apart)
        whole = np.empty((*size, self.size))
        whole[..., self._rigid] = slope[:, :, :-1]
        if len(self.elastic):
            signed = (apart, -rows.moves * axis, axis)
            parts = zip(signed, rows.vectors, strict=True)
            own = [product(pressed[..., None, :], turn[:, one.link], one.shape)[..., 0, :] for pressed, one in parts]
            whole[..., self.elastic] = own[0] + own[1] + own[2]
        return whole

    def _filled(self, z: Array, rows: Rows) -> tuple[Array, Array]:
        """Values (B, R) and derivatives (B, R, z) of functions."""
        vectors = self._vectors(z, rows)
        return np.sum(vectors.axis * vectors.apart, axis=-1), self._slopes(vectors, rows)

    def functions(self, z: Array, theta: Array) -> tuple[Array, Array]:
        """Functions c (B, z) at crank angles (B,), and their derivatives by places and turns; see ``Mechanism``."""
        value, slope = np.empty_like(z), np.zeros((len(z), self.size, self.size))
        held = slice(1, self.size - len(self.elastic))
        value[:, held], slope[:, held] = self._filled(z, self._rows)
        (along, across, sideways), arrow = self._drive
        crank = self.driver.second[0]
        pointer = product(self._turn(z, crank), arrow)
        turned = matrices.arctan2(product(pointer, sideways), product(pointer, across))
        value[:, 0] = np.mod(turned - theta + np.pi, 2.0 * np.pi) - np.pi
        slope[:, 0, self._spin(self._number(crank))] = along
        value[:, held.stop :] = z[:, self.elastic]
        slope[:, np.arange(held.stop, self.size), self.elastic] = 1.0
        return value, slope

    @cached_property
    def _drive(self) -> tuple[Array, Array]:
        """Axes (3, 3) of the driven joint on the ground, in rows, and that of the crank (3,) that lies across it."""
        return axes_of_joint(self.driver.first_axis).T, axes_of_joint(self.driver.second_axis)[:, 1]

    def along(self, z: Array, joint: LinkJoint) -> tuple[Array, Array]:
        """How far [m] the second point lies along a joint's axis, (B,), and its derivatives (B, z)."""
        value, slope = self._filled(z, self._table([(joint, ALONG)]))
        return value[:, 0], slope[:, 0]

    def axes(self, z: Array, joint: LinkJoint) -> Array:
        """Axes (B, 3, 3) along which the point of a joint is measured, in columns."""
        turn = self._lies.turn(self._each(z))[:, self._number(joint.measured_in)]
        return np.asarray(product(turn, self._frame_of(joint)))

    def add_bent_rows(self, z: Array, forces: Array, total: Array) -> None:
        """Add the second derivatives of the functions times forces (..., B, z) to ``total`` (..., B, z, z)."""
        rows = self._rows
        vectors = self._vectors(z, rows)
        factor = forces[..., 1 : 1 + len(rows.moves), None]
        pressed = (factor * vectors.apart, -rows.moves * factor * vectors.axis, factor * vectors.axis)
        gradients = [self._gradient(vectors.turn, *part) for part in zip(rows.vectors, vectors[1:4], strict=True)]
        apart = gradients[2] + rows.moves[:, :, None] * (
            self._moving(rows.end.link) - self._moving(rows.start.link) - gradients[1]
        )
        for link, name in enumerate(self.at):
            for carried, force in zip(rows.vectors, pressed, strict=True):
                own = carried.link == link
                part = MovingVectors(*(each[own] for each in carried))
                self._add_carried(link, vectors.turn[:, link], part, force[..., own, :], total)
            own = rows.axis.link == link
            if own.any():
                columns = np.arange(self.at[name].start + 3, self.at[name].stop)
                count = len(z), int(own.sum()) * 3
                turning = (factor[..., own, :, None] * gradients[0][:, own][..., columns]).reshape(
                    *factor.shape[:-3], *count, len(columns)
                )
                crossed = product(np.swapaxes(turning, -1, -2), apart[:, own].reshape(*count, self.size))
                total[..., columns, :] += crossed
                total[..., columns] += np.swapaxes(crossed, -1, -2)

    def _gradient(self, turn: Array, carried: MovingVectors, vector: Array) -> Array:
        """Derivatives (B, R, 3, z) of vectors that links carry, (B, R, 3) on the ground, by turns and bending."""
        every = np.arange(len(carried.link))
        slope = np.zeros((*vector.shape, len(self.links) + 1, RIGID))
        slope[:, every, :, carried.link, 3:] = -np.swapaxes(skew(vector), 0, 1)
        whole = np.empty((*vector.shape, self.size))
        whole[..., self._rigid] = slope[..., :-1, :]
        if len(self.elastic):
            whole[..., self.elastic] = product(turn[:, carried.link], carried.shape)
        return whole

    def _moving(self, link: NDArray[np.int64]) -> Array:
        """Derivatives (R, 3, z) of the places of links."""
        slope = np.zeros((len(link), 3, len(self.links) + 1, RIGID))
        slope[np.arange(len(link)), :, link, :3] = np.eye(3)
        whole = np.zeros((len(link), 3, self.size))
        whole[..., self._rigid] = slope[..., :-1, :]
        return whole
