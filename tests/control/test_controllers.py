"""Controllers do what they are named after, on machines side by side."""

from unittest.mock import Mock

import gymnasium as gym
import numpy as np
import pytest

from chaosgym.control.controllers import (
    BackOff,
    Bandit,
    Belief,
    BestFelt,
    CommonSchedule,
    ConstantTrim,
    Follow,
    MapFollower,
    RecedingHorizon,
    Schedule,
    SkipBands,
)
from chaosgym.control.controllers.planned import best_schedule
from chaosgym.control.maps import Maps, maps_of
from chaosgym.control.rollout import play
from chaosgym.envs.kernels.steps import PLACE
from chaosgym.envs.vector_env import native_envs

BEAM = "chaosgym/ImpactBeamTolerance-v1"
MACHINES = range(12, 24)
"""Following costs much on most of them."""


@pytest.fixture(scope="module")
def own():
    """Maps of the machines that are played."""
    return maps_of(BEAM, machines=MACHINES)


@pytest.fixture(scope="module")
def following():
    """What following the demand gives."""
    return play(Follow(), BEAM, MACHINES)


def test_a_map_is_of_one_machine_however_soon_its_joint_fractures():
    """A job that ends gives its place to another machine, which would be measured at the speeds that are left."""
    usual, brittle = (maps_of(BEAM, machines=range(2), reference_damage=each) for each in (0.5, 100.0))
    np.testing.assert_array_equal(brittle.share, usual.share)
    np.testing.assert_array_equal(brittle.mean_peak, usual.mean_peak)


def test_following_is_at_the_demand(following):
    """But for the steps after a change."""
    assert np.mean(following.speed == following.demand) > 0.95
    assert following.type_iii_share.mean() > 0.05


def test_the_own_map_avoids_type_iii_close_to_the_demand(own, following):
    """It returns more on nine in ten machines where following costs much; to know demands to come adds little."""
    played = play(MapFollower([own]), BEAM, MACHINES)
    dear = following.returns < -3.0
    assert dear.sum() >= 5
    assert np.mean(played.returns[dear] > following.returns[dear]) > 0.9
    assert played.returns.mean() > 0.5 * following.returns.mean()
    assert played.type_iii_share.mean() < 0.3 * following.type_iii_share.mean()
    ahead = play(Schedule([own]), BEAM, MACHINES)
    assert ahead.returns.mean() == pytest.approx(played.returns.mean(), abs=0.2 * abs(played.returns.mean()))


def test_backing_off_learns_from_measurements(following):
    """It has less than 0.6 of the Type III of following, with or without a memory."""
    for remembers in (True, False):
        played = play(BackOff(remembers=remembers), BEAM, MACHINES)
        assert played.type_iii_share.mean() < 0.6 * following.type_iii_share.mean()
        assert played.returns.mean() > following.returns.mean()


def test_the_best_felt_speed_is_one_that_was_felt():
    """Every speed was run before in the job or is a new demand, or lies on the way to one of these."""
    envs = native_envs(BEAM, 8, action="speed", objective="life")
    observations, _ = envs.reset(seed=5)
    player = BestFelt()
    player.start(envs)
    felt = [set() for _ in range(8)]
    returned = 0
    for _ in range(envs.task.steps):
        speeds = player(observations)[:, 0]
        for job, (wanted, row) in enumerate(zip(speeds.tolist(), observations, strict=True)):
            demand = float(row[PLACE.demand])
            felt[job].add(round(float(row[PLACE.speed]), 6))
            assert wanted == demand or round(wanted, 6) in felt[job]
            assert abs(wanted - demand) <= envs.task.largest_trim
            returned += wanted != demand
        observations, *_ = envs.step(speeds[:, None])
    assert returned > 100
    following, best = (play(one, BEAM, range(6), objective="life") for one in (Follow(), BestFelt()))
    assert following.damage.mean() > 1.2 * best.damage.mean()


def test_looking_ahead_stays_within_the_range_of_the_task(monkeypatch):
    """Whatever it is worth, it finishes its jobs near the demand."""
    monkeypatch.setattr("chaosgym.control.controllers.planned.EVERY", 40)
    played = play(RecedingHorizon(), BEAM, np.arange(3), steps=40)
    assert np.nanmax(np.abs(played.speed - played.demand)) <= 2.0 + 4.5
    assert np.all(played.status == 1)


