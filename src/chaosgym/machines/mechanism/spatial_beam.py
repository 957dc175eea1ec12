r"""A flexible link in space: a slender beam along the x axis of its frame that bends in two planes.

Its elastic coordinates are its stretch, then its bending modes along y, then those along z, as in the plane (``beam``).
It does not twist: where it bends in both planes its end turns about x, against its start, by

    1/2 int (v' w'' - w' v'') ds

with deflections v along y and w along z, which is the rotation of a line that carries no torque (Bishop 1975).

References
----------
Bishop, There is more than one way to frame a curve, American Mathematical Monthly 82 (1975).
"""

import math
from collections.abc import Mapping
from functools import partial

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.matrices import product
from chaosgym.errors import ParameterError
from chaosgym.machines.beam_element import POINTS
from chaosgym.machines.mechanism.beam import (
    END,
    START,
    STRETCH,
    BendingModes,
    bending_of,
    curvatures,
    elastic_of,
    parabolas,
    pull_of,
)
from chaosgym.machines.mechanism.links import Beam, Link
from chaosgym.machines.mechanism.space import (
    RIGID,
    Lie,
    SpatialBody,
    SpatialPlaces,
    Vector,
    lying,
    spatially_together,
)

Carried = Mapping[str, tuple[SpatialBody, ...]]

FIBRES = 16
"""Fibres around a round section at which stress is told: the largest is missed by 2 % at most."""


def spatial_beam_link(
    name: str,
    beam: Beam,
    ends: Carried,
    orientation: Vector = (0.0, 0.0, 0.0),
    axis: Vector = (0.0, 0.0, 1.0),
    along: Carried | None = None,
) -> Link:
    """Return a link in space that bends.

    Parameters
    ----------
    name
        Of the link; its points are "start" and "end".
    beam
        Its beam.
    ends
        Rigid bodies that turn with the beam's start and end; their centres count from there.
    orientation, axis
        As of ``spatial_link``.
    along
        Bodies of other links at its ends that turn with them in the plane of x and y alone. They have a part in the
        shapes of the modes, and no mass here.
    """
    lie, beside = lying(orientation, axis), along or {}
    planes = (
        bending_of(beam, beam.second_moment, _turning(1, ends, beside)),
        bending_of(beam, beam.sideways_moment, _turning(2, ends, {})),
    )
    named = {START: _end(beam, planes, lie, 0), END: _end(beam, planes, lie, 1)}
    bar = planes[0]
    masses = [
        _points(beam, planes, lie, bar.position, [plane.deflection for plane in planes], bar.drawn, planes[1].drawn)
    ]
    weights = [beam.density * beam.area * bar.weight]
    turning = np.zeros((3, RIGID + masses[0].shape.shape[-1], RIGID + masses[0].shape.shape[-1]))
    for end, bodies in ends.items():
        for body in bodies:
            place, mass = body.particles()
            masses.append(named[end].beside(place))
            weights.append(mass)
            turning += body.turning(named[end].slope[0])
    carried = sum(body.mass for each in (ends, beside) for body in each.get(END, ()))
    stiffness, damping = elastic_of(beam, carried, planes)
    modes = range(1, 1 + beam.modes + beam.fitted)
    names = (STRETCH,) * int(beam.stretches)
    names += tuple(f"{plane}mode {k}" for plane in ("", "sideways ") for k in modes)
    mass = np.concatenate(weights)
    return Link(
        name,
        named,
        spatially_together(masses),
        mass,
        np.zeros(len(mass)),
        0.0,
        names,
        np.diag(stiffness),
        np.diag(damping),
        beam,
        RIGID,
        turning,
        partial(spatial_beam_link, name, ends=ends, orientation=orientation, axis=axis, along=along),
    )


def _turning(way: int, ends: Carried, beside: Carried) -> tuple[tuple[float, float], ...]:
    """Static moment and moment of inertia of the bodies at start and end, for bending along y (1) or z (2)."""
    found = []
    for end in (START, END):
        bodies = (*ends.get(end, ()), *beside.get(end, ()))
        about = [body.inertia[3 - way] + body.mass * (body.centre[0] ** 2 + body.centre[way] ** 2) for body in bodies]
        found.append((sum(body.mass * body.centre[0] for body in bodies), sum(about)))
    return tuple(found)


