"""What does a sensor make of a simulated run? Noisy records of any length, from the start or settled, for training.

A sweep with signals keeps the peak force, and the stroboscopic displacement and velocity, of cycles 0 to 63 and 200 to
263 of a run from rest. Each copy of a run takes one of the windows, 8 to 64 cycles of it, and one kind of noise:

    none        one copy in six
    relative    normal, with a deviation of 0.1 to 3 % of the record's mean peak
    sensor      evenly spread over an error of 0.3 to 5 N

The error is told to the classifier in two copies of three, the section in one of three. Models that were trained on
clean records fail on noisy ones.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.classifier.features import MAX_CYCLES, MIN_CYCLES
from chaosgym.errors import DatasetError

Array = NDArray[np.float64]

WINDOWS = ("start", "settled")
NORMAL_DEVIATIONS = 3.0
"""Standard deviations that count as the largest error of normal noise."""


class Records(NamedTuple):
    """Records as a sensor gives them.

    ``peaks`` (n, cycles) [N], NaN after the end; ``section`` (n, cycles, 2), NaN where not given; ``sensor_error``
    (n,) [N], NaN where not told; ``rows`` (n,) which run each record is of.
    """

    peaks: Array
    section: Array
    sensor_error: Array
    rows: NDArray[np.int64]


def signals_of(table: Any, window: str) -> tuple[Array, Array, NDArray[np.int64]]:
    """Signals of a window of a sweep's table: peaks (n, 64), section (n, 64, 2), and the rows (n,) that have them.

    Raises
    ------
    DatasetError
        If the sweep was run without signals.
    """
    names = [f"{window}_{name}" for name in ("peak_force", "displacement", "velocity")]
    missing = [name for name in names if name not in table.column_names]
    if missing:
        raise DatasetError(f"the sweep has no column {missing[0]}; run it with `chaosgym sweep --signals SHARE`")
    kept = [table.column(name).combine_chunks() for name in names]
    rows = np.flatnonzero(kept[0].is_valid().to_numpy(zero_copy_only=False))
    peaks, displacement, velocity = (
        np.stack(column.take(rows).to_numpy(zero_copy_only=False)).astype(float)
        if len(rows)
        else np.empty((0, MAX_CYCLES))
        for column in kept
    )
    return peaks, np.stack([displacement, velocity], axis=2), rows


def training_records(signals: Mapping[str, tuple[Array, Array, NDArray[np.int64]]], copies: int, seed: int) -> Records:
    """Noisy copies of every run of the windows' signals, of random length, window and noise."""
    generator = np.random.default_rng(seed)
    parts = [_copy(*signals[window], generator) for _ in range(copies) for window in WINDOWS]
    return Records(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _copy(peaks: Array, section: Array, rows: NDArray[np.int64], generator: np.random.Generator) -> Records:
    count, cycles = peaks.shape
    lengths = np.exp(generator.uniform(np.log(MIN_CYCLES), np.log(cycles + 1.0), count)).astype(int)
    starts = (generator.random(count) * (cycles - lengths + 1)).astype(int) * (generator.random(count) < 0.5)
    columns = np.minimum(starts[:, None] + np.arange(cycles), cycles - 1)
    ended = np.arange(cycles) >= lengths[:, None]
    forces = np.take_along_axis(peaks, columns, axis=1)
    level = np.where(ended, 0.0, forces).sum(axis=1) / lengths
    kind = generator.integers(0, 6, count)
    share = np.where((kind == 1) | (kind == 2), 10.0 ** generator.uniform(-3.0, -1.5, count), 0.0)
    error = np.where(kind >= 3, np.exp(generator.uniform(np.log(0.3), np.log(5.0), count)), 0.0)
    forces = forces + (share * level)[:, None] * generator.standard_normal(forces.shape)
    forces = np.maximum(forces + error[:, None] * generator.uniform(-1.0, 1.0, forces.shape), 0.0)
    told = np.where(generator.random(count) < 2.0 / 3.0, NORMAL_DEVIATIONS * share * level + error, np.nan)
    states = np.take_along_axis(section, columns[:, :, None], axis=1)
    size = np.sqrt(np.mean(states**2, axis=1, keepdims=True))
    noise = 10.0 ** generator.uniform(-4.0, -1.5, (count, 1, 1))
    states = states + noise * size * generator.standard_normal(states.shape)
    states[generator.random(count) >= 1.0 / 3.0] = np.nan
    forces[ended] = np.nan
    return Records(forces, states, told, rows)
