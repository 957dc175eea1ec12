"""What speed is asked for? A production demand that changes every 20 to 40 steps and is not announced."""

import numpy as np
from numpy.typing import NDArray

from chaosgym.envs.task import Task

Array = NDArray[np.float64]


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
    return np.asarray(np.clip(grid, low, high))
