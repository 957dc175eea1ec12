"""The file of a mechanism: links, joints and what pulls at them, with units; a class of machines out of it."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core.matrices import inv, product
from chaosgym.errors import ParameterError
from chaosgym.machines.contact_law import damping_for, is_hertzian, with_power
from chaosgym.machines.file_keys import needed
from chaosgym.machines.loads import cycle_of
from chaosgym.machines.machine import TaskDefaults
from chaosgym.machines.mechanism.beam import beam_link
from chaosgym.machines.mechanism.file_joints import end_of, ends_of, frictions_of, joints_of, with_motions
from chaosgym.machines.mechanism.file_parts import (
    beam_of,
    bodies_at_ends,
    body_of,
    in_space,
    place_of,
    spatial_links,
)
from chaosgym.machines.mechanism.forces import STROKE_ANGLES, Along, Force, Gas, SampledForce, Spring, TorsionSpring
from chaosgym.machines.mechanism.joints import Clearance
from chaosgym.machines.mechanism.keys import KEYS
from chaosgym.machines.mechanism.links import Link, rigid_link
from chaosgym.machines.mechanism.machine import MechanismMachine
from chaosgym.machines.mechanism.machine_class import machine_of
from chaosgym.machines.mechanism.mechanism import Mechanism
from chaosgym.machines.mechanism.motor import motor_of
from chaosgym.machines.mechanism.nominal import places, revolution_of
from chaosgym.machines.mechanism.spatial import SpatialMechanism
from chaosgym.machines.parameters import parameter
from chaosgym.machines.stated import range_of, state_of, tolerances_of
from chaosgym.numbers import number

LISTS = ("joint", "motion", "force", "moment", "gas", "spring", "damper", "torsion_spring")
"""Lists of tables in a file."""

MASS_ANGLES = 72
"""Crank angles whose mean is the mass that strikes."""


STILL = 1e-6
"""Stroke of a piston, as a share of the mechanism's length, below which it stands still."""


def tables_of(values: Mapping[str, Any], _folder: Path) -> dict[str, Any]:
    """All tables of a file, values in SI.

    Raises
    ------
    ParameterError
        If a table or a key is missing or unknown, or a unit or a value is wrong.
    """
    KEYS.check_tables(values)
    data: dict[str, Any] = {"": KEYS.checked("", values)}
    for path in ("ground", "motor", "operation", "tolerances", "job"):
        data[path] = KEYS.checked(path, values.get(path, {}))
    if "motor" not in values:
        data["motor"] = None
    data["ground.points"] = _points("ground", values["ground"])
    if not isinstance(values["link"], dict) or not values["link"]:
        raise ParameterError("[link.NAME] is missing: each link is a table, such as [link.crank]")
    data["link"] = {name: _link_table(name, table) for name, table in values["link"].items()}
    for path in LISTS:
        rows = _list(path, values.get(path, []))
        data[path] = [KEYS.checked(path, with_power(path, row) if isinstance(row, dict) else row) for row in rows]
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


def _direction(angle: float, mechanism: Mechanism) -> Array:
    """Unit vector at an angle [deg] from the x axis on, in the plane of x and y."""
    vector = np.zeros(mechanism.dimensions)
    vector[:2] = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    return vector


def _force(row: Mapping[str, Any], mechanism: Mechanism) -> Force:
    at, given = needed("force", row, "at", "force")
    if len(given) == mechanism.dimensions:
        size, angle = math.hypot(*given), math.degrees(math.atan2(given[1], given[0]))
        raise ParameterError(
            f"force.force has {len(given)} numbers, as a vector; allowed: one along a direction, as in force = "
            f'"{size:g} N", direction = "{angle:g} deg", or at least {1 + mechanism.dimensions} samples of a revolution'
        )
    cycle = cycle_of("force", row, "force", "N", constant=True)
    direction = _direction(row.get("direction", 0.0), mechanism)
    return Force(end_of("force.at", at), Along(cycle, direction).at, note=cycle.note(f"the force at {at}", "N"))


def _moment(row: Mapping[str, Any], mechanism: Mechanism) -> Force:
    at, _ = needed("moment", row, "at", "moment")
    _refuse_space("moment", mechanism)
    cycle = cycle_of("moment", row, "moment", "N m", constant=True)
    only = Along(cycle, np.ones(1)).at
    return Force(end_of("moment.at", at), only, turns=True, note=cycle.note(f"the moment at {at}", "N m"))


def _refuse_space(table: str, mechanism: Mechanism) -> None:
    if mechanism.dimensions > 2:
        raise ParameterError(f"[[{table}]] acts in the plane; allowed: in a file whose points have no z")


