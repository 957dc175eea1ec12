"""The design brief: machine, tolerances, criteria and changes in one TOML file."""

import os
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

from chaosgym.design.bearing import Criteria, variation_region
from chaosgym.design.bent_section import Bending, fibres, read_bending
from chaosgym.design.changes import default_changes
from chaosgym.design.methodology import SERIES_SIZE
from chaosgym.design.runs import deviating
from chaosgym.design.wear import Wear, read_wear, worn_clearances
from chaosgym.diagnosis import Tolerance, default_tolerances
from chaosgym.errors import DesignError
from chaosgym.files import toml_of
from chaosgym.machines import FILE_ENDING, MACHINES, Machine
from chaosgym.machines.numbers import shown
from chaosgym.machines.parameters import by_field, parameters_of, suggestion, with_settings
from chaosgym.machines.stated import flat
from chaosgym.machines.units import parse_quantity, parse_row, units_of

BY_FIELD = ("parameters", "tolerances", "changes", "costs")
"""Sections whose keys are fields of the machine."""

REQUIRED_CRITERIA = ("load_rating", "life", "reliability")
"""Criteria that a brief must state; the others have defaults, which the report lists."""

SECTIONS = (
    "machine",
    "series",
    "parameters",
    "tolerances",
    "region",
    "duty",
    "criteria",
    "changes",
    "costs",
    "archard",
    "bending",
    "impacts",
)

DUTY = ("hours_a_day", "speeds")

DAYS_A_YEAR = 365.25

MOST_CLEARANCES = 64
"""Clearances at which a brief may ask where impacts fall."""

OF_MACHINE = ("structure", "joint", "joints", "drive", "operation")
"""Sections of a machine's file: what holds one is no brief."""


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
    stated
        Names of the criteria that the brief states itself.
    bending_stated
        Those of its section on bending.
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
    stated: tuple[str, ...] = field(default=())
    bending_stated: tuple[str, ...] = field(default=())


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
    if of_machine:
        return replace(brief_from(values), stated=())
    if beside.suffix == FILE_ENDING and beside.is_file():
        short = Path(os.path.normpath(beside))  # another file where a folder on the way is a link
        values["machine"] = str(short if short.is_file() and short.samefile(beside) else beside)
    return brief_from(values)


def _read(path: str | Path) -> tuple[str, dict[str, Any]]:
    try:
        text, values = toml_of(path)
    except ValueError as error:
        raise DesignError(f"{path} {error}") from None
    return text, values


def brief_from(values: Mapping[str, Any]) -> DesignBrief:
    """Build a design brief from the values of its file."""
    name = values.get("machine")
    if not isinstance(name, str):
        raise DesignError(f"machine = {shown(name)} does not exist; {MACHINES.listed('')}")
    _known("the brief", values, SECTIONS, _homes(MACHINES[str(name)]() if name in MACHINES else None))
    machine = _machine(name)
    fields = parameters_of(machine)
    settings = {
        key: given if fields[key].choices else parse_quantity(f"parameters.{key}", given, fields[key].unit)
        for key, given in _section(values, "parameters", fields, machine).items()
    }
    machine = with_settings(machine, settings)
    duty = _speeds(values, machine, machine.speed_field in settings)
    if duty and machine.speed_field not in settings:
        machine = machine.at(max(duty, key=lambda speed: duty[speed]))
    nominal = getattr(machine, machine.speed_field)
    region = _section(values, "region", ("tolerances", "wear"), machine)
    wear = region.get("wear", False)
    if not isinstance(wear, bool):
        raise DesignError(f"region.wear = {shown(wear)} is out of range; allowed: true or false")
    criteria = _criteria(values, machine)
    tolerances = variation_region(machine, _tolerances(values, machine), region.get("tolerances", 1), wear)
    return DesignBrief(
        machine=machine,
        region=tolerances,
        criteria=criteria,
        changes=_changes(values, machine),
        costs=_costs(values, machine),
        series_size=_series_size(values),
        duty={speed / nominal: share for speed, share in duty.items()},
        wear=_wear(values, machine),
        bending=_bending(values, machine, tolerances),
        impacts=_impacts(values, machine),
        stated=tuple(values.get("criteria", {})),
        bending_stated=tuple(values.get("bending", {})),
    )


def _machine(name: Any) -> Any:
    if name not in MACHINES:
        raise DesignError(f"machine = {shown(name)} does not exist; {MACHINES.listed(name)}")
    return MACHINES[name]()


def _known(where: str, given: Iterable[str], known: Iterable[str], homes: Mapping[str, str] | None = None) -> None:
    known = list(known)
    for key in given:
        if key not in known:
            home = f"; it belongs in {homes[key]}" if homes and key in homes else suggestion(key, known)
            raise DesignError(f"{where} has no key {shown(key)}{home}")


