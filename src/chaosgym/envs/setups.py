"""The machine at work: nominal machine, tolerances and numbers of the task, from what the machine says of itself."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from chaosgym.envs.task import Task
from chaosgym.errors import ParameterError
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import parameters_of, suggestion


@dataclass(frozen=True)
class Setup:
    """A machine at work: ``task``, and ``tolerances``, half widths as shares of the nominal value."""

    tolerances: Mapping[str, float]
    task: Task


def setup_of(machine: Machine) -> Setup:
    """Setup of a machine by its ``work``; what that leaves open follows from its usual ranges and its tolerances.

    Raises
    ------
    ParameterError
        If the machine's ``work`` has a number that no task has, or one out of its range.
    """
    work = machine.work
    known = parameters_of(Task)
    for name in work.task:
        if name not in known:
            raise ParameterError(f"the job of {machine.name} has no number {name!r}{suggestion(name, known)}")
    numbers: dict[str, Any] = dict(work.task)
    task = replace(_usual_task(machine), **numbers)
    return Setup(_shares(machine) if work.tolerances is None else work.tolerances, task)


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
        speed_ripple=0.002 if machine.carries_deviations else 0.0,
    )
