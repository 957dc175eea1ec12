"""Instants of the samples of a recording: from a rate, or from stamps without their rounding, with gaps."""

import math
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError
from chaosgym.recordings.columns import choose_time
from chaosgym.recordings.read import Recording

LONGEST_GAP, UNEVEN = 1.5, 0.2
"""Steps, in mean steps, from which samples are missing, and the deviation that even sampling may have."""


class Sampling(NamedTuple):
    """Instants [s] of the samples, the step between them, and gaps in words."""

    time: Array
    step: float
    gaps: tuple[str, ...]


def sampling(recording: Recording, size: int, rate_hz: float | None = None) -> Sampling:
    """Instants of the samples, from the given rate, the file's own, or its time column.

    Parameters
    ----------
    recording
        What was read.
    size
        Number of samples.
    rate_hz
        Sampling rate [Hz], if it is known.

    Raises
    ------
    DiagnosisError
        If there is neither, or the stamps fall, or their steps differ by more than rounding.
    """
    stamps = None if rate_hz is not None else choose_time(recording, told=recording.rate_hz is not None)
    rate = rate_hz if rate_hz is not None else recording.rate_hz
    if rate is not None and stamps is None:
        if not (math.isfinite(rate) and rate > 0.0):
            raise DiagnosisError(f"rate = {rate:g} Hz is out of range; allowed: above 0")
        return Sampling(np.arange(size) / rate, 1.0 / rate, ())
    if stamps is None:
        raise DiagnosisError(
            f"{recording.source} has no time column; use --rate-hz, or name the time column 'time [s]'"
        )
    return even_sampling(stamps.values[:size], recording)


def even_sampling(stamps: Array, recording: Recording) -> Sampling:
    """Instants without the rounding of their stamps; gaps are kept.

    Raises
    ------
    DiagnosisError
        If the stamps fall, or their steps differ by more than rounding; names the line.
    """
    steps = np.diff(stamps)
    falling = np.flatnonzero(~(steps >= 0.0))
    if len(steps) < 2 or len(falling):
        where = recording.where(int(falling[0]) + 1) if len(falling) else recording.where(0)
        raise DiagnosisError(f"{recording.source}, {where}: time does not rise; allowed: one series in increasing time")
    rounding = _rounding(stamps)
    typical = float(np.median(steps))
    typical = float(np.mean(steps[steps <= LONGEST_GAP * typical + 2.0 * rounding]))
    if typical <= 0.0:
        raise DiagnosisError(f"{recording.source}: the time stamps are too coarse to tell samples apart; use --rate-hz")
    gap = steps > LONGEST_GAP * typical + 1.01 * rounding
    odd = np.flatnonzero((np.abs(steps - typical) > UNEVEN * typical + 1.01 * rounding) & ~gap)
    if len(odd) or gap.mean() > 0.1:
        first = int(odd[0] if len(odd) else np.flatnonzero(gap)[0])
        raise DiagnosisError(
            f"{recording.source}, {recording.where(first + 1)}: sampled unevenly, a step of {steps[first]:.4g} s where "
            f"{typical:.4g} s are usual; resample at equal steps"
        )
    counted = np.where(gap, np.round(steps / typical), 1.0)
    order = np.concatenate([[0.0], np.cumsum(counted)])
    step = float((stamps[-1] - stamps[0]) / order[-1])
    told = tuple(
        f"{recording.where(int(place) + 1)}: a gap of {steps[place]:.4g} s" for place in np.flatnonzero(gap)[:5]
    )
    return Sampling(stamps[0] + order * step, step, told)


def _rounding(stamps: Array) -> float:
    """Last decimal place of the stamps [s]; 0 if they have more than twelve."""
    for decimals in range(13):
        if np.max(np.abs(np.round(stamps, decimals) - stamps)) <= 1e-9 * 10.0**-decimals + 4e-16 * abs(stamps[-1]):
            return float(10.0**-decimals)
    return 0.0