def _homes(machine: Machine | None = None) -> dict[str, str]:
    """Where a key belongs that stands in the wrong place."""
    homes = dict.fromkeys(parameters_of(machine), "[parameters], [tolerances] or [changes]") if machine else {}
    homes |= dict.fromkeys(set(parameters_of(Criteria)) - {"hours"}, "[criteria]") | {"wear": "[region]"}
    homes |= dict.fromkeys((*parameters_of(Bending), *OF_SECTION), "[bending]")
    homes |= dict.fromkeys(parameters_of(Wear), "[archard]")
    homes |= dict.fromkeys(DUTY, "[duty]") | dict.fromkeys(SECTIONS, "the brief itself, above or beside this section")
    return homes | dict.fromkeys(OF_MACHINE, 'the file of the machine, which the brief names: machine = "FILE.toml"')


def _section(
    values: Mapping[str, Any], name: str, known: Iterable[str], machine: Machine | None = None
) -> Mapping[str, Any]:
    given = values.get(name, {})
    if not isinstance(given, Mapping):
        raise DesignError(f"{name} = {shown(given)} is not a table; write [{name}] and one line a value below it")
    section: Mapping[str, Any] = by_field(machine, flat(given)) if machine and name in BY_FIELD else given
    _known(f"[{name}]", section, known, _homes(machine))
    return section


def _criteria(values: Mapping[str, Any], machine: Machine) -> Criteria:
    known = {name: about for name, about in parameters_of(Criteria).items() if name != "hours"}  # a unit of the life
    section = _section(values, "criteria", known, machine)
    for name in REQUIRED_CRITERIA:
        if name not in section:
            raise DesignError(f"[criteria] lacks {name}")
    read = {
        key: parse_quantity(f"criteria.{key}", given, known[key].unit)
        for key, given in section.items()
        if key != "life"
    }
    return Criteria(**read, **_life(section["life"], _hours_a_day(values, machine))).at(machine.cycle_period)


def _hours_a_day(values: Mapping[str, Any], machine: Machine) -> float:
    given = _section(values, "duty", DUTY, machine).get("hours_a_day", "24 h")
    hours = parse_quantity("duty.hours_a_day", given, "h", {"h": 1.0, "min": 1.0 / 60.0})
    if not 0.0 < hours <= 24.0:
        raise DesignError(f"duty.hours_a_day = {shown(given)} is out of range; allowed: above 0 h, at most 24 h")
    return hours


def _speeds(values: Mapping[str, Any], machine: Machine, stated: bool) -> dict[float, float]:
    """Share of the operating time at each speed of a load collective; empty for one speed."""
    given = _section(values, "duty", DUTY, machine).get("speeds", {})
    if not isinstance(given, Mapping):
        raise DesignError(
            f'duty.speeds = {shown(given)} is not a table; write [duty.speeds] and "20 Hz" = "40 %" below'
        )
    unit, name = parameters_of(machine)[machine.speed_field].unit, machine.speed_field
    shares = dict[float, float]()
    for key, share in given.items():
        speed = parse_quantity(f"duty.speeds {shown(key)}", key, unit)
        with_settings(machine, {name: speed})
        if speed in shares:
            raise DesignError(f"duty.speeds states {shown(key)} twice; add its shares up")
        shares[speed] = parse_quantity(f"duty.speeds.{key}", share, "-")
        if not 0.0 < shares[speed] <= 1.0:
            raise DesignError(f"duty.speeds.{key} = {shown(share)} is out of range; allowed: above 0 %, at most 100 %")
    total = sum(shares.values())
    if shares and abs(total - 1.0) > 1e-6:
        raise DesignError(
            f"duty.speeds adds up to {100.0 * total:.6g} %; allowed: shares of the time that add up to 100 %"
        )
    nominal = getattr(machine, name)
    if shares and stated and nominal not in shares:
        raise DesignError(
            f"duty.speeds lacks the nominal {name} {nominal:g} {unit}; give it a share, or leave it out of [parameters]"
        )
    return {speed: share / total for speed, share in shares.items()}


def _wear(values: Mapping[str, Any], machine: Machine) -> Wear | None:
    if "archard" not in values:
        return None
    known = parameters_of(Wear)
    section = _section(values, "archard", known, machine)
    own = {"area": {"m^2": 1.0, "cm^2": 1e-4, "mm^2": 1e-6}}
    found = read_wear(
        {key: parse_quantity(f"archard.{key}", one, known[key].unit, own.get(key)) for key, one in section.items()}
    )
    worn_clearances(machine, found)  # refused before the machine is assessed, not after
    return found


OF_SECTION = {"at": "m", "link": "", "span": "m", "turn": "", "curvatures": "kg^-1/2 m^-2"}
"""Keys that state a section, and their units."""


