"""Whole operating cycles in, one row of results per cycle out."""

from chaosgym.simulation.integrators import ExactEvents, Integrator, RungeKutta4, default_integrator
from chaosgym.simulation.record import CycleRecord, MotionState
from chaosgym.simulation.run import (
    batch_arrays,
    parallel_map,
    rest_state,
    simulate,
    simulate_many,
    simulate_with_deviations,
)

__all__ = [
    "CycleRecord",
    "ExactEvents",
    "Integrator",
    "MotionState",
    "RungeKutta4",
    "batch_arrays",
    "default_integrator",
    "parallel_map",
    "rest_state",
    "simulate",
    "simulate_many",
    "simulate_with_deviations",
]
