"""What a job costs, by hand: damage, status and the terms of the reward."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

from chaosgym.envs.kernels.steps import TERMS, rewards_of, status_of
from chaosgym.envs.task import LIFE_PRICE, Status, Task, UnknownKeywordError, demand_of, divided
from chaosgym.errors import ParameterError
from tests.plain_modes import PLAIN_BEAM

TASK = Task(steps=10, cycles_per_step=2, reference_force=50.0, reference_damage=0.5)


def test_each_surface_wears_by_its_own_peaks():
    """Eq. 5.2: a job under the reference force has the reference damage; twice the force has 2^(10/3) times as much."""
    peaks = np.array([[[50.0, 100.0], [50.0, 0.0]]])
    damage = TASK.damage(peaks)
    assert damage.shape == (1, 2)
    np.testing.assert_allclose(damage[0], [0.5 * 2 / 20, 0.5 * 2.0 ** (10.0 / 3.0) / 20], rtol=1e-12)
    assert TASK.job_cycles == 20


def test_lives_compare_without_a_load_rating():
    """Reference force and damage stand in the damage as D / F^p alone; a ratio of lives depends on neither."""
    peaks = np.random.default_rng(0).uniform(20.0, 120.0, (2, 20, 2))
    same = replace(TASK, reference_force=2.0 * 50.0, reference_damage=0.5 * 2.0 ** (10.0 / 3.0))
    other = replace(TASK, reference_force=731.0, reference_damage=0.3)
    np.testing.assert_allclose(same.damage(peaks), TASK.damage(peaks), rtol=1e-12)
    ratio, ratio_there = (np.divide(*task.damage(peaks)) for task in (TASK, other))
    np.testing.assert_allclose(ratio, ratio_there, rtol=1e-12)


def test_a_job_stands_where_the_worst_puts_it():
    """A failed simulation or a stall before a fracture, a fracture before the end, the end at the last step."""
    outcome = [Status.RUNNING] * 3 + [Status.SIMULATION_FAILED, Status.STALLED, Status.RUNNING]
    steps, damage = [9, 10, 10, 10, 10, 3], [0.2, 0.99, 1.0, 2.0, 2.0, 1.5]
    expected = ["RUNNING", "JOB_DONE", "FRACTURE", "SIMULATION_FAILED", "STALLED", "FRACTURE"]
    found = [status_of(TASK.steps, *given) for given in zip(outcome, steps, damage, strict=True)]
    assert [Status(value).name for value in found] == expected


def test_every_term_costs_its_weight():
    """Deviation, share of Type III, life used, time, and each step not done, each by its own weight."""
    task = Task(
        steps=10, type_iii_weight=2.0, deviation_weight=3.0, damage_weight=5.0, time_weight=7.0, failure_weight=11.0
    )
    given = {"deviation": 0.5, "type_iii": 0.25, "damage": 0.1, "time": 0.2, "failed": True, "steps_left": 4.0}
    terms = rewards_of(task.numbers[0], **given)
    assert dict(zip(TERMS, terms, strict=True)) == pytest.approx(
        {
            "reward_deviation": -1.5,
            "reward_type_iii": -0.5,
            "reward_damage": -0.5,
            "reward_time": -1.4,
            "reward_failure": -44.0,
        }
    )
    assert rewards_of(task.numbers[0], **{**given, "failed": False})[-1] == 0.0


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
        ({"trim_step": 0.0}, "^lowest_speed and highest_speed must differ, and trim_step must be positive$"),
        ({"lowest_speed": 20.0, "highest_speed": 20.0, "lowest_demand": 20.0, "highest_demand": 20.0}, "must differ"),
    ],
)
def test_a_task_that_contradicts_itself_is_refused(fields, message):
    """Low ends do not exceed high ones, and the demands lie within the drive's speeds."""
    with pytest.raises(ParameterError, match=message):
        Task(**fields)


def test_ranges_may_be_single_values():
    """A demand that never changes by more or less than 2, and holds for 30 steps each."""
    same = {"smallest_change": 2.0, "largest_change": 2.0, "shortest_hold": 30, "longest_hold": 30}
    assert Task(**same, lowest_demand=16.0, highest_demand=30.0).largest_change == 2.0


