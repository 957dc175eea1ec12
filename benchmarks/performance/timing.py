"""Medians of repeated runs, and the time that kernels take of them."""

import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

from chaosgym.core.compilation import call, call_side_by_side
from chaosgym.machines import Machine, batch
from chaosgym.machines.binned import run
from chaosgym.simulation import CycleRecord, Integrator, simulate

BLOCKS = 5
"""A timed run is cut into this many blocks, whose median counts."""


def timed_run(
    machine: Machine, cycles: int, *, transient: int = 0, integrator: Integrator | None = None
) -> tuple[CycleRecord, float]:
    """Simulate from rest and time it.

    Returns
    -------
    record : CycleRecord
        Equal to that of ``simulate(machine, cycles, transient=transient)``.
    seconds_per_cycle : float
        Median processor time over blocks of the run; loading the compiled kernels is not counted.
    """
    simulate(machine, 1, integrator=integrator)
    state = simulate(machine, transient, integrator=integrator).final_state if transient else None
    record: CycleRecord | None = None
    seconds = []
    for block in np.array_split(np.arange(cycles), min(BLOCKS, cycles)):
        start = time.thread_time()
        part = simulate(machine, len(block), state, integrator=integrator)
        seconds.append((time.thread_time() - start) / len(block))
        record = part if record is None else record.followed_by(part)
        state = part.final_state
    assert record is not None
    return record, statistics.median(seconds)


class Rate(NamedTuple):
    """Units of work per second of the wall clock, and per second of processor time of all threads together."""

    per_second: float
    per_processor_second: float


def rate(work: Callable[[], int], repeats: int) -> Rate:
    """Median rates of some runs of ``work``, which returns how many units it did; a first run is not counted."""
    work()
    rates = []
    for _ in range(repeats):
        wall, processor = time.perf_counter(), time.process_time()
        done = work()
        rates.append((done / (time.perf_counter() - wall), done / (time.process_time() - processor)))
    return Rate(*(statistics.median(column) for column in zip(*rates, strict=True)))


def processor_seconds(work: Callable[[], object]) -> float:
    """Processor time [s] of a piece of work, on all threads together."""
    start = time.process_time()
    work()
    return time.process_time() - start


class KernelTime:
    """Processor time of this thread in the kernels that move machines, in ``seconds``."""

    seconds = 0.0

    def counted(self, call: Callable[..., Any]) -> Callable[..., Any]:
        """Return a way to call kernels that counts their time."""

        def counting(*arguments: Any) -> Any:
            start = time.thread_time()
            result = call(*arguments)
            self.seconds += time.thread_time() - start
            return result

        return counting


@contextmanager
def kernel_time() -> Iterator[KernelTime]:
    """Count the time of these kernels meanwhile."""
    spent = KernelTime()
    side_by_side = spent.counted(call_side_by_side)
    with ExitStack() as patched:
        for module in (batch, run):
            patched.enter_context(patch.object(module, "call_side_by_side", side_by_side))
            if hasattr(module, "call"):
                patched.enter_context(patch.object(module, "call", spent.counted(call)))
        yield spent
