"""How fast is it here? Numbers that a reader can rerun with ``chaosgym bench``.

Processor time of the thread counts, so that what else runs on the computer hardly matters.
"""

import statistics
import time
from dataclasses import replace

import numpy as np

from chaosgym.machines import THESIS_IMPACT_BEAM, THESIS_SLIDER_CRANK, Machine, SliderCrank
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


def beam_benchmark(repeats: int = 5) -> dict[str, float]:
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


def crank_benchmark(repeats: int = 5) -> dict[str, float]:
    """Microseconds per revolution of the slider crank at 200 rpm: planar, flexible rod, clearance at the slider.

    Each figure is the median of ``repeats`` timed runs of 100 settled revolutions on one core.
    """
    result = {}
    for clearance in (0.032e-3, 0.254e-3):
        for interval in (1.0, 5.0):
            crank = replace(
                THESIS_SLIDER_CRANK, crank_speed=200.0, slider_clearance=clearance, matrix_update_interval=interval
            )
            times = [timed_run(crank, 100, transient=30)[1] for _ in range(repeats)]
            result[f"200 rpm, {1e3 * clearance:g} mm, bins of {interval:g} deg"] = 1e6 * statistics.median(times)
    return result


def crank_set_up_benchmark(repeats: int = 5) -> dict[str, float]:
    """Microseconds to make the slider crank ready to run with bins of 1 and 5 deg, medians of 5 ``repeats``.

    A new machine differs in more than speed and clearance; its first speed is included.
    """
    result = {}
    changes = range(1, 5 * repeats + 1)
    for interval in (1.0, 5.0):
        crank = replace(THESIS_SLIDER_CRANK, matrix_update_interval=interval)
        machines = {
            "new machine": [replace(crank, yoke_mass=0.16 + 1e-6 * k) for k in changes],
            "new speed": [replace(crank, crank_speed=200.0 + 1e-3 * k) for k in changes],
            "speed seen before": [replace(crank, slider_clearance=1e-6 * k) for k in changes],
        }
        crank.reduce()
        for name, each in machines.items():
            result[f"{name}, bins of {interval:g} deg"] = 1e6 * statistics.median(map(_time_to_reduce, each))
    return result


def _time_to_reduce(crank: SliderCrank) -> float:
    start = time.thread_time()
    crank.reduce()
    return time.thread_time() - start


def benchmark(repeats: int = 5) -> dict[str, dict[str, float]]:
    """All figures of this module, by kind."""
    return {
        "impact_beam_microseconds_per_cycle": beam_benchmark(repeats),
        "slider_crank_microseconds_per_cycle": crank_benchmark(repeats),
        "slider_crank_set_up_microseconds": crank_set_up_benchmark(repeats),
    }
