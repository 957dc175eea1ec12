"""The commands ``sweep`` and ``dataset``: the responses of many machines, and the folder that they are kept in."""

from pathlib import Path
from typing import Any

import click

from chaosgym.cli import Group
from chaosgym.cli.machine_options import machine_command, millimetres_meant
from chaosgym.cli.output import AS_JSON, WORKERS, emit, picture_path, plot_option


@machine_command
@click.option(
    "--axis",
    "axes",
    multiple=True,
    metavar="FIELD=LOW:HIGH[:COUNT][:lin|log]",
    help="Repeatable; ends in SI or with a unit (0.1 mm).",
)
@click.option("--grid", "sampling", flag_value="grid", default="grid", help="All combinations (default).")
@click.option("--random", "random_size", type=click.IntRange(1), metavar="N", help="N random points.")
@click.option("--sobol", "sobol_size", type=click.IntRange(1), metavar="N", help="N points of a Sobol sequence.")
@click.option(
    "--crosses",
    "cross_count",
    type=click.IntRange(1),
    metavar="N",
    help="N random machines, each with its neighbours one tolerance away in speed and clearance.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option(
    "--budget", type=click.IntRange(100, 10**7), default=400, show_default=True, help="Cycles at the most, by point."
)
@click.option("--signals", type=float, default=0.0, help="Share of the points whose signals are kept, 0 to 1.")
@click.option("--full-types", type=float, default=0.0, help="Share of the points typed over all tolerances, 0 to 1.")
@click.option(
    "--initial-states",
    type=click.IntRange(1),
    default=48,
    show_default=True,
    help="With --full-types: random starts that look for other motions, or 3 as in datasets that state no number.",
)
@WORKERS
@click.option("--scheduler", metavar="tcp://HOST:PORT", help="Compute on a Dask cluster (extra [cluster]).")
@click.option("--repair", is_flag=True, help="Compute damaged chunks again.")
@click.option("--routes", is_flag=True, help="Of one axis: also name how chaos begins, and its sudden changes.")
@click.option("--out", type=click.Path(file_okay=False), required=True, help="Folder for the labelled points.")
@plot_option()
def sweep(
    machine: Any,
    axes: tuple[str, ...],
    sampling: str,
    random_size: int | None,
    sobol_size: int | None,
    cross_count: int | None,
    seed: int,
    budget: int,
    signals: float,
    full_types: float,
    initial_states: int,
    workers: int | None,
    scheduler: str | None,
    repair: bool,
    routes: bool,
    out: str,
    plot: str | None,
    as_json: bool,
) -> None:
    """Label many machines and keep them as Parquet; the same command again resumes."""
    from collections import Counter

    from chaosgym.machines.parameters import field_named, parameters_of
    from chaosgym.sweeps import Axis, SweepPlan, run_sweep
    from chaosgym.sweeps.plan import default_axes

    picture = picture_path(plot, f"sweep-{machine.name}")
    if machine.initial_state:
        raise click.UsageError("the labels of a sweep are those of runs from rest: leave --initial-state out")
    sizes = {"random": random_size, "sobol": sobol_size, "crosses": cross_count}
    given = [name for name, size in sizes.items() if size]
    if len(given) > 1:
        raise click.UsageError("--random, --sobol and --crosses exclude each other")
    kind: Any = given[0] if given else sampling
    units = {name: about.unit for name, about in parameters_of(machine).items()}
    axes = tuple("=".join([field_named(machine, field), *span]) for field, *span in (text.split("=") for text in axes))
    chosen = tuple(Axis.parse(text, units) for text in axes) or default_axes(machine, kind)
    plan = SweepPlan(machine, chosen, kind, sizes.get(kind) or 0, seed, budget, signals, full_types, initial_states)
    if routes and (kind != "grid" or len(chosen) != 1):
        raise click.UsageError("--routes needs a grid of one axis: --axis FIELD=LOW:HIGH:COUNT once")
    if routes:
        from chaosgym.branches.family_along import continuous_field

        continuous_field(machine, chosen[0].field)  # refused before the sweep, not after
    for text in axes:
        _note_millimetres(machine, text)
    labelled = run_sweep(plan, out, workers=workers, scheduler=scheduler, repair=repair, progress=True)
    counts = {
        name: dict(Counter(str(value) for value in labelled.column(name)))
        for name in ("nature", "response_type", "status")
    }
    warnings = _warnings(plan, labelled)
    result = {
        "machine": machine.name,
        "folder": out,
        "complete": True,
        "points": len(labelled.table),
        **counts,
        "warnings": warnings,
    }
    lines = [
        f"{machine.name}: complete, {len(labelled.table)} points in {out}",
        *(
            f"  {name:14s}" + ", ".join(f"{key} {count}" for key, count in sorted(counts[name].items()))
            for name in counts
        ),
        *(f"  {warning}" for warning in warnings),
    ]
    if routes:
        told, more = _routes(plan, labelled)
        result |= told
        lines += more
    emit(result, as_json, lambda: lines, picture, lambda plots: plots.response.sweep_map(labelled))


