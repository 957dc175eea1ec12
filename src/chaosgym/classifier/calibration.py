"""Calibration: temperature scaling, conformal sets of plausible classes, and the calibration error that remains.

Temperature scaling: C. Guo et al., On calibration of modern neural networks, ICML 2017. Class-conditional split
conformal sets: M. Sadinle et al., J. Am. Stat. Assoc. 114 (2019).
"""

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array

Labels = NDArray[np.int64]

BINS = 15
"""Bins of equal mass for the expected calibration error."""


def softmax(scores: Array) -> Array:
    """Probabilities (n, classes) of scores (n, classes)."""
    powers = np.exp(scores - scores.max(axis=1, keepdims=True))
    powers /= powers.sum(axis=1, keepdims=True)
    return np.asarray(powers)


def best_temperature(scores: Array, labels: Labels) -> float:
    """Divisor of the scores (n, classes) under which the class numbers (n,) are most likely."""
    from scipy.optimize import minimize_scalar

    def surprise(logarithm: float) -> float:
        chances = softmax(scores / np.exp(logarithm))[np.arange(len(labels)), labels]
        return float(-np.mean(np.log(chances.clip(1e-12))))

    return float(np.exp(minimize_scalar(surprise, bounds=(-1.5, 2.5)).x))


def conformal_thresholds(chances: Array, labels: Labels, coverage: float) -> Array:
    """Probability of each class (classes,) from which on it is plausible: true classes are, with a given coverage."""
    found = np.zeros(chances.shape[1])
    for kind in range(len(found)):
        truth = np.sort(chances[labels == kind, kind])
        rank = int(np.floor((1.0 - coverage) * (len(truth) + 1) + 1e-9)) - 1  # 0.9 of ten leaves one, in floats less
        found[kind] = truth[rank] if rank >= 0 else 0.0
    return found


def calibration_error(confidence: Array, correct: NDArray[np.bool_], bins: int = BINS) -> float:
    """Expected calibration error: mean gap between confidence (n,) and share correct over bins of equal mass."""
    order = np.argsort(confidence, kind="stable")
    gaps = [
        len(part) * abs(confidence[part].mean() - correct[part].mean())
        for part in np.array_split(order, bins)
        if len(part)
    ]
    return float(np.sum(gaps) / len(order))
