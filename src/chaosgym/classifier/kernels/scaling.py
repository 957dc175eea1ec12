"""How do features become inputs of a network? Scaled, clipped, and the mean where there is none."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Single = NDArray[np.float32]


@njit(cache=True, nogil=True)
def fill_scaled(features: Array, centre: Single, spread: Single, limit: float, out: Single) -> None:
    """Inputs ``out`` (n, n_features) of ``features`` (n, n_features), between ``-limit`` and ``limit``."""
    for row in range(len(features)):
        for i in range(len(centre)):
            scaled = (features[row, i] - centre[i]) / spread[i]
            out[row, i] = min(max(scaled, -limit), limit) if scaled == scaled else 0.0
