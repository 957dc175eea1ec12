"""Angle and speed of a shaft from the pulses of a tachometer: missed and doubled pulses are mended and counted."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline


FEWEST_TURNS = 12
"""Turns that a recording must have."""

FEWEST_SAMPLES = 4
"""Samples from pulse to pulse where these come fastest."""

NARROW, FLAGS = 1.5, 10.0
"""Samples that a pulse must last, or some fall between samples; and from pulse to pulse where one will do, which a
logger set."""

WINDOW, TREND = 11, 3
"""Intervals of pulses whose median is the usual one, and degree of the trend of the speed that is taken out before."""

SHORT, UNEVEN = 0.6, 0.3
"""Shares of the usual interval: below which a pulse is doubled, and by which intervals may miss whole numbers of it."""

STRAY = 0.15
"""Share of the usual interval by which a pulse lies beside its place on both sides, where it is none of the shaft's."""

MOST_MENDED, MOST_UNEVEN = 0.2, 0.05
"""Shares of the pulses that may be missed or doubled, and of the intervals that may be uneven."""

SLOWEST, STOPPED = 0.1, 1.5
"""Share of the largest speed below which the ends of a recording are left out; and by what factor an interval between
these may exceed that of this speed, or the shaft may have stopped there and turned back."""

APART = 50
"""Samples between the pulses that carry the angle: a pulse is known to half a sample only."""


@dataclass(frozen=True)
class Turns:
    """Angle of a shaft over time.

    Attributes
    ----------
    instants : (pulses,)
        Of the pulses that carry the angle [s].
    angles : (pulses,)
        Angle at these, in turns from the first pulse on.
    missed, doubled
        Pulses that were mended.
    """

    instants: Array
    angles: Array
    missed: int = 0
    doubled: int = 0

    @cached_property
    def _angle(self) -> "CubicSpline":
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.instants, self.angles)

    def angle(self, time: ArrayLike) -> Array:
        """Angle [turns] at instants [s] between the first pulse and the last."""
        return np.asarray(self._angle(time))

    def speed(self, time: ArrayLike) -> Array:
        """Rotational speed [turns/s]."""
        return np.asarray(self._angle(time, 1))

    @cached_property
    def starts(self) -> Array:
        """Instants [s] at which whole turns begin."""
        from scipy.interpolate import CubicSpline

        whole = np.arange(np.ceil(self.angles[0]), np.floor(self.angles[-1]) + 1.0)
        return np.asarray(CubicSpline(self.angles, self.instants)(whole))

    @property
    def told(self) -> str:
        """What was mended, for people; empty if nothing was."""
        parts = [f"{count} {name}" for name, count in (("missed", self.missed), ("doubled", self.doubled)) if count]
        return f"pulses mended: {', '.join(parts)}" if parts else ""


def turns_of(signal: Array, time: Array, pulses_per_revolution: int = 1) -> Turns:
    """Angle of the shaft from the signal of a tachometer.

    Parameters
    ----------
    signal : (n,)
        Of the tachometer; it rises through the middle of its range once a pulse. Missing samples are nan.
    time : (n,)
        Instants [s], evenly apart but for gaps.
    pulses_per_revolution
        Pulses of one turn.

    Raises
    ------
    DiagnosisError
        If there are no 12 turns, fewer than 4 samples a pulse, a silence of six pulses, a stop, or uneven pulses.

    Examples
    --------
    >>> from chaosgym.recordings.tachometer import turns_of
    >>> time = np.arange(4000) / 1000.0
    >>> found = turns_of(np.sin(2.0 * np.pi * 5.0 * time**2), time)
    >>> float(found.speed(2.0).round(2)), found.missed
    (20.0, 0)
    """
    if pulses_per_revolution < 1:
        raise DiagnosisError(f"{pulses_per_revolution} pulses per revolution; allowed: 1 or more")
    rises, width = _rises(np.asarray(signal, dtype=float), time)
    _check_count(len(rises) - 1, pulses_per_revolution)
    step = float(np.median(np.diff(time)))
    gap = float(np.quantile(np.diff(rises), 0.1)) / step
    if gap < FEWEST_SAMPLES or (gap < FLAGS and width < NARROW):
        raise DiagnosisError(
            f"pulses come every {gap:.1f} samples where the shaft is fastest, and last {width:.1f}; needed: "
            f"{FEWEST_SAMPLES}, and {NARROW:g}; sample faster, or use fewer pulses per revolution"
        )
    rises = _fast_enough(rises)
    single = _without_stray(_without_doubled(rises))
    numbers, missed = _numbered(single)
    doubled = len(rises) - len(single)
    if missed + doubled > MOST_MENDED * len(rises):
        raise DiagnosisError(
            f"of {len(rises)} pulses of the tachometer {doubled} are doubled, and {missed} are missed; allowed: "
            f"{100.0 * MOST_MENDED:g} % in all; is its threshold the middle of its range?"
        )
    _check_count(int(numbers[-1]), pulses_per_revolution)
    divisors = [d for d in range(1, pulses_per_revolution + 1) if pulses_per_revolution % d == 0]
    carry = numbers % next((d for d in divisors if d * gap >= APART), pulses_per_revolution) == 0
    return Turns(single[carry], numbers[carry] / pulses_per_revolution, missed, doubled)


