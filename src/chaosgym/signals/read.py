"""What is in a recorder's file? Columns of numbers with names and units, whatever wrote them.

CSV with any common delimiter, decimal comma, UTF-8 or UTF-16, comments and a line of units; Parquet, NumPy ``.npy``,
MATLAB ``.mat``, WAV, and universal files (UFF 58, extra ``[uff]``). Formats are told by their first bytes.
"""

import hashlib
import io
import re
import sys
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
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

COMMENT = re.compile(r"\s*(#|%|//|\")")
NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?|[+-]?(nan|inf(inity)?)", re.IGNORECASE)


@dataclass(frozen=True)
class Recording:
    """Columns of a file.

    Attributes
    ----------
    source
        File name, or "standard input".
    columns
        Readings by name, each (n,) without blanks at its end.
    units
        Unit of a column, where the file names it.
    problems
        Why a column can't be used: its first entry that is no finite number, with its line.
    lines
        Line of each reading; empty for binary files.
    rate_hz
        Sampling rate, where the file holds it.
    sha256
        Of the bytes.
    form
        What it is, for people: "CSV, semicolons, decimal comma".
    named
        Whether the file names its columns.
    """

    source: str
    columns: Mapping[str, Array]
    form: str
    sha256: str
    units: Mapping[str, str] = field(default_factory=dict)
    problems: Mapping[str, str] = field(default_factory=dict)
    lines: tuple[int, ...] = ()
    rate_hz: float | None = None
    named: bool = True

    def where(self, index: int) -> str:
        """Place of a reading, for people."""
        return f"line {self.lines[index]}" if index < len(self.lines) else f"reading {index + 1}"


def read_recording(source: str | Path) -> Recording:
    """Read a file; "-" is standard input.

    Raises
    ------
    DiagnosisError
        If it can't be read, or holds no numbers.
    """
    name = "standard input" if str(source) == "-" else str(source)
    try:
        data = _standard_input() if str(source) == "-" else Path(source).read_bytes()
    except OSError as error:
        raise DiagnosisError(f"{name} can't be read: {error.strerror}") from error
    reader, form = _reader(data)
    try:
        found = reader(data)
    except DiagnosisError as error:
        raise DiagnosisError(f"{name} {error}") from error
    except ImportError:
        raise
    except Exception as error:  # whatever a library says of damaged bytes
        raise DiagnosisError(f"{name} can't be read as {form}: {str(error).splitlines()[0][:120]}") from error
    columns = {title: values for title, values in found.pop("columns").items() if len(values)}
    problems = found.setdefault("problems", {})
    if not columns and not problems:
        raise DiagnosisError(f"{name} holds no numbers")
    for title, values in columns.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad) and title not in problems:
            lines = found.get("lines", ())
            place = f"line {lines[bad[0]]}" if len(lines) else f"reading {bad[0] + 1}"
            problems[title] = f"{place}: {str(values[bad[0]])!r} is not a finite number"
    found["form"] = found.get("form", form)
    return Recording(source=name, columns=columns, sha256=hashlib.sha256(data).hexdigest(), **found)


def parse_reading(line: str, number: int, *, first: bool) -> float | None:
    """Reading of one line of a stream; None for a blank line, a comment, or a heading before the first reading.

    Raises
    ------
    DiagnosisError
        If the line is no finite number, or holds several.
    """
    text = line.lstrip("\ufeff").strip().rstrip(",;")
    if not text or COMMENT.match(text):
        return None
    if not NUMBER.fullmatch(text):
        if first:
            return None
        raise DiagnosisError(f"standard input, line {number}: {text[:40]!r} is not a finite number")
    value = float(text.replace(",", "."))
    if not np.isfinite(value):
        raise DiagnosisError(f"standard input, line {number}: {text[:40]!r} is not a finite number")
    return value


def _standard_input() -> bytes:
    stream = getattr(sys.stdin, "buffer", None)
    return sys.stdin.read().encode() if stream is None else stream.read()


def _reader(data: bytes) -> tuple[Any, str]:
    """Function that reads the bytes, and the name of the format."""
    if data[:4] == b"PAR1":
        return _parquet, "Parquet"
    if data[:6] == b"\x93NUMPY":
        return _numpy, "NumPy"
    if data[:4] in (b"RIFF", b"RIFX"):
        return _wav, "WAV"
    if data[:6] == b"MATLAB":
        return _matlab, "MATLAB"
    if data[:80].split(b"\n")[0].strip() == b"-1":
        return _universal, "UFF"
    return _csv, "CSV"


def _parquet(data: bytes) -> dict[str, Any]:
    import pyarrow.parquet as pq

    table = pq.read_table(io.BytesIO(data))
    columns, units = {}, {}
    for column in table.schema:
        if not (pa.types.is_floating(column.type) or pa.types.is_integer(column.type)):
            continue
        values = table.column(column.name).cast(pa.float64()).to_numpy(zero_copy_only=False)
        name, unit = split_unit(column.name)
        columns[name] = _without_end(np.asarray(values, dtype=float))
        unit = (column.metadata or {}).get(b"unit", unit.encode()).decode()
        if unit:
            units[name] = unit
    return {"columns": columns, "units": units}


