"""Which joints, drives and shapes of a machine's file are rotations: their units tell, and have to agree."""

from collections.abc import Mapping
from typing import Any

from chaosgym.errors import ParameterError
from chaosgym.machines.modal_machine.keys import SHAPE, TABLES
from chaosgym.machines.modal_machine.places import Term, terms_of
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
    points = _motions_of(shapes, structure.get("modal_masses"))
    if residual := structure.get("residual"):
        _agree("structure.residual", _motion("structure.residual", residual), str(residual.get("at", "")), points)
    of_drives = []
    for path in ("drive", "load"):
        rows = values.get(path, [])
        for row in rows if isinstance(rows, list) else [rows]:
            of_drives.append(_motion(path, row))
            base = "displacement" in row or "acceleration" in row
            _agree(path, of_drives[-1], str(row.get("at", BASE if base else "")), points)
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
    """Refuse units of a table that do not fit the shapes of the points whose linear combination it concerns."""
    for _, word, lever in [Term(1.0, place)] if place in points else terms_of(place):
        stated = points.get(word)
        moves_there = True if lever else moves
        if lever and moves:
            raise ParameterError(
                f"{path} at {place!r} slides by its radius, and a unit says that it turns; allowed: m, N"
            )
        if moves_there is not None and stated is not None and stated != moves_there:
            unit = "kg^1/2" if word == BASE else SHAPE.unit
            raise ParameterError(
                f"{path} at {place!r} {MOTION[moves_there]}, and the shape of {word!r} is of a point that "
                f"{MOTION[stated]}; allowed: a shape in {TURNING[unit] if moves_there else unit}"
            )


def _motions_of(shapes: Mapping[str, Any], masses: Any) -> dict[str, bool | None]:
    """Whether each point turns by the unit of its shape; modal masses, if any, leave that open of all but the base.

    Refuses shapes whose unit does not go with their scale.
    """
    points = {name: turns(given, "kg^1/2" if name == BASE else SHAPE.unit) for name, given in shapes.items()}
    for name, given in shapes.items():
        where, unit = f"structure.shapes.{name} = {shown(given)}", "kg^1/2" if name == BASE else SHAPE.unit
        if masses is None and points[name] is None:
            beside = "the unit of a mass beside modal_masses" if name == BASE else "none is needed beside modal_masses"
            raise ParameterError(
                f"{where} has no unit; write it in {unit}, or in {TURNING[unit]} if it turns ({beside})"
            )
        if masses is not None and points[name] is not None:
            allowed = "a mass" if name == BASE else "no unit"
            raise ParameterError(
                f"{where} is mass-normalised, as none is beside modal_masses; allowed: {allowed}, or no modal_masses"
            )
    if masses is not None and BASE in shapes:
        points[BASE] = _base_motion(shapes[BASE], bool(turns(masses, "kg")))
    return points


def _base_motion(given: Any, modes_turn: bool) -> bool:
    """Whether the base turns, by the unit of its participation phi' M r beside modal masses of kg or kg m^2."""
    unit, crossed = ("kg m^2", "kg m") if modes_turn else ("kg", "kg m")
    if turns(given, "kg m") is False:
        return not modes_turn
    if turns(given, "kg") is not modes_turn:
        raise ParameterError(
            f"structure.shapes.base = {shown(given)} has no unit of a mass; beside modal_masses it is what a motion of "
            f"the base takes along in each mode, the sum of mass times shape: write it in {unit}, or in {crossed} if "
            f"the base {MOTION[not modes_turn]} (of one body whose shape is 1, its modal mass)"
        )
    return modes_turn
