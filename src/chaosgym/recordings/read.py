"""Recorders' files as columns of numbers with names and units, whatever wrote them.

CSV with any common delimiter, decimal comma, UTF-8 or UTF-16, comments and a heading; Parquet, NumPy ``.npy``, MATLAB
``.mat``, WAV; universal files (UFF 58, extra ``[uff]``); TDMS, MDF, HDF5, MATLAB 7.3, Excel and FLAC (extra
``[recordings]``). Formats are told by their first bytes.
"""

import hashlib
import io
import os
import select
import stat
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError
from chaosgym.recordings import recorders
from chaosgym.recordings.heading import split_unit
from chaosgym.recordings.text import MOST_MISSING, read_text


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

    def __repr__(self) -> str:
        return f"<{self.source}: {self.form}; {', '.join(self.columns)}>"

    def where(self, index: int) -> str:
        """Place of a reading, for people."""
        return f"line {self.lines[index]}" if index < len(self.lines) else f"reading {index + 1}"


def read_recording(source: str | Path) -> Recording:
    """Read a file; "-" is standard input.

    Raises
    ------
    DiagnosisError
        If it can't be read, or holds no numbers.

    Examples
    --------
    >>> chaosgym.read_recording("docs/data/peaks.csv")
    <docs/data/peaks.csv: CSV, commas; cycle, upper, lower>
    """
    name = "standard input" if str(source) == "-" else str(source)
    try:
        data = _standard_input() if str(source) == "-" else _bytes_of(Path(source))
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
        if len(bad) > MOST_MISSING * len(values) and title not in problems:
            lines = found.get("lines", ())
            place = f"line {lines[bad[0]]}" if len(lines) else f"reading {bad[0] + 1}"
            problems[title] = f"{place}: {str(values[bad[0]])!r} is not a finite number"
    found["form"] = found.get("form", form)
    return Recording(source=name, columns=columns, sha256=hashlib.sha256(data).hexdigest(), **found)


LARGEST = 2**30
"""Bytes of a recording at the most: a text needs ten times its size in memory."""

PATIENCE = 2.0
"""Time [s] in which a named pipe must have something to read."""


def _bytes_of(path: Path) -> bytes:
    """Bytes of a file or a named pipe.

    Raises
    ------
    DiagnosisError
        If it is a device, a pipe into which nothing writes, or too large.
    OSError
        If it can't be read.
    """
    told = path.stat()
    if stat.S_ISCHR(told.st_mode) or stat.S_ISBLK(told.st_mode):
        raise DiagnosisError(f"{path} is a device; read a stream with -, as in: program | chaosgym ... -")
    if told.st_size > LARGEST:
        raise DiagnosisError(
            f"{path} holds {told.st_size / 2**30:.1f} GiB; allowed: up to 1 GiB; cut it, or one peak a cycle"
        )
    if not stat.S_ISFIFO(told.st_mode):
        return path.read_bytes()
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb") as pipe:
        if not select.select([pipe], [], [], PATIENCE)[0]:
            raise DiagnosisError(f"{path} is a pipe into which nothing was written for {PATIENCE:g} s")
        os.set_blocking(pipe.fileno(), True)
        return pipe.read()


def _standard_input() -> bytes:
    stream = getattr(sys.stdin, "buffer", None)
    return sys.stdin.read().encode() if stream is None else stream.read()


def _reader(data: bytes) -> tuple[Any, str]:
    """Function that reads the bytes, and the name of the format."""
    if data[:6] == b"MATLAB":
        return recorders.matlab, "MATLAB"
    if data[:4] in (b"RIFF", b"RIFX"):
        return recorders.wav, "WAV"
    if data[:4] == b"PK\x03\x04":
        return lambda workbook: read_text(recorders.excel(workbook)), "Excel"
    if data[:80].split(b"\n")[0].strip() == b"-1":
        return _universal, "UFF"
    known = {b"PAR1": (_parquet, "Parquet"), b"\x93NUMPY": (_numpy, "NumPy"), **recorders.READERS}
    return next((reader for first, reader in known.items() if data.startswith(first)), (read_text, "CSV"))


def _parquet(data: bytes) -> dict[str, Any]:
    import pyarrow.parquet as pq

    table = pq.read_table(io.BytesIO(data))
    columns, units = {}, {}
    for column in table.schema:
        if pa.types.is_timestamp(column.type):
            stamps = table.column(column.name).to_numpy()
            columns[column.name] = (stamps - stamps[0]) / np.timedelta64(1, "s")
            units[column.name] = "s"
            continue
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


def _without_end(values: Array) -> Array:
    """Readings down to the last one that is not blank."""
    return np.asarray(values[: int(np.max(np.flatnonzero(~np.isnan(values)), initial=-1)) + 1])
