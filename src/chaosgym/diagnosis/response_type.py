r"""What may a designer rely on? Types I, II and III of a response over a tolerance neighbourhood (thesis 5.5).

The machine is run at its nominal parameters and, one parameter at a time, at two points on either side of them: half
the tolerance and all of it, each from rest. The statistic is the largest peak force of the settled cycles.

    III           the centre is not periodic; or points that are not periodic lie on both sides along one parameter;
                  or attractors that coexist at the centre have largest peaks more than 10 % apart
    II            otherwise, if some point exceeds the centre's largest peak by 10 % or is not periodic
    I             the rest
    undetermined  if the centre is

A point that is undetermined is not known to be periodic, and counts as not periodic. Window, statistic and rule of
initial states are part of the label: ``type_stability`` counts how many labels change with them.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.diagnosis.diagnose import diagnose
from chaosgym.diagnosis.response import Diagnosis, Nature, Type
from chaosgym.errors import DiagnosisError, SimulationError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of, with_settings
from chaosgym.simulation import MotionState, parallel_map, rest_state

Array = NDArray[np.float64]
Window = Literal["parameters", "speed-clearance"]
Start = Literal["rest", "continuation"]

FORCE_CHANGE = 0.10
"""Change of the largest peak force that matters: a quarter of the fatigue life (thesis 5.5.2)."""

SHARES = (-1.0, -0.5, 0.5, 1.0)
"""Points of the neighbourhood along one parameter, in tolerances."""


class Tolerance(NamedTuple):
    """Tolerance of one parameter: ``value`` in its unit, or as a share of its nominal value if ``relative``."""

    value: float
    relative: bool = True

    def at(self, nominal: float, share: float) -> float:
        """The parameter's value at a share, -1 to 1, of the tolerance.

        Relative tolerances are ratios, so that the points of a grid in geometric progression are neighbours.
        """
        return nominal * (1.0 + self.value) ** share if self.relative else nominal + share * self.value


def default_tolerances(machine: Machine) -> dict[str, Tolerance]:
    """Tolerances of a machine's speed, clearance, length and dampings.

    Speed +-2 % of a frequency, +-10 rpm of a rotation (thesis 5.5.2); clearance +-5 %; lengths +-0.1 %; every damping
    +-10 %.
    """
    known = parameters_of(machine)
    rotates = known[machine.speed_field].unit == "rpm"
    tolerances = {
        machine.speed_field: Tolerance(10.0, relative=False) if rotates else Tolerance(0.02),
        machine.clearance_field: Tolerance(0.05),
    }
    for name in known:
        if name in ("length", "rod_length"):
            tolerances[name] = Tolerance(0.001)
        elif "damping" in name and not known[name].choices and getattr(machine, name) > 0.0:
            tolerances[name] = Tolerance(0.10)
    return tolerances


class Neighbour(NamedTuple):
    """One point of the neighbourhood: along which parameter, on which side (-1 or +1), and what it does."""

    parameter: str
    side: int
    nature: Nature
    largest_peak: float


@dataclass(frozen=True, kw_only=True)
class ResponseType:
    """The type of a response over its neighbourhood.

    Attributes
    ----------
    type
        "I", "II", "III" or "undetermined".
    reason
        One sentence for people.
    centre
        Verdict on the nominal machine.
    largest_peak
        Largest peak force of its settled cycles, both sides [N].
    neighbours
        What each point of the neighbourhood does; empty if the centre decides alone.
    coexisting_peaks
        Largest peak from each of the other initial states at the centre [N].
    definition
        Window, statistic and initial states: part of the label. Plain values.
    """

    type: Type
    reason: str
    centre: Diagnosis
    largest_peak: float
    neighbours: tuple[Neighbour, ...]
    coexisting_peaks: tuple[float, ...]
    definition: Mapping[str, Any]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "type": self.type,
            "reason": self.reason,
            "centre": self.centre.as_dict(),
            "largest_peak": self.largest_peak,
            "neighbours": [neighbour._asdict() for neighbour in self.neighbours],
            "coexisting_peaks": list(self.coexisting_peaks),
            "definition": dict(self.definition),
        }


def judge_type(
    nature: Nature, largest_peak: float, neighbours: Iterable[Neighbour], coexisting_peaks: Sequence[float] = ()
) -> tuple[Type, str]:
    """Type of a response and its reason, from what the centre and its neighbourhood do.

    Parameters
    ----------
    nature, largest_peak
        Of the centre; the peak force in any unit.
    neighbours
        Points of the neighbourhood.
    coexisting_peaks
        Largest peaks at the centre from other initial states.
    """
    neighbours = list(neighbours)
    if nature == "undetermined":
        return "undetermined", "the nominal response is undetermined"
    if nature != "periodic":
        return "III", f"the nominal response is {nature}"
    for peak in coexisting_peaks:
        if abs(peak - largest_peak) > FORCE_CHANGE * min(peak, largest_peak):
            return "III", f"another initial state leads to {peak:.3g} N instead of {largest_peak:.3g} N"
    restless = [point for point in neighbours if point.nature != "periodic"]
    for name in dict.fromkeys(point.parameter for point in restless):
        if len({point.side for point in restless if point.parameter == name}) == 2:
            return "III", f"not periodic on both sides along {name}"
    if restless:
        first = restless[0]
        return "II", f"{first.nature} {'above' if first.side > 0 else 'below'} the nominal {first.parameter}"
    for point in neighbours:
        if point.largest_peak > (1.0 + FORCE_CHANGE) * largest_peak:
            more = point.largest_peak / largest_peak - 1.0 if largest_peak > 0.0 else np.inf
            side = "above" if point.side > 0 else "below"
            return "II", f"peak force {more:.0%} higher {side} the nominal {point.parameter}"
    return "I", "periodic throughout the neighbourhood, peak force less than 10 % higher"


def types_on_grid(
    natures: ArrayLike, largest_peaks: ArrayLike, axes: Sequence[int] | None = None, reach: Sequence[int] | int = 2
) -> NDArray[np.str_]:
    """Types of all points of a grid whose neighbours are the points of the grid up to ``reach`` steps away.

    Parameters
    ----------
    natures : (...) of str
        Nature at each point.
    largest_peaks : (...)
        Largest peak force at each point.
    axes
        Axes along which tolerances lie; all by default. At the border neighbours of one side are missing.
    reach
        Steps of the grid in one tolerance, for all of ``axes`` or for each.

    Returns
    -------
    array of "I", "II", "III" or "undetermined", of the same shape.
    """
    nature, peak = np.asarray(natures, dtype=object), np.asarray(largest_peaks, dtype=float)
    if nature.shape != peak.shape:
        raise DiagnosisError(f"natures have shape {nature.shape} and peaks {peak.shape}; allowed: the same shape")
    chosen = range(nature.ndim) if axes is None else axes
    reaches = [reach] * len(chosen) if isinstance(reach, int) else reach
    types = np.empty(nature.shape, dtype="<U12")
    for index in np.ndindex(nature.shape):
        neighbours = []
        for axis, far in zip(chosen, reaches, strict=True):
            for step in (*range(-far, 0), *range(1, far + 1)):
                place = index[axis] + step
                if 0 <= place < nature.shape[axis]:
                    at = (*index[:axis], place, *index[axis + 1 :])
                    neighbours.append(Neighbour(f"axis {axis}", int(np.sign(step)), nature[at], float(peak[at])))
        types[index] = judge_type(cast(Nature, nature[index]), float(peak[index]), neighbours)[0]
    return types


def response_type(
    machine: Machine,
    tolerances: Mapping[str, Tolerance] | None = None,
    *,
    window: Window = "parameters",
    start: Start = "rest",
    initial_states: int = 3,
    budget: int = 1600,
    workers: int | None = None,
) -> ResponseType:
    """Type of a machine's response over its tolerance neighbourhood.

    Parameters
    ----------
    machine
        The nominal machine.
    tolerances
        By field; ``default_tolerances(machine)`` by default.
    window
        "parameters" varies every field that has a tolerance; "speed-clearance" varies these two only, which is what
        maps and datasets use.
    start
        Where the runs of the neighbourhood start: at rest, or in the state that the centre ended in.
    initial_states
        How many initial states look for coexisting attractors at the centre, 1 to 3: rest; the mirror image of the
        state that rest leads to; half that state.
    budget
        Cycles that each run may take.
    workers
        Number of threads; all processors by default.

    Raises
    ------
    ParameterError
        If a tolerance names no field, or leads out of the field's range.
    DiagnosisError
        If ``window``, ``start`` or ``initial_states`` is not allowed.
    SimulationError
        If a run can't be finished.
    """
    allowed = _tolerances_of(machine, tolerances, window)
    _check_initial_states(initial_states)
    if start not in ("rest", "continuation"):
        raise DiagnosisError(f"start = {start!r} is not one of 'rest', 'continuation'")
    centre = diagnose(machine, budget=budget)
    origin = centre.evidence["final_state"] if start == "continuation" else None
    neighbours: tuple[Neighbour, ...] = ()
    coexisting: tuple[float, ...] = ()
    if centre.nature == "periodic":
        points = _points(machine, allowed)
        runs = parallel_map(
            lambda point: diagnose(point[2], initial_state=origin, budget=budget), points, workers=workers
        )
        neighbours = tuple(_neighbour(name, side, run) for (name, side, _), run in zip(points, runs, strict=True))
        coexisting = _coexisting_peaks(machine, centre, initial_states, budget)
    kind, reason = judge_type(centre.nature, centre.evidence["largest_peak"], neighbours, coexisting)
    return ResponseType(
        type=kind, reason=reason, centre=centre, largest_peak=centre.evidence["largest_peak"], neighbours=neighbours,
        coexisting_peaks=coexisting, definition=_definition(allowed, window, start, initial_states, budget),
    )  # fmt: skip


def _points(machine: Machine, tolerances: Mapping[str, Tolerance]) -> list[tuple[str, int, Machine]]:
    """(parameter, side, machine) of every point of the neighbourhood."""
    return [
        (name, int(np.sign(share)), with_settings(machine, {name: tolerance.at(getattr(machine, name), share)}))
        for name, tolerance in tolerances.items()
        for share in SHARES
    ]


def _tolerances_of(
    machine: Machine, tolerances: Mapping[str, Tolerance] | None, window: Window
) -> dict[str, Tolerance]:
    if window not in ("parameters", "speed-clearance"):
        raise DiagnosisError(f"window = {window!r} is not one of 'parameters', 'speed-clearance'")
    given = default_tolerances(machine) if tolerances is None else dict(tolerances)
    for name in given:
        with_settings(machine, {name: getattr(machine, name, 0.0)})
    if window == "parameters":
        return given
    return {name: given[name] for name in (machine.speed_field, machine.clearance_field) if name in given}


def _check_initial_states(initial_states: int) -> None:
    if initial_states not in (1, 2, 3):
        raise DiagnosisError(f"initial_states = {initial_states!r} is out of range; allowed: 1, 2 or 3")


def _coexisting_peaks(machine: Machine, centre: Diagnosis, initial_states: int, budget: int) -> tuple[float, ...]:
    rest = rest_state(machine)
    reached = np.asarray(centre.evidence["final_state"])
    return tuple(
        diagnose(machine, initial_state=MotionState(share * reached, rest.bouncing), budget=budget).evidence[
            "largest_peak"
        ]
        for share in (-1.0, 0.5)[: initial_states - 1]
    )


def _definition(
    tolerances: Mapping[str, Tolerance], window: Window, start: Start, initial_states: int, budget: int
) -> dict[str, Any]:
    return {
        "window": window,
        "tolerances": {name: tolerance._asdict() for name, tolerance in tolerances.items()},
        "shares": list(SHARES),
        "statistic": "largest peak force of the settled cycles, both sides",
        "force_change": FORCE_CHANGE,
        "initial_states": initial_states,
        "start": start,
        "budget": budget,
    }


def type_stability(
    machines: Sequence[Machine], *, budget: int = 800, workers: int | None = None, progress: bool = False
) -> dict[str, float]:
    """Share of type labels that change with the definition, over machines.

    Parameters
    ----------
    machines
        What to label, in the two-parameter window.
    budget, workers, progress
        As for ``response_map``.

    Returns
    -------
    dict
        "window x 0.5" and "window x 2.5" (frequency +-1 % and +-5 % instead of +-2 %), "continuation" (runs of the
        neighbourhood start where the centre ended) and "one initial state" (no search for coexisting attractors).
    """

    def labels(machine: Machine) -> list[Type]:
        given = default_tolerances(machine)
        half, wide = ({name: t._replace(value=f * t.value) for name, t in given.items()} for f in (0.5, 2.5))
        variants: list[dict[str, Any]] = [
            {}, {"tolerances": half}, {"tolerances": wide}, {"start": "continuation"}, {"initial_states": 1},
        ]  # fmt: skip
        return [
            response_type(machine, window="speed-clearance", budget=budget, workers=1, **variant).type
            for variant in variants
        ]

    rows = parallel_map(labels, machines, workers=workers, progress="types" if progress else None)
    names = ("window x 0.5", "window x 2.5", "continuation", "one initial state")
    return {
        name: sum(row[0] != row[column] for row in rows) / max(1, len(rows))
        for column, name in enumerate(names, start=1)
    }


@dataclass(frozen=True, kw_only=True)
class ResponseMap:
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
    runs
        Number of machines that were run; without sharing it would be nine times the number of points and more.
    definition
        Window, statistic and initial states.
    """

    machine: Machine
    speed: Array
    clearance: Array
    type: NDArray[np.str_]
    nature: NDArray[np.str_]
    largest_peak: Array
    runs: int
    definition: Mapping[str, Any]


