"""The command ``branch``: periodic orbits followed along a field, through folds and loss of stability."""

from collections import Counter
from pathlib import Path
from typing import Any

import click
import numpy as np

from chaosgym.cli.machine_options import machine_command
from chaosgym.cli.options import FloatRange
from chaosgym.cli.output import WORKERS, check_target, emit, picture_path, plot_option, write_table

SHOWN = 30
"""Branches, and bifurcations, that the table shows; all are in --out and --json."""


@machine_command
@click.option(
    "--along",
    required=True,
    metavar="FIELD=LOW:HIGH[:COUNT]",
    help="Field, or speed or clearance, and its range in SI or with a unit; COUNT points of the sweep (41).",
)
@click.option(
    "--against",
    metavar="FIELD=LOW:HIGH[:COUNT]",
    help="Second field: follow the bifurcations over both, over a sweep of COUNT rows (13).",
)
@click.option(
    "--longest-period",
    type=click.IntRange(1, 64),
    default=4,
    show_default=True,
    help="Longest period [cycles] of a branch that begins at a flip.",
)
@click.option(
    "--most-unstable",
    type=FloatRange(1.0, 1e6),
    default=1000.0,
    show_default=True,
    help="Largest multiplier up to which unstable orbits are followed.",
)
@WORKERS
@click.option("--out", type=click.Path(dir_okay=False), help="Table to write (.csv or .parquet), a row an orbit.")
@click.option("--overwrite", is_flag=True, help="Replace the table if it exists.")
@plot_option()
def branch(
    machine: Any,
    along: str,
    against: str | None,
    longest_period: int,
    most_unstable: float,
    workers: int | None,
    out: str | None,
    overwrite: bool,
    plot: str | None,
    as_json: bool,
) -> None:
    """Follow periodic orbits along a field: where they fold, flip and graze, stable or not; over a second one too."""
    picture = picture_path(plot, f"branch-{Path(machine.name).stem}")
    if out:
        check_target(out, overwrite)
    first = _axis(machine, along)
    limits: dict[str, Any] = {
        "longest_period": longest_period,
        "most_unstable": most_unstable,
        "workers": workers,
        "progress": True,
    }
    found: Any
    if against is None:
        from chaosgym.branches.diagram_search import SWEEP, follow

        found = follow(machine, first.field, (first.low, first.high), sweep=first.count or SWEEP, **limits)
    else:
        from chaosgym.branches.bifurcation_map import COLUMNS, ROWS, bifurcation_map

        second = _axis(machine, against)
        found = bifurcation_map(
            machine,
            first.field,
            second.field,
            span=(first.low, first.high),
            other=(second.low, second.high),
            columns=first.count or COLUMNS,
            rows=second.count or ROWS,
            **limits,
        )
    result, lines = found.as_dict(), _lines(found) if against is None else _map_lines(found)
    if against is None:
        from chaosgym.branches.route_to_chaos import routes_to_chaos

        routes = routes_to_chaos(found)
        result["routes"] = [one.as_dict() for one in routes]
        lines += _at_most([one.line for one in routes])
    if out:
        write_table(_columns(found), out)
        result["out"] = out
        lines.append(f"written to {out}")
    emit(
        result,
        as_json,
        lambda: lines,
        picture,
        lambda plots: plots.branch_figure(found) if against is None else plots.bifurcation_map_figure(found),
    )


def _axis(machine: Any, text: str) -> Any:
    """Field and range of "FIELD=LOW:HIGH[:COUNT]"."""
    from chaosgym.branches.family_along import continuous_field
    from chaosgym.machines.parameters import parameters_of
    from chaosgym.sweeps import Axis

    name, _, span = text.partition("=")
    field = continuous_field(machine, name)
    units = {field: about.unit for field, about in parameters_of(machine).items()}
    return Axis.parse(f"{field}={span}" if span else text, units)


