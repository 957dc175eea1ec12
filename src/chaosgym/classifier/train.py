"""How is the classifier of a machine trained, and is it any better than simple rules?

Everything is judged on machines (or blocks of a plane) that no training has seen. The learning curve repeats the
training on a half, a quarter and an eighth of the machines.
"""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks.classifier.ceiling import ceilings
from benchmarks.classifier.compare import SCENES, compare_parameters, compare_scene, outside_parameters, refusals
from benchmarks.classifier.latency import measure_speed
from chaosgym.classifier.data import Examples, examples_of, thinned
from chaosgym.classifier.estimator import ResponseClassifier
from chaosgym.classifier.evaluation import probability_scores
from chaosgym.classifier.records import training_records
from chaosgym.classifier.report import card_lines
from chaosgym.classifier.scorers import Trees, pair_scores, train_scorers
from chaosgym.classifier.shipped import MachineClassifier
from chaosgym.files import write_atomically
from chaosgym.machines.parameters import parameters_of
from chaosgym.sweeps import LabelledSweep
from chaosgym.version import __version__

PUPIL, PUPIL_SHARE = 60_000, 3
"""Made-up machines from which the network that answers about parameters learns, and at most for each training row."""

CURVE = (0.125, 0.25, 0.5)
"""Shares of the training machines of the learning curve, before all of them."""

LEAST_ROWS = 60
"""In a leaf of a tree."""

ROUNDS = 100
"""Of the boosting."""

RECORDS, COPIES = 30_000, 6
"""Noisy training records made of the signals, about, and copies of a run at most."""


TIMED = ("training_seconds", "speed")
"""Parts of the report that differ from run to run; the card, and with it the model file, has none of them."""


@dataclass(frozen=True)
class TrainingResult:
    """Trained classifier, the report on held-out rows, and the examples that both come from."""

    classifier: MachineClassifier
    report: dict[str, Any]
    examples: Examples

    def save(self, folder: str | Path) -> None:
        """Write ``classifier.npz``, ``report.json`` and ``CARD.md`` into a folder."""
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        self.classifier.save(target / "classifier.npz")
        text = json.dumps(self.report, indent=1)
        write_atomically(target / "report.json", lambda temporary: temporary.write_text(text + "\n"))
        card = "\n".join(card_lines(self.classifier.card)) + "\n"
        write_atomically(target / "CARD.md", lambda temporary: temporary.write_text(card))


def train_classifier(
    sweep: LabelledSweep,
    seed: int = 0,
    *,
    model: str | None = None,
    curve: bool = True,
    transfer: LabelledSweep | None = None,
    noise: Mapping[str, Any] | None = None,
    progress: bool = False,
) -> TrainingResult:
    """Train on a labelled sweep and judge beside baselines.

    Parameters
    ----------
    sweep
        Labelled points; with signals, records are learned too.
    seed
        Of split, noise, weights and baselines. Same seed, same weights.
    model
        As of ``ResponseClassifier``, for parameters; by default the best on the machines that calibrate. Records are
        always judged by boosting.
    curve
        Measure the learning curve too.
    transfer
        Sweep of another machine. The record classifier is tried on its held-out records; then records of both are
        learned, and that classifier is kept if it is less surprised by the calibrating machines of ``sweep``.
    noise
        What ``label_noise`` found for the sweep, for the ceiling of any classifier.
    progress
        Show a progress bar on standard error.

    Raises
    ------
    DatasetError
        If there are too few rows or only one response type.
    """
    examples, sparse = examples_of(sweep, seed), examples_of(thinned(sweep, seed), seed)
    other = examples_of(transfer, seed) if transfer and examples.signals else None
    steps = 4 + (3 + len(SCENES) if examples.signals else 0) + (1 + len(CURVE) if curve else 0) + (2 if other else 0)
    with tqdm(total=steps, desc="train classifier", unit="step", disable=not progress, mininterval=0.5) as bar:
        began = time.perf_counter()
        parameters = fit_parameters(sparse, ~sparse.test, model or "best", seed, tick=bar.update)
        own = fit_records([examples], seed, tick=bar.update) if examples.signals else None
        both = fit_records([examples, other], seed, tick=bar.update) if other else None
        records = both if own and both and both.log_loss_ < own.log_loss_ else own
        seconds = time.perf_counter() - began
        report = _rows(sparse) | {
            "training_seconds": round(seconds, 1),
            "model": parameters.model_,
            "log_loss": {**parameters.log_losses_, "its pupil": parameters.log_loss_},
        }
        report["ceiling"] = ceilings(sweep, noise)
        report["parameters"] = compare_parameters(sparse, parameters, seed)
        report["parameters"]["refused"] = outside_parameters(sparse, parameters, seed)
        bar.update()
        if records is not None:
            report["records"] = {}
            for scene in SCENES:
                report["records"][scene.name] = compare_scene(scene, examples, records, seed)
                bar.update()
            report["refused"] = refusals(examples, records, seed)
        if own and both and other:
            losses = {"own machine": own.log_loss_, "both machines": both.log_loss_}
            report["transfer"] = _transfer(other, own, seed) | {"log_loss": losses}
        if curve:
            report["learning_curve"] = _learning_curve(sparse, parameters, seed, bar.update)
    teachers = [examples, other] if other and records is both else [examples]
    card = _card(sweep, teachers, sparse, report, seed)
    classifier = MachineClassifier(examples.machine, parameters, records, card)
    report["speed"] = measure_speed(classifier, seed)
    return TrainingResult(classifier, report, sparse)


