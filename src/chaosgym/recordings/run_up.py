r"""A recording of a run-up or coast-down: orders of the signal over the speed, and its types by bands of speed.

1. A tachometer tells the angle of the shaft, and a turn is a cycle, whatever it lasts (``signals.tachometer``).
2. Orders of the signal, and of the ringing that impacts excite above them (``signals.orders``).
3. Peaks of the turns are parted into bands of speed. In each the trend is taken out, a parabola over the turns; then
   ``measured_sweep`` judges the bands as it judges speeds that were held. A band must outlast what a response needs to
   follow the speed: where its peaks still change smoothly by more than the sensor errs, it is left out and told.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.plain import Result, plain
from chaosgym.recordings.cycles import CyclePeaks, cycle_peaks
from chaosgym.recordings.fixed_lines import FixedLine
from chaosgym.recordings.measured_sweep import FEWEST_SPEEDS, SweepTypes, judged_speed, sweep_types
from chaosgym.recordings.orders import AngleSignal, OrderLine, OrderSpectra, ringing
from chaosgym.recordings.sampling import Sampling
from chaosgym.recordings.tachometer import Turns
from chaosgym.series.noise import stated_error

HIGHEST_ORDER = 20.0
"""Order up to which spectra are taken, if none is stated."""

BAND, BANDS = 24, 40
"""Turns of a band at least (the thesis has 20 or 30 cycles at a speed), and bands at most over the whole range."""

CHANGES = 0.05
"""Share by which the speed must change, or types by speed are not told."""

LOST = 0.01
"""Share of the amplitude of the highest order whose loss is told."""

QUIET = 1e-4
"""Share of the standard deviation of a signal below which ringing is that of its digits and of the filter."""

ONE_WAY = 0.95
"""Share of the turns in one direction below which the others are told to be left out."""

NARROW = 0.0075
"""Share of the peaks that their sampling may leave open: samples beside the largest then lie 30 % below it."""

SMOOTH = 0.25
"""Mean square of successive differences, over twice the variance, below which peaks change smoothly (von Neumann): it
is 1 if they are independent, and 0.1 or less for a swing that takes the band."""


@dataclass(frozen=True)
class RunUp(Result):
    """What a recording of changing speed says.

    Attributes
    ----------
    turns
        Of the shaft.
    cycles
        Peaks of the turns.
    speeds : (cycles,)
        Rotational speed in the middle of each turn that has a peak [rpm].
    spectra, lines
        Orders of the signal over the speed, and the strongest of them.
    envelope
        Strongest orders of the ringing above the highest order; empty where the signal is sampled too slowly for it, or
        nothing rings.
    fixed
        Fixed frequencies, upwards: hum, and resonances that noise excites.
    types
        Regions of Types I, II and III over the speed [rpm]; None where they are not told.
    judged : (2, n)
        Speeds of the bands and peaks without their trend, of which ``types`` are told.
    notes
        What was mended or left out, and why types are not told.
    """

    shows = (
        "missed_pulses=turns.missed doubled_pulses=turns.doubled envelope_orders=envelope fixed_frequencies=fixed types"
    )

    turns: Turns
    cycles: CyclePeaks
    speeds: Array
    spectra: OrderSpectra
    lines: tuple[OrderLine, ...]
    envelope: tuple[OrderLine, ...]
    fixed: tuple[FixedLine, ...]
    types: SweepTypes | None
    judged: Array
    notes: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        ends = {"first": self.speeds[0], "last": self.speeds[-1], "smallest": self.speeds.min()}
        own = {
            "turns": self.turns.angles[-1],
            "speed_rpm": {**ends, "largest": self.speeds.max()},
            "frames": {"time_s": self.spectra.times, "speed_rpm": 60.0 * self.spectra.speeds},
            "orders": [{**line.as_dict(), "amplitude": line.amplitude} for line in self.lines],
        }
        return {**super().as_dict(), **plain(own)}


def run_up(
    value: Array,
    instants: Sampling,
    turns: Turns,
    *,
    sensor_error: float | None = None,
    sensor_sigma: float | None = None,
    highest: float = HIGHEST_ORDER,
) -> RunUp:
    """Orders and types of a recording whose speed changes.

    Parameters
    ----------
    value : (n,)
        The signal; missing samples are nan.
    instants
        Its sampling.
    turns
        Of the shaft.
    sensor_error, sensor_sigma
        Largest error of a peak, or its standard deviation; without one no types are told.
    highest
        Order up to which spectra are taken.

    Raises
    ------
    DiagnosisError
        If the signal is sampled too slowly for a turn or for the highest order.

    Examples
    --------
    >>> from chaosgym.recordings.sampling import Sampling
    >>> from chaosgym.recordings.tachometer import turns_of
    >>> time = np.arange(20_000) / 1000.0
    >>> angle = 5.0 * time + 0.5 * time**2
    >>> instants = Sampling(time, 1e-3, ())
    >>> turns = turns_of(np.sin(2.0 * np.pi * angle), time)
    >>> found = run_up(3.0 * np.sin(4.0 * np.pi * angle), instants, turns, highest=8.0)
    >>> [(round(line.order, 2), round(line.largest, 2)) for line in found.lines]
    [(2.0, 3.0)]
    """
    error = stated_error(sensor_error, sensor_sigma)
    value = np.asarray(value, dtype=float)
    cycles = cycle_peaks(value, instants, turns=turns)
    signal = AngleSignal(value, instants.time, instants.step, turns, highest)
    spectra = signal.spectra()
    begins = np.maximum(cycles.starts, turns.instants[0])
    ends = np.minimum(begins + 1.0 / turns.speed(begins), turns.instants[-1])
    speeds = 60.0 * (turns.angle(ends) - turns.angle(begins)) / (ends - begins)
    notes = [*cycles.notes, *_doubts(signal, instants.step)]
    above = ringing(value, instants.step, highest * float(signal.speed.max()))
    envelope: list[OrderLine] = []
    if above is None:
        notes.append("no envelope: the signal is sampled too slowly for what lies above the highest order")
    else:
        rings = AngleSignal(above, instants.time, instants.step, turns, highest)
        least = QUIET * float(np.nanstd(value))
        envelope = [line for line in rings.lines(rings.spectra()) if line.typical > least]
        notes += [] if envelope else ["no envelope: nothing rings above the highest order"]
    judged, types = np.empty((2, 0)), None
    if error is None:
        notes.append("types by speed are not told without the sensor's error: --sensor-error")
    elif float(np.ptp(speeds)) < CHANGES * float(speeds.max()):
        notes.append(f"types by speed are not told: it changes by less than {100.0 * CHANGES:g} %")
    elif cycles.resolution > NARROW * float(np.median(cycles.peaks)):
        notes.append("types by speed are not told: peaks last hardly two samples; sample faster")
    else:
        bands, told = _bands(speeds, cycles.peaks, error.half_width)
        natures = [judged_speed(band[1], error.half_width, sensor_error, sensor_sigma) for band in bands]
        judged, between = _without_changes(bands, natures)
        notes += [*told, *between]
        if len(np.unique(judged[0])) < FEWEST_SPEEDS:
            notes.append(
                f"types by speed are not told: they need {FEWEST_SPEEDS} bands of {BAND} turns in one direction"
            )
        else:
            types = sweep_types(judged[0], judged[1], sensor_error=sensor_error, sensor_sigma=sensor_sigma)
    lines = tuple(signal.lines(spectra))
    if not lines and types is not None and any(one.nature == "irregular" for one in types.speeds):
        notes.append("no order stands out, so what is irregular may be noise alone")
    fixed = tuple(signal.fixed.lines())
    return RunUp(turns, cycles, speeds, spectra, lines, tuple(envelope), fixed, types, judged, tuple(notes))


def _doubts(signal: AngleSignal, step: float) -> list[str]:
    """What the sampling of pulses leaves open."""
    notes = []
    blurred = 2.0 * np.pi * signal.highest * float(signal.speed.max()) * step / math.sqrt(12.0)
    lost = 1.0 - math.exp(-0.5 * blurred**2)
    if lost > LOST:
        notes.append(
            f"a square pulse is known to half a sample: order {signal.highest:g} may come out {100.0 * lost:.2g} % too "
            "small at the largest speed"
        )
    return notes


def _bands(speeds: Array, peaks: Array, half_width: float) -> tuple[list[Array], list[str]]:
    """Bands (2, turns) of the longest run in one direction: their speed, and peaks without their trend; and notes."""
    first, last = _one_way(speeds)
    notes = []
    if last - first < ONE_WAY * len(speeds):
        ends = f"{speeds[first]:.4g} to {speeds[last - 1]:.4g} rpm"
        notes.append(f"types are those of the longest run in one direction: turns {first + 1} to {last}, {ends}")
    least = float(np.ptp(speeds[first:last])) / BANDS
    found: list[Array] = []
    start = first
    for end in range(first + BAND, last + 1):
        far = abs(speeds[end - 1] - speeds[start]) >= least and last - end >= BAND
        if end - start < BAND or not (far or end == last):
            continue
        part, number = peaks[start:end], np.arange(end - start)
        trend = np.polynomial.Polynomial.fit(number, part, 2)(number)
        rest = part - trend
        middle = float(speeds[start:end].mean())
        if np.abs(rest).max() > half_width and np.mean(np.diff(rest) ** 2) < 2.0 * SMOOTH * float(np.var(rest)):
            notes.append(
                f"left out at {middle:.4g} rpm: peaks change smoothly by {np.ptp(rest):.3g}; run up more slowly"
            )
        else:
            found.append(np.vstack([np.full(end - start, middle), rest + float(part.mean())]))
        start = end
    return found, notes


def _without_changes(bands: list[Array], natures: list[tuple[bool, int | None]]) -> tuple[Array, list[str]]:
    """All bands but those within which one period gives way to another; and what these were."""
    kept, notes = [], []
    for number, band in enumerate(bands):
        (before, first), (wild, _), (after, second) = (
            natures[max(0, number - 1)],
            natures[number],
            natures[min(number + 1, len(bands) - 1)],
        )
        if wild and not before and not after and first != second:
            notes.append(f"left out at {band[0, 0]:.4g} rpm: period {first} gives way to {second}")
        else:
            kept.append(band)
    return (np.hstack(kept) if kept else np.empty((2, 0))), notes


def _one_way(speeds: Array) -> tuple[int, int]:
    """Turns (first, last) between two ends of the speed, between which it changes most."""
    from scipy.ndimage import median_filter

    smooth = median_filter(speeds, 9, mode="nearest")
    ends = sorted({0, len(speeds), int(np.argmin(smooth)), int(np.argmax(smooth)) + 1})
    pairs = [(a, b) for a, b in pairwise(ends) if b - a > 1]
    return max(pairs, key=lambda pair: abs(float(smooth[pair[1] - 1] - smooth[pair[0]])))
