"""The force and the speed among the columns of a recording, never a counter or a clock by mistake."""

import math
import re
from collections.abc import Iterator
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError, nearest_or
from chaosgym.recordings.quantities import (
    CLOCK,
    DIMENSIONS,
    FORCES,
    OTHERS,
    SAME_LETTERS,
    SPEEDS,
    UNITS,
    UNKNOWN,
    VOLTS,
    WORDS,
    as_unit,
    other_quantity,
    split_unit,
)
from chaosgym.recordings.read import Recording

OTHER = re.compile(
    r"(cycle|zyklus|takt|index|nr|no|id|table|count(er)?|rpm|speed|drehzahl|hz|freq\w*|"
    r"phase|angle|winkel|trigger|tacho\w*|temp\w*|displacement|velocity|position|weg)",
    re.IGNORECASE,
)
"""Words in the name of a column that is no force."""

SPEED = re.compile(r"hz|freq\w*|frequenz|rpm|speed|drehzahl", re.IGNORECASE)
"""Words in the name of a column that holds the speed of each reading."""

FIRST, BLOCK = 1000, 2**20
"""Readings that tell of most columns that they are no clock, and those of a long column that are looked at in turn."""

LARGEST = 1e100
"""Size of a reading beyond which sums of squares are no numbers."""

MOST_SHOWN = 12
"""Columns that a message names."""

CALIBRATION = re.compile(r"\s*([\d.,]+(?:e[+-]?\d+)?)\s*([^\s/]+(?:/s(?:²|2|\^2))?)\s*(?:/\s*(\S+))?\s*", re.IGNORECASE)
"""A number, a unit and the unit that it is divided by."""

COMMON = {"acceleration": "m/s^2", "velocity": "mm/s", "displacement": "mm", "pressure": "bar", "moment": "Nm"}
MAY_BE = {**{other: (other,) for other in COMMON}, "vibration": ("acceleration", "velocity", "displacement")}
"""A unit of each quantity, and what readings may be whose title tells of one."""


class Signal(NamedTuple):
    """Readings of one column; ``described`` is one line on where they come from.

    Forces are in newton, times in seconds, any other quantity in the ``unit`` of the file. Those of which no unit is
    known, but that they are no forces, are in "units".
    """

    values: Array
    name: str
    described: str
    unit: str = "N"


def is_counter(values: Array) -> bool:
    """Whether values rise in equal steps, as a counter or an even time stamp does."""
    steps = np.diff(values[:FIRST])
    if len(values) < 5 or not steps[0] > 0.0:
        return False
    return all(np.allclose(each, steps[0], rtol=1e-6, atol=0.0) for each in steps_of(values))


def steps_of(values: Array) -> Iterator[Array]:
    """Differences of successive values, block by block: those of a long column need as much memory as it."""
    for first in range(0, max(1, len(values) - 1), BLOCK):
        yield np.diff(values[first : first + BLOCK + 1])


def is_clock(values: Array) -> bool:
    """Whether values never fall and rise on and on, as rounded time stamps do."""
    if np.any(np.diff(values[:FIRST]) < 0.0):
        return False
    size = len(values)
    steady = size > 7 and bool(all(np.all(steps >= 0.0) for steps in steps_of(values)) and values[-1] > values[0])
    mean = float(values[-1] - values[0]) / max(1, size - 1)
    return is_counter(values) or (steady and max(float(steps.max()) for steps in steps_of(values)) < 20.0 * mean)


def rises(values: Array) -> bool:
    """Whether values seldom fall, as instants do of which some are wrong."""
    rising = sum(int(np.count_nonzero(steps >= 0.0)) for steps in steps_of(values))
    return bool(rising >= 0.9 * (len(values) - 1))


def force_names(recording: Recording) -> list[str]:
    """Columns that could be forces: those in a unit of force, or that nothing speaks against; else of another quantity.

    Where there is none of these, it is those in a unit that is not known, of which a person may state another.
    """
    known = [name for name, unit in recording.units.items() if unit in FORCES]
    usable = [name for name in recording.columns if name not in recording.problems or recording.problems[name]]
    named = [name for name in known if name in usable]
    plain = [name for name in usable if not _speaks_against(recording, name)]
    others = [name for name in usable if recording.units.get(name, "") in OTHERS or _other(recording, name)]
    unknown = [name for name in usable if (unit := recording.units.get(name, "")) and unit not in UNITS]
    return named or plain or others or unknown


