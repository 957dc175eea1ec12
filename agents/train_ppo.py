"""Train a speed schedule with PPO: one file, from arguments to saved policy.

    python agents/train_ppo.py --env chaosgym/ImpactBeam-v0 --steps 100000 --seed 0 --out runs/ppo-beam

Writes policy.zip (stable-baselines3), config.json (arguments, versions) and progress.csv (return of every episode).
"""

import argparse
import csv
import json
import platform
from dataclasses import asdict, dataclass
from pathlib import Path

import gymnasium as gym
import numpy as np
import stable_baselines3
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecMonitor

import chaosgym
from chaosgym.envs import SB3VecEnv


@dataclass(frozen=True)
class Arguments:
    """Everything that decides a run."""

    env: str = "chaosgym/ImpactBeam-v0"
    steps: int = 100_000
    seed: int = 0
    out: str = "runs/ppo"
    envs: int = 8
    rollout: int = 256
    batch: int = 256
    epochs: int = 10
    learning_rate: float = 3e-4
    gamma: float = 0.995
    entropy: float = 0.0
    threads: int = 1


def parse() -> Arguments:
    """Read the command line; every field of Arguments is an option."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name, value in asdict(Arguments()).items():
        parser.add_argument(f"--{name.replace('_', '-')}", type=type(value), default=value)
    return Arguments(**vars(parser.parse_args()))


class EpisodeLog(BaseCallback):
    """Append the return and length of every finished episode to a CSV file."""

    def __init__(self, path: Path):
        super().__init__()
        self.path = path

    def _on_training_start(self) -> None:
        self.file = self.path.open("w", newline="")
        self.writer = csv.writer(self.file)
        self.writer.writerow(["step", "return", "length"])

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            if "episode" in info:
                self.writer.writerow([self.num_timesteps, info["episode"]["r"], info["episode"]["l"]])
        return True

    def _on_training_end(self) -> None:
        self.file.close()


def main() -> None:
    """Train, save, and say where."""
    arguments = parse()
    out = Path(arguments.out)
    if out.exists():
        raise SystemExit(f"--out {out} exists; choose another folder")
    gym.spec(arguments.env)
    out.mkdir(parents=True)
    torch.set_num_threads(arguments.threads)
    envs = VecMonitor(SB3VecEnv(arguments.env, arguments.envs))
    model = PPO(
        "MlpPolicy", envs, n_steps=arguments.rollout, batch_size=arguments.batch, n_epochs=arguments.epochs,
        learning_rate=arguments.learning_rate, gamma=arguments.gamma, ent_coef=arguments.entropy, seed=arguments.seed,
        device="cpu",
    )  # fmt: skip
    model.learn(arguments.steps, callback=EpisodeLog(out / "progress.csv"), progress_bar=False)
    model.save(out / "policy.zip")
    versions = {"chaosgym": chaosgym.__version__, "stable_baselines3": stable_baselines3.__version__,
                "torch": torch.__version__, "numpy": np.__version__, "python": platform.python_version()}  # fmt: skip
    (out / "config.json").write_text(
        json.dumps({"arguments": asdict(arguments), "versions": versions}, indent=2) + "\n"
    )
    print(f"policy, config and progress in {out}")


if __name__ == "__main__":
    main()
