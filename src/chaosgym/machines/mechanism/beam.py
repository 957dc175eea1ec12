r"""A flexible link: a slender beam along the x axis of its frame, with rigid bodies at its ends.

Its elastic coordinates are its stretch and the lowest bending modes of the beam that is pinned at both ends and
carries the bodies there (Craig and Bampton 1968). A point beyond s is drawn in by half the integral of the squared
slope up to s, so that tension of the nominal motion stiffens bending.

References
----------
Craig and Bampton, Coupling of substructures for dynamic analyses, AIAA Journal 6 (1968); thesis 2.2 and 4.3.
"""

import math
from collections.abc import Mapping
from functools import cache, partial
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.matrices import product
from chaosgym.machines.beam_element import POINTS, bending_matrices, fitted_modes, interpolation
from chaosgym.machines.mechanism.links import Beam, Body, Link, LinkPlaces, together

ELEMENTS = 10
"""Finite elements, at least; more modes take two a mode."""

START, END = "start", "end"
"""Points of a beam."""

STRETCH = "stretch"


class BendingModes(NamedTuple):
    """Modes of a beam in a plane, pinned at both ends; p points of integration.

    Attributes
    ----------
    squares : (m,)
        Squares of their angular frequencies [rad^2/s^2]; modal masses are 1.
    position, weight : (p,)
        Points along the beam and the lengths [m] they stand for.
    deflection, slope : (p, m)
        Of the modes there.
    end_slope : (2, m)
        Slopes of the modes at start and end.
    drawn : (p, m, m)
        Integrals of products of the slopes up to each point.
    whole : (m, m)
        Likewise up to the end.
    """

    squares: Array
    position: Array
    weight: Array
    deflection: Array
    slope: Array
    end_slope: Array
    drawn: Array
    whole: Array


def bending_of(beam: Beam, second_moment: float, ends: tuple[tuple[float, float], ...]) -> BendingModes:
    """Modes of a beam in a plane.

    Parameters
    ----------
    beam
        The beam.
    second_moment
        Of its cross section for bending in that plane [m^4].
    ends
        Of what turns with start and end: static moment along the beam [kg m], and moment of inertia about that end
        [kg m^2].
    """
    count = max(ELEMENTS, 2 * beam.modes)
    lengths, line = np.full(count, beam.length / count), beam.density * beam.area
    mass, stiffness = bending_matrices(lengths, beam.youngs_modulus * second_moment, line)
    points, size = interpolation(lengths), 2 * count + 2
    slopes = (1, size - 1)
    for slope, (static, inertia) in zip(slopes, ends, strict=True):
        mass[slope, slope] += inertia
        # felt by fitted modes alone: the modes themselves do not move the ends
        mass[slope, slope - 1] += static
    inner = [i for i in range(size) if i not in (0, size - 2)]
    at = np.ix_(inner, inner)
    kept, modes = beam.modes, beam.modes + beam.fitted
    squares, shapes = matrices.eigh(stiffness[at], mass[at])
    if not beam.fitted:
        squares, shapes = squares[:kept], shapes[:, :kept]
    if beam.fitted:
        straight = np.full(size, 1.0 / beam.length)
        straight[::2] = np.linspace(0.0, 1.0, count + 1)
        driven = product(shapes.T, product(mass, straight)[inner])
        angular, mix = fitted_modes(np.sqrt(squares[kept:]), driven[kept:], beam.fitted)
        squares = np.concatenate([squares[:kept], angular**2])
        shapes = np.hstack([shapes[:, :kept], product(shapes[:, kept:], mix)])
    basis = np.zeros((size, modes))
    basis[inner] = shapes * np.where(shapes[0] < 0.0, -1.0, 1.0)
    inside = product(points.slope, basis)
    drawn, whole = _drawn_in(inside, beam.length / count)
    return BendingModes(
        squares,
        points.position,
        points.weight,
        product(points.deflection, basis),
        inside,
        basis[list(slopes)],
        drawn,
        whole,
    )


def elastic_of(beam: Beam, carried: float, planes: tuple[BendingModes, ...]) -> tuple[Array, Array]:
    """Stiffness and damping (e,) of the stretch, with a mass [kg] at the end, and of the modes in some planes."""
    line, spring = beam.density * beam.area, beam.youngs_modulus * beam.area / beam.length
    squares = np.concatenate([plane.squares for plane in planes])
    stretches = [spring] * int(beam.stretches)
    inertia = np.concatenate([[line * beam.length / 3.0 + carried] * len(stretches), np.ones(len(squares))])
    stiffness = np.concatenate([stretches, squares])
    return stiffness, 2.0 * beam.damping_ratio * np.sqrt(stiffness * inertia)


