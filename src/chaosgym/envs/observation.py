"""What does the agent see? The speed, what is asked for, and what a force sensor reports of a step, with its errors."""

from collections.abc import Sequence

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from chaosgym.core.compilation import call
from chaosgym.envs.kernels.steps import sensed
from chaosgym.envs.task import Task
from chaosgym.machines.batch import Cycles
from chaosgym.monitor import HIGHEST, LIMIT

Array = NDArray[np.float64]
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

MONITOR = "monitor_level"
"""One more with ``monitor="on"``: the level of ``chaosgym.monitor``, an alarm above 1."""

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
    return (*OBSERVATION_NAMES, MONITOR) if task.monitor == "on" else OBSERVATION_NAMES


def observation_space(task: Task) -> Box:
    """Return the space of observations, (14,) or (15,), with finite bounds."""
    span, force = task.highest_speed - task.lowest_speed, FORCE_RANGE * task.load_rating
    trim = span if task.action == "speed" else task.largest_trim
    low = [task.lowest_speed, task.lowest_demand, -trim, -span, 0.0, 0.0] + [0.0] * len(FELT)
    high = [task.highest_speed, task.highest_demand, trim, span, 1.0, float(task.shortest_hold)]
    high += [force] * (len(FELT) - 2) + [IMPACT_RANGE, 1.0]
    if task.monitor == "on":
        low, high = [*low, 0.0], [*high, HIGHEST / LIMIT]
    return Box(np.array(low, np.float32), np.array(high, np.float32))


def felt(task: Task, cycles: Cycles, last: int, period: Array, generators: Generators) -> tuple[Array, Array]:
    """What sensors report of the ``last`` cycles of k machines, of a period [s] each, by generators of their own.

    Returns
    -------
    (values, peaks)
        (k, 8), the entries ``FELT``, and (k, last) measured peak forces [N].
    """
    count = len(generators)
    errors = np.empty((count, last + 1))
    for row, generator in zip(errors, generators, strict=True):
        generator.random(out=row)
    errors = (2.0 * errors - 1.0) * ([task.sensor_error] * last + [task.bouncing_error])
    values, peaks = np.empty((count, len(FELT))), np.empty((count, last))
    call(sensed, *cycles[1:], period, errors, peaks, values)
    if task.missed_impacts > 0.0:
        for row, generator in zip(values, generators, strict=True):
            row[6] = generator.binomial(int(row[6]), 1.0 - task.missed_impacts)
    values[:, 6] /= last
    return values, peaks
