"""The force and the time among the columns of a recording; never a counter or a time stamp by mistake."""

import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.errors import DiagnosisError
from chaosgym.machines.units import ALTERNATIVES
from chaosgym.signals.read import Recording

Array = NDArray[np.float64]

OTHER = re.compile(
    r"(time|zeit|temps|stamp|date|datum|clock|cycle|zyklus|takt|index|nr|no|count(er)?|rpm|speed|drehzahl|hz|freq\w*|"
    r"phase|angle|winkel|trigger|tacho\w*|temp\w*|displacement|velocity|position|weg)",
    re.IGNORECASE,
)
"""Words in the name of a column that is no force."""

TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "min": 60.0, "h": 3600.0}
FORCES = ALTERNATIVES["N"]


class Signal(NamedTuple):
    """Readings of one column, in newton or seconds; ``described`` is one line on where they come from."""

    values: Array
    name: str
    described: str


def is_counter(values: Array) -> bool:
    """Whether values rise in equal steps, as a counter or an even time stamp does."""
    steps = np.diff(values)
    return len(values) > 4 and bool(steps[0] > 0.0 and np.allclose(steps, steps[0], rtol=1e-6, atol=0.0))


def is_clock(values: Array) -> bool:
    """Whether values never fall and rise on and on, as rounded time stamps do."""
    steps = np.diff(values)
    steady = len(values) > 7 and bool(np.all(steps >= 0.0) and steps.mean() > 0.0)
    return is_counter(values) or (steady and float(np.max(steps)) < 20.0 * float(steps.mean()))


def force_names(recording: Recording) -> list[str]:
    """Columns that could be forces: those with a unit of force, or else those that nothing speaks against."""
    known = [name for name, unit in recording.units.items() if unit in FORCES]
    usable = [name for name in recording.columns if name not in recording.problems or recording.problems[name]]
    named = [name for name in known if name in usable]
    return named or [name for name in usable if not _speaks_against(recording, name)]


def _speaks_against(recording: Recording, name: str) -> str:
    """Why a column is no force; empty if it may be one."""
    values, unit = recording.columns[name], recording.units.get(name, "")
    finite = values[np.isfinite(values)]
    if unit and unit not in FORCES:
        return f"is in {unit}"
    if recording.named and any(OTHER.fullmatch(word) for word in re.split(r"[\W_\d]+", name) if word):
        return "is no force by its name"
    return (
        "rises like a counter or a clock"
        if is_counter(finite) or (len(recording.columns) > 1 and is_clock(finite))
        else ""
    )


def choose_force(recording: Recording, column: str | None = None, unit: str | None = None) -> Signal:
    """Force [N] of a recording.

    Parameters
    ----------
    recording
        What was read.
    column
        Name of the column; needed where several could be the force.
    unit
        Its unit, if the file does not say it.

    Raises
    ------
    DiagnosisError
        If there is no such column, several could be meant, it can't be a force, or an entry is no finite number.
    """
    listed = ", ".join(repr(name) for name in dict.fromkeys([*recording.columns, *recording.problems]))
    if column is None:
        names = force_names(recording)
        if len(names) > 1:
            shown = ", ".join(map(repr, names))
            raise DiagnosisError(
                f"{recording.source} has several columns that could be forces: {shown}; use --column NAME"
            )
        if not names:
            why = "; ".join(f"{name!r} {_speaks_against(recording, name)}" for name in recording.columns)
            raise DiagnosisError(f"{recording.source} has no column that could be a force ({why}); use --column NAME")
        name = names[0]
    else:
        matching = [name for name in recording.columns if name.casefold() == column.strip().casefold()]
        place = re.fullmatch(r"\d+", column.strip())
        if not matching and place and 1 <= int(column) <= len(recording.columns):
            matching = [list(recording.columns)[int(column) - 1]]
        if not matching:
            raise DiagnosisError(f"{recording.source} has no column {column!r}; its columns: {listed}")
        name = matching[0]
    return _force(recording, name, unit)


def forces(recording: Recording, column: str | None = None, unit: str | None = None) -> list[Signal]:
    """Every column that could be a force [N], or the named one: one run a column."""
    names = force_names(recording)
    if column is not None or len(names) < 2:
        return [choose_force(recording, column, unit)]
    return [_force(recording, name, unit) for name in names]


def _force(recording: Recording, name: str, unit: str | None) -> Signal:
    if name in recording.problems:
        raise DiagnosisError(f"{recording.source}, {recording.problems[name]}")
    values, written = recording.columns[name], unit or recording.units.get(name, "")
    if written and written not in FORCES:
        told = f"allowed: {', '.join(FORCES)}" if unit else f"give its unit with --unit ({', '.join(FORCES)})"
        raise DiagnosisError(f"{recording.source}: column {name!r} is in {written}, no unit of force; {told}")
    if is_counter(values):
        raise DiagnosisError(f"{recording.source}: column {name!r} rises in equal steps and can't be a force")
    shown = f"{written}" if written else "taken as N"
    described = f"{recording.source}: {recording.form}, column {name!r} ({shown}), {len(values)} readings"
    return Signal(values * FORCES[written or "N"], name, described)


def check_peaks(signal: Signal, recording: Recording) -> Array:
    """Peaks [N] of a column.

    Raises
    ------
    DiagnosisError
        If one is negative.
    """
    low = np.flatnonzero(signal.values < 0.0)
    if len(low):
        raise DiagnosisError(
            f"{recording.source}, {recording.where(int(low[0]))}: {signal.values[low[0]]:g} N is a negative force; "
            "allowed: 0 N and more, one peak a cycle"
        )
    return signal.values


def choose_time(recording: Recording) -> Signal | None:
    """Time stamps [s], if a column holds them: by its unit, its name, or as the one that rises like a clock."""
    fits = [name for name in recording.columns if recording.units.get(name, "") in TIMES]
    fits += [name for name in recording.columns if re.search(r"time|zeit|temps|stamp", name, re.IGNORECASE)]
    if len(recording.columns) > 1:
        fits += [
            name for name in recording.columns if is_clock(recording.columns[name]) and not recording.units.get(name)
        ]
    if not fits:
        return None
    name = fits[0]
    if name in recording.problems:
        raise DiagnosisError(f"{recording.source}, {recording.problems[name]}")
    unit = recording.units.get(name, "s")
    return Signal(recording.columns[name] * TIMES.get(unit, 1.0), name, f"time from column {name!r} [{unit}]")
