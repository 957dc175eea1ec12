"""Cycles, environment steps, sweep points and classifier rows per second.

Rates per second of the wall clock, and per second of processor time, which suffer less where a computer is busy with
something else. Environments take random actions. CartPole, and HalfCheetah where mujoco is installed, stand beside
ours.
"""

import os
import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import gymnasium as gym
import numba
import numpy as np
from tqdm import tqdm

from benchmarks.performance.timing import KernelTime, Rate, kernel_time, rate
from chaosgym.classifier import default_classifier
from chaosgym.core import compilation
from chaosgym.machines import MACHINES, ImpactBeam, Machine, SliderCrank
from chaosgym.simulation import ExactEvents, Integrator, RungeKutta4, simulate
from chaosgym.sweeps import SweepPlan, run_sweep
from chaosgym.sweeps.plan import default_axes

BEAM, CRANK = ImpactBeam(n_modes=5, fitted_modes=0), SliderCrank(n_modes=3, fitted_modes=0, matrix_update_interval=1.0)
"""Machines that are timed: natural modes alone, the crank's matrices held over 1 deg."""

SUB_ENVIRONMENTS = 256
"""Sub-environments of a vector environment."""

SETTLING_CYCLES = 50
"""Cycles from rest before a response is timed."""

SWEEP_POINTS = 16
"""Random points of a timed sweep over the machine's usual ranges."""

CLASSIFIER_ROWS = 10_000
"""Machines classified at once."""

STEPS = {"chaosgym": (200, 5), "CartPole-v1": (5000, 500), "HalfCheetah-v5": (1000, 8)}
"""Steps of a timed run of a single environment and of a vector environment, by the first part of the id."""

OTHER_ENVIRONMENTS = ("CartPole-v1", "HalfCheetah-v5")


RANGE = [
    (float(frequency), float(clearance))
    for frequency in np.geomspace(4.0, 30.0, 5)
    for clearance in np.geomspace(0.03e-3, 0.254e-3, 4)
]
"""Frequencies [Hz] and clearances [m] of the points over which the beam's rate is averaged."""

RANGE_CYCLES = 100
"""Cycles of a timed run at each."""

LOOP = 1000
"""Steps of logistic maps in the reference loops, which each computer can run."""

Measure = Callable[[Any, int], Rate]


def benchmark(repeats: int = 5, *, progress: bool = False) -> dict[str, Any]:
    """Measure every rate; each figure is the median of ``repeats`` runs.

    Returns
    -------
    dict
        ``range``, the mean over the beam's range and its ends, then ``cycles``, ``env_steps``, ``vector_env_steps``,
        ``sweep_points``, ``classifier_rows``: by name, how many
        ``per_second`` and ``per_processor_second``. ``step_microseconds``, see ``step_cost``. ``in_loops``: the
        beam's mean cycle and the Python of each step, in ``reference_loops``. ``load_average``: how busy the computer
        was before and after.
    """
    beam, crank = BEAM, CRANK
    environments = {name: name for name in _environments()}
    results: dict[str, Any] = {"load_average": {"before": os.getloadavg()[0]}, "range": beam_range(repeats)}
    work: dict[str, tuple[Measure, dict[str, Any]]] = {
        "cycles": (cycle_rate, _points()),
        "env_steps": (env_rate, environments),
        "vector_env_steps": (vector_env_rate, environments),
        "sweep_points": (sweep_rate, {beam.name: beam, crank.name: crank}),
        "classifier_rows": (classifier_rate, {beam.name: beam.name}),
    }
    with tqdm(total=sum(len(subjects) for _, subjects in work.values()), desc="bench", disable=not progress) as bar:
        for quantity, (measure, subjects) in work.items():
            results[quantity] = {}
            for name, subject in subjects.items():
                results[quantity][name] = measure(subject, repeats)._asdict()
                bar.update()
    ours = [name for name in environments if name not in OTHER_ENVIRONMENTS]
    results["step_microseconds"] = {name: step_cost(name, repeats) for name in ours}
    loops, (mean, *_) = reference_loops(repeats), results["range"].items()
    results["in_loops"] = {f"compiled, {mean[0]}": 1e6 / mean[1]["per_processor_second"] / loops["compiled"]} | {
        f"Python of a step, {name}": cost["python"] / loops["python"]
        for name, cost in results["step_microseconds"].items()
    }
    results["load_average"]["after"] = os.getloadavg()[0]
    return results