def fit_parameters(
    examples: Examples,
    rows: Any,
    model: str,
    seed: int,
    *,
    tick: Callable[[], object] = lambda: None,
) -> ResponseClassifier:
    """Train from parameters on some rows (n,), those that calibrate included."""
    peaks = np.full(len(examples.values), np.nan)
    if examples.signals:
        settled, _, at = examples.signals["settled"]
        peaks[at] = settled[np.arange(len(at)), np.random.default_rng(seed).integers(0, settled.shape[1], len(at))]
    pupil = min(PUPIL, PUPIL_SHARE * int((rows & examples.training).sum()))
    classifier = ResponseClassifier(
        "parameters", model, pupil, examples.machine, examples.fields, rounds=ROUNDS, least_rows=LEAST_ROWS, seed=seed
    )
    return classifier.fit(
        examples.values[rows],
        examples.response_type[rows],
        nature=examples.nature[rows],
        period=examples.period[rows],
        peak_force=peaks[rows] if np.isfinite(peaks[rows]).any() else None,
        groups=examples.groups[rows],
        calibration=examples.calibration[rows],
        ranges=examples.ranges,
        tick=tick,
    )


def fit_records(
    machines: Sequence[Examples], seed: int, tick: Callable[[], object] = lambda: None
) -> ResponseClassifier:
    """Train on noisy records of the rows that train and calibrate; of machines after the first no row calibrates."""
    parts = [_record_columns(examples, seed) for examples in machines]
    columns: dict[str, Any] = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    whose = np.repeat(np.arange(len(parts)), [len(part["y"]) for part in parts])
    columns["groups"] += (columns["groups"].max() + 1) * whose
    columns["calibration"] &= whose == 0
    classifier = ResponseClassifier("records", "boosting", rounds=ROUNDS, least_rows=LEAST_ROWS, seed=seed)
    return classifier.fit(columns.pop("X"), columns.pop("y"), **columns, tick=tick)


def _record_columns(examples: Examples, seed: int) -> dict[str, Any]:
    """What ``ResponseClassifier.fit`` takes of the noisy records of one machine."""
    signals = examples.signals_where(~examples.test)
    runs = max(1, sum(len(peaks) for peaks, _, _ in signals.values()))
    noisy = training_records(signals, min(COPIES, max(1, round(RECORDS / runs))), seed)
    settled, _, at = examples.signals["settled"]
    where = np.full(len(examples.values), -1)
    where[at] = np.arange(len(at))
    cycle = np.random.default_rng(seed + 1).integers(0, settled.shape[1], len(noisy.rows))
    return {
        "X": noisy.peaks,
        "y": examples.response_type[noisy.rows],
        "nature": examples.nature[noisy.rows],
        "peak_force": settled[where[noisy.rows], cycle],
        "groups": examples.groups[noisy.rows],
        "calibration": examples.calibration[noisy.rows],
        "section": noisy.section,
        "sensor_error": noisy.sensor_error,
    }


