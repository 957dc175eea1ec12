"""What each section of a design brief says, checked against the machine that it is about."""

from collections.abc import Iterable, Mapping
from typing import Any

from chaosgym.design.bearing import Criteria
from chaosgym.design.bent_section import Bending, fibres, read_bending
from chaosgym.design.changes import default_changes
from chaosgym.design.methodology import SERIES_SIZE
from chaosgym.design.runs import deviating
from chaosgym.design.wear import Wear, read_wear, worn_clearances
from chaosgym.diagnosis import Tolerance, default_tolerances
from chaosgym.errors import DesignError
from chaosgym.machines import MACHINES, Machine
from chaosgym.machines.parameters import by_field, parameters_of, suggestion, with_settings
from chaosgym.machines.stated import flat
from chaosgym.numbers import number, shown, whole
from chaosgym.units import parse_quantity, parse_row, units_of

BY_FIELD = ("parameters", "tolerances", "changes", "costs")
"""Sections whose keys are fields of the machine."""

SECTIONS = (
    "machine",
    "series",
    "fidelity",
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
    "report",
)

HEADING = ("title", "project", "author")
"""Texts at the head of a report."""

DUTY = ("hours_a_day", "speeds")

DAYS_A_YEAR = 365.25

MOST_CLEARANCES = 64
"""Clearances at which a brief may ask where impacts fall."""

OF_MACHINE = ("structure", "joint", "joints", "drive", "operation")
"""Sections of a machine's file: what holds one is no brief."""


def machine_named(name: Any) -> Any:
    """Machine of a name or a file; raises DesignError if there is none."""
    if name not in MACHINES:
        raise DesignError(f"machine = {shown(name)} does not exist; {MACHINES.listed(name)}")
    return MACHINES[name]()


def refuse_unknown(
    where: str, given: Iterable[str], known: Iterable[str], homes: Mapping[str, str] | None = None
) -> None:
    """Refuse a key that is not known; where it belongs elsewhere, say where."""
    known = list(known)
    for key in given:
        if key not in known:
            home = f"; it belongs in {homes[key]}" if homes and key in homes else suggestion(key, known)
            raise DesignError(f"{where} has no key {shown(key)}{home}")


def homes_of(machine: Machine | None = None) -> dict[str, str]:
    """Where a key belongs that stands in the wrong place."""
    homes = dict.fromkeys(parameters_of(machine), "[parameters], [tolerances] or [changes]") if machine else {}
    homes |= dict.fromkeys(set(parameters_of(Criteria)) - {"hours"}, "[criteria]") | {"wear": "[region]"}
    homes |= dict.fromkeys((*parameters_of(Bending), *OF_SECTION), "[bending]")
    homes |= dict.fromkeys(parameters_of(Wear), "[archard]")
    homes |= dict.fromkeys(HEADING, "[report]")
    homes |= dict.fromkeys(DUTY, "[duty]") | dict.fromkeys(SECTIONS, "the brief itself, above or beside this section")
    return homes | dict.fromkeys(OF_MACHINE, 'the file of the machine, which the brief names: machine = "FILE.toml"')


def table_of(
    values: Mapping[str, Any], name: str, known: Iterable[str], machine: Machine | None = None
) -> Mapping[str, Any]:
    """A table of the brief whose keys are known; one that is left out is empty."""
    given = values.get(name, {})
    if not isinstance(given, Mapping):
        raise DesignError(f"{name} = {shown(given)} is not a table; write [{name}] and one line a value below it")
    section: Mapping[str, Any] = by_field(machine, flat(given)) if machine and name in BY_FIELD else given
    refuse_unknown(f"[{name}]", section, known, homes_of(machine))
    return section


def heading_of(values: Mapping[str, Any]) -> dict[str, str]:
    """Texts at the head of the report: title, project and author, those that are stated."""
    section = table_of(values, "report", HEADING)
    for key, text in section.items():
        if not isinstance(text, str) or not text.strip():
            raise DesignError(f"report.{key} = {shown(text)} is no text; allowed: a text in quotes")
    return {key: section[key].strip() for key in HEADING if key in section}


def criteria_of(values: Mapping[str, Any], machine: Machine, source: str, lines: Mapping[str, int]) -> Criteria:
    """Bearing data and requirements, with the life in cycles; each knows its line of the ``source``."""
    known = {name: about for name, about in parameters_of(Criteria).items() if name != "hours"}  # a unit of the life
    section = table_of(values, "criteria", known, machine)
    read = {
        key: parse_quantity(f"criteria.{key}", given, known[key].unit)
        for key, given in section.items()
        if key != "life"
    }
    hours_a_day = _hours_a_day(values, machine)
    life = _life(section["life"], hours_a_day) if "life" in section else {}
    stated = {name: f"{source}:{lines[name]}" if name in lines else source for name in section}
    if "hours" in life:
        stated["hours"] = stated["life"]
    return Criteria(**read, **life, stated=stated).at(machine.cycle_period)


