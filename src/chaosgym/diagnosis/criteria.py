r"""Where may chaos be expected, without any simulation? The predictive criteria of thesis 5.3.1.

Beam     clearance above 0.02 of the static tip deflection and frequency above 16 Hz at 1 % structural damping; at 8 %
         there is no chaos at 0.04 either. Between the two dampings the least clearance is interpolated.
Crank    clearance above 0.064 mm and speed above 100 rpm at 5 % contact damping; above 0.032 mm at 2.5 %. Between and
         beyond, the least clearance is taken proportional to the damping.

They say where chaos is possible, not that it occurs: periodic windows lie inside.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from chaosgym.diagnosis.response import Nature
from chaosgym.errors import DiagnosisError
from chaosgym.machines import ImpactBeam, Machine
from chaosgym.machines.impact_beam.modes import static_tip_deflection

BEAM_FREQUENCY = 16.0
"""Frequency [Hz] above which chaos was seen."""

BEAM_CLEARANCE, BEAM_CLEARANCE_DAMPED = 0.02, 0.04
"""Least dimensionless clearance at 1 % and at 8 % structural damping."""

BEAM_DAMPING, BEAM_DAMPING_HIGH = 0.01, 0.08

CRANK_SPEED = 100.0
"""Speed [rpm] above which chaos was seen."""

CRANK_CLEARANCE, CRANK_DAMPING = 0.064e-3, 0.05
"""Least clearance [m] at a contact damping ratio."""


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
    if isinstance(machine, ImpactBeam):
        share = (machine.damping_ratio - BEAM_DAMPING) / (BEAM_DAMPING_HIGH - BEAM_DAMPING)
        least = max(0.0, BEAM_CLEARANCE + share * (BEAM_CLEARANCE_DAMPED - BEAM_CLEARANCE))
        clearance = machine.clearance / static_tip_deflection(machine)
        return _criterion(
            {"clearance": (clearance, least), "frequency": (machine.excitation_frequency, BEAM_FREQUENCY)}
        )
    if machine.name == "slider-crank":
        crank: Any = machine
        least = CRANK_CLEARANCE * crank.contact_damping_ratio / CRANK_DAMPING
        return _criterion({"clearance": (crank.slider_clearance, least), "speed": (crank.crank_speed, CRANK_SPEED)})
    raise DiagnosisError(f"there is no printed criterion for {machine.name}; known: impact-beam, slider-crank")


def _criterion(values: dict[str, tuple[float, float]]) -> PredictiveCriterion:
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
