"""Controllers do what they are named after, on machines side by side."""

import gymnasium as gym
import numpy as np
import pytest

from chaosgym.control.comparison import cycle_keywords
from chaosgym.control.controllers import (
    BackOff,
    Bandit,
    Belief,
    CommonSchedule,
    ConstantTrim,
    DelayedFeedback,
    ExtremumSeeking,
    Follow,
    ForceFeedback,
    HillClimbing,
    MapFollower,
    RecedingHorizon,
    Schedule,
    SkipBands,
)
from chaosgym.control.controllers.chaos_control import orbit_to_hold
from chaosgym.control.controllers.planned import best_schedule
from chaosgym.control.maps import Maps, maps_of
from chaosgym.control.rollout import play
from chaosgym.simulation import simulate

BEAM = "chaosgym/ImpactBeamTolerance-v1"
MACHINES = range(24)


@pytest.fixture(scope="module")
def own():
    """Maps of the machines that are played."""
    return maps_of(BEAM, machines=MACHINES)


@pytest.fixture(scope="module")
def following():
    """What following the demand gives."""
    return play(Follow(), BEAM, MACHINES)


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


def test_backing_off_learns_from_measurements():
    """It has less than 0.6 of the Type III of following, with or without a memory."""
    many = range(128)
    following = play(Follow(), BEAM, many)
    for remembers in (True, False):
        played = play(BackOff(remembers=remembers), BEAM, many)
        assert played.type_iii_share.mean() < 0.6 * following.type_iii_share.mean()
        assert played.returns.mean() > following.returns.mean()


@pytest.mark.parametrize(
    "make",
    [
        HillClimbing,
        ExtremumSeeking,
        ForceFeedback,
        lambda fleet=None: RecedingHorizon(every=40),
    ],
)
def test_others_stay_within_the_range_of_the_task(make):
    """Whatever they are worth, they finish their jobs near the demand."""
    played = play(make(), BEAM, np.arange(3), steps=40)
    assert np.nanmax(np.abs(played.speed - played.demand)) <= 2.0 + 4.5
    assert np.all(played.status == 1)


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
    rows = np.zeros((3, 14))
    rows[:, 1] = [20.0, 21.5, 22.75]
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


def test_a_job_of_single_cycles_is_the_same_job():
    """For controllers that act in each cycle: the same machines, nearly the same demand, on average as much to lose."""
    task = gym.make_vec(BEAM, num_envs=1).unwrapped.task
    machines = range(12)
    coarse, fine = play(Follow(), BEAM, machines), play(Follow(), BEAM, machines, **cycle_keywords(task))
    assert fine.speed.shape == (1200, 12)
    assert np.mean(fine.demand[::10] == coarse.demand) > 0.9
    assert fine.returns.mean() == pytest.approx(coarse.returns.mean(), rel=0.1)


def test_delayed_feedback_corrects_by_half_a_slew_limit_at_most():
    """And not at all where the peaks repeat."""
    task = gym.make_vec(BEAM, num_envs=1).unwrapped.task
    keywords = cycle_keywords(task) | {"steps": 200}
    played = play(DelayedFeedback(), BEAM, range(2), **keywords)
    assert np.nanmax(np.abs(played.speed[60:] - played.demand[60:])) <= 0.11


def test_an_orbit_can_be_held_that_the_free_motion_leaves():
    """Corrections of the speed by the state keep the peaks of a chaotic beam near each other."""
    beam = gym.make("chaosgym/ImpactBeam-v1").unwrapped.nominal.at(26.0)
    limit = 0.1
    hold = orbit_to_hold(beam, limit)
    assert hold is not None
    state = simulate(beam, 200).final_state
    held, free = [], simulate(beam, 400, state).peak_force[200:, 0]
    for _ in range(400):
        wanted = -float(hold.gain @ (state.coordinates - hold.state))
        record = simulate(beam.at(26.0 + (wanted if abs(wanted) <= limit else 0.0)), 1, state)
        state = record.final_state
        held.append(record.peak_force[0, 0])
    assert np.std(held[200:]) < 0.2 * np.std(free)
