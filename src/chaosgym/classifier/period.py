"""After how many cycles does a noisy record of a periodic response repeat?"""

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.classifier.features import as_records
from chaosgym.classifier.kernels.records import class_scatter

IMPROVEMENT = 0.5
"""A longer period counts if its classes scatter less than this share of any shorter one's: noise gains little."""

LONGEST, REPEATS = 16, 4
"""Longest period looked for, and how often it must be seen."""


def repeat_period(peaks: ArrayLike) -> int:
    """Smallest period of one record (cycles,) whose classes scatter clearly less than those of every shorter period."""
    record = as_records(peaks)[0][0]
    record = record[~np.isnan(record)]
    best, period = np.inf, 1
    for candidate in range(1, min(LONGEST, len(record) // REPEATS) + 1):
        scatter = class_scatter(record, candidate)
        if scatter < IMPROVEMENT * best - 1e-9 * abs(record).max():
            best, period = scatter, candidate
        best = min(best, scatter)
    return period
