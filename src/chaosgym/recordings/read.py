"""Recorders' files as columns of numbers with names and units, whatever wrote them.

CSV with any common delimiter, decimal comma, UTF-8 or UTF-16, comments and a heading; Parquet, NumPy ``.npy`` and
``.npz``, JSON, MATLAB ``.mat``, WAV; universal files (UFF 58, extra ``[uff]``); TDMS, MDF, HDF5, MATLAB 7.3, Excel and
FLAC (extra ``[recordings]``). Formats are told by their first bytes.
"""

import hashlib
import mmap
import os
import select
import stat
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError, NoRecordingError
from chaosgym.recordings.formats import format_of
from chaosgym.recordings.naming import Named, named
from chaosgym.recordings.quantities import split_unit
from chaosgym.recordings.raw import Data, Parts, Raw, TooMuch, pieces


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
    rates
        Sampling rates [Hz] that the file states, by the name of the number, or of the column that they belong to.
    speeds
        Speeds [rpm] that the file states, by the name of the number.
    texts
        Columns of text: the first of them, with its line.
    doubts
        Why the unit of a column is in doubt.
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
    lines: Sequence[int] = ()
    rates: Mapping[str, float] = field(default_factory=dict)
    speeds: Mapping[str, float] = field(default_factory=dict)
    texts: Mapping[str, str] = field(default_factory=dict)
    doubts: Mapping[str, str] = field(default_factory=dict)
    named: bool = True

    @property
    def rate_hz(self) -> float | None:
        """Sampling rate [Hz], where the file states one, and no two that differ."""
        rates = list(self.rates.values())
        return rates[0] if rates and np.allclose(rates, rates[0], rtol=1e-6, atol=0.0) else None

    def __repr__(self) -> str:
        return f"<{self.source}: {self.form}; {', '.join(self.columns)}>"

    def where(self, index: int) -> str:
        """Place of a reading, for people."""
        return f"line {self.lines[index]}" if index < len(self.lines) else f"reading {index + 1}"


def read_recording(source: str | Path, *, sheet: str | None = None, column: str | None = None) -> Recording:
    """Read a file; "-" is standard input.

    Parameters
    ----------
    source
        Name of the file.
    sheet
        Of a workbook, by name; without it the first one that has the column, or a table of numbers.
    column
        Name of the column that the workbook is searched for.

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
    form = format_of(data)
    try:
        raw = form.read(data)
        if isinstance(raw, Raw) and sheet is not None:
            raise DiagnosisError(f"is read as {form.name}, which has no sheets; got: sheet {sheet!r}")
        raw, one = (raw, named(raw)) if isinstance(raw, Raw) else _part(raw, form.name, sheet, column)
    except DiagnosisError as error:
        raise type(error)(f"{name} {error}") from error
    except Exception as error:  # whatever a library says of damaged bytes
        raise DiagnosisError(
            f"{name} can't be read as {form.name}: {(str(error).splitlines() or ['damaged'])[0][:120]}"
        ) from error
    if not one.columns and not one.problems:
        raise NoRecordingError(f"{name} holds no numbers")
    told = f", of another length and left out: {', '.join(one.left[:5])}" if one.left else ""
    return Recording(
        source=name,
        form=raw.form + told,
        sha256=_digest(data),
        lines=raw.lines,
        named=raw.named,
        **{key: value for key, value in one._asdict().items() if key != "left"},
    )


def _digest(data: Data) -> str:
    """SHA-256 of the bytes."""
    digest = hashlib.sha256()
    for piece in pieces(data, 2**24):
        digest.update(piece)
    return digest.hexdigest()


FEWEST_ROWS = 8
"""Readings of a column that make a sheet a table of numbers."""


def _part(parts: Parts, form: str, sheet: str | None, column: str | None) -> tuple[Raw, Named]:
    """The sheet that was asked for, or the first with the column, or with a table of numbers; else the longest.

    Raises
    ------
    DiagnosisError
        If there is no such sheet, or no sheet holds numbers.
    """
    if sheet is not None and sheet not in parts:
        raise DiagnosisError(f"has no sheet {sheet!r}; its sheets: {', '.join(map(repr, parts))}")
    tables: list[tuple[int, Raw, Named]] = []
    for name in parts if sheet is None else [sheet]:
        try:
            raw = parts[name]()
        except TooMuch:
            raise
        except DiagnosisError:
            if sheet is not None:
                raise
            continue
        raw.form = f"{form}, sheet {name!r}" + (f" of {', '.join(map(repr, parts))}" if len(parts) > 1 else "")
        one = named(raw)
        rows = max(map(len, one.columns.values()), default=0)
        wanted = split_unit(column or "")[0].casefold()
        if wanted in map(str.casefold, one.columns) or (not wanted and rows >= FEWEST_ROWS):
            return raw, one
        tables.append((min(rows, FEWEST_ROWS), raw, one))
    if not tables:
        raise NoRecordingError("holds no numbers")
    return max(tables, key=lambda table: table[0])[1:]


LARGEST = 2**30
"""Bytes of a recording at the most."""

PATIENCE = 2.0
"""Time [s] in which a named pipe must have something to read."""


def _bytes_of(path: Path) -> Data:
    """Bytes of a file, mapped into memory, or of a named pipe.

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
        with open(path, "rb") as file:
            try:
                return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
            except (OSError, ValueError):  # an empty file, or a file system that maps none
                return file.read()
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb") as pipe:
        if not select.select([pipe], [], [], PATIENCE)[0]:
            raise DiagnosisError(f"{path} is a pipe into which nothing was written for {PATIENCE:g} s")
        os.set_blocking(pipe.fileno(), True)
        return _within(str(path), pipe.read(LARGEST + 1))


def _standard_input() -> bytes:
    if sys.stdin is None:
        raise DiagnosisError("standard input is closed; allowed: a file, or - behind a program that writes")
    stream = getattr(sys.stdin, "buffer", None)
    return _within("standard input", sys.stdin.read().encode() if stream is None else stream.read(LARGEST + 1))


def _within(name: str, content: bytes) -> bytes:
    if len(content) > LARGEST:
        raise DiagnosisError(f"{name} holds more than 1 GiB; allowed: up to 1 GiB; cut it, or one peak a cycle")
    return content
