"""What does a file of readings show? Its columns as runs, each with its verdict; many files as a table.

``judged_runs`` reads one file, ``judged_files`` a file, a folder or a pattern.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from glob import glob, has_magic
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import ChaosgymError, DiagnosisError, NoRecordingError
from chaosgym.numbers import summary
from chaosgym.recordings.columns import MOST_SHOWN, Signal, check_peaks, choose_force, forces, named_columns
from chaosgym.recordings.description import Sampled
from chaosgym.recordings.judge import judge_peaks
from chaosgym.recordings.kind import Kind, RecordingOptions, in_readings, kind_of
from chaosgym.recordings.measured_verdict import MeasuredVerdict
from chaosgym.recordings.quantities import UNKNOWN, VOLTS, other_quantity
from chaosgym.recordings.read import Recording, read_recording

if TYPE_CHECKING:
    from chaosgym.recordings.cycles import CyclePeaks
    from chaosgym.recordings.trace import Trace

SPEED = "the speed of the machine"
"""What tells more of a series whose cycle is estimated."""


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
    trace
        Of a series, where it was asked for.
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
    trace: "Trace | None" = None

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
    """The runs of one file with what they show together, or why it was not judged, or some of its columns were not.

    ``recording`` is whether it is one, as far as it was read.
    """

    source: str
    runs: tuple[Run, ...] = ()
    together: MeasuredVerdict | None = None
    error: str = ""
    recording: bool = True


def judged_runs(
    source: str | Path,
    options: RecordingOptions | None = None,
    *,
    several: bool = False,
    of_force: bool = False,
    traced: bool = False,
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
    traced
        Keep what is drawn of a series.

    Raises
    ------
    DiagnosisError
        If nothing can be judged.

    Examples
    --------
    >>> from chaosgym.recordings.kind import RecordingOptions
    >>> from chaosgym.recordings.runs import judged_runs
    >>> (run,) = judged_runs("docs/data/peaks.csv", RecordingOptions(column="upper", sensor_error=1.0))
    >>> run.kind, len(run.peaks), run.verdict.diagnosis.nature
    ('peaks', 1000, 'undetermined')
    """
    runs, errors = _judged_columns(source, options or RecordingOptions(), several, of_force, traced)
    if errors:
        raise errors[0]
    return runs


def _judged_columns(
    source: str | Path, options: RecordingOptions, several: bool, of_force: bool, traced: bool
) -> tuple[tuple[Run, ...], tuple[DiagnosisError, ...]]:
    """Read a file and judge its columns: (runs, why others of several could not be judged)."""
    recording = read_recording(source, sheet=options.sheet, column=options.column)
    names = [] if options.column is None else named_columns(recording, options.column)
    if options.tachometer is None:
        chosen = forces if several or names else lambda *of: [choose_force(*of)]
        signals = chosen(recording, options.column, options.unit, options.scale)
        readings = [signal.values for signal in signals]
        kind, why = kind_of(recording, *readings, stated=options.kind, of_series=options.of_series)
    else:
        signals, (kind, why) = [], ("series", f"{options.of_series} is stated")
    columns: list[str | None] = [*(names or [signal.name for signal in signals])] or [None]
    judge: list[Callable[[], Run]]
    if kind == "series":
        judge = [partial(_of_series, recording, name, options, why, of_force, traced) for name in columns]
    else:
        judge = [partial(_of_peaks, recording, one, options, why, of_force, len(signals) > 1) for one in signals]
    runs, errors = [], []
    for name, each in zip(columns, judge, strict=True):
        try:
            runs.append(each())
        except DiagnosisError as error:
            errors.append(error if len(judge) == 1 else DiagnosisError(f"column {name!r}: {error}"))
    return tuple(runs), tuple(errors)


def judged_run(source: str | Path, options: RecordingOptions | None = None, *, traced: bool = False) -> Run:
    """Read and judge the one column of forces of a file; arguments as for ``judged_runs``.

    Raises
    ------
    DiagnosisError
        As ``judged_runs``, and if several columns are named.
    """
    options = options or RecordingOptions()
    runs = judged_runs(source, options, of_force=True, traced=traced)
    if len(runs) > 1:
        names = ", ".join(repr(run.name) for run in runs)
        raise DiagnosisError(f"column={options.column!r} means {names}; allowed here: one column")
    return runs[0]


def judged_files(
    source: str, options: RecordingOptions | None = None, *, progress: bool = False, traced: bool = False
) -> tuple[JudgedFile, ...]:
    """Read and judge a file, or those of a folder or a pattern; one of several that can't be judged says why.

    ``traced`` keeps what is drawn of a series, ``progress`` shows a bar on standard error.

    Raises
    ------
    DiagnosisError
        If no file can be judged: what is said of the first.
    """
    files = files_of(source)
    if files is None:
        return (_judged_file(source, options or RecordingOptions(), traced),)
    if not files:
        raise DiagnosisError(f"{source} holds no file")
    from tqdm import tqdm

    shown = tqdm(files, desc="recordings", delay=2.0, disable=None if progress else True)
    judged = []
    for name in shown:
        try:
            judged.append(_judged_file(name, options or RecordingOptions(), traced))
        except (ChaosgymError, OSError) as error:
            judged.append(JudgedFile(name, error=str(error), recording=not isinstance(error, NoRecordingError)))
    if not any(one.runs for one in judged):
        first = next((one for one in judged if one.recording), judged[0])
        raise DiagnosisError(f"no file of {source} could be judged; the first: {first.error}")
    return tuple(judged)


