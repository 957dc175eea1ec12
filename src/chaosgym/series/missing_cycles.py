"""Cycles that a recorder lost or wrote twice: the phase of every reading in a pattern that otherwise repeats.

The phases are those of least cost: the square of each reading's distance from the pattern, and a price for every jump
of the phase (the algorithm of A. Viterbi, IEEE Trans. Inf. Theory 13, 1967).
"""

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array

STRETCH = 4
"""Periods in succession, at least, from which the pattern is taken."""

FAR, PRICE = 6.0, 20.0
"""Standard deviations beyond which a reading costs no more, and the price of a jump; squares of standard deviations."""

MOST_LOST = 0.1
"""Share of the readings before which cycles may be missing."""

LEAST_DRIFT, STEADY, LONG = 4, 0.45, 8
"""Cycles by which the phase of a pattern drifts in all, standard deviation [cycles] from a steady drift, and period
from which it may (assumed). Of a staircase the deviation is 0.3; of losses by chance it grows with their number. Losses
of some recorders come at equal intervals; a short pattern shows them, since each of its readings is another."""


def with_stand_ins(values: Array, period: int, scatter: float) -> tuple[Array, NDArray[np.int64]]:
    """(record with stand-ins for missing cycles, which reading each is, -1 for a stand-in).

    Parameters
    ----------
    values : (cycles,)
        Readings.
    period
        Period of the pattern, as ``dominant_period`` tells it.
    scatter
        Standard deviation of a reading.
    """
    origin = np.arange(len(values))
    if period == 1 or len(values) < STRETCH * period:
        return values, origin
    far = np.abs(values[period:] - values[:-period]) > FAR * scatter
    if not far.any():
        return values, origin
    pattern = _pattern(values, period, far)
    if pattern is None or np.ptp(pattern) < 2.0 * FAR * scatter:
        return values, origin
    phase = _phases(values, pattern, scatter)
    lost = (np.diff(phase) - 1) % period
    if np.count_nonzero(lost) > MOST_LOST * len(values) or _beats(lost, period):
        return values, origin
    place = np.concatenate([[0], np.cumsum(1 + lost)])
    whole, origin = np.full(place[-1] + 1, np.nan), np.full(place[-1] + 1, -1)
    whole[place], origin[place] = values, np.arange(len(values))
    for gap in np.flatnonzero(origin < 0):
        whole[gap] = whole[gap - period] if gap >= period else pattern[(phase[0] + gap) % period]
    return whole, origin


def _beats(lost: NDArray[np.int64], period: int) -> bool:
    """Whether the phase of a pattern drifts steadily: its period is no whole number of cycles, and nothing is lost."""
    if period < LONG:
        return False
    drift, cycles = np.cumsum((lost + period // 2) % period - period // 2), np.arange(len(lost))
    steady = np.polynomial.Polynomial.fit(cycles, drift, 1)
    return bool(abs(drift[-1]) >= LEAST_DRIFT and np.std(drift - steady(cycles)) < STEADY)


def _pattern(values: Array, period: int, far: NDArray[np.bool_]) -> Array | None:
    """Medians of each phase over the longest stretch that repeats; None if it is short."""
    ends = np.concatenate([[-1], np.flatnonzero(far), [len(far)]])
    longest = int(np.argmax(np.diff(ends)))
    start, stop = int(ends[longest]) + 1, int(ends[longest + 1]) + period
    if stop - start < STRETCH * period:
        return None
    return np.array([np.median(values[start + first : stop : period]) for first in range(period)])


def _phases(values: Array, pattern: Array, scatter: float) -> NDArray[np.int64]:
    """Phase of each reading, (cycles,)."""
    costs = np.minimum(((values[:, None] - pattern) / scatter) ** 2, FAR**2)
    total, came = costs[0], np.empty(costs.shape, np.int64)
    following = np.roll(np.arange(len(pattern)), 1)
    for cycle in range(1, len(values)):
        least = int(np.argmin(total))
        on = total[following]
        jumps = total[least] + PRICE < on
        came[cycle] = np.where(jumps, least, following)
        total = np.where(jumps, total[least] + PRICE, on) + costs[cycle]
    phase = np.empty(len(values), np.int64)
    phase[-1] = int(np.argmin(total))
    for cycle in range(len(values) - 1, 0, -1):
        phase[cycle - 1] = came[cycle, phase[cycle]]
    return phase
