r"""One peak a cycle of a time series: cut at the quietest phase of the cycle, largest modulus of each.

The cycle is stated, taken from a tachometer, or estimated.
"""

from dataclasses import dataclass, replace

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError
from chaosgym.numbers import number
from chaosgym.recordings.columns import Signal, choose_force, named_column
from chaosgym.recordings.cycle_estimate import FEWEST_SAMPLES, estimated_cycle, strongest_line_nearby
from chaosgym.recordings.description import Sampled
from chaosgym.recordings.kind import RecordingOptions
from chaosgym.recordings.read import Recording
from chaosgym.recordings.sampling import Sampling, sampling
from chaosgym.recordings.tachometer import Turns, turns_of
from chaosgym.units import ALTERNATIVES, duration, parse_quantity

BLOCK = 2**18
"""Samples that are looked at in turn."""

PHASES = 64
"""Phases at which the quietest one is looked for."""

FULL = 0.9
"""Share of its samples that a cycle must have."""

NOTHING_STATED = RecordingOptions()
"""Where the recording tells all."""


@dataclass(frozen=True)
class CyclePeaks:
    """Peaks of a series.

    Attributes
    ----------
    peaks : (cycles,)
        Largest modulus of each cycle, in the unit of the series.
    starts : (cycles,)
        Instants [s] at which these cycles begin.
    resolution
        Half width of what the sampling leaves open of a peak.
    period
        Cycle [s]; the mean one with a tachometer.
    instants
        Sampling of the series.
    notes
        How the cycle is known, what is missing, and doubts.
    condition
        "if the cycle is 49.4 ms" where it was estimated; empty where it is known.
    sampled
        Samples a cycle and cycles a second; None with a tachometer.
    """

    peaks: Array
    starts: Array
    resolution: float
    period: float
    instants: Sampling
    notes: tuple[str, ...]
    condition: str = ""
    sampled: Sampled | None = None


def cycle_period(text: str) -> float:
    """Operating cycle [s] of a text: cycles a second or a minute, or the time of one.

    Raises
    ------
    ParameterError
        If it is no quantity in such a unit, or not above 0.

    Examples
    --------
    >>> from chaosgym.recordings.cycles import cycle_period
    >>> [round(cycle_period(text), 12) for text in ("20 Hz", "1200 rpm", "50 ms")]
    [0.05, 0.05, 0.05]
    """
    value = parse_quantity("cycle", text, "s", {**ALTERNATIVES["Hz"], **ALTERNATIVES["s"]})
    number("cycle", value, 0.0, inside=True)
    return 1.0 / value if text.rstrip().endswith(tuple(ALTERNATIVES["Hz"])) else value


def cycle_peaks(
    value: Array, instants: Sampling, period: float | None = None, turns: Turns | None = None
) -> CyclePeaks:
    """Largest modulus of each cycle of a series.

    Parameters
    ----------
    value : (n,)
        The signal; a cycle with a sample that is not finite is left out.
    instants
        Its sampling.
    period
        Cycle [s]; estimated from the series if neither it nor ``turns`` is given.
    turns
        Of the shaft, by a tachometer: a turn is a cycle.

    Raises
    ------
    DiagnosisError
        If a cycle has fewer than 8 samples, or the series is shorter than one cycle.
    """
    missing, value = ~np.isfinite(value), filled(value)
    notes, condition = [f"missing samples: {gap}" for gap in instants.gaps], ""
    if turns is not None:
        starts = turns.starts
        cycle = float(np.mean(np.diff(starts)))
        notes.append(f"cycle from the tachometer: {duration(cycle, 6)} on average, {len(starts) - 1} cycles")
        notes += filter(None, [turns.told])
    elif period is None:
        cycle, origin = estimated_cycle(value, instants.step)
        condition = f"if the cycle is {duration(cycle)}"
        notes.append(
            f"cycle estimated from {origin}: {duration(cycle, 6)} ({1.0 / cycle:.5g} Hz); state it (--read cycle=...) "
            "if that is not the speed"
        )
    else:
        cycle = period
    _check_cycle(cycle if turns is None else float(np.diff(turns.starts).min()), instants)
    if turns is None:
        if period is not None:
            other = None if instants.gaps else strongest_line_nearby(value, instants.step, period)
            if other is not None:
                notes.append(
                    f"the spectrum has its line at {1.0 / other:.6g} Hz, beside the stated {1.0 / period:.6g} Hz"
                )
        first = instants.at(0)
        whole = int((instants.at(-1) + instants.step - first) / cycle * (1.0 + 1e-12))
        starts = np.asarray(first + cycle * np.arange(whole + 1))
    starts = _shifted_to_quiet(value, instants, starts)
    peaks, kept, spread = _largest(np.where(missing, np.nan, value) if missing.any() else value, instants, starts)
    dropped = len(starts) - 1 - len(peaks)
    if dropped:
        notes.append(f"{dropped} cycles left out: samples are missing")
    if len(peaks) == 0:
        raise DiagnosisError(f"the series holds no whole cycle of {duration(cycle)}")
    sampled = Sampled(cycle / instants.step, 1.0 / cycle) if turns is None else None
    return CyclePeaks(peaks, kept, spread, cycle, instants, tuple(notes), condition, sampled)


