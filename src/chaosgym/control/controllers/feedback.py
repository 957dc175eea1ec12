"""Controllers that use measurements alone: where the peaks do not repeat, they try other speeds.

Thresholds and rates are in units of the sensor's error. They were chosen on machines that no comparison uses.
"""

from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.control.controllers.controller import THRESHOLD, Controller, Observations, irregular, place_of, seen
from chaosgym.control.maps import Maps

PATIENCE, SPACING = 2, 2
"""Steps before ``BackOff`` moves on, and trim steps between the rungs of its ladder."""

PRIOR_WEIGHT, OPTIMISM = 2.0, 0.3
"""Steps that the mean map of ``Bandit`` counts for, and standard deviations of the share that it subtracts."""

HALF_WILD, SOFTNESS = 1.0, 0.1
"""Measured irregularity at which a step of ``Bandit`` counts half, and the width over which it goes from 0 to 1."""


class BackOff(Controller):
    """At the demand; if that is irregular for two steps, at the next offset of a ladder, and anew with each demand.

    Parameters
    ----------
    remembers
        Whether speeds that were irregular in this job are skipped.
    classified
        Whether the trained sense of ``classifier="on"`` says what is irregular, instead of a threshold.
    """

    knows = "measurements"

    def __init__(self, *, remembers: bool = True, classified: bool = False) -> None:
        super().__init__()
        self.remembers, self.classified = remembers, classified

    @property
    def keywords(self) -> dict[str, Any]:
        """Keywords of the environment that it plays in."""
        return super().keywords | ({"classifier": "on"} if self.classified else {})

    def begin(self, envs: Any) -> None:
        """Start at the demand."""
        task = self.task
        sizes = np.arange(SPACING, round(task.largest_trim / task.trim_step) + 1, SPACING) * task.trim_step
        self.ladder = np.array([0.0, *(sign * size for size in sizes for sign in (-1.0, 1.0))])
        self._rung, self._wild = np.zeros(self.count, int), np.zeros(self.count, int)
        self._demand = np.full(self.count, np.nan)
        self._bad = np.zeros((self.count, len(task.grid)), np.bool_)

    def speeds(self, observations: Observations) -> Array:
        """The demand and the offset."""
        demand, speed, every = seen(observations, "demand"), seen(observations, "speed"), np.arange(self.count)
        wanted = np.clip(self._demand + self.ladder[self._rung], self.task.lowest_speed, self.task.highest_speed)
        there = np.abs(speed - wanted) < 0.3 * self.task.trim_step
        wild = irregular(observations, self.task, THRESHOLD, 1e-3, self.sure) > 0.5
        new = demand != self._demand
        self._demand = demand
        self._wild = np.where(there & wild & ~new, self._wild + 1, np.where(there, 0, self._wild))
        self._rung[new], self._wild[new] = 0, 0
        moves = self._wild >= PATIENCE
        if self.remembers:
            self._bad[every[moves], place_of(speed, self.task)[moves]] = True
        self._rung[moves] = (self._rung[moves] + 1) % len(self.ladder)
        self._wild[moves] = 0
        if self.remembers:
            for _ in self.ladder:
                bad = self._bad[every, place_of(demand + self.ladder[self._rung], self.task)]
                self._rung[bad] = (self._rung[bad] + 1) % len(self.ladder)
        return np.asarray(demand + self.ladder[self._rung])


class BestFelt(Controller):
    """At the speed within reach that cost least when it was felt in this job; each demand is felt first."""

    knows = "measurements"

    def begin(self, envs: Any) -> None:
        """Forget the last jobs."""
        self._steps, self._share, self._peak = np.zeros((3, self.count, len(self.task.grid)))

    def speeds(self, observations: Observations) -> Array:
        """The demand if it is new, or the speed of least cost."""
        task, grid, every = self.task, self.task.grid, np.arange(self.count)
        demand = seen(observations, "demand")
        self._feel(observations)
        felt = Maps(grid, self._share, self._peak)
        cost = self.cost(felt.share, felt.damage(task), demand, grid)
        far = np.abs(grid - demand[:, None]) > task.largest_trim + 0.5 * task.trim_step
        best = grid[np.where(far | (self._steps == 0.0), np.inf, cost).argmin(axis=1)]
        return np.where(self._steps[every, place_of(demand, task)] > 0.0, best, demand)

    def _feel(self, observations: Observations) -> None:
        """Take the step into the means of its speed."""
        here = np.arange(self.count), place_of(seen(observations, "speed"), self.task)
        self._steps[here] += 1.0
        wild = irregular(observations, self.task, THRESHOLD, 1e-3, self.sure)
        self._share[here] += (wild - self._share[here]) / self._steps[here]
        self._peak[here] += (seen(observations, "mean_peak_force") - self._peak[here]) / self._steps[here]


class Bandit(Controller):
    """Mean map of models, updated by the irregularity measured at each speed; uncertain speeds get a bonus.

    Parameters
    ----------
    fleet
        Maps of models within tolerances.
    """

    knows = "tolerances"

    def __init__(self, fleet: Maps) -> None:
        super().__init__()
        self.fleet = fleet

    def begin(self, envs: Any) -> None:
        """Start with the mean map."""
        prior = self.fleet.share.mean(axis=0)
        self._wild = np.tile(PRIOR_WEIGHT * prior, (self.count, 1)) + 0.05
        self._calm = np.tile(PRIOR_WEIGHT * (1.0 - prior), (self.count, 1)) + 0.05
        self._speed = np.full(self.count, np.nan)

    def speeds(self, observations: Observations) -> Array:
        """The speed of least expected cost less the optimism."""
        grid, speed = self.fleet.speeds, seen(observations, "speed")
        held = np.abs(speed - self._speed) < 0.5 * self.task.trim_step
        self._speed = speed
        chance = irregular(observations, self.task, HALF_WILD, SOFTNESS, self.sure)
        near = np.exp(-0.5 * ((grid - speed[:, None]) / self.task.trim_step) ** 2) * held[:, None]
        self._wild += near * chance[:, None]
        self._calm += near * (1.0 - chance)[:, None]
        counted = self._wild + self._calm
        share = self._wild / counted
        doubt = np.sqrt(share * (1.0 - share) / (counted + 1.0))
        hoped, demand = share - OPTIMISM * doubt, seen(observations, "demand")
        cost = self.cost(hoped, self.fleet.damage(self.task).mean(axis=0), demand, grid)
        return np.asarray(grid[cost.argmin(axis=1)])
