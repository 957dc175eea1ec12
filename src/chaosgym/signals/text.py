"""Columns of a text: CSV with any common delimiter, decimal comma, encoding, comments and headings."""

import io
import re
from collections import Counter
from itertools import pairwise
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
from numpy.typing import NDArray

from chaosgym.errors import DiagnosisError

Array = NDArray[np.float64]

DELIMITERS = {"\t": "tabs", ";": "semicolons", "|": "bars", ",": "commas", " ": "blanks"}
"""Delimiters in the order in which they are tried."""

HEADING = 500
"""Lines among which a heading ends."""

COMMENT = re.compile(r"\s*(#|%|//|\")")
QUOTED = re.compile(r'\s*"[^"]*"\s*($|[,;\t|])')
"""A line whose first entry is in quotes."""

TORN = re.compile(r'\s*"\s*[+-]?[\d.,]')
"""A line that begins with a quote and a number."""

NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?|[+-]?(nan|inf(inity)?)", re.IGNORECASE)


def read_text(data: bytes) -> dict[str, Any]:
    """Columns, units, problems, lines and form of a text, as ``Recording`` names them."""
    text = _decoded(data)
    if "\0" in text:
        raise DiagnosisError("is neither text nor a format that is known (CSV, Parquet, .npy, .mat, WAV, UFF)")
    kept = [
        (number, line.rstrip("\r"))
        for number, line in enumerate(text.split("\n"), start=1)
        if line.strip(" ,;|\t\r") and not (COMMENT.match(line) and not QUOTED.match(line) and not TORN.match(line))
    ]
    if not kept:
        raise DiagnosisError("holds no numbers")
    delimiter = _delimiter([line for _, line in kept])
    if delimiter == " ":
        kept = [(number, "\t".join(line.split())) for number, line in kept]
    mark = "\t" if delimiter == " " else delimiter
    rows = [[word.strip(' "') for word in line.split(mark)] for _, line in kept[:HEADING]]
    width = Counter(line.count(mark) + 1 for _, line in kept[-200:]).most_common(1)[0][0]
    start = next((i for i, row in enumerate(rows) if any(map(_is_number, row)) and len(row) == width), None)
    if start is None:
        raise DiagnosisError("holds no numbers")
    names, units = _titles([row for row in rows[:start] if len(row) == width], width)
    titles = names or [f"column {place + 1}" for place in range(width)]
    if len(set(titles)) != len(titles):
        raise DiagnosisError(f"names two columns alike: {', '.join(titles)}")
    body = kept[start:]
    lines = tuple(number for number, _ in body)
    torn = [number for number, line in body if line.count('"') % 2]
    table = _table([(number, line.replace('"', "")) for number, line in body] if torn else body, titles, mark)
    comma = delimiter != "," and any(
        "," in (value or "") for column in table.columns for value in column[:50].to_pylist()
    )
    columns, problems = {}, {}
    for title, column in zip(titles, table.columns, strict=True):
        columns[title], problem = _numbers(column, comma, lines)
        if torn:
            problem = f"line {torn[0]}: a quote is not closed, as in {len(torn)} of {len(lines)} lines"
        if problem:
            problems[title] = problem
    columns = {title: values for title, values in columns.items() if values is not None}
    form = "CSV" if width == 1 else f"CSV, {DELIMITERS[delimiter]}"
    return {
        "columns": columns,
        "units": {title: unit for title, unit in units.items() if unit},
        "problems": problems,
        "lines": lines,
        "form": form + (", decimal comma" if comma else ""),
        "named": bool(names),
    }


