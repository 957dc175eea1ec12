"""Quantities as texts of a number and a unit, such as ``0.127 mm``. A bare number is refused: its unit is ambiguous.

Each unit of a field has its alternatives and what one of them is in the field's own unit. A frequency of a cycle and a
rotation differ by 60, never by 2 pi. Units that are not listed are written as the field states them. µ is u, and
N·m, N*m, Nm and N m are one, as are m², m2 and m^2.
"""

import math
import re
from collections.abc import Iterable, Mapping
from typing import Any

from chaosgym.errors import ParameterError
from chaosgym.numbers import shown

ALTERNATIVES: Mapping[str, Mapping[str, float]] = {
    "m": {"m": 1.0, "mm": 1e-3, "um": 1e-6, "in": 25.4e-3, "mil": 25.4e-6, "thou": 25.4e-6},
    "Hz": {"Hz": 1.0, "kHz": 1e3, "rpm": 1.0 / 60.0},
    "rpm": {"rpm": 1.0, "Hz": 60.0},
    "N": {"N": 1.0, "kN": 1e3, "mN": 1e-3, "lbf": 4.4482216152605},
    "Pa": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "ksi": 6894757.293168},
    "kg": {"kg": 1.0, "g": 1e-3},
    "N/m": {"N/m": 1.0, "kN/m": 1e3, "N/mm": 1e3, "kN/mm": 1e6, "N/um": 1e6},
    "N s/m": {"N s/m": 1.0, "N s/mm": 1e3},
    "m/N": {"m/N": 1.0, "mm/N": 1e-3, "um/N": 1e-6},
    "kg m": {"kg m": 1.0, "kg mm": 1e-3, "g mm": 1e-6},
    "m/s": {"m/s": 1.0, "mm/s": 1e-3},
    "rad/s": {"rad/s": 1.0, "deg/s": math.pi / 180.0},
    "m/s^2": {"m/s^2": 1.0, "g": 9.80665},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
    "Mcycles": {"Mcycles": 1.0, "cycles": 1e-6},
    "deg": {"deg": 1.0},
    "-": {"": 1.0, "%": 1e-2},
    "rad": {
        "rad": 1.0,
        "mrad": 1e-3,
        "deg": math.pi / 180.0,
        "arcmin": math.pi / 10_800.0,
        "arcsec": math.pi / 648_000.0,
    },
    "N m": {
        "N m": 1.0,
        "kN m": 1e3,
        "mN m": 1e-3,
        "N mm": 1e-3,
        "N cm": 1e-2,
        "lbf ft": 1.3558179483314,
        "lbf in": 0.1129848290276,
    },
    "N m/rad": {
        "N m/rad": 1.0,
        "kN m/rad": 1e3,
        "MN m/rad": 1e6,
        "N mm/rad": 1e-3,
        "N m/deg": 180.0 / math.pi,
        "N m/arcmin": 10_800.0 / math.pi,
    },
    "N m s/rad": {"N m s/rad": 1.0, "mN m s/rad": 1e-3, "N mm s/rad": 1e-3, "N m s/deg": 180.0 / math.pi},
    "N m/rad^1.5": {"N m/rad^1.5": 1.0},
    "s/rad": {"s/rad": 1.0},
    "rad/(N m)": {"rad/(N m)": 1.0, "deg/(N m)": math.pi / 180.0, "arcmin/(N m)": math.pi / 10_800.0},
    "kg m^2": {"kg m^2": 1.0, "kg cm^2": 1e-4, "kg mm^2": 1e-6, "g cm^2": 1e-7, "g mm^2": 1e-9, "t m^2": 1e3},
    "rad/s^2": {"rad/s^2": 1.0, "deg/s^2": math.pi / 180.0},
    "kg^-1/2 m^-1": {"kg^-1/2 m^-1": 1.0},
    "kg^-1/2 m^-2": {"kg^-1/2 m^-2": 1.0},
    "kg^1/2 m": {"kg^1/2 m": 1.0},
}
"""By unit of a field: the units that are understood, and their size."""

