"""What a file or a call states of a kind of machine: its class, ranges and tolerances."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, get_type_hints

from chaosgym.errors import ParameterError
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import by_field, check_parameter, parameters_of, suggestion
from chaosgym.units import parse_quantity, parse_row


def class_with(base: type[Machine], defaults: Mapping[str, Any], attributes: Mapping[str, Any]) -> Any:
    """Subclass of a class of machines with further fields or other defaults, and with other class attributes.

    Raises
    ------
    ParameterError
        If the machine of all defaults is not allowed.
    """
    hints = get_type_hints(base)
    annotations = {name: hints.get(name, Any) for name in defaults}
    annotations |= {name: ClassVar[Any] for name in attributes if not name.startswith("__")}
    body = {"__module__": __name__, "__annotations__": annotations, **defaults, **attributes}
    made: Any = dataclass(frozen=True, kw_only=True)(type(base.__name__, (base,), body))
    made()
    return made


def refuse_names(what: str, names: Iterable[str], example: str) -> None:
    """Refuse names that can't begin that of a field."""
    for name in names:
        if not name.isidentifier() or name.startswith("_"):
            raise ParameterError(f"{what} {name!r} is out of range; allowed: letters, digits and _, as in {example}")


def range_of(kind: Any, what: str, field: str, values: Any) -> tuple[float, float]:
    """Lowest and highest value of a field of a class of machines.

    Raises
    ------
    ParameterError
        If it is no range; ``what`` names it.
    """
    if len(values) != 2 or not values[0] < values[1]:
        raise ParameterError(f"{what} is no range; allowed: a text such as '4 to 30 Hz', the lower one first")
    low, high = (check_parameter(kind, field, end) for end in values)
    return low, high


def tolerances_of(given: Mapping[str, Any], machine: Machine) -> dict[str, tuple[float, bool]]:
    """Half widths by field, and whether they are shares of the value.

    Raises
    ------
    ParameterError
        If there is no such field, or the width is none or leads out of the field's range.
    """
    known = {name: about for name, about in parameters_of(machine).items() if not about.choices}
    found = {}
    for name, text in by_field(machine, flat(given)).items():
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


def flat(given: Mapping[str, Any]) -> dict[str, Any]:
    """Entries of a table with those of tables in it, such as left.clearance, by their dotted keys."""
    found: dict[str, Any] = {}
    for key, value in given.items():
        inner = flat(value) if isinstance(value, dict) else {"": value}
        found |= {f"{key}.{name}" if name else key: each for name, each in inner.items()}
    return found


def state_of(operation: Mapping[str, Any], machine: Machine) -> tuple[float, ...]:
    """Initial state that the table [operation] of a file states; empty for rest.

    Raises
    ------
    ParameterError
        If it has another length than the machine's states.
    """
    if "initial_state" not in operation:
        return ()
    return machine.from_state(parse_row("operation.initial_state", operation["initial_state"], "-")).initial_state
