"""Types of arrays in annotations; docstrings give shapes and units."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Real numbers."""

Indices = NDArray[np.int64]
"""Whole numbers that count or name."""
