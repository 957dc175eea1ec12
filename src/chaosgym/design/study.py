"""The answer to a design brief, computed: assessment, map, life over speed, changes.

It comes with statements that contradict the machines of its own; there should be none.
"""

import numpy as np

from chaosgym.branches.coexistence import Coexistence, coexistence
from chaosgym.branches.margins import margins_of
from chaosgym.design.bearing import hours_of
from chaosgym.design.brief import DesignBrief
from chaosgym.design.collective import assess_duty
from chaosgym.design.combination import BASE, RECORDED, TRANSIENT, combination
from chaosgym.design.design_study import DesignStudy
from chaosgym.design.fatigue import equivalent_force_of_history
from chaosgym.design.guidelines import CASES, guidelines
from chaosgym.design.improve import MOST_VERIFIED, REFINEMENTS, improve
from chaosgym.design.methodology import Assessment
from chaosgym.design.peak_impacts import peak_impacts, worn_side
from chaosgym.design.runs import DIAGNOSIS_BUDGET, NOMINAL_BUDGET, SERIES_CYCLES
from chaosgym.design.surroundings import MAP_SHARES, MIDDLE, WITHIN, in_tolerance, map_around, suggested
from chaosgym.design.trends import DIAGRAM_CYCLES, HISTORY_SAMPLES, LifeTrend, impacts_against, life_against
from chaosgym.diagnosis.response_type import region_points
from chaosgym.diagnosis.type_rule import FORCE_CHANGE
from chaosgym.errors import DesignError
from chaosgym.machines import Machine
from chaosgym.simulation import CycleRecord, simulate

TREND_POINTS = 53
"""Speeds of the life trend."""


