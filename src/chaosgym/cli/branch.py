"""The command ``branch``: periodic orbits followed along a field, through folds and loss of stability."""

from collections import Counter
from pathlib import Path
from typing import Any

import click
import numpy as np

from chaosgym.cli.machine_options import machine_command, model_over
from chaosgym.cli.options import FloatRange, IntRange
from chaosgym.cli.output import (
    DIAGNOSED,
    WORKERS,
    announce,
    check_target,
    emit,
    picture_path,
    plot_option,
    write_table,
)
from chaosgym.plain import plain

SAMPLED, SAMPLED_EACH = 7, 3
"""Points of the range by which its one model is chosen: of one field, and of each of two."""

SHOWN = 30
"""Branches, and bifurcations, that the table shows; all are in --out and --json."""


FIRST = "branch, before it follows orbits"
"""What can be told beforehand: how many orbits there are, the sweep tells."""


@machine_command(chooses="range")
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
    type=IntRange(1, 64),
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
    axes = [_axis(machine, text) for text in (along, against) if text is not None]
    machine = model_over(machine, _points(machine, axes), chosen=[axis.field for axis in axes])
    first, second = axes[0], axes[-1]
    limits: dict[str, Any] = {
        "longest_period": longest_period,
        "most_unstable": most_unstable,
        "workers": workers,
        "progress": True,
    }
    found: Any
    if against is None:
        from chaosgym.branches.diagram_search import SWEEP, SWEEP_BUDGET, SWEEP_STARTS, follow

        announce(FIRST, machine, DIAGNOSED * (first.count or SWEEP) * SWEEP_BUDGET * (1 + SWEEP_STARTS))
        found = follow(machine, first.field, (first.low, first.high), sweep=first.count or SWEEP, **limits)
    else:
        from chaosgym.branches.bifurcation_map import COLUMNS, ROWS, bifurcation_map
        from chaosgym.branches.diagram_search import SWEEP_BUDGET

        points = (first.count or COLUMNS) * (second.count or ROWS)
        announce(FIRST, machine, DIAGNOSED * points * SWEEP_BUDGET)
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
        from chaosgym.branches.calm import calm_along
        from chaosgym.branches.route_to_chaos import routes_to_chaos

        calm = calm_along(found)
        result["calm"] = None if calm is None else calm.as_dict()
        lines += [] if calm is None else calm.lines
        routes = routes_to_chaos(found)
        result["routes"] = plain(routes)
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


def _points(machine: Any, axes: list[Any]) -> list[Any]:
    """The machine at a few points of the range, by which its one model is chosen."""
    from itertools import product

    from chaosgym.machines.parameters import with_settings

    count = SAMPLED if len(axes) == 1 else SAMPLED_EACH
    values = [np.linspace(axis.low, axis.high, count).tolist() for axis in axes]
    return [with_settings(machine, {a.field: v for a, v in zip(axes, at, strict=True)}) for at in product(*values)]


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
    """How far was looked for motions, where several live side by side, and the share of each of the random starts."""
    points = [point for point in diagram.sweep if point.motions]
    if not points:
        return []
    unseen = max(point.unseen for point in points)
    looked = (
        f"{points[0].starts} random starts at each of {len(points)} values: motions not met take at most {unseen:.1%} "
        "of such starts (95 %)"
    )
    several = [point for point in points if len(point.motions) > 1]
    if not several:
        return [f"{looked}; one motion was met at each"]
    ends = " to ".join(dict.fromkeys(f"{point.value:.6g}" for point in (several[0], several[-1])))
    lines = [f"{looked}; several motions at {len(several)}, {ends} {unit}:"]
    return [
        *lines,
        *_at_most([f"  {_share_line(several, diagram.branches, place, unit)}" for place in diagram.places(several)]),
    ]


def _share_line(several: list[Any], branches: Any, place: tuple[int | None, int | None], unit: str) -> str:
    """A motion that lives beside others, its force, and where it takes most and fewest of the starts."""
    there = [(point.value, one) for point in several for one in point.motions if one.place == place]
    force = max(one.largest_peak for _, one in there)
    told = f"up to {force:.3g} N" if force > 0.0 else "without contact"
    number, stretch = place
    if number is None:
        named = f"{', '.join(sorted({one.nature for _, one in there}))}, on no branch"
    elif stretch is None:
        named = f"branch {number}"
    else:
        values = branches[number - 1].stretches[stretch - 1].values
        named = f"branch {number}, stable from {values.min():.6g} to {values.max():.6g} {unit}"
    shares: dict[float, float] = {}
    for value, one in there:
        shares[value] = shares.get(value, 0.0) + one.share
    most, least = max(shares, key=lambda value: shares[value]), min(shares, key=lambda value: shares[value])
    span = dict.fromkeys(f"{shares[value]:.0%} at {value:.6g} {unit}" for value in (most, least))
    return f"{named}, {told}: {' to '.join(span)}"


def _at_most(lines: list[str]) -> list[str]:
    more = len(lines) - SHOWN
    return [*lines[:SHOWN], *([f"  and {more} more: --out or --json has all"] if more > 0 else [])]


def _branch_line(number: int, one: Any, unit: str) -> str:
    share = "stable" if one.stable.all() else "unstable" if not one.stable.any() else "stable in parts"
    return (
        f"branch {number}: period {one.period}, {one.values.min():.6g} to {one.values.max():.6g} {unit}, {share}, "
        f"{len(one)} orbits, from {one.begins}"
    )
