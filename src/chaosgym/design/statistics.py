r"""Statistics of a force that never repeats, and how many cycles they take (thesis 5.4.1, 5.4.3).

Running mean and deviation over the first n cycles

    m(n) = sum F_i / n,    s(n)^2 = sum (F_i - m(n))^2 / n

have converged when they stay in a band around their final values for the second half of the record. The band of the
deviation is what 80 cycles give for a normal distribution: that is where the thesis reads off convergence.

Before that, the number of cycles needed follows from the standard errors of the two, with the integrated
autocorrelation time of the record, because successive cycles of a chaotic response are not independent.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.arrays import Array
from chaosgym.errors import DesignError
from chaosgym.plain import Result

MIN_CYCLES = 16
"""Fewest cycles of any statistic."""

MEAN_BAND, DEVIATION_BAND = 0.02, 0.15
"""Bands of the running mean and deviation, as shares of their final values; 0.15 is 1.96 / sqrt(2 * 80), rounded."""

COARSE_MEAN_BAND, COARSE_DEVIATION_BAND = 0.05, 0.30
"""Bands that a measurement must reach at least: half of the 10 % change of force that matters (thesis 5.5.2)."""

CONFIDENCE_FACTOR = 1.96
"""Standard errors in a two-sided 95 % interval."""

MOST_LEVELS = 16
"""Values that repeat exactly up to which each is a mode of its own."""

SAME_FORCE = 1e-4
"""Spread, as a share of the largest force, below which all forces are one."""

MODE_SIGNIFICANCE = 3.0
"""Standard errors of the estimated density by which a mode must stand out."""


def as_forces(forces: ArrayLike, minimum: int = 1) -> Array:
    """Return forces as (n,).

    Raises
    ------
    DesignError
        If there are fewer than ``minimum``, or values that are negative or not finite.

    Examples
    --------
    >>> from chaosgym.design.statistics import as_forces
    >>> as_forces([10, 20])
    array([10., 20.])
    """
    values = np.asarray(forces, dtype=float)
    if values.ndim != 1:
        raise DesignError(f"forces have shape {values.shape}; allowed: (cycles,)")
    bad = np.flatnonzero(~(np.isfinite(values) & (values >= 0.0)))
    if len(bad):
        raise DesignError(
            f"force {values[bad[0]]:g} N in cycle {bad[0] + 1} is out of range; allowed: finite, 0 or more"
        )
    if len(values) < minimum:
        raise DesignError(f"{len(values)} cycles are too few; needed: {minimum} or more")
    return values


@dataclass(frozen=True)
class RunningStatistics:
    """Mean and standard deviation of the first n cycles, in the unit of the force; all arrays (cycles,)."""

    cycles: NDArray[np.int64]
    mean: Array
    deviation: Array


def running_statistics(forces: ArrayLike) -> RunningStatistics:
    """Mean and standard deviation after each cycle (thesis figure 5.14).

    Examples
    --------
    >>> from chaosgym.design.statistics import running_statistics
    >>> running_statistics([1.0, 3.0, 5.0]).mean
    array([1., 2., 3.])
    """
    values = as_forces(forces, 1)
    count = np.arange(1, len(values) + 1)
    shift = float(np.mean(values))
    centred = values - shift
    mean = np.cumsum(centred) / count
    variance = np.maximum(np.cumsum(centred**2) / count - mean**2, 0.0)
    return RunningStatistics(count, mean + shift, np.sqrt(variance))


@dataclass(frozen=True)
class Convergence(Result):
    """How long a record must be.

    Attributes
    ----------
    cycles
        Cycles after which running mean and deviation stay in their bands.
    recorded
        Cycles of the record.
    needed
        Cycles that the standard errors ask for.
    converged
        Whether ``cycles`` leaves half the record as proof, and the record is as long as ``needed``.
    """

    shows = "cycles recorded needed converged"

    cycles: int
    recorded: int
    needed: int

    @property
    def converged(self) -> bool:
        """Whether the statistics of the record may be relied on."""
        return self.recorded >= max(2 * self.cycles, self.needed)


def convergence(forces: ArrayLike) -> Convergence:
    """Tell after how many cycles the statistics of a record have converged.

    Examples
    --------
    >>> from chaosgym.design.statistics import convergence
    >>> convergence([10.0, 12.0] * 100)
    Convergence(cycles=4, recorded=200, needed=80)
    """
    values = as_forces(forces, 1)
    running = running_statistics(values)
    mean, deviation = running.mean[-1], running.deviation[-1]
    # a spread far below the mean's own band needs no precision of its own
    allowed = max(DEVIATION_BAND * deviation, 0.1 * MEAN_BAND * mean)
    outside = (np.abs(running.mean - mean) > MEAN_BAND * mean) | (np.abs(running.deviation - deviation) > allowed)
    last = np.flatnonzero(outside)
    return Convergence(int(last[-1]) + 2 if len(last) else 1, len(values), cycles_needed(values))


def cycles_needed(forces: ArrayLike, mean_band: float = MEAN_BAND, deviation_band: float = DEVIATION_BAND) -> int:
    r"""Cycles that mean and deviation within their bands take, at 95 % confidence, by their standard errors.

    n >= tau (1.96 s / (b m))^2 for the mean and n >= tau (1.96 / b)^2 (k - 1) / 4 for the deviation, where tau is the
    integrated autocorrelation time and k the kurtosis.

    Examples
    --------
    >>> from chaosgym.design.statistics import cycles_needed
    >>> cycles_needed(np.random.default_rng(0).normal(50.0, 5.0, 400))
    99
    """
    values = as_forces(forces, 1)
    mean, deviation = float(np.mean(values)), float(np.std(values))
    if deviation <= 0.1 * mean_band * mean:
        return MIN_CYCLES
    centred = (values - mean) / deviation
    of_mean = correlation_time(centred) * (CONFIDENCE_FACTOR * deviation / (mean_band * mean)) ** 2
    kurtosis = float(np.mean(centred**4))
    of_deviation = correlation_time(centred**2) * (CONFIDENCE_FACTOR / deviation_band) ** 2 * (kurtosis - 1.0) / 4.0
    return max(MIN_CYCLES, math.ceil(of_mean), math.ceil(of_deviation))


def correlation_time(values: ArrayLike) -> float:
    """Integrated autocorrelation time [cycles], 1 for independent values, by Geyer's initial positive sequence.

    References
    ----------
    C. J. Geyer, Practical Markov chain Monte Carlo, Statistical Science 7 (1992), 473-483.

    Examples
    --------
    >>> from chaosgym.design.statistics import correlation_time
    >>> round(correlation_time(np.random.default_rng(0).normal(size=4000)), 1)
    1.0
    """
    series = np.asarray(values, dtype=float)
    centred = series - np.mean(series)
    size = len(centred)
    spectrum = np.fft.rfft(centred, 2 * size)
    covariance = np.fft.irfft(np.abs(spectrum) ** 2)[:size] / size
    if covariance[0] <= 0.0:
        return 1.0
    correlation = covariance / covariance[0]
    pairs = correlation[0 : size - 1 : 2] + correlation[1::2]
    negative = np.flatnonzero(pairs <= 0.0)
    kept = pairs[: negative[0]] if len(negative) else pairs
    return float(max(1.0, 2.0 * np.sum(kept) - 1.0))


def require_enough(forces: ArrayLike) -> Array:
    """Return the forces if they suffice for a statistic within the coarse bands.

    Raises
    ------
    DesignError
        If they don't; says how many cycles are needed.

    Examples
    --------
    >>> from chaosgym.design.statistics import require_enough
    >>> require_enough([10.0, 12.0] * 100).shape
    (200,)
    """
    values = as_forces(forces)
    needed = cycles_needed(values, COARSE_MEAN_BAND, COARSE_DEVIATION_BAND)
    if len(values) < needed:
        raise DesignError(
            f"{len(values)} cycles are too few for a statistic of these forces (mean {np.mean(values):.3g} N, standard "
            f"deviation {np.std(values):.3g} N); needed: {needed} or more"
        )
    return values


@dataclass(frozen=True)
class Histogram:
    """Distribution of a force.

    Attributes
    ----------
    edges : (bins + 1,)
        [N].
    count : (bins,) int
        Cycles.
    modes : (modes,)
        Forces [N] at which the density has a significant maximum, ascending.
    """

    edges: Array
    count: NDArray[np.int64]
    modes: Array


def histogram(forces: ArrayLike, bins: int | None = None) -> Histogram:
    """Histogram of peak forces, and its modes (thesis figure 5.7).

    Parameters
    ----------
    forces : (cycles,)
        [N].
    bins
        Number of bins; by the rule of Freedman and Diaconis if None, at most 60.

    Notes
    -----
    A mode is a maximum of a Gaussian kernel density that stands out of its surroundings by three standard errors,
    sqrt(f / (2 sqrt(pi) n h)). The bandwidth h is half of Silverman's, which is made for one normal mode and would
    smooth several into one. Values that repeat exactly, as those of a periodic response, are modes each.

    Examples
    --------
    >>> from chaosgym.design.statistics import histogram
    >>> histogram([10.0] * 90 + [20.0] * 10, bins=2).count
    array([90, 10])
    """
    values = as_forces(forces)
    low, high = float(np.min(values)), float(np.max(values))
    if high - low <= SAME_FORCE * high:
        margin = 0.5e-2 * high or 0.5
        return Histogram(
            np.array([low - margin, high + margin]), np.array([len(values)]), np.array([float(np.mean(values))])
        )
    if bins is None:
        width = 2.0 * float(np.subtract(*np.percentile(values, [75, 25]))) / len(values) ** (1.0 / 3.0)
        bins = int(np.clip(np.ceil((high - low) / width) if width > 0.0 else 60, 5, 60))
    count, edges = np.histogram(values, bins=bins)
    return Histogram(edges, count, _modes(values))


def _modes(values: Array) -> Array:
    from scipy.signal import find_peaks  # slow to import, and few questions need it

    levels = np.unique(np.round(values / np.max(values), 6))
    if len(levels) <= min(MOST_LEVELS, len(values) // 4):
        return np.asarray(levels * np.max(values))
    bandwidth = 0.5 * 1.06 * float(np.std(values)) * len(values) ** -0.2
    grid = np.linspace(np.min(values) - 3.0 * bandwidth, np.max(values) + 3.0 * bandwidth, 512)
    density = np.zeros_like(grid)
    for chunk in np.array_split(values, max(1, len(values) // 2000)):
        density += np.exp(-0.5 * ((grid[:, None] - chunk) / bandwidth) ** 2).sum(axis=1)
    density /= len(values) * bandwidth * math.sqrt(2.0 * math.pi)
    error = np.sqrt(density / (2.0 * math.sqrt(math.pi) * len(values) * bandwidth))
    places, found = find_peaks(density, prominence=0.0)
    significant = found["prominences"] > MODE_SIGNIFICANCE * error[places]
    return np.asarray(grid[places[significant]])
