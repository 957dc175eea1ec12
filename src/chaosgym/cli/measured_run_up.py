"""A recording of a run-up or coast-down: what ``diagnose --series FILE --tachometer NAME --run-up`` tells."""

from pathlib import Path
from typing import Any

import click

from chaosgym.cli.measured_options import Measured, in_readings
from chaosgym.cli.output import patience


@patience("read and judge the run-up")
def judged_run_up(given: Measured, orders: float | None) -> tuple[Any, str, str, dict[str, Any], list[str]]:
    """The ``RunUp``, a title for it, the unit of its signal, the answer as JSON, and as lines.

    Raises
    ------
    click.UsageError
        If there is no tachometer.
    DiagnosisError
        If the recording can't be judged.
    """
    from chaosgym.recordings.cycles import series_of
    from chaosgym.recordings.read import read_recording
    from chaosgym.recordings.run_up import HIGHEST_ORDER, run_up

    if not (given.series and given.tachometer):
        raise click.UsageError("--run-up needs --series FILE --tachometer NAME")
    recording = read_recording(given.series, sheet=given.sheet, column=given.column)
    signal, instants, turns = series_of(
        recording,
        given.column,
        given.unit,
        rate_hz=given.rate_hz,
        tachometer=given.tachometer,
        pulses_per_revolution=given.pulses_per_revolution or 1,
        scale=given.scale,
    )
    assert turns is not None
    found = run_up(
        signal.values,
        instants,
        turns,
        sensor_error=in_readings(given.sensor_error, signal.unit),
        sensor_sigma=in_readings(given.sensor_sigma, signal.unit),
        highest=orders or HIGHEST_ORDER,
    )
    notes = [f"read {signal.described}", *found.notes]
    result = {
        "file": recording.source,
        "sha256": recording.sha256,
        "column": signal.name,
        "unit": signal.unit,
        **found.as_dict(),
        "notes": notes,
        "warnings": [],
    }
    speeds = found.speeds
    lines = [
        f"{recording.source}: {found.turns.angles[-1]:.0f} turns, {speeds[0]:.4g} to {speeds[-1]:.4g} rpm"
        f" (between {speeds.min():.4g} and {speeds.max():.4g} rpm)"
    ]
    lines += [_order_line(line, signal.unit) for line in found.lines]
    if found.envelope:
        named = ", ".join(f"{round(line.order, 2):g}" for line in found.envelope)
        lines.append(f"  envelope of the ringing above: orders {named}, the strongest first")
    lines += [] if found.types is None else region_lines(found.types, "rpm", signal.unit)
    title = f"{Path(recording.source).name}, {signal.name}"
    return found, title, signal.unit, result, [*lines, *(f"  {note}" for note in notes)]


def _order_line(line: Any, unit: str) -> str:
    """An order and how large it becomes."""
    largest = f"up to {line.largest:.4g} {unit} at {60.0 * line.speed:.4g} rpm"
    return f"  order {round(line.order, 2):<6g} {largest}, {line.typical:.3g} {unit} over all speeds"


def region_lines(types: Any, speed_unit: str, unit: str) -> list[str]:
    """Regions of types, upwards, and where irregular motion begins."""
    after, rows = f" {speed_unit}" if speed_unit else "", []
    for region in types.regions:
        span = f"{region.first:.6g}" + (f" to {region.last:.6g}" if region.speeds > 1 else "") + after
        inside = [one for one in types.speeds if region.first <= one.speed <= region.last]
        wild = sum(one.nature == "irregular" for one in inside)
        natures = f"irregular at {wild} of {len(inside)} speeds" if wild else "periodic"
        forces = f"mean peak {region.lowest_mean:.4g} to {region.highest_mean:.4g} {unit}"
        rows.append(f"  Type {region.type:4s} {span:18s} {natures}, {forces}")
    for one in types.beginnings:
        route = "route not told" if one.route == "not told" else one.route
        rows.append(f"  irregular between {one.periodic:.6g} and {one.irregular:.6g}{after}: {route}; {one.because}")
    return rows
