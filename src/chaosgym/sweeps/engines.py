"""Places where chunks of a sweep are computed: threads of this process, or the workers of a Dask cluster.

Both yield finished chunks in any order and hand out only a few ahead, so that a sweep of any size takes little memory.
Threads suffice on one machine: the kernels release the interpreter's lock. Dask gives the chunks of a lost worker to
another one.
"""

from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from itertools import islice
from os import cpu_count
from threading import Event
from typing import Any

import pyarrow as pa

from chaosgym.errors import DatasetError, UnfinishedError
from chaosgym.sweeps.label import label_rows
from chaosgym.sweeps.plan import SweepPlan

Finished = tuple[range, pa.Table]

AHEAD = 4
"""Chunks handed out for each thread of a cluster, the running ones included."""

CONNECT_SECONDS = 15


def on_threads(plan: SweepPlan, chunks: Iterable[range], workers: int | None = None) -> Iterator[Finished]:
    """Label chunks on threads of this process, one a processor by default."""
    threads = workers or cpu_count() or 1
    waiting, stop = iter(chunks), Event()
    pool = ThreadPoolExecutor(max_workers=threads)
    try:
        running = {pool.submit(label_rows, plan, rows, stop): rows for rows in islice(waiting, 2 * threads)}
        while running:
            done: set[Future[pa.Table]] = wait(running, return_when=FIRST_COMPLETED).done
            for future in done:
                rows = running.pop(future)
                running |= {pool.submit(label_rows, plan, rows, stop): rows for rows in islice(waiting, 1)}
                yield rows, future.result()
    finally:
        stop.set()  # after Ctrl-C, chunks end with the row that they are at
        pool.shutdown(cancel_futures=True)


def on_cluster(plan: SweepPlan, chunks: Iterable[range], scheduler: str) -> Iterator[Finished]:
    """Label chunks on the workers of a Dask scheduler, which need this version of chaosgym.

    Raises
    ------
    DatasetError
        If Dask is not installed or no scheduler answers at the address.
    UnfinishedError
        If the cluster gives up: the scheduler is gone, or several workers were lost over one chunk.
    """
    try:
        from distributed import Client, KilledWorker, as_completed
        from distributed.comm import CommClosedError
    except ImportError as error:
        raise DatasetError(f"--scheduler needs the extra [cluster]: {error}") from None
    try:
        client = Client(scheduler, timeout=CONNECT_SECONDS)
    except (OSError, ValueError) as error:
        raise DatasetError(f"no Dask scheduler answers at {scheduler}: {error}") from None
    with client:
        waiting = iter(chunks)
        threads = max(1, sum(client.nthreads().values()))
        running: dict[Any, range] = {}

        def submit(count: int) -> list[Any]:
            futures = [(client.submit(label_rows, plan, rows, pure=False), rows) for rows in islice(waiting, count)]
            running.update(futures)
            return [future for future, _ in futures]

        try:
            completed = as_completed(submit(AHEAD * threads), raise_errors=False)
            for future in completed:
                for more in submit(1):
                    completed.add(more)
                yield running.pop(future), future.result()
        except (KilledWorker, CommClosedError, OSError) as error:
            raise UnfinishedError(f"the cluster at {scheduler} gave up: {error}") from None