def _routes(plan: Any, labelled: Any) -> tuple[dict[str, Any], list[str]]:
    """Routes to chaos and crises along the one axis: for JSON, and as lines."""
    from chaosgym.branches.route_to_chaos import routes_in_sweep

    (field,) = plan.fields
    values, natures = labelled.column(field).tolist(), [str(one) for one in labelled.column("nature")]
    onsets, crises = routes_in_sweep(plan.machine, field, values, natures, progress=True)
    told = {"routes": [one.as_dict() for one in onsets], "crises": [one.as_dict() for one in crises]}
    lines = [f"  {one.line}" for one in onsets]
    lines += [f"  crisis between {one.first:.8g} and {one.second:.8g}: {one.because}" for one in crises]
    return told, lines or ["  no place where chaos begins or changes suddenly"]


def _note_millimetres(machine: Any, text: str) -> None:
    """Say where a bare end of an axis looks like millimetres."""
    from chaosgym.machines.parameters import field_named, parameters_of

    field, _, span = text.partition("=")
    field = field_named(machine, field)
    if parameters_of(machine)[field].unit == "m":
        ends = [end for end in span.split(":")[:2] if end[-1:].isdigit()]
        doubts = [millimetres_meant(field, end, float(end), getattr(machine, field)) for end in ends]
        for doubt in list(filter(None, doubts))[:1]:
            click.echo(doubt, err=True)


def _warnings(plan: Any, labelled: Any) -> list[str]:
    """What the counts do not say: points without contact, and why there are no response types."""
    found = []
    silent = sum(value == 0.0 for value in labelled.column("contact_fraction").tolist())
    if silent:
        found.append(f"{silent} of {len(labelled.table)} points have no contact at all: the gap is never closed")
    if plan.sampling == "grid" and not plan.type_reach() and plan.full_types < 1.0:
        found.append(
            "no response types of periodic points: they compare points one tolerance apart, and the "
            "steps of this grid are wider; use a "
            "finer grid, --crosses, or --full-types 1"
        )
    return found


FOLDER = click.argument("folder", type=click.Path(exists=True, file_okay=False))


@click.group(cls=Group)
def dataset() -> None:
    """Describe or draw a folder that `chaosgym sweep` made."""


@dataset.command("info")
@FOLDER
@AS_JSON
def info(folder: str, as_json: bool) -> None:
    """Print rows, classes, settings, label definitions, faults and provenance."""
    from chaosgym.sweeps.info import dataset_info

    found = dataset_info(folder)
    emit(found, as_json, lambda: _lines(folder, found))


def _lines(folder: str, found: dict[str, Any]) -> list[str]:
    rows, settings = found["rows"], found["settings"]
    state = "complete" if found["complete"] else "unfinished: run the command again that makes it"
    if "whole" in settings:
        state = f"a sample of {settings['whole']['size']} crosses"
    plan = ", ".join(
        f"{name} {settings[name]}" for name in ("sampling", "size", "seed", "budget", "signals", "full_types")
    )
    lines = [
        f"{folder}: {found['machine']}, {rows['finished']} of {rows['planned']} points, {state}",
        f"  settings: {plan}, version {settings['version']}",
    ]
    if not found["complete"]:
        return lines
    for name, counts in found["classes"].items():
        if not name.endswith("_by_split"):
            lines.append(f"  {name:20s}" + (", ".join(f"{label} {count}" for label, count in counts.items()) or "none"))
    lines.append(f"  {'faults':20s}" + ", ".join(f"{name} {count}" for name, count in found["faults"].items()))
    if found["types"]:
        types = found["types"]
        lines.append(
            f"  types from neighbours and over the full window differ at {types['disagreement']:.1%} "
            f"of {types['points']} points"
        )
    lines.append("  columns:")
    lines += [f"    {name:20s}{meaning}" for name, meaning in found["definitions"].items()]
    return [*lines, *(f"  made by {', '.join(f'{k} {v}' for k, v in made.items())}" for made in found["provenance"])]


@dataset.command("map")
@FOLDER
@click.option("--out", type=click.Path(dir_okay=False), required=True, help="Picture to write (.png, .svg, .pdf).")
@AS_JSON
def map_(folder: str, out: str, as_json: bool) -> None:
    """Draw natures and response types over speed and clearance, as thesis figures 3.9 and 4.15."""
    from chaosgym.plotting.response import sweep_map
    from chaosgym.plotting.style import check_picture, save_picture
    from chaosgym.sweeps import read_sweep

    path = check_picture(Path(out))
    save_picture(sweep_map(read_sweep(folder)), path)
    emit({"wrote": out}, as_json, lambda: [f"wrote {out}"])
