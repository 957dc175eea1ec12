"""The answer to a design brief, computed: assessment, map, life over speed, changes, and that they agree."""

import numpy as np

from chaosgym.branches.margins import margins_of
from chaosgym.design.brief import DesignBrief
from chaosgym.design.collective import assess_duty
from chaosgym.design.combination import combination
from chaosgym.design.contradictions import contradictions
from chaosgym.design.design_study import DesignStudy
from chaosgym.design.fatigue import equivalent_force_of_history
from chaosgym.design.guidelines import guidelines
from chaosgym.design.improve import improve
from chaosgym.design.peak_impacts import peak_impacts, worn_side
from chaosgym.design.surroundings import in_tolerance, map_around, suggested
from chaosgym.design.trends import (
    DIAGRAM_CYCLES,
    HISTORY_SAMPLES,
    LifeTrend,
    impacts_against,
    life_against,
)
from chaosgym.errors import DesignError
from chaosgym.machines import Machine
from chaosgym.simulation import CycleRecord, simulate

TREND_POINTS = 53
"""Speeds of the life trend."""


def study(brief: DesignBrief, *, seed: int = 0, workers: int | None = None, progress: bool = False) -> DesignStudy:
    """Answer a design brief.

    Parameters
    ----------
    brief
        What is asked.
    seed
        Of the series and the bootstrap.
    workers
        Number of threads; all processors by default.
    progress
        Show progress bars on standard error.

    Raises
    ------
    ParameterError
        If a tolerance leads out of its field's range.
    SimulationError
        If a run of the nominal machine or its series can't be finished.
    DesignError
        If the study contradicts itself, see ``contradictions``.
    """
    machine = brief.machine
    around = map_around(brief, workers, progress)
    assessment = assess_duty(
        machine,
        brief.region,
        brief.criteria,
        brief.duty,
        series_size=brief.series_size,
        further=in_tolerance(around),
        bending=brief.bending,
        wear=brief.wear,
        seed=seed,
        workers=workers,
        progress=progress,
    )
    trend = _life_over_speed(machine, workers, progress)
    improvement = None
    if assessment.verdict != "meets":
        improvement = improve(
            assessment,
            brief.changes,
            brief.costs,
            seeds=suggested(brief, assessment, trend, around),
            series_size=brief.series_size,
            seed=seed,
            workers=workers,
            progress=progress,
        )
    record = simulate(machine, DIAGRAM_CYCLES, transient=DIAGRAM_CYCLES, samples_per_cycle=HISTORY_SAMPLES)
    side = int(np.argmax(np.sum(record.peak_force**brief.criteria.life_exponent, axis=0)))
    answer = DesignStudy(
        brief,
        assessment,
        improvement,
        around,
        trend,
        peak_impacts(record, worn_side(record, brief.criteria.life_exponent)),
        impacts_against(machine, brief.impacts, brief.criteria.life_exponent, workers=workers),
        combination(assessment, in_tolerance(around), seed=seed, workers=workers, progress=progress),
        guidelines(assessment, in_tolerance(around)),
        margins_of(assessment.machine, assessment.response.centre, assessment.region),
        _every_impact(record, side, brief),
        seed,
    )
    if found := contradictions(answer):
        raise DesignError(f"the report contradicts itself, which is a fault of this program: {'; '.join(found)}")
    return answer


def _every_impact(record: CycleRecord, side: int, brief: DesignBrief) -> float:
    force = np.maximum(record.surface_force[:, :, side].ravel(), 0.0)
    return equivalent_force_of_history(force, len(record), brief.criteria.life_exponent)


def _life_over_speed(machine: Machine, workers: int | None, progress: bool) -> LifeTrend | None:
    low, high = machine.usual_ranges[machine.speed_field]
    nominal = getattr(machine, machine.speed_field)
    speeds = np.union1d(np.linspace(min(low, nominal), max(high, nominal), TREND_POINTS), [nominal])
    try:
        return life_against(machine, machine.speed_field, speeds, workers=workers, progress=progress)
    except DesignError:
        return None
