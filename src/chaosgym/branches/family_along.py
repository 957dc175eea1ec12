"""The family of periodic orbits through a state, along a field of a machine by its name."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.branches.orbit_family import CLOSELY, OrbitFamily
from chaosgym.core import matrices
from chaosgym.errors import ParameterError, SimulationError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import USUAL, check_parameter, field_named, name_of, parameters_of, suggestion

UNMOVED = 1e-13
"""Change of s that changes nothing but the rounding of a model."""


def family_of(machine: Machine, field: str, low: float, high: float, state: Array, period: int) -> OrbitFamily:
    """Family of the orbit through a state, along a field between two values; its noise is not measured.

    Raises
    ------
    ParameterError
        If the field is unknown, is no number that varies continuously, or does not reach so far.
    """
    for value in (low, high):
        check_parameter(machine, field, value)
    weight = machine.state_weights(state)
    size = float(matrices.norm(weight * state)) or 1.0
    machines = machine.along(field, low, high)
    return OrbitFamily(machine, field, low, high, period, np.asarray(weight / size), machines)


def with_noise(family: OrbitFamily, state: Array) -> OrbitFamily:
    """The family with its noise measured near a state at the machine's own value."""
    if family.field in (family.machine.speed_field, family.machine.clearance_field):
        return family  # these reach the model without computing it anew
    s = float(np.clip((getattr(family.machine, family.field) - family.low) / (family.high - family.low), 0.01, 0.99))
    x = np.append(family.weight * state, s)
    try:
        ends = [family.end(x, s + k * UNMOVED) for k in range(4)]
    except SimulationError:
        return family
    jumps = [float(matrices.norm(b - a)) for a, b in pairwise(ends)]
    return replace(family, noise=max(max(jumps) - CLOSELY, 0.0))


def continuous_field(machine: Machine, name: str) -> str:
    """Field of a machine by one of its names, see ``field_named``.

    Raises
    ------
    ParameterError
        If there is none, or none that varies continuously.
    """
    known, field = parameters_of(machine), field_named(machine, name)
    numbers: list[str] = [key for key, about in known.items() if not about.choices and _continuous(machine, key)]
    if field not in numbers:
        hint = suggestion(name, [*USUAL, *numbers])
        raise ParameterError(f"{name_of(machine)} has no field {name!r} that varies continuously{hint}")
    return field


def _continuous(machine: Any, name: str) -> bool:
    return not isinstance(getattr(machine, name), int | str)
