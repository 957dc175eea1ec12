"""A recording beside a machine: ``fit`` asks its model, ``overlay`` lays one over the other."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from chaosgym.cli.judge import run_lines
from chaosgym.cli.machine_options import machine_command
from chaosgym.cli.options import FILE, recording_options
from chaosgym.cli.output import DIAGNOSED, announce, emit, patience, picture_path, plot_option

if TYPE_CHECKING:
    from chaosgym.fit.record_fit import RecordFit
    from chaosgym.recordings.kind import RecordingOptions


@machine_command
@FILE
@recording_options()
@click.option(
    "--estimate", multiple=True, metavar="FIELD", help="Tell this field of the machine, such as clearance; repeatable."
)
@plot_option()
def fit(
    machine: Any,
    file: str,
    options: "RecordingOptions",
    estimate: tuple[str, ...],
    plot: str | None,
    as_json: bool,
) -> None:
    """Tell what a machine's model says of a recording: its nature, and parameters of the machine."""
    from chaosgym.fit.model_fit import usual_cycles
    from chaosgym.fit.record_fit import fit_record

    picture = picture_path(plot, f"fit-{machine.name}")

    def begin() -> None:
        announce("fit", machine, DIAGNOSED * usual_cycles(machine, estimate))

    with patience("compare with the machine"):
        result = fit_record(machine, file, options, estimate=estimate, begin=begin)
    first = result.runs[0]
    emit(
        result.as_dict(),
        as_json,
        lambda: _fit_lines(result),
        picture,
        lambda plots: plots.measured_figure(first),
    )


def _fit_lines(result: "RecordFit") -> list[str]:
    """What the model says, then each column without it."""
    from chaosgym.fit.record_fit import estimate_lines

    fit, runs = result.fit, result.runs
    lines = [f"{runs[0].source} by {result.machine.name}: {fit.words}", f"  {fit.reason}"]
    if fit.fits:
        noise = ", ".join(f"{name} {100.0 * share:.2g} %" for name, share in fit.noise.items())
        lines.append(f"  noise that makes such records: {noise}")
    lines += [f"  {line}" for line in estimate_lines(result.machine, fit.estimates)]
    return [*lines, *(line for run in runs for line in run_lines(f"{run.name} without the model", run))]


@machine_command(chooses="point")
@FILE
@recording_options()
@click.option(
    "--out", type=click.Path(dir_okay=False, path_type=Path), required=True, help="Picture (.png, .svg, .pdf)."
)
def overlay(machine: Any, file: str, options: "RecordingOptions", out: Path, as_json: bool) -> None:
    """Lay a recording over what a machine does: peaks, their distribution and their section."""
    from chaosgym.fit.overlay import overlay as compare
    from chaosgym.plotting.commands import overlay_figure
    from chaosgym.plotting.style import check_picture, save_picture
    from chaosgym.recordings.runs import judged_run

    picture = check_picture(out)
    with patience("read and judge the recording"):
        run = judged_run(file, options)
    both = compare(machine, run.peaks, run.verdict.diagnosis, larger=run.kind == "series")
    save_picture(overlay_figure(both), picture)
    result = {**both.as_dict(), "file": run.source, "out": str(out)}
    emit(result, as_json, lambda: _overlay_lines(result))


def _overlay_lines(result: dict[str, Any]) -> list[str]:
    share = result["distance_share_of_mean"]
    rows = []
    for name in ("measured", "simulated"):
        one = result[name]
        period = f", period {one['period']}" if one["period"] else ""
        forces = f"mean peak {one['mean_peak_force_N']:.2f} N, largest {one['largest_peak_force_N']:.2f} N"
        rows.append(f"{name:10s} {one['nature']}{period}, {forces}")
    apart = "" if share is None else f", {share:.1%} of the measured mean"
    rows.append(f"their peaks are {result['distance_N']:.3g} N apart on average{apart}")
    return [*rows, f"written to {result['out']}"]
