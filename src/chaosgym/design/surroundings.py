"""Types of machines around the nominal speed and clearance."""

import numpy as np

from chaosgym.design.brief import DesignBrief
from chaosgym.design.runs import DIAGNOSIS_BUDGET
from chaosgym.diagnosis import Neighbour, ResponseMap, response_map
from chaosgym.errors import ParameterError

MAP_SHARES = np.arange(-4, 5) / 2.0
"""Points of the map along speed and clearance, in tolerances."""

MIDDLE = len(MAP_SHARES) // 2
"""Place of the nominal machine along each axis of the map."""


def in_tolerance(around: ResponseMap | None) -> tuple[Neighbour, ...]:
    """Machines of the map within the tolerances of speed and clearance, but for the nominal one."""
    if around is None:
        return ()
    inside = np.flatnonzero(np.abs(MAP_SHARES) <= 1.0)
    fields = (around.machine.speed_field, around.machine.clearance_field)
    return tuple(
        Neighbour(
            dict(zip(fields, (float(MAP_SHARES[i]), float(MAP_SHARES[j])), strict=True)),
            str(around.nature[i, j]),
            float(np.nan_to_num(around.largest_peak[i, j])),
        )
        for i in inside
        for j in inside
        if MAP_SHARES[i] or MAP_SHARES[j]
    )


def map_around(brief: DesignBrief, workers: int | None, progress: bool) -> ResponseMap | None:
    """Types over speed and clearance; None where these do not vary or leave their range."""
    machine, region = brief.machine, brief.region
    for name in (machine.speed_field, machine.clearance_field):
        if name not in region or not (getattr(machine, name) or not region[name].relative):  # a share of zero is zero
            return None
    speeds, clearances = (
        [region[name].at(getattr(machine, name), share) for share in MAP_SHARES]
        for name in (machine.speed_field, machine.clearance_field)
    )
    try:
        return response_map(
            machine, speeds, clearances, region, budget=DIAGNOSIS_BUDGET, workers=workers, progress=progress
        )
    except ParameterError:
        return None
