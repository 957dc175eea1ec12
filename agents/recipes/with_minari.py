"""Behaviour cloning of a policy from an offline dataset in Minari's format. Needs minari and torch.

python agents/export_minari.py --policy runs/ppo-0 --jobs 100 --out minari
MINARI_DATASETS_PATH=minari python agents/recipes/with_minari.py chaosgym/ImpactBeamTolerance/ppo-0-v1
"""

import argparse

import minari
import numpy as np
import torch
from torch import nn

import chaosgym

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("dataset")
parser.add_argument("--env", default="chaosgym/ImpactBeamTolerance-v1")
parser.add_argument("--epochs", type=int, default=20)
parser.add_argument("--machines", type=int, default=16)
asked = parser.parse_args()
torch.set_num_threads(1)
torch.manual_seed(0)

episodes = list(minari.load_dataset(asked.dataset).iterate_episodes())
# an episode has one observation more than actions
seen = torch.as_tensor(np.concatenate([one.observations[:-1] for one in episodes]))
done = torch.as_tensor(np.concatenate([one.actions for one in episodes])).long()
mean, deviation = seen.mean(0), seen.std(0) + 1e-3
network = nn.Sequential(nn.Linear(seen.shape[1], 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, 6))
optimizer = torch.optim.Adam(network.parameters(), lr=1e-3)
for _ in range(asked.epochs):
    for chosen in torch.randperm(len(seen)).split(256):
        loss = nn.functional.cross_entropy(network((seen[chosen] - mean) / deviation), done[chosen])
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()


def act(observation: np.ndarray) -> int:
    """The likeliest action."""
    with torch.no_grad():
        return int(network((torch.as_tensor(observation) - mean) / deviation).argmax())


print(f"cross-entropy {loss.item():.2f} on {len(seen)} steps of {len(episodes)} jobs")
result = chaosgym.evaluate(act, asked.env, machines=asked.machines)
print(f"score {result.score:.2f} ({result.interval[0]:.2f} to {result.interval[1]:.2f}) on {asked.machines} machines")
