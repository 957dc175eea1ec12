"""The run of a sweep: in chunks, in parallel, each kept at once, so that a stopped run goes on."""

import json
import logging
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, nullcontext
from itertools import islice
from pathlib import Path
from threading import Event
from typing import Any

import pyarrow as pa
from tqdm import tqdm

from chaosgym.errors import DatasetError, UnfinishedError
from chaosgym.files import claimed, held
from chaosgym.simulation.parallel import number_of_workers
from chaosgym.sweeps.dataset import LabelledSweep, read_sweep
from chaosgym.sweeps.folder import CHUNK_FOLDER, PLAN_FILE, SWEEP, SweepFolder
from chaosgym.sweeps.label import label_rows
from chaosgym.sweeps.plan import SweepPlan, spread
from chaosgym.version import __version__

Finished = tuple[range, pa.Table]
Types = Mapping[int, dict[str, Any]]

AHEAD = 4
"""Chunks handed out for each thread of a cluster, the running ones included."""

CONNECT_SECONDS = 15


def on_threads(
    plan: SweepPlan, chunks: Iterable[range], threads: int, known: Types | None = None
) -> Iterator[Finished]:
    """Label chunks on threads of this process."""
    waiting, stop = iter(chunks), Event()
    pool = ThreadPoolExecutor(max_workers=threads)
    try:
        running = {pool.submit(label_rows, plan, rows, stop, known): rows for rows in islice(waiting, 2 * threads)}
        while running:
            done: set[Future[pa.Table]] = wait(running, return_when=FIRST_COMPLETED).done
            for future in sorted(done, key=lambda one: one.exception() is not None):  # so that an error costs no chunk
                rows = running.pop(future)
                running |= {pool.submit(label_rows, plan, rows, stop, known): rows for rows in islice(waiting, 1)}
                yield rows, future.result()
    finally:
        stop.set()  # after Ctrl-C, chunks end with the row that they are at
        pool.shutdown(cancel_futures=True)


@contextmanager
def cluster_at(scheduler: str) -> Iterator[Any]:
    """Client of a Dask scheduler.

    Raises
    ------
    DatasetError
        If Dask is not installed or no scheduler answers at the address.
    UnfinishedError
        If the cluster gives up: the scheduler is gone, or several workers were lost over one chunk.
    """
    try:
        from distributed import Client, KilledWorker
        from distributed.comm import CommClosedError
    except ImportError as error:
        raise DatasetError(f"a Dask cluster needs the extra [cluster]: {error}") from None
    try:
        client = Client(scheduler, timeout=CONNECT_SECONDS)
    except (OSError, ValueError) as error:
        raise DatasetError(f"no Dask scheduler answers at {scheduler}: {error}") from None
    for name in [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == "distributed"]:
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what they say of a lost scheduler is told in one line
    try:
        yield client
    except (KilledWorker, CommClosedError, CancelledError) as error:
        raise UnfinishedError(
            f"the cluster at {scheduler} gave up ({type(error).__name__}); finished chunks are kept: run the same "
            "command again when it is back"
        ) from None
    finally:
        client.close(timeout=CONNECT_SECONDS)


def on_cluster(plan: SweepPlan, chunks: Iterable[range], client: Any) -> Iterator[Finished]:
    """Label chunks on the workers of a Dask client, which need this version of chaosgym."""
    from distributed import as_completed

    waiting = iter(chunks)
    threads = max(1, sum(client.nthreads().values()))
    running: dict[Any, range] = {}

    def submit(count: int) -> list[Any]:
        futures = [(client.submit(label_rows, plan, rows, pure=False), rows) for rows in islice(waiting, count)]
        running.update(futures)
        return [future for future, _ in futures]

    completed = as_completed(submit(AHEAD * threads), raise_errors=False)
    for future in completed:
        for more in submit(1):
            completed.add(more)
        yield running.pop(future), future.result()


def run_sweep(
    plan: SweepPlan,
    folder: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    repair: bool = False,
    progress: bool = False,
    known: Types | None = None,
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
    known
        Types of some rows by runs of their own that need not be computed again; a cluster computes them all.

    Raises
    ------
    ParameterError
        If the number of threads is none.
    DatasetError
        If the folder holds anything else, or a damaged chunk. Nothing in it is touched.
    UnfinishedError
        If the disk is full, the cluster is lost, or another process writes into the folder. What was kept stays; the
        same call goes on.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> speeds = chaosgym.Axis("excitation_frequency", 10.0, 22.0, 3)
    >>> with TemporaryDirectory() as folder:
    ...     sweep = chaosgym.run_sweep(chaosgym.SweepPlan(chaosgym.ImpactBeam(), (speeds,)), folder)
    >>> sweep.table["nature"].to_pylist()
    ['periodic', 'periodic', 'chaotic']
    """
    threads = number_of_workers(workers)
    with (
        cluster_at(scheduler) if scheduler else nullcontext() as client,
        held(claimed(folder, PLAN_FILE, what=SWEEP), CHUNK_FOLDER),
    ):
        store = SweepFolder(folder, plan, __version__)
        missing = store.missing(repair=repair)
        missing = [missing[place] for place in spread(len(missing))]  # so that the time left follows from those done
        if missing:
            done = on_cluster(plan, missing, client) if client else on_threads(plan, missing, threads, known)
            _keep(store, missing, done, progress)
        if not store.data.is_file():
            store.finish()
    return read_sweep(folder)


def _keep(store: SweepFolder, missing: list[range], done: Iterable[tuple[range, pa.Table]], progress: bool) -> None:
    """Keep every chunk as it is done."""
    size = len(store.plan)
    first = size - sum(len(rows) for rows in missing)
    shown = {"desc": "sweep", "unit": "point", "mininterval": 1.0, "smoothing": 0.0, "disable": not progress}
    with tqdm(total=size, initial=first, **shown) as bar:
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
