"""Machine parameters: numbers with a unit, an allowed range and a provenance.

A machine is a frozen dataclass whose fields are made by ``parameter``. Default, unit, range and source of a number
live there and nowhere else; validation, the command line and the documentation read them. A rung of the fidelity
ladder is a short name for some fields that are set together and that decide accuracy alone.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache
from types import MappingProxyType
from typing import Any, Literal, TypeVar

import numpy as np

from chaosgym.errors import ParameterError, nearest_or
from chaosgym.machines.accuracy import is_tolerance, model_within, tolerance_of
from chaosgym.numbers import number, whole

Provenance = Literal["printed", "derived", "calibrated", "assumed", "stated"]
"""printed: in the thesis; derived: follows from printed numbers; calibrated: fitted to printed results; assumed;
stated: in the machine's own file."""

LONG = 1e10
"""Numbers from here on are shown by powers of ten: stiffnesses stay below, moduli lie above."""

M = TypeVar("M")


@dataclass(frozen=True)
class Parameter:
    """Unit, allowed range (both ends included) or choices, and provenance of one machine parameter."""

    unit: str
    low: float
    high: float
    choices: tuple[str, ...]
    provenance: Provenance
    source: str


def parameter(
    default: Any,
    *,
    unit: str = "-",
    low: float = -math.inf,
    high: float = math.inf,
    choices: tuple[str, ...] = (),
    provenance: Provenance,
    source: str,
) -> Any:
    """Make a dataclass field that carries its unit, range and provenance."""
    described = Parameter(unit, low, high, choices, provenance, source)
    return field(default=default, metadata={"parameter": described})


def described_as(known: Parameter, default: Any, **changes: Any) -> Any:
    """Make a field that is described as another one, but for some ``changes``."""
    return field(default=default, metadata={"parameter": replace(known, **changes)})


def assumed(default: Any, unit: str, low: float, high: float) -> Any:
    """Make a field of a machine of one's own, of which its file may say otherwise."""
    return parameter(default, unit=unit, low=low, high=high, provenance="assumed", source="default")


def parameters_of(machine: Any) -> Mapping[str, Parameter]:
    """Describe every parameter of a machine or machine class, by field name."""
    return _parameters_of(_class_of(machine))


def _class_of(machine: Any) -> type:
    return machine if isinstance(machine, type) else type(machine)


@cache
def _parameters_of(machine: type) -> Mapping[str, Parameter]:
    described = {f.name: f.metadata.get("parameter") for f in fields(machine)}
    return MappingProxyType({name: about for name, about in described.items() if about is not None})


def check_parameter(owner: Any, name: str, value: Any) -> Any:
    """Return the value in its field's own type.

    Raises
    ------
    ParameterError
        If it is not a finite number in the allowed range, or not one of the choices. Names field, value and range.
    """
    described = parameters_of(owner)[name]
    if described.choices:
        if value not in described.choices:
            raise ParameterError(f"{name} = {value!r} is not one of {', '.join(described.choices)}")
        return value
    if isinstance(getattr(_class_of(owner), name), int):
        return whole(name, value, int(described.low), int(described.high))
    return number(name, value, described.low, described.high, described.unit.strip("-"))


def validate(machine: Any) -> None:
    """Check every field of a machine that is being constructed, and store it in its own type."""
    for name in parameters_of(machine):
        object.__setattr__(machine, name, check_parameter(machine, name, getattr(machine, name)))


USUAL = ("speed", "clearance")
"""Fields that each machine has, whatever it calls them."""


def field_named(owner: Any, name: str) -> str:
    """Name of a field that may be written as of a joint, or as a machine's "speed" or "clearance"; else as it is.

    A joint's field is written ``left.clearance``, or ``joint.clearance`` of the only one.

    Examples
    --------
    >>> from chaosgym.machines.parameters import field_named
    >>> field_named(chaosgym.ImpactBeam(), "speed")
    'excitation_frequency'
    """
    plain = getattr(owner, "aliases", {}).get(name, name.replace(".", "_"))
    usual = getattr(owner, f"{name}_field", name) if name in USUAL else name
    return next((field for field in (plain, usual) if field in parameters_of(owner)), name)


