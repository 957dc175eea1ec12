"""Titles, units and numbers that stand above a recorder's columns, as written.

The row of titles is the nearest one above the data that is neither a row of units, nor of types, nor of settings.
"""

import re
from itertools import pairwise
from typing import Any, NamedTuple

from chaosgym.recordings.naming import DECIMAL, RATE, STEP
from chaosgym.recordings.quantities import as_unit, split_unit

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

OF_COLUMN = re.compile(r"(vertical[ _]units?|y[ _]unit(s|[ _]label)?|units?|einheit(en)?)", re.IGNORECASE)
"""Keys of the columns' units."""


class Heading(NamedTuple):
    """Titles of the columns, empty if there are none; the unit beside each; keys of a rate or interval and values."""

    titles: list[str]
    units: list[str]
    stated: dict[str, Any]


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
    titles: list[str] = []
    fitting = [row for row in reversed(rows) if _fits(row, width, used)]
    for place, row in enumerate(fitting):
        words = [*row[:width], *[""] * (width - len(row))]
        above = fitting[place + 1] if place + 1 < len(fitting) else []
        if not any(below) and _are_units(words, above[:width]):
            below = [as_unit(word) or (word if word.casefold() not in TYPES else "") for word in words]
            continue
        if OF_COLUMN.fullmatch(words[0]) and width > 1:
            below = below if any(below) else ["", *[as_unit(word) for word in words[1:]]]
            continue
        titles = [word or f"column {number}" for number, word in enumerate(words, start=1)]
        break
    if not any(below):
        below = _keyed(rows, width, used, bool(titles))
    return Heading(titles, below, _stated(rows))


def _fits(row: list[str], width: int, used: int) -> bool:
    """Whether a row may be one of titles or units: no settings, no types, no numbers."""
    words = [word for word in row[:width] if word]
    return not (
        used > len(row)
        or not words
        or (width > 1 and len(row) == 1)
        or all(map(_is_setting, words))
        or SETTING.match(row[0])
        or (width > 1 and _is_number(row[used - 1]))
        or (len(words) > 1 and len(set(words)) == 1 and words[0].casefold() in TYPES)
    )


def _are_units(row: list[str], above: list[str]) -> bool:
    """Whether a row holds units: all of its words, or two and more, below as many titles that are fewer units."""
    words = [word for word in row if word]
    if all(as_unit(word) or word.casefold() in TYPES or _is_number(word) for word in words):
        return True
    titles = [word for word in above if word]
    units = sum(bool(as_unit(word)) for word in words)
    return (
        units > max(1, sum(bool(as_unit(word)) for word in titles))
        and len(titles) >= len(words)
        and not any(_is_number(word) or _is_setting(word) for word in titles)
    )


def _keyed(rows: list[list[str]], width: int, used: int, titled: bool) -> list[str]:
    """Units behind a key such as ``Vertical Units``: one for each column but the first, or one for the last."""
    labels = [row[1:] for row in rows if row[1:] and OF_COLUMN.fullmatch(row[0])]
    if titled and labels and len(labels[-1]) >= used - 1 > 0:
        return (["", *map(as_unit, labels[-1]), *[""] * width])[:width]
    if labels and not titled:
        return ([*[""] * (used - 1), as_unit(labels[0][0].split(":")[-1]), *[""] * width])[:width]
    return [""] * width


def _is_number(word: str) -> bool:
    return re.fullmatch(DECIMAL, word) is not None


def _is_setting(word: str) -> bool:
    """Whether a word is a key with its value: ``Sample rate: 2000 Hz``, ``dx=0.0005 s``."""
    _, mark, value = word.replace("=", ":").partition(":")
    return bool(mark) and bool(re.match(r"\s*[\d\"]", value)) and not as_unit(value)


def _stated(rows: list[list[str]]) -> dict[str, Any]:
    """Keys of a sampling rate or interval with the number behind them, or below them."""
    stated: dict[str, Any] = {}
    for row, following in pairwise([*rows, []]):
        for place, word in enumerate(row):
            key, _, value = word.replace("=", ":").partition(":")
            name = split_unit(key)[0].strip()
            if RATE.fullmatch(name) or STEP.fullmatch(name):
                behind = value.strip() or (row[place + 1] if place + 1 < len(row) else "")
                lower = following[place] if place < len(following) else ""
                number = next((text for text in (behind, lower) if re.match(r"(?:Analog:)?\s*[\d.]", text)), None)
                if number is not None:
                    stated.setdefault(key.strip(), number)
    return stated
