"""Units as recorders write them, and what a title of a column says: its name and its unit.

A unit is taken from brackets, a row of units or a property, never from a word of a name. But a column whose name
tells of another quantity, such as an acceleration, is never taken for a force.
"""

import re
from collections.abc import Mapping

from chaosgym.units import ALTERNATIVES, unit_as_listed

FORCES = {**ALTERNATIVES["N"], "daN": 10.0, "MN": 1e6, "kgf": 9.80665, "gf": 9.80665e-3, "ozf": 0.2780138509537812}
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}
RATES = {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6, "1/s": 1.0, "S/s": 1.0, "kS/s": 1e3, "MS/s": 1e6}
VOLTS = {"V": 1.0, "mV": 1e-3, "µV": 1e-6, "uV": 1e-6}
"""Units of force [N], of time [s], of a sampling rate [Hz] and of a voltage [V]."""

SPEEDS = ("Hz", "rpm", "1/min", "min-1", "rad/s")
"""Units of a speed."""

_OTHERS = "g mg m/s² m/s2 m/s^2 m/s mm/s in/s m mm um µm in mil Pa kPa MPa bar psi V mV µV uV A mA Nm N·m FS kg gram"
OTHERS = frozenset(_OTHERS.split())
"""Units of quantities that are judged in their own unit."""

_NEVER_JUDGED = ("deg", "°", "°C", "°F", "degC", "degF", "K", "C", "%", "-")
UNITS = frozenset({*FORCES, *TIMES, *RATES, *SPEEDS, *OTHERS, *_NEVER_JUDGED}) - {"FS"}
"""Units that a file may name."""

SIZES: Mapping[str, Mapping[str, float]] = {
    "force": FORCES,
    "time": TIMES,
    "acceleration": {"g": 9.80665, "mg": 9.80665e-3, "m/s²": 1.0, "m/s2": 1.0, "m/s^2": 1.0},
    "velocity": {"m/s": 1.0, "mm/s": 1e-3, "in/s": 25.4e-3},
    "displacement": {**ALTERNATIVES["m"], "µm": 1e-6},
    "pressure": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "bar": 1e5, "psi": 6894.757293168},
    "voltage": VOLTS,
    "current": {"A": 1.0, "mA": 1e-3},
    "moment": {"Nm": 1.0, "N·m": 1.0},
    "mass": {"kg": 1.0, "gram": 1e-3},
}
"""By quantity: its units, and the size of each."""

_OTHER_DIMENSIONS = {
    "frequency": {*RATES, *SPEEDS},
    "angle": {"deg", "°"},
    "temperature": {"°C", "°F", "degC", "degF", "K", "C"},
}
DIMENSIONS = {unit: each for table in (SIZES, _OTHER_DIMENSIONS) for each, units in table.items() for unit in units}
"""What each unit measures."""

UNKNOWN = "units"
"""Stands for the unit of readings that are no forces by their title, where the file states none."""

SAME_LETTERS = {"g": {"gram", "gf"}, "gram": {"gf", "kgf"}, "kg": {"gf", "kgf"}}
"""Units that may be stated of a file's unit of another dimension: a g may be a gram, and a scale's kg a force."""

_WORDS = {
    "s": "second sec sekunde sekunden",
    "ms": "millisecond milliseconds millis msec",
    "us": "microsecond micros usec µsec",
    "ns": "nanosecond nanos nsec",
    "min": "minute",
    "h": "hour hr",
    "N": "newton",
    "kN": "kilonewton",
    "mN": "millinewton",
    "MN": "meganewton",
    "daN": "decanewton",
    "lbf": "pound lb pound-force pounds-force",
    "kgf": "kilogram-force kilopond kp",
    "gf": "gram-force",
    "ozf": "ounce-force",
    "m/s²": "ms2 mps2 m/s/s",
    "mm/s": "mm_s mmps",
    "kg": "kilogram",
    "gram": "gramme",
    "V": "volt",
    "mV": "millivolt",
    "µV": "microvolt",
    "A": "ampere amp",
    "mA": "milliampere milliamp",
    "Pa": "pascal",
    "kPa": "kilopascal",
    "MPa": "megapascal",
    "Hz": "hertz",
    "kHz": "kilohertz",
    "m": "metre meter",
    "mm": "millimetre millimeter",
    "µm": "micrometre micrometer micron",
    "in": "inch inches",
    "deg": "degree",
    "°C": "celsius",
}
WORDS = {word: unit for unit, words in _WORDS.items() for word in words.split()}
WORDS |= {unit.casefold(): unit for unit in ("Hz", "kHz", "rpm", "lbf", "kgf", "daN", "psi", "bar", "degC", "gram")}
"""Units by how they are written out, in small letters and the singular. A pound is one of force."""

_SUFFIXES = "N kN mN daN lbf kgf gf s ms us ns rpm Hz kHz mV mm um"
SUFFIXES = frozenset(_SUFFIXES.split())
"""Units that may end a name after an underscore or "in": single letters such as A and V number channels as well."""