def by_field(owner: Any, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is given by ``field_named`` names, by the fields' own.

    Raises
    ------
    ParameterError
        If a field is given by two names.
    """
    found = {field_named(owner, name): value for name, value in given.items()}
    if len(found) < len(given):
        names = [name for name in given if field_named(owner, name) != name]
        raise ParameterError(f"{', '.join(names)}: given twice; allowed: one of the names of a field")
    return found


def refuse_not_finite(what: str, *arrays: Any) -> None:
    """Refuse arrays of a model that hold anything but finite numbers: a kernel would not come back from them.

    Raises
    ------
    ParameterError
        If one does; names ``what`` they are.
    """
    if not all(np.all(np.isfinite(array)) for array in arrays):
        raise ParameterError(
            f"{what} holds values that are not finite numbers; allowed: parameters that give finite ones"
        )


def suggestion(name: str, known: Iterable[str]) -> str:
    """End of a message about an unknown name: the nearest known one, or all of them."""
    names = list(known)
    return "; " + nearest_or(f"known: {', '.join(names)}", name, names)


def name_of(machine: Any) -> str:
    """Name by which a person knows a machine: that of its file, or of its kind."""
    return getattr(machine, "name", "") or type(machine).__name__


def with_settings(machine: M, settings: Mapping[str, Any]) -> M:
    """Return the machine with some fields replaced, or with those of a rung of ``fidelity``.

    A ``fidelity`` such as "1 %" takes the cheapest model whose estimated error is within it; see ``model_within``.

    Raises
    ------
    ParameterError
        If a name is no field of the machine (the nearest one is suggested), a value is not allowed, or ``fidelity`` is
        given together with a field that it sets.
    """
    known = parameters_of(machine)
    tolerance = settings.get("fidelity") if is_tolerance(settings.get("fidelity")) else None
    settings = by_field(machine, expand_fidelity(machine, settings))
    for name in settings:
        if name not in known:
            raise ParameterError(f"{name_of(machine)} has no field {name!r}{suggestion(name, known)}")
    made = replace(machine, **settings)  # type: ignore[type-var]
    if "initial_state" in vars(machine):
        object.__setattr__(made, "initial_state", vars(machine)["initial_state"])
    return made if tolerance is None else model_within(made, tolerance).machine


def changes_of(machine: Any) -> dict[str, Any]:
    """Fields in which a machine differs from the default of its kind."""
    default = type(machine)()
    values = {name: getattr(machine, name) for name in parameters_of(machine)}
    return {name: value for name, value in values.items() if value != getattr(default, name)}


def origin_of(machine: Any, name: str) -> tuple[str, str]:
    """Provenance and source of a field's value: those of the default, or "given"."""
    value, about = getattr(machine, name), parameters_of(machine)[name]
    if value == getattr(type(machine)(), name):
        return about.provenance, about.source
    return "given", "this command"


def digits(value: float) -> str:
    """Six digits of a number, for people: with a power of ten only above ten thousand millions and below 0.0001.

    Examples
    --------
    >>> digits(1e6), digits(1.5e7), digits(2e-4), digits(2e11)
    ('1,000,000', '15,000,000', '0.0002', '2e+11')
    """
    text = f"{value:,.6g}"
    return f"{float(text):,.0f}" if "e+" in text and abs(value) < LONG else text


def quantity_of(owner: Any, name: str) -> str:
    """Value of a field with its unit, for people: millimetres and gigapascals where these are usual."""
    value, unit = getattr(owner, name), parameters_of(owner)[name].unit
    if isinstance(value, str):
        return value
    if unit == "m":
        value, unit = 1e3 * value, "mm"
    elif unit == "Pa" and abs(value) >= 1e6:
        value, unit = 1e-9 * value, "GPa"
    elif unit == "Mcycles":
        unit = "million cycles"
    return digits(value) + ("" if unit == "-" else f" {unit}")


def is_half_play(machine: Any, name: str) -> bool:
    """Whether a field is half of the play in a joint: a clearance of one with two stops.

    Examples
    --------
    >>> from chaosgym.machines.parameters import is_half_play
    >>> is_half_play(chaosgym.ImpactBeam(), "clearance"), is_half_play(chaosgym.ImpactBeam(), "length")
    (True, False)
    """
    stops = getattr(machine, f"{name.removesuffix('clearance')}stops", "two")
    return name.endswith("clearance") and stops == "two"


def markdown_table(machine: Any) -> list[str]:
    """Lines of a table with every parameter of a machine, its value, unit, provenance and source."""
    rows = ["| parameter | value | unit | provenance | source |", "|---|---|---|---|---|"]
    for name, about in parameters_of(machine).items():
        value = getattr(machine, name)
        shown = value if isinstance(value, str) else digits(value)
        unit = "" if about.unit == "-" else about.unit
        rows.append(f"| `{name}` | {shown} | {unit} | {' | '.join(origin_of(machine, name))} |")
    return rows


def expand_fidelity(machine: Any, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings with ``fidelity`` replaced by the fields that it sets.

    What a tolerance sets is known only once the machine is made; here it is checked.

    Raises
    ------
    ParameterError
        If the rung is unknown, or if a field that it sets is given too; names both.
    """
    others = {name: value for name, value in settings.items() if name != "fidelity"}
    rung = settings.get("fidelity")
    if rung is None:
        return others
    if is_tolerance(rung):
        tolerance_of(rung)
        for name in getattr(machine, "model_fields", ()):
            if name in others:
                raise ParameterError(
                    f"fidelity = {rung!r} chooses {name}, and {name} = {others[name]!r} is given too; "
                    "allowed: one of the two"
                )
        return others
    ladder = getattr(machine, "fidelity_ladder", {})
    if not isinstance(rung, str) or rung not in ladder:
        raise ParameterError(f"fidelity = {rung!r} is not one of {', '.join(ladder)}, nor a tolerance such as '1 %'")
    for name, value in ladder[rung].items():
        if name in others:
            raise ParameterError(
                f"fidelity = {rung!r} sets {name} = {value!r}, and {name} = {others[name]!r} is given too; "
                "allowed: one of the two"
            )
    return {**others, **ladder[rung]}
