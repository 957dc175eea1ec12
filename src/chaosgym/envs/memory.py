"""A wrapper that adds the measurements of the job by speed, and how far they lie from the mean over machines.

env = VisitedSpeeds(gym.make("chaosgym/ImpactBeamTolerance-v1"))

Adds to the observation, in the order of ``SpeedMemory.names``:

- speed and peaks of the last three observations;
- for every speed around the demand, how irregular the peaks were there in this job, and whether it was visited;
- how far mean peak, impacts and bouncing lie from their usual values at this speed, now and on average over the job.
  Usual is the mean over all machines met so far: a table that grows while training runs, and is kept with the policy.
"""

from typing import Any, cast

import gymnasium as gym
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.envs.kernels.steps import PLACE, REPEATS
from chaosgym.envs.observation import Observation, observation_space
from chaosgym.envs.task import Task

PAST = 3
"""Earlier observations that are kept."""

KEPT = ("speed", "offset", "mean_peak_force", "std_peak_force", "repeat_1", "repeat_2", "repeat_4")
"""Their entries that are."""

REACH = 12
"""Trim steps to either side of the demand for which the memory gives the measurements."""

COMPARED = ("mean_peak_force", "impacts_per_cycle", "bouncing_share")
"""Entries that are compared with their usual values."""

LARGEST = 4.0
"""Deviations from the usual value are cut off here, in standard deviations."""

_KEPT = [getattr(PLACE, name) for name in KEPT]
_COMPARED = [getattr(PLACE, name) for name in COMPARED]
_REPEATS = [place for place, _ in REPEATS]


def irregularity(observations: NDArray[Any]) -> Array:
    """Mean difference of peaks a period apart, (...) [N], least over periods 1, 2, 4, of observations (..., entries).

    Sensor errors of half width e alone make it 2 e / 3, whatever the period.
    """
    scatter = 1.155 * observations[..., PLACE.std_peak_force]
    return np.asarray(np.minimum(scatter, observations[..., _REPEATS].min(axis=-1)), dtype=float)


class Usual:
    """Sums over all machines met, by speed: ``count`` (speeds,), ``total`` and ``squares`` (speeds, 3)."""

    def __init__(self, speeds: int) -> None:
        self.count = np.zeros(speeds)
        self.total, self.squares = np.zeros((speeds, len(COMPARED))), np.zeros((speeds, len(COMPARED)))

    def add(self, places: NDArray[np.int64], values: Array) -> None:
        """Take in values (n, 3) at the places (n,) of speeds."""
        np.add.at(self.count, places, 1.0)
        np.add.at(self.total, places, values)
        np.add.at(self.squares, places, values**2)

    def deviation(self, places: NDArray[np.int64], values: Array, floor: Array) -> Array:
        """Distances from the mean (n, 3) in standard deviations, each with a floor; 0 before enough observations."""
        count = np.maximum(self.count[places], 1.0)[:, None]
        mean = self.total[places] / count
        spread = np.sqrt(np.maximum(self.squares[places] / count - mean**2, 0.0))
        known = self.count[places][:, None] >= 30.0
        return np.where(known, np.clip((values - mean) / (spread + floor), -LARGEST, LARGEST), 0.0)


