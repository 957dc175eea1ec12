"""CSV files of one cycle, a force, lift or stiffness over the angle, read as if their samples were written out."""

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from chaosgym.errors import ParameterError
from chaosgym.files import contents, first_line
from chaosgym.machines.modal_machine.drive import KINDS
from chaosgym.machines.parameters import suggestion
from chaosgym.numbers import shown

LARGEST = 10_000_000
"""Bytes that such a file may have."""

TURN = {"deg": 360.0, "rad": 2.0 * math.pi, "cycle": 1.0}
"""One cycle in the units that a column of angles may have."""


def files_of(values: Mapping[str, Any]) -> list[str]:
    """Names of the CSV files that the drives, joints and springs of a machine's file name."""
    tables = (values.get(name, ()) for name in ("drive", "joint", "spring"))
    rows = [row for table in tables for row in (table if isinstance(table, list) else [table])]
    return [given for row in rows if isinstance(row, dict) for kind, given in row.items() if _is_file(kind, given)]


def with_samples(table: str, row: Any, folder: Path) -> Any:
    """A row of a table, such as "drive", with the samples of a CSV file in place of its name.

    Raises
    ------
    ParameterError
        If the file can't be read, has no such column, no unit, or no cycle at equal steps; names the file.
    """
    if not isinstance(row, dict):
        return row
    found = {kind: _column(folder / given, row.get("column")) for kind, given in row.items() if _is_file(kind, given)}
    if "column" in row and not found:
        raise ParameterError(f"{table}.column has no meaning without a CSV file; leave it out")
    return {name: found.get(name, given) for name, given in row.items() if name != "column"}


def _is_file(kind: str, given: Any) -> bool:
    return kind in (*KINDS, "stiffness") and isinstance(given, str) and given.lower().endswith(".csv")


def _column(path: Path, wanted: Any) -> list[str]:
    try:
        rows = [row for row in csv.reader(contents(path, LARGEST).decode("utf-8-sig").splitlines()) if row]
        heads = [head.strip().partition("[") for head in rows[0]] if rows else []
        if not heads or not all(rest.endswith("]") for _, _, rest in heads):
            raise ValueError("does not begin with names of columns and their units, as in: angle [deg],lift [mm]")
        names, units = [name.strip() for name, _, _ in heads], [rest[:-1].strip() for _, _, rest in heads]
        numbers = [[float(cell) for cell in row] for row in rows[1:]]
        if not numbers or any(len(row) != len(names) for row in numbers):
            raise ValueError(f"has rows of other lengths than its {len(names)} columns, or none")
    except (ValueError, csv.Error) as error:
        raise ParameterError(f"{path} {first_line(error)}") from None
    angles = [place for place, unit in enumerate(units) if unit in TURN]
    columns = [place for place in range(len(names)) if place not in angles]
    if wanted is not None:
        columns = [place for place in columns if names[place] == wanted]
    if len(columns) != 1:
        known = [name for place, name in enumerate(names) if place not in angles]
        what = f"has no column {shown(wanted)}" if wanted is not None else "has several columns; say column = "
        raise ParameterError(f"{path} {what}{suggestion(str(wanted), known)}")
    values = [row[columns[0]] for row in numbers]
    for place in angles[:1]:
        values = _one_cycle(path, [row[place] for row in numbers], values, TURN[units[place]])
    return [f"{value!r} {units[columns[0]]}" for value in values]


def _one_cycle(path: Path, angles: list[float], values: list[float], turn: float) -> list[float]:
    """Values without the one that closes the cycle, if they are at equal steps over it."""
    closed = abs(angles[-1] - angles[0] - turn) < 1e-6 * turn
    if closed and abs(values[-1] - values[0]) > 1e-6 * max(map(abs, values)):
        raise ParameterError(f"{path} ends at {values[-1]:g} and begins at {values[0]:g}; allowed: a cycle that closes")
    count = len(values) - closed
    steps = [angle - turn * place / count for place, angle in enumerate(angles[:count])]
    if count < 3 or max(map(abs, steps)) > 1e-4 * turn / count + 1e-9 * turn:
        raise ParameterError(f"{path} is no cycle at equal steps from 0 to {turn:g}; allowed: 3 rows or more")
    return values[:count]
