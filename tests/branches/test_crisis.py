import numpy as np
import pytest
from scipy.optimize import brentq

from chaosgym.branches.crisis import boundary_crisis, covered, interior_crisis


def logistic(r, state, steps):
    """x <- r x (1 - x); whoever leaves [0, 1] rests at -1."""
    x, series = 0.3 if state is None else state, np.empty(steps)
    for i in range(steps):
        x = r * x * (1.0 - x) if 0.0 <= x <= 1.0 else -1.0
        series[i] = x
    return series, x


def image_of_the_maximum(r, steps):
    """Where the logistic map takes its maximum in some steps."""
    x = 0.5
    for _ in range(steps):
        x = r * x * (1.0 - x)
    return x


def test_the_window_of_period_3_ends_in_an_interior_crisis():
    """The three bands meet the unstable orbit of period 3 at r = 3.8568007, where the maximum falls on it in 4 steps.

    Grebogi, Ott and Yorke (1983); in x <- C - x^2 it is C = 1.790327.
    """
    exact = brentq(lambda r: image_of_the_maximum(r, 7) - image_of_the_maximum(r, 4), 3.8566, 3.8570, xtol=1e-12)
    assert 0.25 * exact**2 - 0.5 * exact == pytest.approx(1.790327, abs=1e-6)
    for first, second in ((3.8560, 3.8580), (3.8540, 3.8600), (3.8580, 3.8560)):
        found = interior_crisis(logistic, first, second)
        assert found is not None
        assert found.first < exact < found.second
        assert found.second - found.first < 1.01 * abs(second - first) / 64.0


@pytest.mark.parametrize(("low", "high"), [(3.67, 3.69), (3.59, 3.62), (3.70, 3.72), (3.88, 3.90), (3.852, 3.856)])
def test_bands_that_merge_and_sets_that_grow_are_no_crisis(low, high):
    """Two bands merge at 3.6786, four at 3.5926: they touch, so they cover as much before as after."""
    assert interior_crisis(logistic, low, high) is None


def test_two_bands_cover_less_than_their_range():
    """Bands [0, 1] and [9, 10] in turn cover 2."""
    random = np.random.default_rng(0)
    series = random.uniform(0.0, 1.0, 4000) + np.tile([0.0, 9.0], 2000)
    assert covered(series) == pytest.approx(2.0, abs=0.01)


def test_the_logistic_set_ends_in_a_boundary_crisis_at_4():
    """At r = 4 the set meets the fixed point 0; beyond, motions stay for a while and leave."""
    for chaotic, other in ((3.99, 4.011), (3.999, 4.0007)):
        found = boundary_crisis(logistic, chaotic, other)
        assert found is not None
        # the motion still lasts 4500 steps where one in many thousand leaves
        assert found.first < 4.0 + 1e-4 * (other - chaotic) + 1e-6
        assert found.second > 4.0
        assert found.second - found.first < 1.01 * (other - chaotic) / 256.0


@pytest.mark.parametrize(("chaotic", "other"), [(3.82, 3.84), (3.58, 3.55), (3.80, 3.835), (3.855, 3.845)])
def test_windows_and_reverse_doubling_are_no_boundary_crisis(chaotic, other):
    """Chaos that gives way to a periodic motion within its own range did not end at an unstable orbit."""
    assert boundary_crisis(logistic, chaotic, other) is None
