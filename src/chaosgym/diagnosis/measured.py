"""How is a measured response brought to one sample a cycle? Reading and checking of CSV files."""

import csv
import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.diagnosis.stroboscopic import MIN_CYCLES
from chaosgym.errors import DiagnosisError

Array = NDArray[np.float64]

JITTER = 0.01
"""Largest deviation of a sampling interval from the median that still counts as even."""

MIN_SAMPLES_PER_CYCLE = 4
"""Fewest samples a cycle of a time history whose peaks mean anything."""


@dataclass(frozen=True)
class CycleSamples:
    """A time history reduced to its cycles: ``peak`` (cycles,) largest value, ``section`` (cycles,) first value."""

    peak: Array
    section: Array


def read_peaks(path: str | Path) -> Array:
    """Peak force of each cycle from a CSV file of one column, (cycles,).

    Raises
    ------
    DiagnosisError
        If the file can't be read, has several columns, fewer than 16 rows, values that are no numbers or not finite,
        or one value throughout; names the file and the row.
    """
    peaks = _read(path, 1)[:, 0]
    _check_varies(peaks, path)
    return peaks


def read_series(path: str | Path, period_s: float) -> CycleSamples:
    """Cycles of a time history in a CSV file with the columns time [s] and value.

    Parameters
    ----------
    path
        File; a header line is allowed.
    period_s
        Duration of one operating cycle [s].

    Raises
    ------
    DiagnosisError
        As ``read_peaks``, and if the sampling is uneven or too coarse.
    """
    table = _read(path, 2)
    _check_varies(table[:, 1], path)
    return cycles_of(table[:, 0], table[:, 1], period_s)


def cycles_of(time: ArrayLike, values: ArrayLike, period_s: float) -> CycleSamples:
    """Reduce an evenly sampled time history to its whole cycles.

    Parameters
    ----------
    time, values : (samples,)
        Instants [s] and what was measured then.
    period_s
        Duration of one operating cycle [s].

    Raises
    ------
    DiagnosisError
        If the lengths differ, values are not finite, the sampling is uneven or coarser than four samples a cycle, or
        there are fewer than 16 cycles.
    """
    t, x = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    if not math.isfinite(period_s) or period_s <= 0.0:
        raise DiagnosisError(f"period_s = {period_s!r} s is out of range; allowed: above 0")
    if t.ndim != 1 or t.shape != x.shape or len(t) < 2:
        raise DiagnosisError(f"time has shape {t.shape} and values {x.shape}; allowed: two equal lengths of 2 or more")
    if not (np.isfinite(t).all() and np.isfinite(x).all()):
        row = int(np.flatnonzero(~(np.isfinite(t) & np.isfinite(x)))[0])
        raise DiagnosisError(f"sample {row} is not finite; allowed: finite times and values")
    intervals = np.diff(t)
    step = float(np.median(intervals))
    if step <= 0.0 or np.max(np.abs(intervals - step)) > JITTER * step:
        row = int(np.argmax(np.abs(intervals - step)))
        raise DiagnosisError(
            f"the series is sampled unevenly: {intervals[row]:.3g} s after sample {row}, but {step:.3g} s as a rule; "
            "allowed: equal intervals within 1 %"
        )
    per_cycle = period_s / step
    if per_cycle < MIN_SAMPLES_PER_CYCLE:
        raise DiagnosisError(f"{per_cycle:.2g} samples a cycle are too few; allowed: {MIN_SAMPLES_PER_CYCLE} or more")
    cycles = int((t[-1] - t[0] + (1.0 + 1e-6) * step) / period_s)
    if cycles < MIN_CYCLES:
        raise DiagnosisError(f"the series has {cycles} whole cycles; allowed: {MIN_CYCLES} or more")
    starts = t[0] + period_s * np.arange(cycles + 1)
    index = np.searchsorted(t, starts - 1e-6 * step)
    peak = np.array([x[a:b].max() for a, b in pairwise(index)])
    return CycleSamples(peak, np.interp(starts[:-1], t, x))


def _read(path: str | Path, columns: int) -> Array:
    try:
        with open(path, newline="") as file:
            rows = [row for row in csv.reader(file) if any(cell.strip() for cell in row)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise DiagnosisError(f"{path} can't be read: {error}") from error
    if rows and not _is_number(rows[0][0]):
        rows = rows[1:]
    values = np.empty((len(rows), columns))
    for number, row in enumerate(rows, start=1):
        if len(row) != columns:
            raise DiagnosisError(f"{path} has {len(row)} columns in data row {number}; allowed: {columns}")
        for k, cell in enumerate(row):
            if not _is_number(cell) or not math.isfinite(float(cell)):
                raise DiagnosisError(f"{path} has {cell.strip()!r} in data row {number}; allowed: finite numbers")
            values[number - 1, k] = float(cell)
    if len(values) < MIN_CYCLES:
        raise DiagnosisError(f"{path} has {len(values)} data rows; allowed: {MIN_CYCLES} or more")
    return values


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _check_varies(values: Array, path: str | Path) -> None:
    if np.ptp(values) == 0.0:
        raise DiagnosisError(
            f"{path} holds {values[0]:g} throughout: a dead sensor or contact; allowed: a response that varies"
        )
