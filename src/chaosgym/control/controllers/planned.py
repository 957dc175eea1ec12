"""Controllers that plan: on maps of a model or of the machine itself, on a belief, or by simulating ahead."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.control.controllers.controller import THRESHOLD, Controller, Observations, irregular, seen
from chaosgym.control.maps import Maps
from chaosgym.envs.judge import MISS, recurrence_miss


class Follow(Controller):
    """Runs at the demand."""

    def speeds(self, observations: Observations) -> Array:
        """The demand."""
        return seen(observations, "demand")


class ConstantTrim(Controller):
    """The one trim that costs least on average over machines and demands, by maps of models.

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
        """Find the trim."""
        task = self.task
        trims = np.arange(-task.largest_trim, task.largest_trim + 1e-9, task.trim_step)
        demands = np.arange(task.lowest_demand, task.highest_demand + 1e-9, task.trim_step)
        at = np.clip(demands[:, None] + trims, task.lowest_speed, task.highest_speed)
        felt = task.type_iii_weight * self.fleet.share + task.damage_weight * self.fleet.damage(task)
        cost = task.deviation_weight * np.abs(at - demands[:, None]) + felt.mean(axis=0)[self.fleet.nearest(at)]
        self.trim = float(trims[cost.mean(axis=0).argmin()])

    def speeds(self, observations: Observations) -> Array:
        """The demand and the trim."""
        return seen(observations, "demand") + self.trim


class SkipBands(Controller):
    """Waits at the nearest edge of the nominal model's bands of Type III, as drives do that skip bands of speed.

    Parameters
    ----------
    nominal
        Map of the nominal model, one row.
    """

    knows = "model"

    def __init__(self, nominal: Maps) -> None:
        super().__init__()
        self.nominal = nominal

    def speeds(self, observations: Observations) -> Array:
        """The nearest speed outside the bands."""
        demand = seen(observations, "demand")
        distance = np.abs(self.nominal.speeds - demand[:, None]) + 1e6 * (self.nominal.share[0] > 0.5)
        inside = self.nominal.share[0][self.nominal.nearest(demand)] > 0.5
        return np.where(inside, self.nominal.speeds[distance.argmin(axis=1)], demand)


class MapFollower(Controller):
    """Goes to the speed that costs least at the present demand, by the machine's own map; the future is unknown.

    Parameters
    ----------
    levels
        Maps of the machines that are played, in their order: of new ones, and, if they wear, of worn ones, evenly
        spaced in clearance up to the last step.
    """

    knows = "machine"

    def __init__(self, levels: list[Maps]) -> None:
        super().__init__()
        self.grid = levels[0].speeds
        self._levels = [maps.smoothed() for maps in levels]

    def cost_at(self, progress: float, demand: Array) -> Array:
        """Cost (n, s) of a step at each speed when a part of the job is done."""
        place = progress * (len(self._levels) - 1)
        low = min(int(place), max(0, len(self._levels) - 2))
        high = min(low + 1, len(self._levels) - 1)
        costs = [
            self.cost(maps.share, maps.damage(self.task), demand, self.grid)
            for maps in (self._levels[low], self._levels[high])
        ]
        return np.asarray((1.0 - place + low) * costs[0] + (place - low) * costs[1])

    def speeds(self, observations: Observations) -> Array:
        """The best speed of the map."""
        progress = 1.0 - float(seen(observations, "remaining_share").min())
        return np.asarray(self.grid[self.cost_at(progress, seen(observations, "demand")).argmin(axis=1)])


class Schedule(MapFollower):
    """The best schedule on the machine's own map by dynamic programming, the demands to come known."""

    knows = "machine and future"

    def begin(self, envs: Any) -> None:
        """Plan all jobs."""
        demand = envs.jobs.demand[:, :-1]
        steps = demand.shape[1]
        cost = np.array([self.cost_at(t / steps, demand[:, t]) for t in range(steps)])
        self._plan = self.grid[best_schedule(cost, self._places(envs.jobs.speed), self._reach())]
        self._step = 0

    def _places(self, speeds: Array) -> NDArray[np.int64]:
        return np.asarray(np.abs(self.grid - speeds[:, None]).argmin(axis=1))

    def _reach(self) -> int:
        return int(self.task.slew_limit / (self.grid[1] - self.grid[0]) + 1e-9)

    def speeds(self, observations: Observations) -> Array:
        """The next speed of the plan."""
        self._step += 1
        return np.asarray(self._plan[self._step - 1])


