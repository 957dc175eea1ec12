"""The calm region over the ranges of the sliders, found row by row while the page works.

A row is one clearance at many speeds, a tolerance apart. Each point is typed over the tolerances of speed and clearance
by runs from rest; where these say Type I, random starts and the motions of the speed below look for other motions. The
row of the machine's own clearance comes first, then clearances from the smallest up, until one is not of Type I at
every speed.
"""

from collections.abc import Generator, Iterator

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.diagnosis import CalmRegion, MachineDiagnosis, attractors, calm_region, default_tolerances, diagnose
from chaosgym.diagnosis.attractor import Attractor
from chaosgym.diagnosis.calm_region import random_starts
from chaosgym.diagnosis.response_type import coexisting
from chaosgym.diagnosis.type_rule import judge_type, types_on_grid
from chaosgym.errors import DiagnosisError, SimulationError
from chaosgym.explore.point import BUDGET, Slider
from chaosgym.machines import Machine
from chaosgym.series.verdict import Type

STARTS = 16
"""Random starts at each point of it."""

CLEARANCES = 6
"""Clearances over the range of the slider, besides the machine's own."""

MOST_STEPS = 80
"""Steps of one tolerance up and down from the machine's own speed, at the most."""

SEARCHED = (
    f"by runs from rest over its tolerances, and at the point by {random_starts(STARTS)} and the motions of the speed "
    "below"
)
"""How far is looked at each point."""

BESIDE = (-1.0, 0.0, 1.0)
"""Clearances of a row, in tolerances."""

Types = NDArray[np.str_]


def calm_search(machine: Machine, speed: Slider, clearance: Slider) -> Iterator[CalmRegion | None]:
    """Find the calm region of the ranges of two sliders.

    Yields
    ------
    CalmRegion or None
        None after each run; the region so far after each row.

    Examples
    --------
    >>> from chaosgym.explore.point import sliders_of
    >>> speed, clearance, _ = sliders_of(chaosgym.ImpactBeam())
    >>> found = calm_search(chaosgym.ImpactBeam(), speed._replace(low=8.5, high=9.5), clearance)
    >>> region = next(region for region in found if region)
    >>> [(round(low, 2), round(high, 2)) for low, high in region.ranges]
    [(8.79, 9.33)]
    """
    speeds = _speeds(machine, speed)
    own = float(getattr(machine, machine.clearance_field))
    rows = {own: (yield from _row(machine, speeds, own, whole=True))}
    yield _region(machine, speeds, rows)
    for value in np.linspace(clearance.low, clearance.high, CLEARANCES).tolist():
        if value not in rows:
            rows[value] = yield from _row(machine, speeds, value, whole=False)
            yield _region(machine, speeds, rows)
        if (rows[value] != "I").any():
            return


def _region(machine: Machine, speeds: Array, rows: dict[float, Types]) -> CalmRegion:
    return calm_region(machine, speeds, list(rows), np.column_stack(list(rows.values())), SEARCHED)


def _speeds(machine: Machine, slider: Slider) -> Array:
    """Speeds of the slider, a tolerance apart, the machine's own among them."""
    own, tolerance = float(getattr(machine, machine.speed_field)), default_tolerances(machine)[machine.speed_field]
    steps = np.unique([tolerance.at(own, share) for share in range(-MOST_STEPS, MOST_STEPS + 1)])
    return steps[(slider.low <= steps) & (steps <= slider.high)]


def _row(machine: Machine, speeds: Array, clearance: float, whole: bool) -> Generator[None, None, Types]:
    """Types (n_speeds,) at a clearance; unless ``whole``, left undetermined beyond the first that is not I."""
    tolerance = default_tolerances(machine)[machine.clearance_field]
    nature, peak = (
        np.full((len(speeds), len(BESIDE)), "undetermined", dtype="<U13"),
        np.zeros((len(speeds), len(BESIDE))),
    )
    types, found = np.full(len(speeds), "undetermined"), np.full(len(speeds), "undetermined")
    below: tuple[Attractor, ...] = ()
    for i, speed in enumerate(speeds.tolist()):
        for j, share in enumerate(BESIDE):
            verdict = _run(machine.at(speed, tolerance.at(clearance, share)))
            if verdict is not None:
                nature[i, j], peak[i, j] = verdict.nature, float(verdict.evidence["largest_peak"])
            yield None
            if share == 0.0:
                found[i], below = _with_others(machine.at(speed, clearance), verdict, below)
                # for the points beside it the motion that matters most counts: a change of the speed may lead to it
                for one in below:
                    if (one.nature != "periodic", one.largest_peak) > (nature[i, j] != "periodic", peak[i, j]):
                        nature[i, j], peak[i, j] = one.nature, one.largest_peak
                yield None
        types[: i + 1] = types_on_grid(nature[: i + 1], peak[: i + 1], reach=1)[:, 1]
        types = np.where((types == "I") | (types == "II") & (found == "III"), found, types)
        if not whole and (types[:i] != "I").any():
            types[i:] = "undetermined"
            break
    return types


def _run(machine: Machine) -> MachineDiagnosis | None:
    try:
        return diagnose(machine, budget=BUDGET)
    except (DiagnosisError, SimulationError):
        return None


def _with_others(
    machine: Machine, verdict: MachineDiagnosis | None, below: tuple[Attractor, ...]
) -> tuple[Type, tuple[Attractor, ...]]:
    """Type of a point by its own motions alone, and these; ``below`` are those of the speed below."""
    if verdict is None or verdict.nature != "periodic":
        return "undetermined", ()
    states = {f"motion {number} of the speed below": one.state for number, one in enumerate(below, 1)}
    met = attractors(machine, starts=STARTS, budget=BUDGET, centre=verdict, states=states)
    kind, _ = judge_type("periodic", float(verdict.evidence["largest_peak"]), (), coexisting(met, verdict))
    return kind, met.motions