def _check_count(pulses: int, per_revolution: int) -> None:
    turns = pulses / per_revolution
    if turns < FEWEST_TURNS:
        at = "" if per_revolution == 1 else f", {per_revolution} pulses each"
        raise DiagnosisError(
            f"the tachometer rises {max(pulses + 1, 0)} times, {max(turns, 0.0):.3g} turns{at}; needed: "
            f"{FEWEST_TURNS} turns or more"
        )


def _rises(signal: Array, time: Array) -> tuple[Array, float]:
    """Instants [s] at which the signal rises through the middle of its range, and the samples for which it stays there.

    The latter is the mean of the shortest tenth.
    """
    known = np.isfinite(signal)
    if not known.any():
        return np.empty(0), 0.0
    signal, time = signal[known], time[known]
    low, high = float(signal.min()), float(signal.max())
    middle, slack = 0.5 * (low + high), 0.1 * (high - low)
    side = np.where(signal > middle + slack, 1, np.where(signal < middle - slack, 0, -1))
    decided = np.maximum.accumulate(np.where(side >= 0, np.arange(len(side)), 0))
    above = np.where(side[decided] < 0, 0, side[decided])
    rises, falls = (np.flatnonzero(np.diff(above) == way) for way in (1, -1))
    after = falls[falls > rises[0]] if len(rises) else falls[:0]
    lasting = np.sort(after - rises[: len(after)])
    # the last sample below the middle may lie before the one that decides
    below = np.maximum.accumulate(np.where(signal <= middle, np.arange(len(signal)), 0))[rises + 1]
    share = (middle - signal[below]) / (signal[below + 1] - signal[below])
    width = float(np.mean(lasting[: max(1, len(lasting) // 10)])) if len(lasting) else 0.0
    return np.asarray(time[below] + share * (time[below + 1] - time[below])), width


def _fast_enough(rises: Array) -> Array:
    """Pulses but for slow ones at both ends, where the shaft starts or stops; nowhere else may it."""
    gaps = np.diff(rises)
    longest = float(np.quantile(gaps, 0.1)) / SLOWEST
    fast = np.flatnonzero(gaps <= longest)
    first, last = fast[0], fast[-1] + 1
    stops = first + np.flatnonzero(gaps[first:last] > STOPPED * longest)
    if len(stops):
        place = int(stops[0])
        raise DiagnosisError(
            f"the tachometer is silent from {rises[place]:.6g} to {rises[place + 1]:.6g} s; cut the recording there, "
            "as the shaft may have stopped and turned back"
        )
    return rises[first : last + 1]


def _usual(gaps: Array) -> Array:
    """The interval of one pulse at each of the intervals, of which some span several; a trend of the speed is kept."""
    from scipy.ndimage import median_filter

    logs, number = np.log(gaps), np.arange(len(gaps))
    middle = median_filter(logs, WINDOW, mode="mirror")
    trend = np.polynomial.Polynomial.fit(number, middle, min(TREND, len(gaps) - 1))(number)
    return np.asarray(np.exp(trend + median_filter(logs - trend, WINDOW, mode="mirror")))


def _without_doubled(rises: Array) -> Array:
    """Pulses without those that come too soon: of two, that goes without which the intervals are evener."""
    while len(rises) > WINDOW:
        gaps = np.diff(rises)
        usual = _usual(gaps)
        short = np.flatnonzero(gaps < SHORT * usual)
        if not len(short):
            break
        place = int(short[0])
        around = rises[max(0, place - 1) : place + 3]
        first = place - max(0, place - 1)
        costs = [float(np.abs(np.diff(np.delete(around, first + k)) - usual[place]).sum()) for k in (0, 1)]
        rises = np.delete(rises, place + int(np.argmin(costs)))
    return rises


def _without_stray(rises: Array) -> Array:
    """Pulses without those that stand where one beside them was missed: apart by no whole intervals, on both sides."""
    while len(rises) > WINDOW:
        share = np.diff(rises) / _usual(np.diff(rises))
        away = share - np.maximum(1.0, np.rint(share))
        both = share[:-1] + share[1:]
        whole = np.abs(both - np.rint(both)) < 0.5 * STRAY
        stray = np.flatnonzero((np.minimum(np.abs(away[:-1]), np.abs(away[1:])) > STRAY) & whole) + 1
        if not len(stray):
            break
        worst = int(stray[np.argmax(np.abs(away[stray]))])
        rises = np.delete(rises, worst)
    for end in (0, -1):  # beside the first pulse and the last one it makes the interval short
        while len(rises) > WINDOW and np.diff(rises)[end] < (1.0 - 2.0 * STRAY) * _usual(np.diff(rises))[end]:
            rises = np.delete(rises, end)
    return rises


def _numbered(rises: Array) -> tuple[NDArray[np.int64], int]:
    """Number of each pulse, those that are missed counted, and how many are missed."""
    gaps = np.diff(rises)
    share = gaps / _usual(gaps)
    steps = np.maximum(1, np.rint(share)).astype(np.int64)
    if steps.max() > WINDOW // 2:
        place = int(np.argmax(steps))
        span = f"from {rises[place]:.6g} to {rises[place + 1]:.6g} s"
        raise DiagnosisError(f"the tachometer is silent {span}; cut the recording there, or sample faster")
    uneven = float(np.mean(np.abs(share - steps) > UNEVEN))
    if uneven > MOST_UNEVEN:
        raise DiagnosisError(
            f"{100.0 * uneven:.0f} % of the intervals between pulses are uneven; allowed: {100.0 * MOST_UNEVEN:g} %; "
            "is the column that of a tachometer?"
        )
    return np.concatenate([[0], np.cumsum(steps)]), int(np.sum(steps - 1))
