"""The estimator follows scikit-learn, and its plain arrays equal what scikit-learn and torch computed."""

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.utils.estimator_checks import check_estimator

from chaosgym.classifier import ResponseClassifier, network
from chaosgym.classifier.calibration import best_temperature, calibration_error, conformal_threshold, softmax
from chaosgym.classifier.network import network_scores, train_network
from chaosgym.classifier.pairs import pairs_of
from chaosgym.classifier.scorers import pair_scores
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
    assert not hasattr(copy, "scorers_")
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


def test_network_learns_and_repeats(monkeypatch):
    """Two trainings with one seed agree bit for bit, and learn a circle."""
    monkeypatch.setattr(network, "MOST_UPDATES", 300)
    generator = np.random.default_rng(1)
    features = generator.uniform(-1.0, 1.0, (800, 2))
    labels = (np.hypot(*features.T) < 0.7).astype(int)
    first, second = (train_network(features[:600], np.eye(2)[labels[:600]], seed=2) for _ in range(2))
    scores = network_scores(first, features)
    np.testing.assert_array_equal(scores, network_scores(second, features))
    assert np.mean(scores[600:].argmax(axis=1) == labels[600:]) > 0.9


def test_type_and_nature_never_contradict_each_other():
    """A chaotic response is Type III, so Type III is at least as probable as chaos."""
    generator = np.random.default_rng(2)
    X = generator.standard_normal((500, 2))
    nature = np.where(X[:, 0] > 0.5, "chaotic", "periodic")
    y = np.where(nature == "chaotic", "III", np.where(X[:, 1] > 0.0, "I", np.where(X[:, 1] > -1.0, "II", "III")))
    model = ResponseClassifier(rounds=20).fit(X, y, nature=nature)
    types, natures = model.predict_proba(X), model.predict_nature_proba(X)
    np.testing.assert_allclose(types.sum(axis=1), 1.0)
    np.testing.assert_allclose(natures.sum(axis=1), 1.0)
    assert np.all(types[:, 2] >= natures[:, 0] - 1e-12)


def test_a_pupil_says_what_its_teachers_say():
    """One network that was asked about 3000 made-up rows agrees with boosting on 95 % of the rows."""
    X = np.random.default_rng(5).uniform(-1.0, 1.0, (800, 2))
    y = np.where(X[:, 0] > 0.3, "III", np.where(X[:, 1] > 0.0, "I", "II"))
    model = ResponseClassifier(rounds=20, pupil=3000).fit(X, y)
    taught = model.pairs_.types_from(model.pairs_.chances(pair_scores(model.teachers_, X)))
    assert np.mean(taught.argmax(axis=1) == model.predict_proba(X).argmax(axis=1)) > 0.95
    assert np.mean(model.predict(X) == y) > 0.95


def test_natures_and_types_are_calibrated_apart():
    """Scores that are three times too sure of the nature and twice of the type get these temperatures."""
    generator = np.random.default_rng(6)
    types, natures = np.array(["I", "II", "III", "III"]), np.array(["periodic"] * 3 + ["chaotic"])
    pairs, _ = pairs_of(types, natures)
    rows = 30_000
    nature, kind = generator.standard_normal((rows, 2)), generator.standard_normal((rows, 4))
    kind -= np.log([np.exp(kind[:, pairs.nature_of == n]).sum(axis=1) for n in pairs.nature_of]).T
    honest = softmax(nature[:, pairs.nature_of] + kind)
    drawn = (honest.cumsum(axis=1) > generator.random((rows, 1))).argmax(axis=1)
    sure = 2.0 * kind
    sure -= np.log([np.exp(sure[:, pairs.nature_of == n]).sum(axis=1) for n in pairs.nature_of]).T
    found = pairs.calibrated(3.0 * nature[:, pairs.nature_of] + sure, drawn)
    np.testing.assert_allclose(found.temperatures, [3.0, 2.0], rtol=0.08)
    np.testing.assert_allclose(found.chances(sure).sum(axis=1), 1.0)


def test_temperature_and_conformal_sets_keep_their_promise():
    """Scores that were doubled are brought back, and sets at 90 % hold the truth nine times of ten."""
    generator = np.random.default_rng(3)
    scores = 2.0 * generator.standard_normal((20_000, 3))
    chances = softmax(scores)
    labels = np.array([generator.choice(3, p=row) for row in chances])
    assert best_temperature(2.0 * scores, labels) == pytest.approx(2.0, rel=0.05)
    threshold = conformal_threshold(chances[:10_000], labels[:10_000], 0.9)
    later = chances[10_000:][np.arange(10_000), labels[10_000:]]
    assert np.mean(later >= threshold) == pytest.approx(0.9, abs=0.015)
    right = chances.argmax(axis=1) == labels
    assert calibration_error(chances.max(axis=1), right) < 0.01
    assert calibration_error(softmax(3.0 * scores).max(axis=1), right) > 0.1