def _map_lines(found: Any) -> list[str]:
    from chaosgym.machines.parameters import parameters_of

    known = parameters_of(found.machine)
    (x, y), squares = ((known[name].unit for name in (found.along, found.against)), Counter(found.nature.ravel()))
    told = ", ".join(f"{nature} {count}" for nature, count in sorted(squares.items()))
    lines = [f"{found.machine.name}: {len(found.curves)} curves over {found.along} and {found.against}; sweep: {told}"]
    rows = []
    for number, one in enumerate(found.curves, 1):
        a, b = one.along_values, one.against_values
        rows.append(
            f"  curve {number}: {one.kind}, period {one.period}, {found.along} {a.min():.6g} to {a.max():.6g} {x}, "
            f"{found.against} {b.min():.6g} to {b.max():.6g} {y}"
        )
        rows += [f"    {end}" for end in one.ends if not end.startswith("end of the range")]
    return lines + _at_most(rows)


def _columns(diagram: Any) -> dict[str, Any]:
    """Columns of the table; empty where a bifurcation has no value."""
    rows = list(diagram.rows())
    names = list(dict.fromkeys(name for row in rows for name in row))
    return {name: np.array([row.get(name) for row in rows], dtype=object) for name in names}


def _lines(diagram: Any) -> list[str]:
    from chaosgym.machines.parameters import parameters_of

    unit = parameters_of(diagram.machine)[diagram.field].unit
    natures = Counter(point.nature for point in diagram.sweep)
    told = ", ".join(f"{nature} {count}" for nature, count in sorted(natures.items()))
    grazing = [one for one in diagram.bifurcations if one.kind == "grazing"]
    harmless = sum(not one.loses_stability for one in grazing)
    shown = [one for one in diagram.bifurcations if (one.kind != "grazing" or one.loses_stability) and not one.ends]
    lines = [
        f"{diagram.machine.name}: {len(diagram.branches)} branches over {diagram.field} {diagram.low:g} to "
        f"{diagram.high:g} {unit}; sweep: {told}",
        *_at_most([f"  {_branch_line(number, one, unit)}" for number, one in enumerate(diagram.branches, 1)]),
        f"bifurcations, and {harmless} grazings that no stability depends on:",
        *_at_most(
            [
                f"  {one.value:<14.9g} {one.kind:18s} period {one.period}"
                + (", stability ends" if one.loses_stability else "")
                for one in shown
            ]
        ),
    ]
    return lines + [f"  {line}" for line in diagram.not_followed] + _share_lines(diagram, unit)


def _share_lines(diagram: Any, unit: str) -> list[str]:
    """Where several motions live side by side, and their largest shares of the random starts."""
    largest: dict[int | None, list[float]] = {}
    several = [point for point in diagram.sweep if len(point.motions) > 1]
    for point in several:
        for one in point.motions:
            largest.setdefault(one.branch, []).append(one.share)
    if not several:
        return []
    told = ", ".join(
        f"{'no branch' if number is None else f'branch {number}'} up to {max(shares):.0%}"
        for number, shares in sorted(largest.items(), key=lambda pair: (pair[0] is None, pair[0]))
    )
    places = f"{several[0].value:.6g} to {several[-1].value:.6g} {unit}"
    return [f"several motions at {len(several)} of {len(diagram.sweep)} values, {places}; of random starts: {told}"]


def _at_most(lines: list[str]) -> list[str]:
    more = len(lines) - SHOWN
    return [*lines[:SHOWN], *([f"  and {more} more: --out or --json has all"] if more > 0 else [])]


def _branch_line(number: int, one: Any, unit: str) -> str:
    share = "stable" if one.stable.all() else "unstable" if not one.stable.any() else "stable in parts"
    return (
        f"branch {number}: period {one.period}, {one.values.min():.6g} to {one.values.max():.6g} {unit}, {share}, "
        f"{len(one)} orbits, from {one.begins}"
    )
