"""Training of a classifier: ``train-classifier``."""

from pathlib import Path

import click

from chaosgym.cli.output import emit


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
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def train_classifier(data: tuple[str, ...], out: str, seed: int, as_json: bool) -> None:
    """Train the classifier on a sweep and judge it on machines held out (needs the extra [learn])."""
    from chaosgym.classifier.train import report_table
    from chaosgym.classifier.train import train_classifier as train
    from chaosgym.sweeps import read_sweep

    target = Path(out)
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise click.UsageError(f"--out {out} exists already and is not an empty folder; choose another one")
    if not target.absolute().parent.is_dir():
        raise click.UsageError(f"--out {out} lies in a folder that does not exist")
    reports = {}
    for folder in data:
        trained = train(read_sweep(folder), seed, progress=True)
        name = trained.classifier.machine.name
        trained.save(target / name if len(data) > 1 else target)
        reports[name] = trained.report
    result = {"out": out, **(reports if len(data) > 1 else next(iter(reports.values())))}
    emit(result, as_json, lambda: [line for name, report in reports.items() for line in (name, *report_table(report))])
