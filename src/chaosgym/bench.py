"""How fast is it here? Numbers that a reader can rerun with ``chaosgym bench``."""

import statistics
import time
from dataclasses import replace
from typing import Any

import numpy as np

from chaosgym.machines import THESIS_IMPACT_BEAM, Machine
from chaosgym.simulation import CycleRecord, ExactEvents, Integrator, RungeKutta4, simulate

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
        Median computing time over blocks of the run; loading the compiled kernels is not counted.
    """
    simulate(machine, 1, integrator=integrator)
    state = simulate(machine, transient, integrator=integrator).final_state if transient else None
    record: CycleRecord | None = None
    seconds = []
    for block in np.array_split(np.arange(cycles), min(BLOCKS, cycles)):
        start = time.perf_counter()
        part = simulate(machine, len(block), state, integrator=integrator)
        seconds.append((time.perf_counter() - start) / len(block))
        record = part if record is None else record.followed_by(part)
        state = part.final_state
    assert record is not None
    return record, statistics.median(seconds)


def benchmark(repeats: int = 5) -> dict[str, Any]:
    """Microseconds per operating cycle of the impact beam at the points that the documentation quotes.

    Each figure is the median of ``repeats`` timed runs of 300 settled cycles on one core.
    """
    points: dict[str, tuple[float, float, Integrator]] = {
        "30 Hz, 0.127 mm, exact": (30.0, 0.127e-3, ExactEvents()),
        "30 Hz, 0.032 mm, exact": (30.0, 0.032e-3, ExactEvents()),
        "19 Hz, 0.127 mm, exact": (19.0, 0.127e-3, ExactEvents()),
        "10 Hz, 0.127 mm, exact": (10.0, 0.127e-3, ExactEvents()),
        "30 Hz, 0.127 mm, Runge-Kutta 4, 4000 steps": (30.0, 0.127e-3, RungeKutta4(4000)),
    }
    result = {}
    for name, (frequency, clearance, integrator) in points.items():
        beam = replace(THESIS_IMPACT_BEAM, excitation_frequency=frequency, clearance=clearance)
        times = [timed_run(beam, 300, transient=50, integrator=integrator)[1] for _ in range(repeats)]
        result[name] = 1e6 * statistics.median(times)
    return result
