"""SAC on a speed schedule, with continuous trims and a memory of visited speeds; numpy plays the policy.

    python agents/sac.py --env chaosgym/ImpactBeamTolerance-v1 --seed 0 --steps 300000 --out runs/sac-0

The same command goes on with a run that was interrupted, and ends as if it had not been. The folder holds progress.csv
(a row every 10,000 steps), checkpoint.bin, which only who wrote it can load, and then policy.json and weights.npz.
"""

import argparse
from pathlib import Path

from training import Progress, load_checkpoint, run

from stable_baselines3 import SAC
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

from chaosgym.control.policies import save_policy
from chaosgym.control.policies.export import exported
from chaosgym.envs import SB3VecEnv
from chaosgym.envs.sb3 import SB3VisitedSpeeds


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", default="chaosgym/ImpactBeamTolerance-v1", help="Id, or file of a machine.")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=int, default=300_000)
    parser.add_argument("--out", type=Path, default=Path("runs/sac"))
    parser.add_argument("--envs", type=int, default=64)
    parser.add_argument("--every", type=int, default=10_000, help="Steps between rows and checkpoints.")
    parser.add_argument("--batch", type=int, default=256)
    parser.add_argument("--learning-rate", type=float, default=1e-3)
    parser.add_argument("--gamma", type=float, default=0.95)
    parser.add_argument("--gradient-steps", type=int, default=16)
    parser.add_argument("--units", type=int, default=64)
    return parser.parse_args()


def train(asked: argparse.Namespace) -> None:
    """Train, or go on, until the steps are done."""
    native = VecMonitor(SB3VecEnv(asked.env, asked.envs, action="continuous"))
    envs = VecNormalize(SB3VisitedSpeeds(native), gamma=asked.gamma)
    model, kept = load_checkpoint(asked.out, SAC, envs) or (None, None)
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
        envs.seed(1_000_000 * (asked.seed + 1))
    model.learn(asked.steps - model.num_timesteps, Progress(asked, kept), reset_num_timesteps=False)
    save_policy(exported(model, asked.env, envs, memory=True), asked.out)
    print(f"policy in {asked.out}")


if __name__ == "__main__":
    run(train, arguments())