def _gas(row: Mapping[str, Any], mechanism: Mechanism) -> Force:
    """Force of the gas on the piston along its nominal stroke."""
    at, bore, dead, low, high = needed("gas", row, "at", "bore", "dead_volume", "suction", "discharge")
    number("gas.discharge", high, low, 1e9, "Pa")
    gas = Gas(math.pi / 4.0 * bore**2, dead, low, high, row.get("behind", low), row.get("exponent", 1.3))
    direction, point = _direction(row.get("direction", 0.0), mechanism), end_of("gas.at", at)
    theta: Any = np.arange(STROKE_ANGLES) * (2.0 * math.pi / STROKE_ANGLES)
    revolution = revolution_of(mechanism)
    place = product(mechanism.point(places(mechanism, revolution, theta), point)[0], direction)
    if not np.ptp(place) > STILL * revolution.length:
        raise ParameterError(
            f"[[gas]] at {at} has no stroke in its direction; allowed: a point that moves as the gas is compressed"
        )
    return Force(point, SampledForce(gas.force(place), direction).at)


def _spring(row: Mapping[str, Any]) -> Spring:
    first, second = ends_of("spring", row)
    stiffness, length = needed("spring", row, "stiffness", "free_length")
    length -= _preload("spring", row, stiffness)
    return Spring(first, second, stiffness, length, row.get("damping", 0.0))


def _preload(table: str, row: Mapping[str, Any], stiffness: float) -> float:
    """What the preload of a spring takes from its free length or angle."""
    load = float(row.get("preload", 0.0))
    if load and not stiffness > 0.0:
        raise ParameterError(f"{table}.preload needs {table}.stiffness above 0")
    return load / stiffness if load else 0.0


def _damper(row: Mapping[str, Any]) -> Spring:
    first, second = ends_of("damper", row)
    return Spring(first, second, 0.0, 0.0, *needed("damper", row, "damping"))


def _torsion(row: Mapping[str, Any], mechanism: Mechanism) -> TorsionSpring:
    first, second = ends_of("torsion_spring", row)
    _refuse_space("torsion_spring", mechanism)
    mechanism.places(first), mechanism.places(second)
    if "stiffness" not in row and "damping" not in row:
        raise ParameterError("[torsion_spring] lacks stiffness; allowed without one: damping")
    stiffness = row.get("stiffness", 0.0)
    angle = math.radians(row.get("free_angle", 0.0)) - _preload("torsion_spring", row, stiffness)
    return TorsionSpring(first, second, stiffness, angle, row.get("damping", 0.0))


def mechanism_of(data: Mapping[str, Any]) -> tuple[Mechanism, dict[str, Clearance]]:
    """Mechanism of the tables of a file, and the clearances of its joints by their names."""
    spatial, ground = data["spatial"], data["ground"]
    joints, clearances = joints_of(data["joint"], spatial)
    joints = with_motions(data["motion"], joints)
    points, kind = data["ground.points"], SpatialMechanism if spatial else Mechanism
    if spatial:
        points = {name: in_space(place) for name, place in points.items()}
        links = spatial_links(data["link"], joints)
    else:
        links = tuple(_link(name, table) for name, table in data["link"].items())
    springs = (*map(_spring, data["spring"]), *map(_damper, data["damper"]))
    still = kind(links, tuple(joints), points, springs=springs)
    pull = tuple((ground.get("gravity", 0.0) * _direction(ground.get("gravity_direction", -90.0), still)).tolist())
    for spring in springs:
        still.places(spring.first), still.places(spring.second)
    makers = ("force", _force), ("moment", _moment), ("gas", _gas)
    forces = tuple(make(row, still) for table, make in makers for row in data[table])
    for force in forces:
        still.places(force.point)
    torsion = tuple(_torsion(row, still) for row in data["torsion_spring"])
    return replace(still, gravity=pull, forces=forces, torsion=torsion), clearances


def _with_restitution(
    rows: list[dict[str, Any]], mechanism: Mechanism, clearances: Mapping[str, Clearance]
) -> dict[str, Clearance]:
    """Clearances whose linear surfaces have the damper that restores the stated share of the speed of an impact.

    The mass that strikes is what resists a short push, the mean over a revolution and the directions of a pin.
    """
    found = dict(clearances)
    for row in rows:
        if "restitution" not in row or is_hertzian(row) or row["name"] not in found:
            continue
        name, restored = row["name"], number(f"joint {row['name']}.restitution", row["restitution"], 1e-3, 1.0)
        machine = machine_of(mechanism, clearances, monitored=name)()
        mobile = inv(machine.equations(0.0, MASS_ANGLES).mass)
        pushed = np.concatenate([contact.row for contact in machine.contacts if contact.reading.any()])
        mass = 1.0 / float(np.mean(np.einsum("ri,bij,rj->br", pushed, mobile, pushed)))
        found[name] = found[name]._replace(damping=damping_for(restored, mass, found[name].stiffness))
    return found


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
    clearances = _with_restitution(data["joint"], mechanism, clearances)
    motor = motor_of(data["motor"]) if data["motor"] is not None else None
    made = machine_of(
        mechanism,
        clearances,
        monitored=operation.get("monitored", ""),
        motor=motor,
        frictions=frictions_of(data["joint"], data["spatial"]),
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
    made.initial_state = state_of(operation, machine)
    made.task_defaults = TaskDefaults(task=data["job"])
    if motor is not None:
        _ = machine.crank  # what can't turn is refused here
    machine.reduce()  # what can't move is refused here, by name, and the rest is kept for the first run
    kind: type[MechanismMachine] = made
    return kind
