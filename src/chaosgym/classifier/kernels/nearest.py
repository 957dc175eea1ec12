"""How far is a row from the nearest of some others?"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@njit(cache=True, nogil=True)
def nearest(rows: Array, prototypes: Array) -> Array:
    """Smallest root mean square difference over the figures that both rows have."""
    out = np.empty(len(rows))
    for i in range(len(rows)):
        best = np.inf
        for j in range(len(prototypes)):
            total, count = 0.0, 0
            for k in range(rows.shape[1]):
                gap = rows[i, k] - prototypes[j, k]
                if gap == gap:
                    total += gap * gap
                    count += 1
            if count > 0:
                best = min(best, total / count)
        out[i] = np.sqrt(best)
    return out
