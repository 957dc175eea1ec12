"""The command ``calibrate``: which unprinted parameters bring a machine closest to the thesis."""

from pathlib import Path
from typing import Any

import click

from chaosgym.cli.output import AS_JSON, WORKERS, emit

UNFINISHED = 3
"""Exit code of a search that leaves statements out of reach while a bound is active; see ``scorecard.walls``."""


@click.command()
@click.argument("machine", type=click.Choice(["impact-beam", "slider-crank"]))
@click.option(
    "--budget",
    required=True,
    metavar="MINUTES|CANDIDATES",
    help="Of the search, as in 20min, or a number of candidates; the thorough runs that judge it come on top.",
)
@click.option("--out", type=click.Path(file_okay=False), required=True, help="Folder; the same command again resumes.")
@click.option("--leave-out", multiple=True, metavar="FIGURE", help="Figure, such as 3.9, that the search does not see.")
@click.option("--basin", metavar="NAME", help="Beginning of the names of the structures that are searched.")
@click.option(
    "--draws",
    type=click.IntRange(0, 10**6),
    default=0,
    show_default=True,
    help="Candidates drawn over all ranges of each structure, and judged by few runs; the best is where it begins.",
)
@click.option(
    "--neighbours",
    type=click.IntRange(0, 1000),
    default=0,
    show_default=True,
    help="Follow the hits to be expected of so many neighbours of a candidate, not those of itself.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@WORKERS
@AS_JSON
def calibrate(
    machine: str,
    budget: str,
    out: str,
    leave_out: tuple[str, ...],
    basin: str | None,
    draws: int,
    neighbours: int,
    seed: int,
    workers: int | None,
    as_json: bool,
) -> None:
    """Search the parameters that the thesis does not print (needs the extra [calibrate])."""
    from thesis.scorecard.calibrate import calibrate as search
    from thesis.scorecard.search import Budget

    found = search(
        machine,
        Budget.parse(budget),
        Path(out),
        seed=seed,
        left_out=frozenset(leave_out),
        basin=basin,
        draws=draws,
        neighbours=neighbours,
        workers=workers,
        progress=True,
    )
    result = found.as_dict()
    emit(result, as_json, lambda: [*_lines(result, out), *(one.line for one in found.walls)])
    if any(one.unfinished for one in found.walls):
        raise SystemExit(UNFINISHED)


def _lines(result: dict[str, Any], out: str) -> list[str]:
    rates = result["hits_of"]
    lines = [
        f"{result['machine']}: objective {result['objective']:.4f} after {result['candidates']} candidates, "
        f"in the basin of {result['basin']}",
        *(f"  {which:8s} hits {rates[which][0]} of {rates[which][1]} statements" for which in ("best", "present")),
        f"  {'parameter':30s} {'best':>12s} {'near-best candidates':>27s}",
    ]
    for name, best in result["searched"].items():
        low, high = result["near_best"][name]
        lines.append(f"  {name:30s} {best:>12.5g} {f'{low:.5g} to {high:.5g}':>27s}")
    return [*lines, f"every statement: {out}/result.json"]
