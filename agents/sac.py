"""SAC on a speed schedule, with continuous trims and a memory of visited speeds: one file, to a policy numpy plays.

    python agents/sac.py --env chaosgym/ImpactBeamTolerance-v1 --seed 0 --steps 300000 --out runs/sac-0

The same command goes on with a run that was interrupted, with an empty memory of steps. The folder holds
progress.csv (a row every 10,000 steps),
checkpoint.zip and checkpoint.npz until the end, and then policy.json and weights.npz.
"""

import argparse
import csv
import time
from pathlib import Path

import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize
from tqdm import tqdm

from chaosgym.control.policies import save_policy
from chaosgym.control.policies.export import exported
from chaosgym.envs import SB3VecEnv
from chaosgym.envs.sb3 import SB3VisitedSpeeds

ROW = ("step", "return", "type_iii", "deviation", "processor_seconds")


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", default="chaosgym/ImpactBeamTolerance-v1")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=int, default=300_000)
    parser.add_argument("--out", type=Path, default=Path("runs/sac"))
    parser.add_argument("--envs", type=int, default=64)
    parser.add_argument("--batch", type=int, default=256)
    parser.add_argument("--learning-rate", type=float, default=1e-3)
    parser.add_argument("--gamma", type=float, default=0.95)
    parser.add_argument("--gradient-steps", type=int, default=16)
    parser.add_argument("--units", type=int, default=64)
    return parser.parse_args()


class Progress(BaseCallback):
    """Writes a row and a checkpoint every 10,000 steps."""

    def __init__(self, asked: argparse.Namespace, envs: VecNormalize) -> None:
        super().__init__()
        self.asked, self.envs = asked, envs
        self.jobs: list[tuple[float, float, float]] = []
        self.sums = np.zeros((3, asked.envs))
        self.began, self.last = time.process_time(), 0

    def _on_training_start(self) -> None:
        self.last = self.num_timesteps
        self.bar = tqdm(total=self.asked.steps, initial=self.num_timesteps, unit="step", desc=self.asked.out.name)

    def _on_step(self) -> bool:
        self.bar.update(self.num_timesteps - self.bar.n)
        for i, info in enumerate(self.locals["infos"]):
            self.sums[:, i] += 1.0, info["type_iii"], info["deviation"]
            if "episode" in info:
                steps, type_iii, deviation = self.sums[:, i]
                self.jobs.append((info["episode"]["r"], type_iii / steps, deviation / steps))
                self.sums[:, i] = 0.0
        self._write()
        return True

    def _write(self) -> None:
        if self.num_timesteps - self.last < 10_000 or not self.jobs:
            return
        self.last = self.num_timesteps
        row = [self.num_timesteps, *np.round(np.mean(self.jobs, axis=0), 4), round(time.process_time() - self.began)]
        self.jobs = []
        path = self.asked.out / "progress.csv"
        new = not path.exists()
        with path.open("a", newline="") as file:
            csv.writer(file).writerows([ROW, row] if new else [row])
        save(self.asked, self.envs, self.model)

    def _on_training_end(self) -> None:
        self.bar.close()


def save(asked: argparse.Namespace, envs: VecNormalize, model: SAC) -> None:
    """Write a checkpoint: what stable-baselines3 needs to go on, without pickle for the statistics."""
    usual = envs.venv.memory.usual
    kept = {f"{kind}_{name}": getattr(rms, name) for kind, rms in statistics(envs) for name in ("mean", "var", "count")}
    np.savez(asked.out / "checkpoint.npz", usual_count=usual.count, total=usual.total, squares=usual.squares, **kept)
    model.save(asked.out / "checkpoint.zip")


def load(asked: argparse.Namespace, envs: VecNormalize) -> SAC | None:
    """Return the model of the checkpoint, if there is one, and put the statistics into the environments."""
    if not (asked.out / "checkpoint.zip").exists():
        return None
    with np.load(asked.out / "checkpoint.npz") as kept:
        for kind, rms in statistics(envs):
            for name in ("mean", "var", "count"):
                setattr(rms, name, kept[f"{kind}_{name}"])
        usual = envs.venv.memory.usual
        usual.count, usual.total, usual.squares = kept["usual_count"], kept["total"], kept["squares"]
    return SAC.load(asked.out / "checkpoint.zip", envs, device="cpu")


def statistics(envs: VecNormalize) -> list[tuple[str, object]]:
    """Running means and variances of observations and returns."""
    return [("obs", envs.obs_rms), ("ret", envs.ret_rms)]


def main() -> None:
    """Train, and write the policy."""
    asked = arguments()
    asked.out.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    native = VecMonitor(SB3VecEnv(asked.env, asked.envs, action="continuous"))
    envs = VecNormalize(SB3VisitedSpeeds(native), gamma=asked.gamma)
    model = load(asked, envs)
    if model is None:
        model = SAC(
            "MlpPolicy",
            envs,
            batch_size=asked.batch,
            learning_rate=asked.learning_rate,
            gamma=asked.gamma,
            learning_starts=120 * asked.envs,
            train_freq=1,
            gradient_steps=asked.gradient_steps,
            buffer_size=min(asked.steps, 300_000),
            seed=asked.seed,
            device="cpu",
            policy_kwargs={"net_arch": [2 * asked.units, asked.units]},
        )
    envs.seed(1_000_000 * (asked.seed + 1) + model.num_timesteps)
    model.learn(asked.steps - model.num_timesteps, Progress(asked, envs), reset_num_timesteps=False)
    save(asked, envs, model)
    save_policy(exported(model, asked.env, envs, memory=True), asked.out)
    print(f"policy in {asked.out}")


if __name__ == "__main__":
    main()
