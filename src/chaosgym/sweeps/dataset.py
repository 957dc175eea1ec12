"""How is a labelled sweep kept? One Parquet file whose schema says units, definitions and provenance.

Any Parquet reader opens it; the columns are the swept fields in SI units, then the labels and their evidence.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from chaosgym.errors import DatasetError

DATA_FILE = "sweep.parquet"

LABELS: Mapping[str, tuple[pa.DataType, str, str]] = {
    "nature": (pa.string(), "-", "Two-Step Test: periodic, quasiperiodic, chaotic or undetermined; null if failed"),
    "period": (pa.int32(), "cycles", "cycles after which a periodic response repeats; null otherwise"),
    "response_type": (pa.string(), "-", "I, II, III or undetermined, over the neighbours in speed and clearance"),
    "status": (pa.string(), "-", "labelled, undetermined or failed"),
    "margin": (pa.float64(), "-", "distance of the verdict from its threshold; 0 on the threshold"),
    "peak_force_min": (pa.float64(), "N", "smallest peak force of a judged cycle, first side of the joint"),
    "peak_force_max": (pa.float64(), "N", "largest peak force of a judged cycle, first side"),
    "peak_force_mean": (pa.float64(), "N", "mean peak force, first side"),
    "peak_force_std": (pa.float64(), "N", "standard deviation of the peak force, first side"),
    "impacts_per_cycle": (pa.float64(), "-", "contacts that begin in a cycle, all sides"),
    "contact_fraction": (pa.float64(), "-", "share of the time in contact, all sides"),
    "bounce_fraction": (pa.float64(), "-", "longest bouncing before sustained contact, in half cycles"),
    "reason": (pa.string(), "-", "why the verdict is what it is, or why the run failed"),
}
"""Label columns: type, unit, meaning."""


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
        """Shape of the grid, or (n_points,) if the points were drawn."""
        if self.settings["sampling"] != "grid":
            return (len(self.table),)
        return tuple(axis["count"] for axis in self.settings["axes"])


def schema(axis_units: Mapping[str, str], settings: Mapping[str, Any]) -> pa.Schema:
    """Schema of a sweep over some fields: units and meanings on the columns, provenance on the whole."""
    fields = [pa.field(name, pa.float64(), metadata={"unit": unit}) for name, unit in axis_units.items()]
    fields += [pa.field(name, kind, metadata={"unit": unit, "meaning": meaning})
               for name, (kind, unit, meaning) in LABELS.items()]  # fmt: skip
    return pa.schema(fields, metadata={"chaosgym": json.dumps(settings, sort_keys=True)})


def read_sweep(folder: str | Path) -> LabelledSweep:
    """Read a finished sweep.

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
        table = pq.read_table(path)
        settings = json.loads(table.schema.metadata[b"chaosgym"])
    except (pa.ArrowException, KeyError, TypeError, ValueError, OSError) as error:
        raise DatasetError(f"{path} can't be read as a chaosgym sweep: {error}") from error
    return LabelledSweep(table, settings)
