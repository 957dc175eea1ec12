"""How are many trees walked? Level by level, a block of rows at a time, or row by row."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

BLOCK = 64
"""Rows that walk a tree side by side."""


@njit(cache=True, nogil=True)
def _walk(
    feature: NDArray[np.int32],
    threshold: Array,
    missing_right: NDArray[np.bool_],
    child: NDArray[np.int32],
    value: Array,
    roots: NDArray[np.int32],
    depths: NDArray[np.int32],
    score: NDArray[np.int32],
    baseline: Array,
    features: Array,
    out: Array,
) -> None:
    """Scores of one block of rows."""
    rows = len(features)
    known = np.ascontiguousarray(features.T)
    total = np.zeros((len(baseline), rows))
    node = np.empty(rows, dtype=np.int32)
    for tree in range(len(roots)):
        node[:] = roots[tree]
        for _ in range(depths[tree]):
            for row in range(rows):
                at = node[row]
                seen = known[feature[at], row]
                right = (seen > threshold[at]) | ((seen != seen) & missing_right[at])
                node[row] = child[at] + np.int32(right)
        sums = total[score[tree]]
        for row in range(rows):
            sums[row] += value[node[row]]
    for row in range(rows):
        for place in range(len(baseline)):
            out[row, place] = baseline[place] + total[place, row]


@njit(cache=True, nogil=True)
def walk_blocks(
    feature: NDArray[np.int32],
    threshold: Array,
    missing_right: NDArray[np.bool_],
    child: NDArray[np.int32],
    value: Array,
    roots: NDArray[np.int32],
    depths: NDArray[np.int32],
    score: NDArray[np.int32],
    baseline: Array,
    features: Array,
    out: Array,
) -> None:
    """Scores of all rows, block by block."""
    for block in range((len(features) + BLOCK - 1) // BLOCK):
        start, stop = block * BLOCK, min(len(features), (block + 1) * BLOCK)
        _walk(
            feature,
            threshold,
            missing_right,
            child,
            value,
            roots,
            depths,
            score,
            baseline,
            features[start:stop],
            out[start:stop],
        )


@njit(cache=True, nogil=True)
def walk_rows(
    feature: NDArray[np.int32],
    threshold: Array,
    missing_right: NDArray[np.bool_],
    child: NDArray[np.int32],
    value: Array,
    roots: NDArray[np.int32],
    depths: NDArray[np.int32],
    score: NDArray[np.int32],
    baseline: Array,
    features: Array,
    out: Array,
) -> None:
    """Scores of all rows, row by row."""
    for row in range(len(features)):
        out[row] = baseline
        for tree in range(len(roots)):
            node = roots[tree]
            while child[node] != node:
                seen = features[row, feature[node]]
                right = seen > threshold[node] or (np.isnan(seen) and missing_right[node])
                node = child[node] + np.int32(right)
            out[row, score[tree]] += value[node]
