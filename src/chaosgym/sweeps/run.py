"""The run of a sweep: in chunks, in parallel, each kept at once, so that a stopped run goes on."""

import json
from collections.abc import Iterable
from pathlib import Path

import pyarrow as pa
from tqdm import tqdm

from chaosgym.errors import DatasetError
from chaosgym.files import held
from chaosgym.sweeps.dataset import LabelledSweep, read_sweep
from chaosgym.sweeps.engines import on_cluster, on_threads
from chaosgym.sweeps.folder import SweepFolder, claimed
from chaosgym.sweeps.label import label_rows
from chaosgym.sweeps.plan import SweepPlan
from chaosgym.version import __version__


def run_sweep(
    plan: SweepPlan,
    folder: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    repair: bool = False,
    progress: bool = False,
) -> LabelledSweep:
    """Label every point of a plan and keep the result in a folder.

    A run that was stopped goes on where it stopped; a finished one is read. The rows do not depend on either, nor on
    where they are computed.

    Parameters
    ----------
    plan
        What to label.
    folder
        New, empty, or holding a run of the same plan and version.
    workers
        Number of threads; all processors by default.
    scheduler
        Address of a Dask scheduler whose workers compute instead, such as "tcp://host:8786".
    repair
        Compute damaged chunks again, rather than name them and stop.
    progress
        Show a progress bar on standard error.

    Raises
    ------
    DatasetError
        If the folder holds anything else, or a damaged chunk. Nothing in it is touched.
    UnfinishedError
        If the disk is full, the cluster is lost, or another process writes into the folder. What was kept stays; the
        same call goes on.
    """
    with held(claimed(folder)):
        store = SweepFolder(folder, plan, __version__)
        missing = store.missing(repair=repair)
        if missing:
            done = on_cluster(plan, missing, scheduler) if scheduler else on_threads(plan, missing, workers)
            _keep(store, missing, done, progress)
        if not store.data.is_file():
            store.finish()
    return read_sweep(folder)


def _keep(store: SweepFolder, missing: list[range], done: Iterable[tuple[range, pa.Table]], progress: bool) -> None:
    """Keep every chunk as it is done."""
    size = len(store.plan)
    first = size - sum(len(rows) for rows in missing)
    with tqdm(total=size, initial=first, desc="sweep", unit="point", disable=not progress, mininterval=1.0) as bar:
        for rows, table in done:
            _check_version(table)
            store.keep(rows, table)
            bar.update(len(rows))


def _check_version(table: pa.Table) -> None:
    """Refuse rows of a cluster that runs another version."""
    used = json.loads(table.schema.metadata[b"chaosgym"])["provenance"]["chaosgym"]
    if used != __version__:
        raise DatasetError(f"the cluster's workers run chaosgym {used}; allowed: {__version__}, as here")


def relabel(sweep: LabelledSweep, rows: Iterable[int]) -> pa.Table:
    """Compute some rows of a sweep again, all but the response types that rest on neighbours."""
    plan = sweep.plan
    return pa.concat_tables([label_rows(plan, range(row, row + 1)) for row in rows])
