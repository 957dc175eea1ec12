"""The commands ``classify`` and ``train-classifier``."""

import os
import sys
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any

import click

from chaosgym.cli.machine_options import FloatRange, Quantity, machine_command
from chaosgym.cli.measured_options import Measured, measured_options, measured_runs, run_as_dict, run_lines
from chaosgym.cli.output import AS_JSON, draw, emit, patience, picture_path, plot_option
from chaosgym.machines import MACHINES

KERNELS = ("--follow", "--batch")
"""Options under which the machine code of the kernels is worth its loading."""


def _quick_start(arguments: list[str]) -> None:
    """Run the Python source of the kernels for one record, or parameters alone: loading machine code takes longer."""
    learned = {"--peaks", "--series", "--budget-us=0"} & {*arguments} or ("--budget-us", "0") in pairwise(arguments)
    if learned and not ({*KERNELS} & {*arguments} or "numba" in sys.modules):
        os.environ["NUMBA_DISABLE_JIT"] = "1"


@machine_command(required=False, before=_quick_start)
@click.option(
    "--budget-us",
    type=FloatRange(0.0),
    help="Processor time [us] for the answer; 0: from parameters alone. Default: what it takes to be sure.",
)
@click.option("--nature-only", is_flag=True, help="Don't judge the type, which needs the four neighbours.")
@click.option("--follow", is_flag=True, help="Watch peaks from standard input, one a line: a monitor with an alarm.")
@click.option("--log", type=click.Path(dir_okay=False), help="CSV file to which --follow appends its events.")
@click.option("--delimiter", metavar="TEXT", help="Between the columns of --follow; default: found from each line.")
@click.option("--timeout-s", type=Quantity("s"), help="Time without a line after which --follow says: stalled.")
@click.option("--batch", type=click.Path(exists=True, dir_okay=False), help="Judge every row of a Parquet file.")
@click.option("--out", type=click.Path(dir_okay=False), help="Parquet file for the answers of --batch.")
@measured_options
@click.option(
    "--model", type=click.Path(exists=True, dir_okay=False), help="Classifier file; default: the shipped one."
)
@plot_option()
def classify(
    machine: Any,
    measured: Measured,
    budget_us: float | None,
    nature_only: bool,
    follow: bool,
    log: str | None,
    delimiter: str | None,
    timeout_s: float | None,
    batch: str | None,
    out: str | None,
    model: str | None,
    plot: str | None,
    as_json: bool,
) -> None:
    """Tell response type (I, II, III) and nature by as few cycles as it takes, with proof where periodic."""
    if machine is None:
        raise click.UsageError(f"give a machine: {', '.join(MACHINES)}")
    if sum(map(bool, (measured, follow, batch))) > 1:
        raise click.UsageError("--peaks or --series, --follow and --batch exclude each other")
    if bool(batch) != bool(out):
        raise click.UsageError("--batch FILE and --out FILE belong together: give both or neither")
    half_width = _half_width(measured, follow)
    if (budget_us is not None or nature_only) and (measured or follow):
        raise click.UsageError("--budget-us and --nature-only belong to a machine or --batch, not to records")
    for name, given in (("--log", log), ("--delimiter", delimiter), ("--timeout-s", timeout_s)):
        if given is not None and not follow:
            raise click.UsageError(f"{name} belongs to --follow")
    if timeout_s is not None and not 0.0 < timeout_s < 1e6:
        raise click.UsageError(f"--timeout-s {timeout_s:g} is out of range; allowed: above 0")
    if plot and not measured:
        raise click.UsageError("--plot goes with --peaks or --series; `chaosgym diagnose` draws a machine")
    if follow:
        from chaosgym.recordings.stream import LineReader

        reader = LineReader(measured.column, delimiter, measured.unit, measured.scale)
        return _follow(sys.stdin, reader, half_width, log, timeout_s, as_json)
    from chaosgym.classifier import MachineClassifier, classifier_for

    classifier = MachineClassifier.load(model) if model else classifier_for(machine)
    if classifier.machine.name != machine.name:
        raise click.UsageError(f"--model {model} knows {classifier.machine.name}, not {machine.name}")
    if measured:
        _classify_measured(classifier, measured, half_width, plot, as_json)
    elif batch and out:
        _classify_batch(classifier, batch, out, budget_us, not nature_only, as_json)
    else:
        with patience("classify"):
            answer = classifier.classify(machine, budget_us=budget_us, types=not nature_only)
        emit({"machine": machine.name, **answer.as_dict()}, as_json, lambda: _machine_lines(machine.name, answer))
    return None


