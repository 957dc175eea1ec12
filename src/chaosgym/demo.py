"""A tour of chaosgym on the impact beam: one pass through every floor, with a picture after each step.

Simulate a Type I, II and III point, label a sweep, train and test the classifier, compare the shipped agent, or one
that is trained here, with following the demand and with backing off. Every number is computed here and now.
"""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from chaosgym.classifier.train import report_table, train_classifier
from chaosgym.control.controllers import BackOff, Follow
from chaosgym.control.policies import TrainedPolicy, save_policy, shipped_policy
from chaosgym.control.policies.export import exported
from chaosgym.control.rollout import Played, Policy, play
from chaosgym.envs.vector_env import native_envs
from chaosgym.errors import ChaosgymError, DatasetError
from chaosgym.machines import ImpactBeam
from chaosgym.series import two_step_test
from chaosgym.simulation import CycleRecord, simulate
from chaosgym.sweeps import Axis, LabelledSweep, SweepPlan, run_sweep

POINTS = {"I": (9.0, 0.127e-3), "II": (12.0, 0.127e-3), "III": (30.0, 0.127e-3)}
"""Excitation frequency [Hz] and clearance [m] of one point of each type."""

AXES = (
    Axis("excitation_frequency", 8.0, 30.0, 68, "log"),
    Axis("clearance", 0.1e-3, 0.145e-3, 9, "log"),
)
"""Grid of the small sweep: steps of 2 % of speed and 5 % of clearance, the tolerances that a type stands for."""

ENVIRONMENT = "chaosgym/ImpactBeamTolerance-v1"
TRAINING_STEPS = 100_000
FOLLOWING = "follow the demand"
MACHINES = 24
"""Machines of the comparison, none of which the agent has met."""


def run_demo(
    folder: str | Path, seed: int = 0, train: bool = False, say: Callable[[str], None] = print
) -> dict[str, Any]:
    """Run everything and keep sweep, classifier, a trained policy, and a picture of each step in a new folder.

    Parameters
    ----------
    folder
        New or empty.
    seed
        Of the training of classifier and agent.
    train
        Train an agent, which takes minutes, rather than take the shipped one.
    say
        Receives one line of progress at a time, and the path of each picture.

    Raises
    ------
    DatasetError
        If the folder exists and is not empty.
    ChaosgymError
        If the packages of the extra [learn] are missing.
    """
    try:
        import sklearn  # noqa: F401

        if train:
            import stable_baselines3  # noqa: F401
    except ImportError as error:
        raise ChaosgymError(f"the demo trains a classifier or an agent and needs the extra [learn]: {error}") from None
    folder = Path(folder)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise DatasetError(f"{folder} exists and is not empty; choose another folder with --out")
    folder.mkdir(parents=True, exist_ok=True)
    began = time.perf_counter()

    pictures: list[str] = []

    def draw(name: str, *results: Any) -> None:
        """Write the picture of a step, and say where."""
        pictures.append(str(_draw(folder / f"{len(pictures) + 1}-{name}.png", name, *results)))
        say(f"    picture: {pictures[-1]}")

    say("1/4 simulate three points")
    records = {kind: _run_point(*point) for kind, point in POINTS.items()}
    draw("responses", records)
    plan = SweepPlan(ImpactBeam(), AXES)
    say(f"2/4 label a sweep of {len(plan)} points")
    sweep = run_sweep(plan, folder / "sweep", progress=True)
    draw("types", sweep)
    say("3/4 train and test the classifier")
    trained = train_classifier(sweep, seed, progress=True)
    trained.classifier.save(folder / "classifier.npz")
    draw("classifier", trained.classifier)
    name = f"agent of {TRAINING_STEPS} steps" if train else "shipped agent"
    say(f"4/4 {f'train an agent for {TRAINING_STEPS} steps and ' if train else ''}compare the {name} with two rules")
    players: dict[str, Policy] = {
        name: _trained(folder, seed) if train else shipped_policy(ENVIRONMENT),
        "back off, with memory": BackOff(),
        FOLLOWING: Follow(),
    }
    jobs = {player: play(policy, ENVIRONMENT, range(MACHINES)) for player, policy in players.items()}
    worst = int(np.argmax(jobs[FOLLOWING].type_iii_share))
    draw("agent", {player: jobs[player].job(worst) for player in (FOLLOWING, name)})
    result = {
        "points": {kind: _point_row(kind, record, sweep) for kind, record in records.items()},
        "sweep": {"points": len(sweep.table), "types": _shares(sweep)},
        "classifier": trained.report,
        "agent": {player: _agent_row(played) for player, played in jobs.items()},
        "pictures": pictures,
    }
    result["seconds"] = time.perf_counter() - began
    return result


def most_cycles(train: bool = False) -> int:
    """Cycles of a demo in which no point of the sweep repeats soon.

    Examples
    --------
    >>> from chaosgym.demo import most_cycles
    >>> most_cycles() < most_cycles(train=True)
    True
    """
    plan, task = SweepPlan(ImpactBeam(), AXES), native_envs(ENVIRONMENT).task
    played = 3 * MACHINES * task.steps + (TRAINING_STEPS if train else 0)
    return len(plan) * plan.budget + played * task.cycles_per_step


