"""The file of a machine: TOML with units in, a class of machines out, whose defaults are what the file states."""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from importlib import resources
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from chaosgym.errors import ParameterError
from chaosgym.files import contents, toml_of
from chaosgym.machines.linear_impact import damping_for
from chaosgym.machines.machine import Machine, Work
from chaosgym.machines.modal_machine.archives import LARGEST, read_archive, read_matrix
from chaosgym.machines.modal_machine.cycle_file import files_of, with_samples
from chaosgym.machines.modal_machine.drive import KINDS, Drive
from chaosgym.machines.modal_machine.jointed import Joint, machine_with_joints
from chaosgym.machines.modal_machine.keys import REQUIRED, TABLES, checked_table, schema
from chaosgym.machines.modal_machine.machine import ModalMachine, clearance_option
from chaosgym.machines.modal_machine.structure import BASE, Structure
from chaosgym.machines.modal_machine.turning import turning_joints
from chaosgym.machines.parameters import check_parameter, field_named, parameter, parameters_of, suggestion
from chaosgym.machines.units import TURNING, parse_quantity

FIELDS = {"stiffness": "contact_stiffness", "damping": "contact_damping"}
"""Fields of the machine by key of [joint], where they have other names."""

MOST_SAMPLED = 16
"""Harmonics of a sampled cycle by default, at most."""

_classes: dict[str, type[Machine]] = {}


def machine_class(path: str | Path) -> type[Machine]:
    """Class of the machines that a file describes; calling it without arguments gives the one that is stated.

    Raises
    ------
    ParameterError
        If the file can't be read, a key is unknown, a unit missing, or a value not allowed; one line that says where.
    """
    try:
        text, values = toml_of(path)
    except ValueError as error:
        raise ParameterError(f"{path} {error}") from None
    try:
        folder = Path(path).parent
        data = _tables(values, folder)
        digest = hashlib.sha256(text.encode())
        for name in ("matrices", "mass", "stiffness", "damping", "universal_file"):
            if name in data["structure"]:
                digest.update(_bytes(folder / data["structure"][name]))
        for name in files_of(values):
            digest.update(_bytes(folder / name))
        key = f"{path} {digest.hexdigest()}"
        if key not in _classes:
            _classes[key] = _built(str(path), digest.hexdigest()[:16], data, folder)
        return _classes[key]
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from None


def read_machine(path: str | Path) -> Machine:
    """Machine that a file describes, at the speed and clearance that it states.

    Raises
    ------
    ParameterError
        As ``machine_class``.
    """
    kind: Any = machine_class(path)
    machine: Machine = kind()
    return machine


def template() -> str:
    """Commented file of an example, ready to edit."""
    return (resources.files(__package__) / "template.toml").read_text(encoding="utf-8")


def schema_text() -> str:
    """JSON schema of such files, as text."""
    return json.dumps(schema(), indent=1) + "\n"


def _bytes(path: Path) -> bytes:
    try:
        return contents(path, LARGEST)
    except ValueError as error:
        raise ParameterError(f"{path} {error}") from None


