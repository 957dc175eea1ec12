"""The command ``export``: a machine for other simulators."""

from pathlib import Path
from typing import Any

import click

from chaosgym.cli.machine_options import machine_command
from chaosgym.cli.options import IntRange
from chaosgym.cli.output import check_target, emit


@machine_command
@click.option("--fmu", type=click.Path(dir_okay=False, path_type=Path), required=True, help="File to write, NAME.fmu.")
@click.option(
    "--samples", type=IntRange(1, 10**5), default=256, show_default=True, help="Instants of its motion, a cycle."
)
@click.option("--overwrite", is_flag=True, help="Replace the file if it exists.")
def export(machine: Any, fmu: Path, samples: int, overwrite: bool, as_json: bool) -> None:
    """Write a machine as an FMU for co-simulation (FMI 2.0), which other simulators step in time.

    Whoever runs it needs a Python that can import chaosgym: docs/how-to/fmus.md. Needs the extra fmu.
    """
    from chaosgym.simulation.fmu import export_fmu, interface_of

    check_target(fmu, overwrite, (".fmu",))
    result = {"machine": machine.name, "fmu": str(export_fmu(machine, fmu, samples=samples)), **interface_of(fmu)}
    rows = [(kind, *row) for kind in ("input", "output") for row in result[f"{kind}s"].items()]
    lines = [
        f"{machine.name}: written to {fmu}",
        *(f"{kind:7s} {name:28s} {about}" for kind, name, about in rows),
        f"it runs where a Python can import chaosgym {result['chaosgym']}: docs/how-to/fmus.md",
    ]
    emit(result, as_json, lambda: lines)
