"""The estimator refuses what it cannot judge, and its plain arrays equal what scikit-learn computed."""

import numpy as np
import pytest
from sklearn.ensemble import HistGradientBoostingClassifier

from chaosgym.classifier import ResponseClassifier
from chaosgym.classifier.calibration import softmax
from chaosgym.classifier.trees import class_scores, forest_of


def test_what_cannot_be_learned_or_judged_is_refused_by_name():
    """One class, rows without a class, a model without a fit, other columns and NaN are one line each."""
    points, labels = np.random.default_rng(0).random((60, 2)), np.repeat(["chaotic", "periodic"], 30)
    model = ResponseClassifier(rounds=2)
    with pytest.raises(ValueError, match="not fitted"):
        model.predict(points)
    with pytest.raises(ValueError, match="at least 2 classes"):
        model.fit(points, np.full(60, "chaotic"))
    with pytest.raises(ValueError, match="59 classes for 60 rows"):
        model.fit(points, labels[1:])
    with pytest.raises(ValueError, match="NaN"):
        model.fit(points * np.nan, labels)
    model.fit(points, labels)
    for bad, message in ((points[:, :1], "1 columns; allowed: 2"), (points * np.nan, "NaN"), (points[0], "2D")):
        with pytest.raises(ValueError, match=message):
            model.predict(bad)


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
