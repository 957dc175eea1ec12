r"""Links of a mechanism in space: how they lie and turn, and where their points are.

A link has coordinates z = (x, y, z, phi, u_1, u_2): the place of its frame on the ground, its turn phi about an axis of
its own, and a rotation vector u across that axis. Its frame turns by

    R = R_0 E R_z(phi) exp(u) E^T

from how it lies roughly at crank angle 0, R_0; the axis is the third column of E. So it may go right round about one
axis, that of the crank, and swings by less than half a turn about the others.

Small turns d are those of the world, exp(d) R. With them a point R rho moves by d x R rho to first order, and by
d x (d x R rho) / 2 to second order, wherever the link is: all derivatives are by d.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.matrices import product
from chaosgym.errors import ParameterError
from chaosgym.machines.mechanism.links import Link, rotation

Vector = tuple[float, float, float]

RIGID = 6
"""Coordinates of a link in space: three places and three turns."""

REACH = 0.1
"""Distance [m] from the centre of a body at which particles stand for its inertia; any other gives the same motion."""


def cross(one: Array, other: Array) -> Array:
    """Cross product of vectors (..., 3), in a third of the time of numpy's."""
    ahead, behind = [1, 2, 0], [2, 0, 1]
    return np.asarray(one[..., ahead] * other[..., behind] - one[..., behind] * other[..., ahead])


def skew(vector: Array) -> Array:
    """Matrices (..., 3, 3) of the cross product with vectors (..., 3)."""
    found = np.zeros((*vector.shape, 3))
    found[..., [1, 2, 0], [2, 0, 1]] = -vector
    found[..., [2, 0, 1], [1, 2, 0]] = vector
    return found


def _series(angle: Array) -> tuple[Array, Array, Array]:
    """sin a / a, (1 - cos a) / a^2 and (a - sin a) / a^3."""
    square = angle**2
    first, second, third = 1.0 - square / 6.0, 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    large = angle > 1e-3
    if np.any(large):
        a = angle[large]
        first[large], second[large], third[large] = (
            matrices.sin(a) / a,
            (1.0 - matrices.cos(a)) / a**2,
            (a - matrices.sin(a)) / (a * a * a),
        )
    return first[..., None, None], second[..., None, None], third[..., None, None]


def turned_by(vector: Array) -> Array:
    """Rotations (B, 3, 3) by rotation vectors (B, 3) [rad]."""
    first, second, _ = _series(np.linalg.norm(vector, axis=-1))
    across = skew(vector)
    return np.asarray(np.eye(3) + first * across + second * product(across, across))


def axes_of(third: Array, wanted: Array | None = None) -> Array:
    """Right-handed axes (3, 3), in columns: the last along a vector (3,), the first as near as may be to another one.

    Without one it is that of the unit vectors that lies most across.
    """
    unit = third / matrices.norm(third)
    if wanted is None:
        wanted = np.eye(3)[int(np.argmin(np.abs(unit)))]
    first = wanted - unit * product(unit, wanted)
    first = first / matrices.norm(first)
    return np.stack([first, np.cross(unit, first), unit], axis=1)


class Lie(NamedTuple):
    """How a link lies, or several: L = R_0 E and E^T of the module's equation, (..., 3, 3)."""

    before: Array
    after: Array

    def turn(self, z: Array) -> Array:
        """R (..., 3, 3) at coordinates z (..., 6)."""
        return np.asarray(product(self.before, _spun(z[..., 3]), turned_by(_swing(z[..., 4], z[..., 5])), self.after))

    def moved(self, z: Array, step: Array) -> Array:
        """Coordinates after a small step (..., 6) of the place and about the axes of the world."""
        back = np.swapaxes(self.before, -1, -2)
        own = product(back, turned_by(step[..., 3:]), self.turn(z), np.swapaxes(self.after, -1, -2))
        across = np.hypot(own[..., 2, 0], own[..., 2, 1])
        straight = across < 1e-12
        factor = np.where(straight, 1.0, matrices.arctan2(across, own[..., 2, 2]) / np.where(straight, 1.0, across))
        swing = _swing(own[..., 2, 1] * factor, -own[..., 2, 0] * factor)
        spun = product(own, turned_by(-swing))
        spin = matrices.arctan2(spun[..., 1, 0], spun[..., 0, 0])
        spin += 2.0 * np.pi * np.round((z[..., 3] - spin) / (2.0 * np.pi))
        return np.concatenate([z[..., :3] + step[..., :3], spin[..., None], swing[..., :2]], axis=-1)

    def rates(self, z: Array, rate: Array) -> Array:
        """Rates (..., 6) of the coordinates of links whose place and angular velocity change by ``rate``."""
        swing = _swing(z[..., 4], z[..., 5])
        _, second, third = _series(np.linalg.norm(swing, axis=-1))
        across = skew(swing)
        slope = np.eye(3) + second * across + third * product(across, across)
        slope[..., 2] = [0.0, 0.0, 1.0]
        turned = product(_spun(-z[..., 3]), product(np.swapaxes(self.before, -1, -2), rate[..., 3:, None]))
        own = matrices.solve(slope, turned)[..., 0]
        return np.concatenate([rate[..., :3], own[..., 2:], own[..., :2]], axis=-1)


