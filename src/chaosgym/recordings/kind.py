"""What is stated of a file of readings, and whether it holds one reading a cycle or a series over time.

A series that is taken for peaks, or the reverse, gets a verdict on the wrong question. So a file that leaves it open is
refused, and the message names what to state.
"""

import re
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError
from chaosgym.recordings.quantities import CLOCK, DIMENSIONS, SIZES, UNKNOWN
from chaosgym.recordings.read import Recording
from chaosgym.recordings.sampling import choose_time, typical_step
from chaosgym.units import as_float

Kind = Literal["peaks", "series"]

FAST = 1000.0
"""Readings a second from which a file is a series: cycles of machines are longer than a millisecond."""

SMOOTH, OSCILLATIONS = 0.5, 8
"""Correlation of neighbouring readings, or of their differences, from which they lie on a curve, and the times that it
must swing. Peaks of a record that drifts or changes its regime are correlated, but do not swing."""

MOST_READINGS = 2**20
"""Readings, those in the middle, by which it is told how they lie."""

AT_REST, SMALL = 0.2, 0.05
"""Share of the readings that are small in a series of impacts, and what is small, as a share of the largest ones."""


class InUnit(float):
    """A size whose unit is stated.

    Examples
    --------
    >>> from chaosgym.recordings.kind import InUnit
    >>> InUnit(0.05, "g").unit
    'g'
    """

    def __new__(cls, size: float | str, unit: str) -> "InUnit":
        """Make a size in a unit."""
        made = super().__new__(cls, as_float(size) if isinstance(size, str) else size)
        made.unit = unit
        return made

    unit: str


@dataclass(frozen=True)
class RecordingOptions:
    """What is stated of a file of readings; what is not, the file or its readings tell.

    Attributes
    ----------
    column, unit, scale
        As for ``choose_force``; ``column`` may mean several, as for ``named_columns``.
    sheet
        Of a workbook; the first with the column, or with numbers.
    kind
        "peaks", one reading a cycle, or "series".
    rate_hz
        Sampling rate of a series [Hz].
    period
        Its cycle [s].
    tachometer, pulses_per_revolution
        Column of a tachometer, a turn of which is a cycle, and its pulses of a turn.
    sensor_error, sensor_sigma
        Largest error of a reading, or its standard deviation [N], or an ``InUnit``.

    Raises
    ------
    DiagnosisError
        If a tachometer stands beside a cycle, its pulses without it, or what only a series has beside ``kind="peaks"``.
    """

    column: str | None = None
    unit: str | None = None
    scale: str | None = None
    sheet: str | None = None
    kind: Kind | None = None
    rate_hz: float | None = None
    period: float | None = None
    tachometer: str | None = None
    pulses_per_revolution: int | None = None
    sensor_error: float | None = None
    sensor_sigma: float | None = None

    def __post_init__(self) -> None:
        """Refuse what contradicts itself."""
        if self.tachometer and self.period is not None:
            raise DiagnosisError("a tachometer and a cycle are stated; allowed: one of them")
        if self.pulses_per_revolution and not self.tachometer:
            raise DiagnosisError("pulses per revolution are stated; allowed: with a tachometer")
        if self.kind == "peaks" and self.of_series:
            raise DiagnosisError(
                f"{self.of_series} is stated, which one reading a cycle has not; allowed: for a series"
            )

    @property
    def of_series(self) -> str | None:
        """What is stated that only a series has, in words."""
        if self.tachometer:
            return f"the tachometer {self.tachometer!r}"
        if self.period is not None:
            return f"a cycle of {self.period:.6g} s"
        return None if self.rate_hz is None else f"a rate of {self.rate_hz:g} Hz"


def in_readings(size: float | None, unit: str) -> float | None:
    """The stated size of an error in the unit of the readings.

    Raises
    ------
    DiagnosisError
        If it is in a unit of another quantity.

    Examples
    --------
    >>> from chaosgym.recordings.kind import InUnit, in_readings
    >>> in_readings(InUnit(0.1, "g"), "m/s^2"), in_readings(InUnit(50.0, "mg"), "g")
    (0.980665, 0.05)
    """
    stated = getattr(size, "unit", unit)
    if size is not None and stated != unit:
        quantity = DIMENSIONS.get(stated, "")
        if quantity in SIZES and quantity == DIMENSIONS.get(unit):
            return float(size) * SIZES[quantity][stated] / SIZES[quantity][unit]
        if unit == UNKNOWN:
            raise DiagnosisError(
                f"the sensor's error is in {stated}, and the file does not state the unit of the readings; state it: "
                f"--read unit={stated}"
            )
        raise DiagnosisError(f"the sensor's error is in {stated}, the readings are in {unit}; state both in one unit")
    return size


class KindOfFile(NamedTuple):
    """What a file holds, and why it is taken for that."""

    kind: Kind
    why: str


