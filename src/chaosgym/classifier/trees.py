"""How are boosted trees evaluated without scikit-learn? As plain arrays, walked level by level, many rows at a time.

The nodes of all trees stand in a row, children side by side. A leaf is its own child and lets everything pass to the
left, so that all rows of a tree take the same number of steps and none needs a branch. Missing values go where training
sent them. Each tree adds to one score.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.classifier.kernels.trees import walk_blocks, walk_rows

Array = NDArray[np.float64]

FEW_ROWS = 8
"""Rows below which each goes its own way, and stops at its leaf."""


class Forest(NamedTuple):
    """Trees of a boosted model: scores = baseline + sum of the leaves.

    ``feature`` (n_nodes,) to look at; ``threshold`` (n_nodes,) above which a row goes right, infinite at a leaf;
    ``missing_right`` (n_nodes,) whether a missing value does; ``child`` (n_nodes,) number of the left child, the right
    one follows it; ``value`` (n_nodes,) of a leaf; ``roots``, ``depths`` (n_trees,); ``score`` (n_trees,) which score a
    tree adds to; ``baseline`` (n_scores,).
    """

    feature: NDArray[np.int32]
    threshold: Array
    missing_right: NDArray[np.bool_]
    child: NDArray[np.int32]
    value: Array
    roots: NDArray[np.int32]
    depths: NDArray[np.int32]
    score: NDArray[np.int32]
    baseline: Array


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
        depths=np.array([nodes["depth"].max() for _, nodes in trees], dtype=np.int32),
        score=np.array([score for score, _ in trees], dtype=np.int32),
        baseline=np.ascontiguousarray(model._baseline_prediction, dtype=float).ravel(),
    )


def _side_by_side(nodes: Any, start: int) -> tuple[Any, ...]:
    """Columns of one tree's nodes, numbered from ``start`` and so that a right child follows its left sister."""
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
        np.where(leaf, np.inf, nodes["num_threshold"]),
        ~leaf & ~nodes["missing_go_to_left"].astype(bool),
        start + np.where(leaf, np.arange(len(nodes)), place[nodes["left"].astype(np.int64)]),
        nodes["value"],
    )


def constant_forest(baseline: Array) -> Forest:
    """A forest without trees: the same scores (n_scores,) for every row."""
    none, numbers, truths = np.zeros(0, dtype=np.int32), np.zeros(0), np.zeros(0, dtype=np.bool_)
    return Forest(none, numbers, truths, none, numbers, none, none, none, baseline)


def joined(forests: tuple[Forest, ...]) -> Forest:
    """One forest whose scores are those of several, in their order."""
    nodes = np.cumsum([0, *(len(forest.feature) for forest in forests)])
    counts = np.cumsum([0, *(len(forest.baseline) for forest in forests)])
    moved = [
        forest._replace(child=forest.child + start, roots=forest.roots + start, score=forest.score + first)
        for forest, start, first in zip(forests, nodes[:-1].astype(np.int32), counts[:-1].astype(np.int32), strict=True)
    ]
    return Forest(*(np.concatenate(column) for column in zip(*moved, strict=True)))


def forest_scores(forest: Forest, features: Array) -> Array:
    """Scores (n_rows, n_scores) of features (n_rows, n_features)."""
    out = np.empty((len(features), len(forest.baseline)))
    walk = walk_blocks if len(features) >= FEW_ROWS else walk_rows
    walk(*forest, features, out)
    return out


def class_scores(forest: Forest, features: Array) -> Array:
    """Scores (n_rows, n_classes); of two classes, for which boosting has one score, the first has zero."""
    found = forest_scores(forest, features)
    return np.concatenate([np.zeros_like(found), found], axis=1) if found.shape[1] == 1 else found