def _spun(angle: Array) -> Array:
    """Turns (..., 3, 3) about z."""
    turn = np.zeros((*angle.shape, 3, 3))
    turn[..., :2, :2], turn[..., 2, 2] = rotation(angle), 1.0
    return turn


def _swing(first: Array, second: Array) -> Array:
    """Rotation vectors (..., 3) across z."""
    return np.stack([first, second, np.zeros_like(first)], axis=-1)


class SpatialPlaces(NamedTuple):
    """k points of a link with e elastic coordinates q.

    A point lies at rho + N q + 1/2 q C q in axes of the link. What is fixed to it turns by exp(S q), then by 1/2 q T q
    about x: the twist of a line that bends in two planes and carries no torque.

    Attributes
    ----------
    place : (k, 3)
        rho [m].
    lie
        How the link lies.
    shape, slope : (k, 3, e)
        N and S.
    curve : (k, 3, e, e)
        C.
    twist : (k, e, e)
        T.
    """

    place: Array
    lie: Lie
    shape: Array
    slope: Array
    curve: Array
    twist: Array

    def moved(self, z: Array) -> Array:
        """Places on the ground (B, k, 3) at coordinates z (B, 6 + e), whose elastic ones are zero."""
        return np.asarray(z[:, None, :3] + product(self.place, np.swapaxes(self.lie.turn(z), -1, -2)))

    def turned(self, vector: Array) -> tuple[Array, Array]:
        """First and second derivative (3, e) and (3, e, e) by q of a vector (3,) that turns with the first point."""
        slope = self.slope[0].T
        if not len(slope):
            return self.shape[0], self.curve[0]
        once = cross(slope, vector)
        twice = cross(slope[:, None], once[None])
        return once.T, np.moveaxis(0.5 * (twice + np.swapaxes(twice, 0, 1)), -1, 0) + np.multiply.outer(
            np.array([0.0, -vector[2], vector[1]]), self.twist[0]
        )

    def beside(self, arm: Array) -> "SpatialPlaces":
        """Points away by ``arm`` (k, 3) from the first one, with which they turn."""
        parts = [self.turned(each) for each in arm]
        return SpatialPlaces(
            self.place + arm,
            self.lie,
            np.stack([self.shape[0] + once for once, _ in parts]),
            np.repeat(self.slope, len(arm), axis=0),
            np.stack([self.curve[0] + twice for _, twice in parts]),
            np.repeat(self.twist, len(arm), axis=0),
        )


def spatially_fixed(place: Array, lie: Lie) -> SpatialPlaces:
    """Points (k, 3) of a link without elastic coordinates."""
    place = np.asarray(place, dtype=float).reshape(-1, 3)
    count, shape = len(place), np.zeros((len(place), 3, 0))
    return SpatialPlaces(place, lie, shape, shape, np.zeros((count, 3, 0, 0)), np.zeros((count, 0, 0)))


def spatially_together(some: list[SpatialPlaces]) -> SpatialPlaces:
    """Points of one link in a row."""
    place, lie, *rest = zip(*some, strict=True)
    return SpatialPlaces(np.concatenate(place), lie[0], *map(np.concatenate, rest))


class SpatialInertia(NamedTuple):
    """Inertia of a link with 6 + e coordinates in its own axes, where it does not depend on the crank angle.

    In these axes a particle moves by H per unit coordinate, and is accelerated by a of twelve kinds: 1 along each axis,
    and along each axis in proportion to each part of its place.

    Attributes
    ----------
    moments : (3, 3, z, z)
        Sum m H_i^T H_j of parts i and j of the motions.
    pull : (12, z)
        Sum m H^T a.
    bent : (12, z, z)
        Second derivatives of the places times m a.
    """

    moments: Array
    pull: Array
    bent: Array


def spatial_inertia_of(link: Link) -> SpatialInertia:
    """Inertia of a link in its own axes."""
    places, mass = link.masses, link.mass
    rho, elastic = places.place, len(link.elastic)
    count, size = len(mass), RIGID + elastic
    motion = np.zeros((count, 3, size))
    motion[:, :, :3], motion[:, :, 3:6], motion[:, :, 6:] = np.eye(3), -skew(rho), places.shape
    carried = product((mass[:, None] * motion.reshape(count, -1)).T, motion.reshape(count, -1))
    moments = np.moveaxis(carried.reshape(3, size, 3, size), 1, 2)
    # factors of the twelve accelerations, whose direction is the last index but one
    weight = mass[:, None] * np.concatenate([np.ones((count, 1)), rho], axis=1)
    pull = np.einsum("kf,kiz->fiz", weight, motion)
    return SpatialInertia(
        moments,
        np.concatenate([pull[0], np.swapaxes(pull[1:], 0, 1).reshape(9, size)]),
        _bent(places, mass),
    )


