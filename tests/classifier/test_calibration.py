"""Probabilities mean what they say: ranks, temperatures and gaps that can be checked by hand."""

import numpy as np
import pytest

from chaosgym.classifier.calibration import best_temperature, calibration_error, conformal_thresholds, softmax


@pytest.mark.parametrize(("coverage", "rank"), [(0.9, 1), (0.8, 2), (0.5, 5), (0.95, 0)])
def test_the_rank_of_a_conformal_threshold_is_exact(coverage, rank):
    """Of nine true chances the floor((1 - coverage) 10)-th smallest; without one, every class is plausible."""
    chances = np.array([0.11, 0.32, 0.23, 0.44, 0.55, 0.97, 0.66, 0.88, 0.79])
    table, labels = np.column_stack([1.0 - chances, chances]), np.ones(9, dtype=np.int64)
    expected = np.sort(chances)[rank - 1] if rank else 0.0
    np.testing.assert_array_equal(conformal_thresholds(table, labels, coverage), [0.0, expected])


def test_softmax_of_large_scores_is_finite():
    """Only differences of scores count."""
    scores = np.array([[1000.0, 1000.0 + np.log(3.0)], [-1000.0, -1000.0]])
    np.testing.assert_allclose(softmax(scores), [[0.25, 0.75], [0.5, 0.5]], rtol=1e-12)


def test_calibration_error_is_the_mean_gap_over_bins_of_equal_mass():
    """Two bins of two: 0.6 and 0.8 said, half and all right."""
    confidence, right = np.array([0.8, 0.6, 0.8, 0.6]), np.array([True, False, True, True])
    assert calibration_error(confidence, right, bins=2) == pytest.approx(0.5 * (0.1 + 0.2))
    equal = calibration_error(np.tile([0.6, 0.7], 500), np.arange(1000) < 500, bins=4)
    assert equal == pytest.approx((0.4 + 0.6 + 0.3 + 0.7) / 4.0), "equal confidences keep their order on any computer"


@pytest.mark.parametrize(("label", "end"), [(0, -1.5), (1, 2.5)])
def test_a_temperature_stays_within_its_bounds(label, end):
    """Scores that are always right would be sharpened without end, those always wrong flattened, sure ones too."""
    scores = np.array([[1000.0, 0.0], [30.0, 0.0], [10.0, 0.0], [3.0, 0.0]])
    assert best_temperature(scores, np.full(4, label)) == pytest.approx(np.exp(end), rel=1e-3)


def test_temperature_and_conformal_sets_keep_their_promise():
    """Scores that were doubled are brought back, and sets at 90 % hold nine of ten rows of every class."""
    generator = np.random.default_rng(3)
    scores = 2.0 * generator.standard_normal((20_000, 3))
    chances = softmax(scores)
    labels = np.array([generator.choice(3, p=row) for row in chances])
    assert best_temperature(2.0 * scores, labels) == pytest.approx(2.0, rel=0.05)
    thresholds = conformal_thresholds(chances[:10_000], labels[:10_000], 0.9)
    for kind in range(3):
        later = chances[10_000:, kind][labels[10_000:] == kind]
        assert np.mean(later >= thresholds[kind]) == pytest.approx(0.9, abs=0.02)
    right = chances.argmax(axis=1) == labels
    assert calibration_error(chances.max(axis=1), right) < 0.01
    assert calibration_error(softmax(3.0 * scores).max(axis=1), right) > 0.1
