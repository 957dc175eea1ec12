"""Train a speed schedule with recurrent PPO: the machine is hidden, and an LSTM can infer it from what it felt.

    python agents/train_ppo_lstm.py --env chaosgym/ImpactBeamTolerance-v0 --seed 0 --out runs/ppo-lstm-beam-0

The same command goes on with a run that was interrupted. What the folder holds: agents/common.py.
"""

from dataclasses import dataclass

import common
from sb3_contrib import RecurrentPPO

from chaosgym.control.learner_view import Memory


@dataclass(frozen=True)
class Arguments:
    """Everything that decides a run."""

    env: str = "chaosgym/ImpactBeam-v0"
    steps: int = 300_000
    seed: int = 0
    out: str = "runs/ppo-lstm"
    envs: int = 16
    rollout: int = 200
    batch: int = 400
    epochs: int = 5
    learning_rate: float = 7e-4
    gamma: float = 0.95
    gae_lambda: float = 0.9
    entropy: float = 0.0
    log_std: float = -0.7
    units: int = 64
    memory: Memory = "none"
    increments: bool = True
    shaping: bool = True
    evaluate_every: int = 25_000
    jobs: int = 16
    threads: int = 1


def main() -> None:
    """Train, save, and say where."""
    arguments = common.parse(Arguments, __doc__)
    run = common.Run(arguments)
    model = run.resumed(RecurrentPPO) or RecurrentPPO(
        "MlpLstmPolicy",
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
        policy_kwargs={"log_std_init": arguments.log_std, "lstm_hidden_size": arguments.units},
    )
    run.learn(model)


if __name__ == "__main__":
    main()
