"""Names, units, rates and speeds of the columns of a recording: decided here, once, for every format."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.recordings.quantities import RATES, TIMES, as_unit, same_unit, split_unit
from chaosgym.recordings.raw import LONGEST, Raw, RawColumn, short

MOST_MISSING = 0.02
"""Share of the readings that a recorder may have marked as missing."""

RATE = re.compile(
    r"f_?s|sr|s?rate|(sampl?\w*[ _-]?)(rate|freq\w*)|samplerate|abtast(rate|frequenz)|fréquence d'échantillonnage",
    re.IGNORECASE,
)
STEP = re.compile(
    r"t_?s|t_?interval|(sampl\w*[ _]?)(interval|period|time)|abtastintervall|delta[ _]?[xt]?|"
    r"[xt][ _]?(inc|increment|delta|step)|clock|"
    r"wf_increment|increment|time[ _]?step|dx|dt",
    re.IGNORECASE,
)
UNIT = re.compile(r"unit_?string|(ni_?)?unit_?description|units?|einheit(en)?|quantity", re.IGNORECASE)
SPEED = re.compile(r".*rpm", re.IGNORECASE)
"""Names under which files keep the sampling rate, the interval, the unit of a column, and the speed of the shaft."""

DECIMAL = r"[+-]?\d++(?:[.,]\d++)?+(?:[eE][+-]?\d++)?+"


class Named(NamedTuple):
    """Columns by name, their units, and all else that the file says; fields as in ``Recording``."""

    columns: dict[str, Array]
    units: dict[str, str]
    problems: dict[str, str]
    texts: dict[str, str]
    doubts: dict[str, str]
    rates: dict[str, float]
    speeds: dict[str, float]
    left: list[str]


def named(raw: Raw) -> Named:
    """Names, units, rates and speeds of raw columns; those of another length than most readings are left out.

    A unit beside a column (a row of units, a property) counts before one in its title. Where both are written out and
    differ, the unit is in doubt.
    """
    sizes = [len(column.values) for column in raw.columns if column.values is not None]
    size = max(set(sizes), key=lambda n: (n * sizes.count(n), n), default=0)
    left = [column.title for column in raw.columns if column.values is not None and len(column.values) != size]
    stated = short(raw.stated)
    one = Named({}, {}, {}, {}, {}, rates_of(stated), _speeds(stated), left)
    columns = [column for column in raw.columns if column.values is None or len(column.values) == size]
    for name, column in zip(_names(columns), columns, strict=True):
        if column.values is None:
            one.texts[name] = column.problem
            continue
        values = _without_end(column.values)
        if problem := column.problem or _problem(values, raw.lines):
            one.problems[name] = problem
        if not len(values):
            continue
        one.columns[name] = values
        unit, doubt = _unit(column)
        if unit:
            one.units[name] = unit
        if doubt:
            one.doubts[name] = doubt
        if rates := rates_of(column.stated):
            one.rates[name] = next(iter(rates.values()))
    return one


def rates_of(stated: Mapping[str, Any]) -> dict[str, float]:
    """Sampling rates [Hz] by the names under which they are stated."""
    rates: dict[str, float] = {}
    for key, value in stated.items():
        for name, unit in map(split_unit, (key, re.split(r"[./]", key)[-1])):
            if RATE.fullmatch(name) and (number := quantity(value, unit, RATES)):
                rates[key] = number
            elif (STEP.fullmatch(name) or (unit and name == "interval")) and (number := quantity(value, unit, TIMES)):
                rates[key] = 1.0 / number
    return rates


def quantity(value: Any, unit: str, sizes: Mapping[str, float]) -> float | None:
    """Number above 0 with its unit, in Hz or s; None if the value is none."""
    written = (
        re.fullmatch(rf"(?:Analog:)?\s*({DECIMAL})\s*(\S*)", value.strip().removesuffix("."))
        if isinstance(value, str)
        else None
    )
    if isinstance(value, str):
        if written is None:
            return None
        number, unit = float(written[1].replace(",", ".")), as_unit(written[2]) or written[2] or unit
    else:
        try:
            number = float(np.ravel(value)[0])
        except (TypeError, ValueError, IndexError):
            return None
    size = 1.0 if not unit else {key.casefold(): each for key, each in sizes.items()}.get(unit.casefold(), 0.0)
    return number * size if 1e-12 < number * size < 1e12 else None


def _names(columns: list[RawColumn]) -> list[str]:
    """Name of each column: its title without the unit where that tells columns apart, else as written."""
    plain = [_name(split_unit(column.title)[0], column) for column in columns]
    alike, used = Counter(plain), Counter[str]()
    names: dict[str, None] = {}
    for column, name in zip(columns, plain, strict=True):
        title = one = name if alike[name] == 1 else _name(column.title, column)
        while one in names:
            used[title] += 1
            one = f"{title} ({used[title] + 1})"
        names[one] = None
    return list(names)


def _name(title: str, column: RawColumn) -> str:
    return f"{column.group}/" * bool(column.group) + title + f" {column.place}" * bool(column.place)


def _unit(column: RawColumn) -> tuple[str, str]:
    """(unit of a column, why it is in doubt)."""
    within = split_unit(column.title)[1]
    beside = next((_text(value) for key, value in column.stated.items() if UNIT.fullmatch(key) and _text(value)), "")
    beside = "" if beside.upper() == "NONE" else as_unit(beside) or beside
    bracketed = within and re.search(r"[\[(/]", column.title) is not None
    if bracketed and as_unit(within) and as_unit(beside) and not same_unit(within, beside):
        return "", f"is in {within} by its title {column.title!r} and in {beside} by what stands beside it"
    return (beside if as_unit(beside) or not within else within), ""


def _text(value: Any) -> str:
    return (value[:LONGEST].decode(errors="replace") if isinstance(value, bytes) else str(value or "")).strip()


def _speeds(stated: Mapping[str, Any]) -> dict[str, float]:
    """Speeds [rpm] by the names under which they are stated."""
    speeds = {key: quantity(value, "", {}) for key, value in stated.items() if SPEED.fullmatch(key)}
    return {key: speed for key, speed in speeds.items() if speed}


def _without_end(values: Array) -> Array:
    """Readings down to the last one that is not blank."""
    if len(values) and not np.isnan(values[-1]):
        return values
    return values[: int(np.max(np.flatnonzero(~np.isnan(values)), initial=-1)) + 1]


def _problem(values: Array, lines: Sequence[int]) -> str:
    """Why readings can't be used: too many of them are no finite numbers."""
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad) <= MOST_MISSING * len(values):
        return ""
    place = f"line {lines[bad[0]]}" if len(lines) else f"reading {bad[0] + 1}"
    return f"{place}: {str(values[bad[0]])!r} is not a finite number"
