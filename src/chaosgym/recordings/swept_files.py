"""A recording at many speeds, or one whose speed changes: its file, and the types that it shows."""

from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError
from chaosgym.plain import Result, plain
from chaosgym.recordings.columns import Signal, check_peaks, choose_force, choose_speed
from chaosgym.recordings.cycles import series_of
from chaosgym.recordings.kind import RecordingOptions, in_readings
from chaosgym.recordings.measured_sweep import SweepTypes, sweep_types
from chaosgym.recordings.read import Recording, read_recording
from chaosgym.recordings.run_up import HIGHEST_ORDER, RunUp, run_up
from chaosgym.recordings.runs import ask_for_force, files_of


@dataclass(frozen=True)
class JudgedSweep(Result):
    """Peaks at many speeds, from a file.

    Attributes
    ----------
    recording, speed, force
        The file, and its two columns.
    speeds, peaks : (n,)
        Readings that are there: speed in the file's unit, peak force [N].
    types
        Regions of Types I, II and III.
    """

    shows = (
        "file=recording.source sha256=recording.sha256 speed_column=speed.name speed_unit=speed.unit "
        "column=force.name notes"
    )

    recording: Recording
    speed: Signal
    force: Signal
    speeds: Array
    peaks: Array
    types: SweepTypes

    @property
    def speed_label(self) -> str:
        """Name and unit of the speed."""
        return f"{self.speed.name} [{self.speed.unit}]" if self.speed.unit else self.speed.name

    @property
    def notes(self) -> list[str]:
        """What was read."""
        return [f"read {self.force.described}", self.speed.described]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {**super().as_dict(), **plain(self.types)}


def judged_sweep(
    source: str | Path, options: RecordingOptions | None = None, *, speed_column: str | None = None
) -> JudgedSweep:
    """Read and judge peak forces at many speeds, a line a cycle with its speed.

    Parameters
    ----------
    source
        Name of the file; "-" is standard input. Readings of a folder or a pattern of files count as those of one file.
    options
        What is stated of it: its column of forces, and the sensor's error, which is needed.
    speed_column
        Column of the speed, where several may be.

    Raises
    ------
    DiagnosisError
        If columns can't be told, or ``sweep_types`` refuses what they hold.

    Examples
    --------
    >>> from chaosgym.recordings.kind import RecordingOptions
    >>> from chaosgym.recordings.swept_files import judged_sweep
    >>> sweep = judged_sweep("docs/data/sweep.csv", RecordingOptions(sensor_error=3.0))
    >>> [(region.type, region.first, region.last) for region in sweep.types.regions]
    [('I', 4.0, 7.0), ('II', 8.0, 21.0), ('III', 22.0, 30.0)]
    """
    options = options or RecordingOptions()
    files = files_of(str(source))
    if files == []:
        raise DiagnosisError(f"{source} holds no file")
    parts = [_columns(name, options, speed_column) for name in files or [str(source)]]
    recording, speed, force, *_ = parts[0]
    for other, beside, *_ in parts[1:]:
        if beside.unit != speed.unit:
            raise DiagnosisError(
                f"{other.source} has speeds in {beside.unit or 'no unit'}, {recording.source} in "
                f"{speed.unit or 'no unit'}; allowed: one unit"
            )
    if files is not None:
        digest = sha256("".join(part[0].sha256 for part in parts).encode()).hexdigest()
        recording = replace(recording, source=str(source), sha256=digest)
        force = force._replace(described=f"{force.described}; of {len(parts)} files")
    speeds, peaks = (np.concatenate([part[place] for part in parts]) for place in (3, 4))
    error, sigma = in_readings(options.sensor_error, "N"), in_readings(options.sensor_sigma, "N")
    try:
        types = sweep_types(speeds, peaks, sensor_error=error, sensor_sigma=sigma)
    except DiagnosisError as error:
        raise DiagnosisError(f"{recording.source}: {error}") from error
    return JudgedSweep(recording, speed, force, speeds, peaks, types)


def _columns(
    source: str, options: RecordingOptions, speed_column: str | None
) -> tuple[Recording, Signal, Signal, Array, Array]:
    """A file, its columns of speed and force, and what is there of both."""
    recording = read_recording(source, sheet=options.sheet, column=options.column)
    speed = choose_speed(recording, speed_column)
    force = choose_force(recording, options.column, options.unit, options.scale)
    ask_for_force(recording.source, force)
    if speed.name == force.name:
        raise DiagnosisError(
            f"{recording.source}: column {speed.name!r} can't be both speed and force; state --read column=NAME"
        )
    if len(speed.values) != len(force.values):
        raise DiagnosisError(
            f"{recording.source} has {len(speed.values)} speeds and {len(force.values)} peaks; needed: as many"
        )
    there = np.isfinite(speed.values) & np.isfinite(force.values)
    speeds, peaks = speed.values[there], check_peaks(force._replace(values=force.values[there]), recording)
    return recording, speed, force, speeds, peaks


@dataclass(frozen=True)
class JudgedRunUp(Result):
    """A recording of changing speed, from a file.

    Attributes
    ----------
    recording, signal
        The file, and its column.
    result
        Orders and types.
    """

    shows = "file=recording.source sha256=recording.sha256 column=signal.name unit=signal.unit notes"

    recording: Recording
    signal: Signal
    result: RunUp

    @property
    def notes(self) -> list[str]:
        """What was read, mended and left out."""
        return [f"read {self.signal.described}", *self.result.notes]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {**super().as_dict(), **self.result.as_dict()}


def judged_run_up(source: str | Path, options: RecordingOptions, *, highest: float = HIGHEST_ORDER) -> JudgedRunUp:
    """Read and judge a recording of a run-up or coast-down.

    Parameters
    ----------
    source
        Name of the file; "-" is standard input.
    options
        What is stated of it; a tachometer is needed.
    highest
        Order up to which spectra are taken.

    Raises
    ------
    DiagnosisError
        If no tachometer is stated, or ``run_up`` refuses the recording.
    """
    if options.tachometer is None:
        raise DiagnosisError("a run-up needs a tachometer; state --tachometer NAME")
    recording = read_recording(source, sheet=options.sheet, column=options.column)
    signal, instants, turns = series_of(recording, options)
    assert turns is not None
    result = run_up(
        signal.values,
        instants,
        turns,
        sensor_error=in_readings(options.sensor_error, signal.unit),
        sensor_sigma=in_readings(options.sensor_sigma, signal.unit),
        highest=highest,
    )
    return JudgedRunUp(recording, signal, result)
