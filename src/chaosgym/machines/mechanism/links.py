r"""Links of a planar mechanism: where their points are, and how these move with the coordinates of the link.

A link has coordinates z = (x, y, phi, q): the place of its frame on the ground, its turn, and elastic coordinates q, of
which a rigid link has none. A point lies at

    r = (x, y) + R(phi) (rho + N q + 1/2 q C q)

with its place rho, shape N and curve C in the axes of the link. In the nominal motion q is zero.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.matrices import product

RIGID = 3
"""Coordinates of a rigid link: two places and a turn."""

MOST_MODES = 12
"""Modes that a beam may keep, in each plane."""

_QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])


def rotation(angle: Array) -> Array:
    """Turn of vectors by angles (...,) [rad]: (..., 2, 2)."""
    turn = np.empty((*angle.shape, 2, 2))
    turn[..., 0, 0] = turn[..., 1, 1] = matrices.cos(angle)
    turn[..., 1, 0] = matrices.sin(angle)
    turn[..., 0, 1] = -turn[..., 1, 0]
    return turn


def quarter_after(turn: Array) -> Array:
    """Derivative of a turn (..., 2, 2) by its angle."""
    return np.asarray(product(turn, _QUARTER))


class LinkPlaces(NamedTuple):
    """k points of a link with e elastic coordinates.

    Attributes
    ----------
    place : (k, 2)
        In the axes of the link [m].
    shape : (k, 2, e)
        Motion per unit of each elastic coordinate.
    slope : (k, e)
        Turn [rad] per unit of each elastic coordinate.
    curve : (k, 2, e, e)
        Second derivative of the place by the elastic coordinates.
    """

    place: Array
    shape: Array
    slope: Array
    curve: Array

    def moved(self, z: Array) -> Array:
        """Places on the ground (B, k, 2) at coordinates z (B, 3 + e), whose elastic ones are zero."""
        return np.asarray(z[:, None, :2] + product(self.place, np.swapaxes(rotation(z[:, 2]), -1, -2)))

    def gradient(self, z: Array) -> Array:
        """Derivatives of the places by the coordinates, (B, k, 2, 3 + e)."""
        turn, (count, _, elastic) = rotation(z[:, 2]), self.shape.shape
        gradient = np.zeros((len(z), count, 2, RIGID + elastic))
        gradient[:, :, 0, 0] = gradient[:, :, 1, 1] = 1.0
        gradient[..., 2] = product(self.place, np.swapaxes(quarter_after(turn), -1, -2))
        gradient[..., RIGID:] = product(turn[:, None], self.shape)
        return gradient

    def bent(self, z: Array, force: Array) -> Array:
        """Second derivatives of the places times forces (..., B, k, 2), summed over the points: (..., B, z, z)."""
        turn, size = rotation(z[:, 2]), RIGID + self.shape.shape[2]
        own = product(force, turn)
        bent = np.zeros((*force.shape[:-2], size, size))
        bent[..., 2, 2] = -np.einsum("...ki,ki->...", own, self.place)
        bent[..., 2, RIGID:] = np.einsum("...ki,kie->...e", product(force, quarter_after(turn)), self.shape)
        bent[..., RIGID:, 2] = bent[..., 2, RIGID:]
        bent[..., RIGID:, RIGID:] = np.einsum("...ki,kief->...ef", own, self.curve)
        return bent


def fixed(place: Array) -> LinkPlaces:
    """Points (k, 2) of a link without elastic coordinates."""
    place = np.asarray(place, dtype=float).reshape(-1, 2)
    count = len(place)
    return LinkPlaces(place, np.zeros((count, 2, 0)), np.zeros((count, 0)), np.zeros((count, 2, 0, 0)))


def together(some: list[LinkPlaces]) -> LinkPlaces:
    """Points of one link in a row."""
    return LinkPlaces(*(np.concatenate(parts) for parts in zip(*some, strict=True)))


class Body(NamedTuple):
    """A rigid body of a link: mass [kg], inertia about its own centre [kg m^2], and the centre [m]."""

    mass: float
    inertia: float = 0.0
    centre: tuple[float, float] = (0.0, 0.0)


class Beam(NamedTuple):
    """A uniform beam.

    Attributes
    ----------
    length
        From start to end [m].
    area, second_moment
        Of the cross section [m^2], [m^4].
    youngs_modulus, density
        [Pa], [kg/m^3].
    modes
        Bending modes that are kept.
    damping_ratio
        Of every mode, and of the stretch.
    stretches
        Whether its length changes.
    fitted
        Modes that stand for all others, as inertia that the beam's end feels.
    sideways_moment
        Second moment [m^4] of the cross section for bending out of the plane of x and y, in space.
    """

    length: float
    area: float
    second_moment: float
    youngs_modulus: float
    density: float
    modes: int
    damping_ratio: float = 0.0
    stretches: bool = True
    fitted: int = 0
    sideways_moment: float = 0.0


class Link(NamedTuple):
    """A link of a mechanism.

    Attributes
    ----------
    name
        How joints name it.
    points
        One point each, by name: ``LinkPlaces``, or ``SpatialPlaces``.
    masses
        Where its particles are, likewise.
    mass, inertia : (k,)
        Of each particle [kg], and what turns with it [kg m^2].
    angle
        Rough turn [rad] at crank angle 0: tells which way a loop is closed.
    elastic
        Names of the elastic coordinates.
    stiffness, damping : (e, e)
        Of the elastic coordinates.
    beam
        What bends, if it is a uniform beam.
    rigid
        Coordinates of the link apart from elastic ones: in the plane or in space.
    turning : (3, z, z)
        In space, of bodies whose mass lies along each axis of the link: sum m du^T du of the unit vectors u there.
    remade
        The same link of another ``beam``, if it bends.
    """

    name: str
    points: Mapping[str, Any]
    masses: Any
    mass: Array
    inertia: Array
    angle: float = 0.0
    elastic: tuple[str, ...] = ()
    stiffness: Array = np.zeros((0, 0))
    damping: Array = np.zeros((0, 0))
    beam: Beam | None = None
    rigid: int = RIGID
    turning: Array = np.zeros((3, 0, 0))
    remade: "Callable[[Beam], Link] | None" = None

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return self.rigid + len(self.elastic)


class Inertia(NamedTuple):
    """Inertia of a link with e coordinates in its own axes, where it does not depend on the crank angle.

    Attributes
    ----------
    translating, gyroscopic, turning : (e, e)
        Sum m H^T H and sum m H^T Q H of the particles, which move in axes of the link by H per unit coordinate; Q turns
        by a quarter. What turns with the particles.
    pull : (4, e)
        Sum m H^T a of four accelerations of the points: 1 along x, 1 along y, Q rho and rho.
    bent : (4, e, e)
        Likewise, the second derivatives of the points times m a.
    """

    translating: Array
    gyroscopic: Array
    turning: Array
    pull: Array
    bent: Array


def inertia_of(link: Link) -> Inertia:
    """Inertia of a link in its own axes."""
    still, places, count = np.zeros((1, link.size)), link.masses, len(link.mass)
    motion = places.gradient(still)[0]
    unit = np.broadcast_to(np.eye(2)[:, None], (2, count, 2))
    pushed = link.mass[:, None] * np.concatenate([unit, [product(places.place, _QUARTER.T), places.place]])
    row = np.hstack([np.zeros((count, 2)), np.ones((count, 1)), places.slope])
    return Inertia(
        np.einsum("k,kiz,kiy->zy", link.mass, motion, motion),
        np.einsum("k,kiz,ij,kjy->zy", link.mass, motion, _QUARTER, motion),
        product(row.T, link.inertia[:, None] * row),
        np.einsum("fki,kiz->fz", pushed, motion),
        places.bent(still, pushed[:, None])[:, 0],
    )


def rigid_link(
    name: str, points: Mapping[str, tuple[float, float]], bodies: tuple[Body, ...] = (), angle: float = 0.0
) -> Link:
    """Return a link that neither bends nor stretches; points [m] and bodies in its axes, ``angle`` [rad]."""
    return Link(
        name,
        {point: fixed(np.array(place)) for point, place in points.items()},
        fixed(np.array([body.centre for body in bodies]).reshape(-1, 2)),
        np.array([body.mass for body in bodies], dtype=float),
        np.array([body.inertia for body in bodies], dtype=float),
        angle,
    )
