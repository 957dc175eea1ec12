"""Evaluation of boosted trees, row by row."""

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.core.kernel import njit


@njit(cache=True, nogil=True)
def walk_rows(
    feature: NDArray[np.int32],
    threshold: Array,
    missing_right: NDArray[np.bool_],
    child: NDArray[np.int32],
    value: Array,
    roots: NDArray[np.int32],
    score: NDArray[np.int32],
    baseline: Array,
    features: Array,
    out: Array,
) -> None:
    """Scores ``out`` (n, n_scores) of ``features`` (n, n_features); the rest are the columns of a ``Forest``."""
    for row in range(len(features)):
        out[row] = baseline
        for tree in range(len(roots)):
            node = roots[tree]
            while child[node] != node:
                seen = features[row, feature[node]]
                right = seen > threshold[node] or (np.isnan(seen) and missing_right[node])
                node = child[node] + np.int32(right)
            out[row, score[tree]] += value[node]
