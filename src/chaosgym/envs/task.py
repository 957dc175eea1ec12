r"""The task: length of a job, demanded speeds, sensors, disturbances and costs.

A step of a job costs

    - deviation_weight |speed - demand|
    - type_iii_weight  (share of the step's cycles that are irregular)
    - damage_weight    (increase of the damage)
    - time_weight      (duration of the step) / (duration of the whole job at top speed)
    - failure_weight   (steps that are left)                     on fracture, a stall or a failed simulation

The keyword ``objective`` names a set of these weights, ``OBJECTIVES``: irregular motion, the joint's life, or both.

A step not done costs more than a bad one, so giving up never pays. Damage adds up peak forces as the basic rating life
of a bearing does, to the power of p = 10/3 (line contact); that of a joint is its worse surface's:

    D = D_0 / n  sum (F_i / F_0)^p              n cycles of a job, ``reference_force`` F_0, ``reference_damage`` D_0

It is a scale of cost, and needs no load rating: F_0 and D_0 stand in it as D_0 / F_0^p alone, so that lives compare as
damages do whatever they are. For a life in hours state a rating (``chaosgym run-agent --load-rating``).

References
----------
P. Gu, Chaotic Vibration in Machine Systems and Its Implications for Design, PhD thesis, MIT, 1994, 3.5.2 and 5.2.1.
ISO 281:2007, Rolling bearings - Dynamic load ratings and rating life.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.envs.entries import AddedEntries
from chaosgym.envs.kernels import steps
from chaosgym.errors import ParameterError, nearest_or
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import parameter, parameters_of, validate
from chaosgym.rating_life import damage_in_a_million

_number = partial(parameter, low=0.0, high=1e9, provenance="assumed")
_count = partial(parameter, low=1, high=1e6, provenance="assumed")


class Status(IntEnum):
    """Where the job stands; ``info["status"]``."""

    RUNNING = steps.RUNNING
    JOB_DONE = steps.JOB_DONE
    FRACTURE = steps.FRACTURE
    SIMULATION_FAILED = steps.SIMULATION_FAILED
    STALLED = steps.STALLED


@dataclass(frozen=True, kw_only=True)
class Task(AddedEntries):
    """Drive, demand, sensors, disturbance and weights of a task; speeds are in the unit of the machine's speed field.

    Raises
    ------
    ParameterError
        If a value is out of range, or ranges do not fit each other.
    """

    action: str = parameter(
        "trim", choices=("trim", "continuous", "speed"), provenance="assumed", source="kind of action"
    )
    steps: int = _count(120, source="steps of a job")
    cycles_per_step: int = _count(10, source="operating cycles in a step")
    lowest_speed: float = _number(16.0, source="lowest speed of the drive")
    highest_speed: float = _number(30.0, source="highest speed of the drive")
    slew_limit: float = _number(2.0, source="largest change of speed in a step")
    speed_grid: float = _number(0.0, source="spacing of the speeds that the drive can hold, 0 for none")
    trim_step: float = _number(0.25, source="smallest change of the trim")
    largest_trim: float = _number(2.0, source="largest trim")
    lowest_demand: float = _number(18.0, source="lowest demand")
    highest_demand: float = _number(29.0, source="highest demand")
    smallest_change: float = _number(1.0, source="smallest change of the demand")
    largest_change: float = _number(4.0, source="largest change of the demand")
    shortest_hold: int = _count(20, source="fewest steps for which a demand holds")
    longest_hold: int = _count(40, source="most steps for which a demand holds")
    start_below: float = _number(2.0, source="speed of the first demand less that of the start")
    run_in_cycles: int = _count(30, source="cycles from rest at the speed of the start, before the first observation")
    sensor_error: float = _number(1.0, unit="N", source="half width of the error of a measured peak force")
    bouncing_error: float = _number(0.05, source="half width of the error of the share of bouncing")
    missed_impacts: float = _number(0.05, high=1.0, source="share of the impacts that the counter misses")
    speed_ripple: float = _number(0.0, high=0.1, source="standard deviation of a cycle's speed, as a share of it")
    kick: float = _number(
        0.0, high=0.1, source="standard deviation of the change of each velocity once a cycle, as a share of its range"
    )
    wear: float = _number(0.0, high=10.0, source="growth of the clearance over the job, as a share of it")
    type_iii_weight: float = _number(1.0, source="cost of a step that is irregular throughout")
    deviation_weight: float = _number(0.25, source="cost of a step at a speed by 1 from the demand")
    damage_weight: float = _number(1.0, source="cost of a damage of 1")
    time_weight: float = _number(0.0, source="cost of the time that the job takes at top speed")
    failure_weight: float = _number(2.0, source="cost of each step that is not done")
    cost_budget: float = _number(
        0.05, high=1.0, source="mean cost of a step that a constrained agent may have; no part of the reward"
    )
    reference_force: float = _number(
        100.0, low=1e-6, unit="N", source="peak force of a job with the reference_damage; no load rating"
    )
    reference_damage: float = _number(0.5, source="damage of a job whose peaks are all the reference_force; 1 ends it")

    def __post_init__(self) -> None:
        validate(self)
        pairs = (
            ("lowest_speed", "highest_speed"),
            ("lowest_demand", "highest_demand"),
            ("lowest_speed", "lowest_demand"),
            ("highest_demand", "highest_speed"),
            ("smallest_change", "largest_change"),
            ("shortest_hold", "longest_hold"),
        )
        for low, high in pairs:
            if getattr(self, low) > getattr(self, high):
                raise ParameterError(
                    f"{low} = {getattr(self, low):g} is out of range; allowed: up to {high} = {getattr(self, high):g}"
                )
        if self.lowest_speed == self.highest_speed or self.trim_step <= 0.0:
            raise ParameterError("lowest_speed and highest_speed must differ, and trim_step must be positive")

    @property
    def grid(self) -> Array:
        """Speeds from the lowest one on, a ``trim_step`` apart."""
        return np.arange(self.lowest_speed, self.highest_speed + 1e-6 * self.trim_step, self.trim_step)

    @property
    def job_cycles(self) -> int:
        """Operating cycles of a job."""
        return self.steps * self.cycles_per_step

    def damage(self, peak_force: Array) -> Array:
        """Damage of each surface, (..., sides), by peak forces (..., cycles, sides) [N]: 1 ends a job."""
        shares: Array = damage_in_a_million(peak_force, self.reference_force).sum(axis=-2)
        return shares * (self.reference_damage / self.job_cycles)

    @cached_property
    def numbers(self) -> NDArray[np.void]:
        """One record of all numbers for the kernels, with the kind of action as its place among the choices."""
        about = parameters_of(self)
        values = {name: getattr(self, name) for name in about if not about[name].choices}
        values["action"] = about["action"].choices.index(self.action)
        return np.array([tuple(values.values())], [(name, type(value)) for name, value in values.items()])


LIFE_PRICE = 1000.0
"""Cost of a damage of 1 where life counts (assumed): on the beam it is worth 33 jobs at 1 Hz off the demand."""

OBJECTIVES: Mapping[str, Mapping[str, float]] = {
    "irregular": {},
    "life": {"type_iii_weight": 0.0, "damage_weight": LIFE_PRICE},
    "both": {"damage_weight": LIFE_PRICE},
}
"""Weights that an objective sets: for "irregular" those of the machine's own task."""


