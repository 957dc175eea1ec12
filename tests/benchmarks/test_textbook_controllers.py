"""Textbook controllers do what they are named after, though they lose."""

import gymnasium as gym
import numpy as np
import pytest

from benchmarks.envs.textbook_controllers import (
    DelayedFeedback,
    ExtremumSeeking,
    ForceFeedback,
    HillClimbing,
    cycle_keywords,
    orbit_to_hold,
)
from chaosgym.control.controllers import Follow
from chaosgym.control.rollout import play
from chaosgym.simulation import simulate

BEAM = "chaosgym/ImpactBeamTolerance-v1"


@pytest.mark.parametrize("controller", [HillClimbing, ExtremumSeeking, ForceFeedback])
def test_they_stay_within_the_range_of_the_task(controller):
    """Whatever they are worth, they finish their jobs near the demand."""
    played = play(controller(), BEAM, np.arange(3), steps=40)
    assert np.nanmax(np.abs(played.speed - played.demand)) <= 2.0 + 4.5
    assert np.all(played.status == 1)


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
    beam = gym.make("chaosgym/ImpactBeam-v1").unwrapped.nominal.at(23.9)
    limit = 0.1
    hold = orbit_to_hold(beam, limit)
    assert hold is not None
    state = simulate(beam, 200).final_state
    held, free = [], simulate(beam, 400, state).peak_force[200:, 0]
    for _ in range(400):
        wanted = -float(hold.gain @ (state.coordinates - hold.state))
        record = simulate(beam.at(23.9 + (wanted if abs(wanted) <= limit else 0.0)), 1, state)
        state = record.final_state
        held.append(record.peak_force[0, 0])
    assert np.std(held[200:]) < 0.2 * np.std(free)
