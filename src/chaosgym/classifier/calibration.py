"""How sure may a classifier call itself? One temperature, a conformal threshold, and the error that remains.

Temperature scaling: C. Guo et al., On calibration of modern neural networks, ICML 2017. Split conformal sets with the
score 1 - p (LAC): M. Sadinle et al., J. Am. Stat. Assoc. 114 (2019).
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BINS = 15
"""Bins of equal mass for the expected calibration error."""


def softmax(scores: Array) -> Array:
    """Probabilities (n, classes) of scores (n, classes)."""
    powers = np.exp(scores - scores.max(axis=1, keepdims=True))
    powers /= powers.sum(axis=1, keepdims=True)
    return np.asarray(powers)


def best_temperature(scores: Array, labels: NDArray[np.int64]) -> float:
    """Divisor of the scores (n, classes) under which the class numbers (n,) are most likely."""
    from scipy.optimize import minimize_scalar

    def surprise(logarithm: float) -> float:
        chances = softmax(scores / np.exp(logarithm))[np.arange(len(labels)), labels]
        return float(-np.mean(np.log(chances.clip(1e-12))))

    return float(np.exp(minimize_scalar(surprise, bounds=(-1.5, 2.5), method="bounded").x))


def conformal_threshold(chances: Array, labels: NDArray[np.int64], coverage: float) -> float:
    """Probability from which on a class belongs to the set that holds the truth with a given coverage."""
    truth = np.sort(chances[np.arange(len(labels)), labels])
    rank = int(np.floor((1.0 - coverage) * (len(truth) + 1))) - 1
    return float(truth[rank]) if rank >= 0 else 0.0


def calibration_error(confidence: Array, correct: NDArray[np.bool_], bins: int = BINS) -> float:
    """Expected calibration error: mean gap between confidence (n,) and share correct over bins of equal mass."""
    order = np.argsort(confidence, kind="stable")
    gaps = [
        len(part) * abs(confidence[part].mean() - correct[part].mean())
        for part in np.array_split(order, bins)
        if len(part)
    ]
    return float(np.sum(gaps) / len(order))
