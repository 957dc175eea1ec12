"""Names, units and sampling interval of a recorder's columns, from the lines above its data.

The row of names is the nearest one above the data that is neither a row of units, nor of types, nor of settings. A unit
is taken from brackets, a row of units, or after a key that says so, never from a word of a name.
"""

import re
from itertools import pairwise
from typing import NamedTuple

_WRITTEN = """
N kN mN MN daN lbf kgf ozf s ms us µs μs ns min h rpm 1/min min-1 Hz kHz 1/s V mV µV uV g m/s² m/s2 m/s^2 m mm um µm μm
in mil rad/s m/s mm/s in/s Pa kPa MPa bar psi A mA Nm N·m deg ° rad °C K % -
"""
UNITS = frozenset(_WRITTEN.split())
"""Units that a heading may name."""

WORDS = {
    "second": "s",
    "sec": "s",
    "sekunden": "s",
    "millisecond": "ms",
    "microsecond": "us",
    "volt": "V",
    "millivolt": "mV",
    "newton": "N",
    "kilonewton": "kN",
    "ampere": "A",
    "amp": "A",
    "pascal": "Pa",
    "hertz": "Hz",
}
"""Units written as words, in the singular."""

UNDERSCORED = frozenset(
    {"N", "kN", "mN", "daN", "lbf", "kgf", "s", "ms", "us", "min", "rpm", "Hz", "kHz", "mV", "mm", "um"}
)
"""Units that may end a name after an underscore or "in": single letters such as A and V number channels as well."""

TYPES = frozenset(
    {"real", "float", "double", "integer", "int", "text", "string", "sequence", "number", "value", "values"}
)
"""Words of a row that tells types."""

SETTING = re.compile(
    r"(model|serial|firmware|software|version|record[ _]length|sampl\w*[ _]|vertical[ _]|horizontal[ _]|probe|trigger|"
    r"waveform|point[ _]f|labels|number[ _]of|analog|digital)",
    re.IGNORECASE,
)
"""Beginnings of keys of an oscilloscope's settings, which are no names of columns."""

DECIMAL = r"[+-]?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?"
RATE = re.compile(r"(sampl\w*[ _]?(rate|freq\w*)|samplerate|abtast(rate|frequenz)|fs)", re.IGNORECASE)
STEP = re.compile(
    r"(sampl\w*[ _]?(interval|period|time)|abtastintervall|delta[ _]?[xt]|[xt][ _]?(increment|delta|step)|increment|"
    r"time[ _]?step|dx|dt)",
    re.IGNORECASE,
)
OF_COLUMN = re.compile(r"(vertical[ _]units?|y[ _]unit(s|[ _]label)?|units?|einheit(en)?)", re.IGNORECASE)
"""Keys of a sampling rate, of a sampling interval, and of the columns' units."""

SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}
HERTZ = {"": 1.0, "hz": 1.0, "khz": 1e3, "mhz": 1e6, "s/s": 1.0, "ks/s": 1e3, "1/s": 1.0}


class Heading(NamedTuple):
    """Names of the columns, empty if there are none; unit by name; sampling rate [Hz] if a key tells it."""

    names: list[str]
    units: dict[str, str]
    rate_hz: float | None


def as_unit(text: str) -> str:
    """Unit that a word means: one of ``UNITS``, with or without brackets; empty if it is none."""
    word = text.strip().strip("[]()").strip()
    if word in UNITS:
        return word
    return WORDS.get(word.casefold().removesuffix("s"), "")


def split_unit(title: str) -> tuple[str, str]:
    """Name and unit of a title: ``Kraft [N]``, ``F (kN)``, ``force / N``, ``peak_N``, ``force in N``."""
    text = title.strip()
    if found := re.fullmatch(r"(.*?)[\s_]*[\[(]\s*([^\])]*?)\s*[\])]", text):
        unit = as_unit(found[2])
        if unit or "[" in text:
            return found[1].strip() or text, unit or found[2]
    if (found := re.fullmatch(r"(.+?)\s*/\s*(\S+)", text)) and found[2] in UNITS:
        return found[1].strip(), found[2]
    if (found := re.fullmatch(r"(.+?)(?:_|\s+in\s+)(\S+)", text)) and found[2] in UNDERSCORED:
        return found[1].strip(), found[2]
    return text, ""


