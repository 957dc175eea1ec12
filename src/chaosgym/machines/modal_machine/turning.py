"""Which joints, drives and shapes of a machine's file are rotations: their units tell, and have to agree."""

from collections.abc import Mapping
from typing import Any

from chaosgym.errors import ParameterError
from chaosgym.machines.modal_machine.keys import SHAPE, TABLES
from chaosgym.machines.modal_machine.structure import BASE
from chaosgym.numbers import shown
from chaosgym.units import TURNING, turns

MOTION = {True: "turns", False: "slides"}


def turning_joints(values: Mapping[str, Any]) -> list[bool]:
    """Which joints of a file turn, in its order.

    Parameters
    ----------
    values
        Of the file, whose tables have been checked.

    Raises
    ------
    ParameterError
        If a joint or a drive has units of both, or others than the shape of its point.
    """
    structure = values["structure"]
    shapes = structure.get("shapes", {})
    points = {name: turns(given, "kg^1/2" if name == BASE else SHAPE.unit) for name, given in shapes.items()}
    _refuse_bare(shapes, points, "modal_masses" in structure)
    if residual := structure.get("residual"):
        _agree("structure.residual", _motion("structure.residual", residual), str(residual.get("at", "")), points)
    drives = values["drive"] if isinstance(values["drive"], list) else [values["drive"]]
    of_drives = [_motion("drive", row) for row in drives]
    for row, moves in zip(drives, of_drives, strict=True):
        base = "displacement" in row or "acceleration" in row
        _agree("drive", moves, str(row.get("at", BASE if base else "")), points)
    joints = values["joint"] if isinstance(values["joint"], list) else [values["joint"]]
    found = []
    for row in joints:
        moves, below = _motion("joint", row), _motion("joint.lower", row.get("lower", {}))
        if below is not None and below != moves:
            raise ParameterError(f"joint.lower {MOTION[below]} and its joint {MOTION[not below]}; allowed: the same")
        _agree("joint", moves, str(row.get("at", "")), points)
        found.append(bool(moves))
        for along in ("slides", "tangent"):
            if along in row:
                _agree(f"joint.{along}", bool(moves), str(row[along]), points)
    for row in values.get("spring", ()):
        _agree("spring", _motion("spring", row), str(row.get("at", "")), points)
    operation = values["operation"]
    names = [row.get("name", f"joint_{number}") for number, row in enumerate(joints, 1)]
    watched = names.index(operation["monitored"]) if operation.get("monitored") in names else 0
    usual = _motion("operation", operation)
    if usual is not None and usual != found[watched]:
        raise ParameterError(f"operation.clearance_range is of a joint that {MOTION[usual]}, and the joint does not")
    if structure.get("units") == "t mm N" and (any(found) or any(of_drives)):
        raise ParameterError("units = 't mm N' is of a structure that slides; allowed with rad or N m: 'kg m N'")
    return found


def _motion(path: str, table: Mapping[str, Any]) -> bool | None:
    """Whether a table is of something that turns; None if no unit tells."""
    told = {name: turns(given, TABLES[path][name].unit) for name, given in table.items() if name in TABLES[path]}
    by_motion = {moves: name for name, moves in told.items() if moves is not None}
    if len(by_motion) == 2:
        one, other = by_motion[True], by_motion[False]
        raise ParameterError(
            f"{path}.{one} = {shown(table[one])} is of what turns and {path}.{other} = {shown(table[other])} of what "
            "slides; allowed: one of the two"
        )
    return next(iter(by_motion), None)


def _agree(path: str, moves: bool | None, place: str, points: Mapping[str, bool | None]) -> None:
    """Refuse units of a table that do not fit the shape of its point."""
    words = [place] if place in points else place.replace("-", " ").replace("+", " ").split()
    for word in words:
        stated = points.get(word)
        if moves is not None and stated is not None and stated != moves:
            unit = "kg^1/2" if word == BASE else SHAPE.unit
            raise ParameterError(
                f"{path} at {place!r} {MOTION[moves]}, and the shape of {word!r} is of a point that {MOTION[stated]}; "
                f"allowed: a shape in {TURNING[unit] if moves else unit}"
            )


def _refuse_bare(shapes: Mapping[str, Any], points: Mapping[str, bool | None], with_masses: bool) -> None:
    """Refuse shapes without a unit, unless modal masses say what they are."""
    for name, moves in points.items():
        if moves is None and not with_masses:
            unit = "kg^1/2" if name == BASE else SHAPE.unit
            raise ParameterError(
                f"structure.shapes.{name} = {shown(shapes[name])} has no unit; write it in {unit}, or in "
                f"{TURNING[unit]} if it turns (none is needed beside modal_masses)"
            )
