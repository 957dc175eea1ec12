"""A learned map remembers what was felt at each speed, and goes where its network expects the least cost."""

import numpy as np
import pytest

from chaosgym.control.policies import load_policy, save_policy
from chaosgym.control.policies.learned_map import CHANNELS, READINGS, FeltSpeeds, LearnedMap, readings_of
from chaosgym.control.policies.network import Dense, Network
from chaosgym.control.rollout import play
from chaosgym.envs.observation import OBSERVATION_NAMES
from chaosgym.envs.vector_env import native_envs
from chaosgym.errors import ModelFileError

ENV = "chaosgym/ImpactBeamTolerance-v1"
TASK = native_envs(ENV).task
SPEEDS = len(TASK.grid)
WILD, CALM = 8.0, -8.0
"""Logits of the share of irregular cycles."""


def _map_of(logits, peaks):
    """A policy that believes in one map, whatever it feels."""
    told = np.concatenate([logits, np.log(peaks)]).astype(np.float32)
    layer = Dense(np.zeros((2 * SPEEDS, CHANNELS * SPEEDS + 1), np.float32), told, "none")
    usual = np.zeros((SPEEDS, len(READINGS))), np.ones((SPEEDS, len(READINGS)))
    return LearnedMap(ENV, Network(None, (layer,)), *usual)


def _observed(speed, demand, force=80.0):
    values = dict.fromkeys(OBSERVATION_NAMES, 0.0) | {"speed": speed, "demand": demand, "mean_peak_force": force}
    return np.array([[values[name] for name in OBSERVATION_NAMES]] * 2, np.float32)


def test_it_goes_to_the_nearest_speed_that_is_calm():
    """Calm at one speed in 1.25 Hz, where all else is irregular; where it is calm everywhere, the demand."""
    logits = np.where(np.abs(TASK.grid % 1.25 - 0.25) < 0.01, CALM, WILD)
    job = play(_map_of(logits, np.full(SPEEDS, 80.0)), ENV, [0, 1])
    held = job.speed[1:] == job.speed[:-1]
    assert held.mean() > 0.8
    np.testing.assert_allclose(np.mod(job.speed[1:][held], 1.25), 0.25)
    assert job.deviation.max() < 0.7
    job = play(_map_of(np.full(SPEEDS, CALM), np.full(SPEEDS, 80.0)), ENV, [0, 1], steps=30)
    assert job.deviation.max() < 0.2


def test_a_wary_map_leaves_a_demand_that_it_has_felt():
    """Irregular at 20 Hz and calm beside it: it goes at once, after a step at 20 Hz, or never."""
    logits = np.where(TASK.grid == 20.0, WILD, CALM)
    for wary, gain, first, then in ((False, 0.05, 0.25, 0.25), (True, 0.05, 0.0, 0.25), (False, 0.95, 0.0, 0.0)):
        policy = _map_of(logits, np.full(SPEEDS, 80.0))
        policy.least_gain, policy.wary = gain, wary
        envs = native_envs(ENV, 2, action="speed", lowest_demand=20.0)
        envs.reset(seed=0)
        policy.start(envs)
        asked = [policy(_observed(speed, 20.0))[0, 0] for speed in (18.0, 20.0)]
        assert np.abs(np.subtract(asked, 20.0)).tolist() == [first, then]


def test_where_life_counts_it_goes_to_the_least_load():
    """The same network, with the weights of another objective: the one speed of half the load, within the band."""
    peaks = np.where(TASK.grid == 23.0, 40.0, 80.0)
    policy = _map_of(np.full(SPEEDS, WILD), peaks)
    envs = native_envs(ENV, 2, objective="life", action="speed")
    envs.reset(seed=0)
    policy.start(envs)
    np.testing.assert_array_equal(policy(_observed(22.0, 22.0)), 23.0)
    np.testing.assert_array_equal(policy(_observed(22.0, 20.0)), 20.0)


def test_a_settled_reading_takes_the_place_of_one_on_the_way():
    """The first step at a speed counts until the second; later ones weigh half; another speed is another memory."""
    usual = np.zeros((SPEEDS, len(READINGS))), np.ones((SPEEDS, len(READINGS)))
    felt, place = FeltSpeeds(TASK, 2, *usual), 8
    assert TASK.grid[place] == 12.0

    def after(force, speed=12.0):
        row = felt.add(_observed(speed, 12.0, force))[0]
        return row[:-1].reshape(SPEEDS, CHANNELS)

    def reading(force):
        return readings_of(_observed(12.0, 12.0, force), TASK)[0, 0]

    assert after(10.0)[place, :3] == pytest.approx([1.0, 0.0, reading(10.0)])
    assert after(20.0)[place, :3] == pytest.approx([1.0, 1.0, reading(20.0)])
    assert after(40.0)[place, 2] == pytest.approx(0.5 * (reading(20.0) + reading(40.0)))
    elsewhere = after(30.0, 13.0)
    assert elsewhere[:, 0].sum() == 2.0
    on_the_way = after(99.0)
    assert on_the_way[place, 2] == elsewhere[place, 2]


def test_a_map_is_saved_and_refused_where_it_does_not_fit(tmp_path):
    """Files give the same speeds; another machine, other speeds and shapes that do not fit end in one line."""
    policy = _map_of(np.linspace(WILD, CALM, SPEEDS), np.linspace(60.0, 90.0, SPEEDS))
    policy.least_gain, policy.wary = 0.125, True
    save_policy(policy, tmp_path)
    job, again = (play(player, ENV, [3], steps=20) for player in (policy, load_policy(tmp_path)))
    np.testing.assert_array_equal(job.speed, again.speed)
    assert (load_policy(tmp_path).least_gain, load_policy(tmp_path).wary) == (0.125, True)
    with pytest.raises(ModelFileError, match=r"machine impact-beam.*slider-crank"):
        play(policy, "chaosgym/SliderCrank-v1", [0], steps=2)
    with pytest.raises(ModelFileError, match=f"knows {SPEEDS} speeds; this task has 29"):
        play(policy, ENV, [0], steps=2, trim_step=0.5)
    with pytest.raises(ModelFileError, match="a deviation of the readings is not positive"):
        LearnedMap(ENV, policy.network, policy.mean, 0.0 * policy.deviation)
    with pytest.raises(ModelFileError, match=r"the least gain is -1\.0; allowed: 0 or more"):
        LearnedMap(ENV, policy.network, policy.mean, policy.deviation, least_gain=-1.0)
    with pytest.raises(ModelFileError, match="the mean of the readings is"):
        LearnedMap(ENV, policy.network, policy.mean[:, :2], policy.deviation)
    with pytest.raises(ModelFileError, match="expected: float32"):
        LearnedMap(ENV, policy.network, policy.mean[1:], policy.deviation[1:])


def test_steps_of_another_length_are_warned_of(tmp_path):
    """A policy says from steps of how many cycles it learned; without a word, from those of the machine's own task."""
    policy = _map_of(np.full(SPEEDS, CALM), np.full(SPEEDS, 80.0))
    with pytest.warns(UserWarning, match=r"learned from steps of 10 cycles and plays with 1; give cycles_per_step=10"):
        play(policy, ENV, [0], steps=2, cycles_per_step=1)
    policy.cycles_per_step = 20
    save_policy(policy, tmp_path)
    play(load_policy(tmp_path), ENV, [0], steps=2, cycles_per_step=20)
    with pytest.warns(UserWarning, match="from steps of 20 cycles and plays with 10"):
        play(load_policy(tmp_path), ENV, [0], steps=2)
