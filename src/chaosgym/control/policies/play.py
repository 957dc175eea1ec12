"""What happens when a policy runs a job? One job, step by step, as arrays."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from chaosgym.envs.tasks import Status
from chaosgym.machines.parameters import parameters_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PlayedJob:
    """A job, one entry a step unless stated otherwise.

    Attributes
    ----------
    env, seed, unit
        Id of the environment, seed of the job, unit of the speeds.
    speed : (steps,)
        In that unit.
    peak_force : (steps, cycles)
        Measured peak forces [N].
    type_iii, cost : (steps,) bool
        Whether the step counts as Type III, and whether it costs.
    damage : (steps,)
        Share of its life that the joint has used up.
    reward : (steps,)
        Of the task.
    force_limit
        Of the task [N].
    status
        How the job ended.
    """

    env: str
    seed: int
    unit: str
    speed: Array
    peak_force: Array
    type_iii: NDArray[np.bool_]
    cost: NDArray[np.bool_]
    damage: Array
    reward: Array
    force_limit: float
    status: Status

    def as_dict(self) -> dict[str, Any]:
        """Sums and shares, then the steps, as plain numbers."""
        return {
            "env": self.env,
            "seed": self.seed,
            "status": self.status.name.lower(),
            "return": float(self.reward.sum()),
            "type_iii_share": float(self.type_iii.mean()),
            "cost_share": float(self.cost.mean()),
            "damage": float(self.damage[-1]),
            "unit": self.unit,
            "speed": self.speed.tolist(),
            "peak_force_N": self.peak_force.tolist(),
            "type_iii": self.type_iii.tolist(),
        }


def play(env: gym.Env[Any, Any], policy: Callable[[Any], Any], seed: int) -> PlayedJob:
    """Run one job of an environment by a policy from observations to actions."""
    observation, _ = env.reset(seed=seed)
    first = env.get_wrapper_attr("observation_names").index("peak_force_1")
    measured = slice(first, first + env.get_wrapper_attr("task").cycles_per_step)
    rows, peaks, status, ended = [], [], Status.RUNNING, False
    while not ended:
        observation, reward, terminated, truncated, info = env.step(policy(observation))
        rows.append((info["speed"], info["cost_type_iii"], info["cost"], info["damage"], float(reward)))
        peaks.append(observation[measured])
        status, ended = Status(info["status"]), terminated or truncated
    speed, type_iii, cost, damage, rewards = np.array(rows, dtype=float).T
    machine: Any = env.get_wrapper_attr("nominal")
    assert env.spec is not None
    return PlayedJob(
        env.spec.id,
        seed,
        parameters_of(machine)[machine.speed_field].unit,
        speed,
        np.array(peaks, dtype=float),
        type_iii > 0.0,
        cost > 0.0,
        damage,
        rewards,
        env.get_wrapper_attr("task").force_limit,
        status,
    )