def _other(recording: Recording, name: str) -> str:
    """As ``other_quantity``; empty where there are no titles."""
    return other_quantity(name) if recording.named else ""


def check_unit(source: str, name: str, stated: str, written: str, other: str) -> None:
    """Refuse a unit of another dimension than the column has by its title or by its unit in the file.

    Parameters
    ----------
    source, name
        Of the file and of the column, for the message.
    stated, written
        The unit that is to hold, and the one that the file has; empty if there is none.
    other
        Quantity that the title tells of, as ``other_quantity``.

    Raises
    ------
    DiagnosisError
        If the dimensions differ.
    """
    asked, known = DIMENSIONS.get(stated, ""), DIMENSIONS.get(written, "")
    if other and asked and asked not in (*MAY_BE[other], "voltage", "current"):
        units = " or ".join(f"unit={COMMON[one]}" for one in MAY_BE[other])
        cure = f"leave unit={stated} out" if known in MAY_BE[other] else f"state its own, such as --read {units}"
        raise DiagnosisError(
            f"{source}: column {name!r} is of {other} by its title, and {stated} is a unit of {asked}; {cure}, or "
            "correct the title if it is wrong"
        )
    if known and asked and asked != known and not other and stated not in SAME_LETTERS.get(written, ()):
        raise DiagnosisError(
            f"{source}: column {name!r} is in {written}, a unit of {known}, and {stated} is one of {asked}; leave "
            f"unit={stated} out, or correct the title if it is wrong"
        )


def _speaks_against(recording: Recording, name: str) -> str:
    """Why a column is no force; empty if it may be one."""
    values, unit = recording.columns[name], recording.units.get(name, "")
    finite = _finite(values)
    if unit and unit not in FORCES:
        return f"is in {unit}"
    words = [word for word in re.split(r"[\W_\d]+", name) if word] if recording.named else []
    if other := _other(recording, name):
        return f"is of {other} by its name"
    if any(OTHER.fullmatch(word) or (CLOCK.fullmatch(word) and rises(finite)) for word in words):
        return "is no force by its name"
    return (
        "rises like a counter or a clock"
        if is_counter(finite) or (len(recording.columns) > 1 and is_clock(finite))
        else ""
    )


def choose_force(
    recording: Recording, column: str | None = None, unit: str | None = None, scale: str | None = None
) -> Signal:
    """Force [N] of a recording, or another quantity in its own unit.

    Parameters
    ----------
    recording
        What was read.
    column
        Name of the column; needed where several could be the force.
    unit
        Its unit, if the file does not say it.
    scale
        Calibration, such as ``"100 mV/N"`` or ``"20 N/V"``, that makes a force or another quantity of the readings.

    Raises
    ------
    DiagnosisError
        If there is no such column, several could be meant, it can't be a force, or an entry is no finite number.

    Examples
    --------
    >>> from chaosgym.recordings.columns import choose_force
    >>> force = choose_force(chaosgym.read_recording("docs/data/peaks.csv"), "upper")
    >>> force.name, force.unit, len(force.values)
    ('upper', 'N', 1000)
    """
    if column is None:
        names = force_names(recording)
        if len(names) > 1:
            raise DiagnosisError(
                f"{recording.source} has several columns that could be forces: {_first(list(map(repr, names)), ', ')}; "
                "state --read column=NAME"
            )
        if not names:
            told = {name: _speaks_against(recording, name) for name in recording.columns} | dict(recording.texts)
            unread = {f"{name!r}, {recording.problems[name]}" for name in recording.problems.keys() - told.keys()}
            why = _first([*(f"{name!r} {reason}" for name, reason in told.items()), *sorted(unread)], "; ")
            raise DiagnosisError(
                f"{recording.source} has no column that could be a force ({why}); state --read column=NAME"
            )
        name = names[0]
    else:
        name = named_column(recording, column)
    return _force(recording, name, unit, scale)


