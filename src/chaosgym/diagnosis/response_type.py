"""Types I, II and III of a response over a tolerance neighbourhood: what a designer may rely on (thesis 5.5).

The machine is run at its nominal parameters and at points half a tolerance and a whole one away: every combination of
speed and clearance, and each other parameter by itself, each from rest; at the speeds beside the nominal one also from
states carried up and down the speed. ``attractors`` looks for other motions of the nominal machine. The statistic is
the largest peak force of the settled cycles.

What follows from that is the rule of ``type_rule``. Window, statistic and initial states are part of the label.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, Literal, NamedTuple

from chaosgym.arrays import Array
from chaosgym.diagnosis.attractors import MOST_STARTS, STARTS, Attractors, attractors
from chaosgym.diagnosis.carried import carried_states
from chaosgym.diagnosis.diagnose import diagnose
from chaosgym.diagnosis.type_rule import FORCE_CHANGE, UNSETTLED, Coexisting, Neighbour, judge_type
from chaosgym.diagnosis.verdict import MachineDiagnosis
from chaosgym.errors import DiagnosisError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import by_field, parameters_of, with_settings
from chaosgym.numbers import whole
from chaosgym.plain import Result
from chaosgym.series.verdict import COEXISTING, TYPE_MEANINGS, Definition, Type
from chaosgym.simulation.parallel import parallel_map

Window = Literal["parameters", "speed-clearance"]
Start = Literal["rest", "continuation"]

FEWEST_STARTS = 16
"""Random starts from which on other motions are searched for; fewer initial states are rest, or three fixed ones."""

LEAST_STEPS = 0.9
"""Steps of a grid that a tolerance must hold at least, so that neighbours on it are neighbours of a response type."""

SHARES = (-1.0, -0.5, 0.5, 1.0)
"""Points of the region along one parameter, in tolerances."""


class Tolerance(NamedTuple):
    """Tolerance of one parameter: ``value`` in its unit, or as a share of its nominal value if ``relative``."""

    value: float
    relative: bool = True

    def at(self, nominal: float, share: float) -> float:
        """The parameter's value at a share, -1 to 1, of the tolerance.

        Relative tolerances are ratios, so that the points of a grid in geometric progression are neighbours.
        """
        return nominal * (1.0 + self.value) ** share if self.relative else nominal + share * self.value

    def steps(self, value: float, following: float) -> int:
        """Steps of a grid that the tolerance holds, by two neighbours of the grid; 0 where they are further apart.

        Examples
        --------
        >>> Tolerance(0.02).steps(20.0, 20.2), Tolerance(0.02).steps(20.0, 21.0)
        (2, 0)
        """
        steps = (self.at(value, 1.0) - value) / (following - value)
        return 0 if steps < LEAST_STEPS else round(steps)


def default_tolerances(machine: Machine) -> dict[str, Tolerance]:
    """Tolerances of a machine's speed, clearance, length and dampings.

    Speed +-2 % of a frequency, +-10 rpm of a rotation (thesis 5.5.2); clearance +-5 %; lengths +-0.1 %; every damping
    constant, ratio or factor +-10 %. A machine that states tolerances has these instead; of speed and clearance
    where it states none.
    """
    known = parameters_of(machine)
    rotates = known[machine.speed_field].unit == "rpm"
    tolerances = {
        machine.speed_field: Tolerance(10.0, relative=False) if rotates else Tolerance(0.02),
        machine.clearance_field: Tolerance(0.05),
    }
    if machine.tolerances:
        return tolerances | {name: Tolerance(*stated) for name, stated in machine.tolerances.items()}
    for name in known:
        if name in ("length", "rod_length"):
            tolerances[name] = Tolerance(0.001)
        elif "damping" in name and name.endswith(("damping", "ratio", "factor")) and getattr(machine, name) > 0.0:
            tolerances[name] = Tolerance(0.10)
    return tolerances


@dataclass(frozen=True, kw_only=True)
class ResponseType(Result):
    """The type of a response over its neighbourhood.

    Attributes
    ----------
    type
        "I", "II", "III" or "undetermined".
    reason
        One sentence for people.
    centre
        Verdict on the nominal machine, with its other motions.
    largest_peak
        Largest peak force of its settled cycles, both sides [N].
    neighbours
        What each point of the neighbourhood does; empty if the centre decides alone.
    attractors
        The motions at the centre, and how far was looked; None unless it is periodic and others were looked for.
    definition
        Window, statistic, initial states and whose nature it is: part of the label. Plain values.
    """

    shows = "type reason centre largest_peak neighbours coexisting_peaks attractors definition"

    type: Type
    reason: str
    centre: MachineDiagnosis
    largest_peak: float
    neighbours: tuple[Neighbour, ...] = field(repr=False)
    attractors: Attractors | None = field(repr=False)
    definition: Mapping[str, Any] = field(repr=False)

    @property
    def coexisting_peaks(self) -> tuple[float, ...]:
        """Largest peak of each of the other motions at the centre [N]."""
        others = coexisting(self.attractors, self.centre)
        return tuple(one.largest_peak for one in others if one.nature != UNSETTLED)

    @property
    def coexists(self) -> bool:
        """Whether the centre repeats, but another initial state leads to a motion of another force or nature."""
        others = coexisting(self.attractors, self.centre)
        return self.centre.nature == "periodic" and judge_type("periodic", self.largest_peak, (), others)[0] == "III"

    @property
    def meaning(self) -> str:
        """What the type means for whoever relies on the machine."""
        return COEXISTING if self.coexists else TYPE_MEANINGS[self.type]

    def over(self, built: Sequence[Neighbour]) -> "ResponseType":
        """Return the type over more machines of the region."""
        centre = self.centre.nature, self.largest_peak
        others = coexisting(self.attractors, self.centre)
        kind, reason = judge_type(*centre, [*self.neighbours, *built], others)
        return replace(self, type=kind, reason=reason)


def response_type(
    machine: Machine,
    tolerances: Mapping[str, Tolerance] | None = None,
    *,
    window: Window = "parameters",
    start: Start = "rest",
    initial_states: int = STARTS,
    budget: int = 1600,
    sensor_error: float = 0.0,
    definition: Definition = "settled",
    centre: MachineDiagnosis | None = None,
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
        How many initial states look for other motions at the centre. 16 or more: so many random starts of
        ``attractors``, and states carried along the speed. 3: rest, the mirror image of the state that rest leads to,
        and half that state, as in datasets that say so. 1: rest alone.
    budget
        Cycles that each run may take.
    sensor_error
        Peak forces [N] that differ by less count as equal; see ``diagnose``.
    definition
        "settled", or "thesis": a response whose chaos dies out counts as chaotic (thesis 5.2.3).
    centre
        Verdict on the nominal machine from rest, if it is known already.
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

    Examples
    --------
    >>> found = chaosgym.response_type(chaosgym.ImpactBeam(excitation_frequency=10.0))
    >>> found.type, found.reason
    ('I', 'periodic throughout the tolerances, peak force less than 10 % higher')
    """
    allowed = chosen_tolerances(machine, tolerances, window)
    check_initial_states(initial_states)
    if start not in ("rest", "continuation"):
        raise DiagnosisError(f"start = {start!r} is not one of 'rest', 'continuation'")
    centre = (centre or diagnose(machine, budget=budget, sensor_error=sensor_error)).labelled(definition)
    origin = centre.evidence["final_state"] if start == "continuation" else None
    neighbours: tuple[Neighbour, ...] = ()
    found: Attractors | None = None
    if centre.nature == "periodic":
        points = region_points(machine, allowed)
        machines = [
            with_settings(
                machine, {name: allowed[name].at(getattr(machine, name), share) for name, share in one.items()}
            )
            for one in points
        ]
        how: dict[str, Any] = {"initial_state": origin, "budget": budget, "sensor_error": sensor_error}
        runs = parallel_map(lambda one: diagnose(one, **how).labelled(definition), machines, workers=workers)
        neighbours = tuple(
            Neighbour(shares, run.nature, run.evidence["largest_peak"])
            for shares, run in zip(points, runs, strict=True)
        )
        if initial_states > 1:
            found, carried = _beside(machine, centre, allowed, initial_states, budget, definition, workers)
            neighbours += carried
    largest = centre.evidence["largest_peak"]
    kind, reason = judge_type(centre.nature, largest, neighbours, coexisting(found, centre))
    return ResponseType(
        type=kind,
        reason=reason,
        centre=centre if found is None else found.told_of(centre),
        largest_peak=largest,
        neighbours=neighbours,
        attractors=found,
        definition=define(allowed, window, start, initial_states, budget, sensor_error, definition),
    )


