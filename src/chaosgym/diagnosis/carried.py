"""States carried along the speed from below and from above, as a run-up and a run-down carry them."""

from collections.abc import Mapping, Sequence
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
        state = rest_state(machine)
        try:
            for speed in _on_the_way(end, own, passed):
                state = simulate(machine.at(speed=speed), CYCLES, state).final_state
                cycles += CYCLES
                if speed in passed:
                    beside.append((speed, state.coordinates))
        except (ParameterError, SimulationError):
            continue
        here[f"{way} from {end:.4g} {unit}"] = state.coordinates
    return Carried(here=here, beside=tuple(beside), cycles=cycles)


def _on_the_way(end: float, own: float, passed: Sequence[float]) -> list[float]:
    """Speeds from an end of the range to the machine's own: in equal ratios, and those that are passed."""
    speeds = {*np.geomspace(end, own, STEPS).tolist()[1:-1], *passed, end, own}
    return sorted(speeds, reverse=end > own)