def kind_of(
    recording: Recording, *values: Array, stated: Kind | None = None, of_series: str | None = None
) -> KindOfFile:
    """Tell whether a file holds one reading a cycle or a series over time.

    Parameters
    ----------
    recording
        What was read.
    values : (n,)
        Readings of each column that is judged; missing ones are nan.
    stated
        The kind, where a person states it.
    of_series
        What else is stated that only a series has, in words: "a cycle of 33 ms".

    Raises
    ------
    DiagnosisError
        If the file leaves it open; says what to state.

    Examples
    --------
    >>> from chaosgym.recordings.kind import kind_of
    >>> recording = chaosgym.read_recording("docs/data/peaks.csv")
    >>> kind_of(recording, recording.columns["upper"])
    KindOfFile(kind='peaks', why='the file states neither a rate nor times')
    """
    if stated is not None:
        return KindOfFile(stated, "as stated")
    if of_series is not None:
        return KindOfFile("series", f"{of_series} is stated")
    try:
        rate, told = _rate(recording)
    except DiagnosisError as error:
        raise DiagnosisError(f"{error}; or state --read as=peaks for one reading a cycle") from error
    if rate is not None and rate >= FAST:
        return KindOfFile("series", told)
    sampled = next(filter(None, map(looks_sampled, values)), "")
    if rate is None:
        if clock := _clock_of_text(recording):
            raise DiagnosisError(
                f"{recording.source}: column {clock!r} {recording.texts[clock]}, no instant that is known; "
                "state the rate (--read rate-hz=...), or --read as=peaks for one reading a cycle"
            )
        if sampled:
            raise DiagnosisError(
                f"{recording.source} states no sampling rate, but its readings {sampled}, as a series does; state the "
                "rate (--read rate-hz=...), or --read as=peaks for one reading a cycle"
            )
        return KindOfFile("peaks", "the file states neither a rate nor times")
    if sampled:
        return KindOfFile("series", told)
    raise DiagnosisError(
        f"{recording.source} may hold a series or one reading a cycle: {told}, {rate:.3g} readings a second, which lie "
        "on no curve; state --read as=peaks, or --read as=series"
    )


def _clock_of_text(recording: Recording) -> str:
    """Name of a column of texts that are instants in a form that is not known; empty if there is none."""
    named = (name for name in recording.texts if any(map(CLOCK.fullmatch, re.split(r"[\W_\d]+", name))))
    return next((name for name in named if re.search(r"\d\d?:\d\d", recording.texts[name])), "")


def _rate(recording: Recording) -> tuple[float | None, str]:
    """Readings a second [Hz], and where they are from; None where the file states neither a rate nor times.

    Raises
    ------
    DiagnosisError
        If there are times that can't be used.
    """
    if recording.rate_hz is not None:
        return recording.rate_hz, f"the file states a rate of {recording.rate_hz:.6g} Hz"
    time = choose_time(recording, told=bool(recording.rates))
    if time is None and recording.rates:
        listed = ", ".join(f"{key} = {rate:.6g} Hz" for key, rate in recording.rates.items())
        return max(recording.rates.values()), f"the file states rates: {listed}"
    if time is None:
        return None, ""
    stamps = time.values
    stamps = stamps if np.isfinite(stamps).all() else stamps[np.isfinite(stamps)]
    step = typical_step(stamps) if len(stamps) > 1 else 0.0
    return (1.0 / step if step > 0.0 else np.inf), f"the file has times in column {time.name!r}"


def looks_sampled(values: Array) -> str:
    """In what way readings lie as samples of a cycle do, in words; empty where they do not.

    Readings once a cycle of a steady machine jump from one to the next. Samples, eight or more a cycle, swing from one
    side to the other on a curve, or rest between impacts.

    Examples
    --------
    >>> import numpy as np
    >>> from chaosgym.recordings.kind import looks_sampled
    >>> looks_sampled(50.0 + np.sin(0.3 * np.arange(300)))
    'lie on a curve that swings'
    >>> looks_sampled(np.tile([40.0, 60.0, 50.0], 100))
    ''
    """
    start = max(0, (len(values) - MOST_READINGS) // 2)
    middle = values[start : start + MOST_READINGS]
    readings = middle[np.isfinite(middle)]
    largest = float(np.max(np.abs(readings), initial=0.0))
    if len(readings) < 8 * OSCILLATIONS or not largest:
        return ""
    readings = readings / largest
    sizes = np.sort(np.abs(readings))
    large = float(sizes[-OSCILLATIONS])  # a few wrong readings may be larger
    if min(-np.quantile(readings, 0.02), np.quantile(readings, 0.98)) > SMALL * large:
        return "swing about zero"
    if np.mean(sizes < SMALL * large) > AT_REST:
        return "rest between impacts"
    low, high = np.quantile(readings, [0.02, 0.98])
    above = readings > 0.5 * (low + high)
    swings = np.count_nonzero(above[1:] != above[:-1]) / 2
    smooth = max(_correlation(readings), _correlation(np.diff(readings))) > SMOOTH
    return "lie on a curve that swings" if smooth and swings >= OSCILLATIONS else ""


def _correlation(values: Array) -> float:
    """Correlation of each value with the next within most quarters of the record; 0 where all are equal."""
    return float(np.median([_of_neighbours(part) for part in np.array_split(values, 4)]))


def _of_neighbours(values: Array) -> float:
    away = values - values.mean()
    size = float(np.dot(away, away))
    return float(np.dot(away[1:], away[:-1])) / size if size > 0.0 else 0.0
