"""The estimator follows scikit-learn, and its plain arrays equal what scikit-learn computed."""

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.utils.estimator_checks import check_estimator

from chaosgym.classifier import ResponseClassifier
from chaosgym.classifier.calibration import softmax
from chaosgym.classifier.trees import class_scores, forest_of


@pytest.mark.filterwarnings("ignore")
def test_follows_the_conventions_of_scikit_learn():
    """Every check of scikit-learn passes; some fit warnings of its own making are beside the point."""
    results = check_estimator(ResponseClassifier(rounds=10), on_skip=None)
    assert {result["status"] for result in results} <= {"passed", "skipped"}


def test_clone_keeps_the_settings():
    """A clone has the same parameters and no fit; an unknown parameter is named."""
    original = ResponseClassifier(inputs="records", rounds=7, seed=5)
    copy = clone(original)
    assert copy.get_params() == original.get_params()
    assert not hasattr(copy, "forest_")
    with pytest.raises(ValueError, match="'colour' is no parameter"):
        original.set_params(colour=3)


@pytest.mark.parametrize("classes", [2, 3])
def test_plain_trees_equal_scikit_learn(classes):
    """Scores of the exported arrays equal those of scikit-learn, missing values included."""
    generator = np.random.default_rng(0)
    features = generator.standard_normal((600, 5))
    labels = (np.abs(features[:, 0]) + features[:, 1] > 0.5).astype(int) + (classes - 2) * (features[:, 2] > 1.0)
    features[generator.random(features.shape) < 0.1] = np.nan
    model = HistGradientBoostingClassifier(max_iter=20).fit(features, labels)
    chances = softmax(class_scores(forest_of(model), features))
    np.testing.assert_allclose(chances, model.predict_proba(features), atol=1e-12)
