"""Statements of a design study that contradict its own machines."""

import numpy as np

from chaosgym.design.bearing import hours_of
from chaosgym.design.design_study import DesignStudy
from chaosgym.design.methodology import Assessment
from chaosgym.design.surroundings import MIDDLE, in_tolerance
from chaosgym.diagnosis.type_rule import FORCE_CHANGE


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
        denied = {"Case I:": natures != {"periodic"}, "Case II throughout:": "periodic" in natures}
        said += [f"{case} {natures} in the tolerances" for case, no in denied.items() if no and case in one.sentence]
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
