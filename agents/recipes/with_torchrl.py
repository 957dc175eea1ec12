"""PPO of TorchRL on the native vector environment. Needs torchrl.

python agents/recipes/with_torchrl.py --rollouts 40
"""

import argparse

import gymnasium as gym
import torch
from gymnasium.vector import AutoresetMode
from tensordict.nn import TensorDictModule
from torch import nn
from torch.distributions import Categorical
from torchrl.envs import GymWrapper
from torchrl.modules import ProbabilisticActor, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

import chaosgym  # noqa: F401

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--env", default="chaosgym/ImpactBeamTolerance-v1")
parser.add_argument("--rollouts", type=int, default=40, help="Of a job on each machine.")
parser.add_argument("--machines", type=int, default=16)
asked = parser.parse_args()
torch.set_num_threads(1)
torch.manual_seed(0)

# TorchRL resets the machines whose job has ended itself; it refuses the default mode
native = gym.make_vec(asked.env, num_envs=asked.machines, autoreset_mode=AutoresetMode.DISABLED)
env = GymWrapper(native, categorical_action_encoding=True)
env.set_seed(0)
size, count = native.single_observation_space.shape[0], int(native.single_action_space.n)
scale = torch.as_tensor(native.single_observation_space.high)


class Scaled(nn.Sequential):
    """Layers behind observations over their largest values."""

    def __init__(self, answers: int) -> None:
        super().__init__(nn.Linear(size, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, answers))

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        """Answers (..., n) to observations (..., 14)."""
        return super().forward(observation / scale)


actor = ProbabilisticActor(
    TensorDictModule(Scaled(count), in_keys=["observation"], out_keys=["logits"]),
    in_keys=["logits"],
    distribution_class=Categorical,
    return_log_prob=True,
)
critic = ValueOperator(Scaled(1), in_keys=["observation"])
advantage = GAE(gamma=0.95, lmbda=0.9, value_network=critic)
loss = ClipPPOLoss(actor, critic, entropy_coeff=0.01)
optimizer = torch.optim.Adam(loss.parameters(), lr=1e-3)

for k in range(asked.rollouts):
    with torch.no_grad():
        jobs = env.rollout(120, actor, break_when_any_done=False)
        advantage(jobs)
    flat = jobs.reshape(-1)
    for _ in range(4):
        for chosen in torch.randperm(len(flat)).split(480):
            told = loss(flat[chosen])
            optimizer.zero_grad()
            (told["loss_objective"] + told["loss_critic"] + told["loss_entropy"]).backward()
            optimizer.step()
    print(f"{k + 1}: return of a job {jobs['next', 'reward'].sum(1).mean():.1f}", flush=True)
