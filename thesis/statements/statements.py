"""Printed numbers: the table ``targets.csv``, read and checked."""

import csv
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from types import MappingProxyType

from chaosgym.errors import DatasetError

COLUMNS = (
    "id",
    "section",
    "figure_or_table",
    "system",
    "kind",
    "quantity",
    "value_low",
    "value_high",
    "unit",
    "conditions",
    "exact_or_approx",
    "note",
)

SYSTEMS = {"IBS": "impact-beam", "SSC": "slider-crank", "BOTH": None}
"""Machine by the prefix of a statement's name; None speaks of both."""

KINDS = ("geometry", "experiment", "simulation", "criterion", "formula")


@dataclass(frozen=True)
class Statement:
    """One quantitative statement of the thesis.

    Attributes
    ----------
    id
        Its name, such as "IBS-013".
    section, figure
        Where it stands; several are separated by semicolons.
    system
        "IBS" (Impact Beam System), "SSC" (Spatial Slider Crank) or "BOTH".
    kinds
        What it speaks of: some of ``KINDS``.
    quantity, conditions, note
        What is stated, under which conditions, and what is doubtful about it.
    low, high
        The number, or both ends of the range, in ``unit``; None where the statement is in words.
    exact
        False where the text says "about".
    """

    id: str
    section: str
    figure: str
    system: str
    kinds: tuple[str, ...]
    quantity: str
    low: float | None
    high: float | None
    unit: str
    conditions: str
    exact: bool
    note: str


@cache
def read_statements() -> Mapping[str, Statement]:
    """All statements of the thesis, by name, in the order of the table.

    Raises
    ------
    DatasetError
        If the table is damaged; names the line and the field.
    """
    return parse_statements((resources.files("thesis.statements") / "targets.csv").read_text(encoding="utf-8"))


def parse_statements(text: str) -> Mapping[str, Statement]:
    """Read a table of statements; see ``read_statements``."""
    reader = csv.DictReader(io.StringIO(text))
    if tuple(reader.fieldnames or ()) != COLUMNS:
        raise DatasetError(f"columns {reader.fieldnames} of the table of statements; allowed: {', '.join(COLUMNS)}")
    statements: dict[str, Statement] = {}
    for row in reader:
        where = f"line {reader.line_num} of the table of statements"
        if None in row or None in row.values():
            raise DatasetError(f"{where} has not {len(COLUMNS)} fields")
        statement = _statement(row, where)
        if statement.id in statements:
            raise DatasetError(f"{where}: id = {statement.id!r} is given twice")
        statements[statement.id] = statement
    return MappingProxyType(statements)


def _statement(row: Mapping[str, str], where: str) -> Statement:
    kinds = tuple(row["kind"].split(";"))
    if row["system"] not in SYSTEMS or not row["id"].startswith(f"{row['system']}-"):
        raise DatasetError(f"{where}: id = {row['id']!r} does not fit system = {row['system']!r}")
    for kind in kinds:
        if kind not in KINDS:
            raise DatasetError(f"{where}: kind = {kind!r} is not one of {', '.join(KINDS)}")
    if row["exact_or_approx"] not in ("exact", "approx", "-"):
        raise DatasetError(f"{where}: exact_or_approx = {row['exact_or_approx']!r} is not one of exact, approx, -")
    low, high = (_number(row[end], f"{where}: {end}") for end in ("value_low", "value_high"))
    if (low is None) != (high is None):
        raise DatasetError(f"{where}: value_low = {low} and value_high = {high}; allowed: both or none")
    return Statement(
        id=row["id"],
        section=row["section"],
        figure=row["figure_or_table"],
        system=row["system"],
        kinds=kinds,
        quantity=row["quantity"],
        low=low,
        high=high,
        unit=row["unit"],
        conditions=row["conditions"],
        exact=row["exact_or_approx"] == "exact",
        note=row["note"],
    )


def _number(text: str, what: str) -> float | None:
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise DatasetError(f"{what} = {text!r} is no finite number")
    return value
