"""The commands ``classify`` and ``train-classifier``."""

import os
import sys
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from chaosgym.cli.judge import run_lines
from chaosgym.cli.machine_options import machine_command
from chaosgym.cli.options import FloatRange, IntRange, recording_options
from chaosgym.cli.output import AS_JSON, emit, patience, picture_path, plot_option

if TYPE_CHECKING:
    from chaosgym.recordings.kind import RecordingOptions
    from chaosgym.recordings.runs import Run

OTHER_FILES = ("--model", "--batch", "--out", "--plot")
"""Options whose word may be the name of a file that is no record."""


def _quick_start(arguments: list[str]) -> None:
    """Run the Python source of the kernels for one record, or parameters alone: loading machine code takes longer."""
    pairs = [*pairwise(arguments)]
    record = any((word == "-" or Path(word).is_file()) and before not in OTHER_FILES for before, word in pairs)
    learned = record or "--budget-us=0" in arguments or ("--budget-us", "0") in pairs
    own = any(Path(word).suffix == ".toml" for word in arguments)  # reading a machine's file runs kernels
    if learned and not (own or "--batch" in arguments or "numba" in sys.modules):
        os.environ["NUMBA_DISABLE_JIT"] = "1"


@machine_command(before=_quick_start)
@click.argument("file", metavar="[FILE]", required=False)
@click.option(
    "--budget-us",
    type=FloatRange(0.0),
    help="Processor time [us] for the answer; 0: from parameters alone. Default: what it takes to be sure.",
)
@click.option("--nature-only", is_flag=True, help="Don't judge the type, which needs the four neighbours.")
@click.option("--batch", type=click.Path(exists=True, dir_okay=False), help="Judge every row of a Parquet file.")
@click.option("--out", type=click.Path(dir_okay=False), help="Parquet file for the answers of --batch.")
@recording_options(("sensor-error",))
@click.option(
    "--model", type=click.Path(exists=True, dir_okay=False), help="Classifier file; default: the shipped one."
)
@plot_option()
def classify(
    machine: Any,
    file: str | None,
    options: "RecordingOptions",
    budget_us: float | None,
    nature_only: bool,
    batch: str | None,
    out: str | None,
    model: str | None,
    plot: str | None,
    as_json: bool,
) -> None:
    """Tell response type (I, II, III) and nature by as few cycles as it takes, with proof where periodic.

    With FILE, what was recorded of the machine: the verdict of all tests, and what the classifier has learned beside.
    """
    from chaosgym.classifier import MachineClassifier, classifier_for
    from chaosgym.recordings.kind import RecordingOptions

    if bool(batch) != bool(out):
        raise click.UsageError("--batch FILE and --out FILE belong together: give both or neither")
    if file and (batch or nature_only or budget_us is not None):
        raise click.UsageError("FILE goes without --batch, --nature-only and --budget-us, which are of machines")
    if not file and (plot or options != RecordingOptions()):
        raise click.UsageError(f"--plot and options of a recording need one: classify {machine.name} FILE")
    classifier = MachineClassifier.load(model) if model else classifier_for(machine)
    if classifier.machine.name != machine.name:
        raise click.UsageError(f"--model {model} knows {classifier.machine.name}, not {machine.name}")
    if file:
        _classify_recording(classifier, file, options, plot, as_json)
    elif batch and out:
        _classify_batch(classifier, batch, out, budget_us, not nature_only, as_json)
    else:
        with patience("classify"):
            answer = classifier.classify(machine, budget_us=budget_us, types=not nature_only)
        emit({"machine": machine.name, **answer.as_dict()}, as_json, lambda: _machine_lines(machine.name, answer))


