"""Recurrent PPO on a speed schedule, on the plain observation: one file, from arguments to a policy numpy plays.

    python agents/recurrent_ppo.py --env chaosgym/ImpactBeamTolerance-v1 --seed 0 --steps 300000 --out runs/recurrent-0

The same command goes on with a run that was interrupted. The folder holds progress.csv (a row every 10,000 steps),
checkpoint.zip and checkpoint.npz until the end, and then policy.json and weights.npz.
"""

import argparse
import csv
import time
from pathlib import Path

import numpy as np
import torch
from sb3_contrib import RecurrentPPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize
from tqdm import tqdm

from chaosgym.control.policies import save_policy
from chaosgym.control.policies.export import exported
from chaosgym.envs import SB3VecEnv

HOLD_BIAS = 2.0
"""Logit of holding the speed at the start: motion settles only at a speed that is held."""

ROW = ("step", "return", "type_iii", "deviation", "processor_seconds")


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", default="chaosgym/ImpactBeamTolerance-v1")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=int, default=300_000)
    parser.add_argument("--out", type=Path, default=Path("runs/recurrent"))
    parser.add_argument("--envs", type=int, default=64)
    parser.add_argument("--rollout", type=int, default=60)
    parser.add_argument("--batch", type=int, default=960)
    parser.add_argument("--epochs", type=int, default=6)
    parser.add_argument("--learning-rate", type=float, default=1e-3)
    parser.add_argument("--gamma", type=float, default=0.95)
    parser.add_argument("--gae-lambda", type=float, default=0.9)
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
        return True

    def _on_rollout_end(self) -> None:
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


def save(asked: argparse.Namespace, envs: VecNormalize, model: RecurrentPPO) -> None:
    """Write a checkpoint: what stable-baselines3 needs to go on, without pickle for the statistics."""
    kept = {f"{kind}_{name}": getattr(rms, name) for kind, rms in statistics(envs) for name in ("mean", "var", "count")}
    np.savez(asked.out / "checkpoint.npz", **kept)
    model.save(asked.out / "checkpoint.zip")


def load(asked: argparse.Namespace, envs: VecNormalize) -> RecurrentPPO | None:
    """Return the model of the checkpoint, if there is one, and put the statistics into the environments."""
    if not (asked.out / "checkpoint.zip").exists():
        return None
    with np.load(asked.out / "checkpoint.npz") as kept:
        for kind, rms in statistics(envs):
            for name in ("mean", "var", "count"):
                setattr(rms, name, kept[f"{kind}_{name}"])
    return RecurrentPPO.load(asked.out / "checkpoint.zip", envs, device="cpu")


def statistics(envs: VecNormalize) -> list[tuple[str, object]]:
    """Running means and variances of observations and returns."""
    return [("obs", envs.obs_rms), ("ret", envs.ret_rms)]


def main() -> None:
    """Train, and write the policy."""
    asked = arguments()
    asked.out.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    envs = VecNormalize(VecMonitor(SB3VecEnv(asked.env, asked.envs)), gamma=asked.gamma)
    model = load(asked, envs)
    if model is None:
        model = RecurrentPPO(
            "MlpLstmPolicy",
            envs,
            n_steps=asked.rollout,
            batch_size=asked.batch,
            n_epochs=asked.epochs,
            learning_rate=lambda left: asked.learning_rate * (0.1 + 0.9 * left),
            gamma=asked.gamma,
            gae_lambda=asked.gae_lambda,
            seed=asked.seed,
            device="cpu",
            policy_kwargs={"lstm_hidden_size": asked.units},
        )
        with torch.no_grad():
            model.policy.action_net.bias[0] += HOLD_BIAS
    envs.seed(1_000_000 * (asked.seed + 1) + model.num_timesteps)
    model.learn(asked.steps - model.num_timesteps, Progress(asked, envs), reset_num_timesteps=False)
    save(asked, envs, model)
    save_policy(exported(model, asked.env, envs), asked.out)
    print(f"policy in {asked.out}")


if __name__ == "__main__":
    main()
