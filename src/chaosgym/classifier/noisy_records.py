"""What a sensor makes of a simulated run: noisy records of any length, from the start or settled, for training.

Each copy of a run takes one of the windows, 8 to 64 cycles of it, and one sensor. The error that it is told is even or
normal (three deviations), 0.02 to 10 N or 0.1 to 10 % of the record's mean. Its real error is none in one copy of five,
anything up to the told one in two, the told one in one, and up to one and a half times as large in one: sensors are
mostly better than they promise, and some are worse. A tenth of the records are rounded, to 0.1 or 0.01 N. In one copy
of six nothing is told.

A record is irregular beyond the sensor's error if the settled run, without any noise, is: ``irregularity`` above the
told error.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.classifier.features import MIN_CYCLES

Array = NDArray[np.float64]

TOLD, RELATIVE = (-1.7, 1.0), (-3.0, -1.0)
"""Decades of the told errors [N], and of those that are shares of the mean peak."""

WORSE = 1.5
"""Largest real error over the told one."""

NORMAL_DEVIATIONS = 3.0
"""Standard deviations that count as the largest error of normal noise."""


class Records(NamedTuple):
    """Records as a sensor gives them.

    ``peaks`` (n, cycles) [N], NaN after the end; ``sensor_error`` (n,) [N], NaN where not told; ``rows`` (n,) which run
    each record is of.
    """

    peaks: Array
    sensor_error: Array
    rows: NDArray[np.int64]


def training_records(start: Array, settled: Array, copies: int, seed: int) -> Records:
    """Noisy copies of runs, whose peaks [N] of two windows are given (n, cycles)."""
    generator = np.random.default_rng(seed)
    parts = [_copy(window, generator) for _ in range(copies) for window in (settled, start)]
    return Records(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _copy(peaks: Array, generator: np.random.Generator) -> Records:
    count, cycles = peaks.shape
    lengths = np.exp(generator.uniform(np.log(MIN_CYCLES), np.log(cycles + 1.0), count)).astype(int)
    starts = (generator.random(count) * (cycles - lengths + 1)).astype(int) * (generator.random(count) < 0.5)
    columns = np.minimum(starts[:, None] + np.arange(cycles), cycles - 1)
    ended = np.arange(cycles) >= lengths[:, None]
    forces = np.take_along_axis(peaks, columns, axis=1)
    level = np.where(ended, 0.0, forces).sum(axis=1) / lengths
    relative = generator.random(count) < 1.0 / 3.0
    absolute, shares = (10.0 ** generator.uniform(*decades, count) for decades in (TOLD, RELATIVE))
    told = np.asarray(np.where(relative, level * shares, absolute))
    forces = noisy(forces, told * _quality(count, generator), generator)
    step = generator.choice([0.0, 0.1, 0.01], count, p=[0.9, 0.05, 0.05])[:, None]
    forces = np.where(step > 0.0, np.round(forces / np.where(step > 0.0, step, 1.0)) * step, forces)
    forces[ended] = np.nan
    silent = generator.random(count) < 1.0 / 6.0
    return Records(forces, np.where(silent, np.nan, told), np.arange(count))


def _quality(count: int, generator: np.random.Generator) -> Array:
    """Real error over the told one, (count,)."""
    kind, share = generator.integers(0, 5, count), generator.random(count)
    return np.select(
        [kind == 0, kind <= 2, kind == 3], [0.0 * share, share, 1.0 + 0.0 * share], 1.0 + (WORSE - 1.0) * share
    )


def noisy(forces: Array, error: Array, generator: np.random.Generator) -> Array:
    """Peaks (n, cycles) with errors of at most ``error`` (n,): even in half of the rows, normal in the others."""
    normal = generator.random(len(forces)) < 0.5
    even = generator.uniform(-1.0, 1.0, forces.shape)
    bell = generator.standard_normal(forces.shape) / NORMAL_DEVIATIONS
    return np.asarray(np.maximum(forces + error[:, None] * np.where(normal[:, None], bell, even), 0.0))
