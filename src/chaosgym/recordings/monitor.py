"""A monitor of peak forces, one a cycle: an alarm when they vary by more than the sensor's error.

The rule is a cumulative sum (E. S. Page, Biometrika 41, 1954) for every lag k of 1 to 8 cycles, or more:

    g_k <- max(0, g_k + min(|x(n) - x(n - k)| / 2e, CAP) - DRIFT)        e: largest error of a peak

Two readings of a repeating response differ by 2e at the most, and by a third of that on average, so that the sum of its
period stays near zero; of an irregular response all sums grow. The alarm goes on where the least of them exceeds LIMIT,
and off where it has sunk below a third of that. The first 64 cycles tell how much the process scatters, whatever error
is stated, so that the alarm tells of what is new. What the last readings forecast better than a line is no scatter:
chaos from the start on raises the alarm where an error is stated. The first 64, 96 and 128 cycles are judged as
``judge_peaks`` does, too: where they are chaotic the event "irregular from the start" says so, and what their map
leaves is the error from there on.
"""

import math
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TextIO

import numpy as np

from chaosgym.arrays import Array, Indices
from chaosgym.errors import ChaosgymError, DiagnosisError
from chaosgym.numbers import number, whole
from chaosgym.plain import Result
from chaosgym.series.noise import predictability
from chaosgym.series.stroboscopic import irregularity

Event = Literal["", "change", "alarm", "all clear", "irregular from the start", "dead sensor", "missing"]

LAGS, LONGEST = 8, 16
"""Longest period that counts as repeating, and that of ``chaosgym monitor``."""

DRIFT, CAP, LIMIT = 0.45, 1.5, 2.5
"""Of the cumulative sums, in twice the sensor's error."""

CLEAR = LIMIT / 3.0
"""Level below which an alarm ends."""

HIGHEST = LIMIT + 2.0
"""Level beyond which the sums don't grow, so that an alarm can end soon."""

NO_REPEAT = 1.1
"""Difference that no error explains: if it is seen at every lag at once, the regime has changed."""

LEARNED, TRIED, QUIET = 64, 32, 1.5
"""First cycles by which the scatter is learned, those after which a stated error may be trusted, and how many times it
the scatter then is at most."""

JUDGED = (64, 96, 128)
"""First cycles that are judged for chaos from the start on."""

OF_MAP, OF_SCATTER = 2.0, 0.5
"""Largest error in standard deviations that a chaotic map leaves, and its largest share of those of the readings."""

FORECAST, LINEAR, ASKED = 4.0, 3, 24
"""Predictability of what a linear forecast from three readings leaves above which motion is deterministic, and readings
from which it is asked for; noise has one of 2."""

LARGE, LASTS, RECENT = 8.0, 96, 40
"""Beyond a learned scatter: factor by which recent readings exceed it, or cycles for which they do, from which they are
no burst; and how many recent readings are asked whether they are deterministic."""

BURST, BLOCKS = 1.3, 4
"""Factor by which a quarter of the first cycles may scatter by more than all, beyond which the largest is learned."""

EVEN, SLACK, SAME = 1.5, 1.1, 1.5
"""Half width of an even error in mean differences of two readings, what is added to one that is learned, and the factor
within which differences at two lags are the same."""

DEAD = 32
"""Equal readings in succession that tell of a dead sensor, where readings differed before."""

FIRST = np.zeros(1, np.int64)
"""Number of the one sensor of a monitor."""

WINDOW, LEAST = 64, 3
"""Cycles since the last change, at most and at least, from which the amplitude is taken."""


