"""Joints of a mechanism's file: what they join, their gaps and surfaces, gears, and motions over the crank angle."""

import math
from collections.abc import Mapping
from typing import Any

from chaosgym.core.binned.model import LINEAR
from chaosgym.errors import ParameterError
from chaosgym.machines.contact_law import LAW_KEYS, hertzian, is_hertzian
from chaosgym.machines.file_keys import needed
from chaosgym.machines.friction_law import Friction, friction_of
from chaosgym.machines.loads import Cycle, cycle_of
from chaosgym.machines.mechanism.file_parts import axes_of_joint, check_kind
from chaosgym.machines.mechanism.friction import check_friction
from chaosgym.machines.mechanism.joints import GROUND, MESH, Clearance, LinkJoint, opened_by
from chaosgym.machines.mechanism.keys import LONGEST
from chaosgym.machines.parameters import suggestion
from chaosgym.numbers import number

SURFACE = ("stiffness", "damping")
"""What a linear surface has."""


def ends_of(where: str, row: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The two points that a row is between.

    Raises
    ------
    ParameterError
        If it does not name two.
    """
    (between,) = needed(where, row, "between")
    if len(between) != 2:
        raise ParameterError(f"{where}.between names {len(between)} points; allowed: two")
    return [end_of(f"{where}.between", each) for each in between]


def end_of(where: str, text: str) -> tuple[str, str]:
    """Link and point of a text such as 'crank.pin'.

    Raises
    ------
    ParameterError
        If it is no such text.
    """
    link, dot, point = text.partition(".")
    if not (link and dot and point):
        raise ParameterError(f"{where} = {text!r} is no point; allowed: LINK.POINT, such as 'crank.pin'")
    return link, point


def joints_of(rows: list[dict[str, Any]], spatial: bool) -> tuple[list[LinkJoint], dict[str, Clearance]]:
    """Joints of a mechanism, and the clearances of those that have one.

    Raises
    ------
    ParameterError
        If a key is missing, has no meaning in a kind of joint, or is out of range.
    """
    joints: list[LinkJoint] = []
    clearances: dict[str, Clearance] = {}
    for row in rows:
        (name,) = needed("joint", row, "name")
        if any(name == joint.name for joint in joints):
            raise ParameterError(f"two [[joint]] have the name {name!r}; allowed: a name of its own for each")
        where = f"joint {name}"
        (kind,) = needed(where, row, "kind")
        first, second = ends_of(where, row)
        check_kind(where, kind, row, spatial)
        clearance = _clearance(name, kind, row, spatial)
        driven = row.get("driven", False)
        if driven and clearance:
            raise ParameterError(f"{where} is driven and has clearance; allowed: one of them")
        if clearance:
            clearances[name] = clearance
        angles = (math.radians(row.get(key, 0.0)) for key in ("axis", "turn"))
        axis, turn = angles
        opened = opened_by(kind, clearance, spatial) if clearance else ()
        axes = axes_of_joint(where, kind, row) if spatial else ((), ())
        mesh = _mesh(where, kind, row)
        joints.append(LinkJoint(name, kind, first, second, axis, "", opened, driven, turn, *axes, None, *mesh))
    return joints, clearances


def _clearance(name: str, kind: str, row: Mapping[str, Any], spatial: bool) -> Clearance | None:
    """Clearance of a joint, if it has one."""
    where = f"joint {name}"
    if "clearance" not in row:
        for key in ("stiffness", "damping", *LAW_KEYS, "stations"):
            if key in row:
                raise ParameterError(f"{where} has {key} and no clearance; allowed: both, or none")
        return None
    gap, exponent = float(row["clearance"]), LINEAR
    if is_hertzian(row):
        stiffness, damping, exponent = hertzian(where, row)
    else:
        for key in ("impact_speed", "law"):
            if key in row:
                raise ParameterError(f"{where}.{key} needs a Hertzian surface; allowed: hertz_stiffness, or damping")
        if "restitution" in row and "damping" in row:
            raise ParameterError(f"{where} has restitution and damping; allowed: one of them")
        # a restitution becomes a damper once it is known what mass strikes
        stiffness, damping = map(
            float, needed(where, {"damping": 0.0, **row} if "restitution" in row else row, *SURFACE)
        )
    stations = tuple(number(f"{where}.stations", at, -LONGEST, LONGEST, "m") for at in row.get("stations", ()))
    if stations and len(set(stations)) < 2:
        raise ParameterError(
            f"{where}.stations are at one place; allowed: two or more, or none for a guide without tilt"
        )
    found = Clearance(gap, stiffness, damping, stations, exponent)
    for what, (value, about) in found.fields.items():
        number(f"{name}_{what}", value, about["low"], about["high"], about["unit"].strip("-"))
    try:
        opened_by(kind, found, spatial)
    except ParameterError as error:
        raise ParameterError(f"{where}: {error}") from None
    return found


def _mesh(where: str, kind: str, row: Mapping[str, Any]) -> tuple[tuple[float, ...], str]:
    """Radii and carrier of a gear or belt."""
    if kind not in MESH:
        for key in ("radii", "carrier"):
            if key in row:
                raise ParameterError(f"{where}.{key} has no meaning in a {kind} joint; leave it out")
        return (), GROUND
    (radii,) = needed(where, row, "radii")
    if len(radii) != 2:
        raise ParameterError(f"{where}.radii has {len(radii)} numbers; allowed: two, of the pitch circles in turn")
    first, second = (number(f"{where}.radii", each, -LONGEST, LONGEST, "m") for each in radii)
    if not (first and second):
        raise ParameterError(f"{where}.radii = 0 m is out of range; allowed: other than 0, below 0 for an inner gear")
    return (first, second), row.get("carrier", GROUND)


def frictions_of(rows: list[dict[str, Any]], spatial: bool) -> dict[str, Friction]:
    """Friction of the joints that have some.

    Raises
    ------
    ParameterError
        If a joint can't have it.
    """
    found = {}
    for row in rows:
        friction = friction_of(row["name"], row)
        if friction is None:
            continue
        try:
            check_friction(row["kind"], friction, "clearance" in row, spatial)
        except ParameterError as error:
            raise ParameterError(f"joint {row['name']}: {error}") from None
        found[row["name"]] = friction
    return found


def with_motions(rows: list[dict[str, Any]], joints: list[LinkJoint]) -> list[LinkJoint]:
    """Joints, the motions of some prescribed over the crank angle.

    Raises
    ------
    ParameterError
        If there is no such joint, or one that can't be moved so.
    """
    found = {joint.name: joint for joint in joints}
    for row in rows:
        (name,) = needed("motion", row, "joint")
        if name not in found:
            raise ParameterError(f"motion.joint = {name!r} is no joint{suggestion(name, found)}")
        joint, key, unit = (
            found[name],
            *{"prismatic": ("displacement", "m"), "revolute": ("swing", "deg")}.get(found[name].kind, ("", "")),
        )
        if not key or joint.opened or joint.driven or joint.first_axis:
            what = "has clearance" if joint.opened else "is driven" if joint.driven else f"is {joint.kind}"
            raise ParameterError(
                f"motion.joint = {name!r} {'is in space' if joint.first_axis else what}; allowed: a tight prismatic or "
                "revolute joint in the plane"
            )
        (_,) = needed("motion", row, key)
        cycle = cycle_of("motion", row, key, unit)
        size = math.radians(1.0) if unit == "deg" else 1.0
        harmonics = tuple((order, size * c, size * s) for order, c, s in cycle.harmonics)
        found[name] = joint._replace(moves=Cycle(size * cycle.mean, harmonics, size * cycle.left_out))
    return list(found.values())
