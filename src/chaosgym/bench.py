"""How fast is it here? Numbers that a reader can rerun with ``chaosgym bench``."""

import statistics
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from chaosgym.core.crank_stepper import SteppedCrankModel
from chaosgym.machines import THESIS_IMPACT_BEAM, Machine
from chaosgym.machines.slider_crank import THESIS_SLIDER_CRANK
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


_BALL = {"slider_joint": "ideal", "gravity": 9.81}
_BOTH_INSTRUMENTED = {"slider_joint": "instrumented", "ball_joint": "instrumented"}

SCENES: Mapping[str, Mapping[str, Any]] = {
    "planar, slider, rigid rod": {"rod": "rigid"},
    "planar, slider": {},
    "planar, slider, friction 0.1": {"friction_coefficient": 0.1},
    "planar, instrumented slider": {"slider_joint": "instrumented"},
    "planar, spherical ball, rigid rod": {**_BALL, "ball_joint": "spherical", "rod": "rigid"},
    "planar, spherical ball": {**_BALL, "ball_joint": "spherical"},
    "planar, instrumented ball": {**_BALL, "ball_joint": "instrumented"},
    "planar, both, spherical ball": {"ball_joint": "spherical"},
    "planar, both instrumented": _BOTH_INSTRUMENTED,
    "25 deg, slider": {"motor_angle": 25.0},
    "25 deg, instrumented slider": {"motor_angle": 25.0, "slider_joint": "instrumented"},
    "25 deg, both, spherical ball, rigid rod": {"motor_angle": 25.0, "ball_joint": "spherical", "rod": "rigid"},
    "25 deg, both, spherical ball": {"motor_angle": 25.0, "ball_joint": "spherical"},
    "25 deg, both instrumented": {"motor_angle": 25.0, **_BOTH_INSTRUMENTED},
}
"""Scenes of the slider crank: fields that differ from the machine of the thesis at 200 rpm."""


@dataclass(frozen=True)
class SceneCost:
    """What a scene of the slider crank requires.

    ``scene``; ``degrees_of_freedom`` names of what is integrated; ``method`` "exact" or "Runge-Kutta"; ``setup`` [s]
    until a machine is ready that was never seen; ``revolution`` [s] to compute a settled revolution. Both are
    processor time, which other load on the computer hardly changes.
    """

    scene: str
    degrees_of_freedom: tuple[str, ...]
    method: str
    setup: float
    revolution: float


def scene_costs(revolutions: int = 10) -> list[SceneCost]:
    """Cost of every scene of ``SCENES`` at 200 rpm and matrices held over 5 deg, on one core."""
    costs = []
    for scene, settings in SCENES.items():
        crank = replace(THESIS_SLIDER_CRANK, crank_speed=200.0, matrix_update_interval=5.0, **settings)
        # compile and load first, on a machine that shares nothing with the one that is timed
        simulate(replace(crank, rod_length=0.24), 1)
        start = time.thread_time()
        model = crank.reduce()
        setup = time.thread_time() - start
        state = simulate(crank, 5).final_state
        start = time.thread_time()
        simulate(crank, revolutions, state)
        revolution = (time.thread_time() - start) / revolutions
        method = "Runge-Kutta" if isinstance(model, SteppedCrankModel) else "exact"
        costs.append(SceneCost(scene, crank.degrees_of_freedom, method, setup, revolution))
    return costs
