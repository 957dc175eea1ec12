"""The command ``sweep``: the responses of many machines."""

from typing import Any

import click

from chaosgym.cli.machine_options import machine_command
from chaosgym.cli.output import emit
from chaosgym.cli.plot_option import draw, picture_path, plot_option
from chaosgym.cli.quantity import millimetres_meant


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
@click.option("--workers", type=click.IntRange(1, 4096), default=None, help="Threads; default: all processors.")
@click.option("--scheduler", metavar="tcp://HOST:PORT", help="Compute on a Dask cluster (extra [cluster]).")
@click.option("--repair", is_flag=True, help="Compute damaged chunks again.")
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
    workers: int | None,
    scheduler: str | None,
    repair: bool,
    out: str,
    plot: str | None,
    as_json: bool,
) -> None:
    """Label many machines and keep them as Parquet; the same command again resumes."""
    from collections import Counter

    from chaosgym.machines.parameters import parameters_of
    from chaosgym.sweeps import Axis, SweepPlan, run_sweep
    from chaosgym.sweeps.plan import default_axes

    picture = picture_path(plot, f"sweep-{machine.name}")
    sizes = {"random": random_size, "sobol": sobol_size, "crosses": cross_count}
    given = [name for name, size in sizes.items() if size]
    if len(given) > 1:
        raise click.UsageError("--random, --sobol and --crosses exclude each other")
    kind: Any = given[0] if given else sampling
    units = {name: about.unit for name, about in parameters_of(machine).items()}
    chosen = tuple(Axis.parse(text, units) for text in axes) or default_axes(machine, kind)
    plan = SweepPlan(machine, chosen, kind, sizes.get(kind) or 0, seed, budget, signals, full_types)
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
    draw(picture, lambda: _figure(labelled), result, lines)
    emit(result, as_json, lambda: lines)


def _figure(labelled: Any) -> Any:
    from chaosgym.plotting.dataset import sweep_map

    return sweep_map(labelled)


def _note_millimetres(machine: Any, text: str) -> None:
    """Say where a bare end of an axis looks like millimetres."""
    from chaosgym.machines.parameters import parameters_of

    field, _, span = text.partition("=")
    if parameters_of(machine)[field].unit == "m":
        ends = [end for end in span.split(":")[:2] if end[-1:].isdigit()]
        doubts = [millimetres_meant(field, end, float(end), getattr(machine, field)) for end in ends]
        for doubt in list(filter(None, doubts))[:1]:
            click.echo(doubt, err=True)


def _warnings(plan: Any, labelled: Any) -> list[str]:
    """What the counts do not say: points without contact, and why there are no response types."""
    found = []
    silent = sum(value == 0.0 for value in labelled.column("impacts_per_cycle").tolist())
    if silent:
        found.append(f"{silent} of {len(labelled.table)} points have no contact at all: the gap is never closed")
    if plan.sampling == "grid" and not plan.type_reach() and plan.full_types < 1.0:
        found.append(
            "no response types of periodic points: they compare points one tolerance apart, and the "
            "steps of this grid are wider; use a "
            "finer grid, --crosses, or --full-types 1"
        )
    return found
