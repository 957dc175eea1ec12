"""The split ``other_simulator`` plays the beams of the test in Exudyn; other environments have none."""

import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from chaosgym.control.controllers import Follow
from chaosgym.control.rollout import play
from chaosgym.envs.exudyn_beam import ExudynBatch
from chaosgym.envs.task import Status
from chaosgym.envs.variants import OTHER_SIMULATOR
from chaosgym.errors import ChaosgymError, ParameterError

BEAM = "chaosgym/ImpactBeamTolerance-v1"
FLEET = {"level": "fleet", "split": OTHER_SIMULATOR}
ONE = np.zeros(1, np.int64)
IDEAL = {"speed_ripple": 0.0, "sensor_error": 0.0, "bouncing_error": 0.0, "missed_impacts": 0.0}


def cycles_of(batch, beam, speed):
    """Forty cycles at a speed from rest, and their growth."""
    batch.start(0, beam)
    return batch.run_varied(ONE, np.full((1, 40), speed))


def test_exudyn_moves_the_same_beam():
    """Periodic at 19 Hz with the same peaks, impacts and bouncing; at 23.25 Hz deviations grow in both."""
    pytest.importorskip("exudyn")
    beam = gym.make(BEAM).unwrapped.nominal
    batches = beam.batch(1), ExudynBatch(beam, 1)
    (ours, growth), (theirs, grown) = (cycles_of(batch, beam, 19.0) for batch in batches)
    np.testing.assert_allclose(theirs.peak_force[0, -8:], ours.peak_force[0, -8:], rtol=0.01)
    np.testing.assert_array_equal(theirs.impacts[0, -8:], ours.impacts[0, -8:])
    np.testing.assert_allclose(theirs.bounce_duration[0, -8:], ours.bounce_duration[0, -8:], rtol=0.01)
    assert max(growth[0, -8:].mean(), grown[0, -8:].mean()) < -0.05
    assert min(cycles_of(batch, beam, 23.25)[1][0, -25:].mean() for batch in batches) > 0.5


def test_a_job_is_that_of_the_test_in_another_simulator():
    """Machine 1 of the fleet at 12 Hz, where it is calm: same machine and demand, what is felt within 2 %."""
    pytest.importorskip("exudyn")
    told = []
    for split in ("test", OTHER_SIMULATOR):
        env = gym.make(BEAM, level="fleet", split=split, action="speed", run_in_cycles=60, **IDEAL).unwrapped
        env.reset(seed=4, options={"machine": 1, "speed": 12.0})
        machine = env.machine
        steps = [env.step(np.array([12.0], np.float32)) for _ in range(2)]
        told.append((machine, env._job.demand, np.array([step[0] for step in steps]), steps[-1][-1]))
    (ours, demand, seen, info), (theirs, same, felt, other) = told
    assert ours == theirs
    np.testing.assert_array_equal(demand, same)
    np.testing.assert_allclose(felt, seen, rtol=0.02, atol=0.02)
    for name in ("type_iii", "clearance", "largest_force", "job_hours"):
        assert other[name] == pytest.approx(info[name], rel=0.05), name


def test_it_is_an_environment(monkeypatch):
    """Gymnasium's checker has nothing to say, side by side the same bytes come out, and what diverges ends a job."""
    pytest.importorskip("exudyn")
    short = {"run_in_cycles": 3, "cycles_per_step": 2, "lowest_speed": 20.0, "lowest_demand": 20.0}
    env = gym.make(BEAM, **FLEET, **short).unwrapped
    check_env(env)
    envs = gym.make_vec(BEAM, num_envs=2, **FLEET, **short)
    seen, _ = envs.reset(seed=6)
    np.testing.assert_array_equal(seen[1], env.reset(seed=7)[0])
    np.testing.assert_array_equal(envs.step(np.array([3, 4]))[0][1], env.step(4)[0])
    felt = np.array([80.0, np.nan]), np.zeros(2), np.zeros(2), 0.0
    monkeypatch.setattr(env._job.batch._beams[0], "cycle", lambda speed: felt)
    assert env.step(0)[-1]["status"] == Status.SIMULATION_FAILED


@pytest.mark.slow
def test_following_costs_there_what_it_costs_here():
    """Three machines of the test: the table of 24 jobs says -1.4 (-3.7 to 1.2) between the simulators."""
    pytest.importorskip("exudyn")
    ours, theirs = (play(Follow(), BEAM, range(3), **FLEET | {"split": split}) for split in ("test", OTHER_SIMULATOR))
    assert theirs.returns.mean() == pytest.approx(ours.returns.mean(), abs=6.0)
    np.testing.assert_allclose(theirs.life, ours.life, rtol=0.1)


def test_what_it_can_not_do_is_refused_in_one_line(monkeypatch):
    """Other machines, pictures, kicks, a contact too stiff for the steps, and no Exudyn."""
    for env_id in ("chaosgym/SliderCrankTolerance-v1", "chaosgym/AnyMachine-v0"):
        with pytest.raises(ParameterError, match="the impact beam alone has it, such as chaosgym/ImpactBeam"):
            gym.make(env_id, split=OTHER_SIMULATOR)
    monkeypatch.setitem(sys.modules, "exudyn", None)
    with pytest.raises(ChaosgymError, match="pip install exudyn"):
        gym.make(BEAM, **FLEET)
    monkeypatch.undo()
    pytest.importorskip("exudyn")
    for keywords, told in (
        ({"render_mode": "rgb_array"}, "not possible with split = 'other_simulator'"),
        ({"kick": 0.001}, "kick is out of range; allowed: 0"),
        ({"contact_stiffness": 1e9}, "by less contact_stiffness"),
        ({"n_modes": 1, "fitted_modes": 0}, "fitted_modes of 2 or more"),
    ):
        with pytest.raises(ParameterError, match=told):
            gym.make(BEAM, **FLEET, **keywords).reset(seed=0)
