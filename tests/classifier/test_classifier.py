"""The classifier: training, honest held-out machines, calibration, refusal, safe files."""

import json

import numpy as np
import pytest

from benchmarks.classifier.plotting import save_pictures
from chaosgym.classifier import MachineClassifier, data, default_classifier
from chaosgym.classifier.data import examples_of
from chaosgym.classifier.train import train_classifier
from chaosgym.errors import DatasetError, ModelFileError, ParameterError
from chaosgym.machines import THESIS_IMPACT_BEAM, THESIS_SLIDER_CRANK, ImpactBeam
from chaosgym.sweeps import LabelledSweep
from tests.classifier.made_up import made_up_sweep, settled


def test_learns_a_known_border(trained):
    """On held-out machines of a plane with straight borders it is right at 19 points of 20, far above the majority."""
    scores = trained.report["parameters"]["response_type"]
    assert scores["classifier"]["accuracy"].value > 0.95
    assert scores["classifier"]["accuracy"].value > scores["majority"]["accuracy"].value + 0.2
    assert set(scores) >= {"majority", "logistic regression", "nearest neighbours", "gradient boosting"}
    low, high = scores["classifier"]["accuracy"][1:]
    assert low <= scores["classifier"]["accuracy"].value <= high


def test_recognises_records_it_has_not_seen(trained):
    """Fresh records of the logistic map: chaos at r = 3.95, period 2 at r = 3.22, period 1 at r = 2.63, through 1 %."""
    generator = np.random.default_rng(8)
    for rate, nature, period in ((3.95, "chaotic", None), (3.22, "periodic", 2), (2.63, "periodic", 1)):
        record = settled(rate, 40) * (1.0 + 0.01 * generator.standard_normal(40))
        answer = trained.classifier.classify_record(record, sensor_error=1.2)
        assert (answer.nature, answer.period) == (nature, period)
        assert not answer.abstained


def test_no_machine_trains_and_judges(trained):
    """Rows of a held-out machine never train: neighbours don't leak."""
    examples = trained.examples
    parts = [set(examples.groups[rows]) for rows in (examples.training, examples.calibration, examples.test)]
    assert all(parts)
    assert sum(map(len, parts)) == len(set.union(*parts))


def test_held_out_rows_of_a_plain_grid_are_whole_blocks(sweep):
    """A sweep without machines is split by rectangles of its plane, a quarter of them held out."""
    plain = LabelledSweep(sweep.table.drop_columns(["machine", "split"]), sweep.settings)
    examples = examples_of(plain, seed=1)
    assert 0.1 < examples.test.mean() < 0.4
    assert set(examples.groups[examples.test]).isdisjoint(examples.groups[~examples.test])


def test_a_large_lattice_is_thinned_but_for_its_judges(sweep, monkeypatch):
    """A third of the rows that train or calibrate is kept, every row that judges, and a small sweep as it is."""
    assert data.thinned(sweep, seed=1) is sweep
    monkeypatch.setattr(data, "LARGE", 100)
    before, after = (examples_of(one, seed=1) for one in (sweep, data.thinned(sweep, seed=1)))
    assert after.test.sum() == before.test.sum()
    assert 0.25 < (~after.test).sum() / (~before.test).sum() < 0.42


def test_same_seed_same_file(trained, sweep, tmp_path):
    """Training is reproducible bit for bit: two model files are equal."""
    for name, result in (("first", trained), ("second", train_classifier(sweep, seed=3))):
        result.save(tmp_path / name)
    first, second = ((tmp_path / name / "classifier.npz").read_bytes() for name in ("first", "second"))
    assert first == second


def test_probabilities_sum_to_one_even_without_an_answer(trained):
    """Probabilities of types and of natures each sum to 1; an abstention names no type and no nature, but a reason."""
    classifier = trained.classifier
    for frequency in (5.0, 29.0, 100.0):
        answer = classifier.classify(ImpactBeam(excitation_frequency=frequency, clearance=5e-5))
        assert sum(answer.probabilities.values()) == pytest.approx(1.0)
        assert sum(answer.nature_probabilities.values()) == pytest.approx(1.0)
        assert answer.abstained == (frequency == 100.0)
        assert (answer.response_type is None) == answer.abstained == (answer.nature is None)
    assert "excitation_frequency = 100 Hz is outside what the classifier was trained on" in answer.reason


def test_many_at_once_equal_one_by_one(trained):
    """The columns of a table say the same as single questions."""
    values = trained.examples.values[:25]
    table = trained.classifier.classify_table(values)
    for row, (frequency, clearance) in enumerate(values):
        answer = trained.classifier.classify(ImpactBeam(excitation_frequency=frequency, clearance=clearance))
        assert table["response_type"][row] == answer.response_type
        assert table["probability_III"][row] == pytest.approx(answer.probabilities["III"], abs=1e-5)


