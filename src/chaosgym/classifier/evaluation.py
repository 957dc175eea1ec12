"""How good is a classifier on machines that it has not seen? Shares with bootstrap intervals over machines."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.classifier.calibration import calibration_error

Array = NDArray[np.float64]

RESAMPLES = 1000
LEVEL = 0.95
SURE_SHARE = 0.9
"""Share of the rows, the most confident ones, whose accuracy is given beside that of all."""


class Estimate(NamedTuple):
    """A figure and its 95 % bootstrap interval."""

    value: float
    low: float
    high: float


def bootstrap_scores(truth: NDArray[Any], guess: NDArray[Any], groups: NDArray[Any], seed: int = 0) -> dict[str, Any]:
    """Accuracy and balanced accuracy (n,) with intervals from drawing whole machines (groups) with replacement."""
    kinds, kind = np.unique(truth, return_inverse=True)
    parts, part = np.unique(groups, return_inverse=True)
    right = np.zeros((len(parts), len(kinds)))
    total = np.zeros_like(right)
    np.add.at(right, (part, kind), guess == truth)
    np.add.at(total, (part, kind), 1.0)
    weights = np.random.default_rng(seed).multinomial(len(parts), np.full(len(parts), 1.0 / len(parts)), RESAMPLES)
    drawn = np.concatenate([np.ones((1, len(parts))), weights])
    rights, totals = drawn @ right, drawn @ total
    accuracy = rights.sum(axis=1) / totals.sum(axis=1)
    with np.errstate(invalid="ignore"):
        balanced = np.nanmean(np.where(totals > 0.0, rights / totals, np.nan), axis=1)
    return {"accuracy": _estimate(accuracy), "balanced_accuracy": _estimate(balanced)}


def _estimate(values: Array) -> Estimate:
    low, high = np.quantile(values[1:], [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])
    return Estimate(float(values[0]), float(low), float(high))


def probability_scores(
    classes: NDArray[Any], chances: Array, truth: NDArray[Any], groups: NDArray[Any]
) -> dict[str, Any]:
    """Scores of probabilities (n, classes): both accuracies, calibration error, accuracy where most confident."""
    guess = classes[chances.argmax(axis=1)]
    confidence, right = chances.max(axis=1), guess == truth
    sure = np.argsort(-confidence, kind="stable")[: int(np.ceil(SURE_SHARE * len(truth)))]
    return {
        **bootstrap_scores(truth, guess, groups),
        "calibration_error": calibration_error(confidence, right),
        "accuracy_on_most_confident": float(right[sure].mean()),
    }


def confusion_matrix(truth: NDArray[Any], guess: NDArray[Any], classes: NDArray[Any]) -> list[list[int]]:
    """Number of rows of each true class (rows) by guess (columns)."""
    return [[int(np.sum((truth == true) & (guess == told))) for told in classes] for true in classes]
