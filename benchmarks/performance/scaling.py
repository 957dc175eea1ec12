"""Scaling over processors, and what an environment costs beside its physics.

A vector environment takes the same random actions from the same seeds on one thread and on all, so that both compute
the same bytes. Wall time tells how well the threads share the work, which only an idle computer shows; processor time
on one thread tells what a step of one machine costs outside the kernels, physics left out.
"""

import statistics
import time
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numba
import numpy as np

from benchmarks.performance.rates import SUB_ENVIRONMENTS
from benchmarks.performance.timing import kernel_time
from chaosgym.machines import MACHINES

WARM_UP_STEPS = 12
"""Steps that are not timed; the speeds have spread after them."""

TIMED_STEPS = 8


@dataclass(frozen=True)
class Scaling:
    """How a vector environment uses the processors.

    ``environment``; ``machines`` side by side; ``threads``; ``one_thread``, ``all_threads`` wall time [s] of a step of
    one machine; ``efficiency`` share of the ideal speed-up; ``physics``, ``wrapper`` processor time [s] of a step of
    one machine inside and outside the kernels, on one thread.
    """

    environment: str
    machines: int
    threads: int
    one_thread: float
    all_threads: float
    efficiency: float
    physics: float
    wrapper: float


def vector_scaling(repeats: int = 5) -> list[Scaling]:
    """Measure the environment of every machine; medians of ``repeats`` runs.

    A first run, in which kernels are loaded and the crank meets its speeds, is not counted.
    """
    return [_scaling_of(f"chaosgym/{MACHINES.class_name(name)}-v1", repeats) for name in MACHINES]


def _scaling_of(name: str, repeats: int) -> Scaling:
    threads = numba.config.NUMBA_NUM_THREADS
    try:
        _timed_steps(name, threads)
        runs = [(_timed_steps(name, 1), _timed_steps(name, threads)) for _ in range(repeats)]
    finally:
        numba.set_num_threads(threads)
    one, many = (statistics.median(run[k][0] for run in runs) for k in (0, 1))
    return Scaling(
        environment=name,
        machines=SUB_ENVIRONMENTS,
        threads=threads,
        one_thread=one,
        all_threads=many,
        efficiency=one / (threads * many),
        physics=statistics.median(run[0][1] for run in runs),
        wrapper=statistics.median(run[0][2] for run in runs),
    )


def _timed_steps(name: str, threads: int) -> tuple[float, float, float]:
    """Wall time of a step of one machine, and this thread's processor time inside and outside the kernels [s]."""
    numba.set_num_threads(threads)
    envs: Any = gym.make_vec(name, num_envs=SUB_ENVIRONMENTS)
    actions = np.random.default_rng(0).integers(0, 6, (WARM_UP_STEPS + TIMED_STEPS, SUB_ENVIRONMENTS))
    envs.reset(seed=0)
    for action in actions[:WARM_UP_STEPS]:
        envs.step(action)
    with kernel_time() as kernels:
        wall, processor = time.perf_counter(), time.thread_time()
        for action in actions[WARM_UP_STEPS:]:
            envs.step(action)
        wall, processor = time.perf_counter() - wall, time.thread_time() - processor
    envs.close()
    each = 1.0 / (TIMED_STEPS * SUB_ENVIRONMENTS)
    return wall * each, kernels.seconds * each, (processor - kernels.seconds) * each