def filled(value: Array) -> Array:
    """The signal with straight lines over what is missing."""
    there = np.isfinite(value)
    if there.all():
        return value
    places = np.arange(len(value))
    return np.asarray(np.interp(places, places[there], value[there]), dtype=float)


def _check_cycle(cycle: float, instants: Sampling) -> None:
    lasts = instants.at(-1) - instants.at(0) + instants.step
    if cycle < FEWEST_SAMPLES * instants.step:
        held = cycle / instants.step
        raise DiagnosisError(
            f"a cycle of {duration(cycle)} holds {held:.1f} samples; allowed: at least {FEWEST_SAMPLES}"
        )
    if cycle > lasts * (1.0 + 1e-9):
        raise DiagnosisError(f"the series lasts {duration(lasts)}, less than one cycle of {duration(cycle)}")


def _shifted_to_quiet(value: Array, instants: Sampling, starts: Array) -> Array:
    """Starts at the phase at which the signal is smallest, so that no peak is cut in two."""
    lengths = np.diff(starts)
    if not len(lengths):
        return starts
    loud = np.zeros(PHASES)
    for first in range(0, len(value), BLOCK):
        time = instants.part(first, first + BLOCK)
        which = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, len(starts) - 2)
        phase = np.floor(PHASES * (time - starts[which]) / lengths[which]).astype(int) % PHASES
        np.maximum.at(loud, phase, np.abs(value[first : first + BLOCK]))
    begin, end = instants.at(0), instants.at(-1)
    loud = np.maximum(loud, np.maximum(np.roll(loud, 1), np.roll(loud, -1)))
    quiet = np.flatnonzero(loud <= loud.min() * (1.0 + 1e-9) + 1e-300)
    share = (quiet[len(quiet) // 2] + 0.5) / PHASES
    shifted = starts[:-1] + share * lengths
    if starts[-1] + share * lengths[-1] <= end + 0.5 * (end - instants.at(-2)):
        shifted = np.append(shifted, starts[-1] + share * lengths[-1])
    if shifted[0] - (shifted[1] - shifted[0] if len(shifted) > 1 else lengths[0]) >= begin - 1e-12:
        shifted = np.insert(shifted, 0, 2.0 * shifted[0] - shifted[1] if len(shifted) > 1 else shifted[0] - lengths[0])
    return shifted if len(shifted) > 1 else starts


def _largest(value: Array, instants: Sampling, starts: Array) -> tuple[Array, Array, float]:
    """(largest modulus of each whole cycle, where these begin, half width that sampling leaves open)."""
    edges = instants.places(starts - 1e-9 * instants.step)
    peaks, kept, opens = [], [], []
    for first, last, begin, end in zip(edges[:-1], edges[1:], starts[:-1], starts[1:], strict=True):
        whole = last - first >= max(1.0, FULL * (end - begin) / instants.step - 1.0)
        size = np.abs(value[max(0, first - 1) : last + 1].astype(float))
        inside = size[first - max(0, first - 1) :][: last - first]
        if not whole or np.isnan(inside).any():
            continue
        kept.append(begin)
        top = first - max(0, first - 1) + int(np.argmax(inside))
        if 0 < top < len(size) - 1 and size[top] >= max(size[top - 1], size[top + 1]):
            curve = size[top - 1] - 2.0 * size[top] + size[top + 1]
            slope = size[top + 1] - size[top - 1]
            peaks.append(size[top] - (slope**2 / (8.0 * curve) if curve < 0.0 else 0.0))
            opens.append(abs(curve) / 8.0)
        else:
            peaks.append(size[top])
            opens.append(0.0)
    # the parabola through three samples leaves about a tenth of what the largest sample alone would miss
    return np.array(peaks), np.array(kept), 0.1 * float(np.median(opens)) if opens else 0.0


def series_of(
    recording: Recording, options: RecordingOptions = NOTHING_STATED
) -> tuple[Signal, Sampling, Turns | None]:
    """The force column of a series, its sampling, and the turns by its tachometer, if there is one.

    Parameters
    ----------
    recording
        What was read.
    options
        What is stated of it; its column means one.

    Raises
    ------
    DiagnosisError
        If a column is not there, or the tachometer is the signal or tells no turns.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from chaosgym.recordings.cycles import series_of
    >>> from chaosgym.recordings.read import read_recording
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "run.csv"
    ...     _ = file.write_text("time [s],force [N]\\n0.0,1.5\\n0.1,5.0\\n0.2,1.0\\n")
    ...     signal, instants, turns = series_of(read_recording(file))
    >>> signal.values.max().item(), instants.time[-1].item(), turns
    (5.0, 0.2, None)
    """
    tachometer = None if options.tachometer is None else named_column(recording, options.tachometer)
    others = recording
    if options.column is None and tachometer is not None:
        rest = {name: values for name, values in recording.columns.items() if name != tachometer}
        others = replace(recording, columns=rest)
    signal = choose_force(others, options.column, options.unit, options.scale)
    instants = sampling(recording, len(signal.values), options.rate_hz, signal.name)
    size = min(len(signal.values), instants.size)
    instants = instants.shortened(size)
    signal = signal._replace(values=signal.values[:size], described=f"{signal.described}; {instants}")
    if tachometer is None:
        return signal, instants, None
    if tachometer == signal.name:
        raise DiagnosisError(f"{recording.source}: column {tachometer!r} can't be both tachometer and signal")
    pulses = recording.columns[tachometer][:size]
    if len(pulses) < size:
        raise DiagnosisError(f"{recording.source}: {tachometer!r} ends before {signal.name!r}")
    return signal, instants, turns_of(pulses, instants.time, options.pulses_per_revolution or 1)


def peaks_of_series(recording: Recording, options: RecordingOptions = NOTHING_STATED) -> tuple[Signal, CyclePeaks]:
    """Peaks of the series in a recording: its force column, and the peak of each cycle.

    Parameters
    ----------
    recording
        What was read.
    options
        What is stated of it; its column means one.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from chaosgym.recordings.cycles import peaks_of_series
    >>> from chaosgym.recordings.kind import RecordingOptions
    >>> t = np.arange(2000) / 1000.0
    >>> rows = "\\n".join(f"{s:.3f},{10.0 + np.sin(20.0 * np.pi * s):.6f}" for s in t)
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "series.csv"
    ...     _ = file.write_text("time s,force N\\n" + rows)
    ...     force, cycles = peaks_of_series(chaosgym.read_recording(file), RecordingOptions(period=0.1))
    >>> len(cycles.peaks), float(cycles.peaks[5])
    (19, 11.0)
    """
    signal, instants, turns = series_of(recording, options)
    cut = cycle_peaks(signal.values, instants, options.period, turns)
    if cut.condition and recording.speeds:
        listed = ", ".join(f"{key} = {speed:g}" for key, speed in recording.speeds.items())
        cut = replace(cut, notes=(*cut.notes, f"the file states {listed}; if that is the speed, state it"))
    return signal, cut
