"""What does a machine's model say of a file? The record's columns beside the machine, and the record alone."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from chaosgym.errors import DiagnosisError
from chaosgym.fit.model_draws import fields_to_estimate
from chaosgym.fit.model_fit import Estimate, ModelFit, model_fit, with_record
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import parameters_of
from chaosgym.plain import Result
from chaosgym.recordings.judge import judge_peaks
from chaosgym.recordings.kind import RecordingOptions
from chaosgym.recordings.runs import Run, judged_runs
from chaosgym.series.noise import stated_error


@dataclass(frozen=True)
class RecordFit(Result):
    """A file beside a machine.

    Attributes
    ----------
    machine
        At its nominal parameters.
    runs
        Columns of the file, each with the verdict on it alone.
    fit
        What the model says of them.
    """

    shows = "machine=machine.name records=runs"

    machine: Machine
    runs: tuple[Run, ...]
    fit: ModelFit

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        file = {"file": self.runs[0].source, "columns": [run.name for run in self.runs]}
        warnings = [] if self.fit.nature != "undetermined" else [self.fit.reason]
        return {**super().as_dict(), **file, **self.fit.as_dict(), "warnings": warnings}


def fit_record(
    machine: Machine,
    source: str | Path,
    options: RecordingOptions | None = None,
    *,
    estimate: Sequence[str] = (),
    begin: Callable[[], object] = lambda: None,
) -> RecordFit:
    """Compare the columns of a file with what a machine does within its tolerances.

    Parameters
    ----------
    machine
        At its nominal parameters.
    source
        Name of the file; "-" is standard input.
    options
        What is stated of it.
    estimate
        Fields of the machine to estimate, as for ``model_fit``.
    begin
        Is called once the file is read, before what takes long.

    Raises
    ------
    DiagnosisError
        If the file can't be judged, or several columns are not named as surfaces of the machine are.
    """
    options = options or RecordingOptions()
    fields_to_estimate(machine, estimate)
    error = stated_error(options.sensor_error, options.sensor_sigma)
    runs = judged_runs(source, options, of_force=True)
    surfaces = _surfaces(machine, runs)
    if len(runs) > 1 and not all(run.aligned for run in runs):
        raise DiagnosisError(f"{runs[0].source}: cycles were left out of one column; compare one column at a time")
    peaks = np.column_stack([run.peaks for run in runs])
    begin()
    fit = model_fit(
        machine,
        peaks,
        surfaces=surfaces,
        larger=runs[0].kind == "series" and surfaces is None,
        sensor_sigma=None if error is None else error.sigma,
        estimate=estimate,
    )
    alone = runs[0].verdict
    if len(runs) > 1:
        alone = judge_peaks(peaks, sensor_error=options.sensor_error, sensor_sigma=options.sensor_sigma)
    return RecordFit(machine, runs, with_record(fit, alone))


def _surfaces(machine: Machine, runs: Sequence[Run]) -> list[int] | None:
    """Places of the surfaces that columns are named after; None for one column of another name."""
    places = {name.lower(): place for name, place in machine.surfaces.items()}
    named = [places[run.name.lower()] for run in runs if run.name.lower() in places]
    if len(named) == len(runs):
        return named
    if len(runs) > 1:
        names = ", ".join(repr(run.name) for run in runs)
        raise DiagnosisError(
            f"columns {names} are compared with surfaces of {machine.name}; allowed: {', '.join(machine.surfaces)}"
        )
    return None


def estimate_lines(machine: Machine, estimates: Mapping[str, Estimate]) -> list[str]:
    """Value and interval of each parameter, or that the record does not tell it."""
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
