"""Plain PPO of stable-baselines3, as an outsider would begin: its defaults, the plain observation, no memory.

    python agents/recipes/with_sb3.py --steps 300000 --out runs/plain

Sixteen machines run side by side, so a rollout is a job of each: 1,920 steps for the default's 2,048. ``--dqn`` takes
DQN instead; a quarter of its steps are learned from in batches, as by agents/sac.py, where its defaults learn from 2 %.

The folder gets a curve, progress.csv, and a policy that `chaosgym compare --policy` and `run-agent` play.
"""

import argparse
import csv
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

from chaosgym.control.policies import save_policy
from chaosgym.control.policies.export import exported
from chaosgym.envs import SB3VecEnv

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--env", default="chaosgym/ImpactBeamTolerance-v1")
parser.add_argument("--keywords", type=json.loads, default={}, help="Of the environment in training, as JSON.")
parser.add_argument("--seed", type=int, default=0)
parser.add_argument("--steps", type=int, default=300_000)
parser.add_argument("--dqn", action="store_true", help="DQN instead of PPO.")
parser.add_argument("--out", type=Path, default=Path("runs/plain"))
asked = parser.parse_args()
torch.set_num_threads(1)
asked.out.mkdir(parents=True, exist_ok=True)

kept: tuple[str, ...] = ("type_iii", "deviation")
envs = VecNormalize(VecMonitor(SB3VecEnv(asked.env, num_envs=16, **asked.keywords)))
model: DQN | PPO
if asked.dqn:
    each = {"train_freq": 1, "gradient_steps": 4, "batch_size": 256, "learning_rate": 1e-3, "gamma": 0.95}
    rest = {"learning_starts": 1_920, "buffer_size": 300_000, "target_update_interval": 1_000}
    model = DQN("MlpPolicy", envs, **each, **rest, seed=asked.seed, device="cpu")
else:
    model = PPO("MlpPolicy", envs, n_steps=120, batch_size=64, seed=asked.seed, device="cpu")
jobs: list[float] = []
felt: list[list[float]] = []


def note(local: dict[str, Any], _: Any) -> bool:
    """A row for each 10,000 steps or more: means of the jobs that ended and of their steps."""
    for info in local["infos"]:
        felt.append([info[name] for name in kept])
        if "episode" in info:
            jobs.append(info["episode"]["r"])
    if jobs and len(felt) >= 10_000:
        means = np.round([np.mean(jobs), *np.mean(felt, axis=0)], 4).tolist()
        table.writerow([model.num_timesteps, *means, round(time.process_time())])
        file.flush()
        jobs.clear()
        felt.clear()
    return True


with (asked.out / "progress.csv").open("w", newline="", encoding="utf-8") as file:
    table = csv.writer(file, lineterminator="\n")
    table.writerow(["step", "return", *kept, "processor_seconds"])
    model.learn(asked.steps, callback=note)
save_policy(exported(model, asked.env, envs), asked.out)
print(f"policy in {asked.out}")
