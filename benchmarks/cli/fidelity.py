"""The commands about models: ``stability`` at extremes, ``accuracy`` of chosen ones, ``ladder`` of all of them."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from chaosgym.cli.fidelity import FOLDER, write_result
from chaosgym.cli.machine_options import machine_command
from chaosgym.cli.output import AS_JSON, WORKERS, emit

if TYPE_CHECKING:
    from benchmarks.fidelity.stability import StabilityMap


@machine_command
@WORKERS
@click.option("--out", type=FOLDER, default=None, help="Write stability.json and stability.png there.")
def stability(machine: Any, workers: int | None, out: Path | None, as_json: bool) -> None:
    """Run a machine at every extreme on every rung: an answer within physical bounds, or an error with a name."""
    from benchmarks.fidelity.stability import stability_map

    result = stability_map(machine, workers=workers, progress=True)
    if out is not None:
        from benchmarks.fidelity.stability_figure import stability_figure

        write_result(out, "stability", result.as_dict(), stability_figure(result))
    emit(result.as_dict(), as_json, lambda: _stability_lines(result))


def _stability_lines(result: "StabilityMap") -> list[str]:
    lines = []
    for cell in result.cells:
        ended = f"{cell.largest_peak:10.4g} N" if cell.largest_peak is not None else f"{cell.outcome}: {cell.detail}"
        lines.append(f"{cell.extreme:28s} {cell.model:14s} {ended}")
    counts = ", ".join(f"{result.count(outcome)} {outcome}s" for outcome in ("answer", "named error", "failure"))
    return [*lines, f"{result.machine}: {counts}"]


@click.command()
@click.option("--count", type=click.IntRange(1, 10**6), default=500, show_default=True, help="Random machines.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--tolerance", default="1 %", show_default=True, help="Error of the peak force that is allowed.")
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), required=True, help="Rows (.csv); it goes on.")
@AS_JSON
def accuracy(count: int, seed: int, tolerance: str, out: Path, as_json: bool) -> None:
    """Compare models that a tolerance chooses with finer ones, on random machines of all kinds (takes long)."""
    from benchmarks.fidelity.accuracy import measure, rows_of, summary_of

    for row in measure(out, count, seed, tolerance):
        click.echo(f"{row['index']:>5} {row['kind']:10s} {row['model']:50s} {row['error']}", err=True)
    found = summary_of(rows_of(out), tolerance)
    emit(found, as_json, lambda: [_accuracy_line(kind, shares) for kind, shares in found.items()])


def _accuracy_line(kind: str, shares: dict[str, Any]) -> str:
    told = {name: "-" if value is None else f"{value:.3g}" for name, value in shares.items()}
    return f"{kind:10s} " + ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in told.items())


@click.command()
@click.argument("kind", type=click.Choice(["beam", "crank", "mechanism"]))
@click.option("--count", type=click.IntRange(1, 10**5), default=60, show_default=True, help="Random machines.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@AS_JSON
def ladder(kind: str, count: int, seed: int, as_json: bool) -> None:
    """Error against cost of every model of a ladder, over random machines of a KIND whose motion repeats."""
    from benchmarks.fidelity.ladder import ladder as measure

    rows = measure(kind, count, seed)
    emit({"kind": kind, "machines": count, "rows": rows}, as_json, lambda: _ladder_lines(rows))


def _ladder_lines(rows: list[dict[str, Any]]) -> list[str]:
    lines = [
        "| model | us a cycle | mean | median | nine of ten | largest | same motion |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        shares = " | ".join(f"{100.0 * row[name]:.2g} %" for name in ("mean", "median", "nine_of_ten", "largest"))
        lines.append(f"| {row['model']} | {row['us_a_cycle']:.0f} | {shares} | {row['same_motion']:.2f} |")
    return lines
