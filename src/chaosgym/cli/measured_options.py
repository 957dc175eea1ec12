"""Options of measured signals, the same for ``diagnose``, ``classify`` and ``design``, and what they read."""

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import click

from chaosgym.cli.machine_options import Quantity
from chaosgym.cli.output import force_line, patience, reading_line, verdict_lines


class InUnit(float):
    """A size whose unit is no force."""

    unit = ""


class Reading(Quantity):
    """A number in newton, with a unit of force, or with the unit of another quantity, which it then carries."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return newton, or an ``InUnit``."""
        from chaosgym.recordings.quantities import OTHERS

        number, _, unit = value.strip().rpartition(" ") if isinstance(value, str) else ("", "", "")
        if unit not in OTHERS:
            return super().convert(value, param, ctx)
        try:
            found = InUnit(number)
        except ValueError:
            raise click.UsageError(f"{param.opts[0] if param else 'value'} {value!r} is no number", ctx) from None
        found.unit = unit
        return found


def in_readings(size: float | None, unit: str) -> float | None:
    """The stated size of an error, which must be in the unit of the readings.

    Raises
    ------
    DiagnosisError
        If it is in another one.
    """
    from chaosgym.errors import DiagnosisError

    stated = getattr(size, "unit", "N")
    if size is not None and stated != unit and (stated != "N" or unit == "N"):
        raise DiagnosisError(f"the sensor's error is in {stated}, the readings are in {unit}; state both in one unit")
    return size


OPTIONS = (
    click.option("--peaks", metavar="FILE", help="Peak forces, one a cycle: CSV, Parquet, .npy, .mat; - is stdin."),
    click.option("--series", metavar="FILE", help="A force over time: the same formats, WAV and UFF; - is stdin."),
    click.option("--column", metavar="NAME", help="Column of the force: name, number, pattern, or several."),
    click.option("--unit", metavar="UNIT", help="Unit of the column, if the file does not name it; default N."),
    click.option("--scale", metavar="TEXT", help="Calibration of the column: '100 mV/N', '20 N/V', '50 N/FS'."),
    click.option("--rate-hz", type=Quantity("Hz"), help="Sampling rate of --series, if it has no time column."),
    click.option("--hz", type=Quantity("Hz"), help="Cycles a second of --series; without it, the spectrum's line."),
    click.option("--rpm", type=Quantity("rpm"), help="Cycles a minute instead."),
    click.option("--period-s", type=Quantity("s"), help="Duration of a cycle instead."),
    click.option("--tachometer", metavar="NAME", help="Column of --series with a tachometer's pulses instead."),
    click.option(
        "--pulses-per-revolution",
        type=click.IntRange(1, 100_000),
        metavar="N",
        help="Pulses of the tachometer in a cycle; default 1.",
    ),
    click.option(
        "--sensor-error",
        type=Reading("N"),
        help="Largest error of a reading (half width). Smaller differences are none.",
    ),
    click.option(
        "--sensor-sigma",
        type=Reading("N"),
        help="Standard deviation of a reading instead. Without either it is estimated from the record.",
    ),
    click.option("--sheet", metavar="NAME", help="Sheet of a workbook; default the first with the column, or numbers."),
)


class Measured(NamedTuple):
    """What the options say."""

    peaks: str | None
    series: str | None
    column: str | None
    unit: str | None
    scale: str | None
    rate_hz: float | None
    hz: float | None
    rpm: float | None
    period_s: float | None
    tachometer: str | None
    pulses_per_revolution: int | None
    sensor_error: float | None
    sensor_sigma: float | None
    sheet: str | None

    def __bool__(self) -> bool:
        return bool(self.peaks or self.series)


class Run(NamedTuple):
    """One measured run: its peaks, the verdict, and where it comes from.

    ``aligned`` tells that no cycle was left out, so that rows of several runs of a file belong together.
    """

    name: str
    peaks: Any
    verdict: Any
    source: str
    sha256: str
    notes: tuple[str, ...]
    unit: str = "N"
    aligned: bool = False


