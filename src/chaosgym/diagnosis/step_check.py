"""The step check: a machine judged again with finer steps, so that the verdict is the machine's and not the step's.

Touch and release that are placed wrongly by a fraction of a step add or remove energy at every impact, which turns
periodic responses into chaos and the reverse. A verdict that a finer step changes is no verdict.

Two steps may be wrong alike: both call a periodic motion chaotic. Chaos of the step shrinks with it, that of the
machine does not. So the step is refined until two successive steps agree in nature, period and exponent of chaos.

Like is compared with like: what the motion settles on with what it settles on. How long transient chaos lasts before
that depends on the last digit of the start, and so on the step; it is told beside.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from chaosgym.diagnosis.diagnose import DEFAULT_BUDGET, diagnose
from chaosgym.diagnosis.verdict import MachineDiagnosis
from chaosgym.machines import Machine
from chaosgym.plain import Result
from chaosgym.series.verdict import Diagnosis, Nature
from chaosgym.simulation import CycleRecord, Integrator

SPREAD_CHANGE = 0.05
"""Largest change of the spread of the peak force, as a share of the largest peak, that counts as none."""

EXPONENT_CHANGE = 0.2
"""Largest change of a positive exponent, as a share of the larger, that counts as none if it exceeds the errors."""

REFINEMENTS = 4
"""Most times that the step is refined."""


@dataclass(frozen=True)
class StepCheck(Result):
    """The verdicts of one machine with a given and with a finer integrator.

    Attributes
    ----------
    given, finer : MachineDiagnosis
        Verdicts; the latter with the finest step tried.
    settled
        Whether the last two steps tried agree. If not, the machine's own verdict is undetermined.
    """

    shows = "nature_stays period_stays spread_stays summary settled"

    given: MachineDiagnosis
    finer: MachineDiagnosis
    settled: bool

    @property
    def spreads(self) -> tuple[float, float]:
        """Largest minus smallest peak force [N] of the settled cycles on the worst surface, given and finer."""
        side = _settled(self.given).worst_side
        given, finer = (float(np.ptp(_settled(one).peak_force[:, side])) for one in (self.given, self.finer))
        return given, finer

    @property
    def nature_stays(self) -> bool:
        """True if both runs settle on the same nature."""
        return _end(self.given)[0] == _end(self.finer)[0]

    @property
    def period_stays(self) -> bool:
        """True if both runs have the same period."""
        return self.given.period == self.finer.period

    @property
    def spread_stays(self) -> bool:
        """True if the spread of the peak force changes by less than 5 % of the largest peak."""
        largest = max(float(_settled(one).peak_force.max()) for one in (self.given, self.finer))
        return abs(self.spreads[0] - self.spreads[1]) <= SPREAD_CHANGE * largest

    @property
    def settle_cycles(self) -> tuple[int | None, int | None]:
        """Cycles after which the motion settles, given and finer; None where it does not."""
        return self.given.settle_cycle, self.finer.settle_cycle

    @property
    def summary(self) -> str:
        """One line for people."""
        nature, period = _end(self.finer)
        finer = nature + (f" with period {period}" if period else "")
        if not self.settled:
            return f"undetermined: no two steps agree; the finest says {finer}"
        kept = "keeps" if self.nature_stays and self.period_stays else "CHANGES"
        line = (
            f"a finer step {kept} the verdict ({finer}); spread of the peak force {self.spreads[0]:.2f} N, "
            f"finer {self.spreads[1]:.2f} N"
        )
        if self.given.transient_chaos or self.finer.transient_chaos:
            before, after = self.settle_cycles
            line += f"; chaotic first, it settles after {before} cycles, finer {after}: that depends on the last digit"
        return line

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        spreads = zip(("spread_N", "finer_spread_N"), self.spreads, strict=True)
        cycles = zip(("settle_cycle", "finer_settle_cycle"), self.settle_cycles, strict=True)
        finer = {"finer_nature": _end(self.finer)[0], "finer_period": self.finer.period}
        return {**super().as_dict(), **dict(spreads), **finer, **dict(cycles)}


def _end(verdict: Diagnosis) -> tuple[Nature, int | None]:
    """Nature and period of what the motion settles on."""
    return verdict.nature, verdict.period


def _settled(verdict: MachineDiagnosis) -> CycleRecord:
    """Cycles of what the motion settles on."""
    run = verdict.run
    settle = verdict.settle_cycle if verdict.transient_chaos and verdict.settle_cycle is not None else 0
    return run.after(min(settle, len(run) - 1)) if settle > len(run) // 2 else verdict.judged


def agree(one: Diagnosis, other: Diagnosis) -> bool:
    """True if two motions settle on the same nature and period, and about the same exponent where they are chaotic."""
    if _end(one) != _end(other):
        return False
    exponents = [verdict.evidence["largest_lyapunov_exponent_per_cycle"] for verdict in (one, other)]
    values, errors = ([exponent[name] for exponent in exponents] for name in ("value", "standard_error"))
    if _end(one)[0] != "chaotic" or min(values) <= 0.0:
        return True
    return bool(abs(values[0] - values[1]) <= max(EXPONENT_CHANGE * max(values), 3.0 * np.hypot(*errors)))


def step_check(
    machine: Machine,
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
    budget, sensor_error
        As in ``diagnose``.
    integrator
        ``machine.default_integrator`` by default.

    Examples
    --------
    >>> check = chaosgym.step_check(chaosgym.ImpactBeam(excitation_frequency=12.0))
    >>> check.nature_stays, check.settled
    (True, True)
    """
    chosen = integrator or machine.default_integrator
    first = finer = diagnose(machine, budget=budget, sensor_error=sensor_error, integrator=chosen)
    for _ in range(REFINEMENTS):
        chosen = chosen.refined()
        coarser, finer = finer, diagnose(machine, budget=budget, sensor_error=sensor_error, integrator=chosen)
        if agree(coarser, finer):
            return StepCheck(first, finer, settled=True)
    return StepCheck(first, finer, settled=False)
