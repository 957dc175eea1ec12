"""The step check: a machine judged again with finer steps, so that the verdict is the machine's and not the step's.

Touch and release that are placed wrongly by a fraction of a step add or remove energy at every impact, which turns
periodic responses into chaos and the reverse. A verdict that a finer step changes is no verdict.

Two steps may be wrong alike: both call a periodic motion chaotic. Chaos of the step shrinks with it, that of the
machine does not. So the step is refined until two successive steps agree in nature, period and exponent of chaos.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from chaosgym.diagnosis.diagnose import DEFAULT_BUDGET, diagnose
from chaosgym.diagnosis.response import Diagnosis
from chaosgym.machines import Machine
from chaosgym.simulation import Integrator

SPREAD_CHANGE = 0.05
"""Largest change of the spread of the peak force, as a share of the largest peak, that counts as none."""

EXPONENT_CHANGE = 0.2
"""Largest change of a positive exponent, as a share of the larger, that counts as none if it exceeds the errors."""

REFINEMENTS = 4
"""Most times that the step is refined."""


@dataclass(frozen=True)
class StepCheck:
    """The verdicts of one machine with a given and with a finer integrator.

    Attributes
    ----------
    given, finer : Diagnosis
        Verdicts; the latter with the finest step tried.
    settled
        Whether the last two steps tried agree. If not, the machine's own verdict is undetermined.
    """

    given: Diagnosis
    finer: Diagnosis
    settled: bool

    @property
    def spreads(self) -> tuple[float, float]:
        """Largest minus smallest peak force [N] of the settled cycles, given and finer."""
        given, finer = (float(np.ptp(one.judged.peak_force[:, 0])) for one in (self.given, self.finer))
        return given, finer

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
        largest = max(float(one.judged.peak_force.max()) for one in (self.given, self.finer))
        return abs(self.spreads[0] - self.spreads[1]) <= SPREAD_CHANGE * largest

    @property
    def summary(self) -> str:
        """One line for people."""
        finer = self.finer.nature + (f" with period {self.finer.period}" if self.finer.period else "")
        if not self.settled:
            return f"undetermined: no two steps agree; the finest says {finer}"
        kept = "keeps" if self.nature_stays and self.period_stays else "CHANGES"
        return (
            f"a finer step {kept} the verdict ({finer}); spread of the peak force {self.spreads[0]:.2f} N, "
            f"finer {self.spreads[1]:.2f} N"
        )

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "nature_stays": self.nature_stays,
            "period_stays": self.period_stays,
            "spread_stays": self.spread_stays,
            "spread_N": self.spreads[0],
            "finer_spread_N": self.spreads[1],
            "finer_nature": self.finer.nature,
            "finer_period": self.finer.period,
            "settled": self.settled,
            "summary": self.summary,
        }


def agree(one: Diagnosis, other: Diagnosis) -> bool:
    """True if two verdicts have the same nature and period, and about the same exponent where they are chaotic."""
    if (one.nature, one.period) != (other.nature, other.period):
        return False
    exponents = [verdict.evidence["largest_lyapunov_exponent_per_cycle"] for verdict in (one, other)]
    values, errors = ([exponent[name] for exponent in exponents] for name in ("value", "standard_error"))
    if one.nature != "chaotic" or min(values) <= 0.0:  # chaos that died out has an exponent below zero
        return True
    return bool(abs(values[0] - values[1]) <= max(EXPONENT_CHANGE * max(values), 3.0 * np.hypot(*errors)))


def step_check(
    machine: Machine,
    given: Diagnosis | None = None,
    *,
    budget: int = DEFAULT_BUDGET,
    sensor_error: float = 0.0,
    integrator: Integrator | None = None,
) -> StepCheck:
    """Judge a machine with an integrator and with ``integrator.refined()``, again refined until two steps agree.

    Parameters
    ----------
    machine
        What to judge, from rest.
    given
        Verdict with the first integrator, if it is known already.
    budget, sensor_error
        As in ``diagnose``.
    integrator
        ``machine.default_integrator`` by default.
    """
    chosen = integrator or machine.default_integrator
    given = given or diagnose(machine, budget=budget, sensor_error=sensor_error, integrator=chosen)
    finer = given
    for _ in range(REFINEMENTS):
        chosen = chosen.refined()
        coarser, finer = finer, diagnose(machine, budget=budget, sensor_error=sensor_error, integrator=chosen)
        if agree(coarser, finer):
            return StepCheck(given, finer, settled=True)
    return StepCheck(given, finer, settled=False)
