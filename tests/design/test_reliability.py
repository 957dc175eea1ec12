"""Reliability: the integral against the closed form, Hertz against his own mean pressure, intervals in practice."""

import itertools
import math

import numpy as np
import pytest
from scipy import stats

from chaosgym.design.reliability import (
    Strength,
    hertz_pressure,
    mean_interval,
    normal_reliability,
    reliability,
    safety_factor,
    time_blocks,
)
from chaosgym.errors import DesignError


@pytest.mark.parametrize("distance", [-1.0, 0.0, 1.5, 4.0])
def test_normal_stress_and_strength_have_the_closed_form(distance):
    """Eq. 5.9: the difference of two normal variables is normal."""
    closed = normal_reliability(10.0, 0.7, 10.0 + distance, 1.3)
    assert closed == pytest.approx(stats.norm.cdf(distance / math.hypot(0.7, 1.3)), abs=1e-15)


def test_recorded_stresses_converge_to_the_integral():
    """Quantiles of a normal stress, 20,000 of them, give the reliability of eq. 5.9 in four digits."""
    stresses = stats.norm(1.3e9, 0.05e9).ppf((np.arange(20_000) + 0.5) / 20_000)
    found = reliability(stresses, Strength(1.6e9, 0.1e9))
    assert found == pytest.approx(normal_reliability(1.3e9, 0.05e9, 1.6e9, 0.1e9), abs=1e-4)


def test_two_peaks_are_seen_by_the_integral_and_lost_by_the_normal_fit():
    """A tenth of the impacts at a stress that kills half the surfaces: R = 0.95; a normal fit says 0.97."""
    stresses = np.array([1.0] * 9 + [2.0])
    strength = Strength(2.0, 0.05)
    assert reliability(stresses, strength) == pytest.approx(0.95)
    assert normal_reliability(stresses.mean(), stresses.std(), *strength) > 0.99


def test_strength_without_scatter_is_the_classical_criterion():
    """With a single strength the reliability is the share of stresses below it."""
    assert reliability([1.0, 2.0, 3.0, 4.0], Strength(3.5, 0.0)) == 0.75
    assert reliability([3.0], Strength(3.0, 0.0)) == 0.0, "a stress that equals the strength is not below it"
    assert (safety_factor(2.0, 5.0, 1.25), safety_factor(2.0, 5.0)) == (2.0, 2.5)
    assert math.isinf(safety_factor(0.0, 5.0))
    assert [normal_reliability(stress, 0.0, 2.0, 0.0) for stress in (1.0, 2.0, 3.0)] == [1.0, 0.0, 0.0]
    assert normal_reliability(1.0, 0.0, 2.0, 0.5) == pytest.approx(stats.norm.cdf(2.0))


@pytest.mark.parametrize(("radius", "modulus"), [(0.0, 1e11), (-1e-3, 1e11), (8e-3, 0.0), (math.nan, 1e11)])
def test_a_ball_of_no_size_or_no_stiffness_is_refused(radius, modulus):
    """Radius and contact modulus must be positive."""
    with pytest.raises(DesignError, match="above 0"):
        hertz_pressure(60.0, radius, modulus)


def test_hertz_pressure_of_a_sphere_on_a_flat():
    """Mean pressure F / (pi a^2) with a^3 = 3 F R / (4 E*) is two thirds of the largest one (Johnson 4.2)."""
    force, radius, modulus = 60.0, 8e-3, 115.4e9
    contact = (3.0 * force * radius / (4.0 * modulus)) ** (1.0 / 3.0)
    assert hertz_pressure(force, radius, modulus) == pytest.approx(1.5 * force / (math.pi * contact**2), rel=1e-12)


def test_pressure_does_not_depend_on_units():
    """Newton and millimetre give megapascal, meganewton and millimetre terapascal: the same pressure."""
    pressure = hertz_pressure(60.0, 8e-3, 115e9)
    assert hertz_pressure(60.0, 8.0, 115e3) == pytest.approx(1e-6 * pressure, rel=1e-12)
    assert hertz_pressure(60e-6, 8.0, 0.115) == pytest.approx(1e-12 * pressure, rel=1e-12)


def test_interval_holds_the_mean_as_often_as_it_says():
    """Of 200 records of 400 independent values, 95 % intervals hold the true mean in about 190."""
    random = np.random.default_rng(5)
    intervals = [mean_interval(time_blocks(random.normal(3.0, 1.0, 400))) for _ in range(200)]
    hits = sum(low <= 3.0 <= high for low, high in intervals)
    assert 178 <= hits <= 199


def test_interval_widens_for_correlated_cycles():
    """Values that come in runs of ten say less than independent ones: the interval is about three times as wide."""
    random = np.random.default_rng(6)
    independent = random.normal(size=2000)
    in_runs = np.repeat(random.normal(size=200), 10)
    widths = [high - low for low, high in (mean_interval(time_blocks(x)) for x in (independent, in_runs))]
    assert 2.0 < widths[1] / widths[0] < 5.0


def test_interval_is_reproducible_and_degenerate_for_a_constant():
    """Same seed, same interval; a constant has no uncertainty."""
    values = np.random.default_rng(7).normal(size=100)
    assert mean_interval(time_blocks(values)) == mean_interval(time_blocks(values))
    assert mean_interval(time_blocks(values)) == mean_interval(time_blocks(values), seed=0)
    assert mean_interval(time_blocks(values)) != mean_interval(time_blocks(values), seed=1)
    assert mean_interval([np.array([2.0])]) == (2.0, 2.0)
    assert mean_interval([0.0, 1.0]) == (0.0, 1.0)


@pytest.mark.parametrize("confidence", [0.5, 0.95, 0.98])
def test_interval_ends_at_percentiles_of_all_ways_to_draw_the_blocks(confidence):
    """Of four blocks, one of them far off, 256 draws with replacement are possible, and all are known."""
    blocks = [0.0, 1.0, 2.0, 10.0]
    means = np.mean(list(itertools.product(blocks, repeat=4)), axis=1)
    expected = np.quantile(means, [(1.0 - confidence) / 2.0, (1.0 + confidence) / 2.0])
    assert mean_interval(blocks, confidence) == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize("confidence", [-0.1, 0.0, 1.0, 1.5, math.nan])
def test_certainty_has_no_interval(confidence):
    """A confidence lies between 0 and 1, without them."""
    with pytest.raises(DesignError, match=f"confidence = {confidence:g} is out of range"):
        mean_interval([0.0, 1.0], confidence)
