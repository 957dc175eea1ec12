"""Train a speed schedule with PPO under a constraint: at most a given share of the steps may cost.

    python agents/train_ppo_lagrangian.py --env chaosgym/ImpactBeamTolerance-v0 --cost-limit 0.05 --out runs/ppolag-0

The same command goes on with a run that was interrupted. What the folder holds: agents/common.py.

PPO-Lagrangian of A. Ray, J. Achiam and D. Amodei, *Benchmarking Safe Exploration in Deep Reinforcement Learning*, 2019:
a multiplier weighs the advantage of the cost, from a critic of its own, against that of the reward, and rises while the
jobs cost more than allowed.
"""

from dataclasses import dataclass
from typing import Any

import common
import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from torch import nn

from chaosgym.control.learner_view import Memory

Array = NDArray[np.float32]


class CostRecorder(VecEnvWrapper):
    """Keeps ``info["cost"]`` of every step since the last ``take``."""

    def __init__(self, envs: VecEnv) -> None:
        super().__init__(envs)
        self._costs: list[list[float]] = []

    def reset(self) -> Any:
        """Start all jobs."""
        return self.venv.reset()

    def step_wait(self) -> Any:
        """Run a step and keep its costs."""
        observations, rewards, ended, infos = self.venv.step_wait()
        self._costs.append([info["cost"] for info in infos])
        return observations, rewards, ended, infos

    def take(self) -> Array:
        """Return the costs (steps, envs) and forget them."""
        costs = np.array(self._costs, np.float32)
        self._costs = []
        return costs


class LagrangianPPO(PPO):
    """PPO on the advantage of the reward less a multiplier times that of the cost.

    Parameters
    ----------
    cost_limit
        Largest mean cost of a step.
    multiplier_rate
        Increase of the multiplier in one update for each unit of cost above the limit.
    keywords
        Those of PPO; ``env`` must contain a ``CostRecorder``.
    """

    def __init__(
        self, *positional: Any, cost_limit: float = 0.05, multiplier_rate: float = 1.0, **keywords: Any
    ) -> None:
        self.cost_limit, self.multiplier_rate = cost_limit, multiplier_rate
        super().__init__(*positional, **keywords)

    def _setup_model(self) -> None:
        super()._setup_model()
        size = int(np.prod(self.observation_space.shape))
        self.cost_critic = nn.Sequential(nn.Linear(size, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, 1))
        self.cost_optimizer = torch.optim.Adam(self.cost_critic.parameters(), lr=self.lr_schedule(1.0))
        self.multiplier = nn.Parameter(torch.zeros(1), requires_grad=False)

    def _get_torch_save_params(self) -> tuple[list[str], list[str]]:
        states, variables = super()._get_torch_save_params()
        return [*states, "cost_critic", "cost_optimizer"], [*variables, "multiplier"]

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), "cost_critic", "cost_optimizer", "multiplier"]

    def train(self) -> None:
        """Weigh the advantages, let PPO update the policy, fit the cost critic, and move the multiplier."""
        buffer = self.rollout_buffer
        costs = self._recorder().take()
        observations = torch.as_tensor(buffer.observations, dtype=torch.float32).reshape(costs.size, -1)
        with torch.no_grad():
            values = self.cost_critic(observations).numpy().reshape(costs.shape)
            last = self.cost_critic(torch.as_tensor(self._last_obs, dtype=torch.float32)).numpy()[:, 0]
        begins = np.vstack([buffer.episode_starts[1:], self._last_episode_starts])
        advantages = self._advantages(costs, values, np.vstack([values[1:], last]), begins)
        targets = torch.as_tensor(advantages + values).reshape(-1)
        weight = float(self.multiplier)
        buffer.advantages = (buffer.advantages - weight * advantages) / (1.0 + weight)
        super().train()
        self._fit(observations, targets)
        self.multiplier += self.multiplier_rate * (float(costs.mean()) - self.cost_limit)
        self.multiplier.clamp_(min=0.0)

    def _recorder(self) -> CostRecorder:
        env: Any = self.env
        while not isinstance(env, CostRecorder):
            env = env.venv
        return env

    def _advantages(self, costs: Array, values: Array, following: Array, begins: Array) -> Array:
        """Generalised advantages of the cost (steps, envs), as PPO has them of the reward."""
        goes_on = 1.0 - begins
        errors = costs + self.gamma * following * goes_on - values
        advantages = np.zeros_like(errors)
        later = np.zeros_like(errors[0])
        for step in reversed(range(len(errors))):
            later = errors[step] + self.gamma * self.gae_lambda * goes_on[step] * later
            advantages[step] = later
        return advantages

    def _fit(self, observations: torch.Tensor, targets: torch.Tensor) -> None:
        for _ in range(self.n_epochs):
            for rows in torch.randperm(len(targets)).split(self.batch_size):
                loss = nn.functional.mse_loss(self.cost_critic(observations[rows])[:, 0], targets[rows])
                self.cost_optimizer.zero_grad()
                loss.backward()
                self.cost_optimizer.step()


@dataclass(frozen=True)
class Arguments:
    """Everything that decides a run."""

    env: str = "chaosgym/ImpactBeam-v0"
    steps: int = 300_000
    seed: int = 0
    out: str = "runs/ppo-lagrangian"
    cost_limit: float = 0.05
    multiplier_rate: float = 1.0
    envs: int = 16
    rollout: int = 200
    batch: int = 400
    epochs: int = 8
    learning_rate: float = 2e-4
    gamma: float = 0.97
    gae_lambda: float = 0.9
    entropy: float = 0.0
    log_std: float = -2.0
    units: int = 128
    memory: Memory = "belief"
    increments: bool = True
    shaping: bool = True
    evaluate_every: int = 25_000
    jobs: int = 16
    threads: int = 1


def main() -> None:
    """Train, save, and say where."""
    arguments = common.parse(Arguments, __doc__)
    run = common.Run(arguments, CostRecorder)
    model = run.resumed(LagrangianPPO) or LagrangianPPO(
        "MlpPolicy",
        run.envs,
        cost_limit=arguments.cost_limit,
        multiplier_rate=arguments.multiplier_rate,
        n_steps=arguments.rollout,
        batch_size=arguments.batch,
        n_epochs=arguments.epochs,
        learning_rate=arguments.learning_rate,
        gamma=arguments.gamma,
        gae_lambda=arguments.gae_lambda,
        ent_coef=arguments.entropy,
        seed=arguments.seed,
        device="cpu",
        policy_kwargs={"log_std_init": arguments.log_std, "net_arch": [arguments.units, arguments.units]},
    )
    run.learn(model)


if __name__ == "__main__":
    main()
