"""Simulating ahead with the nominal model: from where its copy is now, towards every speed in reach."""

from typing import Any

import numpy as np

from chaosgym.control.controllers.controller import Array, Controller, Observations, seen
from chaosgym.envs.judge import MISS, recurrence_miss
from chaosgym.simulation.batch import batch_of

HORIZON = 24
"""Cycles that are simulated ahead."""


class RecedingHorizon(Controller):
    """Searches anew every ten steps and when the demand changes; copies of the nominal model run beside the machines.

    Parameters
    ----------
    every
        Steps between searches.
    """

    knows = "model"

    def __init__(self, *, every: int = 10) -> None:
        super().__init__()
        self.every = every

    def begin(self, envs: Any) -> None:
        """Start the copies as the machines were started."""
        task, self._model = self.task, envs.model
        self._trims = np.arange(-task.largest_trim, task.largest_trim + 1e-9, task.trim_step)
        self._batch = batch_of(self._model, self.count * (1 + len(self._trims)))
        for place in range(len(self._batch)):
            self._batch.start(place, self._model.at(float(envs.jobs.speed[place % self.count])))
        self._batch.run(np.arange(self.count), task.run_in_cycles)
        self._step, self._demand = 0, np.full(self.count, np.nan)
        self._target = envs.jobs.speed.copy()

    def speeds(self, observations: Observations) -> Array:
        """The target of the last search."""
        demand, task = seen(observations, "demand"), self.task
        if self._step:
            self._batch.set_speeds(np.arange(self.count), seen(observations, "speed"))
            self._batch.run(np.arange(self.count), task.cycles_per_step)
        due = (demand != self._demand) | (self._step % self.every == 0)
        self._demand = demand
        self._step += 1
        if due.any():
            jobs = np.flatnonzero(due)
            self._target[jobs] = self._best(jobs, demand[jobs])
        return np.asarray(self._target)

    def _best(self, jobs: Any, demand: Array) -> Array:
        task, width = self.task, len(self._trims)
        targets = np.clip(demand[:, None] + self._trims, task.lowest_speed, task.highest_speed)
        places = self.count + jobs[:, None] * width + np.arange(width)
        for job, row in zip(jobs.tolist(), places, strict=True):
            self._batch.branch(job, row)
        which = places.ravel()
        self._batch.set_speeds(which, targets.ravel())
        peaks = self._batch.run(which, HORIZON).peak_force[:, :, 0]
        wild = (recurrence_miss(peaks) > MISS).reshape(targets.shape).astype(float)
        cost = task.deviation_weight * np.abs(targets - demand[:, None]) + task.type_iii_weight * wild
        return np.asarray(targets[np.arange(len(jobs)), cost.argmin(axis=1)])
