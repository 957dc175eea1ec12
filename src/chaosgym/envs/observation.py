"""Observations: speed, demand, and what a force sensor reports of a step, with its errors."""

from collections.abc import Sequence

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.envs.kernels.steps import PLACE
from chaosgym.envs.task import Task

Observation = NDArray[np.float32]
Generators = Sequence[np.random.Generator]

FORCE_RANGE = 5.0
"""Range of the force sensors in units of the load rating."""

IMPACT_RANGE = 200.0
"""Impacts a cycle at which the counter saturates."""

OBSERVATION_NAMES = PLACE._fields
"""Entries of every observation, in their order."""

FELT = OBSERVATION_NAMES[PLACE.mean_peak_force :]
"""Those that sensors report."""

OVERSPEED = 2.0
"""Largest speed that is observed under a motor, which a load may drive beyond its set-point, over the highest one."""

MEANINGS = {
    "speed": "speed of the step",
    "demand": "speed that is asked for in the coming step",
    "trim": "trim that holds until the next action",
    "offset": "speed less demand",
    "remaining_share": "share of the job still to do",
    "steps_since_change": "steps since the demand changed, at most the shortest hold",
    "mean_peak_force": "mean of the measured peak forces of the step, one a cycle [N]",
    "std_peak_force": "their standard deviation [N]",
    "max_peak_force": "the largest of them [N]",
    "repeat_1": "mean absolute difference of successive ones [N]",
    "repeat_2": "the same after two cycles [N]",
    "repeat_4": "the same after four cycles [N]",
    "impacts_per_cycle": "contacts counted in a cycle, both sides",
    "bouncing_share": "share of the half cycle spent bouncing on one side",
}
"""What each entry is; speeds are in the unit of the machine."""


def observation_space(task: Task) -> Box:
    """Return the space of observations, a number for each of ``task.places``, with finite bounds."""
    slowest, fastest = task.lowest_speed, task.highest_speed
    span = fastest - slowest
    trim = span if task.action == "speed" else task.largest_trim
    if task.drive == "motor":
        slowest, span, fastest = 0.0, fastest, OVERSPEED * fastest
    bounds = dict.fromkeys(FELT, (0.0, FORCE_RANGE * task.reference_force)) | {
        "speed": (slowest, fastest),
        "demand": (task.lowest_demand, task.highest_demand),
        "trim": (-trim, trim),
        "offset": (-span, span),
        "remaining_share": (0.0, 1.0),
        "steps_since_change": (0.0, float(task.shortest_hold)),
        "impacts_per_cycle": (0.0, IMPACT_RANGE),
        "bouncing_share": (0.0, 1.0),
    }
    bounds |= {entry.name: entry.bounds(task) for entry in task.added}
    low, high = np.array([bounds[name] for name in task.places], np.float32).T
    return Box(low.copy(), high.copy())


def sensed(task: Task, impacts: NDArray[np.int64], generators: Generators) -> tuple[Array, NDArray[np.int64]]:
    """Draw what sensors miss of a step of k machines, by generators of their own.

    Returns
    -------
    (errors, counted)
        (k, cycles + 1) of each cycle's peak force and of the share of bouncing, from 0 to 1, and (k,) how many of the
        ``impacts`` (k, cycles, sides) are counted.
    """
    errors, counted = np.empty((len(generators), task.cycles_per_step + 1)), impacts.sum(axis=(1, 2))
    for k, generator in enumerate(generators):
        generator.random(out=errors[k])
        if task.missed_impacts > 0.0:
            counted[k] = generator.binomial(counted[k], 1.0 - task.missed_impacts)
    return errors, counted
