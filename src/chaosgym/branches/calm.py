"""The calm region along a field: sweep points of a bifurcation diagram that are of Type I."""

import math

import numpy as np

from chaosgym.branches.bifurcation_diagram import BifurcationDiagram, SweepPoint
from chaosgym.diagnosis.attractors import most_unseen
from chaosgym.diagnosis.calm_region import CalmRegion, calm_region, random_starts
from chaosgym.diagnosis.response_type import default_tolerances
from chaosgym.diagnosis.type_rule import UNSETTLED, Coexisting, Neighbour, judge_type


def calm_along(diagram: BifurcationDiagram) -> CalmRegion | None:
    """Judge each point of a sweep along speed or clearance by all motions there, and by its neighbours on the sweep.

    Returns
    -------
    CalmRegion or None
        None along another field. Where the steps of the sweep are wider than the tolerance of the field, a point that
        repeats is of unknown type.
    """
    machine, field, points = diagram.machine, diagram.field, diagram.sweep
    across, up = machine.speed_field, machine.clearance_field
    if field not in (across, up) or len(points) < 2:
        return None
    middle = (len(points) - 1) // 2
    tolerance = default_tolerances(machine)[field]
    reach = tolerance.steps(points[middle].value, points[middle + 1].value)
    met = [_motions(diagram, point) for point in points]
    types = np.array([_type(met, at, reach, field) for at in range(len(points))])
    values = [point.value for point in points]
    starts = f"rest and {random_starts(points[0].starts)} lead to" if points[0].starts else "rest leads to"
    searched = f"by all motions that {starts}, and by the stable orbits of the branches"
    settled = "`chaosgym diagnose` with a larger --budget there"
    if not reach:
        wide = tolerance.at(values[middle], 1.0) - values[middle]
        count = math.ceil((values[-1] - values[0]) / wide) + 1 if wide else 0
        settled = "the steps are wider than the tolerance"
        settled += f"; {count} values (FIELD=LOW:HIGH:COUNT) would tell" if count else ""
    if field == across:
        return calm_region(machine, values, [getattr(machine, up)], types[:, None], searched, settled)
    return calm_region(machine, [getattr(machine, across)], values, types[None, :], searched, settled)


def _motions(diagram: BifurcationDiagram, point: SweepPoint) -> list[Coexisting]:
    """The motion from rest, then all others: those that random starts met, the stable orbits, and what is unsettled."""
    first = Coexisting(point.nature, float(np.max(point.peaks, initial=0.0)))
    if point.motions:
        lost = point.unseen > most_unseen(0, point.starts)
        others = [Coexisting(one.nature, one.largest_peak) for one in point.motions[1:]]
        return [first, *others, *([Coexisting(UNSETTLED, float("nan"))] if lost else [])]
    runs = [run for branch in diagram.branches for run in branch.stretches]
    return [first, *(Coexisting("periodic", peak) for run in runs for peak in run.peaks_at(point.value))]


def _type(met: list[list[Coexisting]], at: int, reach: int, field: str) -> str:
    """Type of a point; of a neighbour the motion of the largest force counts, since a change may lead to it.

    Without a neighbour in reach, only what the point does by itself can be told.
    """
    around = []
    for other in range(max(0, at - reach), min(len(met), at + reach + 1)):
        if other != at:
            settled = [one for one in met[other] if one.nature != UNSETTLED] or met[other]
            worst = max(settled, key=lambda one: (one.nature != "periodic", one.largest_peak))
            around.append(Neighbour({field: float(other - at)}, worst.nature, worst.largest_peak))
    kind = judge_type(met[at][0].nature, met[at][0].largest_peak, around, met[at][1:])[0]
    return kind if reach or kind == "III" else "undetermined"
