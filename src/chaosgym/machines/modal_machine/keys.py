"""Keys of a machine's file: unit and meaning of each, from which reader, messages and JSON schema are made."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from chaosgym.errors import ParameterError
from chaosgym.machines.modal_machine.drive import KINDS
from chaosgym.machines.modal_machine.limits import hint, told_of
from chaosgym.machines.numbers import shown
from chaosgym.machines.units import TURNING, parse_quantity, parse_row, turns, units_of


class Key(NamedTuple):
    """What stands behind a key.

    ``about`` it; ``unit`` of a quantity; ``kind`` "quantity", "row", "rows", "text", "texts", "count" or "flag";
    ``choices`` of a text.
    """

    about: str
    unit: str = "-"
    kind: str = "quantity"
    choices: tuple[str, ...] = ()


TEXT = "text"
SHAPE = Key(
    "mass-normalised mode shape there, a number for each mode; 'base': participation [kg^1/2]", "kg^-1/2", "row"
)

TABLES: Mapping[str, Mapping[str, Key]] = {
    "": {"title": Key("what the machine is", kind=TEXT)},
    "structure": {
        "frequencies": Key("natural frequencies of the machine free of contact; 0 for a rigid body", "Hz", "row"),
        "damping_ratios": Key("of each mode, or one for all", "-", "row"),
        "modal_damping": Key("full matrix of modal damping, a row for each mode", "1/s", "rows"),
        "modal_masses": Key("of each mode, if the shapes are not mass-normalised", "kg", "row"),
        "matrices": Key(".npz file with arrays M, K and, if known, C, base and names", kind=TEXT),
        "mass": Key("Matrix Market or .npy file", kind=TEXT),
        "stiffness": Key("Matrix Market or .npy file", kind=TEXT),
        "damping": Key("Matrix Market or .npy file; without it, damping_ratios", kind=TEXT),
        "units": Key("of the matrices", kind=TEXT, choices=("kg m N", "t mm N")),
        "modes": Key("how many of the slowest modes are kept", kind="count"),
        "residual_mode": Key(
            "keep the static deflection of the joint by all other modes; true by default", kind="flag"
        ),
        "base": Key("degrees of freedom that move with the base", kind="texts"),
        "universal_file": Key("file with data sets 55 of a modal test (extra [uff])", kind=TEXT),
    },
    "structure.shapes": {"*": SHAPE},
    "structure.degrees_of_freedom": {"*": Key("row of the matrices, counted from 0", kind="count")},
    "structure.points": {"*": Key("node and direction in the universal file, such as '12 +y'", kind=TEXT)},
    "structure.residual": {
        "at": Key("point whose compliance by the modes that were left out is known", kind=TEXT),
        "compliance": Key("what they add there", "m/N"),
        "frequency": Key("of the one mode that stands for them; twice the highest by default", "Hz"),
    },
    "joint": {
        "name": Key("of one of several joints: its fields begin with it, as in left_clearance", kind=TEXT),
        "at": Key("point that moves in the gap, '-tip', or 'pinion - wheel'", kind=TEXT),
        "clearance": Key("half the gap; with one stop its distance", "m"),
        "offset": Key("middle of the gap, from where the joint rests unloaded", "m"),
        "stops": Key("two, or one on the upper side", kind=TEXT, choices=("two", "one")),
        "stiffness": Key("spring of a stop", "N/m"),
        "damping": Key("damper of a stop", "N s/m"),
        "restitution": Key("speed after over speed before an impact, 0.001 to 1, in place of damping"),
        "preload": Key("constant force towards the upper stop", "N"),
    },
    "joint.lower": {
        "stiffness": Key("spring of the lower stop, if it differs", "N/m"),
        "damping": Key("damper of the lower stop, if it differs", "N s/m"),
    },
    "drive": {
        "at": Key("point where it acts; 'base' for a motion of the base, with which the stops move", kind=TEXT),
        "force": Key("amplitude, samples of one cycle, or a CSV file of them", KINDS["force"], "row"),
        "unbalance": Key("mass times eccentricity: the force grows with speed squared", KINDS["unbalance"], "row"),
        "displacement": Key("of the base: amplitude, samples of a cycle, or a CSV file", KINDS["displacement"], "row"),
        "acceleration": Key("of the base: amplitude, samples of a cycle, or a CSV file", KINDS["acceleration"], "row"),
        "column": Key("of the CSV file, if it has several beside its angles", kind=TEXT),
        "harmonic": Key("of the speed; 1 by default", kind="count"),
        "angle": Key("phase of the sine", "deg"),
        "harmonics": Key("how many the samples are cut to", kind="count"),
    },
    "operation": {
        "speed": Key("operating cycles a second", "Hz"),
        "speed_range": Key("lowest and highest", "Hz", "row"),
        "clearance_range": Key("lowest and highest, of the monitored or the first joint", "m", "row"),
        "monitored": Key("joint that is shown and judged; if open, the one with the largest force", kind=TEXT),
    },
    "tolerances": {"*": Key("half width of a field of the machine, with its unit or as a share in %")},
    "job": {"*": Key("number of the environments' task, as a keyword of gymnasium.make")},
}
"""Tables of the file by their path; "*" is a name that the user chooses. ``drive`` is a list of tables, and ``joint``
may be."""

REQUIRED = ("structure", "joint", "drive", "operation")


def _inner(path: str) -> list[str]:
    """Names of the tables within a table."""
    return [name.rpartition(".")[2] for name in TABLES if name and name.rpartition(".")[0] == path]


def checked_table(path: str, given: Any) -> dict[str, Any]:
    """Values of a table in SI: floats, arrays, texts; tables within it are left out.

    Raises
    ------
    ParameterError
        If a key is unknown (the nearest one is suggested), a unit is missing, or a value has the wrong form.
    """
    if not isinstance(given, dict):
        raise ParameterError(f"{path} = {shown(given)} is not a table; write [{path}] and one line a value below it")
    known, prefix = TABLES[path], f"{path}." if path else ""
    inner = _inner(path)
    values = {}
    for name, value in given.items():
        if name in inner:
            continue
        key = known.get(name) or known.get("*")
        if key is None:
            where = f"[{path}]" if path else "the file"
            raise ParameterError(f"{where} has no key {name!r}{told_of(name, [*known, *inner])}")
        values[name] = value if path in ("tolerances", "job") else _told_value(f"{prefix}{name}", value, key)
    return values


def _told_value(name: str, given: Any, key: Key) -> Any:
    """Value of a key; a unit that does not fit is told of."""
    try:
        return _value(name, given, key)
    except ParameterError as error:
        _, found, unit = str(error).partition(" has the unknown unit '")
        raise ParameterError(f"{error}{hint(unit.partition(chr(39))[0]) if found else ''}") from None


def _value(name: str, given: Any, key: Key) -> Any:
    unit = "kg^1/2" if name == "structure.shapes.base" else key.unit
    moves = turns(given, unit)
    if moves:
        unit = TURNING[unit]
    elif key is SHAPE and moves is None:
        unit = "-"  # no unit, which modal masses allow
    if key.kind in ("row", "rows"):
        if key.kind == "rows":
            if not isinstance(given, list):
                raise ParameterError(f"{name} = {shown(given)} is out of range; allowed: a list of rows")
            return [parse_row(name, row, unit) for row in given]
        return np.array(parse_row(name, given, unit))
    if key.kind == "quantity":
        return parse_quantity(name, given, unit)
    kind: Any = {"text": str, "texts": list, "count": int, "flag": bool}[key.kind]
    if not isinstance(given, kind) or (key.kind == "count" and isinstance(given, bool)):
        what = {"text": "a text", "texts": "a list of texts", "count": "a whole number", "flag": "true or false"}
        raise ParameterError(f"{name} = {shown(given)} is out of range; allowed: {what[key.kind]}")
    if key.kind == "texts" and not all(isinstance(one, str) for one in given):
        raise ParameterError(f"{name} = {shown(given)} is out of range; allowed: a list of texts")
    if key.choices and given not in key.choices:
        raise ParameterError(f"{name} = {shown(given)} is not one of {', '.join(key.choices)}")
    return given


def schema() -> dict[str, Any]:
    """JSON schema of a machine's file, for editors."""
    top: dict[str, Any] = _table_schema("")
    top["required"] = list(REQUIRED)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "chaosgym machine", **top}


