"""What does the learned classifier say of a machine, of measured records, of many at once, or live? ``classify``."""

import os
import sys
from collections.abc import Iterable
from typing import Any

import click

from chaosgym.cli.machine_options import machine_command
from chaosgym.cli.measured_options import Measured, measured_options, measured_runs, run_as_dict, verdict_lines
from chaosgym.cli.output import emit
from chaosgym.machines.registry import MACHINES


def _quick_start(arguments: list[str]) -> None:
    """Run the Python source of the kernels for one question: loading their machine code would take longer."""
    if not ({"--follow", "--batch"} & set(arguments) or "numba" in sys.modules):
        os.environ["NUMBA_DISABLE_JIT"] = "1"


@machine_command(required=False, before=_quick_start)
@click.option("--follow", is_flag=True, help="Judge peaks from standard input as they come, one a line: a monitor.")
@click.option("--batch", type=click.Path(exists=True, dir_okay=False), help="Judge every row of a Parquet file.")
@click.option("--out", type=click.Path(dir_okay=False), help="Parquet file for the answers of --batch.")
@measured_options
@click.option(
    "--model", type=click.Path(exists=True, dir_okay=False), help="Classifier file; default: the shipped one."
)
def classify(
    machine: Any,
    measured: Measured,
    follow: bool,
    batch: str | None,
    out: str | None,
    model: str | None,
    as_json: bool,
) -> None:
    """Tell the response type (I, II, III) and the nature by the learned classifier, without simulating."""
    if machine is None:
        raise click.UsageError(f"give a machine: {', '.join(MACHINES)}")
    if sum(map(bool, (measured, follow, batch))) > 1:
        raise click.UsageError("--peaks or --series, --follow and --batch exclude each other")
    if bool(batch) != bool(out):
        raise click.UsageError("--batch FILE and --out FILE belong together: give both or neither")
    half_width = _half_width(measured, follow)
    from chaosgym.classifier import MachineClassifier, default_classifier

    classifier = MachineClassifier.load(model) if model else default_classifier(machine.name)
    if classifier.machine.name != machine.name:
        raise click.UsageError(f"--model {model} knows {classifier.machine.name}, not {machine.name}")
    if follow:
        _follow(classifier, sys.stdin, half_width, as_json)
    elif measured:
        _classify_measured(classifier, measured, half_width, as_json)
    elif batch and out:
        _classify_batch(classifier, batch, out, as_json)
    else:
        answer = classifier.classify(machine)
        emit({"machine": machine.name, **answer.as_dict()}, as_json, lambda: _lines(machine.name, answer))


def _lines(subject: str, answer: Any) -> list[str]:
    if answer.abstained:
        head = f"{subject}: no answer: {answer.reason}"
    else:
        period = f", period {answer.period}" if answer.period else ""
        head = f"{subject}: Type {answer.response_type}, {answer.nature}{period}"
    bars = [
        f"  {name:12s} {'#' * round(40 * chance):40s} {chance:.3f}"
        for name, chance in (
            *((f"Type {kind}", chance) for kind, chance in answer.probabilities.items()),
            *answer.nature_probabilities.items(),
        )
    ]
    forces = ", ".join(f"{name}: {force:.1f}" for name, force in (answer.peak_force or {}).items())
    return [head, *bars, *([f"  peak force of a settled cycle [N], quantiles {forces}"] if forces else [])]


def _half_width(measured: Measured, follow: bool) -> float | None:
    """Half width [N] of the stated error; None if none is stated."""
    from chaosgym.signals.noise import stated_error

    told = stated_error(measured.sensor_error, measured.sensor_sigma)
    if told is not None and not (measured or follow):
        raise click.UsageError("--sensor-error belongs to --peaks, --series or --follow")
    return None if told is None else told.half_width


def _classify_measured(classifier: Any, measured: Measured, half_width: float | None, as_json: bool) -> None:
    """Print the one verdict on each run, and the classifier's chances as further evidence."""
    from chaosgym.errors import DiagnosisError

    machine = classifier.machine.name
    results, lines = {}, []
    runs = measured_runs(measured, several=True)
    for run in runs:
        try:
            learned = classifier.classify_record(run.peaks, sensor_error=half_width)
        except DiagnosisError as error:
            raise DiagnosisError(f"{run.source}, run {run.name!r}: {error}") from error
        verdict = run.verdict.diagnosis
        results[run.name] = {
            **learned.as_dict(),
            "nature": verdict.nature,
            "period": verdict.period,
            "learned_nature": learned.nature,
            "verdict": run_as_dict(run),
        }
        lines += verdict_lines(f"{machine}, measured" if len(runs) == 1 else run.name, run)
        lines += [
            f"  learned {line.strip()}" if not place else line for place, line in enumerate(_lines(machine, learned))
        ]
    (only,) = results.values() if len(results) == 1 else (None,)
    result = {"machine": machine, **only} if only else {"machine": machine, "runs": results}
    emit(result, as_json, lambda: lines)


def _classify_batch(classifier: Any, source: str, out: str, as_json: bool) -> None:
    from chaosgym.classifier.batch import classify_file

    summary = classify_file(classifier, source, out)
    emit(
        summary,
        as_json,
        lambda: [
            f"{summary['rows']} rows judged, {summary['abstained']} of them without an answer; written to {out}",
            *(f"  Type {name:4s} {count}" for name, count in summary["response_types"].items()),
        ],
    )


def _follow(classifier: Any, lines: Iterable[str], sensor_error: float | None, as_json: bool) -> None:
    """Print a verdict each cycle; the last 64 cycles count."""
    from chaosgym.classifier.features import MIN_CYCLES
    from chaosgym.signals.read import parse_reading

    record: list[float] = []
    for number, line in enumerate(lines, start=1):
        peak = parse_reading(line, number, first=not record)
        if peak is None:
            continue
        if peak < 0.0:
            raise click.UsageError(
                f"standard input, line {number}: {peak:g} N is a negative force; allowed: 0 and more"
            )
        record.append(peak)
        missing = MIN_CYCLES - len(record)
        answer = classifier.classify_record(record, sensor_error=sensor_error) if missing <= 0 else None
        _emit_cycle(len(record), peak, answer, missing, as_json)
    if not record:
        raise click.UsageError("--follow found no peak on standard input")


def _emit_cycle(cycle: int, peak: float, answer: Any, missing: int, as_json: bool) -> None:
    if answer is None:
        verdict = f"waiting for {missing} more cycle{'s' if missing > 1 else ''}"
        result = {"cycle": cycle, "response_type": None, "nature": None, "abstained": True, "reason": verdict}
    else:
        period = f", period {answer.period}" if answer.period else ""
        told = f"Type {answer.response_type}, {answer.nature}{period} ({answer.confidence:.2f})"
        verdict = answer.reason if answer.abstained else told
        result = {"cycle": cycle, **answer.as_dict()}
    emit(result, as_json, lambda: [f"{cycle:6d}  {peak:9.2f} N  {verdict}"])
    sys.stdout.flush()
