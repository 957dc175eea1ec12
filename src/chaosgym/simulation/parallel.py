"""Many at once on threads: runs of machines, or any function of many items."""

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

from tqdm import tqdm

from chaosgym.machines.integrators import Integrator
from chaosgym.machines.machine import Machine
from chaosgym.numbers import whole
from chaosgym.simulation.record import CycleRecord
from chaosgym.simulation.run import simulate


def simulate_many(
    machines: Sequence[Machine],
    cycles: int,
    *,
    transient: int = 0,
    integrator: Integrator | None = None,
    workers: int | None = None,
    progress: bool = False,
) -> list[CycleRecord]:
    """Run many machines side by side on threads: the kernels release the interpreter lock.

    Parameters
    ----------
    machines
        What to run, each from rest.
    cycles, transient, integrator
        As for ``simulate``.
    workers
        Number of threads; all processors by default.
    progress
        Show a progress bar on standard error.

    Returns
    -------
    list of CycleRecord, in the order of ``machines``.

    Examples
    --------
    >>> beams = [chaosgym.ImpactBeam(excitation_frequency=speed) for speed in (12.0, 19.0)]
    >>> [float(record.peak_force.max().round(1)) for record in chaosgym.simulate_many(beams, 20, transient=200)]
    [32.4, 28.3]
    """
    one = partial(simulate, cycles=cycles, transient=transient, integrator=integrator)
    return parallel_map(one, machines, workers=workers, progress="simulate" if progress else None)


MOST_WORKERS = 4096
"""Threads that a computation may have."""


def number_of_workers(workers: int | None) -> int:
    """Return a number of threads; all processors for None.

    Raises
    ------
    ParameterError
        If it is no whole number from 1 on.
    """
    return whole("workers", workers, 1, MOST_WORKERS) if workers is not None else os.cpu_count() or 1


def parallel_map(
    function: Callable[[Any], Any], items: Iterable[Any], *, workers: int | None = None, progress: str | None = None
) -> list[Any]:
    """Apply a function that spends its time in kernels to every item, on threads; results in order.

    ``progress`` names a progress bar on standard error; None shows none.

    Examples
    --------
    >>> from chaosgym.simulation.parallel import parallel_map
    >>> parallel_map(lambda speed: chaosgym.SliderCrank(crank_speed=speed).cycle_period, [200.0, 300.0])
    [0.3, 0.2]
    """
    items, workers = list(items), number_of_workers(workers)
    with ThreadPoolExecutor(max_workers=workers) as pool:
        results = pool.map(function, items)
        return list(tqdm(results, total=len(items), desc=progress, disable=progress is None, unit="machine"))
