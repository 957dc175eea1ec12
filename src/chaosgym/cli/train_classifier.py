"""How is a classifier trained and judged? ``train-classifier``."""

from pathlib import Path

import click

from chaosgym.cli.output import emit


@click.command("train-classifier")
@click.option(
    "--data", type=click.Path(exists=True, file_okay=False), required=True, help="Folder of a finished sweep."
)
@click.option("--out", type=click.Path(), required=True, help="New folder for classifier, report, card and pictures.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option(
    "--model",
    default=None,
    help="boosting, linear, network, or several joined by +; default: the best of three in cross-validation.",
)
@click.option("--curve/--no-curve", default=True, show_default=True, help="Measure the learning curve.")
@click.option(
    "--transfer",
    type=click.Path(exists=True, file_okay=False),
    help="Sweep of another machine, to try records on and to learn from.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def train_classifier(
    data: str, out: str, seed: int, model: str | None, curve: bool, transfer: str | None, as_json: bool
) -> None:
    """Train the classifier on a sweep and judge it beside its baselines (needs the extra [learn])."""
    from benchmarks.classifier.plotting import save_pictures
    from chaosgym.classifier.report import report_table
    from chaosgym.classifier.train import train_classifier as train
    from chaosgym.sweeps import read_sweep
    from chaosgym.sweeps.card import read_noise

    target = Path(out)
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise click.UsageError(f"--out {out} exists already and is not an empty folder; choose another one")
    if not target.absolute().parent.is_dir():
        raise click.UsageError(f"--out {out} lies in a folder that does not exist")
    trained = train(
        read_sweep(data),
        seed,
        model=model,
        curve=curve,
        transfer=read_sweep(transfer) if transfer else None,
        noise=read_noise(data),
        progress=True,
    )
    trained.save(target)
    save_pictures(trained, target)
    emit({"out": out, **trained.report}, as_json, lambda: report_table(trained.report))