def _decoded(data: bytes) -> str:
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    if data[1:40:2].count(0) > 10 and data[0] != 0:
        return data.decode("utf-16-le", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")


def _delimiter(lines: list[str]) -> str:
    """Delimiter of the lines; "," stands for none if there is one column."""
    tail = lines[-200:]
    for delimiter in ("\t", ";", "|"):
        if sum(delimiter in line for line in tail) > 0.5 * len(tail):
            return delimiter
    words = [line.split() for line in tail]
    spaced = sum(len(row) > 1 and all(map(_is_number, row)) for row in words) > 0.5 * len(tail)
    if spaced and not any(word.endswith(",") for row in words for word in row):
        return " "
    single = [row for row in (line.strip().split(",") for line in tail) if _is_number(row[0])]
    decimal = all(
        len(row) == 2 and re.fullmatch(r"[+-]?\d+", row[0]) and re.fullmatch(r"\d+", row[1]) for row in single
    )
    if single and decimal and not _two_columns(lines[0], single):
        return ";"
    return ","


def _two_columns(heading: str, rows: list[list[str]]) -> bool:
    """Whether ``48,9`` is two whole numbers: the heading says so, or the first one counts."""
    if not _is_number(heading.split(",")[0]):
        return "," in heading
    steps = {int(after[0]) - int(before[0]) for before, after in pairwise(rows)}
    return steps == {1} or len(rows) < 2


def _is_number(text: str) -> bool:
    return NUMBER.fullmatch(text.strip()) is not None


def _titles(fitting: list[list[str]], width: int) -> tuple[list[str], dict[str, str]]:
    """(names of the columns, unit by name); no names if the file has no heading."""
    if not fitting:
        return [], {}
    written = fitting[-1]
    below: list[str] = [""] * width
    if len(fitting) > 1 and all(not word or word.strip("[]()") in UNITS for word in written):
        below, written = [word.strip("[]()") for word in written], fitting[-2]
    split = [split_unit(word or f"column {place + 1}") for place, word in enumerate(written)]
    names = [name for name, _ in split]
    if len(set(names)) != len(names):
        names = [word or f"column {place + 1}" for place, word in enumerate(written)]
    return names, {name: unit or lower for (_, unit), name, lower in zip(split, names, below, strict=True)}


_WRITTEN = """
N kN mN MN lbf kgf s ms us µs μs min h rpm 1/min min-1 Hz kHz 1/s V mV g m/s² m/s2 m/s^2 m mm um µm deg ° rad °C K A % -
"""
UNITS = frozenset(_WRITTEN.split())
"""Units that a heading may name."""


def split_unit(title: str) -> tuple[str, str]:
    """Name and unit of a heading: ``Kraft [N]``, ``F (kN)``, ``force / N``, ``peak_N``, ``force in N``."""
    text = title.strip()
    for pattern in (r"(.*?)[\s_]*[\[(]\s*([^\])]*?)\s*[\])]", r"(.+?)\s*/\s*(\S+)", r"(.+?)(?:_|\s+in\s+|\s+)(\S+)"):
        found = re.fullmatch(pattern, text)
        if found and (found[2] in UNITS or ("[" in pattern[:14] and "[" in text)):
            return found[1].strip() or text, found[2]
    return (text, "")


def _table(body: list[tuple[int, str]], titles: list[str], mark: str) -> Any:
    """Columns of text; runs that end early are filled up with blanks."""
    width = len(titles)
    padded = []
    for number, line in body:
        columns = line.count(mark) + 1
        if columns > width and '"' not in line and line.rstrip(mark + " ").count(mark) >= width:
            raise DiagnosisError(f"line {number} has {columns} columns; allowed: {width}")
        short = line if columns <= width or '"' in line else line.rstrip(" ")[: -(columns - width)]
        padded.append(short + mark * max(0, width - columns))
    return pyarrow.csv.read_csv(
        io.BytesIO("\n".join(padded).encode()),
        read_options=pyarrow.csv.ReadOptions(column_names=titles),
        parse_options=pyarrow.csv.ParseOptions(delimiter=mark, ignore_empty_lines=False),
        convert_options=pyarrow.csv.ConvertOptions(
            column_types=dict.fromkeys(titles, pa.string()), strings_can_be_null=False
        ),
    )


def _numbers(column: Any, comma: bool, lines: tuple[int, ...]) -> tuple[Array | None, str]:
    """(readings down to the last entry, what is wrong with them); no readings if the column is text."""
    column = pc.utf8_trim_whitespace(column.combine_chunks())
    filled = pc.not_equal(column, "").to_numpy(zero_copy_only=False)
    size = int(np.max(np.flatnonzero(filled), initial=-1)) + 1
    text = column[:size]
    if comma:
        text = pc.replace_substring(text, ",", ".")
    good = pc.match_substring_regex(text, r"(?i)^([+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?|[+-]?(nan|inf(inity)?))$")
    good = good.to_numpy(zero_copy_only=False)
    if size and good.mean() < 0.5 and not good[0]:
        return None, ""
    bad = np.flatnonzero(~good)
    values = np.full(size, np.nan)
    values[good] = text.filter(pa.array(good)).cast(pa.float64()).to_numpy(zero_copy_only=False)
    if len(bad):
        entry = str(text[int(bad[0])])
        shown = repr(entry[:40]) if entry else "a blank between two numbers"
        return values, f"line {lines[bad[0]]}: {shown} is not a finite number"
    return values, ""
