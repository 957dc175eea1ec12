"""PPO of skrl on the native vector environment. Needs skrl.

python agents/recipes/with_skrl.py --rollouts 160
"""

import argparse
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from skrl.agents.torch.ppo import PPO
from skrl.envs.wrappers.torch import wrap_env
from skrl.memories.torch import RandomMemory
from skrl.models.torch import CategoricalMixin, DeterministicMixin, Model
from skrl.trainers.torch import SequentialTrainer
from skrl.utils import set_seed
from torch import nn

import chaosgym

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--env", default="chaosgym/ImpactBeamTolerance-v1")
parser.add_argument("--rollouts", type=int, default=160, help="Of a job on each machine.")
parser.add_argument("--machines", type=int, default=16)
parser.add_argument("--scored", type=int, default=16, help="Machines of the score.")
asked = parser.parse_args()
torch.set_num_threads(1)
set_seed(0)

# skrl takes the observation after the end of a job for the first of the next one
native = gym.make_vec(asked.env, num_envs=asked.machines, autoreset_mode=AutoresetMode.SAME_STEP)
env = wrap_env(native)
scale = torch.as_tensor(native.single_observation_space.high)
spaces = {name: getattr(env, name) for name in ("observation_space", "state_space", "action_space")}


class Scaled(Model):
    """Layers behind observations over their largest values."""

    def __init__(self, answers: int) -> None:
        Model.__init__(self, **spaces, device="cpu")
        inner = nn.Sequential(nn.Linear(len(scale), 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh())
        self.layers = nn.Sequential(inner, nn.Linear(64, answers))

    def compute(self, inputs: dict[str, Any], role: str = "") -> tuple[torch.Tensor, dict[str, Any]]:
        """Answers (..., n) to observations (..., 14)."""
        return self.layers(inputs["observations"] / scale), {}


class Actor(CategoricalMixin, Scaled):
    """What the actions are drawn from."""

    def __init__(self) -> None:
        Scaled.__init__(self, int(native.single_action_space.n))
        CategoricalMixin.__init__(self)


class Critic(DeterministicMixin, Scaled):
    """What is expected of the rest of a job."""

    def __init__(self) -> None:
        Scaled.__init__(self, 1)
        DeterministicMixin.__init__(self)


agent = PPO(
    models={"policy": Actor(), "value": Critic()},
    memory=RandomMemory(memory_size=120, num_envs=asked.machines, device="cpu"),
    **spaces,
    device="cpu",
    cfg={
        "rollouts": 120,
        "learning_epochs": 4,
        "mini_batches": 4,
        "discount_factor": 0.95,
        "gae_lambda": 0.9,
        "learning_rate": 1e-3,
        "entropy_loss_scale": 0.01,
        "value_clip": 0.0,
        "value_loss_scale": 0.5,
        "experiment": {"write_interval": 0, "checkpoint_interval": 0},
    },
)
steps = 120 * asked.rollouts
trainer = SequentialTrainer(
    env=env, agents=agent, cfg={"timesteps": steps, "headless": True, "disable_progressbar": True}
)
trainer.train()


def act(felt: np.ndarray) -> int:
    """The likeliest action."""
    with torch.no_grad():
        return int(agent.policy.compute({"observations": torch.as_tensor(felt)})[0].argmax())


result = chaosgym.evaluate(act, asked.env, machines=asked.scored)
print(f"{steps} steps on each of {asked.machines} machines")
print(f"score {result.score:.2f} ({result.interval[0]:.2f} to {result.interval[1]:.2f}) on {asked.scored} machines")
