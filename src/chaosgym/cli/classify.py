"""What does the learned classifier say of a machine, of measured records, of many at once, or live? ``classify``."""

import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click

from chaosgym.cli.machine_options import machine_command
from chaosgym.cli.output import emit
from chaosgym.machines.registry import MACHINES


def _quick_start(arguments: list[str]) -> None:
    """Run the Python source of the kernels for one question: loading their machine code would take longer."""
    if not ({"--follow", "--batch"} & set(arguments) or "numba" in sys.modules):
        os.environ["NUMBA_DISABLE_JIT"] = "1"


@machine_command(required=False, before=_quick_start)
@click.option(
    "--peaks", type=click.Path(), help="Judge measured peak forces [N]: CSV, one run a column; - is standard input."
)
@click.option("--follow", is_flag=True, help="Judge peaks from standard input as they come, one a line: a monitor.")
@click.option("--sensor-error", type=click.FloatRange(0.0), help="Largest error of a measured peak [N], if known.")
@click.option("--batch", type=click.Path(exists=True, dir_okay=False), help="Judge every row of a Parquet file.")
@click.option("--out", type=click.Path(dir_okay=False), help="Parquet file for the answers of --batch.")
@click.option(
    "--model", type=click.Path(exists=True, dir_okay=False), help="Classifier file; default: the shipped one."
)
def classify(
    machine: Any,
    peaks: str | None,
    follow: bool,
    sensor_error: float | None,
    batch: str | None,
    out: str | None,
    model: str | None,
    as_json: bool,
) -> None:
    """Tell the response type (I, II, III) and the nature by the learned classifier, without simulating."""
    if machine is None:
        raise click.UsageError(f"give a machine: {', '.join(MACHINES)}")
    if sum(map(bool, (peaks, follow, batch))) > 1:
        raise click.UsageError("--peaks, --follow and --batch exclude each other")
    if bool(batch) != bool(out):
        raise click.UsageError("--batch FILE and --out FILE belong together: give both or neither")
    if sensor_error is not None and not (peaks or follow):
        raise click.UsageError("--sensor-error belongs to --peaks or --follow")
    from chaosgym.classifier import MachineClassifier, default_classifier

    classifier = MachineClassifier.load(model) if model else default_classifier(machine.name)
    if classifier.machine.name != machine.name:
        raise click.UsageError(f"--model {model} knows {classifier.machine.name}, not {machine.name}")
    if follow:
        _follow(classifier, sys.stdin, sensor_error, as_json)
    elif peaks:
        _classify_peaks(classifier, peaks, sensor_error, as_json)
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


def _classify_peaks(classifier: Any, source: str, sensor_error: float | None, as_json: bool) -> None:
    from chaosgym.classifier.peak_files import read_peaks
    from chaosgym.errors import DiagnosisError

    runs = read_peaks(sys.stdin if source == "-" else Path(source))
    answers = {}
    for name, record in runs.items():
        try:
            answers[name] = classifier.classify_record(record, sensor_error=sensor_error)
        except DiagnosisError as error:
            raise DiagnosisError(f"{'standard input' if source == '-' else source}, run {name!r}: {error}") from error
    machine = classifier.machine.name
    if len(answers) == 1:
        (answer,) = answers.values()
        emit({"machine": machine, **answer.as_dict()}, as_json, lambda: _lines(f"{machine}, measured", answer))
        return
    result = {"machine": machine, "runs": {name: answer.as_dict() for name, answer in answers.items()}}
    emit(result, as_json, lambda: [line for name, answer in answers.items() for line in _lines(name, answer)])


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
    from chaosgym.classifier.peak_files import parse_peak

    record: list[float] = []
    for number, line in enumerate(lines, start=1):
        peak = parse_peak(line, number, first=not record)
        if peak is None:
            continue
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
