"""A monitor of peak forces, one a cycle: an alarm as soon as they repeat no longer beyond the sensor's error.

The rule is a cumulative sum (E. S. Page, Biometrika 41, 1954) for every lag k of 1 to 8 cycles:

    g_k <- max(0, g_k + min(|x(n) - x(n - k)| / 2e, CAP) - DRIFT)        e: largest error of a peak

Two readings of a repeating response differ by 2e at the most, and by a third of that on average, so that the sum of its
period stays near zero; of an irregular response all sums grow. The alarm goes on where the least of them exceeds LIMIT,
and off where it has sunk below a third of that. Nothing is learned: no learned window does better on both alarms and
harmless changes (docs/classifier.md).
"""

import math
from collections import deque
from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, TextIO

import numpy as np
from numpy.typing import NDArray

from chaosgym.diagnosis.stroboscopic import irregularity
from chaosgym.errors import ChaosgymError, DiagnosisError

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Event = Literal["", "change", "alarm", "all clear"]

LAGS = 8
"""Longest period that counts as repeating."""

DRIFT, CAP, LIMIT = 0.45, 1.5, 2.5
"""Of the cumulative sums, in twice the sensor's error."""

CLEAR = LIMIT / 3.0
"""Level below which an alarm ends."""

HIGHEST = LIMIT + 2.0
"""Level beyond which the sums don't grow, so that an alarm can end soon."""

NO_REPEAT = 1.1
"""Difference that no error explains: if it is seen at every lag at once, the regime has changed."""

THE_ONE = np.zeros(1, np.int64)
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

    def __init__(self, count: int) -> None:
        self.cycles = np.zeros(count, np.int64)
        self._sums = np.zeros((count, LAGS))
        self._last = np.full((count, LAGS), np.nan)

    def forget(self, which: Indices) -> None:
        """Forget what the sensors ``which`` (k,) have seen."""
        self.cycles[which], self._sums[which], self._last[which] = 0, 0.0, np.nan

    def add(self, which: Indices, peaks: Array, sensor_error: float) -> Array:
        """Add a peak (k,) [N] of each; return its differences (k, 8) from the last eight, in twice the error."""
        last = self._last[which]
        gaps: Array = np.abs(peaks[:, None] - last) / (2.0 * sensor_error)
        added = np.where(np.isnan(gaps), 0.0, np.minimum(gaps, CAP) - DRIFT)
        self._sums[which] = np.minimum(np.maximum(self._sums[which] + added, 0.0), HIGHEST)
        self._last[which] = np.concatenate([peaks[:, None], last[:, :-1]], axis=1)
        self.cycles[which] += 1
        return gaps

    def level(self, which: Indices) -> Array:
        """Least sum over its limit, (k,); 0 during the first 16 cycles."""
        return np.asarray(np.where(self.cycles[which] > 2 * LAGS, self._sums[which].min(axis=1) / LIMIT, 0.0))


@dataclass(frozen=True)
class Watch:
    """What the monitor says after a cycle.

    Attributes
    ----------
    cycle, peak
        Number of the cycle, from 1, and its peak force [N].
    alarm
        Whether the response is irregular beyond the sensor's error; None during the first 16 cycles.
    level
        Least cumulative sum over its limit: the alarm goes on above 1.
    amplitude
        By how much the peaks since the last change do not repeat [N], the sensor's error included; None at first.
    event
        "change" of the regime, "alarm" or "all clear" in this cycle; empty otherwise.
    """

    cycle: int
    peak: float
    alarm: bool | None
    level: float
    amplitude: float | None
    event: Event

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self)

    def __str__(self) -> str:
        state = {None: "waiting", False: "regular", True: "IRREGULAR"}[self.alarm]
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
        Largest error of a peak [N], above 0.

    Raises
    ------
    DiagnosisError
        If the error is not a number above 0.
    """

    def __init__(self, sensor_error: float) -> None:
        if not (math.isfinite(sensor_error) and sensor_error > 0.0):
            raise DiagnosisError(f"sensor_error = {sensor_error:g} N is out of range; allowed: above 0")
        self.sensor_error = float(sensor_error)
        self.reset()

    def reset(self) -> None:
        """Forget what was seen."""
        self.cycle, self.alarm = 0, False
        self._sums = RepeatSums(1)
        self._since: deque[float] = deque(maxlen=WINDOW)

    def update(self, peak: float) -> Watch:
        """Take the peak force [N] of one more cycle.

        Raises
        ------
        DiagnosisError
            If it is negative or not finite; the cycle is not counted.
        """
        if not (math.isfinite(peak) and peak >= 0.0):
            raise DiagnosisError(f"cycle {self.cycle + 1}: peak = {peak:g} N; allowed: finite forces of 0 N and more")
        gaps = self._sums.add(THE_ONE, np.array([float(peak)]), self.sensor_error)
        # a gap to a peak that is not known yet is NaN, and larger than nothing
        changed = bool((gaps > NO_REPEAT).all()) and not self.alarm
        if changed:
            self._since.clear()
        self._since.append(peak)
        self.cycle += 1
        ready = self.cycle > 2 * LAGS
        level = float(self._sums.level(THE_ONE)[0])
        before, self.alarm = self.alarm, level > (CLEAR / LIMIT if self.alarm else 1.0)
        event: Event = "change" if changed and ready else ""
        if self.alarm != before:
            event = "alarm" if self.alarm else "all clear"
        amplitude = irregularity(np.array(self._since), 2 * LAGS) if len(self._since) >= LEAST else None
        return Watch(self.cycle, float(peak), self.alarm if ready else None, level, amplitude, event)

    def watch(self, peaks: Any) -> Iterator[Watch]:
        """Update with every peak of a series, one after the other."""
        for peak in peaks:
            yield self.update(float(peak))


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
                raise ChaosgymError(f"{path} can't be written: {error}; choose another file") from error
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