def _machine_lines(name: str, answer: Any) -> list[str]:
    centre = answer.centre
    if answer.abstained:
        head = f"{name}: no answer: {centre.reason}"
    else:
        period = f", period {centre.period}" if centre.period else ""
        kind = f"Type {answer.response_type} from {answer.begun}, " if answer.response_type else ""
        proven = "proven" if centre.proven else f"probability {centre.probability:.3f}"
        head = f"{name}: {kind}{centre.nature}{period}; {proven} by {centre.stage} ({centre.cycles} cycles simulated)"
    lines = [
        head,
        *_bars({**{f"Type {key}": p for key, p in answer.type_probabilities.items()}, **centre.probabilities}),
    ]
    if answer.type_reason:
        lines.append(f"  type: {answer.type_reason}{'; every nature proven' if answer.type_proven else ''}")
        lines.append(f"  {answer.searched}")
    if centre.largest_peak is not None:
        lines.append(f"  largest peak force {centre.largest_peak:.1f} N")
    return [*lines, f"  {answer.microseconds / 1e3:.2f} ms, the nature {centre.microseconds / 1e3:.2f} ms"]


def _bars(chances: dict[str, float]) -> list[str]:
    return [f"  {name:12s} {'#' * round(40 * chance):40s} {chance:.3f}" for name, chance in chances.items()]


def _learned_lines(answer: Any) -> list[str]:
    chances = _chances(answer)
    if not chances:
        return [f"  learned: no answer: {answer.reason}"]
    told = {True: "irregular beyond the sensor's error", False: "regular to the sensor", None: "irregularity unknown"}
    nature = answer.nature if answer.nature_probabilities else f"no answer ({answer.reason})"
    head = f"  learned: {told[answer.irregular]}, amplitude {answer.amplitude:.3g} N; exact nature: {nature}"
    warning = [f"  warning: {answer.warning}"] if answer.warning else []
    return [head, *_bars(chances), *warning]


def _classify_recording(
    classifier: Any, file: str, options: "RecordingOptions", plot: str | None, as_json: bool
) -> None:
    """Print the one verdict on each run, and the classifier's chances where they agree with it."""
    from chaosgym.recordings.runs import judged_runs

    name = classifier.machine.name
    picture = picture_path(plot, f"classify-{name}")
    with patience("read and judge the recording"):
        runs = judged_runs(file, options, several=True, of_force=True)
        answers = [_record_answer(classifier, run, options) for run in runs]
    both = [*zip(runs, answers, strict=True)]
    results = [{**answer.as_dict(), "verdict": run.as_dict()} for run, answer in both]
    of_one = {"runs": {run.name: one for run, one in zip(runs, results, strict=True)}} if len(runs) > 1 else results[0]
    emit(
        {"machine": name, **of_one},
        as_json,
        lambda: [
            line
            for run, answer in both
            for line in (
                *run_lines(run.name if len(runs) > 1 else f"{name}, measured", run),
                *_learned_lines(answer),
            )
        ],
        picture,
        lambda plots: plots.classified_figure(
            [(run.name, run.peaks, run.verdict.diagnosis, _chances(answer)) for run, answer in both]
        ),
    )


def _record_answer(classifier: Any, run: "Run", options: "RecordingOptions") -> Any:
    from chaosgym.errors import DiagnosisError
    from chaosgym.series.noise import stated_error

    error = stated_error(options.sensor_error, options.sensor_sigma)
    half_width = None if error is None else error.half_width
    try:
        return classifier.classify_record(run.peaks, sensor_error=half_width).under(run.verdict.diagnosis)
    except DiagnosisError as why:
        raise DiagnosisError(f"{run.source}, run {run.name!r}: {why}") from why


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


@click.command("train-classifier")
@click.option(
    "--data",
    type=click.Path(exists=True, file_okay=False),
    required=True,
    multiple=True,
    help="Folder of a finished sweep; repeatable, one classifier each.",
)
@click.option("--out", type=click.Path(), required=True, help="New folder: classifier, report and card; one a machine.")
@click.option("--seed", type=IntRange(0), default=0, show_default=True)
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
