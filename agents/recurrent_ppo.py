"""Recurrent PPO on a speed schedule, on the plain observation, to a policy that numpy plays.

    python agents/recurrent_ppo.py --env chaosgym/ImpactBeamTolerance-v1 --seed 0 --steps 300000 --out runs/recurrent-0

The same command goes on with a run that was interrupted, and ends as if it had not been. The folder holds progress.csv
(a row every 10,000 steps), checkpoint.bin, which only who wrote it can load, and then policy.json and weights.npz.

With ``--across-jobs --keywords '{"jobs": 5}'`` the five jobs of a machine are one episode (RL^2, Duan et al., 2016):
the memory of the network goes on from one to the next, and so does what is expected of the future.
"""

import argparse
from pathlib import Path
from typing import Any

from training import Progress, keywords, load_checkpoint, run

import numpy as np
import torch
from sb3_contrib import RecurrentPPO
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecMonitor, VecNormalize

from chaosgym.control.policies import save_policy
from chaosgym.control.policies.export import exported
from chaosgym.envs import SB3VecEnv

HOLD_BIAS = 2.0
"""Logit of holding the speed at the start: motion settles only at a speed that is held."""


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", default="chaosgym/ImpactBeamTolerance-v1", help="Id, or file of a machine.")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=int, default=300_000)
    parser.add_argument("--out", type=Path, default=Path("runs/recurrent"))
    parser.add_argument("--fidelity", default=None, help="Rung of the machines in training; default: the task's.")
    parser.add_argument("--keywords", type=keywords, default={}, help="Of the environment in training, as JSON.")
    parser.add_argument("--envs", type=int, default=64)
    parser.add_argument("--every", type=int, default=10_000, help="Steps between rows and checkpoints.")
    parser.add_argument("--rollout", type=int, default=60)
    parser.add_argument("--batch", type=int, default=960)
    parser.add_argument("--epochs", type=int, default=6)
    parser.add_argument("--learning-rate", type=float, default=1e-3)
    parser.add_argument("--gamma", type=float, default=0.95)
    parser.add_argument("--gae-lambda", type=float, default=0.9)
    parser.add_argument("--units", type=int, default=64)
    parser.add_argument("--across-jobs", action="store_true", help="One episode is all jobs of a machine.")
    asked = parser.parse_args()
    if asked.across_jobs and int(asked.keywords.get("jobs", 1)) < 2:
        parser.error("--across-jobs needs several jobs of a machine: --keywords '{\"jobs\": 5}'")
    return asked


class JobsInOne(VecEnvWrapper):
    """Ends an episode with every n-th job alone: the n jobs that each machine does in turn.

    Parameters
    ----------
    envs
        Environments with the keyword ``jobs``.
    of_each
        n.
    """

    def __init__(self, envs: VecEnv, of_each: int) -> None:
        super().__init__(envs)
        self.of_each, self.done = of_each, np.zeros(envs.num_envs, np.int64)

    def reset(self) -> Any:
        """Start the first job of all machines."""
        self.done[:] = 0
        return self.venv.reset()

    def step_wait(self) -> Any:
        """Run a step; what follows the end of a job is the beginning of the next one."""
        observations, rewards, ended, infos = self.venv.step_wait()
        self.done += ended
        last = ended & (self.done % self.of_each == 0)
        for i in np.flatnonzero(ended & ~last).tolist():
            del infos[i]["terminal_observation"]
        return observations, rewards, last, infos


def train(asked: argparse.Namespace) -> None:
    """Train, or go on, until the steps are done."""
    jobs = VecMonitor(SB3VecEnv(asked.env, asked.envs, **({"fidelity": asked.fidelity} | asked.keywords)))
    episodes = JobsInOne(jobs, int(asked.keywords.get("jobs", 1))) if asked.across_jobs else jobs
    envs = VecNormalize(episodes, gamma=asked.gamma)
    model, kept = load_checkpoint(asked.out, RecurrentPPO, envs) or (None, None)
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
        envs.seed(1_000_000 * (asked.seed + 1))
    model.learn(asked.steps - model.num_timesteps, Progress(asked, kept), reset_num_timesteps=False)
    save_policy(exported(model, asked.env, envs), asked.out)
    print(f"policy in {asked.out}")


if __name__ == "__main__":
    run(train, arguments())
