"""The command ``firmness``: which verdicts of the scorecard hold in the neighbourhood, and which are luck."""

from pathlib import Path
from typing import Any

import click

from chaosgym.cli.output import AS_JSON, WORKERS, emit


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
    """Judge neighbours of a machine and write thesis/scorecard/firmness.json, which the scorecard shows."""
    from thesis.scorecard.evaluation import THESIS_MACHINES
    from thesis.scorecard.firmness import Firmness, exclusive_pairs, keep, left_out_hits, neighbour_shares
    from thesis.scorecard.search import complete_costs

    one = THESIS_MACHINES[machine]
    pairs = exclusive_pairs(complete_costs(Path(search))) if search else ()
    hits = left_out_hits([Path(folder) for folder in left_out])
    shares = neighbour_shares(one, neighbours, joint=joint, workers=workers, progress=True)
    keep(one, Firmness(shares, neighbours, pairs, hits))
    result: dict[str, Any] = {"machine": machine, "count": neighbours, "neighbours": shares, "exclusive": pairs}
    result["left_out"] = {"hit": hits[0], "total": hits[1]}
    emit(result, as_json, lambda: [f"  {name}  {share:.0%}" for name, share in shares.items()])
