"""What is seen in a record, beside its nature: patterns, lines, trends, steps, spikes, levels and bursts."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.recordings.fixed_motion import Line
from chaosgym.recordings.measured_verdict import Feature
from chaosgym.recordings.scatter import Scatter, newton
from chaosgym.series.noise import NORMAL, equal_interval

MAINS = (50.0, 60.0)
"""Frequencies of supplies [Hz]."""

MULTIPLES = 3
"""Multiples of the mains and of the sampling whose aliases are compared with a line."""

LEVELS_APART, LEAST_STAY = 8.0, 0.05
"""Distance of two levels in standard deviations around them, and the share of the cycles that each holds at least."""

BURSTS, STRETCH = 5.0, 20
"""Correlation of the sizes of successive scatter, times the root of the cycles, from which it comes in bursts, and the
cycles over which their standard deviation is told."""

NEAR, CURVED, SLOW, EXPLAINED = 1.2, 4, 0.3, 0.95
"""Where deviations count as small, in their median; terms of the map there; growth a cycle [1] up to which they lead to
bursts; and share of the next readings that the map accounts for."""

FAR, QUIET, FEWEST_QUIET = 2.5, 8, 4
"""How far bursts go, as a multiple of small deviations; cycles of a quiet stretch, and fewest of them."""


class Sampled(NamedTuple):
    """How a series was sampled: samples a cycle, and cycles a second."""

    samples: float
    cycles_per_second: float


def describe(
    values: Array,
    found: Scatter,
    line: Line | None,
    outliers: tuple[int, ...] = (),
    heights: Array | None = None,
    changes: tuple[int, ...] = (),
    sampled: Sampled | None = None,
) -> tuple[Feature, ...]:
    """What is seen in readings.

    Parameters
    ----------
    values : (cycles,)
        Readings.
    found
        The same without drift, their pattern and their trends.
    line
        The one line that accounts for them, if there is one.
    outliers
        Cycles, from 1, of single far readings.
    heights : (outliers,)
        By how much these exceed what is expected.
    changes
        First cycles, from 1, of later regimes.
    sampled
        How the series was sampled, if it is known.

    Examples
    --------
    >>> import numpy as np
    >>> from chaosgym.recordings.scatter import scatter_of
    >>> pattern = 50.0 + np.random.default_rng(0).normal(size=40)
    >>> readings = np.tile(pattern, 5) + 0.05 * np.random.default_rng(1).normal(size=200)
    >>> [feature.text for feature in describe(readings, scatter_of(readings, 0.0), None)]
    ['a pattern of 40 cycles, seen 5 times, to a standard deviation of 0.0471 N']
    """
    features = [*_spikes(outliers, heights), *_steps(values, changes)]
    if line is not None:
        features += _line(line, len(found.readings), sampled)
    elif not changes:
        features += [*_pattern(found), *_levels(found), *_bursts(found), *_growth(found)]
    if not changes:
        features += _trends(found, line)
    return tuple(features)


def _spikes(outliers: tuple[int, ...], heights: Array | None) -> Iterator[Feature]:
    every = equal_interval(outliers)
    if every is not None and heights is not None:
        height = float(np.mean(heights))
        text = f"{len(outliers)} spikes of {height:+.3g} N on average, one every {every:.4g} cycles"
        yield Feature("spikes", text, {"every_cycles": every, "height": height, "count": len(outliers)})


def _steps(values: Array, changes: tuple[int, ...]) -> Iterator[Feature]:
    ends = [1, *changes, len(values) + 1]
    for start, place, end in zip(ends, ends[1:], ends[2:], strict=False):
        before, after = values[start - 1 : place - 1], values[place - 1 : end - 1]
        low, high = float(np.mean(before)), float(np.mean(after))
        text = (
            f"from cycle {place} on {newton(high)} on average instead of {newton(low)}, with a standard deviation of "
            f"{newton(float(np.std(after)))} instead of {newton(float(np.std(before)))}"
        )
        yield Feature("change", text, {"cycle": place, "level_before": low, "level_after": high})


def _line(line: Line, size: int, sampled: Sampled | None) -> Iterator[Feature]:
    beneath = "one level" if line.period == 1 else f"a pattern of {line.period} cycles"
    kind = "a line" if line.pure else "a line and its multiples"
    cause = causes(line, size, sampled)
    text = f"{kind} of period {line.cycles:.4g} cycles on {beneath}, {100.0 * line.share:.3g} % of the variance"
    figures = {"period_cycles": line.cycles, "share_of_variance": line.share, "pattern_cycles": line.period}
    yield Feature("line", f"{text}; {cause}" if cause else text, figures)


def causes(line: Line, size: int, sampled: Sampled | None) -> str:
    """What makes a line at its frequency: the sampling, or the mains by their alias; empty if that is not known."""
    if sampled is None:
        return ""
    if is_sampling_beat(line, size, sampled):
        return f"as sampling {sampled.samples:.5g} times a cycle makes"
    for mains in MAINS:
        for multiple in range(1, MULTIPLES + 1):
            if _alias(multiple * mains / sampled.cycles_per_second, line, size):
                return f"as a hum of {multiple * mains:g} Hz makes"
    return ""


def is_sampling_beat(line: Line, size: int, sampled: Sampled | None) -> bool:
    """Whether a line lies where a sampling that is no multiple of the cycle makes peaks beat."""
    return sampled is not None and any(_alias(k * sampled.samples, line, size) for k in range(1, MULTIPLES + 1))


def _alias(turns: float, line: Line, size: int) -> bool:
    """Whether a line of a record of so many cycles is what so many turns a cycle look like."""
    return abs(abs(turns - round(turns)) - 1.0 / line.cycles) * size < 0.5


def _pattern(found: Scatter) -> Iterator[Feature]:
    if found.period > 1 and found.has_pattern:
        seen = len(found.readings) / found.period
        within = f"to a standard deviation of {newton(found.sigma)}"
        text = f"a pattern of {found.period} cycles, seen {math.floor(seen)} times, {within}"
        yield Feature("pattern", text, {"cycles": found.period, "times": seen, "standard_deviation": found.sigma})


def _trends(found: Scatter, line: Line | None) -> Iterator[Feature]:
    if found.drift:
        yield Feature("drift", f"the level changes by {found.drift:+.3g} N over the record", {"change": found.drift})
    if found.growth and line is None:
        way = "grows" if found.growth > 0.0 else "shrinks"
        text = f"the pattern {way} by {100.0 * abs(found.growth):.2g} % over the record"
        yield Feature("trend of the pattern", text, {"share": found.growth})


def _levels(found: Scatter) -> Iterator[Feature]:
    """Two levels between which the readings hop."""
    values = found.readings
    ordered = np.sort(values)
    gaps = np.diff(ordered)
    low = max(1, int(LEAST_STAY * len(values)))
    if found.period > 1 or len(values) < 4 * low or not gaps[low - 1 : -low].size:
        return
    cut = low - 1 + int(np.argmax(gaps[low - 1 : -low]))
    above = values > 0.5 * (ordered[cut] + ordered[cut + 1])
    first, second = float(np.mean(values[~above])), float(np.mean(values[above]))
    around = float(np.std(np.where(above, values - second, values - first)))
    hops = int(np.count_nonzero(np.diff(above)))
    if second - first < LEVELS_APART * around or hops < 2:
        return
    stay = len(values) / (hops + 1)
    text = f"hops {hops} times between {newton(first)} and {newton(second)}, and stays {stay:.3g} cycles on average"
    yield Feature("levels", text, {"low": first, "high": second, "hops": hops, "mean_stay_cycles": stay})


def _bursts(found: Scatter) -> Iterator[Feature]:
    """Scatter whose size lasts, though its sign does not."""
    rest = found.residual - found.residual.mean()
    size = len(rest)
    spread = NORMAL * float(np.median(np.abs(rest)))
    if spread <= 0.0 or size < 100:
        return
    sizes = np.minimum(np.abs(rest), 4.0 * spread)
    sizes = sizes - sizes.mean()
    lasts = float(np.sum(sizes[1:] * sizes[:-1])) / max(float(np.sum(sizes**2)), 1e-300) * math.sqrt(size)
    goes = abs(float(np.sum(rest[1:] * rest[:-1]))) / float(np.sum(rest**2)) * math.sqrt(size)
    if lasts > BURSTS and goes < 0.5 * lasts:
        parts = [float(np.std(part)) for part in np.array_split(rest, size // STRETCH)]
        text = f"its scatter comes in bursts: {newton(min(parts))} to {newton(max(parts))} over {STRETCH} cycles"
        yield Feature("bursts", text, {"least": min(parts), "largest": max(parts)})


def _growth(found: Scatter) -> Iterator[Feature]:
    """Growth of small deviations from a level up to bursts: the slope of the map of successive readings there."""
    values, middle = found.readings, float(np.median(found.readings))
    now, following = values[:-1], values[1:]
    for _ in range(3):
        near = NEAR * float(np.median(np.abs(values - middle)))
        small = np.abs(now - middle) < near
        if np.count_nonzero(small) < QUIET * FEWEST_QUIET:
            return
        design = ((now[small] - middle) / near)[:, None] ** np.arange(CURVED)
        weights = np.linalg.lstsq(design, following[small], rcond=None)[0]
        slope = float(weights[1]) / near
        if abs(1.0 - slope) > 0.5 * SLOW:  # towards the level that the map leaves where it is
            middle += float(np.clip((weights[0] - middle) / (1.0 - slope), -0.5 * near, 0.5 * near))
    rest = following[small] - design @ weights
    error = float(np.std(rest) * math.sqrt(np.linalg.pinv(design.T @ design)[1, 1])) / near
    away = np.abs(values - middle)
    stretches = np.diff(np.flatnonzero(np.concatenate([[True], away > near, [True]]))) - 1
    stretches = stretches[stretches >= QUIET]
    grows = 1.0 + 3.0 * error < abs(slope) < 1.0 + SLOW
    accounted = float(np.var(rest)) < (1.0 - EXPLAINED) * float(np.var(following[small]))
    if grows and accounted and away.max() > FAR * near and len(stretches) >= FEWEST_QUIET:
        growth, quiet = abs(slope) - 1.0, float(np.mean(stretches))
        text = (
            f"deviations from {newton(middle)} grow by {100.0 * growth:.2g} % a cycle up to bursts, after "
            f"{len(stretches)} quiet stretches of {quiet:.3g} cycles on average"
        )
        figures = {
            "growth_per_cycle": growth,
            "level": middle,
            "stretches": len(stretches),
            "mean_stretch_cycles": quiet,
        }
        yield Feature("growth of bursts", text, figures)
