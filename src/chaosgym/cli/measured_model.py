"""A measured run beside a machine: what ``diagnose MACHINE --peaks FILE`` tells."""

from collections.abc import Mapping, Sequence
from typing import Any

import click

from chaosgym.cli.measured_options import Measured, Run, measured_runs, run_as_dict, run_lines
from chaosgym.cli.output import patience


def compared(machine: Any, measured: Measured, estimate: Sequence[str]) -> tuple[Run, dict[str, Any], list[str]]:
    """The first run, what the machine's model says of the record as JSON, and as lines.

    Raises
    ------
    click.UsageError
        If several columns are not named as surfaces of the machine are.
    DiagnosisError
        If the record can't be compared.
    """
    import numpy as np

    from chaosgym.errors import DiagnosisError
    from chaosgym.fit.model_draws import fields_to_estimate
    from chaosgym.fit.model_fit import model_fit, with_record
    from chaosgym.recordings.judge import judge_peaks
    from chaosgym.series.noise import stated_error

    fields_to_estimate(machine, estimate)
    told = stated_error(measured.sensor_error, measured.sensor_sigma)
    runs = measured_runs(measured, of_force=True)
    surfaces = _surfaces(machine, runs)
    if len(runs) > 1 and not all(run.aligned for run in runs):
        raise DiagnosisError(f"{runs[0].source}: cycles were left out of one column; compare one column at a time")
    peaks = np.column_stack([run.peaks for run in runs])
    with patience("compare with the machine"):
        found = model_fit(
            machine,
            peaks,
            surfaces=surfaces,
            larger=bool(measured.series) and surfaces is None,
            sensor_sigma=None if told is None else told.sigma,
            estimate=estimate,
        )
        alone = runs[0].verdict
        if len(runs) > 1:
            alone = judge_peaks(peaks, sensor_error=measured.sensor_error, sensor_sigma=measured.sensor_sigma)
    found = with_record(found, alone)
    result = {
        "machine": machine.name,
        "file": runs[0].source,
        "columns": [run.name for run in runs],
        **found.as_dict(),
        "records": [run_as_dict(run) for run in runs],
        "warnings": [] if found.nature != "undetermined" else [found.reason],
    }
    lines = [f"{runs[0].source} by {machine.name}: {found.words}", f"  {found.reason}"]
    if found.fits:
        noise = ", ".join(f"{name} {100.0 * share:.2g} %" for name, share in found.noise.items())
        lines.append(f"  noise that makes such records: {noise}")
    lines += [f"  {line}" for line in estimate_lines(machine, found.estimates)]
    for run in runs:
        lines += run_lines(f"{run.name} without the model", run)
    return runs[0], result, lines


def _surfaces(machine: Any, runs: Sequence[Run]) -> list[int] | None:
    """Places of the surfaces that columns are named after; None for one column of another name."""
    places = {name.lower(): place for name, place in machine.surfaces.items()}
    found = [places.get(run.name.lower()) for run in runs]
    known = [place for place in found if place is not None]
    if len(known) == len(runs):
        return known
    if len(runs) > 1:
        names = ", ".join(repr(run.name) for run in runs)
        raise click.UsageError(
            f"columns {names} are compared with surfaces of {machine.name}; allowed: {', '.join(machine.surfaces)}"
        )
    return None


def estimate_lines(machine: Any, estimates: Mapping[str, Any]) -> list[str]:
    """Value and interval of each parameter, or that the record does not tell it."""
    from chaosgym.machines.parameters import parameters_of

    rows = []
    for field, one in estimates.items():
        unit = parameters_of(machine)[field].unit
        factor, unit = (1e3, "mm") if unit == "m" else (1.0, "" if unit == "-" else unit)
        shown = f"{factor * one.low:.4g} to {factor * one.high:.4g} {unit}".rstrip()
        if one.told:
            rows.append(f"{field}: {factor * one.value:.4g} {unit}".rstrip() + f" (90 %: {shown})")
        else:
            rows.append(f"{field}: the record does not tell it; anything from {shown} makes such records")
    return rows
