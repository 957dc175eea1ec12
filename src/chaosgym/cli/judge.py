"""Verdicts on recordings: ``judge`` a file, ``judge-sweep`` one of many speeds, ``run-up`` one of changing speed."""

import datetime
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from chaosgym.cli.options import FILE, OF_RUN_UP, OF_SWEEP, FloatRange, Quantity, recording_options
from chaosgym.cli.output import (
    AS_JSON,
    emit,
    force_line,
    patience,
    picture_path,
    plot_option,
    reading_line,
    verdict_lines,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chaosgym.design.bearing import Criteria
    from chaosgym.design.measured import MeasuredPeaks
    from chaosgym.recordings.kind import RecordingOptions
    from chaosgym.recordings.measured_verdict import MeasuredVerdict
    from chaosgym.recordings.runs import JudgedFile, Run
    from chaosgym.recordings.swept_files import JudgedRunUp, JudgedSweep


@click.command()
@FILE
@recording_options()
@click.option("--load-rating", type=Quantity("N"), help="Load rating of the surface: tell the life of its bearing too.")
@click.option("--report", type=click.Path(dir_okay=False), help="Report to write (.html or .pdf), and JSON beside it.")
@click.option("--overwrite", is_flag=True, help="Replace the report if it exists.")
@plot_option()
@AS_JSON
def judge(
    file: str,
    options: "RecordingOptions",
    load_rating: float | None,
    report: str | None,
    overwrite: bool,
    plot: str | None,
    as_json: bool,
) -> None:
    """Tell whether a recording is periodic or chaotic, and why.

    FILE holds one reading a cycle or a series over time: CSV, Parquet, .npy, .mat, WAV and recorders' own formats. It
    may be -, a folder, or a pattern of files.
    """
    from chaosgym.recordings.runs import JudgedFile, judged_files, judged_run

    picture = picture_path(plot, "judge")
    if report is not None:
        from chaosgym.plotting.design_report import report_paths

        report_paths(report, overwrite)
    criteria = None if load_rating is None else _criteria(load_rating)
    with patience("read and judge the recording"):
        if criteria is None:
            files = judged_files(file, options, progress=True, traced=report is not None)
        else:
            run = judged_run(file, options, traced=report is not None)
            files = (JudgedFile(run.source, (run,)),)
    life = None if criteria is None else _life(files[0].runs[0], criteria)
    result, lines, draw = _answer(files, life)
    if report is not None:
        lines = [*lines, _written(report, files, life, result, overwrite)]
    emit(result, as_json, lambda: lines, picture, draw)


def _criteria(load_rating: float) -> "Criteria":
    """What a bearing surface of a load rating [N] is judged by."""
    from chaosgym.design.bearing import Criteria

    return Criteria(load_rating=load_rating, stated={"load_rating": "--load-rating"})


def _life(run: "Run", criteria: "Criteria") -> "MeasuredPeaks":
    """What recorded forces mean for a bearing surface."""
    from chaosgym.design.measured import evaluate_run

    return evaluate_run(run, criteria, date=datetime.date.today().isoformat())


def _answer(
    files: "tuple[JudgedFile, ...]", life: "MeasuredPeaks | None"
) -> "tuple[dict[str, Any], list[str], Callable[[Any], Figure]]":
    """Result, lines for people and picture: of a life, of one column, or of several."""
    from chaosgym.recordings.runs import table_as_dict

    runs = [run for one in files for run in one.runs]
    if life is not None:
        lines = [*life.lines(), *runs[0].notes]
        return life.as_dict(), lines, lambda plots: plots.peaks_figure(life)
    if len(files) == len(runs) == 1 and not files[0].error:
        (run,) = runs
        return run.as_dict(), run_lines(run.source, run), lambda plots: plots.measured_figure(run)
    shown = [(run.title, run.peaks, run.verdict.diagnosis) for run in runs]
    return table_as_dict(files), table_lines(files), lambda plots: plots.thumbnails(shown)


def _written(
    report: str,
    files: "tuple[JudgedFile, ...]",
    life: "MeasuredPeaks | None",
    result: dict[str, Any],
    overwrite: bool,
) -> str:
    """Where the report was written."""
    from chaosgym.plotting.design_report import report_line, write_report
    from chaosgym.plotting.recording_report import recording_report

    page = recording_report(files, life, date=datetime.date.today().isoformat())
    return report_line(write_report(page, result, report, overwrite))


@click.command("judge-sweep")
@FILE
@click.option("--speed-column", metavar="NAME", help="Column of the speed, where there are several.")
@recording_options(("column", "sensor-error"), OF_SWEEP)
@plot_option()
@AS_JSON
def judge_sweep(
    file: str, speed_column: str | None, options: "RecordingOptions", plot: str | None, as_json: bool
) -> None:
    """Tell the types (I, II, III) of a measured sweep: peak forces at many speeds, a line a cycle with its speed.

    FILE may be a folder, or a pattern of files, such as one a speed.
    """
    from chaosgym.recordings.swept_files import judged_sweep

    picture = picture_path(plot, "judge-sweep")
    with patience("read and judge the recording"):
        sweep = judged_sweep(file, options, speed_column=speed_column)
    title = f"Types of {Path(sweep.recording.source).name}"
    emit(
        {**sweep.as_dict(), "warnings": []},
        as_json,
        lambda: _sweep_lines(sweep),
        picture,
        lambda plots: plots.sweep_figure(sweep.speeds, sweep.peaks, sweep.types, sweep.speed_label, title),
    )


def _sweep_lines(sweep: "JudgedSweep") -> list[str]:
    """Regions of types, upwards, then what was read."""
    first = f"{sweep.recording.source}: {len(sweep.types.speeds)} speeds"
    return [first, *region_lines(sweep.types, sweep.speed.unit, "N"), *(f"  {note}" for note in sweep.notes)]


@click.command("run-up")
@FILE
@click.option("--orders", type=FloatRange(1.0, 1000.0), metavar="NUMBER", help="Highest order; default 20.")
@recording_options(("column", "rate-hz", "tachometer", "pulses-per-revolution", "sensor-error"), OF_RUN_UP)
@plot_option()
@AS_JSON
def run_up(file: str, orders: float | None, options: "RecordingOptions", plot: str | None, as_json: bool) -> None:
    """Tell orders, and types by bands of speed, of a recording whose speed changes; it needs a tachometer."""
    from chaosgym.recordings.run_up import HIGHEST_ORDER
    from chaosgym.recordings.swept_files import judged_run_up

    picture = picture_path(plot, "run-up")
    with patience("read and judge the run-up"):
        judged = judged_run_up(file, options, highest=orders or HIGHEST_ORDER)
    title = f"{Path(judged.recording.source).name}, {judged.signal.name}"
    emit(
        {**judged.as_dict(), "warnings": []},
        as_json,
        lambda: _run_up_lines(judged),
        picture,
        lambda plots: plots.run_up_figure(judged.result, title, judged.signal.unit),
    )


def _run_up_lines(judged: "JudgedRunUp") -> list[str]:
    """Turns and speeds, orders, the envelope, types, and what was read."""
    result, unit = judged.result, judged.signal.unit
    speeds = result.speeds
    lines = [
        f"{judged.recording.source}: {result.turns.angles[-1]:.0f} turns, {speeds[0]:.4g} to {speeds[-1]:.4g} rpm"
        f" (between {speeds.min():.4g} and {speeds.max():.4g} rpm)"
    ]
    lines += [_order_line(line, unit) for line in result.lines]
    if result.envelope:
        named = ", ".join(f"{round(line.order, 2):g}" for line in result.envelope)
        lines.append(f"  envelope of the ringing above: orders {named}, the strongest first")
    lines += [_fixed_line(line, unit) for line in result.fixed]
    lines += [] if result.types is None else region_lines(result.types, "rpm", unit)
    return [*lines, *(f"  {note}" for note in judged.notes)]


def _fixed_line(line: Any, unit: str) -> str:
    """A frequency that does not follow the speed."""
    told = "a line" if line.damping is None else f"a resonance, damping {100.0 * line.damping:.2g} %,"
    return f"  {line.frequency:.4g} Hz: {told} of {line.amplitude:.3g} {unit} at all speeds, no order"


def _order_line(line: Any, unit: str) -> str:
    """An order and how large it becomes."""
    largest = f"up to {line.largest:.4g} {unit} at {60.0 * line.speed:.4g} rpm"
    return f"  order {round(line.order, 2):<6g} {largest}, {line.typical:.3g} {unit} over all speeds"


def run_lines(subject: str, run: "Run") -> list[str]:
    """Lines for people: nature, why, what was left out, how the readings lie, and what was read."""
    from chaosgym.numbers import summary

    how = force_line(summary(run.peaks)) if run.unit == "N" else reading_line(summary(run.peaks), run.unit)
    lines = verdict_lines(subject, run.verdict.diagnosis, [how], run.verdict.remarks)
    return [*lines, *(f"  {note}" for note in run.notes)]


COLUMNS = ("file", "channel", "verdict", "scatter", "cycles")


def table_lines(files: "Iterable[JudgedFile]") -> list[str]:
    """A line for each run, then the reasons of what sensors say together, and of what was not judged."""
    from chaosgym.recordings.runs import not_judged

    files = list(files)
    rows: list[tuple[str, ...]] = [COLUMNS]
    reasons = []
    for one in files:
        name = Path(one.source).name
        rows += [_row(name, run.name, run.verdict, len(run.peaks)) for run in one.runs]
        if one.together is not None:
            rows.append(_row(name, "together", one.together, len(one.runs[0].peaks)))
            reasons.append(f"{name}: {one.together.diagnosis.reason}")
    widths = [max(len(row[place]) for row in rows) for place in range(len(COLUMNS))]
    lines = ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    return [*lines, *(f"  {reason}" for reason in [*reasons, *not_judged(files)])]


def _row(name: str, channel: str, verdict: "MeasuredVerdict", cycles: int) -> tuple[str, ...]:
    share = verdict.coefficient_of_variation
    scatter = "" if share is None else f"{100.0 * share:.2g} %"
    return name, channel, verdict.diagnosis.words, scatter, str(cycles)


MOST_UNTOLD = 2
"""Beginnings of irregular motion without a route that have a line each."""


def region_lines(types: Any, speed_unit: str, unit: str) -> list[str]:
    """Regions of types, upwards, and where irregular motion begins."""
    after, rows = f" {speed_unit}" if speed_unit else "", []
    for region in types.regions:
        span = f"{region.first:.6g}" + (f" to {region.last:.6g}" if region.speeds > 1 else "") + after
        inside = [one for one in types.speeds if region.first <= one.speed <= region.last]
        wild = sum(one.nature == "irregular" for one in inside)
        natures = f"irregular at {wild} of {len(inside)} speeds" if wild else "periodic"
        forces = f"mean peak {region.lowest_mean:.4g} to {region.highest_mean:.4g} {unit}"
        rows.append(f"  Type {region.type:4s} {span:18s} {natures}, {forces}")
    untold = [one for one in types.beginnings if one.route == "not told"]
    for one in types.beginnings:
        if one not in untold or len(untold) <= MOST_UNTOLD:
            route = "route not told" if one.route == "not told" else one.route
            rows.append(
                f"  irregular between {one.periodic:.6g} and {one.irregular:.6g}{after}: {route}; {one.because}"
            )
    if len(untold) > MOST_UNTOLD:
        places = ", ".join(f"{speed:.6g}" for speed in sorted({one.irregular for one in untold}))
        rows.append(f"  becomes irregular at {places}{after}, by no route that is told")
    return rows
