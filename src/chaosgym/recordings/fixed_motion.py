r"""Fixed motions that may account for readings: a long pattern, a pattern with a trend, a line, a closed curve.

None of them is chaos, and a map forecasts all of them: it finds earlier copies of the pattern, or the last turn of the
line. So each is asked for before a map is believed.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.series.noise import NORMAL, RANDOM, class_residual, correlation, predictability
from chaosgym.series.spectrum import STEPS

THRICE = 3
"""How often a pattern must be seen at least."""

REPEATED = 36
"""Cycles at least that a long pattern forecasts: as many as twelve of period three."""

MOST_READINGS = 3000
"""Readings, the last ones, in which long patterns are looked for."""

BETTER = 0.5
"""Share of the variance around a shorter pattern that a long one may leave: less than by chance among a thousand."""

TREND_GAIN, TREND_SEEN = 0.8, 12
"""Share of the variance around a pattern that its trend may leave, and how often the pattern must be seen."""

PATTERNS, FEWEST, TURNS = 8, 100, 5.0
"""Longest pattern under a line, fewest cycles and fewest turns of it in them: a slower one may be a random walk."""

FUNDAMENTAL, HARMONICS = 0.4, 4
"""Share of the variance around its pattern that one sinusoid must hold, and how many of its multiples are fitted."""

LINE_REST, PURE = 0.4, 0.01
"""Share of the same variance that a line may leave at random, and that the multiples of a pure one hold at most."""

CURVE_REST, JUMPS, APART = 0.05, 8, 12
"""Share that a curve of any shape may leave, at how many places it may jump, and how many cycles neighbours on it are
apart at least: nearer ones are alike in slow noise too."""

FAR_APART = 6.0
"""Robust standard deviations by which neighbours on a curve differ where it jumps."""

FRACTIONS, READINGS_OF_ONE = 4, 8
"""A line that is a fraction of so many cycles, or of so many patterns, is a pattern itself. So it is of more cycles
where their square is less than the readings over the latter: one line in fifty lies there by chance."""

MULTIPLES = 24.0
"""Chi-squared of the multiples of a line from which they are no chance."""


def fractions(size: int) -> int:
    """Cycles of which a line is no fraction by chance in a record of so many."""
    return max(FRACTIONS, math.isqrt(size // READINGS_OF_ONE))


def pattern_variances(values: Array, longest: int) -> Array:
    """Variance around patterns of 1 to ``longest`` cycles, without bias, (longest,)."""
    size = len(values)
    return np.array([np.sum(class_residual(values, k) ** 2) / (size - k) for k in range(1, longest + 1)])


def long_pattern(values: Array, least: float, floor: float) -> int | None:
    """Period of a pattern of up to a third of the readings (cycles,) that leaves half of ``least``; None without one.

    Parameters
    ----------
    values
        Readings.
    least
        Variance around the best of the shorter patterns.
    floor
        Standard deviation that does not count.
    """
    values = values[-MOST_READINGS:]
    size = len(values)
    longest = min(size // THRICE, size - REPEATED)
    if longest < 2:
        return None
    variances = pattern_variances(values, longest)
    freedom = size - np.arange(1, longest + 1)
    allowed = variances.min() * (1.0 + 3.0 * np.sqrt(2.0 / freedom)) + floor**2
    period = int(np.flatnonzero(variances <= allowed)[0]) + 1
    return period if variances[period - 1] < BETTER * least else None


def without_trend(values: Array, period: int) -> tuple[Array, float]:
    """Readings (cycles,) whose pattern grows or shrinks, with the pattern that they have midway; and its growth.

    The growth is the change of the pattern's standard deviation over the record as a share of it; 0 without one.
    """
    size = len(values)
    if period < 2 or size < TREND_SEEN * period:
        return values, 0.0
    phase = np.arange(size) % period
    time = (np.arange(size) - 0.5 * (size - 1)) / size
    residual, elapsed = class_residual(values, period), class_residual(time, period)
    slopes = np.bincount(phase, elapsed * residual) / np.bincount(phase, elapsed**2)
    steady = values - slopes[phase] * time
    before, after = (float(np.sum(one**2)) for one in (residual, class_residual(steady, period)))
    if after / (size - 2 * period) > TREND_GAIN * before / (size - period):
        return values, 0.0
    pattern = steady[:period] - class_residual(steady, period)[:period]
    pattern = pattern - pattern.mean()
    growth = float(np.sum(slopes * pattern) / max(float(np.sum(pattern**2)), 1e-300))
    return steady, growth


@dataclass(frozen=True)
class Line:
    """A line on a pattern, or a closed curve that is run through at a constant rate.

    Attributes
    ----------
    period
        Cycles of the pattern beneath it.
    cycles
        Cycles in which it turns once.
    share
        Its share of the variance of the readings.
    rest
        Standard deviation that it leaves.
    pure
        Whether it is a sinusoid.
    alone
        Whether none of its multiples is seen at all, as of what is added from outside.
    """

    period: int
    cycles: float
    share: float
    rest: float
    pure: bool
    alone: bool


def line_of(values: Array) -> Line | None:
    """The one line that accounts for what readings (cycles,) do about a pattern of up to 8 cycles; None without one."""
    values = values[-MOST_READINGS:]
    size = len(values)
    if size < FEWEST or np.ptp(values) == 0.0:
        return None
    for period in range(1, PATTERNS + 1):
        residual = class_residual(values, period)
        whole = float(np.var(residual))
        if whole <= (1e-9 * float(np.max(np.abs(values)))) ** 2:
            return None
        turns = _rate(residual)
        first = float(np.var(_without_harmonics(residual, turns, 1)[1]))
        if first > (1.0 - FUNDAMENTAL) * whole or not _is_own(turns, period, size):
            continue
        turns, rest = _without_harmonics(residual, turns, HARMONICS)
        multiples, by_chance = first - float(np.var(rest)), float(np.var(rest)) / size
        pure = multiples < PURE * whole + 4.0 * HARMONICS * by_chance
        if not pure and not _is_own(turns, period, size, 2 * HARMONICS + 1):
            continue  # so many harmonics make any pattern of so many cycles
        for rate, left, share in ((turns, rest, LINE_REST), (*_curve(residual, turns), CURVE_REST)):
            if np.var(left) < share * whole and is_random(left):
                held = (whole - float(np.var(left))) / float(np.var(values))
                alone = multiples < MULTIPLES * by_chance
                return Line(period, 1.0 / rate, held, float(np.std(left)), pure, alone)
    return None


def is_random(rest: Array) -> bool:
    """Whether no reading of a rest (cycles,) can be told from those before it."""
    return max(predictability(rest, rest), correlation(rest)) < RANDOM


def _rate(residual: Array) -> float:
    """Turns a cycle of the strongest line."""
    size = len(residual)
    window = np.hanning(size)
    power = np.abs(np.fft.rfft((residual - residual.mean()) * window, 16 * size))
    power[:32] = 0.0
    return float(np.argmax(power)) / (16 * size)


def _is_own(turns: float, period: int, size: int, most: int = FRACTIONS) -> bool:
    """Whether a rate is fast enough to be sure of, and no small fraction of a cycle or of the pattern beneath."""
    most = max(most, fractions(size))
    whole = {*range(1, most + 1), *(period * k for k in range(1, FRACTIONS + 1))}
    return turns * size >= TURNS and all(abs(turns * k - round(turns * k)) * size > 0.5 * k for k in whole)


def _without_harmonics(residual: Array, turns: float, harmonics: int) -> tuple[float, Array]:
    """(turns a cycle, rest) of a line and its multiples by least squares, with Gauss-Newton steps on the rate."""
    time = np.arange(len(residual)) - 0.5 * (len(residual) - 1)
    multiples = np.arange(1, harmonics + 1)
    for _ in range(STEPS):
        angle = 2.0 * np.pi * turns * np.outer(time, multiples)
        design = np.column_stack([np.ones(len(time)), np.cos(angle), np.sin(angle)])
        weights = np.linalg.lstsq(design, residual, rcond=None)[0]
        rest = residual - design @ weights
        slope = (
            2.0
            * np.pi
            * time
            * (
                np.cos(angle) @ (multiples * weights[1 + harmonics :])
                - np.sin(angle) @ (multiples * weights[1 : 1 + harmonics])
            )
        )
        slope -= design @ np.linalg.lstsq(design, slope, rcond=None)[0]
        turns += float(np.clip(slope @ rest / max(float(slope @ slope), 1e-300), -0.5 / len(time), 0.5 / len(time)))
    return turns, rest


def _curve(residual: Array, turns: float) -> tuple[float, Array]:
    """(turns a cycle, rest) of a closed curve of any shape that is run through near a rate; all is rest without one."""
    cycles = np.arange(len(residual))

    def order(rate: float) -> NDArray[np.intp]:
        return np.argsort(rate * cycles % 1.0, kind="stable")

    best = turns
    for reach in (0.5, 0.01):
        near = best + np.linspace(-reach, reach, 101) / len(residual)
        best = min(near.tolist(), key=lambda rate: float(np.sum(np.abs(np.diff(residual[order(rate)])))))
    along = order(best)
    apart = np.diff(residual[along])
    jumps = np.abs(apart) > FAR_APART * NORMAL * float(np.median(np.abs(apart)))
    if jumps.sum() > JUMPS or np.median(np.abs(np.diff(along))) < APART:
        return turns, residual
    middle = (apart[:-1] - apart[1:]) / math.sqrt(6.0)
    middle[jumps[:-1] | jumps[1:]] = 0.0
    rest = np.empty_like(residual)
    rest[along] = np.concatenate([[0.0], middle, [0.0]])
    spread = NORMAL * float(np.median(np.abs(residual - np.median(residual))))
    return (best, rest) if np.var(rest) < CURVE_REST * spread**2 else (turns, residual)