def _beside(
    machine: Machine,
    centre: MachineDiagnosis,
    tolerances: Mapping[str, Tolerance],
    initial_states: int,
    budget: int,
    definition: Definition,
    workers: int | None,
) -> tuple[Attractors, tuple[Neighbour, ...]]:
    """The motions at the centre, and what states carried along the speed do at the speeds of the region."""
    name = machine.speed_field
    nominal = float(getattr(machine, name))
    shares = {tolerances[name].at(nominal, share): share for share in SHARES} if name in tolerances else {}
    found, carried = motions_beside(machine, centre, initial_states, budget, workers, tuple(shares))
    runs = parallel_map(
        lambda one: diagnose(machine.at(speed=one[0]), initial_state=one[1], budget=budget).labelled(definition),
        carried,
        workers=workers,
    )
    return found, tuple(
        Neighbour({name: shares[speed]}, run.nature, run.evidence["largest_peak"])
        for (speed, _), run in zip(carried, runs, strict=True)
    )


def region_points(machine: Machine, tolerances: Mapping[str, Tolerance]) -> list[dict[str, float]]:
    """Points of the region but for its middle: deviations of the parameters that deviate, in tolerances."""
    plane = [name for name in (machine.speed_field, machine.clearance_field) if name in tolerances]
    combined = product((0.0, *SHARES), repeat=len(plane))
    points = [{name: share for name, share in zip(plane, shares, strict=True) if share} for shares in combined]
    others = [{name: share} for name in tolerances if name not in plane for share in SHARES]
    return [*(point for point in points if point), *others]


