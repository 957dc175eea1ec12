"""The classifier: training, honest held-out blocks, safe files, refusal outside its training."""

import json

import numpy as np
import pyarrow as pa
import pytest

from chaosgym.classifier import ResponseClassifier, default_classifier
from chaosgym.classifier.train import held_out_blocks, train_classifier
from chaosgym.errors import DatasetError, ModelFileError, ParameterError
from chaosgym.machines import THESIS_IMPACT_BEAM, ImpactBeam
from chaosgym.machines.parameters import parameters_of
from chaosgym.sweeps import LabelledSweep


@pytest.fixture(scope="module")
def made_up_sweep():
    """A labelled plane with a straight border between each two types, so that the right answer is known."""
    speed, clearance = np.meshgrid(np.geomspace(4.0, 30.0, 40), np.geomspace(2e-5, 2e-4, 25), indexing="ij")
    speed, clearance = speed.ravel(), clearance.ravel()
    level = np.log(speed / 11.0) + 0.5 * np.log(clearance / 6e-5)
    types = np.where(level < -0.4, "I", np.where(level < 0.3, "II", "III"))
    table = pa.table({"excitation_frequency": speed, "clearance": clearance, "response_type": types})
    axes = [{"field": "excitation_frequency", "count": 40}, {"field": "clearance", "count": 25}]
    base = {name: getattr(THESIS_IMPACT_BEAM, name) for name in parameters_of(ImpactBeam)}
    settings = {"machine": "impact-beam", "base": base, "axes": axes, "sampling": "grid", "budget": 0}
    settings["type_reach"] = {"excitation_frequency": 1, "clearance": 1}
    return LabelledSweep(table, settings)


@pytest.fixture(scope="module")
def trained(made_up_sweep):
    """Trained once."""
    return train_classifier(made_up_sweep, seed=3)


def test_network_learns_a_known_border(trained):
    """On held-out blocks of a plane with straight borders it is right at 19 points of 20, far above the majority."""
    scores = trained.report["held_out"]
    assert scores["network"]["accuracy"] > 0.95
    assert scores["network"]["accuracy"] > scores["majority"]["accuracy"] + 0.2
    assert set(scores) >= {"network", "majority", "logistic regression", "nearest neighbours", "gradient boosting"}


def test_held_out_rows_are_whole_blocks():
    """No row of a block is in training if another one is held out: neighbours don't leak."""
    features = np.random.default_rng(0).random((5000, 2))
    test = held_out_blocks(features, seed=1)
    assert 0.1 < test.mean() < 0.4
    span = features.max(axis=0) - features.min(axis=0)
    block = np.minimum((12 * (features - features.min(axis=0)) / span).astype(int), 11) @ [12, 1]
    assert not set(block[test]) & set(block[~test])


def test_same_seed_same_weights(trained, made_up_sweep):
    """Training is reproducible bit for bit, and another seed gives another network."""
    again = train_classifier(made_up_sweep, seed=3)
    other = train_classifier(made_up_sweep, seed=4)
    for first, second in zip(trained.classifier.weights, again.classifier.weights, strict=True):
        np.testing.assert_array_equal(first, second)
    assert not np.array_equal(trained.classifier.weights[0], other.classifier.weights[0])


def test_file_survives_a_round_trip_and_rejects_damage(trained, tmp_path):
    """Saved and loaded it predicts the same; a changed weight, a foreign or a truncated file is refused."""
    path = tmp_path / "model.npz"
    trained.classifier.save(path)
    rows = np.array([[5.0, 3e-5], [12.0, 6e-5], [28.0, 1.8e-4]])
    loaded = ResponseClassifier.load(path)
    np.testing.assert_array_equal(loaded.predict_proba(rows), trained.classifier.predict_proba(rows))
    assert loaded.card["report"] == trained.report
    with np.load(path) as held:
        arrays = dict(held)
    arrays["weight0"] = arrays["weight0"] + 1e-9
    np.savez(tmp_path / "changed.npz", **arrays)
    with pytest.raises(ModelFileError, match="do not match their hash"):
        ResponseClassifier.load(tmp_path / "changed.npz")
    card = json.loads(arrays["card"].tobytes()) | {"format": 99}
    np.savez(tmp_path / "future.npz", **(arrays | {"card": np.frombuffer(json.dumps(card).encode(), dtype=np.uint8)}))
    with pytest.raises(ModelFileError, match="format 99"):
        ResponseClassifier.load(tmp_path / "future.npz")
    (tmp_path / "short.npz").write_bytes(path.read_bytes()[:200])
    with pytest.raises(ModelFileError, match="can't be read"):
        ResponseClassifier.load(tmp_path / "short.npz")


def test_pickled_content_is_never_loaded(tmp_path):
    """An array of objects, which would be unpickled, is refused."""
    np.savez(tmp_path / "evil.npz", card=np.array([{"a": 1}], dtype=object))
    with pytest.raises(ModelFileError, match="can't be read"):
        ResponseClassifier.load(tmp_path / "evil.npz")


def test_training_needs_enough_rows_of_several_types(made_up_sweep):
    """Too few rows or a single type is an error that says what to do."""
    few = LabelledSweep(made_up_sweep.table.slice(0, 20), made_up_sweep.settings)
    with pytest.raises(DatasetError, match="at least 50"):
        train_classifier(few)
    one = LabelledSweep(made_up_sweep.table.slice(0, 100), made_up_sweep.settings)
    with pytest.raises(DatasetError, match="one response type only"):
        train_classifier(one)


def test_shipped_classifier_beats_its_majority_on_held_out_blocks():
    """The card of the shipped model says what it was trained on and that it is better than guessing."""
    classifier = default_classifier("impact-beam")
    scores = classifier.card["report"]["held_out"]
    assert scores["network"]["balanced_accuracy"] > scores["majority"]["balanced_accuracy"] + 0.1
    assert classifier.classify(THESIS_IMPACT_BEAM).response_type == "III"


def test_refuses_machines_it_was_not_trained_on():
    """A parameter outside its range, or changed where training did not vary it, is an error and not a guess."""
    classifier = default_classifier("impact-beam")
    with pytest.raises(ParameterError, match=r"excitation_frequency = 100 Hz is outside"):
        classifier.classify(ImpactBeam(excitation_frequency=100.0))
    with pytest.raises(ParameterError, match=r"length = 0\.28 differs"):
        classifier.classify(ImpactBeam(length=0.28))
