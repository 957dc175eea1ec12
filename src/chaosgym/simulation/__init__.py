"""Simulation of whole operating cycles: one row of results per cycle."""

from chaosgym.machines.integrators import ExactEvents, Integrator, RungeKutta4
from chaosgym.simulation.record import CycleRecord, MotionState
from chaosgym.simulation.run import begin_state, rest_state, simulate, simulate_with_deviations

__all__ = [
    "CycleRecord",
    "ExactEvents",
    "Integrator",
    "MotionState",
    "RungeKutta4",
    "begin_state",
    "rest_state",
    "simulate",
    "simulate_with_deviations",
]
