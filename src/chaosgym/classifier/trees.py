"""How are boosted trees evaluated without scikit-learn? As plain arrays, walked by a compiled loop.

The nodes of all trees stand in a row; a leaf has feature -1 and carries its value in place of a threshold. Missing
values go where training sent them. Each tree adds to one score.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import get_num_threads, njit, prange
from numpy.typing import NDArray

Array = NDArray[np.float64]

MANY_ROWS = 20_000
"""Rows from which on threads pay."""


class Forest(NamedTuple):
    """Trees of a boosted model: scores = baseline + sum of the leaves.

    ``feature`` (n_nodes,) -1 at a leaf; ``threshold`` (n_nodes,) or the leaf's value; ``left``, ``right`` (n_nodes,)
    numbers of the children; ``missing_left`` (n_nodes,); ``roots`` (n_trees,); ``score`` (n_trees,) which score a tree
    adds to; ``baseline`` (n_scores,).
    """

    feature: NDArray[np.int32]
    threshold: Array
    left: NDArray[np.int32]
    right: NDArray[np.int32]
    missing_left: NDArray[np.bool_]
    roots: NDArray[np.int32]
    score: NDArray[np.int32]
    baseline: Array


def forest_of(model: Any) -> Forest:
    """Plain arrays of a fitted ``HistGradientBoosting`` model of scikit-learn, without categorical features."""
    parts, roots, scores, start = [], [], [], 0
    for stage in model._predictors:
        for score, tree in enumerate(stage):
            nodes = tree.nodes
            leaf = nodes["is_leaf"].astype(bool)
            parts.append((
                np.where(leaf, -1, nodes["feature_idx"].astype(np.int64)),
                np.where(leaf, nodes["value"], nodes["num_threshold"]),
                np.where(leaf, 0, nodes["left"].astype(np.int64) + start),
                np.where(leaf, 0, nodes["right"].astype(np.int64) + start),
                nodes["missing_go_to_left"].astype(bool),
            ))  # fmt: skip
            roots.append(start)
            scores.append(score)
            start += len(nodes)
    feature, threshold, left, right, missing = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Forest(
        feature.astype(np.int32), threshold.astype(float), left.astype(np.int32), right.astype(np.int32), missing,
        np.array(roots, dtype=np.int32), np.array(scores, dtype=np.int32),
        np.ascontiguousarray(model._baseline_prediction, dtype=float).ravel(),
    )  # fmt: skip


def constant_forest(baseline: Array) -> Forest:
    """A forest without trees: the same scores (n_scores,) for every row."""
    none = np.zeros(0, dtype=np.int32)
    return Forest(none, np.zeros(0), none, none, np.zeros(0, dtype=np.bool_), none, none, baseline)


def forest_scores(forest: Forest, features: Array) -> Array:
    """Scores (n_rows, n_scores) of features (n_rows, n_features)."""
    out = np.empty((len(features), len(forest.baseline)))
    if len(features) >= MANY_ROWS and get_num_threads() > 1:
        _walk_in_parallel(*forest, features, out)
    else:
        _walk_all(*forest, features, out)
    return out


def class_scores(forest: Forest, features: Array) -> Array:
    """Scores (n_rows, n_classes); of two classes, for which boosting has one score, the first has zero."""
    found = forest_scores(forest, features)
    return np.concatenate([np.zeros_like(found), found], axis=1) if found.shape[1] == 1 else found


@njit(cache=True, nogil=True, inline="always")
def _walk(
    feature: NDArray[np.int32],
    threshold: Array,
    left: NDArray[np.int32],
    right: NDArray[np.int32],
    missing_left: NDArray[np.bool_],
    root: int,
    row: Array,
) -> float:
    node = root
    while feature[node] >= 0:
        value = row[feature[node]]
        goes_left = value <= threshold[node] or (missing_left[node] and np.isnan(value))
        node = left[node] if goes_left else right[node]
    return float(threshold[node])


@njit(cache=True, nogil=True)
def _walk_all(
    feature: NDArray[np.int32],
    threshold: Array,
    left: NDArray[np.int32],
    right: NDArray[np.int32],
    missing_left: NDArray[np.bool_],
    roots: NDArray[np.int32],
    score: NDArray[np.int32],
    baseline: Array,
    features: Array,
    out: Array,
) -> None:
    for row in range(len(features)):
        out[row] = baseline
        for tree in range(len(roots)):
            out[row, score[tree]] += _walk(feature, threshold, left, right, missing_left, roots[tree], features[row])


@njit(cache=True, nogil=True, parallel=True)
def _walk_in_parallel(
    feature: NDArray[np.int32],
    threshold: Array,
    left: NDArray[np.int32],
    right: NDArray[np.int32],
    missing_left: NDArray[np.bool_],
    roots: NDArray[np.int32],
    score: NDArray[np.int32],
    baseline: Array,
    features: Array,
    out: Array,
) -> None:
    for row in prange(len(features)):
        out[row] = baseline
        for tree in range(len(roots)):
            out[row, score[tree]] += _walk(feature, threshold, left, right, missing_left, roots[tree], features[row])