def _tables(values: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """All tables by their path, values in SI."""
    data: dict[str, Any] = {}
    drives: list[Any] = []
    for name in REQUIRED:
        if name not in values:
            raise ParameterError(f"[[{name}]] is missing" if name == "drive" else f"[{name}] is missing")
    for path in TABLES:
        outer, _, inner = path.rpartition(".")
        if outer == "joint":
            continue
        given = values.get(outer, {}).get(inner, {}) if outer else values.get(path, {}) if path else values
        if path == "drive":
            drives = [with_samples(row, folder) for row in (given if isinstance(given, list) else [given])]
            data[path] = [checked_table(path, row) for row in drives]
        else:
            data[path] = checked_table(path, given) if path != "joint" else _joints(given)
    for joint, moves in zip(data["joint"], turning_joints({**values, "drive": drives}), strict=True):
        joint["turns"] = moves
    return data


def _joints(given: Any) -> list[dict[str, Any]]:
    """Values of each [joint] or [[joint]], those of its lower stop as "lower"."""
    rows = given if isinstance(given, list) else [given]
    if not rows:
        raise ParameterError("[[joint]] is missing")
    found = []
    for row in rows:
        values = checked_table("joint", row)
        found.append({**values, "lower": checked_table("joint.lower", row.get("lower", {}))})
    return found


def _needed(table: str, values: Mapping[str, Any], *names: str) -> list[Any]:
    for name in names:
        if name not in values:
            raise ParameterError(f"[{table}] lacks {name}")
    return [values[name] for name in names]


def _built(path: str, digest: str, data: Mapping[str, Any], folder: Path) -> type[Machine]:
    """Make the class: its fields have the file's values as defaults, and one more names the file's content."""
    structure = structure_of(data, folder)
    operation: dict[str, Any] = data["operation"]
    speed, *ends = _needed("operation", operation, "speed", "speed_range", "clearance_range")
    usual = {name: _range(name, given) for name, given in zip(("speed", "clearance"), ends, strict=True)}
    definition = parameter(digest, choices=(digest,), provenance="stated", source=path)
    drives, title = tuple(_drive(row) for row in data["drive"]), data[""].get("title", path)
    types: dict[str, Any] = {"name": path, "__doc__": title, "__reduce__": _reduced}
    made: Any
    if len(data["joint"]) > 1:
        about = {"provenance": "stated", "source": path}
        watched = {"monitored": operation["monitored"]} if "monitored" in operation else {}
        made = machine_with_joints(
            structure,
            _several_joints(data["joint"], structure),
            drives,
            about=about,
            usual_ranges=usual,
            namespace=types,
            definition=definition,
            speed=speed,
            **watched,
        )
    else:
        if "monitored" in operation:
            raise ParameterError("operation.monitored needs several [[joint]]; allowed with one: leave it out")
        made = _with_one_joint(structure, data["joint"][0], drives, speed, usual, types, definition, path)
    made.tolerances = _tolerances(data["tolerances"], made())
    made.work = Work(task=data["job"])
    kind: type[Machine] = made
    return kind


def _stated_of(joint: Mapping[str, Any], name: str, structure: Structure) -> dict[str, Any]:
    """What a file states of a joint, with factors of the lower stop, and the damper that a restitution stands for."""
    if "restitution" in joint:
        joint = _with_damper(joint, name, structure)
    _, clearance, *upper = _needed(name, joint, "at", "clearance", "stiffness", "damping")
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
    at, stiffness, restored = _needed(name, joint, "at", "stiffness", "restitution")
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
        name = table.get("name", f"joint_{number}")
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
    values = {"speed": speed, **{FIELDS.get(name, name): value for name, value in stated.items()}}
    for field in known:
        about = {**vars(known[field]), **({"provenance": "stated", "source": path} if field in values else {})}
        if turning:
            about["unit"] = TURNING.get(about["unit"], about["unit"])
        fields[field] = parameter(values.get(field, getattr(ModalMachine, field)), **about)
    options = {"--speed-hz": ModalMachine.options["--speed-hz"], **clearance_option("clearance", turning)}
    types = {**types, "usual_ranges": usual, "turning": ("joint",) if turning else (), "options": options}
    annotations: dict[str, Any] = dict.fromkeys(fields, Any)
    annotations |= {name: ClassVar[Any] for name in types if not name.startswith("__")}
    namespace = {"__module__": __name__, "__annotations__": annotations, **fields, **types}
    return dataclass(frozen=True, kw_only=True)(type("ModalMachine", (ModalMachine,), namespace))


def _reduced(machine: Any) -> Any:
    """How a machine is pickled: by the name of its file, whose class has no name of its own."""
    return _restored, (machine.name, {each.name: getattr(machine, each.name) for each in fields(machine)})


def _restored(path: str, values: Mapping[str, Any]) -> Machine:
    kind: Any = machine_class(path)
    if kind.definition != values["definition"]:
        raise ParameterError(f"{path} has changed: it is not the machine that was kept")
    machine: Machine = kind(**values)
    return machine


def _range(name: str, values: Any) -> tuple[float, float]:
    if len(values) != 2 or not values[0] < values[1]:
        raise ParameterError(
            f"operation.{name}_range is no range; allowed: a text such as '4 to 30 Hz', the lower one first"
        )
    low, high = (check_parameter(ModalMachine, name, end) for end in values)
    return low, high


def _tolerances(given: Mapping[str, Any], machine: Machine) -> dict[str, tuple[float, bool]]:
    """Half widths by field, and whether they are shares of the value."""
    known = {name: about for name, about in parameters_of(machine).items() if not about.choices}
    found = {}
    for key, text in _flat(given).items():
        name = field_named(machine, key)
        if name not in known:
            raise ParameterError(f"[tolerances] has no key {name!r}{suggestion(name, known)}")
        relative = isinstance(text, str) and text.strip().endswith("%")
        value = parse_quantity(f"tolerances.{name}", text, "-" if relative else known[name].unit)
        if not value > 0.0 or (relative and getattr(machine, name) == 0.0):
            raise ParameterError(f"tolerances.{name} = {text!r} is out of range; allowed: above 0, no share of 0")
        nominal = getattr(machine, name)
        for side in (-1.0, 1.0):
            check_parameter(machine, name, nominal + side * value * (abs(nominal) if relative else 1.0))
        found[name] = (value, relative)
    return found


def _flat(given: Mapping[str, Any]) -> dict[str, Any]:
    """Entries of a table with those of tables in it, such as left.clearance, by their dotted keys."""
    flat: dict[str, Any] = {}
    for key, value in given.items():
        inner = _flat(value) if isinstance(value, dict) else {"": value}
        flat |= {f"{key}.{name}" if name else key: each for name, each in inner.items()}
    return flat


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


_DAMPED = ("damping_ratios", "modal_damping")
_MESH = (*_DAMPED, "units", "modes", "residual_mode", "base", "degrees_of_freedom")

WAYS = {
    "frequencies": (*_DAMPED, "modal_masses", "shapes", "residual"),
    "matrices": _MESH,
    "mass": (*_MESH, "stiffness", "damping"),
    "universal_file": (*_DAMPED, "points", "residual"),
}
"""Ways to give a structure, and the keys and tables of [structure] that mean something beside each."""


def _refuse_two(table: str, given: Mapping[str, Any], *names: str) -> None:
    """Refuse keys of which only one would be read."""
    both = [name for name in names if name in given]
    if len(both) > 1:
        raise ParameterError(f"[{table}] has {' and '.join(both)}; allowed: one of them")


def structure_of(data: Mapping[str, Any], folder: Path) -> Structure:
    """Modes by one of the three ways that [structure] offers."""
    table = data["structure"]
    ways = [name for name in WAYS if name in table]
    if len(ways) != 1:
        raise ParameterError(
            f"[structure] has {' and '.join(ways) or 'no modes'}; allowed: one of frequencies, matrices (.npz), mass "
            "with stiffness, universal_file"
        )
    stated = [*table, *(path.partition(".")[2] for path in data if path.startswith("structure.") and data[path])]
    for name in stated:
        if name not in (*ways, *WAYS[ways[0]]):
            raise ParameterError(f"structure.{name} has no meaning beside {ways[0]}; leave one of them out")
    _refuse_two("structure", table, "damping_ratios", "modal_damping")
    if ways == ["frequencies"]:
        return _of_modes(table, data["structure.shapes"], data["structure.residual"])
    if ways == ["universal_file"]:
        from chaosgym.machines.modal_machine.universal import read_modes

        modes = read_modes(folder / table["universal_file"], data["structure.points"])
        ratios = table.get("damping_ratios", modes.damping_ratios)
        given = {**table, "frequencies": modes.frequencies, "damping_ratios": ratios, "modal_masses": modes.masses}
        return _of_modes(given, modes.shapes, data["structure.residual"])
    return _of_matrices(table, data, folder)


def _ratios(table: Mapping[str, Any]) -> Any:
    if "modal_damping" in table:
        return table["modal_damping"]
    (ratios,) = _needed("structure", table, "damping_ratios")
    return ratios[0] if len(ratios) == 1 else ratios


def _of_modes(table: Mapping[str, Any], shapes: Mapping[str, Any], residual: Mapping[str, Any]) -> Structure:
    rest = None
    if residual:
        at, compliance = _needed("structure.residual", residual, "at", "compliance")
        rest = (at, compliance, residual.get("frequency", 2.0 * float(np.max(table["frequencies"]))))
    if not shapes:
        raise ParameterError("[structure.shapes] is missing: the shape of each mode at each named point")
    masses = table.get("modal_masses")
    return Structure.of_modes(table["frequencies"], _ratios(table), shapes, modal_masses=masses, residual=rest)


def _of_matrices(table: Mapping[str, Any], data: Mapping[str, Any], folder: Path) -> Structure:
    matrices, points = _matrices(table, folder), dict(data["structure.degrees_of_freedom"])
    for place, name in enumerate(matrices.pop("names", ())):
        points.setdefault(str(name), place)
    if not points:
        raise ParameterError("[structure.degrees_of_freedom] is missing: the row of each named point, counted from 0")
    base = matrices.pop("base", None)
    if "base" in table:
        base = np.zeros(matrices["M"].shape[0])
        for name in table["base"]:
            if name not in points:
                raise ParameterError(f"structure.base names no degree of freedom {name!r}{suggestion(name, points)}")
            base[points[name]] = 1.0
    if "C" in matrices:
        _refuse_two("structure", {**table, "the damping matrix C": 0}, "the damping matrix C", *_DAMPED)
    joints = [str(joint.get("at", "")).lstrip("-+ ") for joint in data["joint"]]
    (modes,) = _needed("structure", table, "modes")
    return Structure.of_matrices(
        matrices["M"],
        matrices["K"],
        matrices.get("C") if "C" in matrices else _ratios(table),
        points,
        modes=modes,
        base=base,
        residual_at=[name for name in joints if table.get("residual_mode", True) and name in points],
        scale=1e3 if table.get("units") == "t mm N" else 1.0,
    )


def _matrices(table: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Matrices M, K and, if they are there, C, base and names."""
    if "matrices" in table:
        return read_archive(folder / table["matrices"])
    mass, stiffness = _needed("structure", table, "mass", "stiffness")
    files = {"M": mass, "K": stiffness, **({"C": table["damping"]} if "damping" in table else {})}
    return {name: read_matrix(folder / file) for name, file in files.items()}
