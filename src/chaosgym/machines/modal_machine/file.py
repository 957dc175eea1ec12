"""The file of modes or matrices, joints and drives: its tables in SI, and a class of machines out of them."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from chaosgym.errors import ParameterError
from chaosgym.machines.file_keys import needed
from chaosgym.machines.linear_impact import damping_for
from chaosgym.machines.machine import Machine, TaskDefaults
from chaosgym.machines.modal_machine import cycle_file
from chaosgym.machines.modal_machine.drive import KINDS, Drive
from chaosgym.machines.modal_machine.file_structure import structure_of
from chaosgym.machines.modal_machine.friction import OF_FRICTION, with_friction
from chaosgym.machines.modal_machine.keys import KEYS
from chaosgym.machines.modal_machine.machine import OF_JOINT, ModalMachine, aliases_of, clearance_option
from chaosgym.machines.modal_machine.machine_class import Joint, machine_with_joints
from chaosgym.machines.modal_machine.structure import BASE, Structure
from chaosgym.machines.modal_machine.turning import turning_joints
from chaosgym.machines.modal_machine.varying import Spring, VaryingMachine, checked_samples
from chaosgym.machines.parameters import described_as, parameter, parameters_of
from chaosgym.machines.stated import class_with, range_of, state_of, tolerances_of
from chaosgym.units import TURNING

SAMPLED = ("drive", "joint", "spring")
"""Tables that take samples of a cycle."""

MOST_SAMPLED = 16
"""Harmonics of a sampled cycle by default, at most."""


def tables_of(values: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """All tables by their path, values in SI.

    Raises
    ------
    ParameterError
        If a table or a key is missing or unknown, or a unit or a value is wrong.
    """
    data: dict[str, Any] = {}
    sampled: dict[str, list[Any]] = {name: _rows(values.get(name, []), name, folder) for name in SAMPLED}
    for name in KEYS.required:
        if name not in values:
            raise ParameterError(f"[[{name}]] is missing" if name == "drive" else f"[{name}] is missing")
    for path in KEYS.tables:
        outer, _, inner = path.rpartition(".")
        if outer == "joint":
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
        values = KEYS.checked("joint", row)
        if "stiffness" in values:
            varies = checked_samples("joint.stiffness", values["stiffness"], -math.inf)
            values["stiffness"] = float(np.mean(varies))
            if len(varies) > 1:
                values["samples"] = tuple(varies.tolist())
        found.append({**values, "lower": KEYS.checked("joint.lower", row.get("lower", {}))})
    return found


def files_of(values: Mapping[str, Any], folder: Path) -> list[Path]:
    """Files that a machine's file names, whose tables have been checked."""
    names = ("matrices", "mass", "stiffness", "damping", "universal_file")
    named = [values["structure"][name] for name in names if name in values["structure"]]
    return [folder / name for name in (*named, *cycle_file.files_of(values))]


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
    drives, title = tuple(_drive(row) for row in data["drive"]), data[""].get("title", path)
    types: dict[str, Any] = {"name": path, "__doc__": title}
    made: Any
    if len(data["joint"]) > 1 or "tangent" in data["joint"][0]:
        _refuse_varying(data)
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
            speed=speed,
            **watched,
        )
    else:
        springs = tuple(_spring(row) for row in data["spring"])
        if "monitored" in operation:
            raise ParameterError("operation.monitored needs several [[joint]]; allowed with one: leave it out")
        made = _with_one_joint(structure, data["joint"][0], drives, springs, speed, usual, types, definition, path)
    made.tolerances = tolerances_of(data["tolerances"], made())
    made.stated_state = state_of(operation, made())
    made.task_defaults = TaskDefaults(task={**made.task_defaults.task, **data["job"]})
    kind: type[Machine] = made
    return kind


def _refuse_varying(data: Mapping[str, Any]) -> None:
    """Refuse what goes neither with several joints nor with friction that sticks."""
    beside = "several [[joint]]" if len(data["joint"]) > 1 else "joint.tangent"
    for row in data["joint"]:
        if "slides" in row:
            allowed = "tangent, with sliding_speed" if len(data["joint"]) > 1 else "one of them"
            raise ParameterError(f"joint.slides does not go with {beside}; allowed: {allowed}")
        if "samples" in row:
            raise ParameterError(f"joint.stiffness over the cycle does not go with {beside}; allowed: one number")
    if data["spring"]:
        raise ParameterError(f"[[spring]] does not go with {beside}; allowed: with one [joint] without tangent")


