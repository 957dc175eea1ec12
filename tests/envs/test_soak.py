"""Long runs of the native vector environment; ``CHAOSGYM_SOAK=5`` makes them five times as long."""

import os
import resource

import gymnasium as gym
import numpy as np
import pytest

from chaosgym.envs.task import Status

COUNT = 256

TIMES = float(os.environ.get("CHAOSGYM_SOAK", "1"))

WARM_UP = 4
"""Tenths of a run after which caches are full."""


def _peak_memory() -> float:
    """Largest resident memory of this process so far, in units of a million bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "machine_steps"),
    [("chaosgym/ImpactBeamTolerance-v1", 400_000), ("chaosgym/SliderCrankTolerance-v1", 100_000)],
)
def test_no_step_is_invalid_and_memory_stays(name: str, machine_steps: int) -> None:
    """Steps of one cycle at random speeds, with random resets, on machines drawn anew, leave no invalid value."""
    envs = gym.make_vec(name, num_envs=COUNT, cycles_per_step=1, steps=1000)
    generator = np.random.default_rng(0)
    envs.reset(seed=0)
    steps = -(-int(TIMES * machine_steps) // COUNT)
    tenths = {int(steps * tenth / 10) for tenth in range(10)}
    memory, jobs = [], 0
    for step in range(steps):
        observations, rewards, terminated, truncated, infos = envs.step(generator.integers(0, 6, COUNT))
        assert observations in envs.observation_space
        assert np.all(np.isfinite(rewards))
        assert np.all(rewards <= 0.0)
        for key, values in infos.items():
            assert np.all(np.isfinite(values)), key
        assert Status.SIMULATION_FAILED not in infos["status"]
        assert not truncated.any()
        jobs += int(terminated.sum())
        if step % 10 == 0:
            envs.reset(options={"reset_mask": np.isin(np.arange(COUNT), generator.integers(COUNT, size=5))})
        if step in tenths:
            memory.append(_peak_memory())
    assert jobs > 0 or name == "chaosgym/SliderCrankTolerance-v1"
    memory.append(_peak_memory())
    curve = ", ".join(f"{each:.1f}" for each in memory)
    print(f"{name}: {steps * COUNT} steps, {jobs} jobs; MB at each tenth of them: {curve}")
    assert memory[-1] - memory[WARM_UP] < 4.0
