r"""The spectrum of a response, sampled once a cycle: few lines or a broad band?

A quasiperiodic response has a few well pronounced lines, a chaotic one a broad band (thesis 2.3.1, 5.2.1). With a
window whose side lobes lie 92 dB below its main lobe (Blackman-Harris), lines leave nothing between them, so the
floor (median power over mean power) tells the two apart without counting peaks: far below 1e-4 for lines,
0.01 to 0.7 for a band. Of a measured record lines are fitted, at any frequency, and taken out (``without_lines``).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array

LOBE = 4
"""Half width of the main lobe of the window, in bins."""

_COEFFICIENTS = (0.35875, -0.48829, 0.14128, -0.01168)


@dataclass(frozen=True)
class Spectrum:
    """Power spectrum of a series of one sample a cycle.

    Attributes
    ----------
    frequency : (m,)
        In oscillations per cycle, 0 to 0.5.
    power : (m,)
        Variance per bin; sums to the variance of the series.
    floor
        Median over mean of ``power``: small for lines, near 0.69 for white noise.
    lines
        Number of lines that hold all the power but a thousandth, or but the noise if there is more of it.
    """

    frequency: Array
    power: Array
    floor: float
    lines: int


def _window(n: int) -> Array:
    angle = 2.0 * np.pi * np.arange(n) / n
    return np.asarray(sum(c * np.exp(1j * i * angle).real for i, c in enumerate(_COEFFICIENTS)))


def power_spectrum(series: Array, noise_variance: float = 0.0) -> Spectrum:
    """Power spectrum of a series (cycles,) whose band means have been removed; ``noise_variance`` is not a line."""
    n = len(series)
    window = _window(n)
    transform = np.fft.rfft(window * (series - series.mean()))
    power = np.asarray(np.abs(transform) ** 2 * (2.0 / (n * np.sum(window**2))), dtype=np.float64)
    frequency = np.arange(len(power)) / n
    total = float(power.sum())
    floor = float(np.median(power) / np.mean(power)) if total > 0.0 else 0.0
    return Spectrum(frequency, power, floor, _count_lines(power, total - max(1e-3 * total, 1.2 * noise_variance)))


def _count_lines(power: Array, wanted: float) -> int:
    left = power.copy()
    held, lines = 0.0, 0
    while held < wanted:
        peak = int(np.argmax(left))
        lobe = slice(max(0, peak - LOBE), peak + LOBE + 1)
        held += float(left[lobe].sum())
        left[lobe] = 0.0
        lines += 1
    return lines


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
            frequencies, rest = fitted(values, time, frequencies)
    return rest, len(frequencies)


def fitted(values: Array, time: NDArray[Any], frequencies: Array) -> tuple[Array, Array]:
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
