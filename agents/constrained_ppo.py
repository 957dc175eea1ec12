"""PPO under a constraint: as close to the demand as possible with at most a given share of Type III.

    python agents/constrained_ppo.py --env chaosgym/ImpactBeamTolerance-v1 --limit 0.05 --out runs/constrained-0

The same command goes on with a run that was interrupted, and ends as if it had not been. The folder holds progress.csv
(a row every 10,000 steps), checkpoint.bin, which only who wrote it can load, and then policy.json and weights.npz.
"""

import argparse
from pathlib import Path
from typing import Any

from training import Progress, load_checkpoint, run

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecMonitor, VecNormalize
from torch import nn

from chaosgym.control.policies import save_policy
from chaosgym.control.policies.export import exported
from chaosgym.envs import SB3VecEnv
from chaosgym.envs.sb3 import SB3VisitedSpeeds

Array = NDArray[np.float32]

HOLD_BIAS = 2.0
"""Logit of holding the speed at the start: motion settles only at a speed that is held."""


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", default="chaosgym/ImpactBeamTolerance-v1", help="Id, or file of a machine.")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=int, default=300_000)
    parser.add_argument("--out", type=Path, default=Path("runs/constrained"))
    parser.add_argument("--envs", type=int, default=64)
    parser.add_argument("--every", type=int, default=10_000, help="Steps between rows and checkpoints.")
    parser.add_argument("--rollout", type=int, default=60)
    parser.add_argument("--batch", type=int, default=960)
    parser.add_argument("--epochs", type=int, default=6)
    parser.add_argument("--learning-rate", type=float, default=1e-3)
    parser.add_argument("--gamma", type=float, default=0.95)
    parser.add_argument("--gae-lambda", type=float, default=0.9)
    parser.add_argument("--limit", type=float, default=None, help="Of the mean cost; default: the task's cost_budget.")
    parser.add_argument("--units", type=int, default=64)
    return parser.parse_args()


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
        Increase of the multiplier in one update for each unit of mean cost above the limit. At 4 it reaches 1 in some
        five updates if a twentieth of the steps is too much.
    keywords
        Those of PPO; ``env`` must contain a ``CostRecorder``.
    """

    def __init__(
        self, *positional: Any, cost_limit: float = 0.05, multiplier_rate: float = 4.0, **keywords: Any
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


def train(asked: argparse.Namespace) -> None:
    """Train, or go on, until the steps are done."""
    native = VecMonitor(SB3VecEnv(asked.env, asked.envs, type_iii_weight=0.0))
    envs = VecNormalize(CostRecorder(SB3VisitedSpeeds(native)), gamma=asked.gamma)
    model, kept = load_checkpoint(asked.out, LagrangianPPO, envs) or (None, None)
    if model is None:
        model = LagrangianPPO(
            "MlpPolicy",
            envs,
            cost_limit=envs.get_attr("task")[0].cost_budget if asked.limit is None else asked.limit,
            n_steps=asked.rollout,
            batch_size=asked.batch,
            n_epochs=asked.epochs,
            learning_rate=lambda left: asked.learning_rate * (0.1 + 0.9 * left),
            gamma=asked.gamma,
            gae_lambda=asked.gae_lambda,
            seed=asked.seed,
            device="cpu",
            policy_kwargs={"net_arch": [2 * asked.units, asked.units]},
        )
        with torch.no_grad():
            model.policy.action_net.bias[0] += HOLD_BIAS
        envs.seed(1_000_000 * (asked.seed + 1))
    model.learn(asked.steps - model.num_timesteps, Progress(asked, kept), reset_num_timesteps=False)
    save_policy(exported(model, asked.env, envs, memory=True), asked.out)
    print(f"policy in {asked.out}")


if __name__ == "__main__":
    run(train, arguments())