def _draw(path: Path, name: str, *results: Any) -> Path:
    """Write the picture of a step, and return its file."""
    from chaosgym.plotting import tour
    from chaosgym.plotting.style import save_picture

    save_picture(getattr(tour, f"{name}_figure")(*results), path)
    return path


def _run_point(frequency: float, clearance: float) -> CycleRecord:
    return simulate(ImpactBeam(excitation_frequency=frequency, clearance=clearance), 400)


def _point_row(kind: str, record: CycleRecord, sweep: LabelledSweep) -> dict[str, Any]:
    """Verdict by simulation of a point, and the type of the sweep's nearest point."""
    verdict = two_step_test(record.after(200))
    peaks = record.peak_force[200:].max(axis=1)
    machine: Any = record.machine
    distance = sum(
        np.log(sweep.column(name) / getattr(machine, name)) ** 2 for name in ("excitation_frequency", "clearance")
    )
    return {
        "frequency_hz": machine.excitation_frequency,
        "clearance_mm": 1e3 * machine.clearance,
        "nature": verdict.nature,
        "period": verdict.period,
        "peak_force_N": [float(peaks.min()), float(peaks.max())],
        "type_in_sweep": str(sweep.column("response_type")[int(np.argmin(distance))]),
    }


def _shares(sweep: LabelledSweep) -> dict[str, float]:
    kinds, counts = np.unique([str(value) for value in sweep.column("response_type")], return_counts=True)
    return {str(kind): float(count) / len(sweep.table) for kind, count in zip(kinds, counts, strict=True)}


def _trained(folder: Path, seed: int) -> TrainedPolicy:
    """An agent that is trained here, and written to the folder."""
    policy = _train_agent(seed)
    (folder / "policy").mkdir()
    save_policy(policy, folder / "policy")
    return policy


def _train_agent(seed: int) -> TrainedPolicy:
    """PPO with a memory of visited speeds, as in agents/ppo.py."""
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecNormalize

    from chaosgym.envs.sb3 import SB3VecEnv, SB3VisitedSpeeds

    torch.set_num_threads(1)
    envs = VecNormalize(SB3VisitedSpeeds(SB3VecEnv(ENVIRONMENT, 64)), gamma=0.95)
    envs.seed(1_000_000 * (seed + 1))
    model = PPO(
        "MlpPolicy",
        envs,
        learning_rate=1e-3,
        n_steps=60,
        batch_size=960,
        n_epochs=6,
        gamma=0.95,
        gae_lambda=0.9,
        seed=seed,
        device="cpu",
        policy_kwargs={"net_arch": [128, 64]},
    )
    network: Any = model.policy.action_net
    with torch.no_grad():
        network.bias[0] += 2.0  # hold the speed at first: motion settles at a speed that is held
    with tqdm(total=TRAINING_STEPS, desc="train agent", unit="step") as bar:

        def advance(values: dict[str, Any], _: Any) -> bool:
            bar.update(values["self"].num_timesteps - bar.n)
            return True

        model.learn(TRAINING_STEPS, callback=advance)
    return exported(model, ENVIRONMENT, envs, memory=True)


def _agent_row(played: Played) -> dict[str, float]:
    return {
        "return": float(played.returns.mean()),
        "standard_error": float(played.returns.std() / np.sqrt(MACHINES)),
        "type_iii_share": float(played.type_iii_share.mean()),
        "mean_deviation": float(played.deviation.mean()),
    }


def demo_table(result: dict[str, Any]) -> list[str]:
    """Lines of the result of ``run_demo``, for people."""
    lines = ["", "three points            nature                peak force [N]      type among its neighbours"]
    for point in result["points"].values():
        period = f", period {point['period']}" if point["period"] else ""
        low, high = point["peak_force_N"]
        where = f"{point['frequency_hz']:g} Hz, +-{point['clearance_mm']:.3f} mm"
        lines.append(
            f"  {where:21s} {point['nature'] + period:21s} {low:6.1f} to {high:6.1f}    {point['type_in_sweep']}"
        )
    shares = ", ".join(f"{kind} {share:.0%}" for kind, share in result["sweep"]["types"].items())
    lines += ["", f"sweep of {result['sweep']['points']} points: {shares}", "", *report_table(result["classifier"])]
    title = f"{MACHINES} machines that no agent has met"
    lines += ["", f"{title:42s} return         Type III   off the demand"]
    for name, row in result["agent"].items():
        figures = f"{row['return']:7.2f} +- {row['standard_error']:4.2f} {row['type_iii_share']:8.1%}"
        lines.append(f"  {name:39s} {figures} {row['mean_deviation']:10.2f} Hz")
    best = max(result["agent"], key=lambda name: result["agent"][name]["return"])
    lines += [f"best: {best}", ""]
    return [*lines, *(f"picture: {path}" for path in result["pictures"])]
