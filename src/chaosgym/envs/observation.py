"""Observations: speed, demand, and what a force sensor reports of a step, with its errors."""

from collections.abc import Sequence

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.envs.task import Task
from chaosgym.recordings.monitor import HIGHEST, LIMIT

Observation = NDArray[np.float32]
Generators = Sequence[np.random.Generator]

FORCE_RANGE = 5.0
"""Range of the force sensors in units of the load rating."""

IMPACT_RANGE = 200.0
"""Impacts a cycle at which the counter saturates."""

COMMANDED = ("speed", "demand", "trim", "offset", "remaining_share", "steps_since_change")
FELT = (
    "mean_peak_force",
    "std_peak_force",
    "max_peak_force",
    "repeat_1",
    "repeat_2",
    "repeat_4",
    "impacts_per_cycle",
    "bouncing_share",
)
OBSERVATION_NAMES = (*COMMANDED, *FELT)
"""Entries of an observation, in their order."""

ASKED = {
    "monitor": ("on", "monitor_level"),
    "drive": ("motor", "set_point"),
    "classifier": ("on", "irregular_probability"),
}
"""Entries that follow where a keyword has this value: the level of the monitor, an alarm above 1; the speed at
which the motor gives no torque; and how likely the machine's trained classifier of records holds the motion at this
speed irregular."""

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


def observation_names(task: Task) -> tuple[str, ...]:
    """Return the entries of an observation of a task."""
    return (*OBSERVATION_NAMES, *(ASKED[keyword][1] for keyword in asked_of(task)))


def asked_of(task: Task) -> tuple[str, ...]:
    """Return the keywords of the entries that a task adds, in their order."""
    return tuple(keyword for keyword in ASKED if getattr(task, keyword) == ASKED[keyword][0])


def observation_space(task: Task) -> Box:
    """Return the space of observations, (14,) and one more for each keyword of ``ASKED``, with finite bounds."""
    span, force = task.highest_speed - task.lowest_speed, FORCE_RANGE * task.reference_force
    trim = span if task.action == "speed" else task.largest_trim
    slowest, fastest = task.lowest_speed, task.highest_speed
    if task.drive == "motor":
        slowest, fastest = 0.0, OVERSPEED * fastest
        span = fastest
    low = [slowest, task.lowest_demand, -trim, -span, 0.0, 0.0] + [0.0] * len(FELT)
    high = [fastest, task.highest_demand, trim, span, 1.0, float(task.shortest_hold)]
    high += [force] * (len(FELT) - 2) + [IMPACT_RANGE, 1.0]
    most = {"monitor": HIGHEST / LIMIT, "drive": task.highest_speed, "classifier": 1.0}
    asked = [most[keyword] for keyword in asked_of(task)]
    low, high = low + [0.0] * len(asked), high + asked
    return Box(np.array(low, np.float32), np.array(high, np.float32))


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
