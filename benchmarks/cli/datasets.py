"""The command ``build-dataset``: the datasets of the repository."""

from pathlib import Path

import click

from chaosgym.cli.output import AS_JSON, WORKERS, emit


@click.command("build-dataset")
@click.argument("machine")
@click.option("--out", type=click.Path(file_okay=False), help="Folder; default: datasets/MACHINE/whole.")
@click.option("--crosses", type=click.IntRange(1), default=None, help="The first N crosses; default: all.")
@click.option(
    "--sample",
    type=click.Path(exists=True, file_okay=False),
    help="Sample to compare with; default: datasets/MACHINE/sample if that is there.",
)
@click.option("--no-check", is_flag=True, help="Compare with no sample.")
@WORKERS
@click.option("--scheduler", metavar="tcp://HOST:PORT", help="Compute on a Dask cluster (extra [cluster]).")
@click.option("--repair", is_flag=True, help="Compute damaged chunks again.")
@AS_JSON
def build_dataset(
    machine: str,
    out: str | None,
    crosses: int | None,
    sample: str | None,
    no_check: bool,
    workers: int | None,
    scheduler: str | None,
    repair: bool,
    as_json: bool,
) -> None:
    """Make a dataset that the repository keeps a sample of; the same command again resumes.

    Settings and drawn machines must be those of the sample. Its rows are compared with the same rows of the dataset;
    exit code 1 if they differ by more than another processor explains.
    """
    from benchmarks.sweeps.build import SAMPLE, WHOLE
    from benchmarks.sweeps.build import build_dataset as make

    if sample and no_check:
        raise click.UsageError("--sample and --no-check exclude each other")
    home = Path("datasets") / machine
    if not sample and not no_check and (home / SAMPLE).is_dir():
        sample = str(home / SAMPLE)
    folder = out or str(home / WHOLE)
    built = make(
        machine,
        folder,
        sample=sample,
        crosses=crosses,
        workers=workers,
        scheduler=scheduler,
        repair=repair,
        progress=True,
    )
    found = built.agreement
    result = {
        "machine": machine,
        "folder": folder,
        "points": len(built.sweep.table),
        "settings": built.settings,
        "drawn": built.drawn,
        "sample": sample,
        "agreement": found and found.as_dict(),
    }
    against = f"those of {sample}" if sample else "compared with no sample"
    lines = [
        f"{machine}: complete, {len(built.sweep.table)} points in {folder}",
        f"  settings {built.settings}, drawn machines {built.drawn}: {against}",
        *([f"  {found.line}"] if found else []),
    ]
    emit(result, as_json, lambda: lines)
    if found and not found.sound:
        raise SystemExit(1)
