"""The command ``firmness``: which verdicts of the scorecard hold in the neighbourhood, and which are luck."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from chaosgym.cli.output import AS_JSON, WORKERS, emit

if TYPE_CHECKING:
    from thesis.scorecard.firmness import Firmness


@click.command()
@click.argument("machine", type=click.Choice(["impact-beam", "slider-crank"]))
@click.option("--neighbours", type=click.IntRange(2, 10000), default=24, show_default=True)
@click.option("--search", type=click.Path(file_okay=False, exists=True), help="Folder of the search that led here.")
@click.option(
    "--left-out", type=click.Path(file_okay=False, exists=True), multiple=True, help="Search with a figure left out."
)
@click.option("--joint", type=click.Choice(["slider", "ball"]), help="Only the crank's statements about one joint.")
@WORKERS
@AS_JSON
def firmness(
    machine: str,
    neighbours: int,
    search: str | None,
    left_out: tuple[str, ...],
    joint: str | None,
    workers: int | None,
    as_json: bool,
) -> None:
    """Judge neighbours of a machine and write thesis/scorecard/firmness.json, which the scorecard shows.

    The same command again resumes. Without --search and --left-out it keeps what is known of the same constants.
    """
    from thesis.cache import default_folder
    from thesis.scorecard.evaluation import THESIS_MACHINES
    from thesis.scorecard.firmness import exclusive_pairs, firmness_of, judge_neighbours, keep, left_out_hits
    from thesis.scorecard.search import complete_costs

    one = THESIS_MACHINES[machine]
    known = firmness_of(one)
    pairs = exclusive_pairs(complete_costs(Path(search))) if search else known.exclusive if known else ()
    hits = left_out_hits([Path(folder) for folder in left_out]) if left_out else known.left_out if known else (0, 0)
    firm = judge_neighbours(one, neighbours, joint=joint, folder=default_folder(), workers=workers, progress=True)
    keep(one, replace(firm, exclusive=pairs, left_out=hits))
    mean, low, high = firm.expected
    result: dict[str, Any] = {
        "machine": machine,
        "count": neighbours,
        "neighbours": firm.neighbours,
        "firm": len(firm.firm),
        "expected": {"mean": mean, "low": low, "high": high},
        "exclusive": pairs,
        "left_out": {"hit": hits[0], "total": hits[1]},
    }
    emit(result, as_json, lambda: _lines(firm))


def _lines(firm: Firmness) -> list[str]:
    mean, low, high = firm.expected
    shares = [f"  {name}  {share:.0%}" for name, share in firm.neighbours.items()]
    total = len(firm.neighbours)
    return [*shares, f"{len(firm.firm)} of {total} firm, {mean:.1f} expected ({low:.1f} to {high:.1f}, 95 %)"]
