"""Bootstrap intervals of scores, and the performance profile.

References
----------
Agarwal et al., Deep Reinforcement Learning at the Edge of the Statistical Precipice, NeurIPS 2021.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.arrays import Array

RESAMPLES = 10_000
BATCH = 500
"""Resamples that are drawn, and given to the statistic, at once."""

CONFIDENCE = 0.95


def bootstrap_interval(count: int, statistic: Callable[[NDArray[np.int64]], Array], seed: int = 0) -> Array:
    """Percentile bootstrap interval (2,) of a statistic of ``count`` items.

    Parameters
    ----------
    count
        Number of things; of one alone nothing is known, and the interval is that one value.
    statistic
        Of places (resamples, count) to (resamples,); draws of which it is NaN are left out.
    seed
        Of the draws.
    """
    generator = np.random.default_rng(seed)
    drawn = [statistic(generator.integers(0, count, (BATCH, count))) for _ in range(RESAMPLES // BATCH)]
    tail = 50.0 * (1.0 - CONFIDENCE)
    return np.asarray(np.nanpercentile(drawn, [tail, 100.0 - tail]))


def paired_difference(mine: Array, other: Array, much: float) -> dict[str, Any]:
    """Mean of ``mine`` less ``other``, (count,) each, its interval, and the share that loses more than ``much``."""
    more = mine - other
    low, high = bootstrap_interval(len(more), lambda drawn: np.asarray(more[drawn].mean(axis=-1))).tolist()
    return {"more": float(more.mean()), "interval": [low, high], "made_worse": float(np.mean(more < -much))}


def performance_profile(scores: ArrayLike, thresholds: ArrayLike) -> Array:
    """Share of the scores (any shape) at or above each threshold (n,)."""
    return np.asarray(np.greater_equal.outer(np.ravel(scores), thresholds).mean(axis=0))
