"""What a job costs, by hand: damage, status and the terms of the reward."""

import gymnasium as gym
import numpy as np
import pytest

from chaosgym.envs.task import Status, Task, UnknownKeywordError, split
from chaosgym.errors import ParameterError
from tests.plain_modes import PLAIN_BEAM

TASK = Task(steps=10, cycles_per_step=2, load_rating=50.0, life_share=0.5)


def test_each_surface_wears_by_its_own_peaks():
    """Eq. 5.2: a job under the load rating takes the life_share; twice the force takes 2^(10/3) times as much."""
    peaks = np.array([[[50.0, 100.0], [50.0, 0.0]]])
    damage = TASK.damage(peaks)
    assert damage.shape == (1, 2)
    np.testing.assert_allclose(damage[0], [0.5 * 2 / 20, 0.5 * 2.0 ** (10.0 / 3.0) / 20], rtol=1e-12)
    assert TASK.job_cycles == 20


def test_a_job_stands_where_the_worst_puts_it():
    """A failed simulation before a fracture, a fracture before the end, the end at the last step."""
    failed = np.array([False, False, False, True, False])
    steps, damage = np.array([9, 10, 10, 10, 3]), np.array([0.2, 0.99, 1.0, 2.0, 1.5])
    expected = ["RUNNING", "JOB_DONE", "FRACTURE", "SIMULATION_FAILED", "FRACTURE"]
    assert [Status(int(value)).name for value in TASK.status(failed, steps, damage)] == expected


def test_every_term_costs_its_weight():
    """Deviation, share of Type III, life used, time, and each step not done, each by its own weight."""
    task = Task(
        steps=10, type_iii_weight=2.0, deviation_weight=3.0, damage_weight=5.0, time_weight=7.0, failure_weight=11.0
    )
    given = {
        "deviation": np.array([0.5]),
        "type_iii": np.array([0.25]),
        "damage": np.array([0.1]),
        "time": np.array([0.2]),
        "failed": np.array([True]),
        "steps_left": np.array([4.0]),
    }
    terms = {name: float(value[0]) for name, value in task.rewards(**given).items()}
    assert terms == pytest.approx(
        {
            "reward_deviation": -1.5,
            "reward_type_iii": -0.5,
            "reward_damage": -0.5,
            "reward_time": -1.4,
            "reward_failure": -44.0,
        }
    )
    assert task.rewards(**{**given, "failed": np.array([False])})["reward_failure"][0] == 0.0


def test_the_speeds_of_a_task_end_at_its_highest():
    """Both ends belong to the grid, also where the spacing is no sum of powers of two."""
    task = Task(lowest_speed=10.0, highest_speed=11.0, lowest_demand=10.0, highest_demand=11.0, trim_step=0.1)
    np.testing.assert_allclose(task.grid, np.linspace(10.0, 11.0, 11))


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"lowest_speed": 31.0}, "lowest_speed = 31"),
        ({"lowest_demand": 15.0}, "lowest_speed = 16"),
        ({"highest_demand": 31.0}, "highest_demand = 31"),
        ({"lowest_demand": 29.5}, "lowest_demand = 29.5"),
        ({"smallest_change": 5.0}, "smallest_change = 5"),
        ({"shortest_hold": 50}, "shortest_hold = 50"),
        ({"trim_step": 0.0}, "trim_step must be positive"),
        ({"lowest_speed": 20.0, "highest_speed": 20.0, "lowest_demand": 20.0, "highest_demand": 20.0}, "must differ"),
    ],
)
def test_a_task_that_contradicts_itself_is_refused(fields, message):
    """Low ends do not exceed high ones, and the demands lie within the drive's speeds."""
    with pytest.raises(ParameterError, match=message):
        Task(**fields)


def test_keywords_go_to_the_task_or_to_the_machine():
    """The speed is the agent's; a keyword of neither is named with the one that was meant."""
    task, fields = split(TASK, PLAIN_BEAM, {"steps": 5, "damping_ratio": 0.02, "fidelity": "standard"})
    assert (task.steps, task.load_rating, fields) == (5, 50.0, {"damping_ratio": 0.02, "fidelity": "standard"})
    with pytest.raises(ParameterError, match="is what the agent sets"):
        split(TASK, PLAIN_BEAM, {"excitation_frequency": 20.0})
    with pytest.raises(UnknownKeywordError, match="did you mean damping_ratio"):
        split(TASK, PLAIN_BEAM, {"damping_ration": 0.02})
    with pytest.raises(UnknownKeywordError, match="known: action"):
        split(TASK, PLAIN_BEAM, {"zzz": 0.02})


def test_kicks_in_one_call_move_a_crank_as_kicks_cycle_by_cycle():
    """Observations, rewards and forces are equal bit for bit, whether a step is one call or one for each cycle."""

    def played(traced):
        env = gym.make("chaosgym/SliderCrank-v1").unwrapped
        env._job.traced = traced
        steps = [env.reset(seed=3), *(env.step(7 * k % 6) for k in range(12))]
        return [(step[0].tobytes(), *step[1:]) for step in steps]

    assert played(0) == played(1)
