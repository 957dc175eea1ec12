"""Terms of reward and cost, checked by hand."""

import numpy as np
import pytest

from chaosgym.design.fatigue import statistical_life
from chaosgym.envs.tasks import Status, Step, Task, damage_of, does_not_repeat
from chaosgym.errors import ParameterError


def _step(peaks: list[float] | np.ndarray, cycles: int = 5) -> Step:
    recent = np.asarray(peaks, dtype=float)
    return Step(
        speed=10.0, duration=cycles / 10.0, peak_force=np.tile(recent[-cycles:, None], (1, 2)), recent_peaks=recent
    )


@pytest.mark.parametrize("period", range(1, 9))
def test_periods_up_to_eight_repeat(period: int) -> None:
    """A response that cycles among a few peak forces is periodic, whatever their size."""
    cycle = 30.0 + 20.0 * np.random.default_rng(period).random(period)
    assert not does_not_repeat(_step(np.resize(cycle, 40)))


def test_the_logistic_map_does_not_repeat_where_it_is_chaotic() -> None:
    """At r = 4 the map is chaotic, at r = 3.5 it has period 4."""
    share = {}
    for r in (3.5, 4.0):
        x = np.empty(2000)
        x[0] = 0.3
        for i in range(1, len(x)):
            x[i] = r * x[i - 1] * (1.0 - x[i - 1])
        share[r] = np.mean([does_not_repeat(_step(20.0 + 60.0 * x[:end])) for end in range(500, 2000, 5)])
    assert share[3.5] == 0.0
    assert share[4.0] > 0.8


def test_peaks_within_five_per_cent_repeat_and_beyond_do_not() -> None:
    """The threshold is the repeatability of the thesis' measurements."""
    drift = np.arange(40.0)
    assert not does_not_repeat(_step(100.0 + 4.0 * (drift == 37)))
    assert does_not_repeat(_step(100.0 + 6.0 * (drift == 37)))


def test_no_contact_repeats() -> None:
    """Where nothing touches, every peak force is zero, and zero repeats."""
    assert not does_not_repeat(_step(np.zeros(40)))


def test_dithering_does_not_wipe_out_the_record() -> None:
    """Alternating between two levels in every step still compares with the steps before."""
    irregular = 50.0 + 15.0 * np.random.default_rng(1).uniform(-1.0, 1.0, 40)
    assert does_not_repeat(_step(irregular))


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
    step = _step(np.full(40, 90.0))
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
