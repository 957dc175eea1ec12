"""PPO in one file of plain torch, in the style of CleanRL (Huang et al., JMLR 23, 2022), on the native environment.

python agents/recipes/with_torch.py --rollouts 160
"""

import argparse

import gymnasium as gym
import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from torch import nn
from torch.distributions import Categorical

import chaosgym

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--env", default="chaosgym/ImpactBeamTolerance-v1")
parser.add_argument("--seed", type=int, default=0)
parser.add_argument("--rollouts", type=int, default=160, help="Of a job on each machine.")
parser.add_argument("--machines", type=int, default=16)
parser.add_argument("--scored", type=int, default=16, help="Machines of the score.")
parser.add_argument("--learning-rate", type=float, default=1e-3)
parser.add_argument("--gamma", type=float, default=0.95)
parser.add_argument("--gae-lambda", type=float, default=0.9)
parser.add_argument("--clip", type=float, default=0.2)
parser.add_argument("--entropy", type=float, default=0.01)
parser.add_argument("--epochs", type=int, default=4)
asked = parser.parse_args()
torch.set_num_threads(1)
torch.manual_seed(asked.seed)

# the observation that follows the end of a job is the first of the next one
envs = gym.make_vec(asked.env, num_envs=asked.machines, autoreset_mode=AutoresetMode.SAME_STEP)
size, actions = envs.single_observation_space.shape[0], int(envs.single_action_space.n)
scale = torch.as_tensor(envs.single_observation_space.high)
STEPS = 120


def layer(inputs: int, outputs: int, gain: float = 2.0**0.5) -> nn.Linear:
    """Return a layer of orthogonal weights."""
    made = nn.Linear(inputs, outputs)
    nn.init.orthogonal_(made.weight, gain)
    nn.init.zeros_(made.bias)
    return made


def network(outputs: int, gain: float) -> nn.Sequential:
    """Two hidden layers of 64 units."""
    return nn.Sequential(layer(size, 64), nn.Tanh(), layer(64, 64), nn.Tanh(), layer(64, outputs, gain))


actor, critic = network(actions, 0.01), network(1, 1.0)
weights = [*actor.parameters(), *critic.parameters()]
optimizer = torch.optim.Adam(weights, lr=asked.learning_rate, eps=1e-5)

seen = torch.zeros(STEPS, asked.machines, size)
done, likelihood, reward, ended = torch.zeros(4, STEPS, asked.machines)
value = torch.zeros(STEPS + 1, asked.machines)
observation = torch.as_tensor(envs.reset(seed=asked.seed)[0]) / scale

for k in range(asked.rollouts):
    optimizer.param_groups[0]["lr"] = asked.learning_rate * (1.0 - k / asked.rollouts)
    with torch.no_grad():
        for t in range(STEPS):
            chosen = Categorical(logits=actor(observation))
            action = chosen.sample()
            seen[t], done[t], likelihood[t] = observation, action, chosen.log_prob(action)
            value[t] = critic(observation).squeeze(-1)
            following, gained, terminated, truncated, _ = envs.step(action.numpy())
            reward[t], ended[t] = torch.as_tensor(gained), torch.as_tensor(terminated | truncated)
            observation = torch.as_tensor(following) / scale
        value[STEPS] = critic(observation).squeeze(-1)
        advantage, gain = torch.zeros(STEPS, asked.machines), torch.zeros(asked.machines)
        for t in reversed(range(STEPS)):
            goes_on = 1.0 - ended[t]
            error = reward[t] + asked.gamma * goes_on * value[t + 1] - value[t]
            advantage[t] = gain = error + asked.gamma * asked.gae_lambda * goes_on * gain
        aim = advantage + value[:STEPS]
    flat = [x.flatten(0, 1) for x in (seen, done, likelihood, advantage, aim)]
    for _ in range(asked.epochs):
        for part in torch.randperm(STEPS * asked.machines).split(STEPS * asked.machines // 4):
            of, took, before, better, target = (x[part] for x in flat)
            chosen = Categorical(logits=actor(of))
            ratio = (chosen.log_prob(took) - before).exp()
            better = (better - better.mean()) / (better.std() + 1e-8)
            policy_loss = -torch.min(ratio * better, ratio.clamp(1.0 - asked.clip, 1.0 + asked.clip) * better).mean()
            value_loss = 0.5 * (critic(of).squeeze(-1) - target).square().mean()
            optimizer.zero_grad()
            (policy_loss + 0.5 * value_loss - asked.entropy * chosen.entropy().mean()).backward()
            nn.utils.clip_grad_norm_(weights, 0.5)
            optimizer.step()
    print(f"{k + 1}: return of a job {reward.sum(0).mean():.1f}", flush=True)


def act(felt: np.ndarray) -> int:
    """The likeliest action."""
    with torch.no_grad():
        return int(actor(torch.as_tensor(felt) / scale).argmax())


result = chaosgym.evaluate(act, asked.env, machines=asked.scored)
print(f"score {result.score:.2f} ({result.interval[0]:.2f} to {result.interval[1]:.2f}) on {asked.scored} machines")