def logistic(steps: int) -> float:
    """One logistic map in chaos."""
    x = 0.4
    for _ in range(steps):
        x = 3.9 * x * (1.0 - x)
    return x


def logistics(steps: int) -> Any:
    """As many logistic maps at once as keep a processor busy."""
    x = np.linspace(0.1, 0.4, 64)
    for _ in range(steps):
        for i in range(len(x)):
            x[i] = 3.9 * x[i] * (1.0 - x[i])
    return x


def reference_loops(repeats: int) -> dict[str, float]:
    """Processor time [us] of ``LOOP`` steps: of 64 logistic maps, "compiled", and of one in "python".

    What a computer is slower in these it may be slower in everything: ratios to them compare computers.
    """
    found = {}
    for name, loop, times in (("compiled", numba.njit(logistics), 200), ("python", logistic, 50)):

        def run(loop: Callable[[int], Any] = loop, times: int = times) -> int:
            for _ in range(times):
                loop(LOOP)
            return times

        found[name] = 1e6 / rate(run, repeats).per_processor_second
    return found


def beam_range(repeats: int) -> dict[str, dict[str, float]]:
    """Cycles of the beam over its range of frequency and clearance: the mean cycle, the cheapest and the dearest."""
    found = {}
    for frequency, clearance in RANGE:
        beam = replace(BEAM, excitation_frequency=frequency, clearance=clearance)
        name = f"{frequency:.3g} Hz, {1e3 * clearance:.3g} mm"
        found[name] = np.array(cycle_rate((beam, ExactEvents(), RANGE_CYCLES), repeats))
    by_cost = sorted(found, key=lambda name: -found[name][1])
    mean = 1.0 / np.mean([1.0 / both for both in found.values()], axis=0)
    return {
        f"impact beam, mean cycle of {len(RANGE)} points": Rate(*mean.tolist())._asdict(),
        f"cheapest: {by_cost[0]}": Rate(*found[by_cost[0]].tolist())._asdict(),
        f"dearest: {by_cost[-1]}": Rate(*found[by_cost[-1]].tolist())._asdict(),
    }


def _points() -> dict[str, tuple[Machine, Integrator, int]]:
    """Operating points that the documentation quotes, the integrator, and cycles of a timed run."""
    exact, fixed = ExactEvents(), RungeKutta4(4000)
    beam, crank = BEAM, CRANK
    points: dict[str, tuple[Machine, Integrator, int]] = {}
    for frequency, clearance in ((30.0, 0.127e-3), (30.0, 0.032e-3), (19.0, 0.127e-3), (10.0, 0.127e-3)):
        name = f"impact beam, {frequency:g} Hz, {1e3 * clearance:g} mm"
        points[name] = (replace(beam, excitation_frequency=frequency, clearance=clearance), exact, 300)
    points["impact beam, 30 Hz, 0.127 mm, Runge-Kutta 4, 4000 steps"] = (
        replace(beam, excitation_frequency=30.0, clearance=0.127e-3),
        fixed,
        100,
    )
    for clearance in (0.032e-3, 0.254e-3):
        for degrees in (1.0, 5.0):
            name = f"slider crank, 200 rpm, {1e3 * clearance:g} mm, matrices held over {degrees:g} deg"
            held = replace(crank, crank_speed=200.0, slider_clearance=clearance, matrix_update_interval=degrees)
            points[name] = (held, exact, 100)
    return points


def cycle_rate(point: tuple[Machine, Integrator, int], repeats: int) -> Rate:
    """Operating cycles of a settled response, one thread."""
    machine, integrator, cycles = point
    settled = simulate(machine, SETTLING_CYCLES, integrator=integrator).final_state
    return rate(lambda: len(simulate(machine, cycles, settled, integrator=integrator)), repeats)


