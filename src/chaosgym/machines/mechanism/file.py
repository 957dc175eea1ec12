"""The file of a mechanism: links, joints and what pulls at them, with units; a class of machines out of it."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import ParameterError
from chaosgym.machines.file_keys import needed
from chaosgym.machines.machine import TaskDefaults
from chaosgym.machines.mechanism.beam import beam_link
from chaosgym.machines.mechanism.clearance import Clearance, opened_by, surface_fields
from chaosgym.machines.mechanism.file_parts import (
    LONGEST,
    axes_of_joint,
    beam_of,
    bodies_at_ends,
    body_of,
    check_kind,
    in_space,
    place_of,
    spatial_links,
)
from chaosgym.machines.mechanism.forces import STROKE_ANGLES, Force, Gas, Sampled, Spring
from chaosgym.machines.mechanism.joints import Joint
from chaosgym.machines.mechanism.keys import KEYS
from chaosgym.machines.mechanism.links import Link, rigid_link
from chaosgym.machines.mechanism.machine import MechanismMachine
from chaosgym.machines.mechanism.machine_class import machine_of
from chaosgym.machines.mechanism.mechanism import Mechanism
from chaosgym.machines.mechanism.nominal import places, revolution_of
from chaosgym.machines.mechanism.spatial import SpatialMechanism
from chaosgym.machines.parameters import parameter
from chaosgym.machines.stated import range_of, state_of, tolerances_of
from chaosgym.numbers import number

STILL = 1e-6
"""Stroke of a piston, as a share of the mechanism's length, below which it stands still."""


def tables_of(values: Mapping[str, Any], _folder: Path) -> dict[str, Any]:
    """All tables of a file, values in SI.

    Raises
    ------
    ParameterError
        If a table or a key is missing or unknown, or a unit or a value is wrong.
    """
    for name in KEYS.required:
        if name not in values:
            raise ParameterError(f"[{name}] is missing" if name != "joint" else "[[joint]] is missing")
    data: dict[str, Any] = {"": KEYS.checked("", values)}
    for path in ("ground", "motor", "operation", "tolerances", "job"):
        data[path] = KEYS.checked(path, values.get(path, {}))
    if "motor" not in values:
        data["motor"] = None
    data["ground.points"] = _points("ground", values["ground"])
    if not isinstance(values["link"], dict) or not values["link"]:
        raise ParameterError("[link.NAME] is missing: each link is a table, such as [link.crank]")
    data["link"] = {name: _link_table(name, table) for name, table in values["link"].items()}
    for path in ("joint", "force", "gas", "spring"):
        data[path] = [KEYS.checked(path, row) for row in _list(path, values.get(path, []))]
    points = [data["ground.points"], *(link["points"] for link in data["link"].values())]
    data["spatial"] = any(len(place) == 3 for some in points for place in some.values())
    return data


def files_of(_values: Mapping[str, Any], _folder: Path) -> list[Path]:
    """Files that the tables name: none."""
    return []


def _list(path: str, given: Any) -> list[Any]:
    if not isinstance(given, list):
        raise ParameterError(f"[{path}] is a list: write [[{path}]] for each")
    return given


def _points(where: str, table: Any) -> dict[str, tuple[float, ...]]:
    found = {}
    path = f"{where.partition('.')[0]}.points"
    for name, values in KEYS.checked(path, table.get("points", {}), f"{where}.points").items():
        found[name] = place_of(f"{where}.points.{name}", values)
    return found


def _link_table(name: str, table: Any) -> dict[str, Any]:
    where = f"link.{name}"
    values = KEYS.checked("link", table, where)
    values["points"] = _points(where, table)
    rows = _list(f"{where}.body", table.get("body", []))
    values["body"] = [KEYS.checked("link.body", row, f"{where}.body") for row in rows]
    if "beam" in table:
        values["beam"] = KEYS.checked("link.beam", table["beam"], f"{where}.beam")
        if values["points"]:
            raise ParameterError(f"{where} has a beam, whose points are 'start' and 'end'; leave [{where}.points] out")
    return values


