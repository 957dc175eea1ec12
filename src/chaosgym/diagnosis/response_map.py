"""Response types over speed and clearance."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.arrays import Array
from chaosgym.diagnosis.attractors import attractors
from chaosgym.diagnosis.calm_region import CalmRegion, calm_region, searched_by
from chaosgym.diagnosis.carried import carried_over
from chaosgym.diagnosis.diagnose import checked_run, diagnose
from chaosgym.diagnosis.response_type import (
    FEWEST_STARTS,
    Tolerance,
    check_initial_states,
    chosen_tolerances,
    coexisting,
    define,
    region_points,
)
from chaosgym.diagnosis.type_rule import UNSETTLED, Coexisting, Neighbour, judge_type
from chaosgym.diagnosis.verdict import MachineDiagnosis
from chaosgym.errors import DiagnosisError, SimulationError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.plain import Result
from chaosgym.simulation.parallel import parallel_map

Place = tuple[float, float]
"""Speed and clearance."""


@dataclass(frozen=True, kw_only=True)
class ResponseMap(Result):
    """Types over speed and clearance.

    Attributes
    ----------
    machine
        Base machine.
    speed : (n_speeds,)
        In the unit of the machine's speed field.
    clearance : (n_clearances,)
        [m].
    type, nature : (n_speeds, n_clearances) of str
        Type over the neighbourhood, and nature at the point.
    largest_peak : (n_speeds, n_clearances)
        [N].
    worst_nature, worst_peak : (n_speeds, n_clearances)
        Nature and largest peak [N] of that motion at the point which matters most: chaos, else the largest force.
    runs
        Number of machines that were run; without sharing it would be 25 times the number of points.
    definition
        Window, statistic and initial states.
    """

    shows = "speed clearance type largest_peak calm"

    machine: Machine
    speed: Array
    clearance: Array
    type: NDArray[np.str_]
    nature: NDArray[np.str_]
    largest_peak: Array
    worst_nature: NDArray[np.str_]
    worst_peak: Array
    runs: int
    definition: Mapping[str, Any]

    @property
    def calm(self) -> CalmRegion:
        """Where the map is of Type I: the largest clearance for all its speeds, and calm speeds."""
        searched = searched_by(self.machine, self.definition["initial_states"])
        settled = "`chaosgym diagnose` with a larger --budget there"
        return calm_region(self.machine, self.speed, self.clearance, self.type, searched, settled)


def geometric_grid(low: float, high: float, tolerance: Tolerance, points_per_tolerance: int = 2) -> Array:
    """Grid from ``low`` to at most ``high`` on which neighbourhoods share their points.

    Successive values are half a tolerance apart; fewer ``points_per_tolerance`` than 2 do not share all.

    Examples
    --------
    >>> from chaosgym.diagnosis import Tolerance
    >>> chaosgym.diagnosis.geometric_grid(10.0, 10.3, Tolerance(0.02)).round(3)
    array([10. , 10.1, 10.2])
    """
    share = 1.0 / points_per_tolerance
    values = [low]
    while values[-1] < high:
        values.append(tolerance.at(low, share * len(values)))
    return np.array(values[:-1] if values[-1] > high * (1.0 + 1e-9) else values)


def response_map(
    machine: Machine,
    speeds: ArrayLike,
    clearances: ArrayLike,
    tolerances: Mapping[str, Tolerance] | None = None,
    *,
    initial_states: int = 1,
    budget: int = 1600,
    sensor_error: float = 0.0,
    workers: int | None = None,
    progress: bool = False,
) -> ResponseMap:
    """Types over a grid of speeds and clearances, in the two-parameter window.

    Machines that several neighbourhoods need are run once; on a ``geometric_grid`` that is nearly all of them.

    Parameters
    ----------
    machine
        Base machine.
    speeds, clearances : (n_speeds,), (n_clearances,)
        In the fields' units.
    tolerances, initial_states, budget, sensor_error, workers
        As for ``response_type``. One initial state by default: more can't be shared. Of 16 or more, states are carried
        along all speeds of a clearance at once, and a neighbour counts by its motion of the largest force.
    progress
        Show a progress bar on standard error.

    Examples
    --------
    >>> beam = chaosgym.ImpactBeam()
    >>> found = chaosgym.response_map(beam, speeds=[10.0, 19.0], clearances=[1e-4])
    >>> found.type
    array([['I'],
           ['III']], dtype='<U12')
    """
    allowed = chosen_tolerances(machine, tolerances, "speed-clearance")
    check_initial_states(initial_states)
    budget, sensor_error = checked_run(budget, sensor_error)
    speed, clearance = np.asarray(speeds, dtype=float), np.asarray(clearances, dtype=float)
    fields = (machine.speed_field, machine.clearance_field)
    shape = (len(speed), len(clearance))
    centres = {at: _place(float(speed[at[0]]), float(clearance[at[1]])) for at in np.ndindex(shape)}
    points = region_points(machine, allowed)
    around = {at: [_moved(place, fields, allowed, one) for one in points] for at, place in centres.items()}
    places = list(dict.fromkeys([*centres.values(), *(place for near in around.values() for place in near)]))

    def at_place(place: Place) -> Machine:
        return with_settings(machine, dict(zip(fields, place, strict=True)))

    def judge(place: Place) -> MachineDiagnosis | None:
        try:
            return diagnose(at_place(place), budget=budget, sensor_error=sensor_error)
        except (DiagnosisError, SimulationError):
            return None

    verdicts = parallel_map(judge, places, workers=workers, progress="map" if progress else None)
    runs = dict(zip(places, verdicts, strict=True))
    others = _others(at_place, centres.values(), runs, initial_states, budget, workers)
    types, natures, worst = (np.full(shape, "undetermined") for _ in range(3))
    peaks, worst_peaks = np.full(shape, np.nan), np.full(shape, np.nan)
    for at, place in centres.items():
        centre = runs[place]
        if centre is None:
            continue
        natures[at], peaks[at] = centre.nature, centre.evidence["largest_peak"]
        neighbours = [
            _neighbour(one, runs[near], others.get(near, ())) for one, near in zip(points, around[at], strict=True)
        ]
        _, worst[at], worst_peaks[at] = _neighbour({}, centre, others.get(place, ()))
        types[at] = judge_type(centre.nature, float(peaks[at]), neighbours, others.get(place, ()))[0]
    return ResponseMap(
        machine=machine,
        speed=speed,
        clearance=clearance,
        type=types,
        nature=natures,
        largest_peak=peaks,
        worst_nature=worst,
        worst_peak=worst_peaks,
        runs=len(places),
        definition=define(allowed, "speed-clearance", "rest", initial_states, budget, sensor_error),
    )


def _place(speed: float, clearance: float) -> Place:
    """Speed and clearance to eleven digits: machines that differ beyond are the same."""
    return float(f"{speed:.10e}"), float(f"{clearance:.10e}")


def _moved(
    place: Place, fields: tuple[str, str], tolerances: Mapping[str, Tolerance], shares: Mapping[str, float]
) -> Place:
    """Return the place that deviates from another by shares of the tolerances."""
    speed, clearance = (
        tolerances[name].at(value, shares[name]) if name in shares else value
        for name, value in zip(fields, place, strict=True)
    )
    return _place(speed, clearance)


def _others(
    at_place: Callable[[Place], Machine],
    centres: Iterable[Place],
    runs: Mapping[Place, MachineDiagnosis | None],
    initial_states: int,
    budget: int,
    workers: int | None,
) -> dict[Place, tuple[Coexisting, ...]]:
    """The other motions at each periodic centre; states are carried along all speeds of a clearance at once."""
    periodic = [(place, run) for place in centres if (run := runs[place]) is not None and run.nature == "periodic"]
    if initial_states == 1 or not periodic:
        return {}
    random = initial_states if initial_states >= FEWEST_STARTS else 0
    speeds: dict[float, list[float]] = {}
    for (speed, clearance), _ in periodic if random else ():
        speeds.setdefault(clearance, []).append(speed)
    rows = parallel_map(
        lambda row: carried_over(at_place((row[1][0], row[0])), row[1]), list(speeds.items()), workers=workers
    )
    carried = dict(zip(speeds, rows, strict=True))

    def beside(one: tuple[Place, MachineDiagnosis]) -> tuple[Coexisting, ...]:
        (speed, clearance), centre = one
        states = carried[clearance][speed] if random else None
        machine = at_place((speed, clearance))
        found = attractors(machine, starts=random, budget=budget, centre=centre, states=states, workers=1)
        return coexisting(found, centre)

    found = parallel_map(beside, periodic, workers=workers)
    return dict(zip((place for place, _ in periodic), found, strict=True))


def _neighbour(shares: Mapping[str, float], run: MachineDiagnosis | None, others: Sequence[Coexisting]) -> Neighbour:
    """A point of the region by its motion that matters most: a change of the parameters may lead to any of them."""
    if run is None:
        return Neighbour(shares, "undetermined", np.nan)
    own = Coexisting(run.nature, run.evidence["largest_peak"])
    settled = (one for one in (own, *others) if one is own or one.nature != UNSETTLED)
    return Neighbour(shares, *max(settled, key=lambda one: (one.nature != "periodic", one.largest_peak)))
