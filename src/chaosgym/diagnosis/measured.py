"""How does a measured signal become one sample a cycle? Peak forces as they are, time series cut into periods."""

from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.errors import DiagnosisError

Array = NDArray[np.float64]

UNEVEN = 1e-3
"""Largest deviation of a sampling interval from their mean, as a share, that counts as even sampling."""

FEWEST_SAMPLES = 8
"""Samples that a period must have."""


def read_columns(path: str | Path, columns: int) -> Array:
    """Read numbers from a comma-separated file, (rows, columns); a first line that is not numeric is a header.

    Raises
    ------
    DiagnosisError
        If the file can't be read, or has another number of columns, or an entry that is not a finite number.
    """
    try:
        lines = [line.strip() for line in Path(path).read_text().splitlines() if line.strip()]
    except (OSError, UnicodeDecodeError) as error:
        raise DiagnosisError(f"{path} can't be read: {error}") from error
    rows = []
    for number, line in enumerate(lines, start=1):
        parts = line.split(",")
        try:
            row = [float(part) for part in parts]
        except ValueError:
            if number == 1:
                continue
            raise DiagnosisError(f"{path}, line {number}: {line[:40]!r} is not a number") from None
        if len(row) != columns:
            raise DiagnosisError(f"{path}, line {number} has {len(row)} columns; allowed: {columns}")
        if not np.all(np.isfinite(row)):
            raise DiagnosisError(f"{path}, line {number}: {line[:40]!r} is not finite")
        rows.append(row)
    if not rows:
        raise DiagnosisError(f"{path} holds no numbers")
    return np.array(rows)


def samples_per_period(time: ArrayLike, value: ArrayLike, period: float) -> Array:
    """Two samples a period from a time series: the value at its start, and its largest modulus, (periods, 2).

    Parameters
    ----------
    time : (n,)
        Evenly spaced instants [s].
    value : (n,)
        The signal.
    period
        Operating cycle [s]; periods start at the first instant, and an incomplete last one is left out.

    Raises
    ------
    DiagnosisError
        If the sampling is uneven, coarser than 8 samples a period, or the series shorter than one period.
    """
    instants, signal = np.asarray(time, dtype=float), np.asarray(value, dtype=float)
    steps = np.diff(instants)
    if not np.isfinite(period) or period <= 0.0:
        raise DiagnosisError(f"period = {period:g} s is out of range; allowed: above 0")
    if len(steps) == 0 or np.any(np.abs(steps - steps.mean()) > UNEVEN * abs(steps.mean())) or steps.mean() <= 0.0:
        raise DiagnosisError("the series is sampled unevenly; resample it at equal, increasing instants")
    if period < FEWEST_SAMPLES * steps.mean():
        raise DiagnosisError(
            f"period = {period:g} s holds {period / steps.mean():.1f} samples; allowed: at least {FEWEST_SAMPLES}"
        )
    periods = int((instants[-1] - instants[0]) / period * (1.0 + 1e-12))
    if periods < 1:
        raise DiagnosisError(f"the series lasts {instants[-1] - instants[0]:g} s, less than one period of {period:g} s")
    starts = instants[0] + period * np.arange(periods + 1)
    edges = np.searchsorted(instants, starts - 0.5 * steps.mean())
    largest = [np.max(np.abs(signal[first:last])) for first, last in pairwise(edges)]
    return np.column_stack([np.interp(starts[:-1], instants, signal), largest])