def table_as_dict(files: Iterable[JudgedFile]) -> dict[str, Any]:
    """Values of many runs for JSON."""
    files = list(files)
    return {
        "recordings": [run.as_dict() for one in files for run in one.runs],
        "together": [{"file": one.source, **one.together.as_dict()} for one in files if one.together is not None],
        "not_judged": [{"file": one.source, "reason": one.error} for one in files if one.error],
        "warnings": not_judged(files),
    }


def not_judged(files: Iterable[JudgedFile]) -> list[str]:
    """Why files, or columns, were not judged, a line each; one line for all that are no recordings.

    Examples
    --------
    >>> from chaosgym.recordings.runs import JudgedFile, not_judged
    >>> not_judged([JudgedFile("runs/notes.txt", error="runs/notes.txt holds no numbers", recording=False)])
    ['1 of 1 files is no recording: notes.txt']
    """
    files = list(files)
    told = no_recordings(files)
    return [*(f"not judged: {one.error}" for one in files if one.error and one.recording), *([told] if told else [])]


def no_recordings(files: Sequence[JudgedFile]) -> str:
    """How many files are no recordings, and which; empty if all are.

    Examples
    --------
    >>> from chaosgym.recordings.runs import JudgedFile, no_recordings
    >>> no_recordings([JudgedFile("a.csv"), JudgedFile("runs/notes.txt", recording=False)])
    '1 of 2 files is no recording: notes.txt'
    """
    others = [Path(one.source).name for one in files if not one.recording]
    are = "are no recordings" if len(others) > 1 else "is no recording"
    more = f" and {len(others) - MOST_SHOWN} more" if len(others) > MOST_SHOWN else ""
    return f"{len(others)} of {len(files)} files {are}: {', '.join(others[:MOST_SHOWN])}{more}" if others else ""


def ask_for_force(source: str, signal: Signal) -> None:
    """Refuse readings of another quantity.

    Raises
    ------
    DiagnosisError
        If they are no forces.
    """
    if signal.unit == "N":
        return
    electric = signal.unit in VOLTS or signal.unit in ("A", "mA", "FS")
    judge = f"name a column of one by --read column=NAME, or judge it as it is: chaosgym judge {source}"
    cure = f"state --read scale='100 {signal.unit}/N', if it measures one" if electric else judge
    held = f"is of {other_quantity(signal.name)}" if signal.unit == UNKNOWN else f"is in {signal.unit}"
    raise DiagnosisError(f"{source}: column {signal.name!r} {held}, and this asks for a force; {cure}")


def _of_series(
    recording: Recording, name: str | None, options: RecordingOptions, why: str, of_force: bool, traced: bool
) -> Run:
    """One column of a series, cut into cycles, which a file of peaks does without."""
    from chaosgym.recordings.cycles import peaks_of_series

    signal, cut = peaks_of_series(recording, replace(options, column=name))
    notes = (f"read {signal.described}, as a series: {why}", f"{len(cut.peaks)} cycles", *cut.notes)
    if of_force:
        ask_for_force(recording.source, signal)
    verdict = _judged(recording.source, signal, cut.peaks, options, cut.resolution, cut.sampled)
    conditions = " and ".join(filter(None, (cut.condition, verdict.diagnosis.condition)))
    asked = (*((SPEED,) if cut.condition else ()), *verdict.diagnosis.tells_more)
    verdict = replace(verdict, diagnosis=replace(verdict.diagnosis, condition=conditions, tells_more=asked))
    aligned = len(cut.peaks) == len(signal.values)
    trace = _traced(signal, cut) if traced else None
    return Run(
        signal.name,
        cut.peaks,
        verdict,
        recording.source,
        recording.sha256,
        notes,
        "series",
        signal.unit,
        aligned,
        trace,
    )


def _traced(signal: Signal, cut: "CyclePeaks") -> "Trace":
    """What is drawn of a series; its module is loaded only for that."""
    from chaosgym.recordings.trace import trace_of

    return trace_of(signal.values, cut)


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


def files_of(source: str) -> list[str] | None:
    """Files of a folder, or those that a pattern fits; None where one file is named."""
    if Path(source).is_dir():
        return [str(path) for path in sorted(Path(source).iterdir()) if path.is_file() and path.name[0] != "."]
    if has_magic(source) and not Path(source).exists():
        return sorted(path for path in glob(source, recursive=True) if Path(path).is_file())
    return None


def _judged_file(source: str, options: RecordingOptions, traced: bool) -> JudgedFile:
    """Judge every column of a file that could be the force; where some can't be judged, say why."""
    runs, errors = _judged_columns(source, options, several=True, of_force=False, traced=traced)
    if not runs:
        raise errors[0]
    return JudgedFile(runs[0].source, runs, _together(runs), "; ".join(map(str, errors)))


def _together(runs: tuple[Run, ...]) -> MeasuredVerdict | None:
    """The verdict on all columns of a file of peaks, which are the sensors of one machine; else None."""
    if len(runs) < 2 or not all(run.aligned for run in runs) or len({len(run.peaks) for run in runs}) > 1:
        return None
    from chaosgym.recordings.sensors import judge_together

    return judge_together(
        [run.verdict for run in runs], np.column_stack([run.peaks for run in runs]), [run.name for run in runs]
    )
