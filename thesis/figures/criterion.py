"""How often the printed criteria for chaos (thesis 5.3.1) are right, on machines whose natures are known."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from chaosgym.diagnosis import predictive_criteria
from chaosgym.errors import DiagnosisError
from chaosgym.machines import Machine
from chaosgym.series import Nature


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