def _numbered(array: Array) -> dict[str, Array]:
    """Columns of an array (n,) or (n, columns); the longer side are the readings."""
    table = np.atleast_2d(np.asarray(array, dtype=float))
    if table.ndim != 2:
        raise DiagnosisError(f"holds an array of shape {np.shape(array)}; allowed: (n,) or (n, columns)")
    table = table.T if table.shape[0] < table.shape[1] else table
    return {f"column {place + 1}": _without_end(values) for place, values in enumerate(table.T)}


def _numpy(data: bytes) -> dict[str, Any]:
    array = np.load(io.BytesIO(data), allow_pickle=False)
    if array.dtype.names:
        return {"columns": {name: np.asarray(array[name], dtype=float) for name in array.dtype.names}}
    return {"columns": _numbered(array), "named": False}


def _matlab(data: bytes) -> dict[str, Any]:
    from scipy.io import loadmat

    found = loadmat(io.BytesIO(data))
    columns: dict[str, Array] = {}
    for name, value in found.items():
        if (
            name.startswith("__")
            or not isinstance(value, np.ndarray)
            or value.dtype.kind not in "fiu"
            or value.size < 2
        ):
            continue
        parts = _numbered(np.squeeze(value))
        columns |= (
            {name: next(iter(parts.values()))} if len(parts) == 1 else {f"{name} {k}": v for k, v in parts.items()}
        )
    return {"columns": columns}


def _wav(data: bytes) -> dict[str, Any]:
    from scipy.io import wavfile

    rate, samples = wavfile.read(io.BytesIO(data))
    return {"columns": _numbered(samples), "rate_hz": float(rate), "named": False, "form": f"WAV, {rate} Hz"}


def _universal(data: bytes) -> dict[str, Any]:
    import tempfile

    try:
        import pyuff
    except ImportError as error:
        raise DiagnosisError("is a universal file, which needs the extra [uff]: pip install pyuff") from error
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "record.uff"
        path.write_bytes(data)
        sets = pyuff.UFF(str(path)).read_sets()
    columns, units, rate = {}, {}, None
    for place, one in enumerate([sets] if isinstance(sets, dict) else sets, start=1):
        if one.get("type") != 58 or "data" not in one:
            continue
        name = str(one.get("id1") or "").strip() or f"channel {place}"
        name = f"{name} {place}" if name in columns else name
        columns[name] = np.real(np.asarray(one["data"])).astype(float)
        unit = str(one.get("ordinate_axis_units_lab") or "").strip()
        if unit and unit.upper() != "NONE":
            units[name] = unit
        if one.get("abscissa_inc"):
            rate = 1.0 / float(one["abscissa_inc"])
    return {"columns": columns, "units": units, "rate_hz": rate}


def _csv(data: bytes) -> dict[str, Any]:
    text = _decoded(data)
    if "\0" in text:
        raise DiagnosisError("is neither text nor a format that is known (CSV, Parquet, .npy, .mat, WAV, UFF)")
    kept = [
        (number, line.rstrip("\r"))
        for number, line in enumerate(text.split("\n"), start=1)
        if line.strip(" ,;|\t\r") and not (COMMENT.match(line) and not re.match(r'\s*"[^"]*"\s*($|[,;\t|])', line))
    ]
    if not kept:
        raise DiagnosisError("holds no numbers")
    delimiter = _delimiter([line for _, line in kept])
    if delimiter == " ":
        kept = [(number, "\t".join(line.split())) for number, line in kept]
    mark = "\t" if delimiter == " " else delimiter
    rows = [[word.strip(' "') for word in line.split(mark)] for _, line in kept]
    width = Counter(map(len, rows[-200:])).most_common(1)[0][0]
    start = next((i for i, row in enumerate(rows) if any(map(_is_number, row)) and len(row) == width), None)
    if start is None:
        raise DiagnosisError("holds no numbers")
    names, units = _titles([row for row in rows[:start] if len(row) == width], width)
    titles = names or [f"column {place + 1}" for place in range(width)]
    if len(set(titles)) != len(titles):
        raise DiagnosisError(f"names two columns alike: {', '.join(titles)}")
    table, lines = _table(kept[start:], titles, mark), tuple(number for number, _ in kept[start:])
    comma = delimiter != "," and any(
        "," in (value or "") for column in table.columns for value in column[:50].to_pylist()
    )
    columns, problems = {}, {}
    for title, column in zip(titles, table.columns, strict=True):
        columns[title], problem = _numbers(column, comma, lines)
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


UNITS = frozenset(
    [
        "N",
        "kN",
        "mN",
        "MN",
        "lbf",
        "kgf",
        "s",
        "ms",
        "us",
        "µs",
        "μs",
        "min",
        "h",
        "rpm",
        "1/min",
        "min-1",
        "Hz",
        "kHz",
        "1/s",
        "V",
        "mV",
        "g",
        "m/s²",
        "m/s2",
        "m/s^2",
        "m",
        "mm",
        "um",
        "µm",
        "deg",
        "°",
        "rad",
        "°C",
        "K",
        "A",
        "%",
        "-",
    ]
)
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
    values[good] = [float(entry) for entry in text.filter(pa.array(good)).to_pylist()]
    if len(bad):
        entry = str(text[int(bad[0])])
        shown = repr(entry[:40]) if entry else "a blank between two numbers"
        return values, f"line {lines[bad[0]]}: {shown} is not a finite number"
    return values, ""


def _without_end(values: Array) -> Array:
    """Readings down to the last one that is not blank."""
    return np.asarray(values[: int(np.max(np.flatnonzero(~np.isnan(values)), initial=-1)) + 1])
