"""States carried along the speed from below and from above, as a run-up and a run-down carry them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import ParameterError, SimulationError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of
from chaosgym.simulation import rest_state, simulate

STEPS = 40
"""Speeds of a run from an end of the operating range to the speed that is asked for."""

CYCLES = 24
"""Cycles at each of them."""


@dataclass(frozen=True, kw_only=True)
class Carried:
    """States that arrive at a machine's speed from below and from above.

    Attributes
    ----------
    here
        States (n_states,) at its own speed, by name: "run-up from 0.5 Hz". One that can't be followed is missing.
    beside
        Speed and state (n_states,) at each of the stops on the way.
    cycles
        Of all runs.
    """

    here: Mapping[str, Array] = field(repr=False)
    beside: tuple[tuple[float, Array], ...] = field(repr=False)
    cycles: int


def carried_states(machine: Machine, stops: Sequence[float] = ()) -> Carried:
    """Carry the state of rest along the speed to a machine's own, from both ends of its usual range.

    Parameters
    ----------
    machine
        At its speed.
    stops
        Speeds beside it, in the unit of the speed field, at which the states that pass are given too.

    Examples
    --------
    >>> from chaosgym.diagnosis.carried import carried_states
    >>> list(carried_states(chaosgym.ImpactBeam(excitation_frequency=10.0)).here)
    ['run-up from 4 Hz', 'run-down from 30 Hz']
    """
    name = machine.speed_field
    own, unit = float(getattr(machine, name)), parameters_of(machine)[name].unit
    range_ = machine.usual_ranges.get(name, (own, own))
    here: dict[str, Array] = {}
    beside: list[tuple[float, Array]] = []
    cycles = 0
    for way, end, passed in (
        ("run-up", min(range_[0], *stops, own), sorted(stop for stop in stops if stop < own)),
        ("run-down", max(range_[1], *stops, own), sorted((stop for stop in stops if stop > own), reverse=True)),
    ):
        if end == own:
            continue
        for speed, state in _along(machine, end, own, passed):
            cycles += CYCLES
            if speed == own:
                here[f"{way} from {end:.4g} {unit}"] = state
            elif speed in passed:
                beside.append((speed, state))
    return Carried(here=here, beside=tuple(beside), cycles=cycles)


def carried_over(machine: Machine, speeds: Sequence[float]) -> dict[float, dict[str, Array]]:
    """Carry the state of rest up and down a row of speeds, from both ends of the usual range.

    Parameters
    ----------
    machine
        At any speed.
    speeds
        In the unit of the speed field, at least one.

    Returns
    -------
    dict
        By speed: states (n_states,) that arrive there, by name, as of ``Carried.here``.

    Examples
    --------
    >>> from chaosgym.diagnosis.carried import carried_over
    >>> [len(states) for states in carried_over(chaosgym.ImpactBeam(), [9.9, 10.0]).values()]
    [2, 2]
    """
    name = machine.speed_field
    unit, (low, high) = parameters_of(machine)[name].unit, machine.usual_ranges.get(name, (min(speeds), max(speeds)))
    there: dict[float, dict[str, Array]] = {speed: {} for speed in speeds}
    for way, end, order in (
        ("run-up", min(low, *speeds), sorted(speeds)),
        ("run-down", max(high, *speeds), sorted(speeds, reverse=True)),
    ):
        for speed, state in _along(machine, end, order[-1], order):
            if speed in there:
                there[speed][f"{way} from {end:.4g} {unit}"] = state
    return there


def _along(machine: Machine, end: float, own: float, passed: Sequence[float]) -> Iterator[tuple[float, Array]]:
    """Speeds from an end of the range to another, and the state after some cycles at each; ends where a run fails."""
    state = rest_state(machine)
    try:
        for speed in _on_the_way(end, own, passed):
            state = simulate(machine.at(speed=speed), CYCLES, state).final_state
            yield speed, state.coordinates
    except (ParameterError, SimulationError):
        return


def _on_the_way(end: float, own: float, passed: Sequence[float]) -> list[float]:
    """Speeds from an end of the range to the machine's own: in equal ratios, and those that are passed."""
    speeds = {*np.geomspace(end, own, STEPS).tolist()[1:-1], *passed, end, own}
    return sorted(speeds, reverse=end > own)