def _environments() -> list[str]:
    names = [f"chaosgym/{MACHINES.class_name(name)}-v1" for name in MACHINES]
    for name in OTHER_ENVIRONMENTS:
        try:
            gym.make(name).close()
        except (gym.error.Error, ImportError):
            continue
        names.append(name)
    return names


def env_rate(name: str, repeats: int) -> Rate:
    """Steps of a single environment."""
    env = gym.make(name)
    env.reset(seed=0)
    env.action_space.seed(0)
    steps, _ = STEPS[name.partition("/")[0]]

    def run() -> int:
        for _ in range(steps):
            _, _, terminated, truncated, _ = env.step(env.action_space.sample())
            if terminated or truncated:
                env.reset()
        return steps

    return rate(run, repeats)


def step_cost(name: str, repeats: int) -> dict[str, float]:
    """Processor time [us] of a step of a single environment, and what of it is ``python``: all but the kernel.

    ``warm`` is that of a kernel whose results are written again, so that it leaves the caches as they are. Medians over
    the steps of ``repeats`` equal runs on one thread, after one that is not counted.
    """
    env, steps = gym.make(name), STEPS[name.partition("/")[0]][0]
    actions = np.random.default_rng(0).integers(0, 6, steps)
    moved: list[tuple[float, float]] = []
    warm: list[tuple[float, float]] = []
    with patch.object(compilation, "THREADS", 1), kernel_time() as kernels:
        for _ in range(repeats):
            moved += _steps_taken(env, actions, kernels)
        kernels.written = []
        _steps_taken(env, actions, kernels)
        kept, kernels.written = kernels.written, None
        for _ in range(repeats):
            kernels.replayed = iter(kept)
            warm += _steps_taken(env, actions, kernels)
    whole, python = (statistics.median(column) for column in zip(*moved, strict=True))
    return {"step": whole, "python": python, "warm": statistics.median(python for _, python in warm)}


def _steps_taken(env: Any, actions: Any, kernels: KernelTime) -> list[tuple[float, float]]:
    """Processor time [us] of each step of a run, and what of it is no kernel."""
    taken = []
    env.reset(seed=0)
    for action in actions:
        kernels.seconds, start = 0.0, time.thread_time()
        _, _, terminated, truncated, _ = env.step(action)
        step = time.thread_time() - start
        taken.append((1e6 * step, 1e6 * (step - kernels.seconds)))
        if terminated or truncated:
            env.reset()
    return taken


def vector_env_rate(name: str, repeats: int) -> Rate:
    """Steps, of all sub-environments together, of the vector environment that ``make_vec`` gives."""
    envs = gym.make_vec(name, num_envs=SUB_ENVIRONMENTS)
    envs.reset(seed=0)
    envs.action_space.seed(0)
    _, steps = STEPS[name.partition("/")[0]]

    def run() -> int:
        for _ in range(steps):
            envs.step(envs.action_space.sample())
        return steps * SUB_ENVIRONMENTS

    result = rate(run, repeats)
    envs.close()
    return result


def sweep_rate(machine: Machine, repeats: int) -> Rate:
    """Labelled points of a random sweep over speed and clearance, on all processors."""
    plan = SweepPlan(machine, default_axes(machine, "random"), "random", SWEEP_POINTS)

    def run() -> int:
        with tempfile.TemporaryDirectory() as folder:
            return len(run_sweep(plan, Path(folder) / "sweep").table)

    return rate(run, repeats)


def classifier_rate(machine_name: str, repeats: int) -> Rate:
    """Machines that the shipped classifier types, many at once."""
    classifier = default_classifier(machine_name)
    low, high = classifier.parameters.low_, classifier.parameters.high_
    values = np.random.default_rng(0).uniform(low, high, (CLASSIFIER_ROWS, len(low)))

    def classify() -> int:
        classifier.classify_table(values)
        return len(values)

    return rate(classify, repeats)
