"""PPO on a speed schedule, with a memory of visited speeds if wanted, to a policy that numpy plays.

    python agents/ppo.py --env chaosgym/ImpactBeamTolerance-v1 --seed 0 --steps 300000 --out runs/ppo-0

The same command goes on with a run that was interrupted, and ends as if it had not been. The folder holds progress.csv
(a row every 10,000 steps), checkpoint.bin, which only who wrote it can load, and then policy.json and weights.npz.
"""

import argparse
from pathlib import Path

from training import Progress, keywords, load_checkpoint, run

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

from chaosgym.control.policies import load_policy, save_policy
from chaosgym.control.policies.export import exported
from chaosgym.envs import SB3VecEnv, environment
from chaosgym.envs.sb3 import SB3VisitedSpeeds
from chaosgym.errors import ModelFileError

HOLD_BIAS = 2.0
"""Logit of holding the speed at the start: motion settles only at a speed that is held."""


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", default="chaosgym/ImpactBeamTolerance-v1", help="Id, or file of a machine.")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=int, default=300_000)
    parser.add_argument("--out", type=Path, default=Path("runs/ppo"))
    parser.add_argument("--start", type=Path, default=None, help="Run folder whose policy this training begins with.")
    parser.add_argument("--fidelity", default=None, help="Rung of the machines in training; default: the task's.")
    parser.add_argument("--keywords", type=keywords, default={}, help="Of the environment in training, as JSON.")
    parser.add_argument("--envs", type=int, default=16)
    parser.add_argument("--every", type=int, default=10_000, help="Steps between rows and checkpoints.")
    parser.add_argument("--rollout", type=int, default=120)
    parser.add_argument("--batch", type=int, default=240)
    parser.add_argument("--epochs", type=int, default=10)
    parser.add_argument("--learning-rate", type=float, default=1e-3)
    parser.add_argument("--gamma", type=float, default=0.95)
    parser.add_argument("--gae-lambda", type=float, default=0.9)
    parser.add_argument("--units", type=int, default=64)
    parser.add_argument("--memory", action="store_true", help="See visited speeds too; such a policy can be guarded.")
    return parser.parse_args()


def environments(env: str, asked: argparse.Namespace) -> VecNormalize:
    """Machines side by side, with a memory of visited speeds if it is wanted, normalised."""
    native = VecMonitor(SB3VecEnv(env, asked.envs, **{"fidelity": asked.fidelity} | asked.keywords))
    return VecNormalize(SB3VisitedSpeeds(native) if asked.memory else native, gamma=asked.gamma)


def take_over(model: PPO, envs: VecNormalize, asked: argparse.Namespace) -> None:
    """Begin with the weights of another run; on the same machine, with its scales and what it found usual too."""
    env = load_policy(asked.start).env
    found = load_checkpoint(asked.start, PPO, environments(env, asked))
    if found is None:
        raise ModelFileError(f"{asked.start} holds no checkpoint.bin; --start takes the folder of a run of this script")
    try:
        model.policy.load_state_dict(found[0].policy.state_dict())
    except RuntimeError:
        raise ModelFileError(f"{asked.start} has layers of another size; give its --units here too") from None
    if environment(env).kwargs["machine"] == environment(asked.env).kwargs["machine"]:
        before = found[0].get_env()
        envs.obs_rms, envs.ret_rms = before.obs_rms, before.ret_rms
        if asked.memory:
            envs.venv.memory.usual = before.venv.memory.usual
    model.set_random_seed(asked.seed)


def train(asked: argparse.Namespace) -> None:
    """Train, or go on, until the steps are done."""
    envs = environments(asked.env, asked)
    model, kept = load_checkpoint(asked.out, PPO, envs) or (None, None)
    if model is None:
        model = PPO(
            "MlpPolicy",
            envs,
            n_steps=asked.rollout,
            batch_size=asked.batch,
            n_epochs=asked.epochs,
            learning_rate=lambda left: asked.learning_rate * (0.1 + 0.9 * left),
            gamma=asked.gamma,
            gae_lambda=asked.gae_lambda,
            seed=asked.seed,
            device="cpu",
            policy_kwargs={"net_arch": [2 * asked.units, asked.units]},
        )
        with torch.no_grad():
            model.policy.action_net.bias[0] += HOLD_BIAS
        if asked.start is not None:
            take_over(model, envs, asked)
        envs.seed(1_000_000 * (asked.seed + 1))
    model.learn(asked.steps - model.num_timesteps, Progress(asked, kept), reset_num_timesteps=False)
    save_policy(exported(model, asked.env, envs, memory=asked.memory), asked.out)
    print(f"policy in {asked.out}")


if __name__ == "__main__":
    run(train, arguments())
