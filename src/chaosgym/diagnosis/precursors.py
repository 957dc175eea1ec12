"""Signs that chaos is near: criteria without any simulation (thesis 5.3.1), and precursors on a response (5.3.2).

A machine's ``chaos_thresholds`` hold the printed criteria. They do not say that chaos occurs: periodic windows lie
inside. Precursors of a periodic response are

period doubling     the period is 2, 4, 8 ...
period three        the period is a multiple of three that is no doubling: 3, 6, 12 ...
long bouncing       bouncing on a surface lasts until the end of the half cycle
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from chaosgym.errors import DiagnosisError
from chaosgym.machines import Machine
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