def chosen_tolerances(
    machine: Machine, tolerances: Mapping[str, Tolerance] | None, window: Window
) -> dict[str, Tolerance]:
    """Tolerances that a window uses, all of them fields of the machine."""
    if window not in ("parameters", "speed-clearance"):
        raise DiagnosisError(f"window = {window!r} is not one of 'parameters', 'speed-clearance'")
    given = default_tolerances(machine) if tolerances is None else by_field(machine, tolerances)
    for name in given:
        with_settings(machine, {name: getattr(machine, name, 0.0)})
    if window == "parameters":
        return given
    return {name: given[name] for name in (machine.speed_field, machine.clearance_field) if name in given}


def check_initial_states(initial_states: int) -> None:
    """Refuse a number of initial states that is neither 1, 3 nor enough for a search."""
    if whole("initial_states", initial_states, 1, MOST_STARTS, error=DiagnosisError) in (2, *range(4, FEWEST_STARTS)):
        raise DiagnosisError(
            f"initial_states = {initial_states!r} is out of range; allowed: 1, 3, or {FEWEST_STARTS} or more"
        )


def motions_beside(
    machine: Machine,
    centre: MachineDiagnosis,
    initial_states: int,
    budget: int,
    workers: int | None = None,
    stops: Sequence[float] = (),
) -> tuple[Attractors, tuple[tuple[float, Array], ...]]:
    """The motions at a periodic centre, and the states carried along the speed at the ``stops`` beside it."""
    carried = carried_states(machine, stops) if initial_states >= FEWEST_STARTS else None
    found = attractors(
        machine,
        starts=initial_states if carried else 0,
        budget=budget,
        centre=centre,
        carried=carried,
        workers=workers,
    )
    return found, carried.beside if carried else ()


def coexisting(found: Attractors | None, centre: MachineDiagnosis) -> tuple[Coexisting, ...]:
    """The motions that are not that of the centre, and what did not settle.

    A neutral motion at the centre is a family, whose force may be another.
    """
    if found is None:
        return ()
    first = found.motions[:1] if found.motions[0].neutral else ()
    others = tuple(Coexisting(one.nature, one.largest_peak) for one in (*first, *found.motions[1:]))
    lost = found.unsettled or found.further_unsettled
    return (*others, Coexisting(UNSETTLED, float("nan"))) if lost else others


def define(
    tolerances: Mapping[str, Tolerance],
    window: Window,
    start: Start,
    initial_states: int,
    budget: int,
    sensor_error: float,
    definition: Definition = "settled",
) -> dict[str, Any]:
    """The definition of a type label, as plain values."""
    return {
        "window": window,
        "tolerances": {name: tolerance._asdict() for name, tolerance in tolerances.items()},
        "shares": list(SHARES),
        "statistic": "largest peak force of the settled cycles, both sides",
        "force_change": FORCE_CHANGE,
        "initial_states": initial_states,
        "start": start,
        "budget": budget,
        "sensor_error": sensor_error,
        "nature": definition,
    }
