"""The command ``scorecard``: how many printed results of the thesis are hit."""

from collections.abc import Mapping
from typing import Any

import click

from chaosgym.cli.output import AS_JSON, WORKERS, emit


@click.command()
@click.option("--machine", type=click.Choice(["impact-beam", "slider-crank"]), multiple=True, help="Default: both.")
@click.option(
    "--candidate",
    metavar="NAME|FILE",
    help="Judge this machine instead: a candidate of thesis/scorecard/candidates.json, or result.json of a search.",
)
@click.option("--basin", metavar="NAME", help="Judge where this structure of the search begins instead; one --machine.")
@WORKERS
@click.option("--markdown", is_flag=True, help="Print the page of the documentation.")
@AS_JSON
def scorecard(
    machine: tuple[str, ...],
    candidate: str | None,
    basin: str | None,
    workers: int | None,
    markdown: bool,
    as_json: bool,
) -> None:
    """Compare every simulated statement of the thesis with the machines here; misses are shown."""
    from thesis.cache import default_folder
    from thesis.scorecard.page import page
    from thesis.scorecard.scorecard import scorecard as judge

    bases: dict[str, Any] | None = None
    unprinted: Mapping[str, float] = {}
    if basin is not None:
        from thesis.scorecard.search_space import SEARCH_SPACES

        if len(machine) != 1 or candidate is not None:
            raise click.UsageError("--basin goes with one --machine, and without --candidate")
        space = SEARCH_SPACES[machine[0]].only(basin)
        bases = {machine[0]: space.machine(space.basins[0], space.basins[0].shares())}
    if candidate is not None:
        from thesis.scorecard.candidates import read_candidate

        found, unprinted = read_candidate(candidate)
        if machine and machine != (found.name,):
            raise click.UsageError(f"{candidate} is of --machine {found.name} alone")
        machine, bases = (found.name,), {found.name: found}
    given: dict[str, Any] = {"bases": bases, "unprinted": unprinted, "folder": default_folder()}
    card = judge(machine or None, **given, workers=workers, progress=True)
    if markdown:
        return click.echo(page(card), nl=False)
    result = card.as_dict()
    emit(result, as_json, lambda: _lines(result))


def _lines(result: dict[str, Any]) -> list[str]:
    lines = []
    for machine, totals in result["totals"].items():
        lines.append(f"{machine}")
        lines += [_target(one) for one in result["targets"] if one["machine"] == machine]
        lines += [_count(group, count) for group, count in totals["groups"].items()]
        lines += [_count("all", totals["all"]), *_firm(totals)]
        told = [one for one in result["measured"] if one["machine"] == machine]
        hits = sum(one["verdict"] == "hit" for one in told)
        lines += [f"  measured, never fitted: {hits} of {len(told)} hit"]
        lines += [_target({**one, "neighbours": None}) for one in told]
    return lines


def _count(group: str, count: dict[str, int]) -> str:
    return (
        f"  {group:12s} {count['hit']:3d} of {count['total'] - count['contradictory']:3d} hit, {count['near']} near, "
        f"{count['miss']} missed; {count['contradictory']} contradictory"
    )


def _firm(totals: dict[str, Any]) -> list[str]:
    """The headline's other numbers, as far as they are known."""
    left_out, pairs = totals["left_out"], totals["exclusive"]
    unknown = "not known for these constants: python -m thesis firmness"
    said = f"{left_out['hit']} of {left_out['total']} hit" if left_out["total"] else unknown
    return [
        f"  {'left out':12s} {said}",
        f"  {'firm':12s} {_firm_hits(totals) if totals['firm'] else unknown}",
        f"  {'exclusive':12s} {', '.join(' x '.join(pair) for pair in pairs) or '-'}",
    ]


def _firm_hits(totals: dict[str, Any]) -> str:
    firm, expected = totals["firm"], totals["expected"]
    mean = f"{expected['mean']:.1f} ({expected['low']:.1f} to {expected['high']:.1f})"
    return f"{firm['hit']} of {firm['total']} hit by at least half of the neighbours; one neighbour hits {mean}"


def _target(one: dict[str, Any]) -> str:
    unit = "" if one["unit"] == "-" else f" {one['unit']}"
    printed, value = _shown(one["printed"]), _shown(one["value"])
    share = "   -" if one["neighbours"] is None else f"{one['neighbours']:4.0%}"
    reason = one["reason"].split(" | ")[0]
    return f"  {one['verdict']:13s} {share} {one['id']}  {printed:>14s}  {value:>22s}{unit:8s} {reason}"


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return " ".join(_shown(one) for one in value)
    return "-" if value is None else value if isinstance(value, str) else f"{value:.4g}"
