"""How are boosted trees trained? By scikit-learn; what is kept are plain arrays."""

import numpy as np
from numpy.typing import NDArray

from chaosgym.classifier.trees import Forest, forest_of

Array = NDArray[np.float64]

L2 = 10.0
LEAST_ROWS = 20
"""Rows of a leaf at least."""


def without_empty_columns(features: Array) -> Array:
    """Figures that no training row has become zero throughout: scikit-learn can't bin a column without numbers."""
    return np.where(np.isnan(features).all(axis=0), 0.0, features)


def train_forest(
    features: Array,
    labels: NDArray[np.int64],
    *,
    rounds: int,
    leaves: int = 15,
    learning_rate: float = 0.1,
    least_rows: int = 20,
    depth: int | None = None,
    seed: int = 0,
) -> Forest:
    """Train a boosted classifier of class numbers (n,) on features (n, n_features)."""
    from sklearn.ensemble import HistGradientBoostingClassifier

    model = HistGradientBoostingClassifier(
        max_iter=rounds,
        max_leaf_nodes=leaves,
        max_depth=depth,
        learning_rate=learning_rate,
        l2_regularization=L2,
        min_samples_leaf=min(least_rows, max(1, len(labels) // 20)),
        early_stopping=False,
        random_state=seed,
    )
    return forest_of(model.fit(without_empty_columns(features), labels))


def train_quantile_forest(features: Array, values: Array, quantile: float, rounds: int, seed: int) -> Forest:
    """Train a boosted regression of a quantile of values (n,)."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    model = HistGradientBoostingRegressor(
        loss="quantile",
        quantile=quantile,
        max_iter=rounds,
        learning_rate=0.1,
        l2_regularization=L2,
        max_leaf_nodes=16,
        min_samples_leaf=LEAST_ROWS,
        early_stopping=False,
        random_state=seed,
    )
    return forest_of(model.fit(without_empty_columns(features), values))
