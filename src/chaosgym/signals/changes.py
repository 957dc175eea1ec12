"""Changes of regime in a record: cut where two halves repeat, or scatter, far differently."""

import numpy as np
from numpy.typing import NDArray

from chaosgym.signals.noise import class_residual, dominant_period

Array = NDArray[np.float64]

SHORTEST = 24
"""Fewest cycles of a regime."""

PLACES = 60
"""Places at which a cut is tried first."""

DIFFERENT = 16.0
"""Ratio of variances by which regimes differ."""

GAIN = 30.0
"""Least gain of log-likelihood, times two, of a cut."""


def find_change(values: Array, floor: float) -> int | None:
    """First cycle of the later regime, counted from 0; None if the record is of one kind throughout.

    Parameters
    ----------
    values : (cycles,)
        Readings without single wrong ones.
    floor
        Standard deviation that does not count.
    """
    size = len(values)
    if size < 2 * SHORTEST:
        return None
    third = max(SHORTEST, size // 3)
    periods = {dominant_period(part, floor) for part in (values, values[:third], values[-third:])}
    whole = _variance(values, periods, floor)

    def gain(place: int) -> float:
        parts = (values[:place], values[place:])
        return size * float(np.log(whole)) - sum(len(p) * float(np.log(_variance(p, periods, floor))) for p in parts)

    places = np.unique(np.linspace(SHORTEST, size - SHORTEST, PLACES).astype(int))
    best = max(places.tolist(), key=gain)
    reach = max(1, size // PLACES)
    best = max(range(max(SHORTEST, best - reach), min(size - SHORTEST, best + reach) + 1), key=gain)
    before, after = (_variance(part, periods, floor) for part in (values[:best], values[best:]))
    larger, smaller = max(before, after), min(before, after)
    if gain(best) < GAIN or max(larger / smaller, whole / larger) < DIFFERENT:
        return None
    return int(best)


def _variance(values: Array, periods: set[int], floor: float) -> float:
    """Least variance that the readings have within the classes of one of the periods."""
    fitting = [k for k in periods if 3 * k <= len(values)] or [1]
    found = [float(np.sum(class_residual(values, k) ** 2)) / max(1, len(values) - k) for k in fitting]
    return min(found) + floor**2