def _bent(places: SpatialPlaces, mass: Array) -> Array:
    """Second derivatives (12, z, z) of places times m a, of the accelerations of ``SpatialInertia``."""
    rho, elastic = places.place, places.shape.shape[-1]
    size = RIGID + elastic
    weight = mass[:, None] * np.concatenate([np.ones((len(mass), 1)), rho], axis=1)
    bent = np.zeros((4, 3, size, size))
    outer = product(weight.T, rho)
    pressed = np.einsum("ai,fb->fiab", np.eye(3), outer)
    bent[..., 3:6, 3:6] = 0.5 * (pressed + np.swapaxes(pressed, -1, -2))
    bent[..., 3:6, 3:6] -= outer[..., None, None] * np.eye(3)
    if elastic:
        moved = (product(weight.T, places.shape.reshape(len(mass), -1))).reshape(4, 3, elastic)
        # a turn d moves what bends by d x N q
        bent[..., 3:6, 6:] = product(-skew(np.eye(3)), moved[:, None])
        bent[..., 6:, 3:6] = np.swapaxes(bent[..., 3:6, 6:], -1, -2)
        curve = product(weight.T, places.curve.reshape(len(mass), -1))
        bent[..., 6:, 6:] = curve.reshape(4, 3, elastic, elastic)
    return np.concatenate([bent[0], np.swapaxes(bent[1:], 0, 1).reshape(9, size, size)])


class SpatialBody(NamedTuple):
    """A rigid body: mass [kg], moments of inertia about its centre along the link's axes [kg m^2], centre [m]."""

    mass: float
    inertia: Vector = (0.0, 0.0, 0.0)
    centre: Vector = (0.0, 0.0, 0.0)

    @property
    def squares(self) -> Array:
        """Sum of mass times squared distance (3,) along each axis from the centre [kg m^2]."""
        return np.asarray(0.5 * np.sum(self.inertia) - np.array(self.inertia))

    def turning(self, slope: Array) -> Array:
        """``Link.turning`` (3, 6 + e, 6 + e) of it, where elastic coordinates turn it by ``slope`` (3, e)."""
        found = np.zeros((3, RIGID + slope.shape[1], RIGID + slope.shape[1]))
        for axis, square in enumerate(self.squares):
            moved = product(-skew(np.eye(3)[axis]), np.hstack([np.eye(3), slope]))
            found[axis, 3:, 3:] = product(square * moved.T, moved)
        return found

    def particles(self) -> tuple[Array, Array]:
        """Places (7, 3) and masses (7,) that move like the body; that in the middle may be negative.

        Raises
        ------
        ParameterError
            If no body has such moments of inertia: each is at most the sum of the others.
        """
        squares = self.squares
        if np.any(squares < -1e-9 * np.sum(self.inertia)):
            raise ParameterError(
                f"moments of inertia {', '.join(f'{one:g}' for one in self.inertia)} kg m^2 belong to no body; "
                "allowed: each at most the sum of the two others"
            )
        arms = REACH * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
        outer = np.tile(squares / (2.0 * REACH**2), 2)
        return np.array(self.centre) + arms, np.concatenate([[self.mass - outer.sum()], outer])


@lru_cache(maxsize=256)
def lying(orientation: Vector, axis: Vector) -> Lie:
    """How a link lies that is turned about x, then y, then z of the ground, and may turn right round an own axis."""
    own = axes_of(np.array(axis))
    lies = np.eye(3)
    for unit, angle in zip(np.eye(3), orientation, strict=True):
        lies = product(turned_by(angle * unit[None])[0], lies)
    return Lie(product(lies, own), own.T)


def spatial_link(
    name: str,
    points: dict[str, Vector],
    bodies: tuple[SpatialBody, ...] = (),
    orientation: Vector = (0.0, 0.0, 0.0),
    axis: Vector = (0.0, 0.0, 1.0),
) -> Link:
    """Return a rigid link in space.

    Parameters
    ----------
    name
        How joints name it.
    points
        In its own axes [m].
    bodies
        What has mass.
    orientation
        Rough turns [rad] at crank angle 0 about x, then y, then z of the ground.
    axis
        Own axis about which it may turn right round.
    """
    lie = lying(orientation, axis)
    parts = [body.particles() for body in bodies]
    place = np.concatenate([np.zeros((0, 3)), *(part[0] for part in parts)])
    mass = np.concatenate([np.zeros(0), *(part[1] for part in parts)])
    named = {point: spatially_fixed(np.array(at), lie) for point, at in points.items()}
    turning = np.zeros((3, RIGID, RIGID))
    for body in bodies:
        turning += body.turning(np.zeros((3, 0)))
    return Link(name, named, spatially_fixed(place, lie), mass, np.zeros(len(mass)), rigid=RIGID, turning=turning)