def _hours_a_day(values: Mapping[str, Any], machine: Machine) -> float:
    given = table_of(values, "duty", DUTY, machine).get("hours_a_day", "24 h")
    hours = parse_quantity("duty.hours_a_day", given, "h", {"h": 1.0, "min": 1.0 / 60.0})
    if not 0.0 < hours <= 24.0:
        raise DesignError(f"duty.hours_a_day = {shown(given)} is out of range; allowed: above 0 h, at most 24 h")
    return hours


def speeds_of(values: Mapping[str, Any], machine: Machine, stated: bool) -> dict[float, float]:
    """Share of the operating time at each speed of a load collective; empty for one speed."""
    given = table_of(values, "duty", DUTY, machine).get("speeds", {})
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


def wear_of(values: Mapping[str, Any], machine: Machine) -> Wear | None:
    """Data of Archard's law; None if wear is left out."""
    if "archard" not in values:
        return None
    known = parameters_of(Wear)
    section = table_of(values, "archard", known, machine)
    own = {"area": {"m^2": 1.0, "cm^2": 1e-4, "mm^2": 1e-6}}
    found = read_wear(
        {key: parse_quantity(f"archard.{key}", one, known[key].unit, own.get(key)) for key, one in section.items()}
    )
    worn_clearances(machine, found)  # refused before the machine is assessed, not after
    return found


OF_SECTION = {"at": "m", "link": "", "span": "m", "turn": "", "curvatures": "kg^-1/2 m^-2"}
"""Keys that state a section, and their units."""


def bending_of(values: Mapping[str, Any], machine: Machine, region: Mapping[str, Tolerance]) -> Bending | None:
    """A section of the flexible part; None if bending is left out."""
    if "bending" not in values:
        return None
    known = parameters_of(Bending)
    section = table_of(values, "bending", [*known, *OF_SECTION], machine)
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


def impacts_of(values: Mapping[str, Any], machine: Machine) -> tuple[float, ...]:
    """Clearances [m] at which the report says where impacts fall."""
    if "impacts" not in values:
        return ()
    name = machine.clearance_field
    given = table_of(values, "impacts", ("clearances",), machine).get("clearances")
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
    number("criteria.life", value, 0.0, unit="million cycles", inside=True, error=DesignError)
    return {"hours" if given.rpartition(" ")[2] in in_hours else "life": value}


def tolerances_of(values: Mapping[str, Any], machine: Machine) -> dict[str, Tolerance]:
    """Tolerance of each field; the usual ones where the brief states none."""
    if "tolerances" not in values:
        return default_tolerances(machine)
    fields = {name: about for name, about in parameters_of(machine).items() if not about.choices}
    tolerances = {}
    for key, given in table_of(values, "tolerances", fields, machine).items():
        relative = isinstance(given, str) and given.strip().endswith("%")
        value = parse_quantity(f"tolerances.{key}", given, "-" if relative else fields[key].unit)
        number(f"tolerances.{key}", value, 0.0, inside=True, error=DesignError)
        tolerances[key] = Tolerance(value, relative=relative)
    return tolerances


def changes_of(values: Mapping[str, Any], machine: Machine) -> dict[str, tuple[float, ...]]:
    """Values that may be tried, by field; the usual ones where the brief states none."""
    if "changes" not in values:
        return default_changes(machine)
    fields = {name: about for name, about in parameters_of(machine).items() if not about.choices}
    changes = {}
    for key, given in table_of(values, "changes", fields, machine).items():
        row = given if isinstance(given, list) else [given]
        changes[key] = tuple(parse_quantity(f"changes.{key}", one, fields[key].unit) for one in row)
        for value in changes[key]:
            with_settings(machine, {key: value})
    return changes


def costs_of(values: Mapping[str, Any], machine: Machine) -> dict[str, float]:
    """Cost weights by field."""
    changes = changes_of(values, machine)
    section = table_of(values, "costs", changes or parameters_of(machine), machine)
    read = {f"costs.{key}": parse_quantity(f"costs.{key}", given, "-") for key, given in section.items()}
    costs = {key.removeprefix("costs."): number(key, cost, 0.0, error=DesignError) for key, cost in read.items()}
    # an empty [changes] searches nothing: weights wait there for later
    return costs if changes else {}


def series_size_of(values: Mapping[str, Any]) -> int:
    """Machines that represent the region."""
    return whole("series", values.get("series", SERIES_SIZE), 8, 4096, error=DesignError)
