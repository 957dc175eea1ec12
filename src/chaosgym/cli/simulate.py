"""Commands for one machine: ``simulate``, ``show`` what it is made of, and ``new-machine``, the file of another."""

import time
from pathlib import Path
from typing import Any

import click
import numpy as np

from chaosgym.cli.machine_options import machine_command
from chaosgym.cli.options import IntRange
from chaosgym.cli.output import AS_JSON, announce, check_target, emit, picture_path, plot_option, write_table


@machine_command(chooses="point")
@click.option("--cycles", type=IntRange(1, 10**7), default=100, show_default=True, help="Cycles to record.")
@click.option("--transient", type=IntRange(0, 10**7), default=0, show_default=True, help="Cycles to skip first.")
@click.option("--out", type=click.Path(dir_okay=False), help="Peak force of every cycle, all sides: CSV or Parquet.")
@click.option("--series-out", type=click.Path(dir_okay=False), help="Force and motion over time: CSV or Parquet.")
@click.option("--samples", type=IntRange(8, 10**5), default=256, show_default=True, help="A cycle, --series-out.")
@click.option("--overwrite", is_flag=True, help="Replace these files if they exist.")
@plot_option()
def simulate(
    machine: Any,
    cycles: int,
    transient: int,
    out: str | None,
    series_out: str | None,
    samples: int,
    overwrite: bool,
    plot: str | None,
    as_json: bool,
) -> None:
    """Run a machine from rest; print the last peak forces, and write those of every cycle to a file."""
    from chaosgym.simulation import simulate as run

    picture = picture_path(plot, f"simulate-{machine.name}")
    if out or series_out:
        for path in filter(None, (out, series_out)):
            check_target(path, overwrite)
    announce("simulate", machine, transient + cycles)  # a first run compiles, or loads what is compiled
    start = time.process_time()
    record = run(machine, cycles, transient=transient, samples_per_cycle=samples if series_out else 0, progress=True)
    seconds_per_cycle = (time.process_time() - start) / (transient + cycles)
    first = 2 * record.joint
    contact = record.contact_fraction[:, first : first + 2].sum(axis=1)
    surfaces = {side: record.peak_force[:, place] for side, place in machine.surfaces.items()}
    worst = machine.sides[record.worst_side]
    result = {
        "machine": machine.name,
        "peak_force_N": surfaces[worst],
        "worst_surface": worst,
        "surfaces_peak_force_N": surfaces,
        "impacts": record.impacts.sum(axis=1),
        "contact_fraction": contact,
        "seconds_per_cycle": seconds_per_cycle,
    }
    no_contact = not record.peak_force.any()
    result["warnings"] = ["no contact at all: the gap is never closed"] if no_contact else []
    if out:
        write_table(
            {"cycle": np.arange(1, cycles + 1), **{f"{side} [N]": peaks for side, peaks in surfaces.items()}}, out
        )
    if series_out and record.history is not None:
        every = record.history if record.histories is None else record.histories
        quantities = ("displacement [m]", "velocity [m/s]", "force [N]")
        names = [f"{joint} {name}" for joint in machine.joints for name in quantities] or quantities
        motion = every.reshape(-1, every.shape[2]).T
        write_table({"time [s]": record.time, **dict(zip(names, motion, strict=True))}, series_out)
    result["files"] = [path for path in (out, series_out) if path]
    sensors = dict(zip(machine.sensors, _largest(record.sensor_peak), strict=True))
    if sensors:
        result["largest_sensor_force_N"] = sensors
    drive = machine.drive_torque
    if drive is not None:
        result["drive"] = drive.as_dict()
    lines = [
        f"{machine.name}: {cycles} cycles after {transient}",
        *_monitored(machine),
        *(
            f"{f'peak force, {side}':25s} {peaks.min():.2f} to {peaks.max():.2f} N, mean {peaks.mean():.2f} N"
            for side, peaks in surfaces.items()
        ),
        f"{f'last peaks, {worst}':25s} {' '.join(f'{peak:.2f}' for peak in surfaces[worst][-8:])}",
        f"impacts per cycle         {record.impacts.sum(axis=1).mean():.1f}",
        f"share in contact          {contact.mean():.2f}",
        *(f"largest force, {name:16s} {force:.2f} N" for name, force in sensors.items()),
        *(() if drive is None else drive.told),
        *result["warnings"],
        *(f"written to {path}" for path in result["files"]),
        f"computing time            {1e6 * seconds_per_cycle:.0f} us per cycle",
    ]
    emit(result, as_json, lambda: lines, picture, lambda plots: plots.simulation_figure(record, transient))


