"""The file of modes or matrices, joints and drives: its tables in SI, and a class of machines out of them."""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from chaosgym.errors import ParameterError
from chaosgym.machines.contact_law import LAW_KEYS, damping_for, hertzian, is_hertzian, with_power
from chaosgym.machines.file_keys import needed
from chaosgym.machines.friction_law import OF_FRICTION, with_friction
from chaosgym.machines.loads import cycle_of
from chaosgym.machines.machine import SPEED_IN_HZ, Machine, TaskDefaults
from chaosgym.machines.modal_machine import cycle_file
from chaosgym.machines.modal_machine.drive import KINDS, Drive
from chaosgym.machines.modal_machine.file_structure import structure_of
from chaosgym.machines.modal_machine.keys import KEYS
from chaosgym.machines.modal_machine.machine import OF_JOINT, ModalMachine, aliases_of, clearance_option
from chaosgym.machines.modal_machine.machine_class import Joint, machine_with_joints
from chaosgym.machines.modal_machine.start import coordinate_units, start_of
from chaosgym.machines.modal_machine.structure import BASE, Structure
from chaosgym.machines.modal_machine.turning import turning_joints
from chaosgym.machines.modal_machine.varying import HeldSpring, checked_samples
from chaosgym.machines.parameters import described_as, parameter, parameters_of
from chaosgym.machines.stated import class_with, range_of, tolerances_of
from chaosgym.numbers import number
from chaosgym.units import TURNING

AMOUNT = re.compile(r"[-+]?\d[\d.,e+-]*(\s|$)")
"""How a number begins, with a unit or without."""

SAMPLED = ("drive", "joint", "spring")
"""Tables that take samples of a cycle."""