def _link(name: str, table: Mapping[str, Any]) -> Link:
    for key in ("orientation", "axis"):
        if key in table:
            raise ParameterError(f"link.{name}.{key} has a meaning in space only; allowed: angle, or points with a z")
    where, angle = f"link.{name}.body", math.radians(table.get("angle", 0.0))
    bodies = [body_of(where, row) for row in table["body"]]
    ends = bodies_at_ends(where, table, bodies)
    if ends is None:
        return rigid_link(name, table["points"], tuple(bodies), angle)
    return beam_link(name, beam_of(f"link.{name}.beam", table["beam"]), ends, angle)


def _ends(where: str, row: Mapping[str, Any]) -> list[tuple[str, str]]:
    (between,) = needed(where, row, "between")
    if len(between) != 2:
        raise ParameterError(f"{where}.between names {len(between)} points; allowed: two")
    return [_end(f"{where}.between", each) for each in between]


def _end(where: str, text: str) -> tuple[str, str]:
    link, dot, point = text.partition(".")
    if not (link and dot and point):
        raise ParameterError(f"{where} = {text!r} is no point; allowed: LINK.POINT, such as 'crank.pin'")
    return link, point


def _clearance(name: str, kind: str, row: Mapping[str, Any], spatial: bool) -> Clearance | None:
    """Clearance of a joint, if it has one."""
    where = f"joint {name}"
    if "clearance" not in row:
        for key in ("stiffness", "damping", "hertz_stiffness", "hertz_damping", "friction", "radius", "stations"):
            if key in row:
                raise ParameterError(f"{where} has {key} and no clearance; allowed: both, or none")
        return None
    hertz = "hertz_stiffness" in row or "hertz_damping" in row
    for key in ("stiffness", "damping"):
        if hertz and key in row:
            raise ParameterError(f"{where} has {key} and is Hertzian; allowed: hertz_{key} in place of {key}")
    gap, stiffness, damping = map(float, needed(where, row, *surface_fields(hertz)))
    stations = tuple(number(f"{where}.stations", at, -LONGEST, LONGEST, "m") for at in row.get("stations", ()))
    if stations and len(set(stations)) < 2:
        raise ParameterError(
            f"{where}.stations are at one place; allowed: two or more, or none for a guide without tilt"
        )
    found = Clearance(gap, stiffness, damping, stations, row.get("friction"), hertz, row.get("radius"))
    if found.radius == 0.0:
        raise ParameterError(
            f"{name}_radius = 0 m leaves the friction of a pin without moment; allowed: above 0, or neither friction "
            "nor radius"
        )
    for what, (value, about) in found.fields.items():
        number(f"{name}_{what}", value, about["low"], about["high"], about["unit"].strip("-"))
    try:
        opened_by(kind, found, spatial)
    except ParameterError as error:
        raise ParameterError(f"{where}: {error}") from None
    return found


def _joints(rows: list[dict[str, Any]], spatial: bool) -> tuple[list[Joint], dict[str, Clearance]]:
    joints: list[Joint] = []
    clearances: dict[str, Clearance] = {}
    for row in rows:
        (name,) = needed("joint", row, "name")
        if any(name == joint.name for joint in joints):
            raise ParameterError(f"two [[joint]] have the name {name!r}; allowed: a name of its own for each")
        where = f"joint {name}"
        (kind,) = needed(where, row, "kind")
        first, second = _ends(where, row)
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
        joints.append(Joint(name, kind, first, second, axis, "", opened, driven, turn, *axes))
    return joints, clearances


def _direction(angle: float, mechanism: Mechanism) -> Array:
    """Unit vector at an angle [deg] from the x axis on, in the plane of x and y."""
    vector = np.zeros(mechanism.dimensions)
    vector[:2] = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    return vector


def _force(row: Mapping[str, Any], mechanism: Mechanism) -> Force:
    at, values = needed("force", row, "at", "force")
    return Force(_end("force.at", at), Sampled(np.asarray(values), _direction(row.get("direction", 0.0), mechanism)).at)