class Script:
    """A generator whose draws are written down: shares of the range, and places in a choice."""

    def __init__(self, *draws):
        self.draws = iter(draws)

    def random(self):
        """The next share."""
        return next(self.draws)

    def uniform(self, low, high):
        """The next share of a range."""
        return low + next(self.draws) * (high - low)

    def choice(self, among):
        """What stands in the next place."""
        return among[next(self.draws)]


def test_a_demand_holds_and_changes_as_it_is_drawn():
    """First, then hold, sign and change in turn; a change that would leave the range goes the other way."""
    ranges = {"lowest_demand": 20.0, "highest_demand": 28.0, "smallest_change": 1.0, "largest_change": 3.0}
    task = Task(steps=7, shortest_hold=2, longest_hold=4, trim_step=0.5, **ranges)
    down, up = 0, 1
    #                0.25 -> 22 for 3 steps, -2 -> 20 for 4, -1.6 would be below: +1.6 -> 21.6, on the grid 21.5
    drawn = demand_of(task, Script(0.25, 0.5, down, 0.5, 0.99, down, 0.3, 0.0, up, 0.0))
    assert drawn.tolist() == [22.0, 22.0, 22.0, 20.0, 20.0, 20.0, 20.0, 21.5]
    #                0.75 -> 26, +2 -> 28, +1 would be above: -1 -> 27
    drawn = demand_of(task, Script(0.75, 0.5, up, 0.5, 0.0, up, 0.0, 0.5, up, 0.0))
    assert drawn.tolist() == [26.0, 26.0, 26.0, 28.0, 28.0, 27.0, 27.0, 27.0]


def test_a_demand_stays_in_a_range_that_is_smaller_than_its_changes():
    """Neither up nor down stays inside: the demand goes to the end; the grid ends there too."""
    ranges = {"lowest_demand": 20.0, "highest_demand": 20.8, "smallest_change": 1.0, "largest_change": 1.0}
    task = Task(steps=2, shortest_hold=1, longest_hold=1, trim_step=0.5, **ranges)
    assert demand_of(task, Script(1.0, 0.0, 0, 0.0, 0.0, 1, 0.0, 0.0, 1, 0.0)).tolist() == [20.8, 20.8, 20.0]


def test_keywords_go_to_the_task_or_to_the_machine():
    """The speed is the agent's; a keyword of neither is named with the one that was meant."""
    task, fields = divided(TASK, PLAIN_BEAM, {"steps": 5, "damping_ratio": 0.02, "fidelity": "standard"})
    assert (task.steps, task.reference_force, fields) == (5, 50.0, {"damping_ratio": 0.02, "fidelity": "standard"})
    with pytest.raises(ParameterError, match="is what the agent sets"):
        divided(TASK, PLAIN_BEAM, {"excitation_frequency": 20.0})
    meant = {"damping_ration": "damping_ratio", "step": "steps", "fidelty": "fidelity", "tolerance": "tolerances"}
    for wrong, right in (meant | {"model_fidelty": "model_fidelity"}).items():
        with pytest.raises(UnknownKeywordError, match=rf"'{wrong}'; did you mean {right}\?"):
            divided(TASK, PLAIN_BEAM, {wrong: 0.02})
    with pytest.raises(UnknownKeywordError, match=r"known: .*, action, steps, .* and the fields of impact-beam"):
        divided(TASK, PLAIN_BEAM, {"zzz": 0.02})


def test_an_objective_is_a_set_of_weights():
    """Life prices damage and nothing irregular; what is given beside it stands; another name is refused."""

    def made(**keywords):
        return gym.make("chaosgym/ImpactBeam-v1", **keywords).unwrapped.task

    usual, life, both = (made(objective=name) for name in ("irregular", "life", "both"))
    assert usual == made()
    assert (life.type_iii_weight, life.damage_weight) == (0.0, LIFE_PRICE)
    assert (both.type_iii_weight, both.damage_weight) == (usual.type_iii_weight, LIFE_PRICE)
    assert made(objective="life", damage_weight=3.0).damage_weight == 3.0
    with pytest.raises(ParameterError, match="objective = 'love' is not one of irregular, life, both"):
        made(objective="love")
