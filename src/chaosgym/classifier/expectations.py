"""Which period and which peak forces does a classifier expect, where it has learned any?"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.classifier.boosting import train_forest, train_quantile_forest
from chaosgym.classifier.trees import Forest, class_scores, constant_forest, forest_scores, joined

Array = NDArray[np.float64]
Labels = NDArray[np.int64]

PERIODS = (1, 2, 3, 4)
"""Periods that are told apart; longer ones are answered by 0."""

QUANTILES = (0.05, 0.5, 0.95)
"""Of the peak force of a settled cycle."""

ROUNDS = 60


class Expectations(NamedTuple):
    """``periods`` (n_kinds,) known periods, 0 for longer ones, scored by ``period``; log of forces by ``force``."""

    periods: Labels
    period: Forest
    force: Forest


def learn_expectations(features: Array, period: Labels | None, force: Array | None, seed: int) -> Expectations:
    """Learn from features (n, n_features); periods (n,) are 0 for what has none, forces (n,) NaN where unknown."""
    known, judge = np.zeros(1, dtype=np.int64), constant_forest(np.zeros(1))
    if period is not None and (period > 0).any():
        kinds = np.append(PERIODS, 0)[np.searchsorted(PERIODS, period[period > 0])]
        known, numbers = np.unique(kinds, return_inverse=True)
        if len(known) > 1:
            judge = train_forest(features[period > 0], numbers, rounds=ROUNDS, seed=seed)
    forces = constant_forest(np.zeros(0))
    if force is not None and (force > 0.0).any():
        rows = force > 0.0
        forces = joined(
            tuple(
                train_quantile_forest(features[rows], np.log(force[rows]), quantile, ROUNDS, seed)
                for quantile in QUANTILES
            )
        )
    return Expectations(known, judge, forces)


def expected_period(expectations: Expectations, features: Array) -> Labels:
    """Most probable period (n,) of a periodic response; 0 for a longer one, or where none was learned."""
    if len(expectations.periods) == 1:
        return np.full(len(features), expectations.periods[0])
    return np.asarray(expectations.periods[class_scores(expectations.period, features).argmax(axis=1)])


def expected_force(expectations: Expectations, features: Array) -> Array:
    """Quantiles (n, 3) of the peak force; (n, 0) where none was learned."""
    return np.sort(np.exp(forest_scores(expectations.force, features)), axis=1)