class CommonSchedule(Schedule):
    """The best schedule on the mean map of models within tolerances, the same for all machines; demands known.

    Parameters
    ----------
    fleet
        Maps of models within tolerances.
    """

    knows = "tolerances and future"

    def __init__(self, fleet: Maps) -> None:
        mean = Maps(fleet.speeds, *(values.mean(axis=0, keepdims=True) for values in (fleet.share, fleet.mean_peak)))
        super().__init__([mean])


def best_schedule(cost: Array, start: NDArray[np.int64], reach: int) -> NDArray[np.int64]:
    """Places (steps, n) of least total cost (steps, n, s), from places ``start`` (n,), at most ``reach`` a step."""
    steps, count, speeds = cost.shape
    worth = np.zeros((count, speeds))
    choice = np.zeros((steps, count, speeds), np.int64)
    moves = np.arange(speeds)[:, None] + np.arange(-reach, reach + 1)
    outside = (moves < 0) | (moves >= speeds)
    moves = moves.clip(0, speeds - 1)
    for step in reversed(range(steps)):
        ahead = np.where(outside, np.inf, (cost[step] + worth)[:, moves])
        best = ahead.argmin(axis=2)
        choice[step] = moves[np.arange(speeds), best]
        worth = ahead.min(axis=2)
    places, every = np.empty((steps, count), np.int64), np.arange(count)
    now = start
    for step in range(steps):
        now = choice[step, every, now]
        places[step] = now
    return places


HORIZON, EVERY = 24, 10
"""Cycles that are simulated ahead, and steps between searches."""

USUAL_MISS, TEMPER = 1.33, 0.5
"""Miss of a mean peak, in errors of the sensor, that is nothing unusual, and share of a step's evidence that counts."""


class RecedingHorizon(Controller):
    """Searches every ten steps and when the demand changes; copies of the nominal model run beside the machines."""

    knows = "model"

    def begin(self, envs: Any) -> None:
        """Start the copies as the machines were started."""
        task, self._model = self.task, envs.model
        self._trims = np.arange(-task.largest_trim, task.largest_trim + 1e-9, task.trim_step)
        self._batch = self._model.batch(self.count * (1 + len(self._trims)))
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
        due = (demand != self._demand) | (self._step % EVERY == 0)
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
        peaks = self._model.sensed(self._batch.run(which, HORIZON).peak_force)
        wild = (recurrence_miss(peaks) > MISS).reshape(targets.shape).astype(float)
        cost = task.deviation_weight * np.abs(targets - demand[:, None]) + task.type_iii_weight * wild
        return np.asarray(targets[np.arange(len(jobs)), cost.argmin(axis=1)])


class Belief(Controller):
    """Goes to the speed of least expected cost over simulated machines, weighed by how well their mean peaks fit.

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
        """Start from a uniform prior over the simulated machines."""
        shape = (self.count, len(self.fleet.speeds))
        self._fit = np.zeros((self.count, len(self.fleet.share)))
        self._wild, self._visits = np.zeros(shape), np.zeros(shape)
        self._speed = np.full(self.count, np.nan)

    def speeds(self, observations: Observations) -> Array:
        """The best speed on the expected map, updated by what was measured at the speeds visited."""
        speed, every = seen(observations, "speed"), np.arange(self.count)
        held = np.abs(speed - self._speed) < 0.5 * self.task.trim_step
        self._speed = speed
        place = self.fleet.nearest(speed)
        error = USUAL_MISS * max(self.task.sensor_error, 1e-3 * self.task.reference_force)
        miss = (seen(observations, "mean_peak_force")[:, None] - self.fleet.mean_peak[:, place].T) / error
        self._fit -= TEMPER * np.where(held[:, None], np.log1p(0.5 * miss**2), 0.0)
        weight = np.exp(self._fit - self._fit.max(axis=1, keepdims=True))
        weight /= weight.sum(axis=1, keepdims=True)
        self._wild[every, place] += irregular(observations, self.task, THRESHOLD, 0.1, self.sure) * held
        self._visits[every, place] += held
        share = (weight @ self.fleet.share + self._wild) / (1.0 + self._visits)
        damage, grid = weight @ self.fleet.damage(self.task), self.fleet.speeds
        return np.asarray(grid[self.cost(share, damage, seen(observations, "demand"), grid).argmin(axis=1)])