class RepeatSums:
    """The cumulative sums of N sensors side by side.

    Attributes
    ----------
    cycles : (N,)
        Peaks seen of each.
    """

    def __init__(self, count: int, lags: int = LAGS) -> None:
        self.cycles = np.zeros(count, np.int64)
        self._sums = np.zeros((count, lags))
        self._last = np.full((count, lags), np.nan)

    def forget(self, which: Indices) -> None:
        """Reset the sensors ``which`` (k,)."""
        self.cycles[which], self._sums[which], self._last[which] = 0, 0.0, np.nan

    def add(self, which: Indices, peaks: Array, sensor_error: float) -> Array:
        """Add a peak (k,) [N] of each, NaN if it is missing; return its differences (k, lags) in twice the error."""
        last = self._last[which]
        gaps: Array = np.abs(peaks[:, None] - last) / (2.0 * sensor_error)
        added = np.where(np.isnan(gaps), 0.0, np.minimum(gaps, CAP) - DRIFT)
        self._sums[which] = np.minimum(np.maximum(self._sums[which] + added, 0.0), HIGHEST)
        self._last[which] = np.concatenate([peaks[:, None], last[:, :-1]], axis=1)
        self.cycles[which] += 1
        return gaps

    def quieten(self, which: Indices) -> None:
        """Set the sums of the sensors ``which`` (k,) to zero, and keep their last readings."""
        self._sums[which] = 0.0

    def level(self, which: Indices) -> Array:
        """Least sum over its limit, (k,); 0 until every lag has been measured twice."""
        known = self.cycles[which] > 2 * self._sums.shape[1]
        return np.asarray(np.where(known, self._sums[which].min(axis=1) / LIMIT, 0.0))


@dataclass(frozen=True)
class Watch(Result):
    """State of the monitor after a cycle.

    Attributes
    ----------
    cycle, peak
        Number of the cycle, from 1, and its peak force [N].
    alarm
        Whether the response is irregular beyond the sensor's error; None during the first 16 cycles, or 64 where no
        error is stated.
    level
        Least cumulative sum over its limit: the alarm goes on above 1.
    amplitude
        By how much the peaks since the last change do not repeat [N], the sensor's error included; None at first.
    event
        "change" of the regime, "alarm" or "all clear" in this cycle, "irregular from the start" where the first cycles
        are chaotic, "dead sensor" where readings no longer differ, "missing" for a cycle without a reading; empty
        otherwise.
    """

    cycle: int
    peak: float
    alarm: bool | None
    level: float
    amplitude: float | None
    event: Event

    def __str__(self) -> str:
        state = {None: "waiting", False: "no alarm", True: "IRREGULAR"}[self.alarm]
        size = "" if self.amplitude is None else f"  amplitude {self.amplitude:8.2f} N"
        event = f"  <- {self.event}" if self.event else ""
        return f"{self.cycle:6d}  {self.peak:9.2f} N  {state:9s}  level {self.level:4.2f}{size}{event}"


