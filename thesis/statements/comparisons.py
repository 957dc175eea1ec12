"""Comparisons of the simulated quantities: the table ``comparisons.toml``, read and checked.

Every statement about a simulation is either compared or left out with a reason; none is forgotten.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from chaosgym.errors import DatasetError
from thesis.statements.statements import SYSTEMS, Statement, read_statements

Printed = float | str | tuple[float, float]
"""A number, a word, or both ends of a range."""


class Tolerance(NamedTuple):
    """How far a value may be off for a hit; twice as far is near.

    The larger of ``relative`` times the printed value and ``absolute``; or ``steps`` of the axis; or a ``factor``. With
    none of them the value must be equal.
    """

    name: str
    reason: str
    relative: float = 0.0
    absolute: float = 0.0
    steps: float = 0.0
    factor: float = 0.0


class Axis(NamedTuple):
    """Values of one field, both ends included; ``unit`` turns them into the printed unit."""

    field: str
    low: float
    high: float
    step: float
    unit: float = 1.0

    @property
    def values(self) -> tuple[float, ...]:
        """Values of the field, in SI or the field's own unit."""
        count = round((self.high - self.low) / self.step) + 1
        return tuple(round(float(value), 12) for value in np.linspace(self.low, self.high, count))


@dataclass(frozen=True)
class Comparison:
    """What is computed for one statement, under which conditions, and how far it may be off.

    Attributes
    ----------
    statement
        What the thesis prints.
    machine
        Name of the machine.
    group
        Kind of statement, for the totals.
    quantity
        Name of what is computed.
    printed
        The number, word or range to compare with.
    tolerance
        How far it may be off.
    at
        Operating conditions: fields of the machine, one mapping for each run or curve. A value may be the name of a
        condition that is not in print, ``{"unprinted": name}``.
    along, across
        Axes of a curve or map; None for single runs.
    contradictory
        What the text itself says against it; empty if nothing.
    reading
        Where it can be read in several ways: the words of the thesis, and what was decided; empty elsewhere.
    not_computed
        Why it can't be computed here; empty if it is.
    unit
        Unit of the printed value; the statement's own unless the quantity is another one.
    """

    statement: Statement
    machine: str
    group: str
    quantity: str
    printed: Printed
    tolerance: Tolerance
    at: tuple[Mapping[str, Any], ...]
    along: Axis | None
    across: Axis | None
    contradictory: str
    not_computed: str
    unit: str
    reading: str

    @property
    def id(self) -> str:
        """Name of the statement."""
        return self.statement.id

    @property
    def shown_unit(self) -> str:
        """Unit of printed and computed value; "-" for words and pure numbers."""
        return "-" if isinstance(self.printed, str) else self.unit


class Condition(NamedTuple):
    """An operating condition that is not in print but the same for several statements: its value, and why it."""

    value: float
    reason: str


class Comparisons(NamedTuple):
    """Statements that are compared; why the others about simulations are not, {id: reason}; what is not in print."""

    compared: tuple[Comparison, ...]
    out: Mapping[str, str]
    unprinted: Mapping[str, Condition]


@cache
def read_comparisons() -> Comparisons:
    """Every comparison, in the order of the table.

    Raises
    ------
    DatasetError
        If an entry is damaged, or a simulated statement is neither compared nor left out; names it.
    """
    text = (resources.files("thesis.statements") / "comparisons.toml").read_text(encoding="utf-8")
    return parse_comparisons(text, read_statements())


@cache
def read_measured() -> Comparisons:
    """Comparisons with what the thesis measured, which no search is shown; raises as ``read_comparisons`` does."""
    text = (resources.files("thesis.statements") / "measured.toml").read_text(encoding="utf-8")
    measured = {name: one for name, one in read_statements().items() if set(one.kinds) == {"experiment"}}
    return parse_comparisons(text, measured)


