r"""Links of a mechanism in space: how they lie and turn, and where their points are.

A link has coordinates z = (x, y, z, phi, u_1, u_2): the place of its frame on the ground, its turn phi about an axis of
its own, and a rotation vector u across that axis. Its frame turns by

    R = R_0 E R_z(phi) exp(u) E^T

from how it lies roughly at crank angle 0, R_0; the axis is the third column of E. So it may go right round about one
axis, that of the crank, and swings by less than half a turn about the others.

Small turns d are those of the world, exp(d) R. With them a point R rho moves by d x R rho to first order, and by
d x (d x R rho) / 2 to second order, wherever the link is: all derivatives are by d.
"""

from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
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
        first[large], second[large], third[large] = np.sin(a) / a, (1.0 - np.cos(a)) / a**2, (a - np.sin(a)) / a**3
    return first[..., None, None], second[..., None, None], third[..., None, None]


def turned_by(vector: Array) -> Array:
    """Rotations (B, 3, 3) by rotation vectors (B, 3) [rad]."""
    first, second, _ = _series(np.linalg.norm(vector, axis=-1))
    across = skew(vector)
    return np.asarray(np.eye(3) + first * across + second * (across @ across))


def axes_of(third: Array, wanted: Array | None = None) -> Array:
    """Right-handed axes (3, 3), in columns: the last along a vector (3,), the first as near as may be to another one.

    Without one it is that of the unit vectors that lies most across.
    """
    unit = third / np.linalg.norm(third)
    if wanted is None:
        wanted = np.eye(3)[int(np.argmin(np.abs(unit)))]
    first = wanted - unit * (unit @ wanted)
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(unit, first), unit], axis=1)


class Lie(NamedTuple):
    """How a link lies, or several: L = R_0 E and E^T of the module's equation, (..., 3, 3)."""

    before: Array
    after: Array

    def turn(self, z: Array) -> Array:
        """R (..., 3, 3) at coordinates z (..., 6)."""
        return np.asarray(self.before @ _spun(z[..., 3]) @ turned_by(_swing(z[..., 4], z[..., 5])) @ self.after)

    def moved(self, z: Array, step: Array) -> Array:
        """Coordinates after a small step (..., 6) of the place and about the axes of the world."""
        back = np.swapaxes(self.before, -1, -2)
        own = back @ turned_by(step[..., 3:]) @ self.turn(z) @ np.swapaxes(self.after, -1, -2)
        across = np.hypot(own[..., 2, 0], own[..., 2, 1])
        straight = across < 1e-12
        factor = np.where(straight, 1.0, np.arctan2(across, own[..., 2, 2]) / np.where(straight, 1.0, across))
        swing = _swing(own[..., 2, 1] * factor, -own[..., 2, 0] * factor)
        spun = own @ turned_by(-swing)
        spin = np.arctan2(spun[..., 1, 0], spun[..., 0, 0])
        spin += 2.0 * np.pi * np.round((z[..., 3] - spin) / (2.0 * np.pi))
        return np.concatenate([z[..., :3] + step[..., :3], spin[..., None], swing[..., :2]], axis=-1)

    def rates(self, z: Array, rate: Array) -> Array:
        """Rates (..., 6) of the coordinates of links whose place and angular velocity change by ``rate``."""
        swing = _swing(z[..., 4], z[..., 5])
        _, second, third = _series(np.linalg.norm(swing, axis=-1))
        across = skew(swing)
        slope = np.eye(3) + second * across + third * (across @ across)
        slope[..., 2] = [0.0, 0.0, 1.0]
        turned = _spun(-z[..., 3]) @ (np.swapaxes(self.before, -1, -2) @ rate[..., 3:, None])
        own = np.linalg.solve(slope, turned)[..., 0]
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
    """k points (k, 3) [m] in axes of a link, and how it lies."""

    place: Array
    lie: Lie

    def arms(self, z: Array) -> Array:
        """Vectors (B, k, 3) from the origin of the link to the points, in axes of the ground."""
        return np.asarray(self.place @ np.swapaxes(self.lie.turn(z), -1, -2))

    def moved(self, z: Array) -> Array:
        """Places on the ground (B, k, 3) at coordinates z (B, 6)."""
        return np.asarray(z[:, None, :3] + self.arms(z))


class SpatialBody(NamedTuple):
    """A rigid body: mass [kg], moments of inertia about its centre along the link's axes [kg m^2], centre [m]."""

    mass: float
    inertia: Vector = (0.0, 0.0, 0.0)
    centre: Vector = (0.0, 0.0, 0.0)

    def particles(self) -> tuple[Array, Array]:
        """Places (7, 3) and masses (7,) that move like the body; that in the middle may be negative.

        Raises
        ------
        ParameterError
            If no body has such moments of inertia: each is at most the sum of the others.
        """
        squares = 0.5 * np.sum(self.inertia) - np.array(self.inertia)
        if np.any(squares < -1e-9 * np.sum(self.inertia)):
            raise ParameterError(
                f"moments of inertia {', '.join(f'{one:g}' for one in self.inertia)} kg m^2 belong to no body; "
                "allowed: each at most the sum of the two others"
            )
        arms = REACH * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
        outer = np.tile(squares / (2.0 * REACH**2), 2)
        return np.array(self.centre) + arms, np.concatenate([[self.mass - outer.sum()], outer])


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
    own = axes_of(np.array(axis))
    lies = np.eye(3)
    for unit, angle in zip(np.eye(3), orientation, strict=True):
        lies = turned_by(angle * unit[None])[0] @ lies
    lie = Lie(lies @ own, own.T)
    parts = [body.particles() for body in bodies]
    place = np.concatenate([np.zeros((0, 3)), *(part[0] for part in parts)])
    mass = np.concatenate([np.zeros(0), *(part[1] for part in parts)])
    named = {point: SpatialPlaces(np.array([at]), lie) for point, at in points.items()}
    return Link(name, named, SpatialPlaces(place, lie), mass, np.zeros(len(mass)), rigid=RIGID)
