"""The design brief: machine, tolerances, criteria and changes in one TOML file."""

import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import Any

from chaosgym.design.bearing import Criteria, variation_region
from chaosgym.design.bent_section import Bending
from chaosgym.design.brief_sections import (
    OF_MACHINE,
    SECTIONS,
    bending_of,
    changes_of,
    costs_of,
    criteria_of,
    heading_of,
    homes_of,
    impacts_of,
    machine_named,
    refuse_unknown,
    series_size_of,
    speeds_of,
    table_of,
    tolerances_of,
    wear_of,
)
from chaosgym.design.changes import default_changes
from chaosgym.design.methodology import SERIES_SIZE
from chaosgym.design.wear import Wear
from chaosgym.diagnosis import Tolerance, default_tolerances
from chaosgym.errors import DesignError
from chaosgym.files import toml_of
from chaosgym.machines import FILE_ENDING, MACHINES, Machine
from chaosgym.machines.accuracy import DEFAULT_TOLERANCE, ModelAccuracy, accuracy_of, is_tolerance, model_within
from chaosgym.machines.parameters import expand_fidelity, is_half_play, parameters_of, with_settings
from chaosgym.numbers import shown
from chaosgym.units import parse_quantity


@dataclass(frozen=True, kw_only=True)
class DesignBrief:
    """A design question.

    Attributes
    ----------
    machine
        The nominal machine.
    region
        Tolerance of each field, widened to the region asked for.
    criteria
        Bearing data and requirements.
    changes
        Values that may be tried, by field.
    costs
        Cost weights by field.
    series_size
        Machines that represent the region.
    duty
        Share of the operating time by speed, in nominal speeds; empty for one speed.
    wear
        Data of Archard's law; None if wear is left out.
    bending
        A section of the flexible part and its material; None if bending is left out.
    impacts
        Clearances [m] at which the report says where impacts fall.
    bending_stated
        Names that its section on bending states.
    heading
        Texts at the head of the report, by "title", "project" and "author"; those that are stated.
    accuracy
        Estimated error of the machine's model, the largest of the nominal machine and of its farthest changes.
    """

    machine: Machine
    region: Mapping[str, Tolerance]
    criteria: Criteria
    changes: Mapping[str, tuple[float, ...]]
    costs: Mapping[str, float]
    series_size: int = SERIES_SIZE
    duty: Mapping[float, float] = field(default_factory=dict)
    wear: Wear | None = None
    bending: Bending | None = None
    impacts: tuple[float, ...] = ()
    bending_stated: tuple[str, ...] = field(default=())
    heading: Mapping[str, str] = field(default_factory=dict)
    accuracy: ModelAccuracy[Machine] | None = field(default=None)


def brief_text(path: str | Path) -> tuple[str, bool]:
    """Text of a brief, and whether the file is a machine's, whose template it then is.

    Raises
    ------
    DesignError
        If the file can't be read as TOML.
    """
    text, values = _read(path)
    of_machine = "machine" not in values and any(key in values for key in OF_MACHINE)
    return (template(str(path)), True) if of_machine else (text, False)


def read_brief(path: str | Path) -> DesignBrief:
    """Read a design brief, or start from the template of a machine's file.

    Raises
    ------
    DesignError
        If the file can't be read as TOML, a key is unknown, a unit missing or a value not allowed.
    ParameterError
        If a parameter, tolerance or criterion is out of its range.
    """
    text, of_machine = brief_text(path)
    values = tomllib.loads(text)
    beside = Path(path).parent / str(values.get("machine"))
    if beside.suffix == FILE_ENDING and beside.is_file():
        short = Path(os.path.normpath(beside))  # another file where a folder on the way is a link
        values["machine"] = str(short if short.is_file() and short.samefile(beside) else beside)
    return brief_from(values, str(path), {} if of_machine else lines_of(text, "criteria", values))


def lines_of(text: str, section: str, values: Mapping[str, Any]) -> dict[str, int]:
    """Line of each key of a section of a TOML text, from 1; keys whose value takes several lines have none.

    Examples
    --------
    >>> from chaosgym.design.brief import lines_of
    >>> lines_of("[criteria]\\nlife = 5\\n", "criteria", {"criteria": {"life": 5}})
    {'life': 2}
    """
    found, here = dict[str, int](), ""
    stated = values.get(section, {})
    for number, line in enumerate(text.splitlines(), 1):
        try:
            read = tomllib.loads(line)
        except tomllib.TOMLDecodeError:
            continue
        if line.lstrip().startswith("["):
            here = ".".join(read)
            continue
        own = read if here == section else read.get(section, {}) if not here else {}
        if isinstance(own, Mapping) and isinstance(stated, Mapping):
            found |= {key: number for key, value in own.items() if key in stated and stated[key] == value}
    return found