class Monitor:
    """Watches peak forces as they come.

        monitor = Monitor(sensor_error=3.0)
        for peak in sensor:
            if monitor.update(peak).event == "alarm":
                slow_down()

    Parameters
    ----------
    sensor_error
        Largest error of a peak [N], above 0. The first 64 cycles tell the scatter of the process, if it is larger or
        no error is stated. Chaos from the start on is looked for in the first 128, which takes some tenths of a second
        at cycles 64, 96 and 128; where none is found it may be taken for scatter.
    longest_period
        Longest period [cycles] that counts as repeating; the first verdict comes after twice as many cycles.
    on_event
        Called with the ``Watch`` of every cycle that has an event.

    Raises
    ------
    DiagnosisError
        If the error is not a number above 0, or the period not one of 1 to 64.

    Examples
    --------
    >>> monitor = chaosgym.Monitor(sensor_error=3.0)
    >>> peaks = [30.0, 31.0] * 20 + [30.0, 52.0, 11.0, 44.0, 25.0, 58.0, 17.0, 39.0]
    >>> [watch.cycle for watch in map(monitor.update, peaks) if watch.event == "alarm"]
    [44]
    """

    def __init__(
        self,
        sensor_error: float | None = None,
        *,
        longest_period: int = LAGS,
        on_event: Callable[[Watch], None] | None = None,
    ) -> None:
        if sensor_error is not None:
            number("sensor_error", sensor_error, 0.0, unit="N", inside=True, error=DiagnosisError)
        self.longest_period = whole("longest_period", longest_period, 1, 64, error=DiagnosisError)
        self.stated = None if sensor_error is None else float(sensor_error)
        self.on_event = on_event
        self.reset()

    def reset(self) -> None:
        """Start anew, without earlier readings."""
        self.cycle, self.alarm, self.missing, self.dead = 0, False, 0, False
        self.sensor_error = self.stated
        self._sums = RepeatSums(1, self.longest_period)
        self._since: deque[float] = deque(maxlen=WINDOW)
        self._first: list[float] = []
        self._equal, self._differed = 1, False
        self._trusted = self.stated is not None
        self._recent: deque[float] = deque(maxlen=RECENT)
        self._over, self._from_start = 0, False

    @property
    def state(self) -> dict[str, Any]:
        """State as plain values for JSON."""
        names = ("cycle", "alarm", "sensor_error", "stated", "missing", "dead")
        return {**{name: getattr(self, name) for name in names}, "level": float(self._sums.level(FIRST)[0])}

    def update(self, peak: float) -> Watch:
        """Take the peak force [N] of one more cycle.

        Raises
        ------
        DiagnosisError
            If it is negative or not finite; the cycle is not counted.
        """
        if not (math.isfinite(peak) and peak >= 0.0):
            raise DiagnosisError(f"cycle {self.cycle + 1}: peak = {peak:g} N; allowed: finite forces of 0 N and more")
        died = self._note_equal(float(peak))
        self._recent.append(float(peak))
        irregular = self._learn(float(peak))
        gaps = self._sums.add(FIRST, np.array([float(peak)]), self.sensor_error or math.inf)
        # a gap to a peak that is not known yet is NaN, and larger than nothing
        changed = bool((gaps > NO_REPEAT).all()) and not self.alarm
        if changed:
            self._since.clear()
        self._since.append(peak)
        self.cycle += 1
        ready = self.cycle > 2 * self.longest_period and self.sensor_error is not None
        level = float(self._sums.level(FIRST)[0])
        before, self.alarm = self.alarm, level > (CLEAR / LIMIT if self.alarm else 1.0)
        self._over = self._over + 1 if self.alarm else 0
        self.alarm = self.alarm and (before or self._is_new())
        event: Event = "change" if changed and ready else "dead sensor" if died else ""
        if self.alarm != before:
            event = "alarm" if self.alarm else "all clear"
            self._from_start &= self.alarm
        event = "irregular from the start" if irregular else event
        amplitude = irregularity(np.array(self._since), 2 * LAGS) if len(self._since) >= LEAST else None
        return self._told(Watch(self.cycle, float(peak), self.alarm if ready else None, level, amplitude, event))

    def skip(self) -> Watch:
        """Count a cycle whose reading is missing or is no force; later readings keep their place in the period."""
        self._sums.add(FIRST, np.array([math.nan]), self.sensor_error or math.inf)
        self.cycle, self.missing = self.cycle + 1, self.missing + 1
        level = float(self._sums.level(FIRST)[0])
        return self._told(Watch(self.cycle, math.nan, self.alarm, level, None, "missing"))

    def _told(self, seen: Watch) -> Watch:
        if seen.event and self.on_event is not None:
            self.on_event(seen)
        return seen

    def _note_equal(self, peak: float) -> bool:
        """Whether this reading is the one by which a sensor counts as dead."""
        last = self._since[-1] if self._since else None
        self._equal = self._equal + 1 if peak == last else 1
        self._differed |= last is not None and peak != last
        before, self.dead = self.dead, self._equal >= DEAD and (self._differed or peak == 0.0)
        return self.dead and not before

    def _learn(self, peak: float) -> bool:
        """Take the scatter of the first cycles for the error, if none is stated or it is larger and no chaos.

        Return whether these cycles are chaotic.
        """
        if len(self._first) >= JUDGED[-1]:
            return False
        self._first.append(peak)
        seen = np.array(self._first)
        if self.stated is not None and len(seen) == TRIED:
            self._trusted = self._scatter(seen) <= QUIET * self.stated
        if len(seen) == LEARNED:
            learned = self._scatter(seen)
            if self.stated is None:
                self.sensor_error = max(learned, 1e-6 * float(np.max(seen)), 1e-300)
            elif not self._trusted and learned > self.stated and not self.alarm and not _is_deterministic(seen):
                self.sensor_error = learned
                self._sums.quieten(FIRST)
            self._trusted = True
        unknown = self.sensor_error != self.stated and not self.alarm and not self._from_start
        return unknown and len(seen) in JUDGED and self._is_chaotic(seen)

    def _is_chaotic(self, seen: Array) -> bool:
        """Whether the first readings (cycles,) are chaotic; then the error is what their map leaves."""
        from chaosgym.recordings.judge import judge_peaks

        try:
            found = judge_peaks(seen)
        except DiagnosisError:  # readings beyond what is judged
            return False
        self._from_start = found.diagnosis.nature == "chaotic" and not found.changes
        if self._from_start:
            spread = float(np.std(seen))
            left = OF_MAP * math.sqrt(found.diagnosis.evidence["nonlinear_rest"]) * spread
            self.sensor_error = max(self.stated or 0.0, min(left, OF_SCATTER * spread), 1e-6 * float(np.max(seen)))
        return self._from_start

    def _is_new(self) -> bool:
        """Whether scatter beyond the error is none that the process has from the start, and no burst of it."""
        recent, error = np.array(self._recent), self.sensor_error
        if self.stated is not None and len(self._first) < LEARNED:
            return (self._trusted and len(self._first) >= TRIED) or _is_deterministic(recent)
        if error is None or error == self.stated or self._from_start or self._over > LASTS:
            return True
        return self._scatter(recent[-2 * self.longest_period :]) > LARGE * error or _is_deterministic(recent)

    def _scatter(self, seen: Array) -> float:
        """Largest error by the differences of readings (cycles,) one period apart, of the quarter with the most."""
        longest = min(self.longest_period, len(seen) // 2)
        means = np.array([float(np.mean(np.abs(seen[k:] - seen[:-k]))) for k in range(1, longest + 1)])
        period = int(np.flatnonzero(means <= SAME * means.min())[0]) + 1
        typical = float(means[period - 1 :: period].mean())
        quarters = np.array_split(np.abs(seen[period:] - seen[:-period]), BLOCKS)
        bursts = max(float(np.mean(quarter)) for quarter in quarters) / max(float(means[period - 1]), 1e-300)
        return SLACK * EVEN * typical * max(1.0, bursts / BURST)

    def watch(self, peaks: Any) -> Iterator[Watch]:
        """Update with every peak of a series, one after the other."""
        for peak in peaks:
            yield self.update(float(peak))


def _is_deterministic(seen: Array) -> bool:
    """Whether the last readings (cycles,) forecast what a line of them leaves."""
    if len(seen) < ASKED or np.ptp(seen) == 0.0:
        return False
    windows = np.lib.stride_tricks.sliding_window_view(seen, LINEAR + 1)
    design = np.column_stack([np.ones(len(windows)), windows[:, :-1]])
    rest = windows[:, -1] - design @ np.linalg.lstsq(design, windows[:, -1], rcond=None)[0]
    return predictability(seen[LINEAR:], rest) > FORECAST


class EventLog(AbstractContextManager["EventLog"]):
    """A CSV file to which events are appended as they happen: cycle, event, peak [N], amplitude [N].

    Without a path it keeps nothing.

    Raises
    ------
    ChaosgymError
        If the file can't be written.
    """

    def __init__(self, path: str | Path | None) -> None:
        self._file: TextIO | None = None
        if path is not None:
            try:
                self._file = open(path, "a", encoding="utf-8")  # noqa: SIM115
            except OSError as error:
                raise ChaosgymError(f"{path} can't be written: {error.strerror}; choose another file") from error
            if self._file.tell() == 0:
                self._write("cycle,event,peak_N,amplitude_N")

    def note(self, seen: Watch) -> None:
        """Append the event of a cycle, if it has one."""
        if seen.event:
            size = "" if seen.amplitude is None else f"{seen.amplitude:.6g}"
            self._write(f"{seen.cycle},{seen.event},{seen.peak:.6g},{size}")

    def _write(self, line: str) -> None:
        if self._file is not None:
            self._file.write(line + "\n")
            self._file.flush()

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            self._file.close()
