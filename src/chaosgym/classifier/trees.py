"""Boosted trees as plain arrays: trained by scikit-learn, evaluated without it.

The nodes of all trees stand in a row, children side by side. A leaf is its own child. Missing values go where training
sent them. Each tree adds to one score.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.classifier.kernels.trees import walk_rows
from chaosgym.core.compilation import call_or_interpret

L2 = 5.0
"""Regularisation of the leaves."""


class Forest(NamedTuple):
    """Trees of a boosted model: scores = baseline + sum of the leaves.

    ``feature`` (n_nodes,) to look at; ``threshold`` (n_nodes,) above which a row goes right; ``missing_right``
    (n_nodes,) whether a missing value does; ``child`` (n_nodes,) number of the left child, the right one follows it, a
    leaf's own number; ``value`` (n_nodes,) of a leaf; ``roots`` (n_trees,); ``score`` (n_trees,) which score a tree
    adds to; ``baseline`` (n_scores,).
    """

    feature: NDArray[np.int32]
    threshold: Array
    missing_right: NDArray[np.bool_]
    child: NDArray[np.int32]
    value: Array
    roots: NDArray[np.int32]
    score: NDArray[np.int32]
    baseline: Array


def train_forest(
    features: Array,
    labels: NDArray[np.int64],
    *,
    rounds: int,
    leaves: int = 15,
    learning_rate: float = 0.08,
    least_rows: int = 20,
    seed: int = 0,
) -> Forest:
    """Train a boosted classifier of class numbers (n,) on features (n, n_features); needs scikit-learn."""
    from sklearn.ensemble import HistGradientBoostingClassifier

    model = HistGradientBoostingClassifier(
        max_iter=rounds,
        max_leaf_nodes=leaves,
        learning_rate=learning_rate,
        l2_regularization=L2,
        min_samples_leaf=min(least_rows, max(1, len(labels) // 20)),
        early_stopping=False,
        random_state=seed,
    )
    # scikit-learn can't bin a column without numbers
    return forest_of(model.fit(np.where(np.isnan(features).all(axis=0), 0.0, features), labels))


def forest_of(model: Any) -> Forest:
    """Plain arrays of a fitted ``HistGradientBoosting`` model of scikit-learn, without categorical features."""
    trees = [(score, tree.nodes) for stage in model._predictors for score, tree in enumerate(stage)]
    parts, roots, start = [], [], 0
    for _, nodes in trees:
        parts.append(_side_by_side(nodes, start))
        roots.append(start)
        start += len(nodes)
    feature, threshold, missing_right, child, value = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Forest(
        feature=feature.astype(np.int32),
        threshold=threshold.astype(float),
        missing_right=missing_right,
        child=child.astype(np.int32),
        value=value.astype(float),
        roots=np.array(roots, dtype=np.int32),
        score=np.array([score for score, _ in trees], dtype=np.int32),
        baseline=np.ascontiguousarray(model._baseline_prediction, dtype=float).ravel(),
    )


def _side_by_side(nodes: Any, start: int) -> tuple[Any, ...]:
    """Columns of one tree's nodes, numbered from ``start`` and so that a right child follows its left sibling."""
    order, places = [0], [0]
    while places:
        node = nodes[places.pop(0)]
        if not node["is_leaf"]:
            pair = [int(node["left"]), int(node["right"])]
            order += pair
            places += pair
    place = np.empty(len(nodes), dtype=np.int64)
    place[order] = np.arange(len(nodes))
    nodes = nodes[order]
    leaf = nodes["is_leaf"].astype(bool)
    return (
        np.where(leaf, 0, nodes["feature_idx"].astype(np.int64)),
        np.where(leaf, 0.0, nodes["num_threshold"]),
        ~leaf & ~nodes["missing_go_to_left"].astype(bool),
        start + np.where(leaf, np.arange(len(nodes)), place[nodes["left"].astype(np.int64)]),
        np.where(leaf, nodes["value"], 0.0),
    )


def class_scores(forest: Forest, features: Array) -> Array:
    """Scores (n_rows, n_classes); of two classes, for which boosting has one score, the first has zero."""
    found = np.empty((len(features), len(forest.baseline)))
    call_or_interpret(walk_rows, *forest, features, found)
    return np.concatenate([np.zeros_like(found), found], axis=1) if found.shape[1] == 1 else found