def _gas(row: Mapping[str, Any], mechanism: Mechanism) -> Force:
    """Force of the gas on the piston along its nominal stroke."""
    at, bore, dead, low, high = needed("gas", row, "at", "bore", "dead_volume", "suction", "discharge")
    number("gas.bore", bore, 1e-4, 10.0, "m")
    number("gas.dead_volume", dead, 1e-3, 100.0)
    number("gas.suction", low, 0.0, 1e9, "Pa")
    number("gas.discharge", high, low, 1e9, "Pa")
    exponent = number("gas.exponent", row.get("exponent", 1.3), 0.5, 3.0)
    behind = number("gas.behind", row.get("behind", low), 0.0, 1e9, "Pa")
    gas = Gas(math.pi / 4.0 * bore**2, dead, low, high, behind, exponent)
    direction, point = _direction(row.get("direction", 0.0), mechanism), _end("gas.at", at)
    theta: Any = np.arange(STROKE_ANGLES) * (2.0 * math.pi / STROKE_ANGLES)
    revolution = revolution_of(mechanism)
    place = mechanism.point(places(mechanism, revolution, theta), point)[0] @ direction
    if not np.ptp(place) > STILL * revolution.length:
        raise ParameterError(
            f"[[gas]] at {at} has no stroke in its direction; allowed: a point that moves as the gas is compressed"
        )
    return Force(point, Sampled(gas.force(place), direction).at)


def _spring(row: Mapping[str, Any]) -> Spring:
    first, second = _ends("spring", row)
    stiffness, length = needed("spring", row, "stiffness", "free_length")
    number("spring.stiffness", stiffness, 0.0, 1e12, "N/m")
    number("spring.free_length", length, 0.0, LONGEST, "m")
    return Spring(
        first, second, stiffness, length, number("spring.damping", row.get("damping", 0.0), 0.0, 1e9, "N s/m")
    )


def mechanism_of(data: Mapping[str, Any]) -> tuple[Mechanism, dict[str, Clearance]]:
    """Mechanism of the tables of a file, and the clearances of its joints by their names."""
    spatial, ground = data["spatial"], data["ground"]
    joints, clearances = _joints(data["joint"], spatial)
    points, kind = data["ground.points"], SpatialMechanism if spatial else Mechanism
    if spatial:
        points = {name: in_space(place) for name, place in points.items()}
        links = spatial_links(data["link"], joints)
    else:
        links = tuple(_link(name, table) for name, table in data["link"].items())
    springs = tuple(map(_spring, data["spring"]))
    still = kind(links, tuple(joints), points, springs=springs)
    gravity = number("ground.gravity", ground.get("gravity", 0.0), 0.0, 1e6, "m/s^2")
    pull = tuple((gravity * _direction(ground.get("gravity_direction", -90.0), still)).tolist())
    for spring in springs:
        still.places(spring.first), still.places(spring.second)
    forces = tuple(_force(row, still) for row in data["force"]) + tuple(_gas(row, still) for row in data["gas"])
    for force in forces:
        still.places(force.point)
    return replace(still, gravity=pull, forces=forces), clearances


def built(path: str, digest: str, data: Mapping[str, Any], _folder: Path) -> type[MechanismMachine]:
    """Class of the machines that a file describes; its fields have the file's values as defaults.

    Raises
    ------
    ParameterError
        If the mechanism can't move, nothing rattles, or a value is out of range.
    """
    operation = data["operation"]
    speed, *ends = needed("operation", operation, "speed", "speed_range", "clearance_range")
    mechanism, clearances = mechanism_of(data)
    motor = (
        (*needed("motor", data["motor"], "stall_torque", "no_load_speed"), data["motor"].get("inertia", 0.0))
        if data["motor"] is not None
        else None
    )
    made = machine_of(
        mechanism,
        clearances,
        monitored=operation.get("monitored", ""),
        motor=motor,
        about={"provenance": "stated", "source": path},
        namespace={"name": path, "__doc__": data[""].get("title", path)},
        definition=parameter(digest, choices=(digest,), provenance="stated", source=path),
        speed=speed,
    )
    machine = made()
    fields = (machine.speed_field, machine.clearance_field)
    named = zip(("speed_range", "clearance_range"), fields, ends, strict=True)
    made.usual_ranges = {field: range_of(made, f"operation.{key}", field, given) for key, field, given in named}
    made.tolerances = tolerances_of(data["tolerances"], machine)
    made.stated_state = state_of(operation, machine)
    made.task_defaults = TaskDefaults(task=data["job"])
    if motor is not None:
        _ = machine.crank  # what can't turn is refused here
    machine.reduce()  # what can't move is refused here, by name, and the rest is kept for the first run
    kind: type[MechanismMachine] = made
    return kind
