"""Fourier series through equidistant angles: derivatives, and values between."""

import numpy as np
import pytest

from chaosgym.machines.mechanism.sums import between, derivatives


@pytest.mark.parametrize("count", [61, 62])
def test_a_series_has_the_derivatives_and_the_values_between_of_its_function(count):
    """1 / (5/4 - cos x), whose terms halve one by one: 30 of them leave 1e-9, odd or even in number, in two columns."""
    x, at = 2.0 * np.pi * np.arange(count) / count, np.array([0.1, 3.0, -2.0, 40.0])

    def function(x):
        return np.stack([1.0 / (1.25 - np.cos(x)), np.sin(3.0 * x)], axis=1)

    first, second = derivatives(function(x))
    pole, slope = 1.25 - np.cos(x), np.sin(x)
    np.testing.assert_allclose(first[:, 0], -slope / pole**2, rtol=0.0, atol=2e-7)
    np.testing.assert_allclose(second[:, 0], 2.0 * slope**2 / pole**3 - np.cos(x) / pole**2, rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(second[:, 1], -9.0 * np.sin(3.0 * x), rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(between(function(x), at), function(at), rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(between(function(x), x), function(x), rtol=0.0, atol=1e-14)