def named_column(recording: Recording, column: str) -> str:
    """Name of the column that is meant by a name, with or without its unit and its group, or by a number.

    Raises
    ------
    DiagnosisError
        If there is none.
    """
    asked = {column.strip().casefold(), split_unit(column)[0].casefold()}
    matching = [name for name in recording.columns if name.casefold() in asked]
    place = re.fullmatch(r"\d{1,9}", column.strip(), re.ASCII)
    if not matching and place and 1 <= int(column) <= len(recording.columns):
        matching = [list(recording.columns)[int(column) - 1]]
    if not matching:
        within = [name for name in recording.columns if re.split(r"[/.]", name.casefold())[-1] in asked]
        matching = within if len(within) == 1 else []
    if not matching:
        text = next((name for name in recording.texts if name.casefold() in asked), None)
        if text is not None:
            raise DiagnosisError(f"{recording.source}: column {text!r} {recording.texts[text]}")
        unread = next((name for name in recording.problems if name.casefold() in asked), None)
        if unread is not None:
            raise DiagnosisError(f"{recording.source}, column {unread!r}, {recording.problems[unread]}")
        known = list(dict.fromkeys([*recording.columns, *recording.problems]))
        told = nearest_or(f"its columns of numbers: {_first(list(map(repr, known)), ', ')}", column, known)
        raise DiagnosisError(f"{recording.source} has no column {column!r}; {told}")
    return matching[0]


def choose_speed(recording: Recording, column: str | None = None) -> Signal:
    """Speed of each reading, in the file's unit: the column of that name, or the one whose name or unit says so.

    Raises
    ------
    DiagnosisError
        If there is no such column, several could be meant, or an entry is no finite number.
    """
    if column is None:
        names = [
            name
            for name in dict.fromkeys([*recording.columns, *recording.problems])
            if recording.units.get(name, "") in SPEEDS or any(map(SPEED.fullmatch, re.split(r"[\W_\d]+", name)))
        ]
        if len(names) != 1:
            several = f"several columns that could be the speed: {_first(list(map(repr, names)), ', ')}"
            told = several if names else "no column that says it is a speed"
            raise DiagnosisError(f"{recording.source} has {told}; use --speed-column NAME")
        name = names[0]
    else:
        name = named_column(recording, column)
    if name in recording.problems:
        raise DiagnosisError(f"{recording.source}, {recording.problems[name]}")
    unit = recording.units.get(name, "")
    described = f"column {name!r}{f' ({unit})' if unit else ''} is the speed"
    return Signal(recording.columns[name].astype(float), name, described, unit)


def forces(
    recording: Recording, column: str | None = None, unit: str | None = None, scale: str | None = None
) -> list[Signal]:
    """Every column that could be a force [N], or those that are named: one run a column.

    ``column`` is a name, a number, a pattern such as ``"bearing*"``, or several of them with commas between.
    """
    names = force_names(recording) if column is None else named_columns(recording, column)
    if column is None and len(names) < 2:
        return [choose_force(recording, None, unit, scale)]
    return [_force(recording, name, unit, scale) for name in names]


def named_columns(recording: Recording, column: str) -> list[str]:
    """Columns that a name, a number, a pattern, or several of them with commas between mean; each once.

    Raises
    ------
    DiagnosisError
        If one of them means no column.
    """
    whole = [name for name in recording.columns if name.casefold() == column.strip().casefold()]
    found = list(whole)
    for part in [] if whole else column.split(","):
        matching = [name for name in recording.columns if fnmatchcase(name.casefold(), part.strip().casefold())]
        found += matching or [named_column(recording, part)]
    return list(dict.fromkeys(found))


