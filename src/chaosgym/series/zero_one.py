r"""The 0-1 test on one sample a cycle: regular or chaotic, from a series alone.

The series drives p(n + 1) = p(n) + x(n) cos(c n), q(n + 1) = q(n) + x(n) sin(c n). Regular motion keeps (p, q)
bounded, chaos makes it wander like a random walk: K, the correlation of its mean square displacement with time, is
near 0 or near 1. The median over many c avoids resonances.

Three things make the test fail, and are dealt with or stated: chaos in bands (their means are removed first),
many samples a cycle (give one), sensor noise (it wanders too; ``two_step`` compares with the stated error instead).

References
----------
G. A. Gottwald, I. Melbourne, On the implementation of the 0-1 test for chaos, SIAM J. Appl. Dyn. Syst. 8 (2009).
"""

import math
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.arrays import Array
from chaosgym.series.stroboscopic import as_samples, subtract_bands

MAX_SAMPLES = 1000
"""Samples used at most, the last ones of the series."""

FREQUENCIES = 100
"""Values of c."""

AT_ONCE = 20
"""Walks that are made at once: their arrays stay in the processor's cache."""


def zero_one_statistic(series: ArrayLike, *, remove_bands: bool = True) -> float:
    """K of the 0-1 test: near 0 for regular motion, near 1 for chaos.

    Parameters
    ----------
    series : (cycles,)
        One sample a cycle of a settled motion; 500 and more give a sharp answer, below 100 it means little.
    remove_bands
        Remove the mean of each band of a motion that visits up to 24 bands in turn.

    Returns
    -------
    float
        Median of the correlation over 100 values of c between pi/5 and 4 pi/5; 0 for a series that repeats.

    Examples
    --------
    >>> x = [0.3]
    >>> for _ in range(1999):
    ...     x.append(4.0 * x[-1] * (1.0 - x[-1]))
    >>> round(chaosgym.series.zero_one_statistic(x), 1)
    1.0
    """
    x = as_samples(series)[-MAX_SAMPLES:, 0]
    rounding = 1e-9 * float(np.max(np.abs(x)))
    x = subtract_bands(x)[0] if remove_bands else x - x.mean()
    spread = float(np.std(x))
    if spread <= rounding:
        return 0.0
    x = x / spread
    n = len(x)
    lags = max(4, n // 10)
    c, turns = _directions()
    groups = (turns[i : i + AT_ONCE, :n] for i in range(0, FREQUENCIES, AT_ONCE))
    walks = (np.cumsum(x * group, axis=1) for group in groups)
    displacement = np.concatenate([_mean_square_displacement(walk, lags) for walk in walks])
    steps = np.arange(1, lags + 1)
    oscillation = (x.mean() ** 2) * (1.0 - _cosine(np.outer(c, steps))) / (1.0 - _cosine(c))[:, None]
    growth = displacement - oscillation
    growth = growth - growth.mean(axis=1, keepdims=True)
    time = steps - steps.mean()
    norms = np.sqrt(np.sum(growth**2, axis=1) * np.sum(time**2))
    return float(np.median(np.sum(growth * time, axis=1) / np.where(norms > 0.0, norms, 1.0)))


def _cosine(angle: Array) -> Array:
    """Cosine with equal bits on every processor: numpy's of complex numbers has no variants."""
    return np.asarray(np.exp(1j * angle).real)


@cache
def _directions() -> tuple[Array, NDArray[np.complex128]]:
    """Values of c, (walks,), and exp(i c n) for n = 1 ... ``MAX_SAMPLES``, (walks, samples)."""
    golden = (np.sqrt(5.0) - 1.0) / 2.0
    c = np.pi * (0.2 + 0.6 * ((np.arange(FREQUENCIES) * golden) % 1.0))
    return c, np.exp(1j * np.outer(c, np.arange(1, MAX_SAMPLES + 1)))


def _mean_square_displacement(walk: NDArray[np.complex128], lags: int) -> Array:
    """Mean of |z(j + n) - z(j)|^2 over j for the lags n = 1 ... lags, (walks, lags), by the convolution theorem."""
    walk = walk - walk.mean(axis=1, keepdims=True)
    total = walk.shape[1]
    kept = total - lags
    # j + n stays within the walk, so that its transform needs no zeros but for a length of small factors
    length = min(factor << max(0, math.ceil(math.log2(total / factor))) for factor in (1, 3, 5, 15))
    spectrum = np.fft.fft(walk, length)
    spectrum *= np.conj(np.fft.fft(walk[:, :kept], length))
    cross = np.fft.ifft(spectrum)[:, 1 : lags + 1].real
    squares = np.zeros((len(walk), total + 1))
    np.cumsum(walk.real**2 + walk.imag**2, axis=1, out=squares[:, 1:])
    later = squares[:, kept + 1 : kept + lags + 1] - squares[:, 1 : lags + 1]
    return np.asarray((later + squares[:, kept : kept + 1] - 2.0 * cross) / kept)
