"""A few lines of the spectrum: a torus is their sum, and what they leave is the sensor's error."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PADDED = 16
"""Length of the transform, in lengths of the record."""

STEPS = 4
"""Gauss-Newton steps on the frequencies after each line."""


def without_lines(values: Array, most: int, enough: float) -> tuple[Array, int]:
    """Readings less a sum of sinusoids, and how many.

    Parameters
    ----------
    values : (cycles,)
        Readings.
    most
        Largest number of sinusoids.
    enough
        Standard deviation of the rest at which no further one is looked for.
    """
    size = len(values)
    time = np.arange(size) - 0.5 * (size - 1)
    window = np.hanning(size)
    rest: Array = values - values.mean()
    frequencies: Array = np.empty(0)
    while len(frequencies) < most and np.std(rest) > enough:
        power = np.abs(np.fft.rfft(rest * window, PADDED * size))
        power[: 2 * PADDED] = 0.0
        frequencies = np.asarray([*frequencies, float(np.argmax(power)) / (PADDED * size)])
        for _ in range(STEPS):
            frequencies, rest = _fitted(values, time, frequencies)
    return rest, len(frequencies)


def _fitted(values: Array, time: NDArray[Any], frequencies: Array) -> tuple[Array, Array]:
    """One Gauss-Newton step on the frequencies [1/cycle], and the rest before it."""
    angle = 2.0 * np.pi * np.outer(time, frequencies)
    cosine, sine = np.cos(angle), np.sin(angle)
    design = np.column_stack([np.ones(len(time)), cosine, sine])
    weights = np.linalg.lstsq(design, values, rcond=None)[0]
    count = len(frequencies)
    slope = 2.0 * np.pi * time[:, None] * (weights[1 + count :] * cosine - weights[1 : 1 + count] * sine)
    rest = values - design @ weights
    change = np.linalg.lstsq(np.column_stack([design, slope]), rest, rcond=None)[0][1 + 2 * count :]
    return frequencies + np.clip(change, -0.5 / len(time), 0.5 / len(time)), rest