def _table_schema(path: str) -> dict[str, Any]:
    prefix = f"{path}." if path else ""
    properties, free = {}, None
    for name, key in TABLES[path].items():
        if name == "*":
            free = _key_schema(path, key)
        else:
            properties[name] = _key_schema(path, key)
    for inner in _inner(path):
        table = _table_schema(f"{prefix}{inner}")
        several = {"type": "array", "items": table}
        properties[inner] = several if inner == "drive" else {"anyOf": [table, several]} if inner == "joint" else table
    return {"type": "object", "properties": properties, "additionalProperties": False if free is None else free}


def _key_schema(path: str, key: Key) -> dict[str, Any]:
    text: dict[str, Any] = {"type": "string"}
    number = [{"type": "number"}] if key.unit == "-" or key is SHAPE else []
    one = {"anyOf": [text, *number]} if number else text
    shapes: dict[str, Any] = {
        "quantity": one,
        "row": {"anyOf": [text, *number, {"type": "array", "items": one}]},
        "rows": {"type": "array", "items": {"anyOf": [text, {"type": "array", "items": one}]}},
        "text": {"type": "string", "enum": list(key.choices)} if key.choices else text,
        "texts": {"type": "array", "items": text},
        "count": {"type": "integer"},
        "flag": {"type": "boolean"},
    }
    listed = [*units_of(key.unit), *(units_of(TURNING[key.unit]) if key.unit in TURNING else ())]
    about = key.about if key.unit == "-" else f"{key.about} [{', '.join(listed)}]"
    return {**shapes["quantity" if path in ("tolerances", "job") else key.kind], "description": about}