def test_predicted_forces_hold_most_peaks(trained):
    """Nine settled peaks of ten lie between the predicted quantiles, and the quantiles are in order."""
    examples, known = trained.examples, trained.classifier.parameters
    peaks, _, rows = examples.signals["settled"]
    test = examples.test[rows]
    values = examples.values[rows[test]]
    low, middle, high = known.predict_peak_force(known.features(values), values).T
    assert np.all((low <= middle) & (middle <= high))
    inside = (peaks[test] >= low[:, None]) & (peaks[test] <= high[:, None])
    assert 0.75 < inside.mean() <= 1.0


def test_refuses_faulty_records_and_keeps_sound_ones(trained):
    """Wrong units, spikes and growing records are refused nearly always, sound ones rarely."""
    refused = trained.report["refused"]
    assert refused["none"] < 0.1
    for fault in ("millinewton", "kilonewton", "spikes", "growing", "white noise"):
        assert refused[fault] > 0.9
    answer = trained.classifier.classify_record(1e6 * settled(3.9, 20))
    assert answer.abstained
    assert "wrong units suspected" in answer.reason


def test_refuses_machines_it_was_not_train_classifier(trained):
    """A parameter that training did not vary makes it abstain; another machine is an error."""
    answer = trained.classifier.classify(ImpactBeam(length=0.28, excitation_frequency=10.0, clearance=5e-5))
    assert answer.abstained
    assert "length = 0.28 differs" in answer.reason
    with pytest.raises(ParameterError, match="knows impact-beam, not slider-crank"):
        trained.classifier.classify(THESIS_SLIDER_CRANK)


def test_file_survives_a_round_trip_and_rejects_damage(trained, tmp_path):
    """Loaded it answers the same; a changed number, a changed card, another version or a stump are refused."""
    trained.save(tmp_path)
    path = tmp_path / "classifier.npz"
    loaded = MachineClassifier.load(path)
    assert loaded.classify(THESIS_IMPACT_BEAM) == trained.classifier.classify(THESIS_IMPACT_BEAM)
    assert loaded.classify_record(settled(3.9)) == trained.classifier.classify_record(settled(3.9))
    assert "Classifier of the impact-beam" in (tmp_path / "CARD.md").read_text()
    with np.load(path) as held:
        arrays = dict(held)
    name = "parameters.low_"
    np.savez(tmp_path / "changed.npz", **(arrays | {name: arrays[name] + 1e-9}))
    head = json.loads(arrays["head"].tobytes())
    for key, value in (("card", {**head["card"], "seed": 99}), ("format", 99)):
        text = json.dumps(head | {key: value}).encode()
        np.savez(tmp_path / f"{key}.npz", **(arrays | {"head": np.frombuffer(text, dtype=np.uint8)}))
    (tmp_path / "short.npz").write_bytes(path.read_bytes()[:200])
    for file, message in (
        ("changed", "does not match its hash"),
        ("card", "does not match its hash"),
        ("format", "format 99"),
        ("short", "can't be read"),
        ("missing", "can't be read"),
    ):
        with pytest.raises(ModelFileError, match=message):
            MachineClassifier.load(tmp_path / f"{file}.npz")


def test_pickled_content_is_never_loaded(tmp_path):
    """An array of objects, which would be unpickled, is refused."""
    np.savez(tmp_path / "evil.npz", head=np.array([{"a": 1}], dtype=object))
    with pytest.raises(ModelFileError, match="can't be read"):
        MachineClassifier.load(tmp_path / "evil.npz")


def test_training_needs_enough_rows_of_several_types(sweep):
    """Too few rows or a single type is an error that says what to do."""
    with pytest.raises(DatasetError, match="at least 50"):
        train_classifier(LabelledSweep(sweep.table.slice(0, 20), sweep.settings))
    single = made_up_sweep().table
    one = single.filter([kind == "III" for kind in single.column("response_type").to_pylist()])
    with pytest.raises(DatasetError, match="one response type only"):
        train_classifier(LabelledSweep(one, sweep.settings))


def test_pictures_are_drawn(trained, tmp_path):
    """Maps, abstentions, confusion, reliability and learning curve in one file."""
    assert save_pictures(trained, tmp_path).stat().st_size > 20_000


@pytest.mark.parametrize("machine", ["impact-beam", "slider-crank"])
def test_shipped_classifier_beats_its_majority_on_held_out_machines(machine):
    """The card of a shipped model says what it was trained on and that it is better than guessing."""
    classifier = default_classifier(machine)
    scores = classifier.card["report"]["parameters"]["response_type"]
    assert scores["classifier"]["balanced_accuracy"][0] > scores["majority"]["balanced_accuracy"][0] + 0.1
    assert classifier.records is not None
