"""What a stage of a diagnosis tells: the verdict by its run, its exponent and its orbit, and the vote of each test."""

from dataclasses import dataclass, replace

import numpy as np

from chaosgym.arrays import Array
from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit
from chaosgym.series.exponent import LyapunovExponent
from chaosgym.series.two_step import CHAOTIC_STATISTIC, QUASIPERIODIC_CYCLES, REGULAR_STATISTIC, two_step_test
from chaosgym.series.verdict import Diagnosis, Nature, Status
from chaosgym.simulation import CycleRecord

GROWS = 1.05
"""Ratio of the largest displacements of the last quarter and of the one before it, above which a motion grows."""


LARGER = ("a larger budget of cycles",)
"""What tells more of a run that has not settled."""


@dataclass(frozen=True)
class Stage:
    """What is known after a stage.

    ``record`` from the initial state on; ``growth`` (cycles,) logarithm of what a small deviation grew by in each
    cycle; ``verdict`` of the Two-Step Test; ``exponent`` of the last half; ``orbit`` if one is proven; ``cycles_used``,
    those of Newton's method included.
    """

    record: CycleRecord
    growth: Array
    verdict: Diagnosis
    exponent: LyapunovExponent
    orbit: PeriodicOrbit | None
    cycles_used: int

    @property
    def linear(self) -> bool:
        """True if nothing touches in the last half of the run, so that the machine was linear there."""
        return not self.record.peak_force[len(self.record) // 2 :].any()


def periodic(stage: Stage) -> Diagnosis | None:
    """The verdict if the motion is known to be periodic in the end, else None."""
    verdict, orbit = stage.verdict, stage.orbit
    if orbit is not None:
        reason = f"period {orbit.period} proven: miss {orbit.residual:.0e}, multiplier {orbit.largest_multiplier:.3g}"
        margin = 1.0 - orbit.largest_multiplier
        status: Status = "certified"
    elif verdict.settle_cycle is not None and stage.exponent.sign < 0:
        reason = f"{verdict.reason}; exponent {stage.exponent.per_cycle:.3g} a cycle"
        margin, status = verdict.margin, "agreed"
    else:
        return None
    if stage.linear:
        reason = f"no contact: the machine is linear, and its response periodic; {reason}"
    transient = _was_chaotic(stage)
    if transient:
        reason = f"transient chaos for {verdict.evidence['irregular_cycles']} cycles; then {reason}"
    return Diagnosis(
        nature="chaotic" if transient else "periodic",
        period=orbit.period if orbit else verdict.period,
        margin=margin,
        transient=transient,
        status="transient" if transient else status,
        settle_cycle=verdict.settle_cycle if verdict.settle_cycle is not None else len(stage.record),
        reason=reason,
    )


def periodic_within(stage: Stage, sensor_error: float) -> Diagnosis | None:
    """The verdict if the peak forces of the last half repeat within a sensor error, else None."""
    settled = stage.record.after(len(stage.record) // 2)
    if sensor_error == 0.0 or not np.any(settled.peak_force):
        return None
    coarse = two_step_test(settled, sensor_error=sensor_error)
    if coarse.nature != "periodic":
        return None
    return replace(
        coarse, status="agreed", reason=f"{coarse.reason} and {sensor_error:g} N; exactly, {stage.verdict.reason}"
    )


def _was_chaotic(stage: Stage) -> bool:
    """True if the irregular cycles before a recurrence were chaotic by the exponent too."""
    irregular = stage.verdict.evidence.get("irregular_cycles", 0)
    return stage.verdict.transient and float(np.mean(stage.growth[:irregular])) > 0.0


def without_contact(stage: Stage) -> Diagnosis:
    """Verdict on a run that does not repeat and whose last half has no contact: never chaotic, as it is linear."""
    exponent, record = stage.exponent, stage.record
    lead = "no contact: the machine is linear"
    last, before = (
        float(np.max(np.abs(part))) for part in np.split(record.displacement[-4 * (len(record) // 4) :], 4)[:1:-1]
    )
    if last > GROWS * before or exponent.sign > 0:
        reason = f"{lead}, but its motion still grows after {len(record)} cycles, so that contact may come later"
        return Diagnosis(nature="undetermined", margin=0.0, status="unresolved", reason=reason, tells_more=LARGER)
    if exponent.sign < 0:
        reason = f"{lead}, and its response nears the period of the drive; exponent {exponent.per_cycle:.3g} a cycle"
        return Diagnosis(nature="periodic", period=1, margin=0.0, status="agreed", reason=reason)
    reason = f"{lead}, and its response a sum of lines: those of the drive and of undamped modes"
    return Diagnosis(nature="quasiperiodic", margin=1.0, status="agreed", reason=reason)


def not_periodic(stage: Stage) -> Diagnosis:
    """Verdict on a run that has contacts and is not known to be periodic: by its exponent, with step II."""
    verdict, exponent = stage.verdict, stage.exponent
    reason = f"exponent {exponent.per_cycle:.3g} +- {exponent.standard_error:.2g} a cycle; {verdict.reason}"
    if exponent.sign > 0 and verdict.settle_cycle is None:
        margin = float(np.clip(exponent.per_cycle / (3.0 * exponent.standard_error) - 1.0, 0.0, 1.0))
        status: Status = "agreed" if verdict.nature in ("chaotic", "undetermined") else "disputed"
        return Diagnosis(nature="chaotic", margin=margin, status=status, reason=reason)
    settled = len(stage.record) - len(stage.record) // 2
    if exponent.sign == 0 and verdict.nature == "quasiperiodic" and settled >= QUASIPERIODIC_CYCLES:
        return Diagnosis(nature="quasiperiodic", margin=verdict.margin, status="agreed", reason=reason)
    if exponent.sign < 0 and verdict.nature == "periodic":
        return Diagnosis(nature="periodic", period=verdict.period, margin=0.0, status="agreed", reason=reason)
    reason = f"not settled after {len(stage.record)} cycles: {reason}"
    return Diagnosis(nature="undetermined", margin=0.0, status="unresolved", reason=reason, tells_more=LARGER)


def votes(stage: Stage) -> dict[str, Nature]:
    """What each test says by itself of what the motion does in the end."""
    by_sign: dict[int, Nature] = {1: "chaotic", -1: "periodic", 0: "undetermined"}
    repeats = stage.verdict.settle_cycle is not None
    votes: dict[str, Nature] = {
        "two_step": "periodic" if repeats else stage.verdict.nature,
        "lyapunov": by_sign[stage.exponent.sign],
    }
    statistic = stage.verdict.evidence.get("zero_one")
    if statistic is not None:
        otherwise: Nature = "quasiperiodic" if statistic < REGULAR_STATISTIC else "undetermined"
        votes["zero_one"] = "chaotic" if statistic > CHAOTIC_STATISTIC else otherwise
    votes["newton"] = "periodic" if stage.orbit is not None else "undetermined"
    return votes
