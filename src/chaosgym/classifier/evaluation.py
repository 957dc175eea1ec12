"""Scores on machines that a classifier has not seen: shares with bootstrap intervals over machines."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.classifier.calibration import calibration_error
from chaosgym.classifier.data import Examples
from chaosgym.classifier.estimator import ResponseClassifier
from chaosgym.classifier.features import least_scatter
from chaosgym.classifier.machine_classifier import IRREGULAR, NATURE
from chaosgym.series.stroboscopic import irregularity

RESAMPLES = 1000
LEVEL = 0.95
SENSOR = 3.0
"""Largest error of a peak [N] of the sensor whose records are judged (thesis 3.6)."""

NEAR = 1.5
"""Factor between true amplitude and the sensor's error within which a record hardly decides."""

LENGTHS = (8, 16, 32, 64)
"""Cycles of the records that are judged."""


class ScoreInterval(NamedTuple):
    """A figure and its 95 % bootstrap interval."""

    value: float
    low: float
    high: float


def bootstrap_scores(truth: NDArray[Any], guess: NDArray[Any], groups: NDArray[Any]) -> dict[str, Any]:
    """Accuracy and balanced accuracy (n,) with intervals from drawing whole machines (groups) with replacement."""
    kinds, kind = np.unique(truth, return_inverse=True)
    parts, part = np.unique(groups, return_inverse=True)
    right = np.zeros((len(parts), len(kinds)))
    total = np.zeros_like(right)
    np.add.at(right, (part, kind), guess == truth)
    np.add.at(total, (part, kind), 1.0)
    weights = np.random.default_rng(0).multinomial(len(parts), np.full(len(parts), 1.0 / len(parts)), RESAMPLES)
    drawn = np.concatenate([np.ones((1, len(parts))), weights])
    rights, totals = drawn @ right, drawn @ total
    accuracy = rights.sum(axis=1) / totals.sum(axis=1)
    with np.errstate(invalid="ignore"):
        balanced = np.nanmean(np.where(totals > 0.0, rights / totals, np.nan), axis=1)
    return {"accuracy": _estimate(accuracy), "balanced_accuracy": _estimate(balanced)}


def _estimate(values: Array) -> ScoreInterval:
    low, high = np.quantile(values[1:], [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])
    return ScoreInterval(float(values[0]), float(low), float(high))


def probability_scores(
    classes: NDArray[Any], chances: Array, truth: NDArray[Any], groups: NDArray[Any]
) -> dict[str, Any]:
    """Scores of probabilities (n, classes): both accuracies, calibration error, share of the majority."""
    guess = classes[chances.argmax(axis=1)]
    return {
        **bootstrap_scores(truth, guess, groups),
        "calibration_error": calibration_error(chances.max(axis=1), guess == truth),
        "majority": float(max(np.mean(truth == kind) for kind in classes)),
    }


def score_stages(stages: Mapping[int, ResponseClassifier], examples: Examples) -> dict[str, Any]:
    """Scores of natures on the held-out rows, by stage."""
    found = {}
    for cycles, model in stages.items():
        rows = examples.test & (examples.has_signals if cycles else True)
        more = {"cycles": examples.start[rows, :cycles]} if cycles else {}
        chances = model.predict_proba(examples.values[rows], **more)
        name = f"{cycles} cycles" if cycles else "parameters"
        truth, groups = examples.nature[rows], examples.groups[rows]
        found[name] = {
            **probability_scores(model.classes_, chances, truth, groups),
            "coverage": {
                str(kind): float(np.mean(chances[truth == kind, place] >= model.plausible_[place]))
                for place, kind in enumerate(model.classes_)
                if np.any(truth == kind)
            },
        }
    return found


def score_records(models: Mapping[str, ResponseClassifier], examples: Examples, seed: int) -> dict[str, Any]:
    """Scores of both questions on settled held-out records of a 3 N sensor, by length, beside the plain rule.

    The rule: irregular, or chaotic, if ``least_scatter`` exceeds the sensor's error. ``irregular_away`` is the accuracy
    where the true amplitude is more than a factor ``NEAR`` from that error, and ``near`` the share where it is not.
    """
    rows = np.flatnonzero(examples.test & examples.has_signals & (examples.settled.max(axis=1) > 0.0))
    generator = np.random.default_rng(seed + 1)
    clean, groups = examples.settled[rows], examples.groups[rows]
    amplitude = np.array([irregularity(peaks) for peaks in clean])
    truth = {NATURE: examples.nature[rows], IRREGULAR: amplitude > SENSOR}
    away = (amplitude < SENSOR / NEAR) | (amplitude > SENSOR * NEAR)
    error = np.full(len(rows), SENSOR)
    found = {}
    for cycles in LENGTHS:
        peaks = clean[:, :cycles] + SENSOR * generator.uniform(-1.0, 1.0, (len(rows), cycles))
        peaks = np.maximum(peaks, 0.0)
        rule = np.array([least_scatter(record) for record in peaks]) > SENSOR
        chances = {name: models[name].predict_proba(peaks, sensor_error=error) for name in truth}
        scores = {
            name: probability_scores(models[name].classes_, chances[name], label, groups)
            for name, label in truth.items()
        }
        right = models[IRREGULAR].classes_[chances[IRREGULAR].argmax(axis=1)] == truth[IRREGULAR]
        found[f"{cycles} peaks, {SENSOR:g} N sensor"] = {
            "irregular": scores[IRREGULAR],
            "irregular_rule": float(np.mean(rule == truth[IRREGULAR])),
            "irregular_away": float(right[away].mean()),
            "near": float(1.0 - away.mean()),
            "nature": scores[NATURE],
            "nature_rule": float(np.mean(rule == (truth[NATURE] == "chaotic"))),
        }
    return found
