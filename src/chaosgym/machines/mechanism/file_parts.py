"""Parts of a mechanism's file that differ in the plane and in space: points, bodies, links, axes of joints."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from chaosgym.errors import ParameterError
from chaosgym.machines.file_keys import needed
from chaosgym.machines.mechanism.beam import END, START
from chaosgym.machines.mechanism.joints import GROUND, KINDS, SPATIAL_KINDS, LinkJoint
from chaosgym.machines.mechanism.keys import HEAVIEST
from chaosgym.machines.mechanism.links import MOST_MODES, Beam, Body, Link
from chaosgym.machines.mechanism.space import SpatialBody, spatial_link
from chaosgym.machines.mechanism.spatial_beam import spatial_beam_link
from chaosgym.numbers import number, whole

T = TypeVar("T")


def _section(where: str, row: Mapping[str, Any]) -> tuple[float, float, float]:
    """Area of the cross section of a beam, and its second moments for bending along y and along z."""
    if "diameter" in row:
        if "width" in row or "height" in row:
            raise ParameterError(f"{where} has a diameter and a width or height; allowed: one of them")
        d = row["diameter"]
        return math.pi * d**2 / 4.0, math.pi * d**4 / 64.0, math.pi * d**4 / 64.0
    b, h = needed(where, row, "width", "height")
    return b * h, b * h**3 / 12.0, h * b**3 / 12.0


def beam_of(where: str, row: Mapping[str, Any]) -> Beam:
    """A beam."""
    length, modulus, density, modes = needed(where, row, "length", "youngs_modulus", "density", "modes")
    whole(f"{where}.modes", modes, 1, MOST_MODES)
    area, second, sideways = _section(where, row)
    told = row.get("damping_ratio", 0.0), row.get("stretch", True)
    return Beam(length, area, second, modulus, density, modes, *told, sideways_moment=sideways)


def bodies_at_ends(where: str, table: Mapping[str, Any], bodies: Sequence[T]) -> dict[str, tuple[T, ...]] | None:
    """Bodies of a link at either end of its beam; None if it is rigid."""
    places = [row.get("at") for row in table["body"]]
    if "beam" not in table:
        if any(places):
            raise ParameterError(f"{where}.at has a meaning at the ends of a beam only; leave it out")
        return None
    if not all(places):
        raise ParameterError(f"{where} lacks at: a body of a beam is at its 'start' or its 'end'")
    return {end: tuple(body for at, body in zip(places, bodies, strict=True) if at == end) for end in (START, END)}


def place_of(where: str, values: Any) -> tuple[float, ...]:
    """A point in the plane or in space."""
    if len(values) not in (2, 3):
        raise ParameterError(
            f"{where} has {len(values)} numbers; allowed: two, x and y, as in '50, 0 mm', or three in space"
        )
    return tuple(map(float, values))


def body_of(where: str, row: Mapping[str, Any]) -> Body:
    """A body of a link in the plane."""
    mass = _mass(where, row)
    (inertia,) = _inertia(where, row, 1)
    centre = place_of(f"{where}.centre", row.get("centre", np.zeros(2)))
    if len(centre) == 3:
        raise ParameterError(f"{where}.centre has a z; allowed: x and y, as all points of this file have")
    x, y = centre
    return Body(mass, inertia, (x, y))


def _inertia(where: str, row: Mapping[str, Any], count: int) -> tuple[float, ...]:
    given = row.get("inertia", np.zeros(count))
    if len(given) != count:
        what = "one, about the body's centre" if count == 1 else "three, about x, y and z of the link"
        raise ParameterError(f"{where}.inertia has {len(given)} numbers; allowed: {what}")
    return tuple(map(float, given))


def _mass(where: str, row: Mapping[str, Any]) -> float:
    (mass,) = needed(where, row, "mass")
    return number(f"{where}.mass", mass, 0.0, HEAVIEST, "kg", inside=True)


def in_space(place: tuple[float, ...]) -> tuple[float, float, float]:
    """A point whose z is 0 if it has none."""
    x, y, *z = place
    return x, y, z[0] if z else 0.0


def _spatial_body(where: str, row: Mapping[str, Any]) -> SpatialBody:
    along, across, sideways = _inertia(where, row, 3)
    centre = in_space(place_of(f"{where}.centre", row.get("centre", np.zeros(3))))
    body = SpatialBody(_mass(where, row), (along, across, sideways), centre)
    try:
        body.particles()
    except ParameterError as error:
        raise ParameterError(f"{where}: {error}") from None
    return body


def spatial_links(tables: Mapping[str, Any], joints: list[LinkJoint]) -> tuple[Link, ...]:
    """Links in space; each may turn right round about its axis, by default that of its pin on the ground, else z."""
    pins = [joint for joint in joints if joint.kind in ("revolute", "cylindrical")]
    axes = {joint.first[0]: joint.first_axis for joint in pins if joint.second[0] == GROUND}
    axes |= {joint.second[0]: joint.second_axis for joint in pins if joint.first[0] == GROUND}
    found = []
    for name, table in tables.items():
        where = f"link.{name}"
        if "angle" in table:
            raise ParameterError(f"{where}.angle has a meaning in the plane only; allowed in space: orientation")
        turns = _three(f"{where}.orientation", table.get("orientation", np.zeros(3)))
        bodies = tuple(_spatial_body(f"{where}.body", row) for row in table["body"])
        ends = bodies_at_ends(f"{where}.body", table, bodies)
        points = {point: in_space(place) for point, place in table["points"].items()}
        x, y, z = (math.radians(turn) for turn in turns)
        axis = _axis(f"{where}.axis", table.get("axis", axes.get(name, (0.0, 0.0, 1.0))))
        if ends is None:
            found.append(spatial_link(name, points, bodies, (x, y, z), axis))
        else:
            found.append(spatial_beam_link(name, beam_of(f"{where}.beam", table["beam"]), ends, (x, y, z), axis))
    return tuple(found)


def _three(where: str, values: Any) -> tuple[float, float, float]:
    if len(values) != 3:
        raise ParameterError(f"{where} has {len(values)} numbers; allowed: three, for x, y and z")
    x, y, z = (float(value) for value in values)
    return x, y, z


def axes_of_joint(where: str, kind: str, row: Mapping[str, Any]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Axis of a joint in space in axes of its first and of its second link."""
    if kind == "universal":
        needed(where, row, "first_axis", "second_axis")
    usual = np.array([1.0, 0.0, 0.0] if kind == "prismatic" else [0.0, 0.0, 1.0])
    first = _axis(f"{where}.first_axis", row.get("first_axis", usual))
    return first, _axis(f"{where}.second_axis", row.get("second_axis", first))


def _axis(where: str, values: Any) -> tuple[float, float, float]:
    axis = _three(where, values)
    if not math.hypot(*axis) > 1e-9:
        raise ParameterError(f"{where} has no direction; allowed: three numbers that are not all zero")
    return axis


def check_kind(where: str, kind: str, row: Mapping[str, Any], spatial: bool) -> None:
    """Refuse a kind, or a key of a joint, that belongs to the other sort of mechanism, or to another kind."""
    known = SPATIAL_KINDS if spatial else KINDS
    if kind not in known:
        raise ParameterError(
            f"{where} is {kind}, which a mechanism {'in space' if spatial else 'in the plane'} has not; allowed: "
            f"{', '.join(known)}" + ("" if spatial else ", or a point with a z, which makes it one in space")
        )
    for key, kinds in (("axis", ("prismatic", "slot")), ("turn", ("prismatic", "weld"))):
        if key in row and (spatial or kind not in kinds):
            what = "in space; write first_axis" if spatial else f"in a {kind} joint; leave it out"
            raise ParameterError(f"{where}.{key} has no meaning {what}")
    for key in ("first_axis", "second_axis"):
        if key in row and not spatial:
            raise ParameterError(f"{where}.{key} has a meaning in space only; allowed: axis, or points with a z")