def test_looking_ahead_searches_every_ten_steps_and_at_a_new_demand(monkeypatch):
    """And at no other time: a search takes as long as the rest of the job."""
    searched = []

    def best(self, jobs, demand):
        searched.append((step, jobs.tolist()))
        return demand

    monkeypatch.setattr(RecedingHorizon, "_best", best)
    controller = RecedingHorizon()
    envs = gym.make_vec(BEAM, num_envs=2).unwrapped
    observations, _ = envs.reset(seed=[1, 2])
    controller.start(envs)
    monkeypatch.setattr(controller, "_batch", Mock())
    rows = np.array(observations)
    for step in range(12):
        rows[:, PLACE.demand] = [20.0, 20.0 if step < 4 else 21.0]
        controller.speeds(rows)
    assert searched == [(0, [0, 1]), (4, [1]), (10, [0, 1])]


def test_a_bar_is_shown_only_where_it_is_asked_for(capsys):
    """A job that is played by a script says nothing on standard error."""
    played = play(Follow(), BEAM, [12], steps=2)
    assert {"machine": 12, "seed": played.seeds[0], "env": BEAM}.items() <= played.as_dict().items()
    assert capsys.readouterr().err == ""
    play(Follow(), BEAM, [12], steps=2, progress="a job")
    assert "a job" in capsys.readouterr().err


def test_those_that_know_models_use_their_maps(own, following):
    """With the machines' own maps as the fleet, belief, bandit and common plan all beat following."""
    for controller in (Bandit(own), Belief(own)):
        assert play(controller, BEAM, MACHINES).returns.mean() > following.returns.mean()


def _maps(share):
    share = np.atleast_2d(np.asarray(share, float))
    return Maps(16.0 + 0.25 * np.arange(57), share, 50.0 + 0.0 * share)


def test_bands_are_skipped_to_the_nearest_edge():
    """Within a band of the nominal map the speed is its nearest edge, outside the demand."""
    wild = np.zeros(57)
    wild[20:29] = 1.0
    controller = SkipBands(_maps(wild))
    controller.start(gym.make_vec(BEAM, num_envs=3).unwrapped)
    rows = np.zeros((3, len(PLACE)))
    rows[:, PLACE.demand] = [20.0, 21.5, 22.75]
    assert controller.speeds(rows).tolist() == [20.0, 20.75, 23.25]


def test_the_constant_trim_leaves_a_band_that_is_everywhere_alike():
    """If only the lowest speeds are calm, no trim pays; if every other speed is, a small one does."""
    envs = gym.make_vec(BEAM, num_envs=1).unwrapped
    for share, trim in ((np.ones(57), 0.0), (np.arange(57) % 2, 0.0)):
        controller = ConstantTrim(_maps(share))
        controller.start(envs)
        assert abs(controller.trim) <= abs(trim) + 0.25


def test_the_best_schedule_is_the_best_of_all():
    """By enumeration of every schedule over four steps and four speeds."""
    generator = np.random.default_rng(0)
    cost = generator.uniform(size=(4, 3, 4))
    start = np.array([0, 2, 3])
    places = best_schedule(cost, start, reach=1)
    for job in range(3):
        sums = {}
        for choice in np.ndindex(4, 4, 4, 4):
            if np.all(np.abs(np.diff([start[job], *choice])) <= 1):
                sums[choice] = sum(cost[t, job, place] for t, place in enumerate(choice))
        assert tuple(places[:, job].tolist()) == min(sums, key=sums.get)


def test_a_common_schedule_is_the_same_for_all_machines(own):
    """Machines that meet the same demand go at the same speeds."""
    controller = CommonSchedule(own)
    envs = gym.make_vec(BEAM, num_envs=2, action="speed").unwrapped
    envs.reset(seed=[3, 3], options={"machine": np.array([1, 2])})
    controller.start(envs)
    assert np.array_equal(controller._plan[:, 0], controller._plan[:, 1])


def test_no_controller_stays_where_the_force_is_larger():
    """Backing off an irregular demand into a resonance, twice the force, it goes back; a task may allow any force."""

    class Away(BackOff):
        def speeds(self, observations):
            """One above the demand."""
            return observations[:, PLACE.demand] + 1.0

    def jobs(force, **weights):
        envs = native_envs(BEAM, 1, action="speed", **weights)
        envs.reset(seed=3)
        rule, asked = Away(), []
        rule.start(envs)
        for speed, peak in ((20.0, 80.0), (21.0, force), (20.0, 80.0)):
            observation = np.zeros((1, 14), np.float32)
            observation[0, [PLACE.speed, PLACE.demand, PLACE.mean_peak_force]] = speed, 20.0, peak
            asked.append(float(rule(observation)[0, 0]))
        return asked

    assert jobs(160.0) == [21.0, 20.0, 20.0]
    assert jobs(100.0) == [21.0, 21.0, 21.0]
    assert jobs(160.0, damage_weight=0.0) == [21.0, 21.0, 21.0]