def _read(path: str | Path) -> tuple[str, dict[str, Any]]:
    try:
        text, values = toml_of(path)
    except ValueError as error:
        if Path(path).suffix not in ("", FILE_ENDING) and Path(path).is_file():
            raise DesignError(
                f"{path} is no brief, which is a TOML file; a recording is judged by `chaosgym judge {path}`, and put "
                f"beside a brief by --beside {path}"
            ) from None
        raise DesignError(f"{path} {error}") from None
    return text, values


def brief_from(
    values: Mapping[str, Any], source: str = "brief", lines: Mapping[str, int] = MappingProxyType({})
) -> DesignBrief:
    """Build a design brief from the values of its file, the ``source`` with the line of each criterion."""
    name = values.get("machine")
    if not isinstance(name, str):
        raise DesignError(f"machine = {shown(name)} does not exist; {MACHINES.listed('')}")
    refuse_unknown("the brief", values, SECTIONS, homes_of(MACHINES[str(name)]() if name in MACHINES else None))
    machine = machine_named(name)
    fields = parameters_of(machine)
    settings = {
        key: given if fields[key].choices else parse_quantity(f"parameters.{key}", given, fields[key].unit)
        for key, given in table_of(values, "parameters", fields, machine).items()
    }
    machine = with_settings(machine, settings)
    duty = speeds_of(values, machine, machine.speed_field in settings)
    if duty and machine.speed_field not in settings:
        machine = machine.at(max(duty, key=lambda speed: duty[speed]))
    nominal = getattr(machine, machine.speed_field)
    region = table_of(values, "region", ("tolerances", "wear"), machine)
    wear = region.get("wear", False)
    if not isinstance(wear, bool):
        raise DesignError(f"region.wear = {shown(wear)} is out of range; allowed: true or false")
    criteria = criteria_of(values, machine, source, lines)
    tolerances = variation_region(machine, tolerances_of(values, machine), region.get("tolerances", 1), wear)
    changes = changes_of(values, machine)
    accuracy = _modelled(machine, values.get("fidelity"), settings, changes)
    machine = accuracy.machine
    return DesignBrief(
        machine=machine,
        region=tolerances,
        criteria=criteria,
        changes=changes,
        costs=costs_of(values, machine),
        series_size=series_size_of(values),
        duty={speed / nominal: share for speed, share in duty.items()},
        wear=wear_of(values, machine),
        bending=bending_of(values, machine, tolerances),
        impacts=impacts_of(values, machine),
        bending_stated=tuple(values.get("bending", {})),
        heading=heading_of(values),
        accuracy=accuracy,
    )


def _modelled(
    machine: Machine,
    fidelity: Any,
    settings: Mapping[str, Any],
    changes: Mapping[str, tuple[float, ...]],
) -> ModelAccuracy[Machine]:
    """The machine by one model for all that it may become: as stated, or within a tolerance there."""
    machine = with_settings(machine, expand_fidelity(machine, {**settings, "fidelity": fidelity}))
    ends = {name: sorted({min(values), max(values)}) for name, values in changes.items() if values}
    points = [machine, *(with_settings(machine, {name: end}) for name, pair in ends.items() for end in pair)]
    stated = any(name in settings or name in changes for name in machine.model_fields)
    if stated or (fidelity is not None and not is_tolerance(fidelity)):
        return accuracy_of(machine, points)
    return model_within(machine, fidelity or DEFAULT_TOLERANCE, points)


def template(name: str) -> str:
    """Commented design brief of a machine, ready to edit.

    Raises
    ------
    DesignError
        If there is no such machine.
    """
    import jinja2

    machine = machine_named(name)
    fields = parameters_of(machine)
    bends = "modes" if machine.flexible is not None else ""
    bends = next((name or "beam" for name in machine.bending_parts), bends)

    def written(field: str, value: float) -> str:
        unit = fields[field].unit
        if unit == "-":
            return f"{value:.6g}"
        return f'"{1e3 * value:.6g} mm"' if unit == "m" else f'"{value:.6g} {unit}"'

    def share_of_speed(factor: float) -> str:
        return f'"{factor * getattr(machine, machine.speed_field):.4g} {fields[machine.speed_field].unit}"'

    page = jinja2.Template(
        files("chaosgym.design").joinpath("brief.toml.jinja").read_text(encoding="utf-8"),
        trim_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    text: str = page.render(
        name=name,
        series=SERIES_SIZE,
        speed=machine.speed_field,
        clearance=machine.clearance_field,
        gap=getattr(machine, machine.clearance_field),
        measure="half the gap" if is_half_play(machine, machine.clearance_field) else "from rest to the stop",
        rung=', or a rung such as "fine"' if "fine" in getattr(machine, "fidelity_ladder", {}) else "",
        slides=fields[machine.clearance_field].unit == "m",
        bends=bends,
        tolerances=default_tolerances(machine),
        changes=default_changes(machine),
        nominal=lambda field: written(field, getattr(machine, field)),
        written=written,
        row=lambda field, values: f"[{', '.join(written(field, value) for value in values)}]",
        share_of_speed=share_of_speed,
    )
    return text