TURNING: Mapping[str, str] = {
    "m": "rad",
    "N": "N m",
    "N/m": "N m/rad",
    "N s/m": "N m s/rad",
    "m/N": "rad/(N m)",
    "kg": "kg m^2",
    "kg m": "kg m^2",
    "m/s": "rad/s",
    "m/s^2": "rad/s^2",
    "N/m^1.5": "N m/rad^1.5",
    "s/m": "s/rad",
    "kg^-1/2": "kg^-1/2 m^-1",
    "kg^1/2": "kg^1/2 m",
}
"""By unit of what slides: the unit of the same quantity of what turns."""


def units_of(unit: str) -> Mapping[str, float]:
    """Units in which a field of the given unit may be written."""
    return ALTERNATIVES.get(unit, {unit: 1.0})


def parse_quantity(name: str, given: Any, unit: str, allowed: Mapping[str, float] | None = None) -> float:
    """Value in the field's own unit.

    Parameters
    ----------
    name
        Of the field, for the message.
    given
        A text such as ``"30 Hz"``; a bare number only where the field has no unit.
    unit
        Of the field.
    allowed
        Units that are understood here, and their size; those of the field's unit if None.

    Raises
    ------
    ParameterError
        If the unit is missing or unknown, or the number is none; says what is allowed.
    """
    allowed = allowed or units_of(unit)
    listed = ", ".join(each or "no unit" for each in allowed)
    if isinstance(given, bool) or not isinstance(given, int | float | str):
        raise ParameterError(f"{name} = {shown(given)} is not a quantity; allowed: a number with a unit ({listed})")
    if not isinstance(given, str):
        if unit != "-":
            best, least = next(iter(allowed)), shown(given)
            raise ParameterError(f'{name} = {least} has no unit; write {name} = "{least} {best}" (allowed: {listed})')
        return _finite(name, given, given, 1.0)
    number, written = _split(given)
    try:
        as_float(number)
    except ValueError:
        what = (
            "is several numbers; allowed: one, which holds at all times"
            if "," in given
            else "does not begin with a number"
        )
        raise ParameterError(f"{name} = {shown(given)} {what}") from None
    if written not in allowed:
        what = f"has the unknown unit {shown(written)}" if written else "has no unit"
        meant = [each for each in allowed if each and each.lower() == written.lower()]
        hint = f"; did you mean {' or '.join(meant)}?" if meant else ""
        raise ParameterError(f"{name} = {shown(given)} {what}{hint} (allowed: {listed})")
    return _finite(name, given, number, allowed[written])


def _finite(name: str, given: Any, number: Any, size: float) -> float:
    try:
        value = (as_float(number) if isinstance(number, str) else float(number)) * size
    except OverflowError:
        value = math.inf
    if not math.isfinite(value):
        raise ParameterError(f"{name} = {shown(given)} is no finite number that a computer holds")
    return value


def as_float(text: str) -> float:
    """Number of a text; none with ``_`` in it, which Python takes for a separator: ``0_1`` is a slip for ``0.1``.

    Raises
    ------
    ValueError
        If it is none.
    """
    if "_" in text or not text.isascii():
        raise ValueError(f"{text!r} is no number")
    return float(text)


def check_share(name: str, given: Any, values: Iterable[float]) -> None:
    """Refuse bare numbers above 1 for what is usually written in %: the sign was probably forgotten.

    Raises
    ------
    ParameterError
        If there is one; says how to write it.
    """
    texts = given if isinstance(given, list) else [given]
    if max(values, default=0.0) > 1.0 and not all(isinstance(text, str) and "%" in text for text in texts):
        raise ParameterError(
            f'{name} = {shown(given)} is above 1 and has no unit; write it in %, as in {name} = "4 %" for 0.04'
        )


_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_ROW = re.compile(rf"\s*({_NUMBER}(?:(?:\s*[,;]\s*|\s+to\s+|\s+){_NUMBER})*)\s*(.*)", re.DOTALL)


