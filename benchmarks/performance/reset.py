"""Processor time of a reset of many beams, and of the motion within it: `python -m benchmarks.performance.reset`."""

import sys

import numpy as np

from benchmarks.performance.timing import processor_seconds
from chaosgym.envs.vector_env import native_envs

ENVIRONMENT = "chaosgym/ImpactBeamTolerance-v1"


def reset_seconds(count: int) -> dict[str, float]:
    """Processor time [s] of a ``reset``, of the ``motion`` of as many cycles as it runs in, and of a ``step``."""
    envs = native_envs(ENVIRONMENT, count)
    generators = [np.random.default_rng(k) for k in range(count)]
    envs.reset(seed=0)
    return {
        "reset": processor_seconds(lambda: envs.reset(seed=1)),
        "motion": processor_seconds(lambda: envs.jobs._run(np.arange(count), envs.task.run_in_cycles, generators)),
        "step": processor_seconds(lambda: envs.step(envs.action_space.sample())),
    }


if __name__ == "__main__":
    count = int(sys.argv[1]) if sys.argv[1:] else 4096
    print({name: round(seconds, 2) for name, seconds in reset_seconds(count).items()}, f"s of {count} beams")