def tables_of(values: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """All tables by their path, values in SI.

    Raises
    ------
    ParameterError
        If a table or a key is missing or unknown, or a unit or a value is wrong.
    """
    data: dict[str, Any] = {}
    sampled: dict[str, list[Any]] = {name: _rows(values.get(name, []), name, folder) for name in SAMPLED}
    KEYS.check_tables(values)
    KEYS.checked("", values)
    if not {"drive", "load"} & set(values) and "initial_state" not in values["operation"]:
        raise ParameterError("[[drive]] is missing; allowed without one: a [[load]], or operation.initial_state")
    loads = values.get("load", [])
    for path in KEYS.tables:
        outer, _, inner = path.rpartition(".")
        if outer == "joint":
            continue
        if path == "load":
            data[path] = [KEYS.checked(path, row) for row in (loads if isinstance(loads, list) else [loads])]
            continue
        if path in SAMPLED:
            data[path] = (
                _joints(sampled[path]) if path == "joint" else [KEYS.checked(path, row) for row in sampled[path]]
            )
            continue
        given = values.get(outer, {}).get(inner, {}) if outer else values.get(path, {}) if path else values
        data[path] = KEYS.checked(path, given)
    for joint, moves in zip(data["joint"], turning_joints({**values, **sampled}), strict=True):
        joint["turns"] = moves
    data["coordinates"] = coordinate_units(values["structure"])
    return data


def _rows(given: Any, name: str, folder: Path) -> list[Any]:
    """Rows of a table or a list of tables, with the samples of the CSV files that they name."""
    return [cycle_file.with_samples(name, row, folder) for row in (given if isinstance(given, list) else [given])]


def _joints(rows: list[Any]) -> list[dict[str, Any]]:
    """Values of each [joint] or [[joint]], those of its lower stop as "lower"; a stiffness that varies as "samples"."""
    if not rows:
        raise ParameterError("[[joint]] is missing")
    found = []
    for row in rows:
        values = KEYS.checked("joint", with_power("joint", row) if isinstance(row, dict) else row)
        if "stiffness" in values:
            varies = checked_samples("joint.stiffness", values["stiffness"], -math.inf)
            values["stiffness"] = float(np.mean(varies))
            if len(varies) > 1:
                values["samples"] = tuple(varies.tolist())
        found.append({**values, "lower": KEYS.checked("joint.lower", row.get("lower", {}))})
    return found


def files_of(values: Mapping[str, Any], folder: Path) -> list[Path]:
    """Files that a machine's file names, whose tables have been checked.

    Raises
    ------
    ParameterError
        If a number stands where the file of a matrix is named.
    """
    names = ("matrices", "mass", "stiffness", "damping", "universal_file")
    named = {name: values["structure"][name] for name in names if name in values["structure"]}
    for key, name in named.items():
        if AMOUNT.match(name) and not (folder / name).exists():
            raise ParameterError(
                f"structure.{key} = {name!r} is no file: it names the file of a matrix; of one mass m on a stiffness k "
                "state modal_masses = m and frequencies = sqrt(k / m) / (2 pi)"
            )
    return [folder / name for name in (*named.values(), *cycle_file.files_of(values))]


def built(path: str, digest: str, data: Mapping[str, Any], folder: Path) -> type[Machine]:
    """Make the class: its fields have the file's values as defaults, and one more names the file's content.

    Raises
    ------
    ParameterError
        If a value is not allowed.
    """
    structure = structure_of(data, folder)
    operation: dict[str, Any] = data["operation"]
    speed, *ends = needed("operation", operation, "speed", "speed_range", "clearance_range")
    named = zip(("speed", "clearance"), ends, strict=True)
    usual = {name: range_of(ModalMachine, f"operation.{name}_range", name, given) for name, given in named}
    definition = parameter(digest, choices=(digest,), provenance="stated", source=path)
    drives = (*(_drive(row) for row in data["drive"]), *(_load(row) for row in data["load"]))
    title, springs = data[""].get("title", path), tuple(_spring(row) for row in data["spring"])
    steady = [spring for spring in springs if len(spring.values) == 1]
    if steady:
        structure = structure.with_springs((spring.at, spring.values[0], spring.damping) for spring in steady)
    springs = tuple(spring for spring in springs if len(spring.values) > 1)
    types: dict[str, Any] = {"name": path, "__doc__": title}
    made: Any
    first = data["joint"][0]
    plain = not springs and {"friction", "tangent", "slides", "samples"}.isdisjoint(first) and not is_hertzian(first)
    if len(data["joint"]) > 1 or not plain:
        about = {"provenance": "stated", "source": path}
        watched = {"monitored": operation["monitored"]} if "monitored" in operation else {}
        joints = _several_joints(data["joint"], structure)
        types["aliases"] = _aliases_of_one(next(iter(joints))) if len(joints) == 1 else {}
        made = machine_with_joints(
            structure,
            joints,
            drives,
            about=about,
            usual_ranges=usual,
            namespace=types,
            definition=definition,
            springs=springs,
            speed=speed,
            **watched,
        )
    else:
        if "monitored" in operation:
            raise ParameterError("operation.monitored needs several [[joint]]; allowed with one: leave it out")
        made = _with_one_joint(structure, first, drives, speed, usual, types, definition, path)
    made.tolerances = tolerances_of(data["tolerances"], made())
    if "initial_state" in operation:
        start = start_of(operation["initial_state"], data["coordinates"], structure)
        made.initial_state = made().from_state(start).initial_state
    made.task_defaults = TaskDefaults(task={**made.task_defaults.task, **data["job"]})
    kind: type[Machine] = made
    return kind


def _aliases_of_one(name: str) -> dict[str, str]:
    """Fields of the only joint, by those of a machine with one joint and by ``joint`` and a dot."""
    plain = {**OF_JOINT, **{what: what for what in OF_FRICTION}}
    return {known: f"{name}_{what}" for what, same in plain.items() for known in (same, f"joint.{what}")}


def _spring(row: Mapping[str, Any]) -> HeldSpring:
    (at,) = needed("spring", row, "at")
    if "stiffness" not in row and "damping" not in row:
        raise ParameterError("[spring] lacks stiffness; allowed without one: damping")
    values = checked_samples("spring.stiffness", row.get("stiffness", 0.0), 0.0)
    return HeldSpring(at, tuple(values.tolist()), row.get("damping", 0.0))


def _load(row: Mapping[str, Any]) -> Drive:
    kinds = [kind for kind in ("force", "acceleration") if kind in row]
    if len(kinds) != 1:
        raise ParameterError(
            f"a [[load]] has {' and '.join(kinds) or 'no strength'}; allowed: a force or an acceleration"
        )
    at = row.get("at") or (BASE if kinds == ["acceleration"] else "")
    if not at:
        raise ParameterError("a [[load]] of a force lacks at, the point where it acts")
    return Drive(kinds[0], at, (), float(row[kinds[0]]))


def _stated_of(joint: Mapping[str, Any], name: str, structure: Structure) -> dict[str, Any]:
    """What a file states of a joint, with factors of the lower stop, and the damper that a restitution stands for."""
    joint = with_friction(joint, name)
    if is_hertzian(joint):
        joint = _with_law(joint, name)
    else:
        for key in ("impact_speed", "law"):
            if key in joint:
                raise ParameterError(f"{name}.{key} has no meaning without {name}.hertz_stiffness; leave it out")
        joint = _with_damper(joint, name, structure) if "restitution" in joint else joint
    _, clearance, *upper = needed(name, joint, "at", "clearance", "stiffness", "damping")
    stated = {key: value for key, value in joint.items() if key not in ("lower", "name")}
    for key, above in zip(("stiffness", "damping"), upper, strict=True):
        lower = joint["lower"].get(key, above)
        if lower != above:
            if not above > 0.0:
                raise ParameterError(f"{name}.lower.{key} needs {name}.{key} above 0")
            stated[f"lower_{key}_factor"] = lower / above
    if not clearance >= 0.0:
        raise ParameterError(f"{name}.clearance = {clearance:g} is a gap of negative width; allowed: 0 or more")
    return stated


def _with_law(joint: Mapping[str, Any], name: str) -> dict[str, Any]:
    """A joint of a Hertzian surface: its K, chi and n in place of what states them."""
    stiffness, damping, exponent = hertzian(name, joint)
    for key in ("stiffness", "damping"):
        if key in joint["lower"]:
            raise ParameterError(
                f"{name}.lower.{key} does not go with a Hertzian joint; allowed: two joints, of one stop"
            )
    rest = {key: value for key, value in joint.items() if key not in LAW_KEYS}
    return {**rest, "stiffness": stiffness, "damping": damping, "exponent": exponent}


def _with_damper(joint: Mapping[str, Any], name: str, structure: Structure) -> dict[str, Any]:
    """A joint with the damper that restores the stated share of the speed of the mass that strikes.

    That mass is what resists a short push at the joint, 1 / |phi|^2 of all kept modes (Schwager and Poeschel 2007, see
    ``restitution_of``).
    """
    at, stiffness, restored = needed(name, joint, "at", "stiffness", "restitution")
    if "samples" in joint:
        raise ParameterError(f"{name}.restitution needs one stiffness; allowed with samples of a cycle: damping")
    if "damping" in joint or "damping" in joint["lower"]:
        raise ParameterError(f"{name} has restitution and damping; allowed: one of them")
    number(f"{name}.restitution", restored, 1e-3, 1.0)
    number(f"{name}.stiffness", stiffness, 0.0, inside=True)
    mobility = float(np.sum(structure.shape(at) ** 2))
    if mobility == 0.0:
        raise ParameterError(f"{name}.at = {at!r} never moves: every shape is 0 there")
    lower = joint["lower"].get("stiffness", stiffness)
    dampers = [damping_for(restored, 1.0 / mobility, spring) for spring in (stiffness, lower)]
    rest = {key: value for key, value in joint.items() if key != "restitution"}
    return {**rest, "damping": dampers[0], "lower": {**joint["lower"], "damping": dampers[1]}}


def _several_joints(tables: list[dict[str, Any]], structure: Structure) -> dict[str, Joint]:
    """Joints by their names: the stated ones, or joint_1, joint_2 ..."""
    joints: dict[str, Joint] = {}
    for place, table in enumerate(tables, 1):
        name = table.get("name", f"joint_{place}" if len(tables) > 1 else "joint")
        if name in joints:
            raise ParameterError(f"two [[joint]] have the name {name!r}; allowed: a name of its own for each")
        joints[name] = Joint(**_stated_of(table, name if "name" in table else "joint", structure))
    return joints


def _with_one_joint(
    structure: Structure,
    joint: Mapping[str, Any],
    drives: tuple[Drive, ...],
    speed: float,
    usual: Mapping[str, Any],
    types: Mapping[str, Any],
    definition: Any,
    path: str,
) -> Any:
    stated = _stated_of(joint, "joint", structure)
    turning = stated.pop("turns")
    fields: dict[str, Any] = {
        "modes": structure,
        "joint": stated.pop("at"),
        "drives": drives,
        "definition": definition,
    }
    known = parameters_of(ModalMachine)
    values = {"speed": speed, **{OF_JOINT.get(name, name): value for name, value in stated.items()}}
    for field in known:
        unit = known[field].unit
        about = {"provenance": "stated", "source": path} if field in values else {}
        about["unit"] = TURNING.get(unit, unit) if turning else unit
        fields[field] = described_as(known[field], values.get(field, getattr(ModalMachine, field)), **about)
    options = {**SPEED_IN_HZ, **clearance_option("clearance", turning)}
    types = {**types, "usual_ranges": usual, "turning": ("joint",) if turning else (), "options": options}
    types["aliases"] = aliases_of("joint") | aliases_of(joint.get("name", "joint"))
    return class_with(ModalMachine, fields, types)


def _drive(row: Mapping[str, Any]) -> Drive:
    kinds = [kind for kind in KINDS if kind in row]
    if len(kinds) != 1:
        raise ParameterError(
            f"a [[drive]] has {' and '.join(kinds) or 'no strength'}; allowed: one of {', '.join(KINDS)}"
        )
    (kind,) = kinds
    at = row.get("at") or (BASE if kind in ("displacement", "acceleration") else "")
    if not at:
        raise ParameterError(f"a [[drive]] of a {kind} lacks at, the point where it acts")
    return Drive.over(kind, at, cycle_of("drive", row, kind, KINDS[kind]))
