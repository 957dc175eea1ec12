"""Life under varying forces: every equation in closed form, and the library's counting against a hand count."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chaosgym.design.fatigue import (
    conservative_life,
    equivalent_force,
    equivalent_force_of_history,
    rainflow_cycles,
    rating_life,
    relative_life,
    required_load_rating,
    statistical_life,
)
from chaosgym.errors import DesignError

FORCES = st.lists(st.floats(1e-3, 1e4), min_size=1, max_size=30)


def test_life_under_constant_force():
    """Half the load rating gives 2^p million cycles (eq. 5.2), by whichever of the three ways."""
    assert rating_life(50.0, 100.0, 3.0) == 8.0
    assert statistical_life([50.0] * 7, 100.0, 3.0) == pytest.approx(8.0)
    assert conservative_life([50.0] * 7, 100.0, 3.0) == pytest.approx(8.0)
    assert rating_life(50.0, 100.0) == pytest.approx(2.0 ** (10.0 / 3.0))


def test_the_catalogue_rating_of_a_published_bearing():
    """Shigley's Mechanical Engineering Design, 9th ed., example 11-1: 5000 h at 1725 rev/min under 400 lbf.

    The rating for a million revolutions is 3211 lbf, 14.3 kN, by the exponent 3 of ball bearings.
    """
    million_turns, force = 5000.0 * 60.0 * 1725.0 / 1e6, 400.0 * 4.4482216
    assert required_load_rating(force, million_turns, 3.0) / 4.4482216 == pytest.approx(3211.0, abs=1.0)
    assert rating_life(force, 14.3e3, 3.0) == pytest.approx(million_turns, rel=5e-3)


def test_life_under_two_levels():
    """A quarter of the cycles at the rating and the rest without force use up a life in 4 million cycles (eq. 5.4)."""
    assert statistical_life([100.0, 0.0], 100.0, probabilities=[0.25, 0.75]) == pytest.approx(4.0)
    assert statistical_life([100.0, 50.0], 100.0, probabilities=[1.0, 0.0]) == pytest.approx(1.0), (
        "a force that is rare"
    )
    one_by_one = 1.0 / (0.3 / rating_life(80.0, 200.0) + 0.7 / rating_life(120.0, 200.0))
    assert statistical_life([80.0, 120.0], 200.0, probabilities=[0.3, 0.7]) == pytest.approx(one_by_one, rel=1e-12)


def test_required_load_rating_undoes_life():
    """Eq. 5.5 with the life of eq. 5.4 gives back the load rating."""
    forces = [31.0, 47.0, 62.0, 84.0]
    life = statistical_life(forces, 500.0)
    assert required_load_rating(equivalent_force(forces), life) == pytest.approx(500.0, rel=1e-12)


@given(FORCES, st.floats(1e-6, 1e6))
def test_units_do_not_matter(forces, factor):
    """Forces and load rating in another unit give the same life."""
    life = statistical_life(forces, 300.0)
    assert statistical_life([factor * force for force in forces], factor * 300.0) == pytest.approx(life, rel=1e-9)


@given(FORCES)
def test_statistical_life_is_never_below_the_conservative_one(forces):
    """Palmgren-Miner lies between the life under the largest and the life under the smallest force."""
    statistical, largest = statistical_life(forces, 300.0), conservative_life(forces, 300.0)
    smallest = rating_life(min(forces), 300.0)
    assert largest * (1 - 1e-12) <= statistical <= smallest * (1 + 1e-12)


def test_a_tenth_more_force_takes_a_quarter_of_the_life():
    """The thesis' criterion of 5.5.2: 10 % of force is 25 % of life by the cubic law."""
    assert relative_life([1.1], 1.0).statistical == pytest.approx(0.75, abs=0.002)


def test_forces_behind_figure_5_12():
    """Relative lives of 1e-3 to 1e-1 at 140 rpm mean peaks 10 to 2.15 times the reference (cubic law)."""
    life = relative_life([10.0, 10.0 ** (1.0 / 3.0)], 1.0)
    assert (life.lowest, life.highest) == pytest.approx((1e-3, 1e-1))
    assert life.lowest < life.statistical < life.highest


def test_without_force_life_is_infinite():
    """No contact, no fatigue."""
    assert math.isinf(statistical_life([0.0, 0.0], 100.0))