def measured_options(function: Callable[..., None]) -> Callable[..., None]:
    """Add the options; the function receives them as ``measured``."""

    @functools.wraps(function)
    def wrapped(**keywords: Any) -> None:
        given = Measured(**{name: keywords.pop(name) for name in Measured._fields})
        _check(given, bool(keywords.get("sweep") or keywords.get("follow")))
        function(measured=given, **keywords)

    for option in reversed(OPTIONS):
        wrapped = option(wrapped)
    return wrapped


def _check(given: Measured, elsewhere: bool) -> None:
    if given.peaks and given.series:
        raise click.UsageError("--peaks and --series exclude each other")
    of_series = ("rate_hz", "hz", "rpm", "period_s", "tachometer")
    for name in of_series:
        if getattr(given, name) is not None and not given.series:
            raise click.UsageError(f"--{name.replace('_', '-')} belongs to --series")
    if given.sheet and not (given or elsewhere):
        raise click.UsageError("--sheet belongs to a workbook that was measured")
    if (given.column or given.unit or given.scale) and not (given or elsewhere):
        raise click.UsageError("--column, --unit and --scale belong to a file that was measured, or to --follow")
    for size in (given.sensor_error, given.sensor_sigma):
        if isinstance(size, InUnit) and not given:
            raise click.UsageError(
                f"the sensor's error is in {size.unit}; allowed without a file of readings: N, kN, lbf"
            )
    if given.pulses_per_revolution and not given.tachometer:
        raise click.UsageError("--pulses-per-revolution belongs to --tachometer")
    if given.tachometer and any((given.hz, given.rpm, given.period_s)):
        raise click.UsageError("--tachometer and a stated cycle exclude each other")


@patience("read and judge the recording")
def measured_runs(given: Measured, *, several: bool = False, of_force: bool = False) -> list[Run]:
    """Read and judge what was measured: one run, or one a column where ``several`` are welcome or named.

    Raises
    ------
    DiagnosisError
        If nothing can be judged, or readings are no forces where ``of_force`` asks for them.
    """
    from chaosgym.errors import DiagnosisError
    from chaosgym.recordings.columns import check_peaks, choose_force, forces, named_columns
    from chaosgym.recordings.cycles import cycle_period, peaks_of_series
    from chaosgym.recordings.judge import judge_peaks
    from chaosgym.recordings.read import read_recording

    recording = read_recording(given.peaks or given.series or "-", sheet=given.sheet, column=given.column)
    found = []
    names = [] if given.column is None else named_columns(recording, given.column)
    if given.series:
        period = cycle_period(given.rpm, given.hz, given.period_s)
        for name in names or (None,):
            signal, cut = peaks_of_series(
                recording,
                name,
                given.unit,
                rate_hz=given.rate_hz,
                period=period,
                tachometer=given.tachometer,
                pulses_per_revolution=given.pulses_per_revolution or 1,
                scale=given.scale,
            )
            notes = (f"{len(cut.peaks)} cycles", *cut.notes)
            found.append((signal, cut.peaks, cut.resolution, notes, cut.condition, cut.sampled))
    else:
        chosen = forces if several or names else lambda *of: [choose_force(*of)]
        for signal in chosen(recording, given.column, given.unit, given.scale):
            found.append((signal, check_peaks(signal, recording), 0.0, (), "", None))
    runs = []
    for signal, peaks, resolution, notes, condition, sampled in found:
        if of_force:
            _ask_for_force(recording.source, signal)
        try:
            verdict = judge_peaks(
                peaks,
                sensor_error=in_readings(given.sensor_error, signal.unit),
                sensor_sigma=in_readings(given.sensor_sigma, signal.unit),
                resolution=resolution,
                unit=signal.unit,
                sampled=sampled,
            )
        except DiagnosisError as error:
            run = f", run {signal.name!r}" if len(found) > 1 else ""
            raise DiagnosisError(f"{recording.source}{run}: {error}") from error
        conditions = filter(None, (condition, verdict.diagnosis.condition))
        verdict = replace(verdict, diagnosis=replace(verdict.diagnosis, condition=" and ".join(conditions)))
        runs.append(
            Run(
                signal.name,
                peaks,
                verdict,
                recording.source,
                recording.sha256,
                (f"read {signal.described}", *notes),
                signal.unit,
                len(peaks) == len(signal.values),
            )
        )
    return runs


