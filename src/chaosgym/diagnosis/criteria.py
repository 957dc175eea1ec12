"""The predictive criteria of thesis 5.3.1: where chaos is possible, without any simulation.

A machine's ``chaos_thresholds`` hold the printed ones. They do not say that chaos occurs: periodic windows lie inside.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from chaosgym.diagnosis.response import Nature
from chaosgym.errors import DiagnosisError
from chaosgym.machines import Machine


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


@dataclass(frozen=True)
class CriterionRate:
    """Criterion against natures over a sweep.

    Attributes
    ----------
    points
        Number of points judged.
    hit_rate
        Share of chaotic points where chaos was possible.
    precision
        Share of the points where chaos was possible that are chaotic.
    quiet
        Share of the points where chaos was not possible that are periodic: what a designer relies on.
    """

    points: int
    hit_rate: float
    precision: float
    quiet: float


def criterion_rate(machines: Iterable[Machine], natures: Sequence[Nature]) -> CriterionRate:
    """Measure the criterion on machines whose natures are known; undetermined ones are left out."""
    pairs = [
        (predictive_criteria(machine).chaos_possible, nature != "periodic")
        for machine, nature in zip(machines, natures, strict=True)
        if nature != "undetermined"
    ]
    if not pairs:
        raise DiagnosisError("there is no machine with a known nature")
    possible = [chaotic for expected, chaotic in pairs if expected]
    not_possible = [chaotic for expected, chaotic in pairs if not expected]
    chaos = [expected for expected, chaotic in pairs if chaotic]
    return CriterionRate(
        points=len(pairs),
        hit_rate=float(np.mean(chaos)) if chaos else 0.0,
        precision=float(np.mean(possible)) if possible else 0.0,
        quiet=1.0 - float(np.mean(not_possible)) if not_possible else 0.0,
    )
