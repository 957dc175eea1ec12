"""How good is a speed schedule? Jobs run by a policy, and what they cost."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from tqdm import trange

from chaosgym.errors import ParameterError

Array = NDArray[np.float64]
Policy = Callable[[Any], Any]
"""From an observation to an action."""


@dataclass(frozen=True)
class Evaluation:
    """Results of some jobs, one entry a job; ``speeds`` holds the speed at every step of the last one.

    Attributes
    ----------
    returns : (jobs,)
        Sum of the rewards.
    type_iii_share : (jobs,)
        Share of the steps that count as Type III.
    cost_share : (jobs,)
        Share of the steps with a cost.
    damage : (jobs,)
        Damage at the end.
    time_cost : (jobs,)
        Duration in units of the job at top speed, weighted as in the reward.
    speeds : (steps,)
        In the machine's unit.
    """

    returns: Array
    type_iii_share: Array
    cost_share: Array
    damage: Array
    time_cost: Array
    speeds: Array

    def summary(self) -> dict[str, float]:
        """Means over the jobs."""
        return {
            "return": float(self.returns.mean()),
            "return_std": float(self.returns.std()),
            "type_iii_share": float(self.type_iii_share.mean()),
            "cost_share": float(self.cost_share.mean()),
            "damage": float(self.damage.mean()),
            "time_cost": float(self.time_cost.mean()),
        }


def constant_speed(env: gym.Env[Any, Any], speed: float) -> Policy:
    """Policy that commands one speed, in the machine's unit.

    Raises
    ------
    ParameterError
        If the drive can't go at that speed.
    """
    drive: Any = env.get_wrapper_attr("drive")
    if not drive.lowest_speed <= speed <= drive.highest_speed:
        raise ParameterError(
            f"speed = {speed:g} is out of range; allowed: {drive.lowest_speed:g} to {drive.highest_speed:g}"
        )
    action = np.array([drive.action_for(speed)], dtype=np.float32)
    return lambda observation: action


def evaluate(
    env: gym.Env[Any, Any], policy: Policy, jobs: int, seed: int, *, progress: str | None = None
) -> Evaluation:
    """Run whole jobs; job i is reset with seed + i, so that all policies meet the same machines and sensor errors.

    ``progress`` names a progress bar on standard error.
    """
    rows = []
    for job in trange(jobs, desc=progress, unit="job", disable=progress is None):
        observation, _ = env.reset(seed=seed + job)
        rewards, infos, ended = [], [], False
        while not ended:
            observation, reward, terminated, truncated, info = env.step(policy(observation))
            rewards.append(float(reward))
            infos.append(info)
            ended = terminated or truncated
        rows.append(
            (
                sum(rewards),
                np.mean([info["cost_type_iii"] for info in infos]),
                np.mean([info["cost"] for info in infos]),
                infos[-1]["damage"],
                -sum(info["reward_time"] for info in infos),
            )
        )
        speeds = np.array([info["speed"] for info in infos])
    returns, type_iii, cost, damage, time_cost = np.array(rows, dtype=float).T
    return Evaluation(returns, type_iii, cost, damage, time_cost, speeds)
