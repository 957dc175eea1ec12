import numpy as np
import pytest

from chaosgym.series import power_spectrum, zero_one_statistic
from tests.series.maps import GOLDEN, circle, henon, logistic


@pytest.mark.parametrize("series", [logistic(4.0, 1000), logistic(3.5748, 1000), henon(1000)[:, 0]])
def test_chaos_wanders(series):
    """K is near 1 for chaos, in one band or in eight."""
    assert zero_one_statistic(series) > 0.95


@pytest.mark.parametrize("series", [logistic(3.55, 1000), circle(0.3, GOLDEN, 1000), circle(0.9, 0.6069, 1000)])
def test_regular_motion_stays_bounded(series):
    """K is near 0 for a period and for tori."""
    assert abs(zero_one_statistic(series)) < 0.1


def test_without_band_means_removed_banded_chaos_is_missed():
    """The known failure of the plain test, which removing the means of the bands cures."""
    series = logistic(3.5748, 500)
    assert zero_one_statistic(series, remove_bands=False) < 0.5 < zero_one_statistic(series)


def test_power_sums_to_the_variance():
    """Parseval: the power of white noise sums to its variance, and half of it lies below a quarter of the rate."""
    noise = np.random.default_rng(3).normal(size=4000)
    spectrum = power_spectrum(noise)
    assert spectrum.power.sum() == pytest.approx(1.0, rel=0.1)
    assert spectrum.power[spectrum.frequency < 0.25].sum() == pytest.approx(0.5, rel=0.1)
    assert spectrum.floor == pytest.approx(np.log(2.0), rel=0.15)


def test_a_line_stands_where_it_belongs():
    """A sine of 0.18 oscillations a cycle gives one line there and an empty floor."""
    spectrum = power_spectrum(np.cos(2.0 * np.pi * 0.18 * np.arange(1000)))
    assert spectrum.frequency[np.argmax(spectrum.power)] == pytest.approx(0.18, abs=1e-3)
    assert spectrum.lines == 1
    assert spectrum.floor < 1e-8
