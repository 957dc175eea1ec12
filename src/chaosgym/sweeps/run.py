"""How is a sweep computed? In chunks, in parallel, each chunk kept at once, so that a stopped run goes on."""

import json
import shutil
from concurrent.futures import ThreadPoolExecutor
from os import cpu_count
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from tqdm import tqdm

from chaosgym.diagnosis import two_step_test
from chaosgym.diagnosis.type_rule import types_on_grid
from chaosgym.errors import DatasetError, SimulationError
from chaosgym.files import write_atomically
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of
from chaosgym.simulation import simulate
from chaosgym.sweeps.dataset import DATA_FILE, LabelledSweep, read_sweep, schema
from chaosgym.sweeps.plan import SweepPlan
from chaosgym.version import __version__

PLAN_FILE = "plan.json"
CHUNK_FOLDER = "chunks"
CHUNK_SIZE = 64
"""Points of a chunk: a second or two of computing."""


def label_point(machine: Machine, transient: int, cycles: int) -> dict[str, Any]:
    """Label one machine by the Two-Step Test; a run that fails is a row with status "failed"."""
    try:
        record = simulate(machine, cycles, transient=transient)
    except SimulationError as error:
        return {"status": "failed", "reason": str(error)}
    verdict = two_step_test(record)
    peaks = record.peak_force[:, 0]
    return {
        "nature": verdict.nature,
        "period": verdict.period,
        "status": "undetermined" if verdict.nature == "undetermined" else "labelled",
        "margin": verdict.margin,
        "peak_force_min": peaks.min(),
        "peak_force_max": peaks.max(),
        "peak_force_mean": peaks.mean(),
        "peak_force_std": peaks.std(),
        "impacts_per_cycle": record.impacts.sum(axis=1).mean(),
        "contact_fraction": record.contact_fraction.sum(axis=1).mean(),
        "bounce_fraction": record.bounce_duration.max() / (0.5 * machine.cycle_period),
        "reason": verdict.reason,
    }


def run_sweep(
    plan: SweepPlan, folder: str | Path, *, workers: int | None = None, progress: bool = False
) -> LabelledSweep:
    """Label every point of a plan and keep the result in a folder.

    A run that was stopped goes on where it stopped; a finished one is read. The rows do not depend on either.

    Parameters
    ----------
    plan
        What to label.
    folder
        New, empty, or holding a run of the same plan and version.
    workers
        Number of threads; all processors by default.
    progress
        Show a progress bar on standard error.

    Raises
    ------
    DatasetError
        If the folder holds anything else. Nothing in it is touched.
    """
    folder = Path(folder)
    settings = {**plan.settings(), "version": __version__}
    _claim(folder, settings)
    if (folder / DATA_FILE).exists():
        return read_sweep(folder)
    points = plan.points()
    units = {name: parameters_of(plan.machine)[name].unit for name in points}
    columns = schema(units, settings)
    starts = range(0, len(plan), CHUNK_SIZE)
    chunks = [folder / CHUNK_FOLDER / f"{start:09d}.parquet" for start in starts]

    def compute(start: int, path: Path) -> int:
        rows = range(start, min(start + CHUNK_SIZE, len(plan)))
        if not path.exists():
            labels = [label_point(machine, plan.transient, plan.cycles) for machine in plan.machines(points, rows)]
            lines = [{**{name: points[name][row] for name in points}, **label}
                     for row, label in zip(rows, labels, strict=True)]  # fmt: skip
            table = pa.Table.from_pylist(lines, schema=columns)
            write_atomically(path, lambda temporary: pq.write_table(table, temporary))
        return len(rows)

    with (
        ThreadPoolExecutor(max_workers=workers or cpu_count() or 1) as pool,
        tqdm(total=len(plan), desc="sweep", unit="point", disable=not progress, mininterval=1.0) as bar,
    ):
        for done in pool.map(compute, starts, chunks):
            bar.update(done)
    table = pa.concat_tables([pq.read_table(path, schema=columns) for path in chunks])
    table = _with_response_types(table, plan)
    write_atomically(
        folder / DATA_FILE, lambda temporary: pq.write_table(table, temporary, row_group_size=16 * CHUNK_SIZE)
    )
    shutil.rmtree(folder / CHUNK_FOLDER)
    return LabelledSweep(table, settings)


def _claim(folder: Path, settings: dict[str, Any]) -> None:
    """Make the folder this plan's, or check that it already is."""
    plan_file = folder / PLAN_FILE
    if plan_file.is_file():
        try:
            held = json.loads(plan_file.read_text())
        except ValueError as error:
            raise DatasetError(f"{plan_file} is damaged: {error}; choose another folder") from error
        if held != json.loads(json.dumps(settings)):
            differing = sorted(key for key in settings.keys() | held.keys() if settings.get(key) != held.get(key))
            raise DatasetError(
                f"{folder} holds another sweep (it differs in {', '.join(differing)}); choose another folder"
            )
    elif folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise DatasetError(f"{folder} exists and is no run of this sweep; choose another folder")
    (folder / CHUNK_FOLDER).mkdir(parents=True, exist_ok=True)
    if not plan_file.is_file():
        write_atomically(plan_file, lambda temporary: temporary.write_text(json.dumps(settings, indent=2) + "\n"))


def _with_response_types(table: pa.Table, plan: SweepPlan) -> pa.Table:
    """Fill the response types of a grid over speed and clearance from each point's neighbours."""
    reach = plan.type_reach()
    if not reach:
        return table
    fields = [axis.field for axis in plan.axes]
    natures = np.array(table.column("nature").fill_null("undetermined").to_pylist()).reshape(plan.shape)
    largest = table.column("peak_force_max").to_numpy(zero_copy_only=False).reshape(plan.shape)
    axes = [fields.index(name) for name in reach]
    types = types_on_grid(natures, largest, axes=axes, reach=list(reach.values()))
    position = table.schema.get_field_index("response_type")
    column = pa.array(types.ravel().tolist(), pa.string())
    return table.set_column(position, table.schema.field(position), column)
