"""What a step of k machines comes to: growth, recurrence and the features of measured peaks, without small arrays."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

LAGS = (1, 2, 4)
"""Cycles after which measured peaks are compared with themselves."""

PERIODS = 8
"""Longest period, in cycles, of a motion that repeats."""


@njit(cache=True, nogil=True)
def running_exponents(growth: Array, exponents: Array, memory: float, largest: float, shares: Array) -> None:
    """Carry ``exponents`` (k,) through ``growth`` (k, cycles); ``shares`` (k,) of the cycles with a positive one."""
    count, cycles = growth.shape
    for i in range(count):
        exponent, wild = exponents[i], 0
        for grown in growth[i]:
            exponent += (min(max(grown, -largest), largest) - exponent) / memory
            wild += exponent > 0.0
        exponents[i] = exponent
        shares[i] = wild / cycles


@njit(cache=True, nogil=True)
def recurrence_misses(peaks: Array, misses: Array) -> None:
    """Mean miss at the period that fits best, as a share of the mean peak, (k,), of peak forces (k, cycles)."""
    count, cycles = peaks.shape
    for i in range(count):
        unknown = 0
        while unknown < cycles and np.isnan(peaks[i, unknown]):
            unknown += 1
        lags = min(PERIODS, (cycles - unknown) // 2)
        first = unknown + lags
        total = 0.0
        for cycle in range(first, cycles):
            total += peaks[i, cycle]
        least = np.inf if lags > 0 else 0.0
        for period in range(1, lags + 1):
            miss = 0.0
            for cycle in range(first, cycles):
                miss += abs(peaks[i, cycle] - peaks[i, cycle - period])
            least = min(least, miss)
        misses[i] = least / max(total, 1e-9 * (cycles - first))


@njit(cache=True, nogil=True)
def sensed(
    peak_force: Array,
    impacts: NDArray[np.int64],
    bounce_duration: Array,
    period: Array,
    errors: Array,
    measured: Array,
    features: Array,
) -> None:
    """What sensors report of the last cycles of k machines: peaks ``measured`` (k, last) and ``features`` (k, 8).

    ``peak_force``, ``impacts`` and ``bounce_duration`` (k, cycles, sides), ``period`` (k,). ``errors`` (k, last + 1)
    are those of the peak forces of the first side, and of the share of bouncing. Features are ``observation.FELT``, but
    with the number of all impacts.
    """
    count, last = errors.shape[0], errors.shape[1] - 1
    first, sides = peak_force.shape[1] - last, peak_force.shape[2]
    for i in range(count):
        total, largest, bouncing, contacts = 0.0, 0.0, 0.0, 0
        for k in range(last):
            measured[i, k] = max(peak_force[i, first + k, 0] + errors[i, k], 0.0)
            total += measured[i, k]
            largest = max(largest, measured[i, k])
            for side in range(sides):
                bouncing += bounce_duration[i, first + k, side]
                contacts += impacts[i, first + k, side]
        mean, squares = total / last, 0.0
        for k in range(last):
            squares += (measured[i, k] - mean) ** 2
        features[i, 0], features[i, 1], features[i, 2] = mean, np.sqrt(squares / last), largest
        for column, lag in enumerate(LAGS):
            missed = 0.0
            for k in range(lag, last):
                missed += abs(measured[i, k] - measured[i, k - lag])
            features[i, 3 + column] = missed / max(1, last - lag)
        features[i, 6] = contacts
        features[i, 7] = 2.0 * bouncing / (last * sides * period[i]) + errors[i, last]