def test_rainflow_of_impacts_counts_each_from_zero():
    """Impacts of 60, 40 and 20 N between which the force falls to zero are three full cycles of those ranges."""
    ranges, counts = rainflow_cycles([0.0, 60.0, 0.0, 40.0, 0.0, 20.0, 0.0])
    assert dict(zip(ranges, counts, strict=True)) == {20.0: 1.0, 40.0: 1.0, 60.0: 1.0}


def test_rainflow_of_nested_ranges():
    """A dip from 50 to 30 N within a swing from 0 to 80 N is a cycle of 20 N inside one of 80 N."""
    ranges, counts = rainflow_cycles([0.0, 50.0, 30.0, 80.0, 0.0])
    assert dict(zip(ranges, counts, strict=True)) == {20.0: 1.0, 80.0: 1.0}


def test_a_history_that_repeats_has_no_beginning():
    """Wherever the record was cut, every cycle closes: swings of 60 and of 50 N, each once."""
    history = np.array([30.0, 10.0, 0.0, 60.0, 0.0, 50.0])
    for shift in range(6):
        ranges, counts = rainflow_cycles(np.roll(history, shift))
        assert dict(zip(ranges, counts, strict=True)) == {50.0: 1.0, 60.0: 1.0}


def test_a_constant_force_tires_nothing():
    """Without a change of force there is no range that counts."""
    assert equivalent_force_of_history([7.0, 7.0, 7.0], 1) == 0.0


def test_history_of_single_impacts_gives_the_force_of_their_peaks():
    """With one impact a cycle, counting impacts and counting peaks agree."""
    peaks = np.array([40.0, 65.0, 52.0, 58.0])
    history = np.zeros(40)
    history[5::10] = peaks
    assert equivalent_force_of_history(history, 4) == pytest.approx(equivalent_force(peaks), rel=1e-12)


def test_the_shortest_history_is_one_impact():
    """Three samples of one cycle: its range is the force."""
    assert equivalent_force_of_history([0.0, 60.0, 0.0], 1) == pytest.approx(60.0)


def test_the_load_rating_for_a_life_is_the_rating_under_which_it_lasts():
    """Eq. 5.3 inverts eq. 5.2, for both exponents and on both sides of a million cycles."""
    for life in (0.2, 1.0, 40.0):
        for exponent in (3.0, 10.0 / 3.0):
            rating = required_load_rating(50.0, life, exponent)
            assert rating_life(50.0, rating, exponent) == pytest.approx(life)
    assert required_load_rating(50.0, 8.0, 3.0) == pytest.approx(100.0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: rating_life(10.0, -5.0), "load_rating = -5 N is out of range"),
        (lambda: equivalent_force([]), "0 cycles"),
        (lambda: equivalent_force([10.0, -1.0]), "-1 N in cycle 2"),
        (lambda: equivalent_force([10.0, 20.0], probabilities=[0.5, 0.6]), "add up to 1.1"),
        (lambda: required_load_rating(10.0, 0.0), "life = 0 million cycles is out of range"),
        (lambda: required_load_rating(10.0, 1.0, 0.0), "exponent = 0 is out of range"),
        (lambda: rating_life(10.0, 5.0, 0.0), "exponent = 0 is out of range"),
        (lambda: rating_life(10.0, math.inf), "load_rating = inf N"),
        (lambda: equivalent_force([10.0], -1.0), "exponent = -1 is out of range"),
        (lambda: equivalent_force([10.0, 20.0], probabilities=[1.2, -0.2]), "allowed: 0 or more"),
        (lambda: equivalent_force([10.0, 20.0], probabilities=[1.0]), "one a force"),
        (lambda: rainflow_cycles([0.0, 1.0]), r"shape \(2,\)"),
        (lambda: rainflow_cycles([0.0, math.nan, 1.0]), "finite"),
        (lambda: rainflow_cycles([[0.0], [1.0], [0.0]]), r"shape \(3, 1\)"),
        (lambda: equivalent_force_of_history([0.0, 1.0, 0.0], 0), "cycles = 0"),
    ],
)
def test_impossible_requests_name_what_is_wrong(call, message):
    """Errors name the value and what is allowed."""
    with pytest.raises(DesignError, match=message):
        call()
