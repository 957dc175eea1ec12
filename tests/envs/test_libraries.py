"""What other libraries ask of an environment, and hand it."""

import gymnasium as gym
import numpy as np
import pytest

from chaosgym.control.evaluation import policy_of
from chaosgym.errors import ModelFileError, ParameterError


@pytest.mark.parametrize("keywords", [{}, {"steps": 7}])
def test_the_steps_of_a_job_are_in_its_specification(keywords):
    """``spec.max_episode_steps`` is what a job has; it ends by itself, as termination, and wrappers can ask for it."""
    env = gym.make("chaosgym/ImpactBeam-v1", **keywords)
    steps = keywords.get("steps", 120)
    assert env.spec.max_episode_steps == env.unwrapped.spec.max_episode_steps == steps
    assert gym.make_vec("chaosgym/ImpactBeam-v1", num_envs=1, **keywords).unwrapped.spec.max_episode_steps == steps
    gym.wrappers.TimeAwareObservation(env)
    if keywords:
        env.reset(seed=0)
        ends = [env.step(0)[2:4] for _ in range(steps)]
        assert ends == [(False, False)] * (steps - 1) + [(True, False)]


@pytest.mark.parametrize("action", [1, np.int64(1), np.array(1), np.array([1]), 1.0, np.float32(1.0), [1]])
def test_a_whole_number_in_any_form_is_an_action(action):
    """Arrays of one and whole floats mean the same; 1.5 and complex numbers mean nothing."""
    env = gym.make("chaosgym/ImpactBeam-v1", disable_env_checker=True).unwrapped
    env.reset(seed=0)
    observation = env.step(action)[0]
    env.reset(seed=0)
    np.testing.assert_array_equal(observation, env.step(1)[0])
    for wrong in (1.5, 1 + 0j, "1", [1, 1], -1, 6, None):
        with pytest.raises(ParameterError, match="is not usable"):
            env.step(wrong)


@pytest.mark.parametrize("name", ["A2C", "DQN", "TD3", "DDPG", "TQC", "QRDQN", "TRPO", "CrossQ", "ARS", "MaskablePPO"])
def test_the_file_of_any_algorithm_is_read(name, tmp_path):
    """An untrained model of each algorithm, saved and read, acts as it did; what is no model is refused by name."""
    stable_baselines3, sb3_contrib = pytest.importorskip("stable_baselines3"), pytest.importorskip("sb3_contrib")
    kind = getattr(stable_baselines3, name, None) or getattr(sb3_contrib, name)
    continuous = name in ("TD3", "DDPG", "TQC", "CrossQ")
    env = gym.make("chaosgym/ImpactBeam-v1", action="continuous" if continuous else "trim")
    model = kind("LinearPolicy" if name == "ARS" else "MlpPolicy", env, seed=0, device="cpu")
    model.save(tmp_path / "model.zip")
    read = policy_of(tmp_path / "model.zip")
    assert read.keywords == {"action": "continuous" if continuous else "trim"}
    observation, _ = env.reset(seed=1)
    expected, _ = model.predict(observation, deterministic=True)
    found, _ = read._model.predict(observation, deterministic=True)
    np.testing.assert_array_equal(found, expected)
    (tmp_path / "other.zip").write_bytes((tmp_path / "model.zip").read_bytes()[:500])
    with pytest.raises(ModelFileError, match="can't be read as a model of stable-baselines3"):
        policy_of(tmp_path / "other.zip")