class UnknownKeywordError(ParameterError, TypeError):
    """A keyword that neither the task nor the machine has."""


def divided(task: Task, machine: Machine, keywords: Mapping[str, Any]) -> tuple[Task, dict[str, Any]]:
    """Return the task with the keywords that are its own, and those that are fields of the machine.

    The keyword ``objective`` sets weights; those that are given beside it stand.

    Raises
    ------
    ParameterError
        If a value is not allowed, or a keyword is the speed.
    UnknownKeywordError
        If a keyword is neither; it is a ``TypeError`` too, as for any call with an unknown keyword.
    """
    own, theirs = parameters_of(task), parameters_of(machine)
    objective = keywords.get("objective", "irregular")
    if objective not in OBJECTIVES:
        raise ParameterError(f"objective = {objective!r} is not one of {', '.join(OBJECTIVES)}")
    keywords = dict(OBJECTIVES[objective]) | {name: value for name, value in keywords.items() if name != "objective"}
    for name in keywords:
        if name == machine.speed_field:
            raise ParameterError(f"{name} is what the agent sets; give lowest_speed and highest_speed instead")
        if name not in own and name not in theirs and name != "fidelity":
            ours = ("objective", "fidelity", "model_fidelity", "tolerances", "level", "split", "sealed", "jobs")
            there = f"known: {', '.join(own)}, and the fields of {machine.name}"
            hint = nearest_or(there, name, [*own, *theirs, *ours])
            raise UnknownKeywordError(f"unexpected keyword argument {name!r}; {hint}")
    mine = {name: value for name, value in keywords.items() if name in own}
    return replace(task, **mine), {name: value for name, value in keywords.items() if name not in own}


def demand_of(task: Task, generator: np.random.Generator) -> Array:
    """Draw the demands of the steps of a job and of the one after it, (steps + 1,), on the grid of the trims.

    The first is uniform over the range; each next one differs by ``smallest_change`` to ``largest_change``, up or down,
    whichever stays in the range.
    """
    low, high = task.lowest_demand, task.highest_demand
    asked = np.empty(task.steps + 1)
    now, step = generator.uniform(low, high), 0
    while step <= task.steps:
        # by shares, so that a job of finer steps has the same demand
        hold = task.shortest_hold + int(generator.random() * (task.longest_hold - task.shortest_hold + 1))
        asked[step : step + hold] = now
        step += hold
        change = generator.choice((-1.0, 1.0)) * generator.uniform(task.smallest_change, task.largest_change)
        now = now + change if low <= now + change <= high else now - change
        now = min(max(now, low), high)
    grid = low + task.trim_step * np.rint((asked - low) / task.trim_step)
    return np.asarray(np.minimum(grid, high))
