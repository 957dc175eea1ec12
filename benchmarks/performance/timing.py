"""Medians of repeated runs, and the time that kernels take of them."""

import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from chaosgym.core.compilation import call, call_on_threads
from chaosgym.machines import batch
from chaosgym.machines.binned import run


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
    """Processor time of this thread in the kernels that move machines, in ``seconds``.

    With ``written`` a list, what each call returned and wrote is kept in it. With ``replayed`` an iterator of such, the
    calls of an equal run write it again and move nothing: the processor's caches stay warm, and what is left is Python.
    """

    seconds = 0.0
    written: list[tuple[Any, list[NDArray[Any]]]] | None = None
    replayed: Iterator[tuple[Any, list[NDArray[Any]]]] | None = None

    def counted(self, call: Callable[..., Any]) -> Callable[..., Any]:
        """Return a way to call kernels that counts their time."""

        def counting(*arguments: Any) -> Any:
            start = time.thread_time()
            plain = self.written is None and self.replayed is None
            arrays = [] if plain else [*_writeable(arguments)]
            if self.replayed is None:
                result = call(*arguments)
            else:
                result, kept = next(self.replayed)
                for array, values in zip(arrays, kept, strict=True):
                    array[...] = values
            if self.written is not None:
                self.written.append((result, [array.copy() for array in arrays]))
            self.seconds += time.thread_time() - start
            return result

        return counting


def _writeable(given: Any) -> Iterator[NDArray[Any]]:
    """Arrays within tuples that a kernel may write."""
    if isinstance(given, np.ndarray) and given.flags.writeable:
        yield given
    elif isinstance(given, tuple):
        for one in given:
            yield from _writeable(one)


@contextmanager
def kernel_time() -> Iterator[KernelTime]:
    """Count the time of these kernels meanwhile."""
    spent = KernelTime()
    on_threads = spent.counted(call_on_threads)
    with ExitStack() as patched:
        for module in (batch, run):
            patched.enter_context(patch.object(module, "call_on_threads", on_threads))
            if hasattr(module, "call"):
                patched.enter_context(patch.object(module, "call", spent.counted(call)))
        yield spent
