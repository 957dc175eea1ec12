"""A tour of chaosgym on the impact beam: one pass through every floor, in a few minutes.

Simulate a Type I, II and III point, label a sweep, train and test the classifier, train an agent briefly, compare it
with constant speed. Every number is computed here and now.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.wrappers import RescaleObservation
from tqdm import tqdm

from chaosgym.classifier.report import report_table
from chaosgym.classifier.train import train_classifier
from chaosgym.diagnosis import two_step_test
from chaosgym.envs.evaluation import Evaluation, constant_speed, evaluate
from chaosgym.errors import ChaosgymError, DatasetError
from chaosgym.machines import THESIS_IMPACT_BEAM
from chaosgym.simulation import CycleRecord, simulate
from chaosgym.sweeps import Axis, LabelledSweep, SweepPlan, run_sweep

POINTS = {"I": (6.0, 0.127e-3), "II": (19.0, 0.127e-3), "III": (30.0, 0.127e-3)}
"""Excitation frequency [Hz] and clearance [m] of one point of each type."""

AXES = (
    Axis("excitation_frequency", 4.0, 30.0, 103, "log"),
    Axis("clearance", 0.06e-3, 0.145e-3, 19, "log"),
)
"""Grid of the small sweep: steps of 2 % of speed and 5 % of clearance, the tolerances that a type stands for."""

ENVIRONMENT = "chaosgym/ImpactBeam-v0"
TRAINING_STEPS = 40_000
DISCOUNT = 0.98
INITIAL_LOG_STD = -2.0
"""Exploration of about +-1.8 Hz: calm windows are narrow, and a coarser search never stays in one."""

JOBS = 5
TEST_SEED = 10_000
CONSTANT_SPEEDS = 14


def run_demo(folder: str | Path, seed: int = 0, say: Callable[[str], None] = print) -> dict[str, Any]:
    """Run everything and keep sweep, classifier, policy and figure in a new folder.

    Parameters
    ----------
    folder
        New or empty.
    seed
        Of the training of classifier and agent.
    say
        Receives one line of progress at a time.

    Raises
    ------
    DatasetError
        If the folder exists and is not empty.
    ChaosgymError
        If the packages of the extra [learn] are missing.
    """
    try:
        import sklearn  # noqa: F401
        import stable_baselines3  # noqa: F401
    except ImportError as error:
        raise ChaosgymError(f"the demo trains a classifier and an agent and needs the extra [learn]: {error}") from None
    folder = Path(folder)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise DatasetError(f"{folder} exists and is not empty; choose another folder with --out")
    folder.mkdir(parents=True, exist_ok=True)
    began = time.perf_counter()

    say("1/5 simulate three points")
    records = {kind: _run_point(*point) for kind, point in POINTS.items()}
    plan = SweepPlan(THESIS_IMPACT_BEAM, AXES)
    say(f"2/5 label a sweep of {len(plan)} points")
    sweep = run_sweep(plan, folder / "sweep", progress=True)
    say("3/5 train and test the classifier")
    trained = train_classifier(sweep, seed, curve=False, progress=True)
    trained.classifier.save(folder / "classifier.npz")
    say(f"4/5 train an agent for {TRAINING_STEPS} steps")
    model = _train_agent(seed)
    model.save(folder / "policy.zip")
    say("5/5 compare it with constant speed")
    evaluations = _compare(model)
    result = {
        "points": {kind: _point_row(kind, record, sweep) for kind, record in records.items()},
        "sweep": {"points": len(sweep.table), "types": _shares(sweep)},
        "classifier": trained.report,
        "agent": {name: outcome.summary() for name, outcome in evaluations.items()},
        "figure": str(folder / "overview.png"),
    }
    from chaosgym.plotting.overview import overview

    figure = overview(records, sweep, trained.classifier, {name: run.speeds for name, run in evaluations.items()})
    figure.savefig(folder / "overview.png", dpi=130)
    result["seconds"] = time.perf_counter() - began
    return result


def _run_point(frequency: float, clearance: float) -> CycleRecord:
    return simulate(replace(THESIS_IMPACT_BEAM, excitation_frequency=frequency, clearance=clearance), 400)


def _point_row(kind: str, record: CycleRecord, sweep: LabelledSweep) -> dict[str, Any]:
    """What simulation says of a point, and the type of the sweep's nearest point."""
    verdict = two_step_test(record.after(200))
    peaks = record.peak_force[200:, 0]
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


def _environment() -> gym.Env[Any, Any]:
    """The environment with every entry of the observation on one scale."""
    return RescaleObservation(gym.make(ENVIRONMENT), np.float32(-1.0), np.float32(1.0))


def _train_agent(seed: int) -> Any:
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.env_util import make_vec_env
    from stable_baselines3.common.vec_env import VecNormalize

    torch.set_num_threads(1)
    envs = VecNormalize(make_vec_env(_environment, n_envs=8, seed=seed), norm_obs=False, gamma=DISCOUNT)
    model = PPO(
        "MlpPolicy",
        envs,
        learning_rate=1e-3,
        n_steps=200,
        batch_size=200,
        gamma=DISCOUNT,
        seed=seed,
        device="cpu",
        policy_kwargs={"log_std_init": INITIAL_LOG_STD},
    )
    with tqdm(total=TRAINING_STEPS, desc="train agent", unit="step") as bar:

        def advance(values: dict[str, Any], _: Any) -> bool:
            bar.update(values["self"].num_timesteps - bar.n)
            return True

        return model.learn(TRAINING_STEPS, callback=advance)


def _compare(model: Any) -> dict[str, Evaluation]:
    """The agent and the lowest, the highest and the best constant speed on the same jobs."""
    env = _environment()
    drive: Any = env.get_wrapper_attr("drive")
    speeds = np.linspace(drive.lowest_speed, drive.highest_speed, CONSTANT_SPEEDS)
    constants = {speed: evaluate(env, constant_speed(env, speed), JOBS, TEST_SEED) for speed in speeds}
    best = max(constants, key=lambda speed: constants[speed].returns.mean())
    agent = evaluate(env, lambda observation: model.predict(observation, deterministic=True)[0], JOBS, TEST_SEED)
    return {
        "agent": agent,
        f"constant {speeds[0]:g} Hz": constants[speeds[0]],
        f"constant {best:g} Hz (best of {CONSTANT_SPEEDS})": constants[best],
        f"constant {speeds[-1]:g} Hz": constants[speeds[-1]],
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
    lines += ["", f"{f'agent after {TRAINING_STEPS} steps, {JOBS} jobs':32s} return   Type III   damage     time"]
    for name, row in result["agent"].items():
        figures = f"{row['return']:8.2f} {row['type_iii_share']:10.1%} {row['damage']:8.2f} {row['time_cost']:8.2f}"
        lines.append(f"  {name:29s} {figures}")
    return [*lines, "", f"figure: {result['figure']}   ({result['seconds']:.0f} s)"]
