import numpy as np
import pytest

from chaosgym.series import section_shape, two_step_test
from tests.diagnosis.oscillators import iterate
from tests.series.maps import GOLDEN, circle, henon, logistic


def delayed(rate):
    """The delayed logistic map (Aronson et al., 1982): a closed curve beyond its bifurcation at 2, chaos at 2.27."""
    return lambda x: np.array([x[1], rate * x[1] * (1.0 - x[0])])


@pytest.mark.parametrize("nonlinearity", [0.0, 0.5, 0.95])
def test_a_circle_map_below_criticality_moves_on_a_closed_curve(nonlinearity):
    """Its orbit fills the circle densely, evenly or not."""
    assert section_shape(circle(nonlinearity, GOLDEN, 500)) == "closed curve"


def test_the_delayed_logistic_map_changes_from_a_curve_to_a_folded_set():
    """A published route: closed curve at 2.1, strange attractor at 2.27."""
    assert section_shape(iterate(delayed(2.1), [0.3, 0.3], 1000, skip=2000)) == "closed curve"
    assert section_shape(iterate(delayed(2.27), [0.3, 0.3], 1000, skip=200)) == "set with structure"


@pytest.mark.parametrize("points", [henon(500), logistic(4.0, 500)])
def test_a_strange_attractor_and_an_arc_are_no_closed_curves(points):
    """The Henon attractor has branches at its folds; the logistic parabola has two ends."""
    assert section_shape(points) == "set with structure"


def test_each_band_is_looked_at_by_itself():
    """A motion that visits two curves in turn is one curve in every other sample."""
    n = np.arange(1000)
    assert section_shape(np.where(n % 2, 5.0, 0.0) + np.cos(0.7 * n), bands=2) == "closed curve"


def test_a_torus_of_three_frequencies_is_fuzzy():
    """Its section is a surface, which the thesis leaves to the spectrum (5.2.1)."""
    n = np.arange(600)
    assert section_shape(np.cos(n) + np.cos(np.sqrt(2.0) * n)) == "set with structure"


@pytest.mark.parametrize("points", [np.zeros(100), np.arange(40.0), np.empty(0)])
def test_few_points_or_a_single_one_show_nothing(points):
    """63 points of a band, or one point again and again, have no shape."""
    assert section_shape(points) == "too few points"


def test_the_section_has_a_say_in_step_two():
    """A torus is quasiperiodic on a closed curve; chaos is a set with structure."""
    assert two_step_test(circle(0.3, GOLDEN, 1000)).evidence["section"] == "closed curve"
    assert two_step_test(logistic(4.0, 1000)).evidence["section"] == "set with structure"
    assert two_step_test(logistic(4.0, 1000), sensor_error=0.01).evidence["section"] is None
