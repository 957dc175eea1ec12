"""How do measured peak forces come in? As CSV, one run a column and one line a cycle; shorter runs end in blanks."""

from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from chaosgym.errors import DiagnosisError

Array = NDArray[np.float64]


def read_peaks(source: Path | TextIO) -> dict[str, Array]:
    """Read runs by name from a CSV file or an open stream; a first line that is not numeric names the columns.

    Raises
    ------
    DiagnosisError
        If it can't be read, holds no numbers, or an entry that is neither a finite number nor a blank at the end.
    """
    name = str(source) if isinstance(source, Path) else "standard input"
    try:
        text = source.read_text() if isinstance(source, Path) else source.read()
    except (OSError, UnicodeDecodeError) as error:
        raise DiagnosisError(f"{name} can't be read: {error}") from error
    lines = [line for line in text.splitlines() if line.strip(" ,;\t")]
    if not lines:
        raise DiagnosisError(f"{name} holds no numbers")
    rows = [[part.strip() for part in line.split(",")] for line in lines]
    header = [] if all(_is_number(part) for part in rows[0] if part) else rows.pop(0)
    if not rows:
        raise DiagnosisError(f"{name} holds no numbers")
    width = max(len(row) for row in rows)
    if header and len(header) != width:
        raise DiagnosisError(f"{name} names {len(header)} columns and has {width}")
    names = header or [f"run {column + 1}" for column in range(width)]
    if len(set(names)) != width:
        raise DiagnosisError(f"{name} names two columns alike: {', '.join(names)}")
    first = 2 if header else 1
    return {title: _column(rows, column, f"{name}, line", first) for column, title in enumerate(names)}


def parse_peak(line: str, number: int, *, first: bool) -> float | None:
    """Peak force of one line; None for a blank line, or a heading before the first peak.

    Raises
    ------
    DiagnosisError
        If the line is no finite number.
    """
    text = line.strip().rstrip(",")
    if not text or (first and not _is_number(text)):
        return None
    if not _is_number(text) or not np.isfinite(float(text)):
        raise DiagnosisError(f"standard input, line {number}: {text[:40]!r} is not a finite number")
    if float(text) < 0.0:
        raise DiagnosisError(f"standard input, line {number}: {text[:40]} is a negative force; allowed: 0 N and more")
    return float(text)


def _column(rows: list[list[str]], column: int, where: str, first: int) -> Array:
    """Numbers of a column down to its last entry."""
    entries = [row[column] if column < len(row) else "" for row in rows]
    while entries and not entries[-1]:
        entries.pop()
    for line, entry in enumerate(entries, start=first):
        if not _is_number(entry) or not np.isfinite(float(entry)):
            shown = "a blank between two numbers" if not entry else repr(entry[:40])
            raise DiagnosisError(f"{where} {line}: {shown} is not a finite number")
    return np.array([float(entry) for entry in entries])


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
