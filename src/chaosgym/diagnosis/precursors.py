"""Signs that chaos is near: criteria without any simulation (thesis 5.3.1), and precursors on a response (5.3.2).

A machine's ``chaos_thresholds`` hold the printed criteria. They do not say that chaos occurs: periodic windows lie
inside. Precursors of a periodic response are

period doubling     the period is 2, 4, 8 ...
period three        the period is a multiple of three that is no doubling: 3, 6, 12 ...
long bouncing       bouncing on a surface lasts until the end of the half cycle

How often each was right on the shipped datasets is kept in ``signs.json``; ``python -m benchmarks.sweeps.signs`` counts
anew.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import NamedTuple

import numpy as np

from chaosgym.diagnosis.verdict import MachineDiagnosis
from chaosgym.errors import DiagnosisError
from chaosgym.machines import Machine
from chaosgym.plain import Result
from chaosgym.simulation import CycleRecord


@dataclass(frozen=True)
class PredictiveCriterion:
    """Whether chaos is possible, and why.

    ``margins``: how far each quantity lies above (positive) or below its threshold, as a share of the threshold.
    """

    chaos_possible: bool
    reason: str
    margins: dict[str, float]


def predictive_criteria(machine: Machine) -> PredictiveCriterion:
    """Say whether the printed criteria expect chaos of a machine.

    Raises
    ------
    DiagnosisError
        If the thesis gives no criterion for the machine.
    """
    thresholds = machine.chaos_thresholds
    if not thresholds:
        raise DiagnosisError(f"there is no printed criterion for {machine.name}")
    return _criterion(thresholds)


def _criterion(values: Mapping[str, tuple[float, float]]) -> PredictiveCriterion:
    margins = {name: value / least - 1.0 if least > 0.0 else np.inf for name, (value, least) in values.items()}
    lacking = [name for name, margin in margins.items() if margin <= 0.0]
    if lacking:
        return PredictiveCriterion(False, f"{' and '.join(lacking)} below the threshold", margins)
    return PredictiveCriterion(True, f"{' and '.join(margins)} above the thresholds", margins)


LONG_BOUNCING = 0.5
"""Bouncing that lasts this share of a half cycle reaches its end: the rest is the flight to the other surface."""


@dataclass(frozen=True)
class Precursors:
    """Early warnings on one response; ``bounce_fraction`` is the longest bouncing in half cycles."""

    period_doubling: bool
    period_three: bool
    long_bouncing: bool
    bounce_fraction: float

    @property
    def any(self) -> bool:
        """True if there is any warning."""
        return self.period_doubling or self.period_three or self.long_bouncing


def precursors(period: int | None, bounce_fraction: float = 0.0) -> Precursors:
    """Early warnings of chaos from the period of a response and from how long it bounces.

    Parameters
    ----------
    period
        Period of a periodic response in cycles, or None.
    bounce_fraction
        Longest bouncing before sustained contact, in half cycles; ``bounce_fraction(record)`` gives it.
    """
    odd = period or 1
    doublings = 0
    while odd % 2 == 0:
        odd //= 2
        doublings += 1
    return Precursors(
        period_doubling=odd == 1 and doublings > 0,
        period_three=odd == 3,
        long_bouncing=bounce_fraction >= LONG_BOUNCING,
        bounce_fraction=float(bounce_fraction),
    )


def bounce_fraction(record: CycleRecord) -> float:
    """Longest bouncing of a record, from the first touch of a surface to its last, in half cycles."""
    return float(record.bounce_duration.max()) / (0.5 * record.machine.cycle_period)


class Rate(NamedTuple):
    """How often a sign was right on a dataset.

    ``precision``: share of the points with the sign that had chaos; ``recall``: share of the points with chaos that had
    the sign; ``points``: how many were judged. None where there was none to take a share of.
    """

    precision: float | None
    recall: float | None
    points: int


@cache
def measured_rates() -> Mapping[str, Mapping[str, Rate]]:
    """Rates by machine and by sign, as counted on the shipped datasets."""
    kept = json.loads((resources.files("chaosgym.diagnosis") / "signs.json").read_text(encoding="utf-8"))
    return {machine: {name: Rate(**rate) for name, rate in signs.items()} for machine, signs in kept.items()}


@dataclass(frozen=True)
class Sign(Result):
    """One sign of chaos on one response.

    Attributes
    ----------
    name
        "criteria" (thesis 5.3.1), "period doubling", "period three" or "long bouncing" (5.3.2).
    present
        Whether it is there.
    why
        What was found.
    rate
        How often it was right; None for a machine without a shipped dataset.
    """

    name: str
    present: bool
    why: str
    rate: Rate | None

    @property
    def line(self) -> str:
        """The sign in one line, with its precision where it is there, and with its recall where it is not."""
        printed = self.name == "criteria"
        name = "thresholds of chaos" if printed else f"sign of chaos, {self.name}"
        told = f"{name}: {'yes' if self.present else 'no'}, {self.why}"
        if self.rate is None:
            return f"{told}; how often that is right was not measured on this machine" if self.present else told
        chaos = "chaos" if printed else "chaos within the tolerances of speed and clearance"
        if self.present:
            return f"{told}; {_share(self.rate.precision)} of the dataset's points with this sign had {chaos}"
        return f"{told}; {_share(self.rate.recall)} of the dataset's points with {chaos} had this sign"


def _share(share: float | None) -> str:
    return "none" if share is None else f"{share:.0%}"


def signs_of_chaos(verdict: MachineDiagnosis) -> tuple[Sign, ...]:
    """Signs of chaos on a machine's response, with how often each was right on the dataset of its kind.

    Parameters
    ----------
    verdict
        Of ``diagnose``: it carries the run and the machine. Precursors are looked for on periodic responses only.

    Returns
    -------
    tuple of Sign
        The printed criteria, if the thesis gives any for the machine; then the precursors.

    Raises
    ------
    DiagnosisError
        If the verdict was reached on a plain series.

    Examples
    --------
    >>> from chaosgym import diagnose
    >>> from chaosgym.diagnosis import signs_of_chaos
    >>> from chaosgym.machines import ImpactBeam
    >>> verdict = diagnose(ImpactBeam(excitation_frequency=12.0))
    >>> [(sign.name, sign.present) for sign in signs_of_chaos(verdict)]
    [('criteria', False), ('period doubling', False), ('period three', False), ('long bouncing', False)]
    """
    machine = verdict.run.machine
    rates = measured_rates().get(machine.name, {})
    found = list[Sign]()
    if machine.chaos_thresholds:
        criterion = predictive_criteria(machine)
        found.append(Sign("criteria", criterion.chaos_possible, criterion.reason, rates.get("criteria")))
    if verdict.nature != "periodic":
        return tuple(found)
    early = precursors(verdict.period, bounce_fraction(verdict.judged))
    period = f"period {verdict.period}"
    cycles = early.bounce_fraction / 2.0
    bouncing = f"bounces for {cycles:.2g} cycles before it stays in contact" if cycles else "no bouncing into contact"
    for name, present, why in (
        ("period doubling", early.period_doubling, period),
        ("period three", early.period_three, period),
        ("long bouncing", early.long_bouncing, bouncing),
    ):
        found.append(Sign(name, present, why, rates.get(name)))
    return tuple(found)
