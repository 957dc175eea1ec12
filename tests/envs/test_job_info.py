"""What a job has come to stands in ``info`` in hours and newtons, by the peaks that the joint has felt."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from chaosgym.control.controllers import Follow
from chaosgym.control.rollout import play
from chaosgym.design.fatigue import equivalent_force, rating_life
from chaosgym.envs.kernels.steps import PLACE, SO_FAR
from chaosgym.envs.variants import HELD_OUT_SEED

BEAM = "chaosgym/ImpactBeamTolerance-v1"


@pytest.mark.parametrize("env_id", [BEAM, "chaosgym/SliderCrankTolerance-v1", "chaosgym/AnyMachine-v0"])
def test_damage_and_force_follow_from_the_peaks(env_id, monkeypatch):
    """At every step as ``design.fatigue`` tells of all true peaks so far: the worse surface, by ISO 281's exponent."""
    env = gym.make(env_id, steps=12, speed_ripple=0.0, kick=0.0).unwrapped
    felt, run = [], env._job._moved

    def moved(*given):
        cycles, growth = run(*given)
        felt.append(cycles.peak_force[0].copy())
        return cycles, growth

    monkeypatch.setattr(env._job, "_moved", moved)
    env.reset(seed=5)
    felt.clear()
    task, infos, seconds = env.task, [], 0.0
    rating = task.reference_force * env._job.force[0]
    for step in range(task.steps):
        infos.append(env.step(step % 5)[-1])
        info, peaks = infos[-1], np.concatenate(felt)
        load = max(equivalent_force(side) for side in peaks.T if side.any())
        assert info["job_equivalent_force"] == pytest.approx(load, rel=1e-9)
        assert info["job_largest_force"] == pytest.approx(peaks.max(), rel=1e-12)
        assert info["job_type_iii"] == pytest.approx(np.mean([one["type_iii"] for one in infos]), rel=1e-12)
        assert info["job_deviation"] == pytest.approx(np.mean([one["deviation"] for one in infos]), rel=1e-12)
        done = len(peaks) / task.job_cycles
        assert info["damage"] == pytest.approx(task.reference_damage * done / rating_life(load, rating), rel=1e-9)
        seconds += task.cycles_per_step * env.machine.cycle_period
        assert info["job_hours"] == pytest.approx(seconds / 3600.0, rel=1e-9)
    assert infos[-1]["is_success"]


def test_without_contact_nothing_wears():
    """No force in a gap that the tip does not cross; where forces wear nothing, no constant one wears as much."""
    for keywords, force in (({"clearance": 0.1}, 0.0), ({"reference_damage": 0.0}, np.nan)):
        env = gym.make("chaosgym/ImpactBeam-v1", **keywords)
        env.reset(seed=0)
        info = env.step(0)[-1]
        np.testing.assert_equal([info["job_equivalent_force"], info["damage"]], [force, 0.0])


def test_a_comparison_tells_the_info_of_the_last_step():
    """Following on machine 3, step by step by hand and as comparisons play it; the next job begins at zero."""
    played = play(Follow(), BEAM, [3])
    env = gym.make(BEAM, action="speed")
    seed = HELD_OUT_SEED + 3
    observation, _ = env.reset(seed=seed, options={"machine": 3})
    ended = False
    while not ended:
        observation, _, ended, _, info = env.step(observation[[PLACE.demand]])
    told = (played.deviation, played.type_iii_share, played.largest_force, played.equivalent_force, played.hours)
    assert [info[name] for name in SO_FAR] == pytest.approx([values[0] for values in told], rel=1e-9)
    observation, _ = env.reset(seed=seed, options={"machine": 3})
    info = env.step(observation[[PLACE.demand]])[-1]
    assert info["job_type_iii"] == info["type_iii"]
    assert info["job_largest_force"] == info["largest_force"]


def test_statistics_of_episodes_stand_beside_it():
    """Gymnasium's ``RecordEpisodeStatistics`` adds its own key, and a job that ended tells in ``final_info``."""
    env = gym.wrappers.RecordEpisodeStatistics(gym.make(BEAM, steps=1))
    env.reset(seed=0)
    alone = env.step(0)[-1]
    assert set(SO_FAR) | {"episode"} <= set(alone)
    envs = gym.make_vec(BEAM, num_envs=2, steps=1, autoreset_mode=AutoresetMode.SAME_STEP)
    envs.reset(seed=0)
    final = envs.step(np.zeros(2, int))[-1]["final_info"]
    assert all(final[name][0] == alone[name] for name in SO_FAR)
