"""A measured record and a machine's own, laid over each other: peaks, the section of both, and both verdicts."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.diagnosis.diagnose import diagnose
from chaosgym.diagnosis.verdict import MachineDiagnosis
from chaosgym.errors import DiagnosisError
from chaosgym.machines.machine import Machine
from chaosgym.series.verdict import Diagnosis
from chaosgym.simulation import simulate

TRANSIENT = 400
"""Cycles that the machine runs before those that are compared."""


@dataclass(frozen=True)
class Overlay:
    """Two records of peak forces, one a cycle.

    Attributes
    ----------
    measured, simulated : (cycles,)
        Peak forces [N]; the simulated ones settled.
    measured_verdict, simulated_verdict
        Nature of each.
    distance
        Wasserstein distance [N] of the two: how far the peaks of one lie from those of the other on average, in order.
    """

    machine: Machine
    measured: Array
    simulated: Array
    measured_verdict: Diagnosis
    simulated_verdict: MachineDiagnosis
    distance: float

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        found = {
            "measured": (self.measured, self.measured_verdict),
            "simulated": (self.simulated, self.simulated_verdict),
        }
        told = {
            name: {
                "nature": verdict.nature,
                "period": verdict.period,
                "mean_peak_force_N": float(peaks.mean()),
                "largest_peak_force_N": float(peaks.max()),
            }
            for name, (peaks, verdict) in found.items()
        }
        share = self.distance / float(self.measured.mean()) if self.measured.any() else None
        return {"machine": self.machine.name, **told, "distance_N": self.distance, "distance_share_of_mean": share}


def overlay(machine: Machine, peaks: ArrayLike, verdict: Diagnosis, *, larger: bool = False) -> Overlay:
    """Run a machine for as many cycles as were measured, and compare.

    Parameters
    ----------
    peaks : (cycles,)
        Measured peak force of each cycle [N].
    verdict
        On the measured record.
    larger
        Compare with the larger side of each cycle, as the peaks of a series are taken; by default with the first side.

    Raises
    ------
    DiagnosisError
        If fewer than two cycles were measured.
    SimulationError
        If the machine can't be simulated.
    """
    from scipy.stats import wasserstein_distance

    measured = np.asarray(peaks, dtype=float)
    if measured.ndim != 1 or len(measured) < 2:
        raise DiagnosisError(f"an overlay needs the peaks of two cycles or more, not {measured.size}")
    forces = simulate(machine, len(measured), transient=TRANSIENT).peak_force
    simulated = forces.max(axis=1) if larger else machine.sensed(forces)
    distance = float(wasserstein_distance(measured, simulated))
    return Overlay(machine, measured, simulated, verdict, diagnose(machine), distance)
