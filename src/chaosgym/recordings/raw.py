"""What a reader of a format returns: columns as the file holds them, and what the file says of them, as written.

A small file may claim much: readings are counted before they are read (``check_readings``), and texts are cut before
any pattern is tried on them (``cut``).
"""

import io
import mmap
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError

Data = bytes | mmap.mmap
"""Bytes of a file, which a large one lends from the disk."""

MOST_READINGS = 50_000_000
"""Readings that the columns of a recording may have together: 0.4 GB as numbers of double precision."""

MOST_COLUMNS = 4096
"""Columns that a recording may have."""

LONGEST = 200
"""Letters of a title, or of a property, that are read; recorders write some tens."""

COPIED = 2**22
"""Bytes of a mapped file that are copied at a time."""

CONTROLS = re.compile(r"[\x00-\x1f\x7f\x85\u2028\u2029]+")
"""Letters that end a line, or steer a terminal."""


class TooMuch(DiagnosisError):
    """A file claims more than is read."""


def check_readings(count: int) -> None:
    """Refuse a file that claims more readings than ``MOST_READINGS``.

    Raises
    ------
    TooMuch
        If it does; says what to do.
    """
    if count > MOST_READINGS:
        raise TooMuch(
            f"claims {count:,} readings or more; allowed: up to {MOST_READINGS:,} in all columns; export a part of it"
        )


def check_columns(count: int) -> None:
    """Refuse more columns than ``MOST_COLUMNS``.

    Raises
    ------
    TooMuch
        If there are more.
    """
    if count > MOST_COLUMNS:
        raise TooMuch(f"has {count} columns; allowed: {MOST_COLUMNS}; keep those of forces, times and speeds")


def cut(text: str) -> str:
    """A text as far as it is read, in one line."""
    return CONTROLS.sub(" ", text[:LONGEST])


def pieces(data: Data, size: int) -> Iterator[bytes]:
    """The bytes, so many at a time; those of a file are given back to it behind the reader."""
    for start in range(0, len(data), size):
        yield data[start : start + size]
        give_back(data)


def give_back(data: Data) -> None:
    """Let go of what was read of a mapped file; it is read again where it is asked for again."""
    if isinstance(data, mmap.mmap) and hasattr(mmap, "MADV_DONTNEED"):
        data.madvise(mmap.MADV_DONTNEED)


class _Mapped(io.RawIOBase):
    """A mapped file as a stream that copies no more than is read."""

    def __init__(self, data: mmap.mmap) -> None:
        self._data, self._place = data, 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        start = {io.SEEK_SET: 0, io.SEEK_CUR: self._place, io.SEEK_END: len(self._data)}[whence]
        self._place = max(0, start + offset)
        return self._place

    def readinto(self, into: Any) -> int:
        part = self._data[self._place : self._place + min(len(into), COPIED)]
        into[: len(part)] = part
        self._place += len(part)
        if self._place // COPIED != (self._place - len(part)) // COPIED:
            give_back(self._data)
        return len(part)


def stream(data: Data) -> io.BufferedReader | io.BytesIO:
    """The bytes as an open file, without a copy of what is mapped."""
    return io.BytesIO(data) if isinstance(data, bytes) else io.BufferedReader(_Mapped(data))


@dataclass(frozen=True)
class RawColumn:
    """Readings (n,) under a title as written, in single precision where the file has them so.

    ``values`` is None where they are text, of which ``problem`` tells. ``stated`` holds properties by name, such as
    ``{"unit_string": "kN", "wf_increment": 0.0005}``. ``group`` is the folder in the file, ``place`` the number of a
    column of an array (n, columns).
    """

    title: str
    values: Array | None
    stated: Mapping[str, Any] = field(default_factory=dict)
    group: str = ""
    place: str = ""
    problem: str = ""

    def __post_init__(self) -> None:
        for name in ("title", "group"):
            object.__setattr__(self, name, cut(getattr(self, name)))
        object.__setattr__(self, "stated", short(self.stated))


def short(stated: Mapping[str, Any]) -> dict[str, Any]:
    """Properties as far as their names and texts are read."""
    return {cut(key): cut(value) if isinstance(value, str) else value for key, value in stated.items()}


@dataclass
class Raw:
    """Columns of a file, and single numbers that it names, such as ``{"fs": 2000.0}`` or ``{"dx": "0.5 ms"}``.

    ``lines`` are the lines of the readings of a text; ``named`` tells whether the file names its columns; ``readings``
    counts them as they are added.
    """

    form: str
    columns: list[RawColumn] = field(default_factory=list)
    stated: dict[str, Any] = field(default_factory=dict)
    lines: Sequence[int] = ()
    named: bool = True
    readings: int = 0

    def add(self, title: str, values: Any, stated: Mapping[str, Any] | None = None, group: str = "") -> None:
        """Take the numbers or instants of an array (n,) or (n, columns), whose longer side are the readings.

        Texts are noted; single numbers and arrays of more than two sides are left out.

        Raises
        ------
        TooMuch
            If these are more readings than the budget of a recording.
        """
        table, stated = np.squeeze(np.asarray(values)), stated or {}
        self.readings += table.size
        check_readings(self.readings)
        check_columns(len(self.columns) + 1)
        if table.dtype.kind in "SUO" and table.ndim == 1:
            if all(isinstance(entry, str | bytes | None) for entry in table.tolist()):
                first = next((place for place, entry in enumerate(table.tolist()) if entry), 0)
                told = f"holds text: {str(table[first])[:40]!r} in row {first + 1}"
                self.columns.append(RawColumn(title, None, stated, group, problem=told))
            return
        if table.dtype.kind in "mM" and table.size:
            start = table.flat[0] if table.dtype.kind == "M" else np.timedelta64(0, "s")
            table, stated = (table - start) / np.timedelta64(1, "s"), {**stated, "unit": "s"}
        if table.dtype.kind not in "fiub" or table.ndim not in (1, 2):
            return
        table = np.atleast_2d(table if table.dtype in (np.float32, np.float64) else table.astype(float))
        table = table.T if table.shape[0] < table.shape[1] else table
        several = table.shape[1] > 1 or not self.named
        check_columns(len(self.columns) + table.shape[1])
        for place, column in enumerate(table.T, start=1):
            self.columns.append(RawColumn(title, column, stated, group, str(place) if several else ""))


Parts = Mapping[str, Callable[[], Raw]]
"""Sheets of a workbook by name, each read when it is asked for."""