def _aliases_of_one(name: str) -> dict[str, str]:
    """Fields of the only joint, by those of a machine with one joint and by ``joint`` and a dot."""
    plain = {**OF_JOINT, **{what: what for what in OF_FRICTION}}
    return {known: f"{name}_{what}" for what, same in plain.items() for known in (same, f"joint.{what}")}


def _spring(row: Mapping[str, Any]) -> Spring:
    at, values = needed("spring", row, "at", "stiffness")
    return Spring(at, tuple(checked_samples("spring.stiffness", values, 0.0).tolist()))


def _stated_of(joint: Mapping[str, Any], name: str, structure: Structure) -> dict[str, Any]:
    """What a file states of a joint, with factors of the lower stop, and the damper that a restitution stands for."""
    joint = with_friction(joint, name)
    if "restitution" in joint:
        joint = _with_damper(joint, name, structure)
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


def _with_damper(joint: Mapping[str, Any], name: str, structure: Structure) -> dict[str, Any]:
    """A joint with the damper that restores the stated share of the speed of the mass that strikes.

    That mass is what resists a short push at the joint, 1 / |phi|^2 of all kept modes (Schwager and Poeschel 2007, see
    ``linear_impact``).
    """
    at, stiffness, restored = needed(name, joint, "at", "stiffness", "restitution")
    if "samples" in joint:
        raise ParameterError(f"{name}.restitution needs one stiffness; allowed with samples of a cycle: damping")
    if "damping" in joint or "damping" in joint["lower"]:
        raise ParameterError(f"{name} has restitution and damping; allowed: one of them")
    if not 1e-3 <= restored <= 1.0 or not stiffness > 0.0:
        raise ParameterError(f"{name}.restitution = {restored:g} is out of range; allowed: 0.001 to 1")
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
    for number, table in enumerate(tables, 1):
        name = table.get("name", f"joint_{number}" if len(tables) > 1 else "joint")
        if name in joints:
            raise ParameterError(f"two [[joint]] have the name {name!r}; allowed: a name of its own for each")
        joints[name] = Joint(**_stated_of(table, name if "name" in table else "joint", structure))
    return joints


def _with_one_joint(
    structure: Structure,
    joint: Mapping[str, Any],
    drives: tuple[Drive, ...],
    springs: tuple[Spring, ...],
    speed: float,
    usual: Mapping[str, Any],
    types: Mapping[str, Any],
    definition: Any,
    path: str,
) -> Any:
    stated = _stated_of(joint, "joint", structure)
    turning, samples, slides = stated.pop("turns"), stated.pop("samples", ()), stated.pop("slides", "")
    base: Any = VaryingMachine if samples or springs or "friction" in stated else ModalMachine
    fields: dict[str, Any] = {
        "modes": structure,
        "joint": stated.pop("at"),
        "drives": drives,
        "definition": definition,
    }
    if base is VaryingMachine:
        fields |= {"samples": samples, "springs": springs, "slides": slides}
    known = parameters_of(base)
    values = {"speed": speed, **{OF_JOINT.get(name, name): value for name, value in stated.items()}}
    for field in known:
        unit = known[field].unit
        about = {"provenance": "stated", "source": path} if field in values else {}
        about["unit"] = TURNING.get(unit, unit) if turning else unit
        fields[field] = described_as(known[field], values.get(field, getattr(base, field)), **about)
    options = {"--speed-hz": ModalMachine.options["--speed-hz"], **clearance_option("clearance", turning)}
    types = {**types, "usual_ranges": usual, "turning": ("joint",) if turning else (), "options": options}
    types["aliases"] = aliases_of("joint") | aliases_of(joint.get("name", "joint"))
    return class_with(base, fields, types)


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
    values = row[kind]
    for name in ("harmonics",) if len(values) == 1 else ("harmonic", "angle"):
        if name in row:
            what = "one amplitude" if len(values) == 1 else "samples of a cycle"
            raise ParameterError(f"drive.{name} has no meaning beside {what}; leave it out")
    if len(values) == 1:
        return Drive.sine(kind, at, float(values[0]), row.get("harmonic", 1), math.radians(row.get("angle", 0.0)))
    return Drive.sampled(kind, at, values, row.get("harmonics", min(MOST_SAMPLED, (len(values) - 1) // 2)))
