"""The command ``scorecard``: how many printed results of the thesis are hit."""

from typing import Any

import click

from chaosgym.cli.output import emit


@click.command()
@click.option("--machine", type=click.Choice(["impact-beam", "slider-crank"]), multiple=True, help="Default: both.")
@click.option("--workers", type=click.IntRange(1, 4096), default=None, help="Threads; default: all processors.")
@click.option("--markdown", is_flag=True, help="Print the page of the documentation.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def scorecard(machine: tuple[str, ...], workers: int | None, markdown: bool, as_json: bool) -> None:
    """Compare every simulated statement of the thesis with the machines here; misses are shown."""
    from thesis.cache import default_folder
    from thesis.scorecard.page import page
    from thesis.scorecard.scorecard import scorecard as judge

    card = judge(machine or None, folder=default_folder(), workers=workers, progress=True)
    if markdown:
        return click.echo(page(card), nl=False)
    result = card.as_dict()
    emit(result, as_json, lambda: _lines(result))


def _lines(result: dict[str, Any]) -> list[str]:
    lines = []
    for machine, groups in result["totals"].items():
        lines.append(f"{machine}")
        lines += [_target(one) for one in result["targets"] if one["machine"] == machine]
        for group, count in groups.items():
            counted = count["total"] - count["contradictory"]
            lines.append(
                f"  {group:12s} {count['hit']:3d} of {counted:3d} hit, {count['near']} near, {count['miss']} missed; "
                f"{count['contradictory']} contradictory"
            )
    return lines


def _target(one: dict[str, Any]) -> str:
    unit = "" if one["unit"] == "-" else f" {one['unit']}"
    printed, value = _shown(one["printed"]), _shown(one["value"])
    return f"  {one['verdict']:13s} {one['id']}  {printed:>14s}  {value:>22s}{unit:8s} {one['reason'].split(' | ')[0]}"


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return " ".join(_shown(one) for one in value)
    return "-" if value is None else value if isinstance(value, str) else f"{value:.4g}"