def _bending(values: Mapping[str, Any], machine: Machine, region: Mapping[str, Tolerance]) -> Bending | None:
    if "bending" not in values:
        return None
    known = parameters_of(Bending)
    section = _section(values, "bending", [*known, *OF_SECTION], machine)
    read = dict[str, Any]()
    for key, given in section.items():
        name, unit = f"bending.{key}", OF_SECTION[key] if key in OF_SECTION else known[key].unit
        if key == "curvatures":
            read[key] = tuple(parse_row(name, given, unit))
        elif key in ("turn", "link") or known.get(key, known["slope"]).choices:
            if not isinstance(given, str):
                raise DesignError(f"{name} = {shown(given)} is out of range; allowed: a text")
            read[key] = given
        else:
            read[key] = parse_quantity(name, given, unit)
    found = read_bending(read, machine)
    for end in (-1.0, 1.0):  # the section lies within every machine that may be built
        fibres(deviating(machine, region, [end] * len(region)), found)
    return found


def _impacts(values: Mapping[str, Any], machine: Machine) -> tuple[float, ...]:
    if "impacts" not in values:
        return ()
    name = machine.clearance_field
    given = _section(values, "impacts", ("clearances",), machine).get("clearances")
    if not isinstance(given, list) or not 0 < len(given) <= MOST_CLEARANCES:
        raise DesignError(
            f"impacts.clearances = {shown(given)} is out of range; allowed: a list of 1 to {MOST_CLEARANCES} clearances"
        )
    found = tuple(parse_quantity("impacts.clearances", one, parameters_of(machine)[name].unit) for one in given)
    for value in found:
        with_settings(machine, {name: value})
    return found


def _life(given: Any, hours_a_day: float) -> dict[str, float]:
    """A life in cycles or in time, of which the duty leaves the hours of operation."""
    year = DAYS_A_YEAR * hours_a_day
    in_hours = {"h": 1.0, "years": year, "year": year, "days": hours_a_day, "day": hours_a_day}
    value = parse_quantity("criteria.life", given, "Mcycles", {**units_of("Mcycles"), **in_hours})
    if not value > 0.0:
        raise DesignError(f"criteria.life = {shown(given)} is out of range; allowed: above 0")
    return {"hours" if given.rpartition(" ")[2] in in_hours else "life": value}


def _tolerances(values: Mapping[str, Any], machine: Machine) -> dict[str, Tolerance]:
    if "tolerances" not in values:
        return default_tolerances(machine)
    fields = {name: about for name, about in parameters_of(machine).items() if not about.choices}
    tolerances = {}
    for key, given in _section(values, "tolerances", fields, machine).items():
        relative = isinstance(given, str) and given.strip().endswith("%")
        value = parse_quantity(f"tolerances.{key}", given, "-" if relative else fields[key].unit)
        if not value > 0.0:
            raise DesignError(f"tolerances.{key} = {shown(given)} is out of range; allowed: above 0")
        tolerances[key] = Tolerance(value, relative=relative)
    return tolerances


def _changes(values: Mapping[str, Any], machine: Machine) -> dict[str, tuple[float, ...]]:
    if "changes" not in values:
        return default_changes(machine)
    fields = {name: about for name, about in parameters_of(machine).items() if not about.choices}
    changes = {}
    for key, given in _section(values, "changes", fields, machine).items():
        row = given if isinstance(given, list) else [given]
        changes[key] = tuple(parse_quantity(f"changes.{key}", one, fields[key].unit) for one in row)
        for value in changes[key]:
            with_settings(machine, {key: value})
    return changes


def _costs(values: Mapping[str, Any], machine: Machine) -> dict[str, float]:
    changes = _changes(values, machine)
    section = _section(values, "costs", changes or parameters_of(machine), machine)
    costs = {key: parse_quantity(f"costs.{key}", given, "-") for key, given in section.items()}
    for key, cost in costs.items():
        if not cost >= 0.0:
            raise DesignError(f"costs.{key} = {cost:g} is out of range; allowed: 0 or more")
    # an empty [changes] searches nothing: weights wait there for later
    return costs if changes else {}


def _series_size(values: Mapping[str, Any]) -> int:
    size = values.get("series", SERIES_SIZE)
    if isinstance(size, bool) or not isinstance(size, int) or not 8 <= size <= 4096:
        raise DesignError(f"series = {shown(size)} is out of range; allowed: whole numbers from 8 to 4096")
    return size


def template(name: str) -> str:
    """Commented design brief of a machine, ready to edit.

    Raises
    ------
    DesignError
        If there is no such machine.
    """
    import jinja2

    machine = _machine(name)
    fields = parameters_of(machine)
    bends = "modes" if machine.flexible is not None else ""
    if machine.bending_links:
        bends = machine.bending_links[0]
    if bends and type(machine).stress_at is not Machine.stress_at:
        bends = "beam"

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
        slides=fields[machine.clearance_field].unit == "m",
        bends=bends,
        criteria=Criteria(),
        tolerances=default_tolerances(machine),
        changes=default_changes(machine),
        nominal=lambda field: written(field, getattr(machine, field)),
        written=written,
        row=lambda field, values: f"[{', '.join(written(field, value) for value in values)}]",
        share_of_speed=share_of_speed,
    )
    return text
