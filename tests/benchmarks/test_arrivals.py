"""Shares by steps since the demand changed."""

import numpy as np
import pytest

from benchmarks.envs.arrivals import lines, shares


def test_steps_are_counted_from_the_change_of_demand():
    """The first demand counts nowhere, a second change begins anew, and steps that were not done are left out."""
    demand = np.array([20.0] * 4 + [22.0] * 3 + [19.0] * 3)[:, None].repeat(2, axis=1)
    type_iii = np.ones(demand.shape)
    type_iii[[4, 7]], type_iii[[5, 8]], type_iii[[6, 9]] = 0.8, 0.4, 0.1
    type_iii[9, 1] = np.nan
    found = shares(demand, type_iii)
    assert found["0"] == pytest.approx(0.8)
    assert found["1"] == pytest.approx(0.4)
    assert found["2 to 4"] == pytest.approx(0.1)
    assert found["0 to 1"] == pytest.approx(0.6)
    assert lines({"one": found})[-1].startswith("| one | 0.80 | 0.40 | 0.10 |")
