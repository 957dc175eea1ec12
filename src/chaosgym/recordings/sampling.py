"""Instants of the samples of a recording: from a rate, or from stamps without their rounding, with gaps."""

import re
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError
from chaosgym.numbers import number
from chaosgym.recordings.columns import BLOCK, Signal, is_clock, is_counter, rises, steps_of
from chaosgym.recordings.quantities import CLOCK, TIMES
from chaosgym.recordings.read import Recording
from chaosgym.units import duration

LONGEST_GAP, UNEVEN = 1.5, 0.2
"""Steps, in mean steps, from which samples are missing, and the deviation that even sampling may have."""

EPOCHS = {1e9: 1.0, 1e12: 1e-3, 1e15: 1e-6, 1e18: 1e-9}
"""Seconds in a unit of the clocks that count from 1970, by the smallest of their readings: those of September 2001."""

DAYS = {"1899": (36_000.0, 80_000.0), "the year 0": (700_000.0, 800_000.0)}
"""Days by which spreadsheets and MATLAB count instants: since when, and the least and largest of this century."""

SHORT_OF_A_DAY = 1e-6
"""Step of such stamps, 0.09 s, below which they count days: as seconds they would be sampled at more than 1 MHz."""

AGREE, SLOW = 0.02, 0.1
"""Relative deviation of two sampling rates that are the same, and the step [s] from which stamps need a unit."""


class Even(NamedTuple):
    """Instants [s] in equal steps: the first one, the step, and how many there are."""

    first: float
    step: float
    size: int


class Sampling(NamedTuple):
    """Instants [s] of the samples, the step between them, gaps in words, and where the step comes from."""

    instants: Array | Even
    step: float
    gaps: tuple[str, ...]
    origin: str = ""

    def __str__(self) -> str:
        return f"{duration(self.step * self.size)} at {1.0 / self.step:.6g} Hz {self.origin}".rstrip()

    @property
    def size(self) -> int:
        """Number of samples."""
        return self.instants.size

    @property
    def time(self) -> Array:
        """Instants [s], (n,)."""
        return self.part(0, self.size)

    def part(self, first: int, last: int) -> Array:
        """Instants [s] of the samples from one place to before another."""
        if isinstance(self.instants, Even):
            return np.asarray(self.instants.first + self.step * np.arange(first, min(last, self.size)))
        return self.instants[first:last]

    def at(self, place: int) -> float:
        """Instant [s] of one sample; a negative place counts from the last one."""
        place %= self.size
        return float(self.part(place, place + 1)[0])

    def places(self, instants: Array) -> list[int]:
        """Place of the first sample at or after each instant."""
        if not isinstance(self.instants, Even):
            return np.searchsorted(self.instants, instants).tolist()  # type: ignore[no-any-return]
        places = np.ceil((instants - self.instants.first) / self.step)
        return np.clip(places, 0, self.size).astype(int).tolist()  # type: ignore[no-any-return]

    def shortened(self, size: int) -> "Sampling":
        """The first samples."""
        if isinstance(self.instants, Even):
            return self._replace(instants=self.instants._replace(size=min(size, self.size)))
        return self._replace(instants=self.instants[:size])


def sampling(recording: Recording, size: int, rate_hz: float | None = None, column: str | None = None) -> Sampling:
    """Instants of the samples, from the given rate, a time column, or the rate that the file states.

    Parameters
    ----------
    recording
        What was read.
    size
        Number of samples.
    rate_hz
        Sampling rate [Hz], if it is known. It counts before what the file says; where that differs, ``origin`` says so.
    column
        That was sampled; its own rate counts before those of the file.

    Raises
    ------
    DiagnosisError
        If there is none, or the file states several rates, or the stamps fall, or their steps differ by more than
        rounding, or their unit can't be told.
    """
    if rate_hz is not None:
        return _at(rate_hz, size, f"as stated{_instead_of(recording, size, rate_hz, column)}")
    own = recording.rates.get(column or "")
    rates = dict(recording.rates) if column is None or own is None else {column: own}
    stamps = choose_time(recording, told=bool(rates), rate_hz=recording.rate_hz)
    if stamps is not None:
        even = even_sampling(stamps.values[:size], recording)
        return even._replace(origin=f"by {stamps.described}{even.origin}")
    if not rates:
        raise DiagnosisError(
            f"{recording.source} has no time column; use --read rate-hz=..., or name the time column 'time [s]'"
        )
    key, rate = next(iter(rates.items()))
    if not np.allclose(list(rates.values()), rate, rtol=1e-6, atol=0.0):
        listed = ", ".join(f"{key} = {rate:.6g} Hz" for key, rate in rates.items())
        raise DiagnosisError(f"{recording.source} states several rates: {listed}; use --read rate-hz=...")
    return _at(rate, size, "by the channel" if key in recording.columns else f"by {key!r}")