def study(
    brief: DesignBrief,
    *,
    verdict_only: bool = False,
    seed: int = 0,
    workers: int | None = None,
    progress: bool = False,
) -> DesignStudy:
    """Answer a design brief.

    Parameters
    ----------
    brief
        What is asked.
    verdict_only
        Leave out what takes long: ``design_study.LEFT_OUT``. Motions beside that from rest then count at the nominal
        machine alone, so the verdict can be milder than that of the whole study.
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
    around = map_around(brief, workers, progress, within=verdict_only)
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
    trend = None if verdict_only else _life_over_speed(machine, workers, progress)
    improvement = None
    if assessment.verdict != "meets" and not verdict_only:
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
        None if verdict_only else around,
        trend,
        peak_impacts(record, worn_side(record, brief.criteria.life_exponent)),
        impacts_against(machine, brief.impacts, brief.criteria.life_exponent, workers=workers),
        combination(
            assessment,
            in_tolerance(around),
            base=0 if verdict_only else BASE,
            seed=seed,
            workers=workers,
            progress=progress,
        ),
        guidelines(assessment, in_tolerance(around)),
        None if verdict_only else margins_of(assessment.machine, assessment.response.centre, assessment.region),
        None if verdict_only else _beside(assessment, workers),
        _every_impact(record, side, brief),
        seed,
        verdict_only,
    )
    if found := contradictions(answer):
        raise DesignError(f"the report contradicts itself, which is a fault of this program: {'; '.join(found)}")
    return answer


def most_cycles(brief: DesignBrief, *, verdict_only: bool = False) -> int:
    """Cycles that a study takes where no machine is periodic; most take fewer.

    Examples
    --------
    >>> from chaosgym.design.brief import brief_from
    >>> from chaosgym.design.study import most_cycles
    >>> brief = brief_from({"machine": "impact-beam"})
    >>> most_cycles(brief, verdict_only=True) < 0.1 * most_cycles(brief)
    True
    """
    around = len(region_points(brief.machine, brief.region)) * DIAGNOSIS_BUDGET
    series = brief.series_size * (DIAGNOSIS_BUDGET + SERIES_CYCLES)
    assessed = max(1, len(brief.duty)) * (2 * NOMINAL_BUDGET + series + around)
    if verdict_only:
        return assessed + len(WITHIN) ** 2 * DIAGNOSIS_BUDGET
    grid = (len(MAP_SHARES) + len(WITHIN)) ** 2 + TREND_POINTS
    changes = sum(len(values) for values in brief.changes.values())
    changes += MOST_VERIFIED + REFINEMENTS if changes and brief.criteria.asked else 0
    indices = BASE * (2 + len(brief.region)) * (TRANSIENT + RECORDED)
    return (1 + changes) * assessed + grid * DIAGNOSIS_BUDGET + indices


def _beside(assessment: Assessment, workers: int | None) -> Coexistence | None:
    found = assessment.response.attractors
    if found is None or len(found.motions) == 1:
        return None
    return coexistence(assessment.machine, assessment.response.centre, found, workers=workers)


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


def contradictions(answer: DesignStudy) -> list[str]:
    """Statements of a study that contradict its own machines; none of a study that ``study`` returns.

    The type is held against every machine of the series, of the neighbourhood and of the map within the tolerances,
    the largest force against theirs, the verdict against its checks, the change that suffices against its own, criteria
    of bending and wear against what was found of these, the case of 5.5.1 against the natures found, and map and life
    over speed against the nominal machine.
    """
    found, trend = answer.assessment, answer.life_over_speed
    region = [(one.nature, one.largest_peak) for one in (*found.series.built, *in_tolerance(answer.map))]
    region += [(point.nature, point.largest_peak) for point in found.response.neighbours]
    said = []
    if found.type == "I" and any(nature != "periodic" for nature, _ in region):
        said.append("Type I, with machines in the tolerances that are not periodic")
    largest = max([found.nominal.largest_peak, *(peak for _, peak in region)])
    if found.type == "I" and largest > (1.0 + FORCE_CHANGE) * found.response.largest_peak:
        said.append(f"Type I, with {largest:.4g} N in the tolerances and {found.response.largest_peak:.4g} N nominally")
    if found.type in ("I", "II") and found.evaluation.largest_force < largest * (1.0 - 1e-9):
        said.append(f"largest peak {found.evaluation.largest_force:.4g} N, with {largest:.4g} N in the tolerances")
    met = bool(found.checks) and all(check.met for check in found.checks)
    if (found.verdict == "meets") != ("undetermined" not in found.types and met):
        said.append(f"the verdict {found.verdict!r} does not follow from type and checks")
    said += _of_parts(found)
    best = None if answer.improvement is None else answer.improvement.best
    if best is not None and not (best.meets and all(check.met for check in best.assessment.checks)):
        said.append(f"the change {best.told} is called sufficient, and misses a criterion")
    natures = {nature for nature, _ in region} | {found.nominal.nature}
    for one in answer.guidelines:
        denied = {CASES["I"]: natures != {"periodic"}, CASES["II throughout"]: "periodic" in natures}
        said += [f"{case}, with {natures}" for case, no in denied.items() if no and case in one.sentence]
    elsewhere: dict[str, str] = {"the response type": found.response.centre.nature}
    if answer.map is not None:
        elsewhere["the map"] = str(answer.map.nature[MIDDLE, MIDDLE])
    if trend is not None:
        at = np.flatnonzero(trend.values == getattr(found.machine, trend.field))
        elsewhere["life over speed"] = trend.nature[int(at[0])] if len(at) else "undetermined"
    for where, nature in elsewhere.items():
        if nature != found.nominal.nature and "undetermined" not in (nature, found.nominal.nature):
            said.append(f"the nominal machine is {found.nominal.nature}, and {nature} in {where}")
    return said


def _of_parts(found: Assessment) -> list[str]:
    """Criteria of the flexible part and of wear that are not what was found of these."""
    lives = dict[str, float]()
    if found.criteria.life is None:
        return []
    if found.bending is not None:
        lives["bending life"] = min(found.bending.lives) / found.bending.bending.uncertainty
    if found.wear is not None:
        hours = found.wear.course[-1].hours / found.wear.wear.uncertainty
        lives["wear life"] = hours / hours_of(1.0, found.cycle_period)
    reached = {check.name: check.reached for check in found.checks}
    return [
        f"the {name} is {life:.4g} million cycles, and its criterion is of {reached.get(name, 0.0):.4g}"
        for name, life in lives.items()
        if not np.isclose(life, reached.get(name, -1.0), rtol=1e-9)
    ]
