"""An offline dataset is written in Minari's format and read back by Minari."""

import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest

from tests.agents.test_scripts import AGENTS

pytest.importorskip("minari", reason="needs the extra [offline]")


@pytest.mark.parametrize(
    "name",
    ["ImpactBeam"]
    + [
        pytest.param(name, marks=pytest.mark.slow)
        for name in ("ImpactBeamTolerance", "ImpactBeamWear", "SliderCrank", "SliderCrankTolerance", "SliderCrankWear")
    ],
)
def test_a_dataset_is_loaded_back_and_replays(tmp_path, name):
    """Two jobs of 200 steps; the environment that the dataset names gives the first job again, bit for bit."""
    command = [
        sys.executable,
        str(AGENTS / "export_minari.py"),
        "--env",
        f"chaosgym/{name}-v0",
        "--jobs",
        "2",
        "--seed",
        "5",
        "--out",
        str(tmp_path),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    from minari.dataset.minari_dataset import MinariDataset

    dataset = MinariDataset(tmp_path / "chaosgym" / name / "wandering-v0" / "data")
    assert dataset.total_episodes == 2
    assert dataset.total_steps == 400
    job = dataset[0]
    assert job.observations.shape == (201, 14 if name.endswith("Wear") else 13)
    assert job.terminations[-1]
    env = gym.make(dataset.env_spec)
    observation, _ = env.reset(seed=5)
    np.testing.assert_array_equal(observation, job.observations[0])
    for step, action in enumerate(job.actions):
        observation, reward, *_ = env.step(action)
        np.testing.assert_array_equal(observation, job.observations[step + 1])
        assert reward == job.rewards[step]
    again = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "choose another folder" in again.stderr