def measured_run(given: Measured) -> Run:
    """The one run of forces that was measured.

    Raises
    ------
    UsageError
        If ``--column`` means several.
    """
    runs = measured_runs(given, of_force=True)
    if len(runs) > 1:
        names = ", ".join(repr(run.name) for run in runs)
        raise click.UsageError(f"--column {given.column!r} means {names}; allowed here: one column")
    return runs[0]


def _ask_for_force(source: str, signal: Any) -> None:
    """Refuse readings of another quantity."""
    from chaosgym.errors import DiagnosisError

    if signal.unit != "N":
        raise DiagnosisError(
            f"{source}: column {signal.name!r} is in {signal.unit}, and this asks for a force; state --scale, such as "
            "'100 mV/N'"
        )


@patience("read and judge the recording")
def measured_sweep(source: str, speed: str | None, given: Measured) -> tuple[Any, Any, Any, dict[str, Any]]:
    """Read and judge peaks at many speeds: speeds, peaks, their types, and where they come from."""
    import numpy as np

    from chaosgym.errors import DiagnosisError
    from chaosgym.recordings.columns import check_peaks, choose_force, choose_speed
    from chaosgym.recordings.measured_sweep import sweep_types
    from chaosgym.recordings.read import read_recording

    recording = read_recording(source, sheet=given.sheet, column=given.column)
    at = choose_speed(recording, speed)
    force = choose_force(recording, given.column, given.unit, given.scale)
    _ask_for_force(recording.source, force)
    if at.name == force.name:
        raise DiagnosisError(f"{recording.source}: column {at.name!r} can't be both speed and force; use --column NAME")
    if len(at.values) != len(force.values):
        raise DiagnosisError(
            f"{recording.source} has {len(at.values)} speeds and {len(force.values)} peaks; needed: as many"
        )
    known = np.isfinite(at.values) & np.isfinite(force.values)
    speeds, peaks = at.values[known], check_peaks(force._replace(values=force.values[known]), recording)
    try:
        found = sweep_types(speeds, peaks, sensor_error=given.sensor_error, sensor_sigma=given.sensor_sigma)
    except DiagnosisError as error:
        raise DiagnosisError(f"{recording.source}: {error}") from error
    told = {
        "file": recording.source,
        "sha256": recording.sha256,
        "speed_column": at.name,
        "speed_unit": recording.units.get(at.name, ""),
        "column": force.name,
        "notes": [f"read {force.described}", at.described],
    }
    return speeds, peaks, found, told


def run_lines(subject: str, run: Run) -> list[str]:
    """Lines for people: nature, why, what was left out, how the readings lie, and what was read."""
    from chaosgym.design.statistics import summary

    told = summary(run.peaks)
    how = force_line(told) if run.unit == "N" else reading_line(told, run.unit)
    lines = verdict_lines(subject, run.verdict.diagnosis, [how], run.verdict.remarks)
    return [*lines, *(f"  {note}" for note in run.notes)]


def run_as_dict(run: Run) -> dict[str, Any]:
    """Values of a run for JSON."""
    from chaosgym.design.statistics import summary

    return {
        "file": run.source,
        "column": run.name,
        "sha256": run.sha256,
        **run.verdict.as_dict(),
        "peak_force_summary_N" if run.unit == "N" else "peak_summary": summary(run.peaks),
        "warnings": [*run.verdict.notes, *run.notes],
    }
