"""What a sweep's folder holds: rows, classes, faults, its calm region, and how well two ways to a type agree."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from chaosgym.diagnosis.calm_region import CalmRegion, calm_region, searched_by
from chaosgym.errors import DatasetError
from chaosgym.files import first_line
from chaosgym.machines.accuracy import error_spread
from chaosgym.sweeps.dataset import DAMAGE, DATA_FILE, LabelledSweep, read_sweep
from chaosgym.sweeps.folder import CHUNK_FOLDER, PLAN_FILE, read_plan_file
from chaosgym.sweeps.plan import SweepPlan

ESTIMATED = 32
"""Machines of a sweep whose error is estimated."""

CLASSES = ("nature", "response_type", "full_response_type", "status", "split")


def dataset_info(folder: str | Path) -> dict[str, Any]:
    """Describe a sweep's folder as JSON values.

    Returns
    -------
    dict
        ``machine``, ``complete``, ``rows`` (finished and planned), ``model`` (rung, numbers, and the estimated error of
        the peak force at ``ESTIMATED`` points), ``classes`` (counts by label column; by split too),
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
        "model": model_of(plan),
        "settings": {"definition": plan.definition, **settings},
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
        "model": model_of(sweep.plan),
        "bytes": size,
        "classes": classes,
        "faults": _faults(sweep),
        "two_step": _two_step(sweep),
        "types": compare_types(sweep),
        "settings": {"definition": sweep.definition, **sweep.settings},
        "definitions": json.loads(metadata[b"definitions"]),
        "provenance": sweep.provenance,
    }


def model_of(plan: SweepPlan) -> dict[str, Any]:
    """The one model of a sweep's machines, and how far their peak forces may be off."""
    spread = error_spread(plan.sample(ESTIMATED))
    return {
        "rung": plan.machine.rung,
        "numbers": dict(plan.machine.model_numbers),
        "told": spread.line,
        "estimated_error": spread._asdict(),
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


def calm_region_of(sweep: LabelledSweep) -> CalmRegion | None:
    """Find the calm region of a grid over speed, clearance or both.

    Returns
    -------
    CalmRegion or None
        None where the points are no such grid.
    """
    plan = sweep.plan
    fields = (plan.machine.speed_field, plan.machine.clearance_field)
    everywhere = plan.full_types == 1.0
    types = sweep.column("full_response_type" if everywhere else "response_type")
    types = np.array([kind or "undetermined" for kind in types.tolist()])
    if plan.sampling != "grid" or not set(plan.fields) <= set(fields):
        return None
    speeds, clearances = (
        np.unique(sweep.column(name)) if name in plan.fields else [getattr(plan.machine, name)] for name in fields
    )
    grid = types.reshape(sweep.shape)  # its first axis is the plan's first field
    grid = grid if plan.fields[0] == fields[0] else grid.T
    searched = searched_by(plan.machine, plan.initial_states if everywhere else 1)
    grid = grid.reshape(len(speeds), len(clearances))
    return calm_region(plan.machine, speeds, clearances, grid, searched, _settled_by(sweep))


def _settled_by(sweep: LabelledSweep) -> str:
    """What would tell the types that are unknown."""
    plan = sweep.plan
    untyped = set(sweep.column("nature")[sweep.column("response_type") == "undetermined"])
    checked = bool(plan.type_reach()) or plan.full_types == 1.0
    found = [] if checked else ["--label full-types=1, or a finer grid, checks their tolerances"]
    if None in untyped or "undetermined" in untyped:
        found.append(f"--budget {4 * plan.budget} looks longer")
    return ", and ".join(found)
