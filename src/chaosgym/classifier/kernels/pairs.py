"""How probable are pairs of a type and a nature, by their scores?"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@njit(cache=True, nogil=True)
def fill_chances(scores: Array, nature_of: NDArray[np.int64], temperatures: Array, out: Array) -> None:
    """Probabilities ``out`` (n, n_pairs) of scores (n, n_pairs).

    That of the nature, from the sum over its pairs, times that of the type of such a nature; the scores are divided by
    temperatures (2,), one for natures and one for types.
    """
    pairs = len(nature_of)
    natures = 0
    for pair in range(pairs):
        natures = max(natures, nature_of[pair] + 1)
    top, total, nature_score = np.empty(natures), np.empty(natures), np.empty(natures)
    for row in range(len(scores)):
        top[:] = -np.inf
        for pair in range(pairs):
            top[nature_of[pair]] = max(top[nature_of[pair]], scores[row, pair])
        nature_score[:] = 0.0
        total[:] = 0.0
        for pair in range(pairs):
            gap = scores[row, pair] - top[nature_of[pair]]
            nature_score[nature_of[pair]] += math.exp(gap)
            out[row, pair] = math.exp(gap / temperatures[1])
            total[nature_of[pair]] += out[row, pair]
        highest = -np.inf
        for nature in range(natures):
            nature_score[nature] = (top[nature] + math.log(nature_score[nature])) / temperatures[0]
            highest = max(highest, nature_score[nature])
        whole = 0.0
        for nature in range(natures):
            nature_score[nature] = math.exp(nature_score[nature] - highest)
            whole += nature_score[nature]
        for pair in range(pairs):
            nature = nature_of[pair]
            out[row, pair] *= nature_score[nature] / (whole * total[nature])
