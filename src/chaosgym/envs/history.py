"""What has the agent felt at each speed so far? The peak forces of the job, gathered by speed.

A machine is hidden from the agent, but it answers the same way when a speed is tried again. The memory adds, for every
bin of speed, the mean and the standard deviation of the peak forces measured there in this job, and how many.
"""

from typing import Any, cast

import gymnasium as gym
import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from chaosgym.envs.observation import Observation

Array = NDArray[np.float64]

BINS = 53
"""Bins over the range of the drive: 0.5 Hz of the beam, 5 rpm of the crank, centred on the speeds at both ends."""

FIRST_PEAK = 8
"""Place of the first measured peak in an observation; the speed is at place 0."""

WELL_KNOWN = 100.0
"""Peaks after which a bin counts as fully known."""


class SpeedMemory:
    """Peak forces by speed, of n jobs side by side.

    Parameters
    ----------
    space
        Of the observations, d numbers.
    """

    def __init__(self, space: Box) -> None:
        self.space = remembered_space(space)
        self._lowest, self._highest = float(space.low[0]), float(space.high[0])
        self._sums = np.zeros((0, 3, BINS))

    def start(self, observations: Observation) -> Observation:
        """Forget everything and take in the first observations (n, d) of n jobs; return (n, d + 3 BINS)."""
        self._sums = np.zeros((len(observations), 3, BINS))
        return self.add(observations)

    def restart(self, which: NDArray[np.bool_], observations: Observation) -> Observation:
        """Forget k of the jobs, ``which`` (n,), and take in their first observations (k, d); return (k, d + 3 BINS)."""
        self._sums[which] = _news(observations, self._bins(observations))
        return self._remembered(observations, self._sums[which])

    def add(self, observations: Observation) -> Observation:
        """Take in observations (n, d) and return them with what is remembered, (n, d + 3 BINS)."""
        self._sums += _news(observations, self._bins(observations))
        return self._remembered(observations, self._sums)

    def _bins(self, observations: Observation) -> NDArray[np.int64]:
        place = (observations[:, 0] - self._lowest) / (self._highest - self._lowest) * (BINS - 1)
        bins: NDArray[np.int64] = np.rint(place).astype(np.int64)
        return bins

    def _remembered(self, observations: Observation, sums: Array) -> Observation:
        count, total, squares = sums[:, 0], sums[:, 1], sums[:, 2]
        mean = total / np.maximum(count, 1.0)
        deviation = np.sqrt(np.maximum(squares / np.maximum(count, 1.0) - mean**2, 0.0))
        known = np.minimum(count / WELL_KNOWN, 1.0)
        return np.concatenate([observations, mean, deviation, known], axis=1, dtype=np.float32)


def _news(observations: Observation, bins: NDArray[np.int64]) -> Array:
    """Number, sum and sum of squares of the peaks of observations (n, d), each at its bin: (n, 3, BINS)."""
    peaks = observations[:, FIRST_PEAK:].astype(float)
    news = np.zeros((len(peaks), 3, BINS))
    jobs = np.arange(len(peaks))
    news[jobs, 0, bins] = peaks.shape[1]
    news[jobs, 1, bins] = peaks.sum(axis=1)
    news[jobs, 2, bins] = (peaks**2).sum(axis=1)
    return news


def remembered_space(space: Box) -> Box:
    """Return the space of observations with memory, of the space of those without."""
    ranges = np.repeat([space.high[FIRST_PEAK], space.high[FIRST_PEAK], 1.0], BINS)
    return Box(
        np.concatenate([space.low, np.zeros(3 * BINS)]).astype(np.float32),
        np.concatenate([space.high, ranges]).astype(np.float32),
    )


class RememberSpeeds(gym.Wrapper[Observation, NDArray[np.float32], Observation, NDArray[np.float32]]):
    """Adds the memory to the observations of a single environment, as ``env_wrapper`` of rl-zoo for instance."""

    def __init__(self, env: gym.Env[Observation, NDArray[np.float32]]) -> None:
        super().__init__(env)
        assert isinstance(env.observation_space, Box)
        self._memory = SpeedMemory(env.observation_space)
        self.observation_space = cast(Space[Observation], self._memory.space)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start a job, with nothing remembered."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._memory.start(observation[None])[0], info

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, Any, bool, bool, dict[str, Any]]:
        """Run a step and remember it."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self._memory.add(observation[None])[0], reward, terminated, truncated, info