def _machine_lines(name: str, answer: Any) -> list[str]:
    centre = answer.centre
    if answer.abstained:
        head = f"{name}: no answer: {centre.reason}"
    else:
        period = f", period {centre.period}" if centre.period else ""
        kind = f"Type {answer.response_type}, " if answer.response_type else ""
        proven = "proven" if centre.proven else f"probability {centre.probability:.3f}"
        head = f"{name}: {kind}{centre.nature}{period}; {proven} by {centre.stage} ({centre.cycles} cycles simulated)"
    lines = [
        head,
        *_bars({**{f"Type {key}": p for key, p in answer.type_probabilities.items()}, **centre.probabilities}),
    ]
    if answer.type_reason:
        lines.append(f"  type: {answer.type_reason}{'; every nature proven' if answer.type_proven else ''}")
    if centre.largest_peak is not None:
        lines.append(f"  largest peak force {centre.largest_peak:.1f} N")
    return [*lines, f"  {answer.microseconds / 1e3:.2f} ms, the nature {centre.microseconds / 1e3:.2f} ms"]


def _bars(chances: dict[str, float]) -> list[str]:
    return [f"  {name:12s} {'#' * round(40 * chance):40s} {chance:.3f}" for name, chance in chances.items()]


def _half_width(measured: Measured, follow: bool) -> float | None:
    """Half width [N] of the stated error; None if none is stated."""
    from chaosgym.series.noise import stated_error

    told = stated_error(measured.sensor_error, measured.sensor_sigma)
    if told is not None and not (measured or follow):
        raise click.UsageError("--sensor-error belongs to --peaks, --series or --follow")
    return None if told is None else told.half_width


def _learned_lines(answer: Any) -> list[str]:
    chances = _chances(answer)
    if not chances:
        return [f"  learned: no answer: {answer.reason}"]
    told = {True: "irregular beyond the sensor's error", False: "regular to the sensor", None: "irregularity unknown"}
    nature = answer.nature if answer.nature_probabilities else f"no answer ({answer.reason})"
    head = f"  learned: {told[answer.irregular]}, amplitude {answer.amplitude:.3g} N; exact nature: {nature}"
    warning = [f"  warning: {answer.warning}"] if answer.warning else []
    return [head, *_bars(chances), *warning]


def _classify_measured(
    classifier: Any, measured: Measured, half_width: float | None, plot: str | None, as_json: bool
) -> None:
    """Print the one verdict on each run, and the classifier's chances where they agree with it."""
    from chaosgym.errors import DiagnosisError

    machine = classifier.machine.name
    picture = picture_path(plot, f"classify-{machine}")
    results, lines, drawn = {}, [], []
    runs = measured_runs(measured, several=True, of_force=True)
    for run in runs:
        try:
            answer = classifier.classify_record(run.peaks, sensor_error=half_width).under(run.verdict.diagnosis)
        except DiagnosisError as error:
            raise DiagnosisError(f"{run.source}, run {run.name!r}: {error}") from error
        results[run.name] = {**answer.as_dict(), "verdict": run_as_dict(run)}
        lines += run_lines(f"{machine}, measured" if len(runs) == 1 else run.name, run)
        lines += _learned_lines(answer)
        drawn.append((run.name, run.peaks, run.verdict.diagnosis, _chances(answer)))
    (only,) = results.values() if len(results) == 1 else (None,)
    result = {"machine": machine, **only} if only else {"machine": machine, "runs": results}
    draw(picture, lambda plots: plots.classified_figure(drawn), result, lines)
    emit(result, as_json, lambda: lines)


