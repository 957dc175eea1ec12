"""How is a multinomial logistic regression kept? As centre, spread and weights of its features."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

INVERSE_STRENGTH = 0.1
"""Of the penalty on the squared weights."""


class Linear(NamedTuple):
    """Scores = weights of the scaled features + bias.

    ``centre``, ``spread`` (n_features,); ``weight`` (n_features, n_classes); ``bias`` (n_classes,).
    """

    centre: Array
    spread: Array
    weight: Array
    bias: Array


def linear_scores(linear: Linear, features: Array) -> Array:
    """Scores (n_rows, n_classes) of features (n_rows, n_features); NaN counts as the mean."""
    scaled = (features - linear.centre) / linear.spread
    scaled[np.isnan(scaled)] = 0.0
    return np.asarray(scaled @ linear.weight + linear.bias)


def train_linear(features: Array, labels: NDArray[np.int64]) -> Linear:
    """Train on features (n, n_features) and class numbers (n,), by scikit-learn."""
    from sklearn.linear_model import LogisticRegression

    known = ~np.isnan(features)
    count = known.sum(axis=0).clip(1)
    centre = np.where(known, features, 0.0).sum(axis=0) / count
    spread = np.sqrt(np.where(known, (features - centre) ** 2, 0.0).sum(axis=0) / count)
    spread = np.where(spread > 1e-12, spread, 1.0)
    model = LogisticRegression(C=INVERSE_STRENGTH, max_iter=300).fit(
        np.nan_to_num((features - centre) / spread, nan=0.0), labels
    )
    weight, bias = model.coef_.T, model.intercept_
    if weight.shape[1] == 1:
        weight, bias = np.hstack([np.zeros_like(weight), weight]), np.array([0.0, *bias])
    return Linear(centre, spread, np.ascontiguousarray(weight), bias)