def _monitored(machine: Any) -> list[str]:
    """Which of several joints is shown, where the sides do not say so."""
    from chaosgym.machines.parameters import parameters_of

    about = parameters_of(machine).get("monitored")
    several = about is not None and len(about.choices) > 1 and not machine.joints
    return [f"monitored joint           {machine.monitored}"] if several else []


def _largest(sensor_peak: Any) -> list[float]:
    return [] if sensor_peak is None else [float(force) for force in sensor_peak.max(axis=0)]


@machine_command
@click.option("--markdown", is_flag=True, help="Print the table of the documentation.")
@plot_option()
def show(machine: Any, markdown: bool, plot: str | None, as_json: bool) -> None:
    """Print every parameter of a machine, where the number comes from, and what follows; --plot draws it."""
    from chaosgym.machines.parameters import digits, markdown_table, origin_of, parameters_of

    picture = picture_path(plot, f"show-{machine.name}")

    if markdown and as_json:
        raise click.UsageError("--markdown and --json exclude each other")
    if markdown:
        return click.echo("\n".join(markdown_table(machine)))
    described = parameters_of(machine)
    frequencies = machine.natural_frequencies.tolist()
    origins = {name: origin_of(machine, name) for name in described}
    provenance = {
        name: {"unit": described[name].unit, "grade": grade, "source": source}
        for name, (grade, source) in origins.items()
    }
    result = {
        "machine": machine.name,
        "parameters": {name: getattr(machine, name) for name in described},
        "natural_frequencies_hz": frequencies,
        "mover": machine.moving.how,
        "provenance": provenance,
        **{name: getattr(machine, name) for name in ("degrees_of_freedom", "sensors") if machine.degrees_of_freedom},
    }

    drive = machine.drive_torque
    if drive is not None:
        result["drive"] = drive.as_dict()
    motor = machine.under_motor() if machine.has_motor else None
    if motor is not None:
        result["motor"] = motor.as_dict()

    def lines() -> list[str]:
        rows = []
        for name, about in described.items():
            value = getattr(machine, name)
            shown = value if isinstance(value, str) else digits(value)
            unit = "" if about.unit == "-" else about.unit
            origin = provenance[name]
            rows.append(f"{name:30s} {shown:>11s} {unit:8s} {origin['grade']:10s} {origin['source']}")
        if frequencies:
            rows.append("natural frequencies [Hz]: " + ", ".join(f"{value:.1f}" for value in frequencies))
        rows.append(f"moved by {machine.moving.how}")
        for name in ("degrees_of_freedom", "sensors"):
            if names := getattr(machine, name):
                rows.append(f"{len(names)} {name.replace('_', ' ')}: {', '.join(names)}")
        return [*rows, *(() if drive is None else drive.told), *(() if motor is None else (motor.told,))]

    emit(result, as_json, lines, picture, lambda plots: plots.machine_figure(machine))


@click.command("new-machine")
@click.argument("kind", default="mass", metavar="[mass|modes|four-bar|slider-crank|compressor]")
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="New file; standard output by default.")
@click.option("--schema", is_flag=True, help="The JSON schema of such files instead, for editors.")
@AS_JSON
def new_machine(kind: str, out: Path | None, schema: bool, as_json: bool) -> None:
    """Print the commented file of a machine, of a mass between two stops by default.

    "modes" has every key of modes or matrices with gaps; the others are mechanisms of links and joints.
    """
    from chaosgym.files import write_atomically
    from chaosgym.machines.machine_file import schema_text, template

    if kind.endswith(".toml") and out is None:
        raise click.UsageError(f"{kind} is no template; use --out {kind} for the file to write")
    text = schema_text() if schema else template(kind)
    if out is not None:
        if out.exists():
            raise click.UsageError(f"--out {out} exists already; choose another name")
        write_atomically(out, lambda path: path.write_text(text, encoding="utf-8"))
    result = {"out": None if out is None else str(out), "text": text}
    told = (
        text.rstrip() if out is None else f"written to {out}" + ("" if schema else f"; next: chaosgym diagnose {out}")
    )
    emit(result, as_json, lambda: [told])
