"""The command ``overlay``: a measured record and a machine in one picture."""

from pathlib import Path
from typing import Any

import click

from chaosgym.cli.machine_options import machine_command
from chaosgym.cli.measured_options import Measured, measured_options, measured_runs
from chaosgym.cli.output import emit


@machine_command
@measured_options
@click.option(
    "--out", type=click.Path(dir_okay=False, path_type=Path), required=True, help="Picture (.png, .svg, .pdf)."
)
def overlay(machine: Any, measured: Measured, out: Path, as_json: bool) -> None:
    """Lay a measured record over what a machine does: peaks, their distribution and their section."""
    if not measured:
        raise click.UsageError("give what was measured: --peaks FILE or --series FILE")
    from chaosgym.diagnosis.overlay import overlay as compare
    from chaosgym.plotting.overlay import overlay_figure

    (run,) = measured_runs(measured)
    found = compare(machine, run.peaks, run.verdict.diagnosis, larger=bool(measured.series))
    try:
        overlay_figure(found).savefig(out, dpi=130)
    except ValueError as error:
        raise click.UsageError(f"--out {out}: {error}") from error
    result = {**found.as_dict(), "file": run.source, "out": str(out)}
    emit(result, as_json, lambda: _lines(result))


def _lines(result: dict[str, Any]) -> list[str]:
    share = result["distance_share_of_mean"]
    rows = []
    for name in ("measured", "simulated"):
        told = result[name]
        period = f", period {told['period']}" if told["period"] else ""
        forces = f"mean peak {told['mean_peak_force_N']:.2f} N, largest {told['largest_peak_force_N']:.2f} N"
        rows.append(f"{name:10s} {told['nature']}{period}, {forces}")
    apart = "" if share is None else f", {share:.1%} of the measured mean"
    rows.append(f"their peaks are {result['distance_N']:.3g} N apart on average{apart}")
    return [*rows, f"written to {result['out']}"]
