"""What a sweep's folder holds: rows, classes, faults, and how well two ways to a type agree."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from chaosgym.errors import DatasetError
from chaosgym.files import first_line
from chaosgym.sweeps.dataset import DAMAGE, DATA_FILE, LabelledSweep, read_sweep
from chaosgym.sweeps.folder import CHUNK_FOLDER, PLAN_FILE, read_plan_file
from chaosgym.sweeps.plan import SweepPlan

CLASSES = ("nature", "response_type", "full_response_type", "status", "split")


def dataset_info(folder: str | Path) -> dict[str, Any]:
    """Describe a sweep's folder as JSON values.

    Returns
    -------
    dict
        ``machine``, ``complete``, ``rows`` (finished and planned), ``classes`` (counts by label column; by split too),
        ``faults``, ``types`` (agreement of the two type columns), ``settings``, ``definitions`` and ``provenance``; of
        an unfinished sweep without classes and faults.

    Raises
    ------
    DatasetError
        If the folder holds no sweep, or its file is damaged.
    """
    folder = Path(folder)
    if (folder / DATA_FILE).is_file():
        return _finished(read_sweep(folder), (folder / DATA_FILE).stat().st_size)
    if not (folder / PLAN_FILE).is_file():
        raise DatasetError(f"{folder} holds no sweep: neither {DATA_FILE} nor {PLAN_FILE}")
    settings = read_plan_file(folder / PLAN_FILE)
    try:
        plan = SweepPlan.from_settings(settings)
    except DAMAGE as error:
        raise DatasetError(f"{folder / PLAN_FILE} is damaged: {type(error).__name__}: {first_line(error)}") from error
    kept = {path.name for path in (folder / CHUNK_FOLDER).glob("*.parquet")}
    rows = sum(len(chunk) for chunk in plan.chunks() if f"{chunk.start:012d}.parquet" in kept)
    return {
        "machine": settings["machine"],
        "complete": False,
        "rows": {"finished": rows, "planned": len(plan)},
        "settings": settings,
    }


def _finished(sweep: LabelledSweep, size: int) -> dict[str, Any]:
    present = [name for name in CLASSES if name in sweep.table.column_names]
    classes: dict[str, Any] = {name: _counts(sweep.column(name)) for name in present}
    if "split" in present:
        parts = sweep.column("split")
        for name in ("nature", "response_type"):
            values = sweep.column(name)
            classes[f"{name}_by_split"] = {str(part): _counts(values[parts == part]) for part in np.unique(parts)}
    metadata = sweep.table.schema.metadata
    return {
        "machine": sweep.settings["machine"],
        "complete": True,
        "rows": {"finished": len(sweep.table), "planned": len(sweep.plan)},
        "bytes": size,
        "classes": classes,
        "faults": _faults(sweep),
        "two_step": _two_step(sweep),
        "types": compare_types(sweep),
        "settings": sweep.settings,
        "definitions": json.loads(metadata[b"definitions"]),
        "provenance": sweep.provenance,
    }


def _counts(values: Any) -> dict[str, int]:
    """Counts by class, the most frequent first; rows without one are left out."""
    return dict(Counter(str(value) for value in values if value is not None).most_common())


def _faults(sweep: LabelledSweep) -> dict[str, int]:
    """Rows that a reader may want to leave out."""
    status, nature, neighbours = (sweep.column(name) for name in ("status", "nature", "type_neighbours"))
    wanted_neighbours = sweep.plan.all_neighbours
    faults = {name: int(np.sum(status == name)) for name in ("failed", "disputed", "unresolved", "transient")}
    faults["undetermined"] = int(np.sum(nature == "undetermined"))
    if sweep.plan.sampling == "grid" and wanted_neighbours:
        faults["without_all_neighbours"] = int(np.sum(neighbours != wanted_neighbours))
    if sweep.plan.signals:
        wanted = sweep.plan.with_signals(range(len(sweep.table)))
        faults["without_promised_signals"] = int(wanted.sum()) - (
            len(sweep.table) - sweep.table.column("start_velocity").null_count
        )
    return faults


def _two_step(sweep: LabelledSweep) -> dict[str, Any] | None:
    """How often the Two-Step Test alone and the exponent's sign agree that a response is chaotic or is not.

    None for a sweep of a version without the column.
    """
    if "two_step" not in sweep.table.column_names:
        return None
    alone = sweep.column("two_step")
    exponent, error = sweep.column("exponent"), sweep.column("exponent_error")
    told = np.array([word not in (None, "undetermined") for word in alone])
    chaotic = exponent > 3.0 * error
    return {
        "rows": int(told.sum()),
        "undetermined": int(np.sum(alone == "undetermined")),
        "agreement": round(float(np.mean((alone == "chaotic")[told] == chaotic[told])), 4) if told.any() else None,
    }


def compare_types(sweep: LabelledSweep) -> dict[str, Any] | None:
    """Types from neighbours against types over the full window, where both stand; None if nowhere."""
    shared, full = sweep.column("response_type"), sweep.column("full_response_type")
    both = np.array([a is not None and b is not None for a, b in zip(shared, full, strict=True)])
    if not sweep.plan.all_neighbours or not both.any():
        return None
    pairs = Counter((str(a), str(b)) for a, b in zip(shared[both], full[both], strict=True))
    return {
        "points": int(both.sum()),
        "disagreement": float(np.mean(shared[both] != full[both])),
        "pairs": {f"{a} against {b}": count for (a, b), count in sorted(pairs.items())},
    }
