"""Smooth functions of an angle that repeat after a revolution, from their values at equidistant angles.

Their Fourier series is their trigonometric interpolation: with enough angles it is exact to rounding between them too,
and its derivatives are those of the functions (Trefethen, Spectral Methods in MATLAB, 2000, chapter 3).
"""

import numpy as np

from chaosgym.arrays import Array


def derivatives(values: Array) -> tuple[Array, Array]:
    """First and second derivative by the angle of values (B, ...) on a uniform grid of a revolution."""
    count = len(values)
    k = np.arange(count // 2 + 1).reshape(-1, *[1] * (values.ndim - 1))
    series = np.fft.rfft(values, axis=0)
    first = 1j * k * series
    if count % 2 == 0:
        first[-1] = 0.0
    return np.fft.irfft(first, count, axis=0), np.fft.irfft(-(k**2) * series, count, axis=0)


def between(values: Array, angle: Array) -> Array:
    """Values (A, ...) at angles (A,) [rad], of values (B, ...) at B equidistant angles from 0 on.

    Examples
    --------
    >>> from chaosgym.machines.periodic import between
    >>> between(np.cos(2 * np.pi * np.arange(5) / 5), np.array([0.3])) - np.cos(0.3) < 1e-15
    array([ True])
    """
    count = len(values)
    series = np.fft.rfft(values.reshape(count, -1), axis=0) * (2.0 / count)
    series[0] *= 0.5
    if count % 2 == 0:
        series[-1] *= 0.5
    turns = np.vander(np.exp(1j * angle), len(series), increasing=True)
    found = turns.real @ series.real - turns.imag @ series.imag
    return np.asarray(found.reshape(len(angle), *values.shape[1:]))