class SpeedMemory:
    """Memories of N jobs side by side.

    Parameters
    ----------
    task
        Whose speeds are remembered.
    count
        N.
    usual
        Values to compare with; a new table by default.
    learns
        Whether the table takes in what is observed.
    """

    def __init__(self, task: Task, count: int, usual: Usual | None = None, *, learns: bool = True) -> None:
        self.task, self.learns = task, learns
        self._lowest, self._spacing = task.lowest_speed, task.trim_step
        speeds = len(task.grid)
        self.usual = usual or Usual(speeds)
        self._felt, self._seen = np.zeros((count, speeds)), np.zeros((count, speeds))
        self._past = np.zeros((count, PAST, len(KEPT)))
        self._last = np.zeros((count, len(KEPT)))
        self._sum, self._weight = np.zeros((count, len(COMPARED))), np.zeros((count, 1))
        force = max(task.sensor_error, 1e-3 * task.reference_force)
        self._floor = np.array([force / 3.0, 0.5, 0.005])
        self._noise = force

    @staticmethod
    def names() -> tuple[str, ...]:
        """Names of the entries that are added."""
        past = [f"{name}_{k}_steps_ago" for k in range(PAST, 0, -1) for name in KEPT]
        around = [f"{what}_{k:+d}" for what in ("felt", "visited") for k in range(-REACH, REACH + 1)]
        usual = [f"{name}_{when}" for when in ("unusual", "unusual_on_average") for name in COMPARED]
        return (*past, *around, *usual)

    def unusual(self, observations: Array) -> Array:
        """How far readings lie from what is usual at their speed, in standard deviations, (k, 3), of (k, entries)."""
        return self.usual.deviation(self._place(observations), observations[:, _COMPARED], self._floor)

    def _place(self, observations: Array) -> NDArray[np.int64]:
        """Places of the speeds of observations (k, entries), (k,)."""
        near = np.rint((observations[:, PLACE.speed] - self._lowest) / self._spacing)
        return near.astype(np.int64).clip(0, self._felt.shape[1] - 1)

    def forget(self, jobs: NDArray[np.bool_]) -> None:
        """Forget the jobs that a mask (N,) marks."""
        for values in (self._felt, self._seen, self._past, self._last, self._sum, self._weight):
            values[jobs] = 0.0

    def add(self, observations: Observation) -> Observation:
        """Take in the observations (N, entries) of a step; return them with what is remembered, (N, entries + m)."""
        return self.first(np.ones(len(observations), np.bool_), observations)

    def first(self, jobs: NDArray[np.bool_], observations: Observation) -> Observation:
        """As ``add``, for the jobs that a mask (N,) marks: (k, entries + m) for observations (N, entries)."""
        every = np.flatnonzero(jobs)
        seen = observations[every].astype(float)
        place = self._place(seen)
        felt = irregularity(seen)
        before = self._felt[every, place]
        self._felt[every, place] = np.where(self._seen[every, place] > 0.0, 0.5 * (before + felt), felt)
        self._seen[every, place] = 1.0
        self._past[every] = np.concatenate([self._past[every, 1:], self._last[every, None]], axis=1)
        self._last[every] = seen[:, _KEPT]
        values = seen[:, _COMPARED]
        if self.learns:
            self.usual.add(place, values)
        unusual = self.unusual(seen)
        weight = np.where(felt < 1.2 * self._noise, 1.0, 0.2)[:, None]
        self._sum[every] += weight * unusual
        self._weight[every] += weight
        around = self._around(every, seen[:, PLACE.demand])
        average = self._sum[every] / (self._weight[every] + 0.5)
        parts = (seen, self._past[every].reshape(len(seen), -1), *around, unusual, average)
        return np.concatenate(parts, axis=1).astype(np.float32)

    def _around(self, every: NDArray[np.int64], demand: Array) -> tuple[Array, Array]:
        """Measured irregularity, and whether a speed was visited, around demands (k,); -1 beyond the drive's range."""
        near = np.rint((demand - self._lowest) / self._spacing).astype(np.int64)[:, None]
        place = near + np.arange(-REACH, REACH + 1)
        inside = (place >= 0) & (place < self._felt.shape[1])
        place = place.clip(0, self._felt.shape[1] - 1)
        rows = every[:, None]
        return self._felt[rows, place] * inside, np.where(inside, self._seen[rows, place], -1.0)


def remembered_space(task: Task) -> Box:
    """Space of the observations of ``task`` with what is remembered."""
    plain = observation_space(task)
    kept_low, kept_high = np.tile(plain.low[_KEPT], PAST), np.tile(plain.high[_KEPT], PAST)
    around, usual = 2 * REACH + 1, 2 * len(COMPARED)
    force = plain.high[PLACE.repeat_1]
    low = [plain.low, np.minimum(kept_low, 0.0), np.zeros(around), np.full(around, -1.0), np.full(usual, -LARGEST)]
    high = [plain.high, kept_high, np.full(around, force), np.ones(around), np.full(usual, LARGEST)]
    return Box(np.concatenate(low).astype(np.float32), np.concatenate(high).astype(np.float32))


class VisitedSpeeds(gym.Wrapper[Observation, Any, Observation, Any]):
    """The environment with a ``SpeedMemory``, forgotten at every reset but for what is usual.

    Parameters
    ----------
    env
        A chaosgym environment of one machine.
    usual, learns
        As for ``SpeedMemory``.
    """

    def __init__(self, env: gym.Env[Observation, Any], usual: Usual | None = None, *, learns: bool = True) -> None:
        super().__init__(env)
        task: Task = env.get_wrapper_attr("task")
        self.memory = SpeedMemory(task, 1, usual, learns=learns)
        self.observation_space = cast(Any, remembered_space(task))
        self.observation_names = (*env.get_wrapper_attr("observation_names"), *SpeedMemory.names())

    def reset(self, **keywords: Any) -> tuple[Observation, dict[str, Any]]:
        """Start a job with nothing remembered."""
        observation, info = self.env.reset(**keywords)
        self.memory.forget(np.ones(1, np.bool_))
        return self.memory.add(observation[None])[0], info

    def step(self, action: Any) -> tuple[Observation, Any, bool, bool, dict[str, Any]]:
        """Run one step and remember it."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self.memory.add(observation[None])[0], reward, terminated, truncated, info
