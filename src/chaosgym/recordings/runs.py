"""What does a file of readings show? Its columns as runs, each with its verdict; many files as a table.

``judged_runs`` reads one file, ``judged_files`` a file, a folder or a pattern.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from glob import glob, has_magic
from pathlib import Path
from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import ChaosgymError, DiagnosisError
from chaosgym.numbers import summary
from chaosgym.recordings.columns import Signal, check_peaks, choose_force, forces, named_columns
from chaosgym.recordings.description import Sampled
from chaosgym.recordings.judge import judge_peaks
from chaosgym.recordings.kind import Kind, kind_of
from chaosgym.recordings.measured_verdict import MeasuredVerdict
from chaosgym.recordings.read import Recording, read_recording


class InUnit(float):
    """A size whose unit is no force.

    Examples
    --------
    >>> from chaosgym.recordings.runs import InUnit
    >>> InUnit(0.05, "g").unit
    'g'
    """

    def __new__(cls, size: float | str, unit: str) -> "InUnit":
        """Make a size in a unit."""
        made = super().__new__(cls, size)
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


@dataclass(frozen=True)
class Run:
    """One column of a file: its peaks, and the verdict on them.

    Attributes
    ----------
    name, source, sha256
        Of the column and of the file.
    peaks : (cycles,)
        One reading a cycle [``unit``].
    verdict
        On these.
    notes
        What was read, and how.
    kind
        Of the file.
    unit
        Of the readings.
    aligned
        No cycle was left out, so that rows of several runs of a file belong together.
    """

    name: str
    peaks: Array
    verdict: MeasuredVerdict
    source: str
    sha256: str
    notes: tuple[str, ...]
    kind: Kind = "peaks"
    unit: str = "N"
    aligned: bool = False

    @property
    def title(self) -> str:
        """File and column, for a picture."""
        return f"{Path(self.source).name}, {self.name}"

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "file": self.source,
            "column": self.name,
            "sha256": self.sha256,
            "read_as": self.kind,
            **self.verdict.as_dict(),
            "peak_force_summary_N" if self.unit == "N" else "peak_summary": summary(self.peaks),
            "warnings": [*self.verdict.notes, *self.notes],
        }


@dataclass(frozen=True)
class JudgedFile:
    """The runs of one file with what they show together, or why it was not judged."""

    source: str
    runs: tuple[Run, ...] = ()
    together: MeasuredVerdict | None = None
    error: str = ""


def judged_runs(
    source: str | Path, options: RecordingOptions | None = None, *, several: bool = False, of_force: bool = False
) -> tuple[Run, ...]:
    """Read and judge a file; "-" is standard input.

    Parameters
    ----------
    source
        Name of the file.
    options
        What is stated of it.
    several
        Judge every column that could be the force, where none is named; by default there must be one.
    of_force
        Refuse readings of another quantity.

    Raises
    ------
    DiagnosisError
        If nothing can be judged.

    Examples
    --------
    >>> from chaosgym.recordings.runs import RecordingOptions, judged_runs
    >>> (run,) = judged_runs("docs/data/peaks.csv", RecordingOptions(column="upper", sensor_error=1.0))
    >>> run.kind, len(run.peaks), run.verdict.diagnosis.nature
    ('peaks', 1000, 'undetermined')
    """
    options = options or RecordingOptions()
    recording = read_recording(source, sheet=options.sheet, column=options.column)
    names = [] if options.column is None else named_columns(recording, options.column)
    if options.tachometer is None:
        chosen = forces if several or names else lambda *of: [choose_force(*of)]
        signals = chosen(recording, options.column, options.unit, options.scale)
        kind, why = kind_of(recording, signals[0].values, stated=options.kind, of_series=options.of_series)
    else:
        signals, (kind, why) = [], ("series", f"{options.of_series} is stated")
    if kind == "series":
        columns: list[str | None] = [*(names or [signal.name for signal in signals])] or [None]
        return tuple(_of_series(recording, name, options, why, of_force) for name in columns)
    return tuple(_of_peaks(recording, signal, options, why, of_force, len(signals) > 1) for signal in signals)


def judged_run(source: str | Path, options: RecordingOptions | None = None) -> Run:
    """Read and judge the one column of forces of a file.

    Raises
    ------
    DiagnosisError
        As ``judged_runs``, and if several columns are named.
    """
    options = options or RecordingOptions()
    runs = judged_runs(source, options, of_force=True)
    if len(runs) > 1:
        names = ", ".join(repr(run.name) for run in runs)
        raise DiagnosisError(f"--column {options.column!r} means {names}; allowed here: one column")
    return runs[0]


def judged_files(
    source: str, options: RecordingOptions | None = None, *, progress: bool = False
) -> tuple[JudgedFile, ...]:
    """Read and judge a file, or those of a folder or a pattern; one of several that can't be judged says why.

    Raises
    ------
    DiagnosisError
        If no file can be judged: what is said of the first.
    """
    files = _files_of(source)
    if files is None:
        runs = judged_runs(source, options)
        return (JudgedFile(runs[0].source, runs, _together(runs)),)
    if not files:
        raise DiagnosisError(f"{source} holds no file")
    from tqdm import tqdm

    shown = tqdm(files, desc="recordings", delay=2.0, disable=None if progress else True)
    judged = [_judged_file(name, options) for name in shown]
    if not any(one.runs for one in judged):
        raise DiagnosisError(f"no file of {source} could be judged; the first: {judged[0].error}")
    return tuple(judged)


def table_as_dict(files: Iterable[JudgedFile]) -> dict[str, Any]:
    """Values of many runs for JSON."""
    files = list(files)
    return {
        "recordings": [run.as_dict() for one in files for run in one.runs],
        "together": [{"file": one.source, **one.together.as_dict()} for one in files if one.together is not None],
        "not_judged": [{"file": one.source, "reason": one.error} for one in files if one.error],
        "warnings": [one.error for one in files if one.error],
    }


def in_readings(size: float | None, unit: str) -> float | None:
    """The stated size of an error, which must be in the unit of the readings.

    Raises
    ------
    DiagnosisError
        If it is in another one.
    """
    stated = getattr(size, "unit", "N")
    if size is not None and stated != unit and (stated != "N" or unit == "N"):
        raise DiagnosisError(f"the sensor's error is in {stated}, the readings are in {unit}; state both in one unit")
    return size


def ask_for_force(source: str, signal: Signal) -> None:
    """Refuse readings of another quantity.

    Raises
    ------
    DiagnosisError
        If they are no forces.
    """
    if signal.unit != "N":
        raise DiagnosisError(
            f"{source}: column {signal.name!r} is in {signal.unit}, and this command asks for a force; state --scale, "
            "such as '100 mV/N'"
        )


def _of_series(recording: Recording, name: str | None, options: RecordingOptions, why: str, of_force: bool) -> Run:
    """One column of a series, cut into cycles, which a file of peaks does without."""
    from chaosgym.recordings.cycles import peaks_of_series

    signal, cut = peaks_of_series(
        recording,
        name,
        options.unit,
        rate_hz=options.rate_hz,
        period=options.period,
        tachometer=options.tachometer,
        pulses_per_revolution=options.pulses_per_revolution or 1,
        scale=options.scale,
    )
    notes = (f"read {signal.described}, as a series: {why}", f"{len(cut.peaks)} cycles", *cut.notes)
    if of_force:
        ask_for_force(recording.source, signal)
    verdict = _judged(recording.source, signal, cut.peaks, options, cut.resolution, cut.sampled)
    conditions = " and ".join(filter(None, (cut.condition, verdict.diagnosis.condition)))
    verdict = replace(verdict, diagnosis=replace(verdict.diagnosis, condition=conditions))
    aligned = len(cut.peaks) == len(signal.values)
    return Run(
        signal.name, cut.peaks, verdict, recording.source, recording.sha256, notes, "series", signal.unit, aligned
    )


def _of_peaks(
    recording: Recording, signal: Signal, options: RecordingOptions, why: str, of_force: bool, many: bool
) -> Run:
    """One column of readings, one a cycle."""
    peaks = check_peaks(signal, recording)
    if of_force:
        ask_for_force(recording.source, signal)
    notes = (f"read {signal.described}, one a cycle: {why}",)
    where = f"{recording.source}, run {signal.name!r}" if many else recording.source
    verdict = _judged(where, signal, peaks, options)
    aligned = len(peaks) == len(signal.values)
    return Run(signal.name, peaks, verdict, recording.source, recording.sha256, notes, "peaks", signal.unit, aligned)


def _judged(
    where: str,
    signal: Signal,
    peaks: Array,
    options: RecordingOptions,
    resolution: float = 0.0,
    sampled: Sampled | None = None,
) -> MeasuredVerdict:
    try:
        return judge_peaks(
            peaks,
            sensor_error=in_readings(options.sensor_error, signal.unit),
            sensor_sigma=in_readings(options.sensor_sigma, signal.unit),
            resolution=resolution,
            sampled=sampled,
            unit=signal.unit,
        )
    except DiagnosisError as error:
        raise DiagnosisError(f"{where}: {error}") from error


def _files_of(source: str) -> list[str] | None:
    """Files of a folder, or those that a pattern fits; None where one file is named."""
    if Path(source).is_dir():
        return [str(path) for path in sorted(Path(source).iterdir()) if path.is_file() and path.name[0] != "."]
    if has_magic(source) and not Path(source).exists():
        return sorted(path for path in glob(source, recursive=True) if Path(path).is_file())
    return None


def _judged_file(source: str, options: RecordingOptions | None) -> JudgedFile:
    try:
        runs = judged_runs(source, options, several=True)
    except (ChaosgymError, OSError) as error:
        return JudgedFile(source, error=str(error))
    return JudgedFile(source, runs, _together(runs))


def _together(runs: tuple[Run, ...]) -> MeasuredVerdict | None:
    """The verdict on all columns of a file of peaks, which are the sensors of one machine; else None."""
    if len(runs) < 2 or not all(run.aligned for run in runs) or len({len(run.peaks) for run in runs}) > 1:
        return None
    from chaosgym.recordings.sensors import judge_together

    return judge_together(
        [run.verdict for run in runs], np.column_stack([run.peaks for run in runs]), [run.name for run in runs]
    )
