"""How sure is a score? Bootstrap intervals and the performance profile.

References
----------
Agarwal et al., Deep Reinforcement Learning at the Edge of the Statistical Precipice, NeurIPS 2021.
"""

import warnings
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

Array = NDArray[np.float64]

RESAMPLES = 10_000
CONFIDENCE = 0.95


def bootstrap_interval(count: int, statistic: Callable[[NDArray[np.int64]], Array], seed: int = 0) -> Array:
    """Percentile interval (2,) of a statistic of ``count`` things, drawn again and again with replacement.

    Parameters
    ----------
    count
        Number of things; of one alone nothing is known, and the interval is that one value.
    statistic
        Of places (resamples, count) or (count,) to (resamples,) or a number; draws of which it is NaN are left out.
    seed
        Of the draws.
    """
    places = np.arange(count)
    if count == 1:
        return np.full(2, float(statistic(places)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", stats.DegenerateDataWarning)
        result = stats.bootstrap(
            (places,),
            lambda drawn, axis: statistic(drawn),
            n_resamples=RESAMPLES,
            method="percentile",
            vectorized=True,
            batch=500,
            rng=np.random.default_rng(seed),
        )
    tail = (1.0 - CONFIDENCE) / 2.0
    return np.asarray(np.nanpercentile(result.bootstrap_distribution, [100 * tail, 100 * (1 - tail)]))


def performance_profile(scores: ArrayLike, thresholds: ArrayLike) -> Array:
    """Share of the scores (any shape) at or above each threshold (n,)."""
    return np.asarray(np.greater_equal.outer(np.ravel(scores), thresholds).mean(axis=0))
