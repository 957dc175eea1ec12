"""Random scatter of a sensor against what a machine does: how well do earlier readings predict what is left?"""

import numpy as np
import pytest
from scipy.spatial import KDTree

from chaosgym.series.noise import predictability, quantum
from tests.series.maps import logistic


def by_tree(values, residual):
    """The same figure by SciPy's tree of neighbours in the maximum norm."""
    found = []
    for delays in (1, 2, 3, 4):
        vectors = np.column_stack([values[k : len(values) - delays + k] for k in range(delays)])
        following = residual[delays:]
        nearest = KDTree(vectors).query(vectors, k=4, p=np.inf)[1][:, 1:]
        told = following[nearest].mean(axis=1)
        found.append(np.corrcoef(told, following)[0, 1] * np.sqrt(len(following)))
    return max(found)


@pytest.mark.parametrize("size", [40, 300])
def test_nearest_delay_vectors_forecast_as_by_a_tree(size):
    """Three neighbours of one to four readings, by another search."""
    values = np.random.default_rng(1).normal(size=size)
    residual = values - values.mean()
    assert predictability(values, residual) == pytest.approx(by_tree(values, residual), rel=1e-9)


def test_a_map_predicts_itself_and_a_random_error_does_not():
    """The logistic map stands 15 deviations out or more; random numbers stay within four."""
    chaos, random = logistic(3.99, 400), np.random.default_rng(2).normal(size=400)
    assert predictability(chaos, chaos - chaos.mean()) > 15.0
    assert abs(predictability(random, random)) < 4.0


def test_the_step_of_a_converter_is_that_of_readings_which_came_again():
    """Half a newton came twice among whole ones: the step is half a newton; a reading that came once is none."""
    whole = np.repeat(np.arange(4.0), 10)
    assert quantum(whole) == 1.0
    assert quantum(np.append(whole, [0.5, 0.5])) == 0.5
    assert quantum(np.append(whole, 0.3)) == 1.0
    assert quantum(np.random.default_rng(0).normal(size=50)) == 0.0
