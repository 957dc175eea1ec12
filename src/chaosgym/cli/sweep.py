"""The commands ``sweep`` and ``dataset``: the responses of many machines, and the folder that they are kept in."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from chaosgym.cli import Group
from chaosgym.cli.machine_options import machine_command, millimetres_meant, model_over
from chaosgym.cli.options import Fact, IntRange, stated
from chaosgym.cli.output import AS_JSON, DIAGNOSED, announce, emit, patience, picture_path, plot_option

SAMPLED = 9
"""Points of the sweep by which its one model is chosen."""

LABELS = {
    "full-types": Fact(
        "full_types", click.FLOAT, "1", "share typed over all tolerances; left out, 1 on a coarse grid of a minute"
    ),
    "initial-states": Fact("initial_states", IntRange(1), "48", "random starts of these types"),
    "definition": Fact(
        "definition",
        click.Choice(["settled", "thesis"]),
        "thesis",
        "chaotic too where chaos died out, as in the thesis",
    ),
    "signals": Fact("signals", click.FLOAT, "0.1", "share whose signals are kept"),
    "routes": Fact("routes", click.BOOL, "yes", "of one axis: also how chaos begins, and its sudden changes"),
}
"""What ``--label`` states of the points."""

LABEL = "; ".join(f"{key}={one.example} ({one.help})" for key, one in LABELS.items())

DRAWN = ("random", "sobol", "crosses")

SAMPLING = (
    "All combinations of the axes, or N points at random, of a Sobol sequence, or machines at random, each with its "
    "neighbours one tolerance away in speed and clearance."
)


class SamplingRule(click.ParamType):  # type: ignore[type-arg]
    """Rule that places points on the axes: (name, number of them, seed)."""

    name = "sampling"
    forms = f"grid|{'|'.join(f'{kind}:N' for kind in DRAWN)}[:SEED]"

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        """Return its forms."""
        return self.forms

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, int, int]:
        """Return the rule; a seed that is left out is 0."""
        kind, *numbers = value.split(":")
        if value == "grid":
            return value, 0, 0
        if kind not in DRAWN or not 1 <= len(numbers) <= 2 or not all(one.isdecimal() for one in numbers):
            self.fail(f"{value!r} is no rule; allowed: {self.forms}", param, ctx)
        size, seed, *_ = *map(int, numbers), 0
        return kind, size, seed


class Workers(IntRange):
    """A number of threads, or the address of a Dask scheduler."""

    def __init__(self) -> None:
        super().__init__(1, 4096)

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        """Return its forms."""
        return "N|tcp://HOST:PORT"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number, or the address as it is."""
        if "://" in str(value):
            return value
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter:
            self.fail(f"{value!r} is neither a number of threads, 1 to {self.max}, nor tcp://HOST:PORT", param, ctx)


