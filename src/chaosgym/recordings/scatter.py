"""Scatter of readings around their own repetition: the pattern that they follow, its trend, and what it leaves."""

import math
from dataclasses import dataclass

import numpy as np

from chaosgym.arrays import Array
from chaosgym.recordings.fixed_motion import (
    FRACTIONS,
    REPEATED,
    THRICE,
    fractions,
    long_pattern,
    pattern_variances,
    without_trend,
)
from chaosgym.series.noise import (
    RANDOM,
    REPEATS,
    class_residual,
    correlation,
    dominant_period,
    predictability,
    without_drift,
)
from chaosgym.series.spectrum import without_lines

PATTERN, LONGEST_PATTERN, SEEN = 2.0, 32, 12
"""Standard deviation of a pattern in those of the scatter around it, its longest period, and how often it is seen."""

FAINT, SURE = 4, 4.0
"""Longest period of a pattern beside small random scatter, and its standard deviation in those of its own error."""

LONG_PATTERN = 3.0
"""Standard deviation of readings in those of what a pattern leaves that is seen three to eleven times."""

ONE_LINE = 0.9
"""Share of the variance in one line of the spectrum from which it may be a hum of the mains."""

HUMMED_PATTERN = 16
"""Longest pattern under a hum: longer ones come near to any torus."""


@dataclass(frozen=True)
class Scatter:
    """What the readings of a stretch do about their repetition.

    ``readings`` are less their drift and the trend of their pattern, ``level`` less their drift only.
    """

    readings: Array
    level: Array
    period: int
    drift: float
    growth: float
    sigma: float
    mean: float
    forecast: float

    @property
    def relative(self) -> float:
        """Standard deviation as a share of the mean reading."""
        return self.sigma / self.mean if self.mean else 0.0

    @property
    def residual(self) -> Array:
        """Readings less their pattern, (cycles,)."""
        return class_residual(self.readings, self.period)

    @property
    def random(self) -> bool:
        """Whether a reading can't be told from those before it."""
        return self.forecast < RANDOM

    @property
    def has_pattern(self) -> bool:
        """Whether a period above one stands out of the scatter, and is the same in both halves."""
        size, k = len(self.readings), self.period
        often = k <= LONGEST_PATTERN and size >= SEEN * k
        return k > 1 and (often or self._has_long_pattern) and self._keeps_pattern(PATTERN)

    @property
    def has_faint_pattern(self) -> bool:
        """Whether a period of two to four is sure beside random scatter, in both halves, however small it is."""
        size, k = len(self.readings), self.period
        sure = SURE * math.sqrt(k / (size // (2 * k) * k)) if size >= SEEN * k else math.inf
        return 1 < k <= FAINT and self.random and self._keeps_pattern(sure)

    def _keeps_pattern(self, least: float) -> bool:
        """Whether both halves have the same pattern, of so many standard deviations of the scatter at least."""
        k, half = self.period, len(self.readings) // (2 * self.period) * self.period
        halves = [part.reshape(-1, k).mean(axis=0) for part in (self.readings[:half], self.readings[half : 2 * half])]
        patterns = [pattern - pattern.mean() for pattern in halves]
        if self.may_be_hum:
            return False
        stands_out = min(float(np.std(pattern)) for pattern in patterns) >= least * self.sigma
        apart = max(0.5, 4.0 * math.sqrt(2.0 * k / half)) * self.sigma
        return stands_out and float(np.max(np.abs(patterns[0] - patterns[1]))) < apart

    @property
    def _has_long_pattern(self) -> bool:
        """Whether a pattern that is seen a few times forecasts many cycles, to a third of its standard deviation."""
        size, k = len(self.readings), self.period
        return (
            self.random
            and size >= max(THRICE * k, k + REPEATED)
            and float(np.std(self.readings)) > LONG_PATTERN * self.sigma
        )

    @property
    def may_be_hum(self) -> bool:
        """Whether its pattern is as well a much shorter one with one line of the spectrum on it.

        A pattern that is seen a few times must be twice as long, any other by more than a line is a fraction of.
        """
        pattern, size = (self.readings - self.residual)[: self.period], len(self.readings)
        few = size < SEEN * self.period and self.period > FRACTIONS
        power, line = np.abs(np.fft.rfft(pattern)) ** 2, np.arange(self.period // 2 + 1)
        for short in range(1, self.period // (2 if few else fractions(size) + 1) + 1):
            rest = power[line % (self.period // short) != 0] if self.period % short == 0 else np.zeros(1)
            if float(rest.max()) > ONE_LINE * float(rest.sum()):
                return True
        return False

    def evidence(self) -> dict[str, float]:
        """Figures for JSON."""
        return {"scatter_sigma": self.sigma, "scatter_share": self.relative, "predictability": self.forecast}


def scatter_of(readings: Array, floor: float) -> Scatter:
    """Scatter of readings around their own repetition; differences below ``floor`` do not count."""
    size = len(readings)
    level, drift = without_drift(readings, dominant_period(readings, floor))
    longest = max(1, size // REPEATS)
    variances = pattern_variances(level, min(64, longest))
    allowed = variances.min() * (1.0 + 3.0 * math.sqrt(2.0 / size)) + floor**2
    period = int(np.flatnonzero(variances <= allowed)[0]) + 1
    period = long_pattern(level, float(variances[period - 1]), floor) or period
    steady, growth = without_trend(level, period)
    residual = class_residual(steady, period)
    sigma = math.sqrt(float(np.sum(residual**2)) / (size - period))
    again = period if size >= SEEN * period else 1  # readings of a phase seen a few times are less their own mean
    forecast = max(predictability(steady, residual), correlation(residual, again))
    return Scatter(steady, level, period, drift, growth, sigma, float(np.mean(np.abs(readings))), forecast)


def left_by_hum(readings: Array) -> float:
    """Standard deviation that a pattern of 1 to 16 cycles and one sinusoid leave at least."""
    patterns = range(1, min(HUMMED_PATTERN, len(readings) // SEEN) + 1)
    residuals = (class_residual(readings, period) for period in patterns)
    return min(float(np.std(without_lines(residual, 1, 0.0)[0])) for residual in residuals)


def newton(force: float) -> str:
    """Force for people."""
    return f"{force:.3g} N"
