r"""Recurrence on the stroboscopic section, one sample of the motion a cycle.

A response has period k if the samples x(n), x(n + k), x(n + 2k), ... coincide. The residual of k is the largest half
range of these k classes; half ranges rather than differences of neighbours, because a torus comes back almost, and its
small misses add up. Values count from a physical zero (mid gap, no force), and their scale is their largest modulus.

A slow approach to a periodic motion does not repeat yet, but its distances |x(n + k) - x(n)| shrink steadily.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError
from chaosgym.series.noise import class_residual

MIN_CYCLES = 16
"""Fewest cycles that are judged at all."""

MAX_PERIOD = 64
"""Longest period that is looked for."""

MIN_REPEATS, NOISY_REPEATS = 3, 8
"""How often a period must be seen, and how often through the noise of a sensor."""

DECAY_BLOCKS = 8
"""Blocks of the window over which distances must shrink from each to the next."""

MAX_DECAY_PERIOD = 16
"""Longest period whose steady approach is looked for."""

STRAIGHTNESS = 0.8
"""Least squared correlation of the logarithms of the blocks with time: a sudden drop is no steady approach."""

DECAY_FACTOR = 4.0
"""How much they must shrink in all for the approach to count as periodic."""

MOST_BANDS, LEAST_IN_A_BAND = 24, 30
"""Bands that a series may visit in turn, and samples that each needs."""


@dataclass(frozen=True)
class Recurrence:
    """The period of a response, if it has one.

    Attributes
    ----------
    period
        Smallest period in the tail of the series, or None.
    residual
        Largest half range of its classes there, relative to the scale; of the best period if none is recurrent.
    settle_cycle
        First cycle from which the whole rest of the series repeats, or None.
    contraction
        Factor per cycle by which deviations from the periodic motion shrank before; None where that can't be seen.
    """

    period: int | None
    residual: float
    settle_cycle: int | None
    contraction: float | None


def as_samples(values: ArrayLike, *, minimum: int = MIN_CYCLES) -> Array:
    """Return values as (cycles, coordinates), or say what is wrong with them.

    Raises
    ------
    DiagnosisError
        If the array is neither 1-D nor 2-D, has fewer cycles than ``minimum``, or holds values that are not finite.
    """
    samples = np.asarray(values, dtype=float)
    if samples.ndim == 1:
        samples = samples[:, None]
    if samples.ndim != 2 or samples.shape[1] == 0:
        raise DiagnosisError(
            f"the series has shape {np.shape(values)}; allowed: (cycles,) or (cycles, coordinates), one row a cycle"
        )
    if len(samples) < minimum:
        raise DiagnosisError(f"the series has {len(samples)} cycles; allowed: {minimum} or more")
    bad = np.flatnonzero(~np.isfinite(samples).all(axis=1))
    if len(bad):
        raise DiagnosisError(f"the series has {len(bad)} cycles with values that are not finite, first at {bad[0]}")
    return samples


def scales(samples: Array) -> Array:
    """Largest modulus of each coordinate, (coordinates,); 1 for a coordinate that is zero throughout."""
    largest = np.max(np.abs(samples), axis=0)
    return np.where(largest > 0.0, largest, 1.0)


def class_residuals(samples: Array, max_period: int) -> Array:
    """Half range of the worst class for the periods 1 ... max_period, (max_period,)."""
    return np.array([_residual(samples, period) for period in range(1, max_period + 1)])


def _residual(samples: Array, period: int) -> float:
    """Half range of the worst class of a period."""
    return 0.5 * _widest(_classes(samples, period))


def _widest(classes: Array) -> float:
    """Largest range of a class over its repeats."""
    return float((np.maximum.reduce(classes) - np.minimum.reduce(classes)).max())


def irregularity(peaks: ArrayLike, max_period: int = MAX_DECAY_PERIOD) -> float:
    """Amplitude [N] by which peak forces (cycles,) do not repeat: half range of the worst class of the best period.

    A sensor whose largest error is smaller can tell the response from a periodic one; to any other it repeats.
    """
    samples = as_samples(peaks, minimum=MIN_REPEATS)
    return float(class_residuals(samples, min(max_period, len(samples) // MIN_REPEATS)).min())


def noisy_class_residuals(samples: Array, max_period: int) -> Array:
    """The same for samples with errors; see ``_noisy_residual``."""
    return np.array([_noisy_residual(samples, period) for period in range(1, max_period + 1)])


def _noisy_residual(samples: Array, period: int) -> float:
    """Scatter of the worst class of a period, in samples with errors.

    Errors are evenly spread over +-1, or normal with three deviations of 1. Half ranges of noise grow with the number
    of samples, so the scatter within classes counts: sqrt(3) standard deviations less two standard errors; a single
    sample may lie 1.5 away.
    """
    classes = _classes(samples, period)
    freedom = (len(classes) - 1) * period
    scatter = np.sqrt(3.0 * np.sum((classes - classes.mean(axis=0)) ** 2, axis=(0, 1)) / freedom)
    scatter /= 1.0 + np.sqrt(2.0 / freedom)
    return float(max(np.max(scatter), 0.5 * _widest(classes) / 1.5))


def _classes(samples: Array, period: int) -> Array:
    """The last whole periods of a series, (repeats, period, coordinates)."""
    repeats = len(samples) // period
    return samples[len(samples) - repeats * period :].reshape(repeats, period, -1)


def find_recurrence(
    scaled: Array, tolerance: ArrayLike, max_period: int = MAX_PERIOD, *, noisy: bool = False
) -> Recurrence:
    """Look for the smallest period in the second half of a series, and for where it begins.

    Parameters
    ----------
    scaled : (cycles, coordinates)
        Samples divided by their scale.
    tolerance : float or (coordinates,)
        Half range that still counts as repetition, in units of the scale.
    max_period
        Longest period tried; each must fit three times into the half.
    noisy
        The tolerance is the error of a sensor, which every sample has.
    """
    allowed = np.broadcast_to(np.asarray(tolerance, dtype=float), scaled.shape[1])
    units = scaled / allowed
    tail = units[len(units) // 2 :]
    longest = max(1, min(max_period, len(tail) // (NOISY_REPEATS if noisy else MIN_REPEATS)))
    worst = float(np.max(allowed))
    residual, residuals = _noisy_residual if noisy else _residual, list[float]()
    for candidate in range(1, longest + 1):
        residuals.append(residual(tail, candidate))
        if residuals[-1] <= 1.0:
            break
    else:
        return Recurrence(None, float(np.min(residuals)) * worst, None, None)
    period = _true_period(tail, candidate)
    deviation = deviations(units, period)
    beyond = np.flatnonzero(deviation > 2.0)
    settle = int(beyond[-1]) + 1 if len(beyond) else 0
    return Recurrence(period, residuals[period - 1] * worst, settle, _contraction(deviation, settle, period))


def _true_period(tail: Array, period: int) -> int:
    """The divisor of a period that the series still approaches steadily: an alternating decay repeats twice as well."""
    if period == 1:
        return 1
    decay = find_decay(tail, period // 2)
    return decay.period if decay is not None and decay.factor >= DECAY_FACTOR and period % decay.period == 0 else period


def deviations(samples: Array, period: int, repeats: int | None = None) -> Array:
    """Largest distance of each sample from the mean of its class in the last half, or last ``repeats``, (cycles,)."""
    n = len(samples)
    repeats = repeats or max(1, (n - n // 2) // period)
    reference = samples[n - repeats * period :].reshape(repeats, period, -1).mean(axis=0)
    phase = (np.arange(n) - (n - repeats * period)) % period
    return np.asarray(np.max(np.abs(samples - reference[phase]), axis=1))


def _contraction(deviation: Array, settle: int, period: int) -> float | None:
    """Factor per cycle by which deviations fell over the last five periods (ten cycles at least) before settling."""
    start = max(0, settle - max(10, 5 * period))
    stretch = deviation[start:settle]
    if len(stretch) < 5 or np.any(stretch <= 0.0):
        return None
    # sums in a fixed order: a library of linear algebra has another one on each processor
    time = np.arange(len(stretch)) - 0.5 * (len(stretch) - 1)
    slope = sum(t * math.log(size) for t, size in zip(time.tolist(), stretch.tolist(), strict=True))
    return math.exp(slope / float(np.sum(time**2)))


@dataclass(frozen=True)
class Decay:
    """A steady approach to a motion of period ``period``.

    ``factor``: how much distances shrank from the first eighth of the series to the last; ``contraction``: per cycle.
    """

    period: int
    factor: float
    contraction: float


def find_decay(scaled: Array, max_period: int = MAX_DECAY_PERIOD) -> Decay | None:
    """Return the steady approach to a periodic motion that a series shows, or None.

    The largest distance |x(n + k) - x(n)| of each of eight blocks must be smaller than that of the block before, and
    their logarithms must fall nearly in a line. Holds for slow real and complex multipliers alike, and for the slower
    than geometric approach at a bifurcation. The smallest k counts for which they shrink to a quarter, or else the
    smallest for which they shrink at all.
    """
    n = len(scaled)
    slow = None
    for k in range(1, min(max_period, MAX_DECAY_PERIOD, n // (2 * DECAY_BLOCKS)) + 1):
        distance = np.max(np.abs(scaled[k:] - scaled[:-k]), axis=1)
        length = len(distance) // DECAY_BLOCKS
        blocks = distance[len(distance) - DECAY_BLOCKS * length :].reshape(DECAY_BLOCKS, length).max(axis=1)
        if np.all(blocks[1:] < blocks[:-1]) and _straightness(np.log(np.maximum(blocks, 1e-300))) > STRAIGHTNESS:
            factor = float(blocks[0]) / max(float(blocks[-1]), 1e-300)
            decay = Decay(k, factor, factor ** (-1.0 / ((DECAY_BLOCKS - 1) * length)))
            if factor >= DECAY_FACTOR:
                return decay
            slow = slow or decay
    return slow


def _straightness(values: Array) -> float:
    """Squared correlation of values with their index."""
    return float(np.corrcoef(np.arange(len(values)), values)[0, 1] ** 2)


def subtract_bands(series: Array) -> tuple[Array, int]:
    """Remove the mean of each band of a series that visits k bands in turn; (what is left, k).

    k is the smallest number up to ``MOST_BANDS`` that leaves nearly the least variance. Without this step chaos in
    bands looks regular to the 0-1 test and to the spectrum, because the jumps between bands drown the rest.
    """
    n = len(series)
    best, variances = series - series.mean(), []
    candidates = range(1, max(1, min(MOST_BANDS, n // LEAST_IN_A_BAND)) + 1)
    for k in candidates:
        variances.append(float(np.sum(class_residual(series, k) ** 2)) / (n - k))
    least = min(variances)
    for k, variance in zip(candidates, variances, strict=True):
        if variance <= 1.1 * least:
            best = class_residual(series, k)
            return best, k
    return best, 1