def read_heading(rows: list[list[str]], width: int, used: int) -> Heading:
    """What the lines above the data tell of them.

    Parameters
    ----------
    rows
        Their words, line by line, the last one nearest to the data.
    width
        Columns of the data.
    used
        Columns up to the last one that holds anything.
    """
    below: list[str] = [""] * width
    written: list[str] | None = None
    for row in reversed(rows):
        words = [*row[:width], *[""] * (width - len(row))]
        told = [word for word in words if word]
        fits = used <= len(row) and bool(told) and (width == 1 or len(row) > 1)
        if (
            not fits
            or all(map(_is_setting, told))
            or SETTING.match(words[0])
            or (width > 1 and _is_number(words[used - 1]))
        ):
            continue
        if len(told) > 1 and (len(set(told)) == 1 and told[0].casefold() in TYPES):
            continue
        if not any(below) and all(as_unit(word) or word.casefold() in TYPES or _is_number(word) for word in told):
            below = [as_unit(word) for word in words]
            continue
        if OF_COLUMN.fullmatch(words[0]) and width > 1:
            below = below if any(below) else ["", *[as_unit(word) for word in words[1:]]]
            continue
        written = words
        break
    rate = _rate(rows)
    if written is None:
        keyed = [as_unit(row[1].split(":")[-1]) for row in rows if len(row) > 1 and OF_COLUMN.fullmatch(row[0])]
        names = [f"column {place + 1}" for place in range(width)]
        return Heading([], _named(names, below if any(below) else [*[""] * (used - 1), *keyed[:1]]), rate)
    split = [split_unit(word or f"column {place + 1}") for place, word in enumerate(written)]
    names = [name for name, _ in split]
    if len(set(names)) != len(names):
        names = [word or f"column {place + 1}" for place, word in enumerate(written)]
    labels = next((row[1:] for row in reversed(rows) if row and OF_COLUMN.fullmatch(row[0])), [])
    if not any(below) and len(labels) >= used - 1 > 0:
        below = ["", *[as_unit(word) for word in labels]]
    return Heading(names, _named(names, [unit or low for (_, unit), low in _paired(split, below)]), rate)


def _paired(split: list[tuple[str, str]], below: list[str]) -> list[tuple[tuple[str, str], str]]:
    return list(zip(split, [*below, *[""] * len(split)], strict=False))


def _named(names: list[str], units: list[str]) -> dict[str, str]:
    return {name: unit for name, unit in zip(names, units, strict=False) if unit}


def _is_number(word: str) -> bool:
    return re.fullmatch(DECIMAL, word) is not None


def _is_setting(word: str) -> bool:
    """Whether a word is a key with its value: ``Sample rate: 2000 Hz``, ``dx=0.0005 s``."""
    _, mark, value = word.replace("=", ":").partition(":")
    return bool(mark) and bool(re.match(r"\s*[\d\"]", value)) and not as_unit(value)


def _rate(rows: list[list[str]]) -> float | None:
    """Sampling rate [Hz] by the first key with a number behind it, or below it."""
    for row, following in pairwise([*rows, []]):
        for place, word in enumerate(row):
            key, _, value = word.replace("=", ":").partition(":")
            behind = value.strip() or (row[place + 1] if place + 1 < len(row) else "")
            lower = following[place] if place < len(following) else ""
            for pattern, scales in ((RATE, HERTZ), (STEP, SECONDS)):
                unit = split_unit(key)[1]
                if pattern.fullmatch(split_unit(key)[0].strip()):
                    number = _quantity(behind, unit, scales) or _quantity(lower, unit, scales)
                    if number:
                        return number if pattern is RATE else 1.0 / number
    return None


def _quantity(text: str, unit: str, scales: dict[str, float]) -> float | None:
    """Number above 0 with its unit, in SI; None if the text is none."""
    found = re.fullmatch(rf"(?:Analog:)?\s*({DECIMAL})\s*(\S*)", text.strip())
    scale = found and scales.get((found[2] or unit).casefold())
    if not found or not scale:
        return None
    value = float(found[1].replace(",", ".")) * scale
    return value if 1e-12 < value < 1e12 else None
