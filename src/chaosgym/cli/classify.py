"""What does the learned classifier say, and how is it trained? ``classify`` and ``train-classifier``."""

from typing import Any

import click

from chaosgym.cli.machine_options import machine_command
from chaosgym.cli.output import emit


@click.command()
@machine_command
@click.option(
    "--model", type=click.Path(exists=True, dir_okay=False), help="Classifier file; default: the shipped one."
)
def classify(machine: Any, model: str | None, as_json: bool) -> None:
    """Tell the response type (I, II, III) by the learned classifier, without simulating."""
    from chaosgym.classifier import ResponseClassifier, default_classifier

    classifier = ResponseClassifier.load(model) if model else default_classifier(machine.name)
    answer = classifier.classify(machine)
    result = {
        "machine": machine.name,
        "response_type": answer.response_type,
        "probabilities": answer.probabilities,
    }
    emit(result, as_json, lambda: [
        f"{machine.name}: Type {answer.response_type}",
        *(f"  Type {name:4s} {'#' * round(40 * chance):40s} {chance:.3f}"
          for name, chance in answer.probabilities.items()),
    ])  # fmt: skip


@click.command("train-classifier")
@click.option(
    "--data", type=click.Path(exists=True, file_okay=False), required=True, help="Folder of a finished sweep."
)
@click.option("--out", type=click.Path(dir_okay=False), required=True, help="Model file to write (.npz).")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def train_classifier(data: str, out: str, seed: int, as_json: bool) -> None:
    """Train the classifier on a sweep and judge it beside its baselines (needs the extra [learn])."""
    from pathlib import Path

    from chaosgym.classifier.train import report_table
    from chaosgym.classifier.train import train_classifier as train
    from chaosgym.sweeps import read_sweep

    if Path(out).exists() or not Path(out).absolute().parent.is_dir():
        raise click.UsageError(f"--out {out} exists already, or its folder does not; choose another file")
    trained = train(read_sweep(data), seed, progress=True)
    trained.classifier.save(out)
    emit({"model": out, **trained.report}, as_json, lambda: report_table(trained.report))
