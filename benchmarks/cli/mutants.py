"""The command ``mutants`` of ``python -m benchmarks``."""

from pathlib import Path

import click

from chaosgym.cli.output import AS_JSON, emit


@click.command()
@click.option("--out", type=click.Path(dir_okay=False), default="runs/mutants.jsonl", show_default=True, help="Rows.")
@click.option("--count", type=click.IntRange(1, 10**5), default=600, show_default=True, help="Changes of the sample.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--wing", "wings", multiple=True, help="Of these folders alone.")
@click.option("--most", type=click.IntRange(0), default=None, help="Stop after so many; the same command goes on.")
@click.option("--equivalent", multiple=True, type=int, help="Number of a change that means nothing; left out.")
@AS_JSON
def mutants(
    out: str,
    count: int,
    seed: int,
    wings: tuple[str, ...],
    most: int | None,
    equivalent: tuple[int, ...],
    as_json: bool,
) -> None:
    """Try changes of every module but kernels, each with the tests of its wing, and tell the share that is noticed."""
    from benchmarks.mutants import run, score

    file = Path(out)
    file.parent.mkdir(parents=True, exist_ok=True)
    run(file, count, seed, wings, most=most)
    found = score(file, equivalent)
    emit(found, as_json, lambda: [f"{name}: {value}" for name, value in found.items()])
