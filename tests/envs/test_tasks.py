"""Terms of reward and cost, checked by hand."""

import numpy as np
import pytest

from chaosgym.design.fatigue import statistical_life
from chaosgym.envs.tasks import Status, Step, Task, damage_of
from chaosgym.errors import ParameterError


def test_damage_is_the_basic_rating_life() -> None:
    """A million cycles at the load rating use up one life; half the force lasts 2^(10/3) times as long."""
    full = damage_of(np.full((1000, 2), 60.0), load_rating=60.0, acceleration=1000.0)
    half = damage_of(np.full((1000, 2), 30.0), load_rating=60.0, acceleration=1000.0)
    assert full == pytest.approx([1.0, 1.0])
    assert full / half == pytest.approx([2 ** (10 / 3)] * 2)


def test_an_agent_and_a_designer_see_the_same_life() -> None:
    """Forces that vary from cycle to cycle break the bearing in a job after the life of eq. 5.4."""
    forces = np.random.default_rng(3).uniform(20.0, 90.0, 500)
    million_lives = damage_of(forces[:, None], load_rating=70.0, acceleration=1e6 / len(forces))
    assert 1.0 / million_lives == pytest.approx([statistical_life(forces, 70.0)], rel=1e-12)


def test_terms_add_up_to_the_reward() -> None:
    """Every weight appears once."""
    task = Task(time_weight=2.0, damage_weight=3.0, type_iii_weight=5.0, failure_weight=7.0)
    step = Step(speed=10.0, duration=0.5, peak_force=np.full((5, 2), 90.0))
    reward, named = task.judge(step, Status.FRACTURE, type_iii=True, damage_increase=0.1, job_time=50.0)
    assert named["reward_time"] == pytest.approx(-2.0 * 0.5 / 50.0)
    assert named["reward_damage"] == pytest.approx(-0.3)
    assert named["reward_type_iii"] == pytest.approx(-5.0 * 5 / 1000)
    assert named["reward_failure"] == -7.0
    assert reward == pytest.approx(sum(value for name, value in named.items() if name.startswith("reward")))
    assert (named["cost"], named["cost_type_iii"], named["cost_force"]) == (1.0, 1.0, 1.0)


def test_a_job_is_a_whole_number_of_steps() -> None:
    """Otherwise the last step would have another meaning."""
    with pytest.raises(ParameterError, match=r"job_cycles = 1001 .* multiples of cycles_per_step = 5"):
        Task(job_cycles=1001)
