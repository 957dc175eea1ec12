"""What is a step worth to one who knows the machine? A shaping of the reward that changes no best policy.

In training the machines are known, so dynamic programming on their regime tables says how much can still be earned
from every speed, step by step. The change of that over a step, added to its reward, is what the step lost against the
best one: the agent is told at once and not at the end of the job. What it observes stays the same.

A. Y. Ng, D. Harada and S. Russell, Policy invariance under reward transformations, ICML 1999.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from tqdm import trange

from chaosgym.control.forecast import forecast_of, worth_of_steps
from chaosgym.envs.observation import REMAINING, SPEED

Array = NDArray[np.float64]


class ClairvoyantShaping(VecEnvWrapper):
    """Adds to each reward the change of what can still be earned, by the table of the machine and without damage.

    Parameters
    ----------
    envs
        With the observations of chaosgym's environments.
    """

    def __init__(self, envs: VecEnv) -> None:
        super().__init__(envs)
        pool, task = envs.get_attr("pool")[0], envs.get_attr("task")[0]
        self._speeds = pool.speeds
        self._ahead = np.zeros((len(pool), task.steps + 1, len(pool.speeds)))
        for k in trange(len(pool), desc="best schedules", unit="machine"):
            forecast = forecast_of(pool, pool.regimes(k), task)
            for step, worth in enumerate(worth_of_steps(forecast)):
                self._ahead[k, step] = forecast.best_within_reach(worth[:1])[0]

    def reset(self) -> Any:
        """Start all jobs."""
        observations = self.venv.reset()
        self._machines = np.array([info["machine"] for info in self.venv.unwrapped.reset_infos])
        self._potential = self._potential_of(observations, self._machines)
        return observations

    def step_wait(self) -> Any:
        """Run a step and shape its rewards."""
        observations, rewards, ended, infos = self.venv.step_wait()
        potential = np.where(ended, 0.0, self._potential_of(observations, self._machines))
        shaped = rewards + potential - self._potential
        if ended.any():
            starts = self.venv.unwrapped.reset_infos
            self._machines = np.where(ended, [info["machine"] for info in starts], self._machines)
            potential[ended] = self._potential_of(observations, self._machines)[ended]
        self._potential = potential
        return observations, shaped.astype(np.float32), ended, infos

    def _potential_of(self, observations: Any, machines: NDArray[np.int64]) -> Array:
        """What can still be earned (n,), interpolated between the speeds of the table."""
        done = np.rint((1.0 - observations[:, REMAINING]) * (self._ahead.shape[1] - 1)).astype(np.int64)
        rows = self._ahead[machines, done]
        return np.array(
            [np.interp(seen[SPEED], self._speeds, row) for seen, row in zip(observations, rows, strict=True)]
        )
