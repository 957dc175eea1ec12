"""Which response do many machines have? ``sweep``."""

from typing import Any

import click

from chaosgym.cli.machine_options import machine_command
from chaosgym.cli.output import emit


@click.command()
@machine_command
@click.option("--axis", "axes", multiple=True, metavar="FIELD=LOW:HIGH[:COUNT][:lin|log]", help="Repeatable, in SI.")
@click.option("--grid", "sampling", flag_value="grid", default="grid", help="All combinations (default).")
@click.option("--random", "random_size", type=click.IntRange(1), metavar="N", help="N random points.")
@click.option("--sobol", "sobol_size", type=click.IntRange(1), metavar="N", help="N points of a Sobol sequence.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--transient", type=click.IntRange(0, 10**7), default=200, show_default=True, help="Cycles to skip.")
@click.option("--cycles", type=click.IntRange(16, 10**7), default=200, show_default=True, help="Cycles to judge.")
@click.option("--workers", type=click.IntRange(1, 4096), default=None, help="Threads; default: all processors.")
@click.option("--out", type=click.Path(file_okay=False), required=True, help="Folder for the labelled points.")
def sweep(
    machine: Any,
    axes: tuple[str, ...],
    sampling: str,
    random_size: int | None,
    sobol_size: int | None,
    seed: int,
    transient: int,
    cycles: int,
    workers: int | None,
    out: str,
    as_json: bool,
) -> None:
    """Label many machines and keep them as Parquet; the same command again resumes."""
    from collections import Counter

    from chaosgym.sweeps import Axis, SweepPlan, run_sweep
    from chaosgym.sweeps.plan import default_axes

    if random_size and sobol_size:
        raise click.UsageError("--random and --sobol exclude each other")
    kind: Any = "random" if random_size else "sobol" if sobol_size else sampling
    chosen = tuple(Axis.parse(text) for text in axes) or default_axes(machine, kind)
    plan = SweepPlan(machine, chosen, kind, random_size or sobol_size or 0, seed, transient, cycles)
    labelled = run_sweep(plan, out, workers=workers, progress=True)
    counts = {name: dict(Counter(str(value) for value in labelled.column(name)))
              for name in ("nature", "response_type", "status")}  # fmt: skip
    result = {"machine": machine.name, "folder": out, "points": len(labelled.table), **counts}
    emit(result, as_json, lambda: [
        f"{machine.name}: {len(labelled.table)} points in {out}",
        *(f"  {name:14s}" + ", ".join(f"{key} {count}" for key, count in sorted(counts[name].items()))
          for name in counts),
    ])  # fmt: skip
