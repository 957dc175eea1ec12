"""Controllers that plan on maps: of the nominal model, of models within tolerances, or of the machine itself."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.control.controllers.controller import Array, Controller, Observations, seen
from chaosgym.control.maps import Maps


class Follow(Controller):
    """Does what is demanded."""

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
        task, share = self.task, self.fleet.share.mean(axis=0)
        trims = np.arange(-task.largest_trim, task.largest_trim + 1e-9, task.trim_step)
        demands = np.arange(task.lowest_demand, task.highest_demand + 1e-9, task.trim_step)
        at = np.clip(demands[:, None] + trims, task.lowest_speed, task.highest_speed)
        cost = task.deviation_weight * np.abs(at - demands[:, None])
        cost += task.type_iii_weight * share[self.fleet.nearest(at)]
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
        self._shares = np.array([maps.smoothed() for maps in levels])

    def share_at(self, progress: float) -> Array:
        """Shares of Type III (n, s) when a part of the job is done."""
        place = progress * (len(self._shares) - 1)
        low = min(int(place), max(0, len(self._shares) - 2))
        high = min(low + 1, len(self._shares) - 1)
        part = place - low
        return np.asarray((1.0 - part) * self._shares[low] + part * self._shares[high])

    def speeds(self, observations: Observations) -> Array:
        """The best speed of the map."""
        share = self.share_at(1.0 - float(seen(observations, "remaining_share").min()))
        return np.asarray(self.grid[self.cost(share, seen(observations, "demand"), self.grid).argmin(axis=1)])


class Schedule(MapFollower):
    """The best schedule on the machine's own map by dynamic programming, the demands to come known."""

    knows = "machine and future"

    def begin(self, envs: Any) -> None:
        """Plan all jobs."""
        demand = envs.jobs.demand[:, :-1]
        steps = demand.shape[1]
        cost = np.array([self.cost(self.share_at(t / steps), demand[:, t], self.grid) for t in range(steps)])
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
        mean = Maps(fleet.speeds, fleet.share.mean(axis=0, keepdims=True), fleet.mean_peak[:1])
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
