"""The command ``stability``: models at extreme parameters."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from chaosgym.cli.fidelity import FOLDER, write_result
from chaosgym.cli.machine_options import machine_command
from chaosgym.cli.output import WORKERS, emit

if TYPE_CHECKING:
    from benchmarks.fidelity.stability import StabilityMap


@machine_command
@WORKERS
@click.option("--out", type=FOLDER, default=None, help="Write stability.json and stability.png there.")
def stability(machine: Any, workers: int | None, out: Path | None, as_json: bool) -> None:
    """Run a machine at every extreme on every rung: an answer within physical bounds, or an error with a name."""
    from benchmarks.fidelity.stability import stability_map

    result = stability_map(machine, workers=workers, progress=True)
    if out is not None:
        from benchmarks.fidelity.stability_figure import stability_figure

        write_result(out, "stability", result.as_dict(), stability_figure(result))
    emit(result.as_dict(), as_json, lambda: _stability_lines(result))


def _stability_lines(result: "StabilityMap") -> list[str]:
    lines = []
    for cell in result.cells:
        ended = f"{cell.largest_peak:10.4g} N" if cell.largest_peak is not None else f"{cell.outcome}: {cell.detail}"
        lines.append(f"{cell.extreme:28s} {cell.model:14s} {ended}")
    counts = ", ".join(f"{result.count(outcome)} {outcome}s" for outcome in ("answer", "named error", "failure"))
    return [*lines, f"{result.machine}: {counts}"]
