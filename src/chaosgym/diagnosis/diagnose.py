"""What kind of response has this machine? Runs it in stages, each twice as long, until the verdict is sure."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.diagnosis.response import Diagnosis
from chaosgym.diagnosis.two_step import two_step_test
from chaosgym.machines import Machine
from chaosgym.simulation import Integrator, MotionState, simulate

FIRST_STAGE = 100
"""Cycles of the first stage."""


def diagnose(
    machine: Machine,
    *,
    initial_state: MotionState | ArrayLike | None = None,
    budget: int = 3200,
    integrator: Integrator | None = None,
) -> Diagnosis:
    """Tell the nature of a machine's response."""
    record = simulate(machine, FIRST_STAGE, initial_state, integrator=integrator)
    while True:
        verdict = two_step_test(record)
        if (verdict.nature == "periodic" and verdict.settle_cycle is not None) or 2 * len(record) > budget:
            break
        more = simulate(machine, len(record), record.final_state, integrator=integrator)
        record = record.followed_by(more)
    evidence = dict(verdict.evidence)
    settled = max(len(record) // 2, verdict.settle_cycle or 0)
    evidence["largest_peak"] = float(np.max(record.peak_force[settled:]))
    evidence["final_state"] = [float(value) for value in record.final_state.coordinates]
    return replace(verdict, evidence=evidence, horizon=len(record))
