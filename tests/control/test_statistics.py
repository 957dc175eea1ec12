"""The statistics are those of the literature, on numbers that can be checked by hand."""

import numpy as np
import pytest

from chaosgym.control.statistics import bootstrap_interval, performance_profile


def test_the_bootstrap_interval_covers_the_mean_about_as_often_as_it_says():
    """Of 200 samples of 25 normal numbers, the interval of the mean holds the true one in 88 to 98 % of the cases."""
    generator = np.random.default_rng(1)
    hits = 0
    for _ in range(200):
        sample = generator.normal(size=25)
        low, high = bootstrap_interval(25, lambda places, sample=sample: sample[places].mean(axis=-1))
        hits += low < 0.0 < high
    assert 0.88 <= hits / 200 <= 0.98


def test_equal_values_have_an_interval_without_width_and_one_value_too():
    """Nothing varies, so nothing is uncertain; the same seed gives the same interval."""
    low, high = bootstrap_interval(1, lambda places: np.full(places.shape[:-1], 3.0))
    assert low == high == 3.0
    values = np.sqrt(np.arange(10.0))
    first, second = (bootstrap_interval(10, lambda places: values[places].mean(axis=-1)) for _ in range(2))
    assert np.array_equal(first, second)
    zero, one = (bootstrap_interval(10, lambda places: values[places].mean(axis=-1), seed) for seed in (0, 1))
    assert np.array_equal(first, zero)
    assert not np.array_equal(first, one)
    assert first[0] < values.mean() < first[1]


def test_the_interval_holds_the_middle_of_what_was_drawn():
    """Of 10,000 draws, each of 7 things with replacement, 2.5 % lie on either side; what is NaN is left out."""
    places, values = [], []

    def largest(drawn):
        places.append(drawn)
        values.append(np.where(drawn[:, 0] == 3, np.nan, drawn.max(axis=-1) + 0.1 * drawn.mean(axis=-1)))
        return values[-1]

    low, high = bootstrap_interval(7, largest)
    drawn, known = np.concatenate(places), np.concatenate(values)
    assert drawn.shape == (10_000, 7)
    assert np.bincount(drawn.ravel()) == pytest.approx([10_000] * 7, rel=0.05)
    known = known[~np.isnan(known)]
    assert (low, high) == tuple(np.percentile(known, [2.5, 97.5]))


def test_the_profile_falls_from_all_to_none():
    """A share of the scores reaches each threshold."""
    assert performance_profile([[0.0, 1.0], [2.0, 3.0]], [-1.0, 0.5, 2.0, 4.0]).tolist() == [1.0, 0.75, 0.5, 0.0]
