"""Does the verdict belong to the machine or to the integrator? Run again with a finer step and compare.

Touch and release that are placed wrongly by a fraction of a step add or remove energy at every impact, which turns
periodic responses into chaos and the reverse. A verdict that a finer step changes is no verdict.
"""

from dataclasses import dataclass
from typing import Any

from chaosgym.diagnosis.response import Diagnosis
from chaosgym.diagnosis.two_step import two_step_test
from chaosgym.machines import Machine
from chaosgym.simulation import CycleRecord, Integrator, simulate

SPREAD_CHANGE = 0.05
"""Largest change of the spread of the peak force, as a share of the largest peak, that counts as none."""


@dataclass(frozen=True)
class StepCheck:
    """The verdicts of one machine with a given and with a finer integrator.

    Attributes
    ----------
    given, finer : Diagnosis
        Verdicts.
    spread, finer_spread : float
        Largest minus smallest peak force of the judged cycles [N].
    largest : float
        Largest peak force [N] of either run.
    """

    given: Diagnosis
    finer: Diagnosis
    spread: float
    finer_spread: float
    largest: float

    @property
    def nature_stays(self) -> bool:
        """True if both runs have the same nature."""
        return self.given.nature == self.finer.nature

    @property
    def period_stays(self) -> bool:
        """True if both runs have the same period."""
        return self.given.period == self.finer.period

    @property
    def spread_stays(self) -> bool:
        """True if the spread of the peak force changes by less than 5 % of the largest peak."""
        return abs(self.spread - self.finer_spread) <= SPREAD_CHANGE * self.largest

    @property
    def summary(self) -> str:
        """One line for people."""
        finer = self.finer.nature + (f" with period {self.finer.period}" if self.finer.period else "")
        kept = "keeps" if self.nature_stays and self.period_stays else "CHANGES"
        return (
            f"a finer step {kept} the verdict ({finer}); spread of the peak force {self.spread:.2f} N, "
            f"finer {self.finer_spread:.2f} N"
        )

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "nature_stays": self.nature_stays,
            "period_stays": self.period_stays,
            "spread_stays": self.spread_stays,
            "spread_N": self.spread,
            "finer_spread_N": self.finer_spread,
            "finer_nature": self.finer.nature,
            "finer_period": self.finer.period,
            "summary": self.summary,
        }


def step_check(
    machine: Machine, *, cycles: int = 200, transient: int = 200, integrator: Integrator | None = None
) -> StepCheck:
    """Judge a machine with an integrator and with ``integrator.refined()``.

    Parameters
    ----------
    machine
        What to judge, from rest.
    cycles, transient
        Cycles to judge, and to run before.
    integrator
        ``machine.default_integrator`` by default.
    """
    chosen = integrator or machine.default_integrator
    given = simulate(machine, cycles, transient=transient, integrator=chosen)
    finer = simulate(machine, cycles, transient=transient, integrator=chosen.refined())
    return StepCheck(
        two_step_test(given),
        two_step_test(finer),
        _spread(given),
        _spread(finer),
        float(max(given.peak_force.max(), finer.peak_force.max())),
    )


def _spread(record: CycleRecord) -> float:
    return float(record.peak_force[:, 0].max() - record.peak_force[:, 0].min())