_NO_FORCES = {
    "acceleration": r"(lin|user|raw|tot)?acc([xyz]|el\w*)?|accél\w*|\w*beschleunigung\w*|beschl\w*",
    "velocity": r"vel|velocity|velocities|geschwindigkeit",
    "displacement": r"disp|displacement|weg|auslenkung",
    "vibration": r"vib|vibration\w*",
    "pressure": r"pressure|druck",
    "moment": r"torque|drehmoment",
}
NO_FORCES = {other: re.compile(words, re.IGNORECASE) for other, words in _NO_FORCES.items()}
FORCE = re.compile(r"\w*(force|kraft|kräfte)\w*", re.IGNORECASE)
"""Words in the name of a column of another quantity, which count unless those of a force stand beside."""

CLOCK = re.compile(r"(?-i:t)|time\w*|\w*time|zeit\w*|\w*zeit|temps|\w*stamp|date\w*|datum|clock|elapsed", re.IGNORECASE)
"""Words in the name of a column of instants."""


def as_unit(text: str) -> str:
    """Unit that a word means, with or without brackets; empty if it is none."""
    word = text.strip().strip("[]()").strip().replace("\u03bc", "µ")
    if word in UNITS:
        return word
    if word == "KN":
        return "kN"
    plain = word.casefold()
    return WORDS.get(plain) or WORDS.get(plain.removesuffix("s"), "")


def other_quantity(name: str) -> str:
    """Quantity that a name tells of and that is no force, such as "acceleration" or "pressure"; empty if it tells none.

    Examples
    --------
    >>> from chaosgym.recordings.quantities import other_quantity
    >>> other_quantity("accX"), other_quantity("Beschleunigung 1"), other_quantity("force at the accelerometer")
    ('acceleration', 'acceleration', '')
    """
    words = re.split(r"[\W_\d]+", name)
    if any(map(FORCE.fullmatch, words)):
        return ""
    return next((other for other, told in NO_FORCES.items() if any(map(told.fullmatch, words))), "")


def split_unit(title: str) -> tuple[str, str]:
    """Name and unit of a title: ``Kraft [N]``, ``F (kN)``, ``force / N``, ``peak_N``, ``force in N``, ``millis``.

    Examples
    --------
    >>> from chaosgym.recordings.quantities import split_unit
    >>> split_unit("Force / kN"), split_unit("time_ms"), split_unit("Channel A")
    (('Force', 'kN'), ('time', 'ms'), ('Channel A', ''))
    """
    text = title.strip()
    name, within = _bracketed(text)
    if within is not None and (as_unit(within) or "[" in text):
        return name.strip() or text, as_unit(within) or within
    name, word = _parted(text, "/", "/")
    if as_unit(word):
        return name.strip(), as_unit(word)
    name, word = _parted(text, "in", "_")
    unit = as_unit(word)
    allowed = unit in SUFFIXES if word in UNITS else len(word) > 2 or unit in RATES
    if unit and (allowed or (unit == "min" and CLOCK.fullmatch(name))):
        return name.strip(), unit
    if text.endswith(("_g", " g")) and other_quantity(text) == "acceleration":
        return re.sub(r"[ _]+(in[ _]+)?g$", "", text), "g"
    unit = as_unit(text)
    return text, unit if unit in TIMES and len(text) > 1 and text.casefold() != "min" else ""


def _bracketed(text: str) -> tuple[str, str | None]:
    """What stands before brackets that end a text, without blanks and _, and what they hold; None without brackets.

    The search runs once over the text: a pattern with two parts of any length takes the square of it.
    """
    if not text.endswith(("]", ")")):
        return text, None
    start = max(text.rfind("]", 0, -1), text.rfind(")", 0, -1)) + 1
    opening = min((place for place in (text.find("[", start), text.find("(", start)) if place >= 0), default=-1)
    if opening < 0:
        return text, None
    last = next(
        (place for place in range(opening - 1, -1, -1) if not (text[place].isspace() or text[place] == "_")), -1
    )
    return text[: last + 1], text[opening + 1 : -1].strip()


def _parted(text: str, apart: str, mark: str) -> tuple[str, str]:
    """A name and the last word of a text, behind a separator: ``F / N`` or ``F/N``; empty words if there is none."""
    words = text.rsplit(maxsplit=1)
    before, last = (words[0], words[1]) if len(words) == 2 else ("", text)
    name = before.removesuffix(apart)
    if name != before and name.strip() and (apart == mark or name[-1].isspace()):
        return name.rstrip(), last
    start = len(text) - len(last)
    place = text.find(mark, max(start, 1))
    return (text[:place], text[place + 1 :]) if 0 < place < len(text) - 1 else ("", "")


def same_unit(one: str, other: str) -> bool:
    """Whether two spellings are of one unit."""
    return unit_as_listed(as_unit(one) or one) == unit_as_listed(as_unit(other) or other)