def _instead_of(recording: Recording, size: int, rate_hz: float, column: str | None) -> str:
    """What the file says by itself, where it contradicts a stated rate; empty where it agrees or can't be used."""
    try:
        own = sampling(recording, size, None, column)
    except DiagnosisError:
        return ""
    return "" if abs(own.step * rate_hz - 1.0) < AGREE else f", instead of {1.0 / own.step:.6g} Hz {own.origin}"


def _at(rate: float, size: int, origin: str) -> Sampling:
    number("rate", rate, 0.0, unit="Hz", inside=True, error=DiagnosisError)
    return Sampling(Even(0.0, 1.0 / rate, size), 1.0 / rate, (), origin)


def choose_time(recording: Recording, *, told: bool = False, rate_hz: float | None = None) -> Signal | None:
    """Time stamps [s], if a column holds them: by its unit, its name, or as the one that rises like a clock.

    With ``told`` only those that unit or name tell. A column that counts one by one is no clock. Stamps without a
    unit are of the one that fits ``rate_hz``, of the years since 1970, or seconds.

    Raises
    ------
    DiagnosisError
        If the stamps can't be used, or their unit can't be told.
    """
    name = _clock(recording, told)
    if name is None:
        return None
    if name in recording.problems or name in recording.doubts:
        reason = recording.problems.get(name) or f"column {name!r} {recording.doubts[name]}"
        raise DiagnosisError(f"{recording.source}, {reason}")
    values, unit = np.asarray(recording.columns[name], dtype=float), recording.units.get(name, "")
    if unit and unit in TIMES:
        values, shown = values if TIMES[unit] == 1.0 else values * TIMES[unit], f"column {name!r} [{unit}]"
    else:
        size, how = _size(recording, name, rate_hz)
        values, shown = values - values[0], f"column {name!r} [{how}]"
        values *= size
    if (fraction := _milliseconds(recording, name, values)) is not None:
        values, shown = values + 1e-3 * recording.columns[fraction], f"{shown} and {fraction!r} [ms]"
    return Signal(values, name, shown, "s")


def _clock(recording: Recording, told: bool) -> str | None:
    """Name of the column of instants."""
    columns, units = recording.columns, recording.units
    fits = [name for name in columns if units.get(name, "") in TIMES]
    named = [name for name in columns if any(map(CLOCK.fullmatch, re.split(r"[\W_\d]+", name)))]
    rising = [name for name in [*fits, *named] if rises(columns[name])]
    rising.sort(
        key=lambda name: len(columns[name]) > 1 and columns[name][-1] == columns[name][0]
    )  # one that stands is none
    if not rising and len(columns) > 1 and not told:
        rising = [
            name for name in columns if is_clock(columns[name]) and not units.get(name) and not _counts(columns[name])
        ]
    return next(iter([*rising, *fits]), None)


def _counts(values: Array) -> bool:
    """Whether values are whole numbers in steps of one."""
    return is_counter(values) and bool(values[1] - values[0] == 1.0 and values[0] == round(float(values[0])))


def _size(recording: Recording, name: str, rate_hz: float | None) -> tuple[float, str]:
    """Seconds in a unit of stamps that state none, and how that is known.

    Raises
    ------
    DiagnosisError
        If they contradict the stated rate, or step so far that they may count parts of a second.
    """
    values = np.asarray(recording.columns[name], dtype=float)
    step, typical = float(values[-1] - values[0]) / max(1, len(values) - 1), typical_step(values)
    if rate_hz is not None:
        for unit in ("s", "ms", "us", "ns"):
            if min(abs(each * TIMES[unit] * rate_hz - 1.0) for each in (step, typical)) < AGREE:
                return TIMES[unit], f"{unit}, by the stated rate of {rate_hz:.6g} Hz"
    for least, size in EPOCHS.items():
        if least <= values[0] and values[-1] < 3.0 * least and typical * size < 2.0:
            return size, f"{duration(size).removeprefix('1 ')} since 1970"
    for first_day, (low, high) in DAYS.items():
        if low <= values[0] and values[-1] < high and typical < SHORT_OF_A_DAY:
            return 86400.0, f"days since {first_day}"
    if rate_hz is not None:
        raise DiagnosisError(
            f"{recording.source}: column {name!r} rises in steps of {typical:.6g} without a unit, and the file states "
            f"{rate_hz:.6g} Hz; use --read rate-hz=..."
        )
    if typical >= SLOW * (1.0 - 1e-9):
        raise DiagnosisError(
            f"{recording.source}: column {name!r} rises in steps of {typical:.6g} without a unit; name it "
            f"'{name} [ms]' or '{name} [s]', or use --read rate-hz={1e3 / typical:.6g} if these are milliseconds"
        )
    return 1.0, "no unit, taken as s"


def _milliseconds(recording: Recording, name: str, stamps: Array) -> str | None:
    """Column that holds the milliseconds within the whole seconds of the stamps."""
    if not np.array_equal(stamps, np.round(stamps)):
        return None
    for other, values in recording.columns.items():
        if other != name and recording.units.get(other) == "ms" and len(values) == len(stamps):
            whole = np.array_equal(values, np.round(values)) and values.min() >= 0.0 and values.max() < 1000.0
            if whole and np.any(np.diff(values) < 0.0):
                return other
    return None


