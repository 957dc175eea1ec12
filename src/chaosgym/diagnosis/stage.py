"""What a stage of a diagnosis tells: the verdict by its run, its exponent and its orbit, and the vote of each test."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit
from chaosgym.series.exponent import LyapunovExponent, chaos_margin
from chaosgym.series.transient_chaos import CHAOTIC_STATISTIC, INITIAL_TRANSIENT
from chaosgym.series.two_step import QUASIPERIODIC_CYCLES, REGULAR_STATISTIC, irregular_start, two_step_test
from chaosgym.series.verdict import Diagnosis, Nature, Status, escape_rate
from chaosgym.simulation import CycleRecord

GROWS = 1.05
"""Ratio of the largest displacements of the last quarter and of the one before it, above which a motion grows."""


MORE = 4
"""Budgets that are suggested where chaos lasted over one."""

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
    status: Status = "agreed"
    if orbit is not None and orbit.neutral:
        reason = (
            f"period {orbit.period} closes: miss {orbit.residual:.0e}; multiplier 1: deviations neither grow nor decay"
        )
        margin = verdict.margin
    elif orbit is not None:
        reason = f"period {orbit.period} proven: miss {orbit.residual:.0e}, multiplier {orbit.largest_multiplier:.3g}"
        margin, status = 1.0 - orbit.largest_multiplier, "certified"
    elif verdict.settle_cycle is not None and stage.exponent.sign < 0:
        reason = f"{verdict.reason}; exponent {stage.exponent.per_cycle:.3g} a cycle"
        margin = verdict.margin
    else:
        return None
    if stage.linear:
        reason = f"no contact: the machine is linear, and its response periodic; {reason}"
    period = orbit.period if orbit else verdict.period
    return Diagnosis(
        nature="periodic",
        period=period,
        manner=", ".join(
            filter(None, ("without contact" * stage.linear, "neutral" * (orbit is not None and orbit.neutral)))
        ),
        margin=margin,
        transient_chaos=_transient_chaos(stage, period),
        status=status,
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


def _transient_chaos(stage: Stage, period: int | None) -> int:
    """Cycles of a motion that settles on a period for which it was chaotic, by the exponent too; 0 where it was not."""
    irregular = stage.verdict.transient_chaos
    if stage.verdict.settle_cycle is None and period is not None:
        irregular = irregular_start(stage.record, period)
    return _if_chaotic(stage, irregular)


def _if_chaotic(stage: Stage, cycles: int) -> int:
    """The first cycles of a motion if deviations grew over them and they are more than an ordinary start."""
    return cycles if cycles > INITIAL_TRANSIENT and float(np.mean(stage.growth[:cycles])) > 0.0 else 0


def without_contact(stage: Stage) -> Diagnosis:
    """Verdict on a run that does not repeat and whose last half has no contact: never chaotic, as it is linear."""
    exponent, record = stage.exponent, stage.record
    lead = "no contact: the machine is linear"
    last, before = (
        float(np.max(np.abs(part))) for part in np.split(record.displacement[-4 * (len(record) // 4) :], 4)[:1:-1]
    )
    touched = np.flatnonzero(record.peak_force.any(axis=1))
    common: dict[str, Any] = {
        "status": "agreed",
        "manner": "without contact",
        "settle_cycle": int(touched[-1]) + 1 if len(touched) else 0,
        "transient_chaos": _if_chaotic(stage, int(touched[-1]) + 1 if len(touched) else 0),
    }
    if last > GROWS * before or exponent.sign > 0:
        reason = f"{lead}, but its motion still grows after {len(record)} cycles, so that contact may come later"
        return Diagnosis(nature="undetermined", margin=0.0, status="unresolved", reason=reason, tells_more=LARGER)
    if exponent.sign < 0:
        reason = f"{lead}, and its response nears the period of the drive; exponent {exponent.per_cycle:.3g} a cycle"
        return Diagnosis(nature="periodic", period=1, margin=0.0, reason=reason, **common)
    reason = f"{lead}, and its response a sum of lines: those of the drive and of undamped modes"
    return Diagnosis(nature="quasiperiodic", margin=1.0, reason=reason, **common)


def lasting_margin(cycles: int) -> float:
    """How far chaos that did not end in so many cycles is from an ordinary start of a motion that settles.

    With 95 % confidence its mean length is a third of them at least. 0 where that is an ordinary start, 1 from a
    hundred times as long on.

    Examples
    --------
    >>> from chaosgym.diagnosis.stage import lasting_margin
    >>> [round(lasting_margin(cycles), 2) for cycles in (150, 3200, 15000)]
    [0.0, 0.66, 1.0]
    """
    return float(np.clip(0.5 * math.log10(1.0 / escape_rate(cycles) / INITIAL_TRANSIENT), 0.0, 1.0))


def not_periodic(stage: Stage) -> Diagnosis:
    """Verdict on a run that has contacts and is not known to be periodic: by its exponent, with step II."""
    verdict, exponent = stage.verdict, stage.exponent
    reason = f"exponent {exponent.per_cycle:.3g} +- {exponent.standard_error:.2g} a cycle; {verdict.reason}"
    if exponent.sign > 0 and verdict.settle_cycle is None:
        status: Status = "agreed" if verdict.nature in ("chaotic", "undetermined") else "disputed"
        cycles = len(stage.record)
        margin = min(chaos_margin(exponent.per_cycle, exponent.standard_error), lasting_margin(cycles))
        rate = escape_rate(MORE * cycles)
        more = f"a budget of {MORE * cycles} cycles: chaos that outlasts it ends at most at a rate of {rate:.1e}"
        return Diagnosis(nature="chaotic", margin=margin, status=status, reason=reason, tells_more=(more,))
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
