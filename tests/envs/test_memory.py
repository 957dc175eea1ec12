"""The memory of visited speeds tells what was felt where, alone and side by side."""

import gymnasium as gym
import numpy as np
import pytest

from chaosgym.envs import SB3VecEnv, VisitedSpeeds
from chaosgym.envs.kernels.steps import PLACE, REPEATS
from chaosgym.envs.memory import REACH, SpeedMemory, irregularity
from chaosgym.envs.sb3 import SB3VisitedSpeeds

BEAM = "chaosgym/ImpactBeamTolerance-v1"


def test_observations_stay_in_their_space() -> None:
    """Whatever is remembered, and when nothing is yet."""
    env = VisitedSpeeds(gym.make(BEAM))
    env.action_space.seed(0)
    assert env.reset(seed=2)[0] in env.observation_space
    for _ in range(40):
        assert env.step(env.action_space.sample())[0] in env.observation_space


def test_what_was_felt_stands_where_it_was_felt() -> None:
    """After some steps, the entry at the offset of the present speed is what the last steps felt."""
    env = VisitedSpeeds(gym.make(BEAM))
    names = list(env.observation_names)
    env.reset(seed=1)
    for _ in range(8):
        observation = env.step(5)[0]
    assert len(names) == len(observation)
    seen = dict(zip(names, observation, strict=True))
    assert seen["visited_+0"] == 1.0
    assert seen["felt_+0"] > 0.0
    assert seen[f"visited_{-REACH:+d}"] in (0.0, -1.0)
    assert seen["speed_1_steps_ago"] == pytest.approx(env.get_wrapper_attr("speed"))


def test_it_is_forgotten_between_jobs_but_for_what_is_usual() -> None:
    """A second job starts with an empty map; the table of usual values has grown."""
    env = VisitedSpeeds(gym.make(BEAM))
    first = env.reset(seed=1)[0]
    env.step(1)
    assert np.array_equal(env.reset(seed=1)[0], first)
    assert env.memory.usual.count.sum() == 3


def test_side_by_side_as_alone() -> None:
    """The wrapper of stable-baselines3's environments remembers what the single one does, over the end of a job."""
    envs = SB3VisitedSpeeds(SB3VecEnv(BEAM, 2, steps=4), learns=False)
    envs.seed(5)
    single = [VisitedSpeeds(gym.make(BEAM, steps=4), learns=False) for _ in range(2)]
    several = envs.reset()
    for i, env in enumerate(single):
        np.testing.assert_array_equal(several[i], env.reset(seed=5 + i)[0])
    for action in (1, 0, 3, 2, 0, 4):
        several, _, ended, infos = envs.step(np.full(2, action))
        for i, env in enumerate(single):
            observation, _, over, _, _ = env.step(action)
            if over:
                np.testing.assert_array_equal(infos[i]["terminal_observation"], observation)
                observation = env.reset()[0]
            np.testing.assert_array_equal(several[i], observation)
        assert ended.all() == over


def test_noise_alone_is_felt_as_two_thirds_of_its_half_width() -> None:
    """Of a motion that repeats, sensors with an error of 1 N make an irregularity of some 0.6 N; chaos adds to it."""
    generator = np.random.default_rng(0)
    peaks = 50.0 + generator.uniform(-1.0, 1.0, (2000, 10))
    rows = np.zeros((2000, len(PLACE)))
    rows[:, PLACE.std_peak_force] = peaks.std(axis=1)
    for column, lag in REPEATS:
        rows[:, column] = np.abs(peaks[:, lag:] - peaks[:, :-lag]).mean(axis=1)
    assert 0.5 < irregularity(rows).mean() < 0.67


def test_the_names_are_as_many_as_the_numbers() -> None:
    """And differ."""
    assert len(set(SpeedMemory.names())) == len(SpeedMemory.names())
