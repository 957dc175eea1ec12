"""Train a speed schedule with PPO: one file, from arguments to a policy that numpy plays.

    python agents/train_ppo.py --env chaosgym/ImpactBeamTolerance-v0 --seed 0 --out runs/ppo-beam-0

The same command goes on with a run that was interrupted. What the folder holds: agents/common.py.
"""

from dataclasses import dataclass

import common
from stable_baselines3 import PPO

from chaosgym.control.learner_view import Memory


@dataclass(frozen=True)
class Arguments:
    """Everything that decides a run."""

    env: str = "chaosgym/ImpactBeam-v0"
    steps: int = 300_000
    seed: int = 0
    out: str = "runs/ppo"
    envs: int = 16
    rollout: int = 200
    batch: int = 400
    epochs: int = 8
    learning_rate: float = 2e-4
    gamma: float = 0.97
    gae_lambda: float = 0.9
    entropy: float = 0.0
    log_std: float = -2.0
    units: int = 128
    memory: Memory = "belief"
    increments: bool = True
    shaping: bool = True
    evaluate_every: int = 25_000
    jobs: int = 16
    threads: int = 1


def main() -> None:
    """Train, save, and say where."""
    arguments = common.parse(Arguments, __doc__)
    run = common.Run(arguments)
    model = run.resumed(PPO) or PPO(
        "MlpPolicy",
        run.envs,
        n_steps=arguments.rollout,
        batch_size=arguments.batch,
        n_epochs=arguments.epochs,
        learning_rate=arguments.learning_rate,
        gamma=arguments.gamma,
        gae_lambda=arguments.gae_lambda,
        ent_coef=arguments.entropy,
        seed=arguments.seed,
        device="cpu",
        policy_kwargs={"log_std_init": arguments.log_std, "net_arch": [arguments.units, arguments.units]},
    )
    run.learn(model)


if __name__ == "__main__":
    main()