def _learning_curve(
    examples: Examples, classifier: ResponseClassifier, seed: int, tick: Callable[[], object]
) -> list[dict[str, Any]]:
    """Accuracy on the held-out rows by share of the training machines, of the model without its pupil.

    Shares that do not hold every pair of type and nature are left out.
    """
    machines = np.random.default_rng(seed).permutation(np.unique(examples.groups[examples.training]))
    trees = Trees(*(getattr(classifier, name) for name in Trees._fields))
    features, pair = (
        classifier.features(examples.values),
        classifier.pairs_.numbers(examples.response_type, examples.nature),
    )
    points = []
    for share in (*CURVE, 1.0):
        drawn = machines[: max(1, round(share * len(machines)))]
        rows = np.isin(examples.groups, drawn)
        if len(np.unique(pair[rows])) < len(classifier.pairs_.type_of):
            continue
        scorers = classifier.teachers_
        if share < 1.0:
            (scorers,) = train_scorers(classifier.model_, trees, features[rows], pair[rows], seed).values()
        chances = classifier.pairs_.chances(pair_scores(scorers, features[examples.test]))
        points.append({"machines": len(drawn), "rows": int(rows.sum()), **_accuracies(examples, classifier, chances)})
        tick()
    return points


def _accuracies(examples: Examples, classifier: ResponseClassifier, chances: NDArray[np.float64]) -> dict[str, Any]:
    """Scores of probabilities of pairs on the held-out rows, for types and natures."""
    test, pairs = examples.test, classifier.pairs_
    told = {
        "response_type": (pairs.types, pairs.types_from(chances), examples.response_type),
        "nature": (pairs.natures, pairs.natures_from(chances), examples.nature),
    }
    return {
        name: probability_scores(kinds, shares, truth[test], examples.groups[test])
        for name, (kinds, shares, truth) in told.items()
    }


def _transfer(other: Examples, records: ResponseClassifier, seed: int) -> dict[str, Any]:
    """Scores of the record classifier on another machine's held-out records."""
    found = {scene.name: compare_scene(scene, other, records, seed, baselines=False) for scene in SCENES[:3]}
    return {"machine": other.machine.name, "scenes": found}


def _rows(examples: Examples) -> dict[str, Any]:
    parts = {"training": examples.training, "calibration": examples.calibration, "held_out": examples.test}
    return {
        "rows": {**{name: int(rows.sum()) for name, rows in parts.items()}, "left_out": examples.left_out},
        "machines": {name: len(np.unique(examples.groups[rows])) for name, rows in parts.items()},
        "share_of_types": {name: float((examples.response_type == name).mean()) for name in ("I", "II", "III")},
        "share_of_natures": {str(name): float((examples.nature == name).mean()) for name in np.unique(examples.nature)},
    }


def _card(
    sweep: LabelledSweep, teachers: Sequence[Examples], sparse: Examples, report: dict[str, Any], seed: int
) -> dict[str, Any]:
    kept = ("sampling", "size", "seed", "budget", "signals", "transient", "cycles", "axes", "patches", "type_reach")
    examples = teachers[0]
    return {
        "machine": examples.machine.name,
        "base": {name: getattr(examples.machine, name) for name in parameters_of(examples.machine)},
        "fields": list(examples.fields),
        "ranges": {
            name: [float(low), float(high)] for name, low, high in zip(examples.fields, *examples.ranges, strict=True)
        },
        "data": {key: sweep.settings[key] for key in kept if key in sweep.settings},
        "rows": {
            "parameters": int(sparse.training.sum()),
            "records": sum(len(part[0]) for of in teachers for part in of.signals_where(of.training).values()),
        },
        "records_of": [of.machine.name for of in teachers],
        "seed": seed,
        "version": __version__,
        "command": f"chaosgym train-classifier --data FOLDER --out FOLDER --seed {seed}",
        "limits": (
            "knows machines that differ from the base in the named fields, within their ranges; the nature is that of "
            "the diagnosis within its budget, the type that of the neighbours in speed and clearance from one initial "
            "state; transient chaos counts as chaotic although a settled record of it is periodic; chaos weaker than "
            "the sensor's noise looks periodic"
        ),
        "report": {name: value for name, value in report.items() if name not in TIMED},
    }
