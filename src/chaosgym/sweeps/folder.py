"""The folder of a running sweep: its plan, and every finished chunk in a file of its own.

A file appears under its name only when it is whole. At the end the chunks become the row groups of one file. Damaged
chunks are named; they are computed again only if that is asked for.
"""

import errno
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from chaosgym.errors import DatasetError, UnfinishedError
from chaosgym.files import contents, write_atomically
from chaosgym.sweeps.dataset import DAMAGE, DATA_FILE, parquet_writer, schema
from chaosgym.sweeps.label import with_response_types
from chaosgym.sweeps.plan import SweepPlan

PLAN_FILE = "plan.json"
CHUNK_FOLDER = "chunks"
SWEEP = "run of this sweep"
"""What a folder holds that may be written into."""

LARGEST_PLAN = 10_000_000
"""Bytes that a plan may have."""


class SweepFolder:
    """The folder of one plan.

    Raises
    ------
    DatasetError
        If the folder holds anything else. Nothing in it is touched.
    """

    def __init__(self, folder: str | Path, plan: SweepPlan, version: str) -> None:
        self.path = Path(folder)
        self.plan = plan
        self.settings: dict[str, Any] = {**plan.settings(), "version": version}
        self.data = self.path / DATA_FILE
        self._claim()

    def _claim(self) -> None:
        plan_file = self.path / PLAN_FILE
        if plan_file.is_file():
            held = read_plan_file(plan_file)
            if held != json.loads(json.dumps(self.settings)):
                differing = sorted(
                    key for key in self.settings.keys() | held.keys() if self.settings.get(key) != held.get(key)
                )
                raise DatasetError(
                    f"{self.path} holds another sweep (it differs in {', '.join(differing)}); choose another folder"
                )
        else:
            text = json.dumps(self.settings, indent=2) + "\n"
            write_atomically(plan_file, lambda temporary: temporary.write_text(text))

    def chunk_file(self, rows: range) -> Path:
        """File of a chunk."""
        return self.path / CHUNK_FOLDER / f"{rows.start:012d}.parquet"

    def missing(self, *, repair: bool = False) -> list[range]:
        """Chunks that are still to be computed; with ``repair`` damaged ones too.

        Raises
        ------
        DatasetError
            If a chunk is damaged and that is not to be repaired.
        """
        if self.data.is_file() and not self._salvage(repair):
            shutil.rmtree(self.path / CHUNK_FOLDER, ignore_errors=True)
            return []
        (self.path / CHUNK_FOLDER).mkdir(exist_ok=True)
        waiting = []
        for rows in self.plan.chunks():
            if self.chunk_file(rows).is_file():
                try:
                    self._read(rows)
                    continue
                except DAMAGE as error:
                    self._name_damage([self.chunk_file(rows).name], error, repair)
            waiting.append(rows)
        return waiting

    def _salvage(self, repair: bool) -> bool:
        """Turn a damaged finished file back into its sound chunks; False if it is sound."""
        try:
            with pq.ParquetFile(self.data, page_checksum_verification=True) as file:
                provenance = json.loads(file.schema_arrow.metadata[b"provenance"])
                damaged = dict(self._damaged_row_groups(file))
                if not damaged:
                    return False
                names = [f"row group {number} of {DATA_FILE}" for number in damaged]
                self._name_damage(names, next(iter(damaged.values())), repair)
                (self.path / CHUNK_FOLDER).mkdir(exist_ok=True)
                origin = {b"chaosgym": json.dumps({"provenance": provenance}).encode()}
                for number, rows in enumerate(self.plan.chunks()):
                    if number not in damaged:
                        self.keep(rows, file.read_row_group(number).replace_schema_metadata(origin))
        except DatasetError:
            raise
        except DAMAGE as error:
            self._name_damage([DATA_FILE], error, repair)
        self.data.unlink()
        return True

    def _damaged_row_groups(self, file: pq.ParquetFile) -> Iterator[tuple[int, Exception]]:
        for number, rows in enumerate(self.plan.chunks()):
            try:
                self._sound(file.read_row_group(number), rows)
            except DAMAGE as error:
                yield number, error

    def _name_damage(self, names: list[str], error: Exception, repair: bool) -> None:
        if not repair:
            why = str(error).splitlines()[0]
            shown = names if len(names) < 6 else [*names[:5], f"and {len(names) - 5} more"]
            raise DatasetError(
                f"{self.path}: {', '.join(shown)} damaged ({why}); the same command with --repair computes it again"
            )

    def _read(self, rows: range) -> pa.Table:
        return self._sound(pq.read_table(self.chunk_file(rows), page_checksum_verification=True), rows)

    def _sound(self, table: pa.Table, rows: range) -> pa.Table:
        if len(table) != len(rows) or not table.schema.equals(schema(self.plan, self.settings)):
            raise ValueError(f"it holds other rows than {rows.start} to {rows.stop - 1} of this sweep")
        for name, column in self.plan.points(rows).items():
            if not np.array_equal(table.column(name).to_numpy(), column):
                raise ValueError(f"it holds other values of {name} than this sweep")
        return table

    def keep(self, rows: range, table: pa.Table) -> None:
        """Keep a finished chunk.

        Raises
        ------
        UnfinishedError
            If the disk is full; what was kept before stays.
        """

        def write(temporary: Path) -> None:
            with parquet_writer(temporary, table.schema) as writer:
                writer.write_table(table)

        self._write(self.chunk_file(rows), write)

    def finish(self) -> None:
        """Join the chunks, with response types, into one file; then remove them."""
        found = [json.loads(pq.read_schema(self.chunk_file(rows)).metadata[b"chaosgym"]) for rows in self.plan.chunks()]
        provenances = [part for chunk in found for part in _as_list(chunk["provenance"])]
        distinct = [json.loads(text) for text in dict.fromkeys(json.dumps(part) for part in provenances)]
        described = schema(self.plan, self.settings)
        described = described.with_metadata({**described.metadata, "provenance": json.dumps(distinct)})

        def write(temporary: Path) -> None:
            with parquet_writer(temporary, described) as writer:
                for table in self._typed():
                    writer.write_table(table.replace_schema_metadata(described.metadata), row_group_size=len(table))

        self._write(self.data, write)
        shutil.rmtree(self.path / CHUNK_FOLDER)

    def _typed(self) -> Iterator[pa.Table]:
        """Chunks in order, with response types."""
        chunks = self.plan.chunks()
        if self.plan.sampling != "grid":
            for rows in chunks:
                yield with_response_types(self._read(rows), self.plan, rows)
            return
        whole = pa.concat_tables([self._read(rows) for rows in chunks])
        whole = with_response_types(whole, self.plan, range(len(self.plan)))
        for rows in chunks:
            yield whole.slice(rows.start, len(rows))

    def _write(self, path: Path, write: Any) -> None:
        try:
            write_atomically(path, write)
        except OSError as error:
            if error.errno not in (errno.ENOSPC, errno.EDQUOT):
                raise
            raise UnfinishedError(
                f"no space left for {path}; finished chunks are kept: free space, then run the same command again"
            ) from error


def _as_list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]


def read_plan_file(path: Path) -> dict[str, Any]:
    """Settings of a sweep from its plan file.

    Raises
    ------
    DatasetError
        If the file can't be read.
    """
    try:
        held = json.loads(contents(path, LARGEST_PLAN))
    except (RecursionError, ValueError) as error:
        raise DatasetError(f"{path} is damaged: {error}; choose another folder") from error
    if not isinstance(held, dict):
        raise DatasetError(f"{path} is damaged: no settings; choose another folder")
    return held
