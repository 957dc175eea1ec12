"""What more threads make of a batch, and more Dask workers of a sweep: wall time, which only an idle computer shows.

Processor time of a unit tells how much the sharing itself costs, on a busy computer too; the largest memory of a worker
after a quarter of the points and after all, whether it grows.
"""

import resource
import statistics
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

from benchmarks.performance.rates import BEAM, SUB_ENVIRONMENTS
from chaosgym.core import compilation
from chaosgym.sweeps import SweepPlan, run_sweep
from chaosgym.sweeps.plan import default_axes

CYCLES = 20
"""Cycles of a timed call of a batch."""


class Share(NamedTuple):
    """Threads or workers: ``number`` of them, wall and processor time [s] of a unit, a cycle of a beam or a point.

    ``memory`` are bytes of the largest worker after a quarter of the points and after all; none of threads.
    """

    of: str
    number: int
    wall: float
    processor: float
    memory: tuple[int, ...]


def powers_of_two(most: int) -> list[int]:
    """1, 2, 4 up to a number, and that."""
    return sorted({*(2**k for k in range(most.bit_length())), most})


def thread_shares(repeats: int) -> list[Share]:
    """A batch of beams on 1, 2, 4 and up to all threads."""
    which = np.arange(SUB_ENVIRONMENTS)
    batch = BEAM.batch(len(which))
    for i in which.tolist():
        batch.start(i, BEAM.at(8.0 + 22.0 * i / len(which)))
    found, each = [], 1.0 / (CYCLES * len(which))
    for count in powers_of_two(compilation.THREADS):
        with patch.object(compilation, "THREADS", count):
            batch.run(which, CYCLES)
            runs = []
            for _ in range(repeats):
                wall, processor = time.perf_counter(), time.process_time()
                batch.run(which, CYCLES)
                runs.append((time.perf_counter() - wall, time.process_time() - processor))
            wall, processor = (statistics.median(column) * each for column in zip(*runs, strict=True))
            found.append(Share("threads", count, wall, processor, ()))
    return found


def worker_shares(points: int, counts: Iterable[int]) -> list[Share]:
    """A sweep of random points on some numbers of Dask workers of one thread each, on this computer.

    Raises
    ------
    ImportError
        Without the extra ``cluster``.
    """
    from distributed import LocalCluster

    found = []
    for count in counts:
        with (
            LocalCluster(n_workers=count, threads_per_worker=1, dashboard_address=None) as cluster,
            cluster.get_client() as client,
            tempfile.TemporaryDirectory() as folder,
        ):
            address = cluster.scheduler_address
            _sweep(4 * count, Path(folder) / "loaded", address)
            first = client.run(_used)
            wall = time.perf_counter()
            _sweep(points // 4, Path(folder) / "quarter", address)
            then = client.run(_used)
            _sweep(points - points // 4, Path(folder) / "rest", address)
            wall, last = time.perf_counter() - wall, client.run(_used)
        processor = sum(last[worker][0] - first[worker][0] for worker in last)
        memory = tuple(max(used[worker][1] for worker in used) for used in (then, last))
        found.append(Share("workers", count, wall / points, processor / points, memory))
    return found


def _sweep(points: int, folder: Path, scheduler: str) -> None:
    run_sweep(SweepPlan(BEAM, default_axes(BEAM, "random"), "random", points), folder, scheduler=scheduler)


def _used() -> tuple[float, int]:
    """Processor time [s] and largest memory [bytes] of this process."""
    used: Any = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime, 1024 * used.ru_maxrss