def _force(recording: Recording, name: str, unit: str | None, scale: str | None) -> Signal:
    if name in recording.problems:
        raise DiagnosisError(f"{recording.source}, {recording.problems[name]}")
    if name in recording.doubts and not unit:
        raise DiagnosisError(f"{recording.source}: column {name!r} {recording.doubts[name]}; state it: --read unit=N")
    own, other = recording.units.get(name, ""), _other(recording, name)
    values, written = recording.columns[name], as_unit(unit or "") or unit or own
    if written and written not in FORCES and written not in OTHERS and not scale:
        allowed = [*FORCES, *sorted(OTHERS)]
        cure = "" if unit else "state its unit, such as --read unit=N; "
        cure += nearest_or(f"allowed: {', '.join(allowed)}", written, [*allowed, *WORDS])
        raise DiagnosisError(f"{recording.source}: column {name!r} is in {written}, no unit that is known; {cure}")
    check_unit(recording.source, name, written, own, other)
    if max(float(np.fmax.reduce(values, initial=0.0)), -float(np.fmin.reduce(values, initial=0.0))) > LARGEST:
        place = int(np.argmax(np.abs(values) > LARGEST))
        raise DiagnosisError(
            f"{recording.source}, column {name!r}, {recording.where(place)}: {values[place]:g} is no reading of a "
            f"sensor; allowed: up to {LARGEST:g}"
        )
    if is_counter(_finite(values)):
        raise DiagnosisError(f"{recording.source}: column {name!r} rises in equal steps and can't be a force")
    told = written or (UNKNOWN if other else "N")
    factor, target = FORCES.get(told, 1.0), "N" if told in FORCES else told
    shown = written or (f"of {other} by its title, whose unit the file does not state" if other else "taken as N")
    if unit and own not in ("", written):
        shown = f"{written} as stated, instead of {own}"
    if scale:
        factor, target = calibration(scale, written)
        shown = f"{written or 'no unit'}, {scale.strip()}"
        if target == "N" and other and DIMENSIONS.get(written) not in MAY_BE[other]:
            raise DiagnosisError(
                f"{recording.source}: column {name!r} is of {other} by its title, and scale = {scale!r} makes "
                "forces of it; leave it out, or correct the title if it is wrong"
            )
    described = f"{recording.source}: {recording.form}, column {name!r} ({shown}), {len(values)} readings"
    if missing := int(np.count_nonzero(~np.isfinite(values))):
        described += f", {missing} of them missing, the first in {recording.where(int(np.argmin(np.isfinite(values))))}"
    return Signal(values if factor == 1.0 else np.multiply(values, factor, dtype=float), name, described, target)


def _finite(values: Array) -> Array:
    """Readings without those that are missing."""
    there = np.isfinite(values)
    return values if there.all() else values[there]


def calibration(scale: str, written: str) -> tuple[float, str]:
    """(factor, unit) that make a quantity of readings in the unit ``written``.

    ``100 mV/N`` is a sensitivity, ``20 N/V`` a range; the side that is not the readings' unit is the quantity's.

    Raises
    ------
    DiagnosisError
        If the text is no calibration, or neither side is a unit of the readings.
    """
    found = CALIBRATION.fullmatch(scale)
    try:
        size = float(found[1].replace(",", ".")) if found else 0.0
    except ValueError:
        size = 0.0
    if found is None or not 0.0 < size < math.inf:
        raise DiagnosisError(f"scale = {scale!r} is no calibration; allowed: such as '100 mV/N', '20 N/V' or '50 N/FS'")
    above, below = found[2], found[3] or written or "FS"
    for factor, quantity, electric in ((size, above, below), (1.0 / size, below, above)):
        turned = _same_kind(written, electric)
        if turned and (quantity in FORCES or quantity in OTHERS):
            force = quantity in FORCES
            return factor * turned * FORCES.get(quantity, 1.0), "N" if force else quantity
    cure = "allowed: one of this unit" if written else "state theirs: --read unit=V"
    raise DiagnosisError(f"scale = {scale!r} does not fit readings in {written or 'no unit'}; {cure}")


def _same_kind(written: str, electric: str) -> float:
    """Readings' unit in that of the calibration; 0 if they are of different kinds."""
    if written in VOLTS and electric in VOLTS:
        return VOLTS[written] / VOLTS[electric]
    return 1.0 if electric == written or (not written and electric == "FS") else 0.0


def check_peaks(signal: Signal, recording: Recording) -> Array:
    """Peaks of a column, without those that are missing.

    Raises
    ------
    DiagnosisError
        If a force is negative.
    """
    low = np.flatnonzero(signal.values < 0.0)
    if len(low) and signal.unit == "N":
        raise DiagnosisError(
            f"{recording.source}, {recording.where(int(low[0]))}: {signal.values[low[0]]:g} N is a negative force; "
            "allowed: 0 N and more, one peak a cycle"
        )
    return _finite(signal.values).astype(float)


def _first(texts: list[str], between: str) -> str:
    """The first of many, and how many follow."""
    more = len(texts) - MOST_SHOWN
    return between.join(texts[:MOST_SHOWN]) + (f" and {more} more" if more > 0 else "")