def _points(
    beam: Beam,
    planes: tuple[BendingModes, BendingModes],
    lie: Lie,
    along: Array,
    across: list[Array],
    *drawn: Array,
) -> SpatialPlaces:
    """Points (k, 3) of the beam's line at places (k,) along it, whose slope does not matter."""
    first, modes = int(beam.stretches), len(planes[0].squares)
    elastic, count = first + 2 * modes, len(along)
    shape, curve = np.zeros((count, 3, elastic)), np.zeros((count, 3, elastic, elastic))
    shape[:, 0, :first] = along[:, None] / beam.length
    for plane in (0, 1):
        own = slice(first + plane * modes, first + (plane + 1) * modes)
        shape[:, 1 + plane, own] = across[plane]
        curve[:, 0, own, own] = -drawn[plane]
    place = along[:, None] * np.array([1.0, 0.0, 0.0])
    return SpatialPlaces(place, lie, shape, np.zeros_like(shape), curve, np.zeros((count, elastic, elastic)))


def _end(beam: Beam, planes: tuple[BendingModes, BendingModes], lie: Lie, end: int) -> SpatialPlaces:
    """Start (0) or end (1) of the beam."""
    first, modes = int(beam.stretches), len(planes[0].squares)
    flat = np.zeros((1, modes))
    drawn = [plane.whole[None] * end for plane in planes]
    found = _points(beam, planes, lie, np.array([beam.length * end]), [flat, flat], *drawn)
    found.slope[0, 2, first : first + modes] = planes[0].end_slope[end]
    found.slope[0, 1, first + modes :] = -planes[1].end_slope[end]
    if end:
        mixed = 0.5 * _twist(planes, beam.length)
        found.twist[0, first : first + modes, first + modes :] = mixed
        found.twist[0, first + modes :, first : first + modes] = mixed.T
    return found


def _twist(planes: tuple[BendingModes, BendingModes], length: float) -> Array:
    """Integrals (m, m) of v' w'' - v'' w' over the beam, of modes v along y and w along z."""
    found = []
    for plane in planes:
        found.append(np.einsum("ik,ekm->eim", parabolas(), plane.slope.reshape(-1, len(POINTS), plane.slope.shape[1])))
    powers = np.arange(3)
    # a slope is a parabola over an element, and the element's length leaves the integral
    sums = np.maximum(powers[:, None] + powers, 1)
    weight = (powers[None] - powers[:, None]) / sums
    return np.asarray(np.einsum("ij,eim,ejn->mn", weight, *found))


def fibre_stress_around(link: Link, beam: Beam, position: float, fibre: float) -> Array:
    """Stress (16, e) [Pa] at fibres around a round section for each elastic coordinate, from y over z; see ``beam``.

    Raises
    ------
    ParameterError
        If the section is not round.
    """
    if not math.isclose(beam.second_moment, beam.sideways_moment):
        raise ParameterError(f"link {link.name!r} bends in space and is not round; allowed there: a beam with diameter")
    first = int(beam.stretches)
    modes = (len(link.elastic) - first) // 2
    squares, ends = np.diag(link.stiffness)[first:], [link.points[end].slope[0] for end in (START, END)]
    bent = np.zeros((2, len(link.elastic)))
    for plane, (about, sign) in enumerate(((2, 1.0), (1, -1.0))):
        own = slice(first + plane * modes, first + (plane + 1) * modes)
        slopes = sign * np.stack([end[about, own] for end in ends])
        bent[plane, own] = curvatures(
            beam, beam.second_moment, squares[own.start - first : own.stop - first], slopes, position
        )
    around = np.arange(FIBRES) * (2.0 * math.pi / FIBRES)
    outward = np.stack([matrices.cos(around), matrices.sin(around)], axis=1)
    return np.asarray(pull_of(beam, len(link.elastic)) - beam.youngs_modulus * fibre * product(outward, bent))