def even_sampling(stamps: Array, recording: Recording) -> Sampling:
    """Instants without the rounding of their stamps; gaps are kept.

    Where many samples share a stamp, the changes of the stamp give the step.

    Raises
    ------
    DiagnosisError
        If the stamps fall, or their steps differ by more than rounding; names the line.
    """
    size, rises = len(stamps), 0
    for first, steps in zip(range(0, size, BLOCK), steps_of(stamps), strict=False):
        falling = np.flatnonzero(~(steps >= 0.0))
        if size < 3 or len(falling):
            where = recording.where(first + int(falling[0]) + 1) if len(falling) else recording.where(0)
            raise DiagnosisError(
                f"{recording.source}, {where}: time does not rise; allowed: one series in increasing time"
            )
        rises += int(np.count_nonzero(steps > 0.0))
    if rises < (size - 1) / 3:
        return _within_stamps(stamps, (np.flatnonzero(np.diff(stamps) > 0.0) + 1).tolist(), recording)
    return _without_rounding(stamps, recording)


def _without_rounding(stamps: Array, recording: Recording) -> Sampling:
    """Instants in equal steps but for gaps; block by block."""
    rounding, typical = _rounding(stamps), typical_step(stamps)
    longest = LONGEST_GAP * typical + 2.0 * rounding
    usual = [steps[steps <= longest] for steps in steps_of(stamps[: BLOCK + 1])]
    typical = float(np.mean(np.concatenate(usual)))
    gaps: list[int] = []
    for first, steps in zip(range(0, len(stamps), BLOCK), steps_of(stamps), strict=False):
        gap = steps > LONGEST_GAP * typical + 1.01 * rounding
        odd = np.flatnonzero((np.abs(steps - typical) > UNEVEN * typical + 1.01 * rounding) & ~gap)
        gaps += (first + np.flatnonzero(gap)).tolist()
        if len(odd) or len(gaps) > 0.1 * (len(stamps) - 1):
            place = first + int(odd[0]) if len(odd) else gaps[0]
            raise DiagnosisError(
                f"{recording.source}, {recording.where(place + 1)}: sampled unevenly, a step of "
                f"{duration(float(stamps[place + 1] - stamps[place]))} where {duration(typical)} are usual; resample "
                "at equal steps"
            )
    lost = [round(float(stamps[place + 1] - stamps[place]) / typical) - 1 for place in gaps]
    step = float((stamps[-1] - stamps[0]) / (len(stamps) - 1 + sum(lost)))
    if not gaps:
        return Sampling(Even(float(stamps[0]), step, len(stamps)), step, ())
    order = np.ones(len(stamps))
    order[0], order[np.array(gaps) + 1] = 0.0, np.array(lost) + 1.0
    np.cumsum(order, out=order)
    told = tuple(
        f"{recording.where(place + 1)}: a gap of {duration(float(stamps[place + 1] - stamps[place]))}"
        for place in gaps[:5]
    )
    return Sampling(stamps[0] + order * step, step, told)


def typical_step(stamps: Array) -> float:
    """Median step of stamps, of a long column by every so many of them."""
    every = -(-len(stamps) // BLOCK)
    return float(np.median(stamps[1::every] - stamps[:-1:every]))


def _within_stamps(stamps: Array, changes: list[int], recording: Recording) -> Sampling:
    """Instants of samples of which three and more share a stamp: as many in each, but for the first and the last.

    Raises
    ------
    DiagnosisError
        If fewer than three stamps are whole, or these hold unlike numbers of samples.
    """
    if len(changes) < 4:
        raise DiagnosisError(
            f"{recording.source}: the time stamps are too coarse to tell samples apart; use --read rate-hz=..."
        )
    counts, spans = np.diff(changes), np.diff(stamps[changes])
    step = float(spans.sum() / counts.sum())
    odd = np.flatnonzero(np.abs(counts - spans / step) > 1.0 + UNEVEN * spans / step)
    if len(odd):
        place = int(odd[0])
        raise DiagnosisError(
            f"{recording.source}, {recording.where(changes[place])}: {counts[place]} samples within "
            f"{duration(spans[place])}, where {spans[place] / step:.4g} are usual; resample at equal steps, or use "
            "--read rate-hz=..."
        )
    first = float(stamps[changes[0]]) - step * changes[0]
    origin = f", whose stamps of {duration(float(np.median(spans)))} hold {np.median(counts):.6g} samples each"
    return Sampling(Even(first, step, len(stamps)), step, (), origin)


def _rounding(stamps: Array) -> float:
    """Last decimal place of the stamps [s]; 0 if they have more than twelve."""
    for decimals in range(13):
        most = 1e-9 * 10.0**-decimals + 4e-16 * abs(stamps[-1])
        blocks = (stamps[first : first + BLOCK] for first in range(0, len(stamps), BLOCK))
        if all(np.max(np.abs(np.round(block, decimals) - block)) <= most for block in blocks):
            return float(10.0**-decimals)
    return 0.0
