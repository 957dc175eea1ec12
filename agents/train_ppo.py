"""Train a speed schedule with PPO: one file, from arguments to a policy that numpy plays.

    python agents/train_ppo.py --env chaosgym/ImpactBeamTolerance-v0 --seed 0 --out runs/ppo-beam-0

The same command goes on with a run that was interrupted. What the folder holds: agents/common.py.
"""

from dataclasses import dataclass

import common
from stable_baselines3 import PPO


@dataclass(frozen=True)
class Arguments:
    """Everything that decides a run."""

    env: str = "chaosgym/ImpactBeam-v0"
    steps: int = 300_000
    seed: int = 0
    out: str = "runs/ppo"
    envs: int = 8
    rollout: int = 200
    batch: int = 200
    epochs: int = 10
    learning_rate: float = 1e-3
    gamma: float = 0.98
    entropy: float = 0.0
    log_std: float = -2.0
    memory: bool = True
    increments: bool = True
    evaluate_every: int = 25_000
    jobs: int = 16
    threads: int = 1


def main() -> None:
    """Train, save, and say where."""
    arguments = common.parse(Arguments, __doc__)
    run = common.Run(arguments)
    model = run.resumed(PPO) or PPO(
        "MlpPolicy", run.envs, n_steps=arguments.rollout, batch_size=arguments.batch, n_epochs=arguments.epochs,
        learning_rate=arguments.learning_rate, gamma=arguments.gamma, ent_coef=arguments.entropy, seed=arguments.seed,
        device="cpu", policy_kwargs={"log_std_init": arguments.log_std},
    )  # fmt: skip
    run.learn(model)


if __name__ == "__main__":
    main()