def parse_row(name: str, given: Any, unit: str) -> list[float]:
    """Values in the field's own unit: of a text such as ``"9.1, 61 Hz"`` or ``"4 to 30 Hz"``, or of a list of texts.

    Raises
    ------
    ParameterError
        As ``parse_quantity``, and if anything but numbers stands before the unit.
    """
    if isinstance(given, list):
        if not given or any(isinstance(one, list) for one in given):
            raise ParameterError(f"{name} = {shown(given)} is no row; allowed: one number or more")
        return [value for one in given for value in parse_row(name, one, unit)]
    if not isinstance(given, str):
        return [parse_quantity(name, given, unit)]
    text = given.strip()
    # a unit that begins with a digit, 1/s, is no number of the row
    written = max((each for each in units_of(unit) if each and text.endswith(f" {each}")), key=len, default="")
    found = _ROW.fullmatch(text.removesuffix(written))
    if found is None:
        return [parse_quantity(name, given, unit)]
    if written and found[2]:
        raise ParameterError(
            f"{name} = {shown(given)} has {shown(found[2].strip())} after its first numbers; allowed: numbers, then "
            f"one unit, such as '1, 2 {written}'"
        )
    return [parse_quantity(name, f"{number} {written or found[2]}", unit) for number in re.findall(_NUMBER, found[1])]


def parse_option(name: str, text: str, unit: str, bare: str) -> float:
    """Value in the field's own unit, where a number without a unit is in the unit ``bare``.

    Raises
    ------
    ParameterError
        If the unit is unknown, or the number is none; says what is allowed.
    """
    try:
        value, written = as_float(text), ""
    except ValueError:
        number, written = _split(text)
        try:
            value = as_float(number)
        except ValueError:
            listed = ", ".join(filter(None, units_of(unit)))
            told = f", nor one with a unit ({listed})" if listed else ""
            raise ParameterError(f"{name}: {text!r} is no number{told}") from None
    return parse_quantity(name, f"{value!r} {written or bare}", unit) if written or bare else value


def duration(seconds: float, digits: int = 4) -> str:
    """A time for people, in the unit that needs no exponent: ``50 ms``, ``2 min``, ``13.89 h``.

    Examples
    --------
    >>> from chaosgym.units import duration
    >>> duration(0.05), duration(50_000.0), duration(3e-7), duration(112.0, 2)
    ('50 ms', '13.89 h', '300 ns', '110 s')
    """
    sizes = {"h": 7200.0, "min": 120.0, "s": 1.0, "ms": 1e-3, "µs": 1e-6, "ns": 0.0}
    unit = next((name for name, least in sizes.items() if seconds >= least * (1.0 - 1e-9)), "ns")
    size = {"h": 3600.0, "min": 60.0, "s": 1.0, "ms": 1e-3, "µs": 1e-6, "ns": 1e-9}[unit]
    return f"{float(f'{seconds / size:.{digits}g}'):g} {unit}"


LOOKS_SCALED = (100.0, 10_000.0)
"""Multiples of a machine's usual length between which a bare number in metres was probably meant in millimetres."""


def looks_like_millimetres(value: float, usual: float) -> bool:
    """Whether a length [m] is about a thousand times the usual one."""
    return usual != 0.0 and LOOKS_SCALED[0] < abs(value / usual) < LOOKS_SCALED[1]


_SPELLINGS = {"\u00b5": "u", "\u03bc": "u", "\u00b7": " ", "*": " ", "\u00b2": "^2", "m2": "m^2", "Nm": "N m"}


def unit_as_listed(written: str) -> str:
    """A unit in the spelling of ``ALTERNATIVES``."""
    for spelling, listed in _SPELLINGS.items():
        written = written.replace(spelling, listed)
    return " ".join(written.split())


def turns(given: Any, unit: str) -> bool | None:
    """Whether a quantity, or the first of a row, is of something that turns; None if its unit leaves that open.

    Parameters
    ----------
    given
        As for ``parse_quantity`` or ``parse_row``.
    unit
        Of a field of something that slides.
    """
    while isinstance(given, list) and given:
        given = given[0]
    if not isinstance(given, str) or unit not in TURNING:
        return None
    found = _ROW.fullmatch(given.strip())
    written = unit_as_listed(found[2]) if found else ""
    return True if written in units_of(TURNING[unit]) else False if written in units_of(unit) else None


def _split(text: str) -> tuple[str, str]:
    """Number and unit: ``30 Hz`` and ``2%``."""
    words = text.strip().split(maxsplit=1)
    if len(words) == 2:
        return words[0], unit_as_listed(words[1])
    word = words[0] if words else ""
    end = len(word)
    while end and not (word[end - 1].isdigit() or word[end - 1] == "."):
        end -= 1
    return word[:end], unit_as_listed(word[end:])
