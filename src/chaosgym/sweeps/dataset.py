"""A labelled sweep as one Parquet file whose schema says units, definitions and provenance.

Any Parquet reader opens it; the columns are the swept fields in SI units, then the labels, their evidence and the
signals. Every page has a checksum, so that damage is found and named. Row groups are the chunks of the run.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from chaosgym.errors import DatasetError
from chaosgym.sweeps.plan import SweepPlan

DATA_FILE = "sweep.parquet"

DAMAGE = (pa.ArrowException, AttributeError, KeyError, RecursionError, TypeError, ValueError, OSError)
"""What a damaged file raises."""


@dataclass(frozen=True)
class LabelledSweep:
    """A labelled sweep: ``table`` with one row a point, and the ``settings`` that made it."""

    table: pa.Table
    settings: dict[str, Any]

    def column(self, name: str) -> Any:
        """Return a column as a numpy array."""
        return self.table.column(name).to_numpy(zero_copy_only=False)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the grid, or (n_points,) if the points do not form one."""
        if self.settings["sampling"] != "grid":
            return (len(self.table),)
        return tuple(axis["count"] for axis in self.settings["axes"])

    @property
    def plan(self) -> SweepPlan:
        """What was labelled."""
        return SweepPlan.from_settings(self.settings)

    @property
    def provenance(self) -> list[dict[str, str]]:
        """Every installation that computed some of the rows."""
        found: list[dict[str, str]] = json.loads(self.table.schema.metadata[b"provenance"])
        return found


@contextmanager
def parquet_writer(path: Path, schema: pa.Schema) -> Iterator[pq.ParquetWriter]:
    """Open a Parquet file with checksums and zstandard compression; signals are split by byte."""
    lists = [field.name for field in schema if pa.types.is_list(field.type)]
    numbers = [field.name for field in schema if pa.types.is_floating(field.type)]
    words = [field.name for field in schema if field.name not in (*numbers, *lists)]
    with pq.ParquetWriter(
        path,
        schema,
        compression="zstd",
        compression_level=9,
        write_page_checksum=True,
        use_dictionary=words,
        use_byte_stream_split=[f"{name}.list.element" for name in lists],
    ) as writer:
        yield writer


def read_sweep(folder: str | Path, columns: list[str] | None = None) -> LabelledSweep:
    """Read a finished sweep, or some columns of it.

    Raises
    ------
    DatasetError
        If the folder holds no finished sweep, or its file is damaged.
    """
    path = Path(folder) / DATA_FILE
    if not path.is_file():
        raise DatasetError(
            f"{folder} holds no finished sweep (no {DATA_FILE}); run `chaosgym sweep` again to finish it"
        )
    try:
        table = pq.read_table(path, columns=columns, page_checksum_verification=True)
        return _understood(table)
    except DAMAGE as error:
        why, _, _ = str(error).partition("\n")
        raise DatasetError(f"{path} can't be read as a chaosgym sweep: {why}") from error


def _understood(table: pa.Table) -> LabelledSweep:
    """Sweep of a table, all of whose metadata can be read: pages have checksums, the footer has none."""
    metadata = table.schema.metadata
    sweep = LabelledSweep(table, json.loads(metadata[b"chaosgym"]))
    for values, kind in (
        (sweep.plan, SweepPlan),
        (sweep.provenance, list),
        (json.loads(metadata[b"definitions"]), dict),
    ):
        if not isinstance(values, kind):
            raise TypeError(f"its metadata hold a {type(values).__name__} for a {kind.__name__}")
    for field in table.schema:
        for key in (b"unit", b"meaning"):
            field.metadata[key].decode()
    return sweep