def parse_comparisons(text: str, statements: Mapping[str, Statement]) -> Comparisons:
    """Read a table of comparisons; see ``read_comparisons``."""
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise DatasetError(f"the table of comparisons is damaged: {error}") from error
    tolerances = {name: _tolerance(name, entry) for name, entry in table.pop("tolerances", {}).items()}
    out: dict[str, str] = table.pop("out", {})
    unprinted = {name: Condition(**entry) for name, entry in table.pop("unprinted", {}).items()}
    for name in (*table, *out):
        if name not in statements:
            raise DatasetError(f"{name} is no statement of the thesis")
    compared = tuple(_comparison(statements[name], entry, tolerances) for name, entry in table.items())
    for statement in statements.values():
        simulated = not {"simulation", "criterion"}.isdisjoint(statement.kinds)
        if simulated and (statement.id in table) == (statement.id in out):
            raise DatasetError(f"{statement.id} must be either compared or left out with a reason")
    for one in compared:
        for name in _names(one.at):
            if name not in unprinted:
                raise DatasetError(f"{one.id}: unprinted = {name!r} is not one of {', '.join(unprinted)}")
    return Comparisons(compared, MappingProxyType(out), MappingProxyType(unprinted))


def _names(at: tuple[Mapping[str, Any], ...]) -> list[str]:
    return [value["unprinted"] for one in at for value in one.values() if isinstance(value, Mapping)]


def conditions(at: Mapping[str, Any], unprinted: Mapping[str, float]) -> dict[str, Any]:
    """Operating conditions with the names of those that are not in print replaced by values."""
    return {name: unprinted[v["unprinted"]] if isinstance(v, Mapping) else v for name, v in at.items()}


def _tolerance(name: str, entry: Mapping[str, Any]) -> Tolerance:
    unknown = set(entry) - set(Tolerance._fields)
    if unknown or not entry.get("reason"):
        raise DatasetError(f"tolerance {name}: needs a reason; unknown fields: {', '.join(sorted(unknown)) or 'none'}")
    return Tolerance(name=name, **entry)


_REQUIRED = frozenset({"group", "quantity", "tolerance", "at"})
_OPTIONAL = frozenset({"printed", "along", "across", "contradictory", "not_computed", "unit", "reading"})


def _comparison(statement: Statement, entry: Mapping[str, Any], tolerances: Mapping[str, Tolerance]) -> Comparison:
    missing, unknown = _REQUIRED - set(entry), set(entry) - _REQUIRED - _OPTIONAL
    if missing or unknown:
        raise DatasetError(f"{statement.id}: missing {sorted(missing)}, unknown {sorted(unknown)}")
    machine = SYSTEMS[statement.system]
    if machine is None:
        raise DatasetError(f"{statement.id} speaks of both machines and can't be compared")
    if entry["tolerance"] not in tolerances:
        raise DatasetError(f"{statement.id}: tolerance = {entry['tolerance']!r} is not one of {', '.join(tolerances)}")
    return Comparison(
        statement=statement,
        machine=machine,
        group=entry["group"],
        quantity=entry["quantity"],
        printed=_printed(statement, entry),
        tolerance=tolerances[entry["tolerance"]],
        at=tuple(entry["at"]),
        along=_axis(entry.get("along")),
        across=_axis(entry.get("across")),
        contradictory=entry.get("contradictory", ""),
        not_computed=entry.get("not_computed", ""),
        unit=entry.get("unit", statement.unit),
        reading=entry.get("reading", ""),
    )


def _printed(statement: Statement, entry: Mapping[str, Any]) -> Printed:
    if "printed" in entry:
        value: float | str = entry["printed"]
        return value
    if statement.low is None or statement.high is None:
        raise DatasetError(f"{statement.id} prints no number: give `printed`")
    return statement.low if statement.low == statement.high else (statement.low, statement.high)


def _axis(entry: Mapping[str, Any] | None) -> Axis | None:
    return None if entry is None else Axis(**entry)
