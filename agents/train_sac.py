"""Train a speed schedule with SAC, which learns off-policy from a memory of steps.

    python agents/train_sac.py --env chaosgym/ImpactBeamTolerance-v0 --seed 0 --out runs/sac-beam-0

The same command goes on with a run that was interrupted, with an empty memory of steps. What the folder holds:
agents/common.py.
"""

from dataclasses import dataclass

import common
from stable_baselines3 import SAC

from chaosgym.control.learner_view import Memory


@dataclass(frozen=True)
class Arguments:
    """Everything that decides a run."""

    env: str = "chaosgym/ImpactBeam-v0"
    steps: int = 50_000
    seed: int = 0
    out: str = "runs/sac"
    envs: int = 16
    batch: int = 256
    learning_rate: float = 7e-4
    gamma: float = 0.95
    learning_starts: int = 3_200
    gradient_steps: int = 8
    memory: Memory = "belief"
    increments: bool = True
    shaping: bool = True
    evaluate_every: int = 10_000
    jobs: int = 16
    threads: int = 1


def main() -> None:
    """Train, save, and say where."""
    arguments = common.parse(Arguments, __doc__)
    run = common.Run(arguments)
    model = run.resumed(SAC) or SAC(
        "MlpPolicy",
        run.envs,
        batch_size=arguments.batch,
        learning_rate=arguments.learning_rate,
        gamma=arguments.gamma,
        learning_starts=arguments.learning_starts,
        train_freq=1,
        gradient_steps=arguments.gradient_steps,
        buffer_size=arguments.steps,
        seed=arguments.seed,
        device="cpu",
    )
    run.learn(model)


if __name__ == "__main__":
    main()