def geometric_grid(low: float, high: float, tolerance: Tolerance, points_per_tolerance: int = 2) -> Array:
    """Grid from ``low`` to at most ``high`` on which neighbourhoods share their points.

    Successive values are half a tolerance apart; fewer ``points_per_tolerance`` than 2 do not share all.
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
    tolerances, initial_states, budget, workers
        As for ``response_type``. One initial state by default: more can't be shared.
    progress
        Show a progress bar on standard error.
    """
    allowed = _tolerances_of(machine, tolerances, "speed-clearance")
    _check_initial_states(initial_states)
    speed, clearance = np.asarray(speeds, dtype=float), np.asarray(clearances, dtype=float)
    fields = (machine.speed_field, machine.clearance_field)
    centres = [(i, k) for i in range(len(speed)) for k in range(len(clearance))]
    needed: dict[tuple[float, float], None] = {}
    around: dict[tuple[int, int], list[tuple[str, int, tuple[float, float]]]] = {}
    for i, k in centres:
        nominal = (float(speed[i]), float(clearance[k]))
        needed[_key(*nominal)] = None
        around[i, k] = []
        for name, tolerance in allowed.items():
            for share in SHARES:
                place = [_key(*nominal)[0], _key(*nominal)[1]]
                at = fields.index(name)
                place[at] = tolerance.at(nominal[at], share)
                key = _key(place[0], place[1])
                needed[key] = None
                around[i, k].append((name, 1 if share > 0.0 else -1, key))
    keys = list(needed)
    machines = [with_settings(machine, dict(zip(fields, key, strict=True))) for key in keys]

    def judge(one: Machine) -> Diagnosis | None:
        try:
            return diagnose(one, budget=budget)
        except SimulationError:
            return None

    runs = dict(
        zip(keys, parallel_map(judge, machines, workers=workers, progress="map" if progress else None), strict=True)
    )
    types = np.empty((len(speed), len(clearance)), dtype="<U12")
    natures, peaks = types.copy(), np.full(types.shape, np.nan)
    for i, k in centres:
        centre = runs[_key(float(speed[i]), float(clearance[k]))]
        if centre is None:
            natures[i, k] = types[i, k] = "undetermined"
            continue
        natures[i, k], peaks[i, k] = centre.nature, centre.evidence["largest_peak"]
        neighbours = [_neighbour(name, side, runs[key]) for name, side, key in around[i, k]]
        coexisting: tuple[float, ...] = ()
        if initial_states > 1 and centre.nature == "periodic":
            nominal_machine = with_settings(machine, {fields[0]: float(speed[i]), fields[1]: float(clearance[k])})
            coexisting = _coexisting_peaks(nominal_machine, centre, initial_states, budget)
        types[i, k] = judge_type(centre.nature, float(peaks[i, k]), neighbours, coexisting)[0]
    return ResponseMap(
        machine=machine, speed=speed, clearance=clearance, type=types, nature=natures, largest_peak=peaks,
        runs=len(keys), definition=_definition(allowed, "speed-clearance", "rest", initial_states, budget),
    )  # fmt: skip


def _key(speed: float, clearance: float) -> tuple[float, float]:
    """Machines that differ in the eleventh digit are the same."""
    return float(f"{speed:.10e}"), float(f"{clearance:.10e}")


def _neighbour(name: str, side: int, run: Diagnosis | None) -> Neighbour:
    if run is None:
        return Neighbour(name, side, "undetermined", np.nan)
    return Neighbour(name, side, run.nature, run.evidence["largest_peak"])
