"""The machine at work: nominal machine, tolerances and numbers of the task, from what the machine says of itself.

A level says what differs from job to job:

    nominal      nothing
    clearance    the tolerances: of the beam and the crank the clearance alone
    wear         the same, and the clearance grows by 10 % in the job
    fleet        what no sensor tells as well: damping, contact, force, mass; and the clearance grows
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from chaosgym.envs.task import Task
from chaosgym.errors import ParameterError
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import parameters_of, suggestion

WEAR, WEARING = 0.1, ("wear", "fleet")
"""Growth of the clearance over a job, as a share of it (assumed), and the levels that have it."""


LEVELS = ("nominal", "clearance", "wear", "fleet")


def tolerances_of(machine: Machine, level: str) -> Mapping[str, float]:
    """Half widths of a level of a machine, as shares of the nominal values, by field.

    Raises
    ------
    ParameterError
        If there is no such level.
    """
    if level not in LEVELS:
        raise ParameterError(f"level = {level!r} is not one of {', '.join(LEVELS)}")
    if level == "nominal":
        return {}
    usual = _shares(machine) if machine.task_defaults.tolerances is None else machine.task_defaults.tolerances
    return {**usual, **machine.task_defaults.fleet} if level == "fleet" else usual


def task_of(machine: Machine, level: str) -> Task:
    """Task of a level of a machine by its ``task_defaults``; what that leaves open follows from its usual ranges.

    Raises
    ------
    ParameterError
        If the machine's ``task_defaults`` has a number that no task has, or one out of its range.
    """
    known = parameters_of(Task)
    for name in machine.task_defaults.task:
        if name not in known:
            raise ParameterError(f"the job of {machine.name} has no number {name!r}{suggestion(name, known)}")
    numbers: dict[str, Any] = {**machine.task_defaults.task, **({"wear": WEAR} if level in WEARING else {})}
    return replace(_usual_task(machine), **numbers)


def _shares(machine: Machine) -> dict[str, float]:
    """Tolerances of a machine as shares, the speed's left out: an agent sets it; those of the clearance at least."""
    stated = {
        name: width if relative else width / abs(getattr(machine, name))
        for name, (width, relative) in machine.tolerances.items()
        if name != machine.speed_field and getattr(machine, name) != 0.0
    }
    return {machine.clearance_field: 0.1} | stated


def _usual_task(machine: Machine) -> Task:
    low, high = machine.usual_ranges[machine.speed_field]
    span = high - low
    return Task(
        lowest_speed=low,
        highest_speed=high,
        slew_limit=span / 7,
        trim_step=span / 56,
        largest_trim=span / 7,
        lowest_demand=low + span / 7,
        highest_demand=high,
        smallest_change=span / 14,
        largest_change=span / 3.5,
        start_below=span / 7,
        deviation_weight=3.5 / span,
        speed_ripple=0.0 if machine.moving.costly else 0.002,
    )
