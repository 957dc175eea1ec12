"""What a cycle costs, and how much memory is kept, as modes, stiffness, gaps, cycles and machines grow.

One of them grows, the others are as in the headline. Times are processor time of one thread, medians of some runs.
"""

import statistics
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

from benchmarks.performance.rates import BEAM
from benchmarks.performance.timing import processor_seconds
from chaosgym import Drive, Structure
from chaosgym.core import compilation
from chaosgym.machines.modal_machine.machine_class import Joint, machine_with_joints
from chaosgym.simulation import simulate

MODES = (2, 4, 6, 8, 12, 16, 24, 32, 40)
STIFFNESS = (1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11)
GAPS = (1, 2, 3, 4, 5, 6)
CYCLES = (1, 10, 100, 1_000, 10_000, 100_000)
MACHINES = (1, 4, 16, 64, 256, 1_024)

TIMED = 300
"""Cycles of a timed run where their number does not grow."""

AT_ONCE = 10
"""Cycles of a call of a batch."""

SETTLING = 50
"""Cycles from rest before; they visit the sets of pressed surfaces."""


class Size(NamedTuple):
    """What one size makes of cost and memory.

    ``grows`` is what grows, to ``value``; ``microseconds`` are those of a cycle; ``impacts`` are those in a cycle;
    ``kept`` are bytes: of tables with modes and gaps, of the record a cycle, of the batch a machine.
    """

    grows: str
    value: float
    microseconds: float
    impacts: float
    kept: float


def sizes(repeats: int = 3) -> list[Size]:
    """Measure every size of the module's constants."""
    beams = [("modes", float(n), replace(BEAM, n_modes=n)) for n in MODES]
    beams += [("stiffness [N/m]", k, replace(BEAM, contact_stiffness=k)) for k in STIFFNESS]
    found = [_of_run(grows, value, beam, repeats, beam.structure.tables.values.nbytes) for grows, value, beam in beams]
    found += [_of_run("gaps", n, _grid(n), repeats) for n in GAPS]
    for cycles in CYCLES:
        seconds, kept = _median(partial(simulate, BEAM, cycles), repeats)
        found.append(Size("cycles", cycles, 1e6 * seconds / cycles, 0.0, kept / cycles))
    with patch.object(compilation, "THREADS", 1):
        return found + [_of_batch(count, repeats) for count in MACHINES]


def _grid(gaps: int) -> Any:
    """A cantilever of six modes with gaps of one width along it, the last one at its tip."""
    places = np.linspace(1.0, 0.4, max(GAPS))[:gaps]
    roots = np.array([1.875, 4.694, 7.855, 10.996, 14.137, 17.279])
    ratio = (np.cosh(roots) + np.cos(roots)) / (np.sinh(roots) + np.sin(roots))

    def shape(x: float) -> list[float]:
        z = roots * x
        return [float(each) for each in 2.0 * (np.cosh(z) - np.cos(z) - ratio * (np.sinh(z) - np.sin(z)))]

    shapes = {f"p{i}": shape(x) for i, x in enumerate(places.tolist())} | {"drive": shape(0.2)}
    structure = Structure.of_modes((4.0 * (roots / roots[0]) ** 2).tolist(), 0.01, shapes)
    joints = {f"gap_{i}": Joint(f"p{i}", 0.2e-3, 1e5, 10.0) for i in range(gaps)}
    return machine_with_joints(structure, joints, (Drive.sine("force", "drive", 20.0),), speed=30.0)()


def _of_run(grows: str, value: float, machine: Any, repeats: int, kept: float | None = None) -> Size:
    simulate(replace(machine, speed=2.0) if kept is None else machine, 1)  # what is imported counts for none
    tracemalloc.start()
    settled = simulate(machine, SETTLING)
    tables = tracemalloc.get_traced_memory()[0] if kept is None else kept
    tracemalloc.stop()
    run = simulate(machine, TIMED, settled.final_state)
    seconds, _ = _median(lambda: simulate(machine, TIMED, settled.final_state), repeats)
    return Size(grows, value, 1e6 * seconds / TIMED, float(run.impacts.sum()) / TIMED, tables)


def _of_batch(count: int, repeats: int) -> Size:
    tracemalloc.start()
    batch = BEAM.batch(count)
    for i in range(count):
        batch.start(i, BEAM)
    kept = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    which = np.arange(count)
    seconds, _ = _median(lambda: batch.run(which, AT_ONCE), repeats)
    return Size("machines", count, 1e6 * seconds / (AT_ONCE * count), 0.0, kept / count)


def _median(work: Callable[[], Any], repeats: int) -> tuple[float, float]:
    """Median processor time [s] of some runs, and bytes of what one returns; a first run counts for those alone."""
    tracemalloc.start()
    result = work()
    kept = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    del result
    return statistics.median(processor_seconds(work) for _ in range(repeats)), kept
