"""Types of machines around the nominal speed and clearance, and the changes that a study suggests to try."""

import numpy as np

from chaosgym.design.brief import DesignBrief
from chaosgym.design.methodology import Assessment
from chaosgym.design.runs import DIAGNOSIS_BUDGET
from chaosgym.design.trends import LifeTrend
from chaosgym.diagnosis import Neighbour, ResponseMap, response_map
from chaosgym.errors import ParameterError

MAP_SHARES = np.arange(-4, 5) / 2.0
"""Points of the map along speed and clearance, in tolerances."""

WITHIN = MAP_SHARES[np.abs(MAP_SHARES) <= 1.0]
"""Those within the tolerances."""

MAP_STARTS = 16
"""Random starts that look for other motions at each point of the map; 48 do at the nominal machine."""

MIDDLE = len(MAP_SHARES) // 2
"""Place of the nominal machine along each axis of the map."""


def in_tolerance(around: ResponseMap | None) -> tuple[Neighbour, ...]:
    """Machines of the map within the tolerances of speed and clearance, by their worst motions; not the nominal one."""
    if around is None:
        return ()
    shares = MAP_SHARES if len(around.speed) == len(MAP_SHARES) else WITHIN
    inside = np.flatnonzero(np.abs(shares) <= 1.0)
    fields = (around.machine.speed_field, around.machine.clearance_field)
    return tuple(
        Neighbour(
            dict(zip(fields, (float(shares[i]), float(shares[j])), strict=True)),
            str(around.worst_nature[i, j]),
            float(np.nan_to_num(around.worst_peak[i, j])),
        )
        for i in inside
        for j in inside
        if shares[i] or shares[j]
    )


def map_around(brief: DesignBrief, workers: int | None, progress: bool, *, within: bool = False) -> ResponseMap | None:
    """Types over speed and clearance; None where these do not vary or leave their range.

    ``within`` leaves out machines beyond the tolerances and motions beside those from rest; types mean nothing then.
    """
    machine, region = brief.machine, brief.region
    for name in (machine.speed_field, machine.clearance_field):
        if name not in region or not (getattr(machine, name) or not region[name].relative):  # a share of zero is zero
            return None
    speeds, clearances = (
        [region[name].at(getattr(machine, name), share) for share in (WITHIN if within else MAP_SHARES)]
        for name in (machine.speed_field, machine.clearance_field)
    )
    try:
        return response_map(
            machine,
            speeds,
            clearances,
            {} if within else region,
            initial_states=1 if within else MAP_STARTS,
            budget=DIAGNOSIS_BUDGET,
            workers=workers,
            progress=progress,
        )
    except ParameterError:
        return None


MOST_OF_MAP = 6
"""Places of the map that seed the search."""


def suggested(
    brief: DesignBrief, found: Assessment, trend: LifeTrend | None, around: ResponseMap | None
) -> list[dict[str, float]]:
    """Candidates for the search, of fields that may change.

    Speeds at which the trend shows no contact or enough life; places of the map without contact or of Type I, nearest
    first; and values at which the trend of the force over each tolerance reaches the required life.
    """
    machine, criteria = found.machine, found.criteria
    fields = (machine.speed_field, machine.clearance_field)
    lasts = found.evaluation.life_interval.low
    lacking = 1.0 if criteria.missing("life") or criteria.life is None else criteria.life / max(lasts, 1e-300)
    seeds = list[dict[str, float]]()
    if trend is not None and fields[0] in brief.changes:
        speeds = trend.longer_lived(getattr(machine, fields[0]), max(lacking, 1.0))
        seeds += [{fields[0]: speed} for speed in speeds]
    if around is not None and set(fields) & brief.changes.keys():
        calm = np.argwhere((around.type == "I") | (around.largest_peak == 0.0))
        calm = calm[np.argsort(np.abs(calm - MIDDLE).sum(axis=1), kind="stable")]
        places = [(float(around.speed[i]), float(around.clearance[j])) for i, j in calm]
        both = [dict(zip(fields, place, strict=True)) for place in places]
        seeds += [{name: value for name, value in one.items() if name in brief.changes} for one in both][:MOST_OF_MAP]
    needed = np.log(max(lacking, 1.0)) / criteria.life_exponent
    for name, slope in zip(found.trend.parameters, found.trend.slopes.tolist(), strict=True):
        row, nominal = brief.changes.get(name, ()), getattr(machine, name)
        if row and slope and nominal > 0.0 and abs(needed / slope) < 1e3:
            value = brief.region[name].at(nominal, -1.2 * needed / slope)
            seeds.append({name: float(np.clip(value, min(*row, nominal), max(*row, nominal)))})
    return [{name: float(f"{value:.4g}") for name, value in one.items()} for one in seeds]