def _chances(answer: Any) -> dict[str, float]:
    """Probabilities that the classifier gives for a record."""
    irregular = {} if answer.irregular_probability is None else {"irregular": answer.irregular_probability}
    return {**irregular, **answer.nature_probabilities}


def _classify_batch(
    classifier: Any, source: str, out: str, budget_us: float | None, types: bool, as_json: bool
) -> None:
    from chaosgym.classifier.batch import classify_file

    summary = classify_file(classifier, source, out, budget_us=budget_us, types=types, progress=True)
    emit(
        summary,
        as_json,
        lambda: [
            f"{summary['rows']} rows judged, {summary['abstained']} of them without an answer; written to {out}",
            *(f"  Type {name:4s} {count}" for name, count in summary["response_types"].items()),
            *(f"  {name:9s} {count}" for name, count in summary["natures"].items()),
        ],
    )


GIVE_UP = 100
"""Lines without a reading after which the stream is taken for the wrong one."""


def _follow(
    lines: Iterable[str],
    reader: Any,
    sensor_error: float | None,
    log: str | None,
    timeout: float | None,
    as_json: bool,
) -> None:
    """Print a verdict each cycle, and a line for every event; what is no reading is counted, warned of and survived."""
    from chaosgym.errors import DiagnosisError
    from chaosgym.recordings.monitor import LONGEST, EventLog, Monitor
    from chaosgym.recordings.stream import stalls

    monitor = Monitor(sensor_error, longest_period=LONGEST)
    with EventLog(log) as events:
        for number, line in stalls(lines, timeout):
            if line is None:
                emit({"event": "stalled", "cycle": monitor.cycle}, as_json, lambda: ["no reading comes  <- stalled"])
                sys.stdout.flush()
                continue
            try:
                peak = reader.read(line, number, first=monitor.cycle == 0)
                if peak is None and (number < GIVE_UP or monitor.cycle):
                    continue
                if peak is None:
                    raise DiagnosisError(f"the first {number} lines hold no reading; state --column and --delimiter")
                seen = monitor.update(peak)
            except DiagnosisError as error:
                if monitor.cycle == 0:
                    raise
                seen = monitor.skip()
                click.echo(f"warning: {error}; left out, {monitor.missing} so far", err=True)
            events.note(seen)
            emit(seen.as_dict(), as_json, lambda: [str(seen)])  # noqa: B023
            sys.stdout.flush()
    if monitor.cycle == 0:
        raise click.UsageError("--follow found no peak on standard input")


@click.command("train-classifier")
@click.option(
    "--data",
    type=click.Path(exists=True, file_okay=False),
    required=True,
    multiple=True,
    help="Folder of a finished sweep; repeatable, one classifier each.",
)
@click.option("--out", type=click.Path(), required=True, help="New folder: classifier, report and card; one a machine.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@AS_JSON
def train_classifier(data: tuple[str, ...], out: str, seed: int, as_json: bool) -> None:
    """Train the classifier on a sweep and judge it on machines held out (needs the extra [learn])."""
    from chaosgym.classifier.train import report_table
    from chaosgym.classifier.train import train_classifier as train
    from chaosgym.files import made_whole
    from chaosgym.sweeps import read_sweep

    if not Path(out).absolute().parent.is_dir():
        raise click.UsageError(f"--out {out} lies in a folder that does not exist")
    reports = {}
    with made_whole(out) as target:
        for folder in data:
            trained = train(read_sweep(folder), seed, progress=True)
            name = trained.classifier.machine.name
            trained.save(target / name if len(data) > 1 else target)
            reports[name] = trained.report
    result = {"out": out, **(reports if len(data) > 1 else next(iter(reports.values())))}
    emit(result, as_json, lambda: [line for name, report in reports.items() for line in (name, *report_table(report))])
