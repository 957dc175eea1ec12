"""What a reader of a format returns: columns as the file holds them, and what the file says of them, as written."""

import io
import mmap
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from chaosgym.arrays import Array

Data = bytes | mmap.mmap
"""Bytes of a file, which a large one lends from the disk."""


def stream(data: Data) -> Any:
    """The bytes as an open file, without a copy of what is mapped."""
    if isinstance(data, bytes):
        return io.BytesIO(data)
    data.seek(0)
    return data


@dataclass(frozen=True)
class Column:
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


@dataclass
class Raw:
    """Columns of a file, and single numbers that it names, such as ``{"fs": 2000.0}`` or ``{"dx": "0.5 ms"}``.

    ``lines`` are the lines of the readings of a text; ``named`` tells whether the file names its columns.
    """

    form: str
    columns: list[Column] = field(default_factory=list)
    stated: dict[str, Any] = field(default_factory=dict)
    lines: tuple[int, ...] = ()
    named: bool = True

    def add(self, title: str, values: Any, stated: Mapping[str, Any] | None = None, group: str = "") -> None:
        """Take the numbers or instants of an array (n,) or (n, columns), whose longer side are the readings.

        Texts are noted; single numbers and arrays of more than two sides are left out.
        """
        table, stated = np.squeeze(np.asarray(values)), stated or {}
        if table.dtype.kind in "SUO" and table.ndim == 1:
            if all(isinstance(entry, str | bytes | None) for entry in table.tolist()):
                first = next((place for place, entry in enumerate(table.tolist()) if entry), 0)
                told = f"holds text: {str(table[first])[:40]!r} in row {first + 1}"
                self.columns.append(Column(title, None, stated, group, problem=told))
            return
        if table.dtype.kind in "mM" and table.size:
            start = table.flat[0] if table.dtype.kind == "M" else np.timedelta64(0, "s")
            table, stated = (table - start) / np.timedelta64(1, "s"), {**stated, "unit": "s"}
        if table.dtype.kind not in "fiub" or table.ndim not in (1, 2):
            return
        table = np.atleast_2d(table if table.dtype in (np.float32, np.float64) else table.astype(float))
        table = table.T if table.shape[0] < table.shape[1] else table
        several = table.shape[1] > 1 or not self.named
        for place, column in enumerate(table.T, start=1):
            self.columns.append(Column(title, column, stated, group, str(place) if several else ""))


Parts = Mapping[str, Callable[[], Raw]]
"""Sheets of a workbook by name, each read when it is asked for."""