@machine_command(chooses="range")
@click.option(
    "--axis",
    "axes",
    multiple=True,
    metavar="FIELD=LOW:HIGH[:COUNT][:lin|log]",
    help="Repeatable; ends in SI or with a unit (0.1 mm).",
)
@click.option("--sampling", type=SamplingRule(), default="grid", show_default=True, help=SAMPLING)
@click.option(
    "--budget", type=IntRange(100, 10**7), default=400, show_default=True, help="Cycles at the most, by point."
)
@click.option(
    "--label", "labels", multiple=True, metavar="KEY=VALUE", help=f"How points are labelled, repeatable: {LABEL}."
)
@click.option(
    "--workers", type=Workers(), help="Threads, by default all processors; or a Dask cluster (extra [cluster])."
)
@click.option("--repair", is_flag=True, help="Compute damaged chunks again.")
@click.option("--out", type=click.Path(file_okay=False), required=True, help="Folder for the labelled points.")
@plot_option()
def sweep(
    machine: Any,
    axes: tuple[str, ...],
    sampling: tuple[Any, int, int],
    budget: int,
    labels: tuple[str, ...],
    workers: int | str | None,
    repair: bool,
    out: str,
    plot: str | None,
    as_json: bool,
) -> None:
    """Label many machines and keep them as Parquet; the same command again resumes."""
    from collections import Counter

    from chaosgym.machines.parameters import field_named, parameters_of
    from chaosgym.sweeps import Axis, SweepPlan, run_sweep
    from chaosgym.sweeps.info import calm_region_of
    from chaosgym.sweeps.plan import default_axes
    from chaosgym.sweeps.types_by_default import timed_types, with_affordable_types
    from chaosgym.units import duration

    picture = picture_path(plot, f"sweep-{machine.name}")
    kind, size, seed = sampling
    label = stated("--label", labels, LABELS, {})
    routes = label.pop("routes", False)
    threads, scheduler = (None, workers) if isinstance(workers, str) else (workers, None)
    units = {name: about.unit for name, about in parameters_of(machine).items()}
    axes = tuple("=".join([field_named(machine, field), *span]) for field, *span in (text.split("=") for text in axes))
    chosen = tuple(Axis.parse(text, units) for text in axes) or default_axes(machine, kind)
    plan = SweepPlan(machine, chosen, kind, size, seed, budget, **label)
    plan = replace(plan, machine=model_over(machine, plan.sample(SAMPLED), chosen=plan.fields))
    if routes and (kind != "grid" or len(chosen) != 1):
        raise click.UsageError("--label routes=yes needs a grid of one axis: --axis FIELD=LOW:HIGH:COUNT once")
    if routes:
        from chaosgym.branches.family_along import continuous_field

        continuous_field(machine, chosen[0].field)  # refused before the sweep, not after
    for text in axes:
        _note_millimetres(machine, text)
    timed = None
    if "full_types" not in label:
        with patience("sweep: time a few types"):
            plan, timed = with_affordable_types(plan, out, threads)
        if timed and not plan.full_types:
            needed = f"{duration(timed.seconds * len(plan), 2)} of processor time: --label full-types=1"
            click.echo(f"types of {len(plan)} points would take about {needed}", err=True)
    known = None
    if not Path(out).exists():
        besides = 0.0
        if plan.full_types:
            with patience("sweep: time a few types"):
                known, seconds = timed or timed_types(plan, threads)
            besides = seconds * (plan.full_types * len(plan) - len(known))
        announce("sweep", plan.machine, DIAGNOSED * len(plan) * plan.budget, besides=besides)
    labelled = run_sweep(plan, out, workers=threads, scheduler=scheduler, repair=repair, progress=True, known=known)
    counts = {
        name: dict(Counter(str(value) for value in labelled.column(name)))
        for name in ("nature", "response_type", *(["full_response_type"] if plan.full_types else []), "status")
    }
    warnings, calm = _warnings(plan, labelled), calm_region_of(labelled)
    result = {
        "machine": machine.name,
        "folder": out,
        "complete": True,
        "points": len(labelled.table),
        **counts,
        "calm": None if calm is None else calm.as_dict(),
        "warnings": warnings,
    }
    lines = [
        f"{machine.name}: complete, {len(labelled.table)} points in {out}",
        *(
            f"  {name:{max(map(len, counts)) + 1}s}"
            + ", ".join(f"{key} {count}" for key, count in sorted(counts[name].items()))
            + (f" (from {plan.machine.begins_from()})" if name == "response_type" and plan.type_reach() else "")
            for name in counts
        ),
        *(f"  {line}" for line in ([] if calm is None else calm.lines)),
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
    from chaosgym.plain import plain

    (field,) = plan.fields
    values, natures = labelled.column(field).tolist(), [str(one) for one in labelled.column("nature")]
    onsets, crises = routes_in_sweep(plan.machine, field, values, natures, progress=True)
    told = {"routes": plain(onsets), "crises": plain(crises)}
    lines = [f"  {one.line}" for one in onsets]
    lines += [f"  crisis between {one.first:.8g} and {one.second:.8g}: {one.because}" for one in crises]
    return told, lines or ["  no place where chaos begins or changes suddenly"]


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
    silent = sum(value == 0.0 for value in labelled.column("contact_fraction").tolist())
    if silent:
        found.append(f"{silent} of {len(labelled.table)} points have no contact at all: the gap is never closed")
    several = sum((one or 0) > 1 for one in labelled.table.column("motions").to_pylist()) if plan.full_types else 0
    if several:
        found.append(
            f"several motions at {several} of {len(labelled.table)} points: the column other_motions has the force, "
            "the share of the starts and the ends of each"
        )
    if plan.sampling == "grid" and plan.type_reach() and plan.full_types < 1.0:
        found.append(
            f"types of the grid's neighbours rest on runs from {plan.machine.begins_from()}; "
            "--label full-types=1 looks for other motions"
        )
    if plan.sampling == "grid" and not plan.type_reach() and plan.full_types < 1.0:
        found.append(
            "periodic points without a type: their tolerances were not checked, and the steps of this grid are wider; "
            "use --label full-types=1, --sampling crosses:N, or a finer grid"
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
    """Print rows, model, classes, settings, label definitions, faults and provenance."""
    from chaosgym.sweeps.info import dataset_info

    found = dataset_info(folder)
    emit(found, as_json, lambda: _lines(folder, found))


def _lines(folder: str, found: dict[str, Any]) -> list[str]:
    rows, settings = found["rows"], found["settings"]
    state = "complete" if found["complete"] else "unfinished: run the command again that makes it"
    if "whole" in settings:
        state = f"a sample of {settings['whole']['size']} crosses"
    shown = ("sampling", "size", "seed", "budget", "signals", "full_types", "definition")
    plan = ", ".join(f"{name} {settings[name]}" for name in shown)
    lines = [
        f"{folder}: {found['machine']}, {rows['finished']} of {rows['planned']} points, {state}",
        f"  settings: {plan}, version {settings['version']}",
        f"  model: {found['model']['rung'] or 'its own'}; {found['model']['told']}",
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
    """Draw natures and response types over speed and clearance."""
    from chaosgym.plotting.response import sweep_map
    from chaosgym.plotting.style import check_picture, save_picture
    from chaosgym.sweeps import read_sweep

    path = check_picture(Path(out))
    save_picture(sweep_map(read_sweep(folder)), path)
    emit({"wrote": out}, as_json, lambda: [f"wrote {out}"])