def beam_link(name: str, beam: Beam, ends: Mapping[str, tuple[Body, ...]], angle: float = 0.0) -> Link:
    """Return a link that bends.

    Parameters
    ----------
    name
        Of the link; its points are "start" and "end".
    beam
        Its beam.
    ends
        Rigid bodies that turn with the beam's start and end; their centres count from there.
    angle
        Rough turn [rad] at crank angle 0.
    """
    turning = []
    for end in (START, END):
        bodies = ends.get(end, ())
        about = sum(body.inertia + body.mass * float(product(body.centre, body.centre)) for body in bodies)
        turning.append((sum(body.mass * body.centre[0] for body in bodies), about))
    bending = bending_of(beam, beam.second_moment, tuple(turning))
    first, modes = int(beam.stretches), beam.modes + beam.fitted
    elastic = first + modes

    def places(along: Array, across: Array, slope: Array, drawn: Array) -> LinkPlaces:
        shape, curve = np.zeros((len(along), 2, elastic)), np.zeros((len(along), 2, elastic, elastic))
        if first:
            shape[:, 0, 0] = along / beam.length
        shape[:, 1, first:] = across
        curve[:, 0, first:, first:] = -drawn
        full = np.concatenate([np.zeros((len(slope), first)), slope], axis=1)
        return LinkPlaces(np.stack([along, np.zeros_like(along)], axis=1), shape, full, curve)

    none = np.zeros_like(bending.slope)
    bar = places(bending.position, bending.deflection, none, bending.drawn)
    named, masses, weights = {}, [bar], list(beam.density * beam.area * bending.weight)
    inertias = [0.0] * len(weights)
    for end, place, slope in ((START, 0.0, bending.end_slope[:1]), (END, beam.length, bending.end_slope[1:])):
        named[end] = places(np.array([place]), none[:1], slope, bending.whole[None] * float(end == END))
        for body in ends.get(end, ()):
            masses.append(_offset(named[end], np.array(body.centre)))
            weights.append(body.mass)
            inertias.append(body.inertia)
    stiffness, damping = elastic_of(beam, sum(body.mass for body in ends.get(END, ())), (bending,))
    return Link(
        name,
        named,
        together(masses),
        np.array(weights),
        np.array(inertias),
        angle,
        (STRETCH,) * first + tuple(f"mode {k + 1}" for k in range(modes)),
        np.diag(stiffness),
        np.diag(damping),
        beam,
        remade=partial(beam_link, name, ends=ends, angle=angle),
    )


def fibre_stress(link: Link, beam: Beam, position: float, fibre: float) -> Array:
    r"""Stress (2, e) [Pa] at the upper and the lower outer fibre for each elastic coordinate of a link.

    Each mode of a uniform beam is w = c1 cos bx + c2 sin bx + c3 exp(-bx) + c4 exp(-b(l - x)), b^4 = rho A w_k^2 / E I.
    It is zero at both ends, where its slopes are known; so its curvature needs no derivative of the elements. The
    stretch pulls all of the section alike.

    Parameters
    ----------
    link, beam
        The link, and its beam.
    position
        Of the section [m] from the start on.
    fibre
        Distance [m] of the outer fibres from the neutral one.
    """
    first = int(beam.stretches)
    slopes = np.stack([link.points[end].slope[0, first:] for end in (START, END)])
    curvature = np.zeros(len(link.elastic))
    curvature[first:] = curvatures(beam, beam.second_moment, np.diag(link.stiffness)[first:], slopes, position)
    return pull_of(beam, len(curvature)) + beam.youngs_modulus * fibre * np.outer([-1.0, 1.0], curvature)


def pull_of(beam: Beam, elastic: int) -> Array:
    """Stress (e,) [Pa] of the whole section for each elastic coordinate: that of the stretch."""
    pull = np.zeros(elastic)
    pull[: int(beam.stretches)] = beam.youngs_modulus / beam.length
    return pull


def curvatures(beam: Beam, second_moment: float, squares: Array, slopes: Array, position: float) -> Array:
    """Curvature (m,) [1/m] of modes at a section [m], of their squares (m,) and slopes (2, m) at start and end."""
    length, line = beam.length, beam.density * beam.area
    found = np.zeros(len(squares))
    for k, b in enumerate(matrices.power(line * squares / (beam.youngs_modulus * second_moment), 0.25)):
        cosine, sine, fade = math.cos(b * length), math.sin(b * length), math.exp(-b * length)
        ends = [
            [1.0, 0.0, 1.0, fade],
            [cosine, sine, fade, 1.0],
            [0.0, b, -b, b * fade],
            [-b * sine, b * cosine, -b * fade, b],
        ]
        weights = matrices.solve(np.array(ends), np.array([0.0, 0.0, *slopes[:, k]]))
        shapes = [-math.cos(b * position), -math.sin(b * position), math.exp(-b * position)]
        found[k] = b**2 * float(product(weights, [*shapes, math.exp(-b * (length - position))]))
    return found


@cache
def parabolas() -> Array:
    """Coefficients of a parabola over an element from its values at the points of integration."""
    return matrices.pinv(np.vander(POINTS, 3, increasing=True))


def _drawn_in(slope: Array, length: float) -> tuple[Array, Array]:
    """Integrals of products of the slopes (p, modes) up to each integration point (p, modes, modes), and to the end.

    Slopes are parabolas over each element, of the given length.
    """
    powers = np.arange(3)
    coefficients = np.einsum("ik,ekm->eim", parabolas(), slope.reshape(-1, len(POINTS), slope.shape[1]))
    ends = powers[:, None] + powers + 1
    weight = length * matrices.power(np.append(POINTS, 1.0)[:, None, None], ends) / ends
    inside = np.einsum("kij,eim,ejn->ekmn", weight, coefficients, coefficients)
    before = np.cumsum(inside[:, -1], axis=0)
    upto = inside[:, :-1] + np.concatenate([np.zeros_like(before[:1]), before[:-1]])[:, None]
    return upto.reshape(-1, *before.shape[1:]), before[-1]


def _offset(end: LinkPlaces, centre: Array) -> LinkPlaces:
    """A point that turns with the end of a beam, away from it by ``centre`` (2,)."""
    slope = end.slope[0]
    shape = end.shape + np.outer([-centre[1], centre[0]], slope)
    curve = end.curve - centre[None, :, None, None] * np.outer(slope, slope)
    return LinkPlaces(end.place + centre, shape, end.slope, curve)
