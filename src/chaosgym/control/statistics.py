"""How sure is a score? Interquartile mean, bootstrap intervals, performance profile, probability of improvement, CVaR.

References
----------
Agarwal et al., Deep Reinforcement Learning at the Edge of the Statistical Precipice, NeurIPS 2021.
Rockafellar, Uryasev, Optimization of conditional value-at-risk, Journal of Risk 2, 2000.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

Array = NDArray[np.float64]

RESAMPLES = 10_000
CONFIDENCE = 0.95
WORST_SHARE = 0.1
"""Share of the jobs that the CVaR is the mean of."""


def interquartile_mean(values: ArrayLike, axis: int | None = None) -> Any:
    """Mean without the lowest and the highest quarter."""
    return stats.trim_mean(np.asarray(values, dtype=float), 0.25, axis=axis)


def bootstrap_interval(count: int, statistic: Callable[[NDArray[np.int64]], Array], seed: int = 0) -> Array:
    """Percentile interval (2,) of a statistic of ``count`` things, drawn again and again with replacement.

    Parameters
    ----------
    count
        Number of things; of one alone nothing is known, and the interval is that one value.
    statistic
        Of places (resamples, count) or (count,) to (resamples,) or a number.
    seed
        Of the draws.
    """
    places = np.arange(count)
    if count == 1:
        return np.full(2, float(statistic(places)))
    result = stats.bootstrap(
        (places,),
        lambda drawn, axis: statistic(drawn),
        n_resamples=RESAMPLES,
        confidence_level=CONFIDENCE,
        method="percentile",
        vectorized=True,
        batch=500,
        rng=np.random.default_rng(seed),
    )
    return np.array(result.confidence_interval)


def performance_profile(scores: ArrayLike, thresholds: ArrayLike) -> Array:
    """Share of the scores (any shape) at or above each threshold (n,)."""
    values, levels = np.ravel(np.asarray(scores, dtype=float)), np.asarray(thresholds, dtype=float)
    return np.asarray((values[:, None] >= levels).mean(axis=0))


def probability_of_improvement(mine: ArrayLike, others: ArrayLike) -> float:
    """Probability that a run of mine (seeds, machines) beats one of another's (seeds', machines) on the same machine.

    Ties count half.
    """
    ours, theirs = np.asarray(mine, dtype=float)[:, None], np.asarray(others, dtype=float)[None]
    return float(np.mean((ours > theirs) + 0.5 * (ours == theirs)))


def worst_mean(values: ArrayLike, share: float = WORST_SHARE) -> float:
    """Conditional value at risk: mean of the largest ``share`` of the values, at least of one."""
    ordered = np.sort(np.ravel(np.asarray(values, dtype=float)))
    return float(ordered[-max(1, round(share * len(ordered))) :].mean())
