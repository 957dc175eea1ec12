"""How a text is written: its delimiter, which columns hold numbers, and the titles, units and numbers above these.

The row of titles is the nearest one above the data that is neither a row of units, nor of types, nor of settings.
"""

import io
import re
from collections import Counter
from itertools import pairwise
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.csv

from chaosgym.errors import DiagnosisError, NoRecordingError
from chaosgym.recordings.lines import FIRST, Line, decimal_comma, is_entry, is_missing, is_number
from chaosgym.recordings.naming import DECIMAL, RATE, STEP
from chaosgym.recordings.quantities import as_unit, split_unit
from chaosgym.recordings.raw import LONGEST, check_columns, cut

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

HEADING = 2000
"""Lines among which a heading ends."""

COMMENT = re.compile(r"\s*(#|%|//|\")")
QUOTED = re.compile(r'\s*"[^"]*"\s*($|[,;\t|])')
"""A line whose first entry is in quotes."""

TORN = re.compile(r'\s*"\s*[+-]?[\d.,]')
"""A line that begins with a quote and a number."""


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
            name, unit = split_unit(key)
            if RATE.fullmatch(name.strip()) or STEP.fullmatch(name.strip()) or (unit and name == "interval"):
                behind = value.strip() or (row[place + 1] if place + 1 < len(row) else "")
                lower = following[place] if place < len(following) else ""
                number = next((text for text in (behind, lower) if re.match(r"(?:Analog:)?\s*[\d.]", text)), None)
                if number is not None:
                    stated.setdefault(key.strip(), number)
    return stated


class Layout(NamedTuple):
    """How a text is written: between its columns, what stands above them, and which columns hold numbers.

    Lines that are ``indented`` have nothing in their first column.
    """

    delimiter: str
    width: int
    steady: list[bool]
    indented: bool
    titles: list[str]
    heading: Heading
    above: frozenset[str]
    comma: bool

    @property
    def mark(self) -> str:
        """What is between the columns once blanks are replaced."""
        return "\t" if self.delimiter == " " else self.delimiter

    def is_data(self, line: str) -> bool:
        """Whether a line has a number, or a mark for a missing one, in each column that has them."""
        words = _words(line, self.mark)
        if self.indented and words[0]:
            return False
        entries = [words[c] for c, held in enumerate(self.steady) if held and c < len(words)]
        told = [is_entry(word) or not word or is_missing(word) for word in entries]
        return any(map(is_entry, entries)) and all(told)


def layout_of(written: list[Line], kept: list[Line], last: list[str], delimiter: str) -> tuple[Layout, int]:
    """How a text is written, by its first and last lines, and at which of those that are kept the data begin."""
    mark = "\t" if delimiter == " " else delimiter
    width = Counter(line.count(mark) + 1 for line in last).most_common(1)[0][0]
    check_columns(width)
    tail = [words for words in (_words(line, mark) for line in last) if len(words) == width]
    steady = [sum(map(is_entry, (words[c] for words in tail))) > 0.5 * len(tail) for c in range(width)]
    indented = width > 1 and not any(words[0] for words in tail)
    layout = Layout(delimiter, width, steady, indented, [], Heading([], [], {}), frozenset(), False)

    def begins(line: str) -> bool:
        words = _words(line, mark)
        return len(words) == width and any(map(is_entry, words)) and (not any(steady) or layout.is_data(line))

    start = next((place for place, (_, line) in enumerate(kept[:HEADING]) if begins(line)), None)
    if start is None:
        raise NoRecordingError("holds no numbers")
    above = frozenset(line for _, line in kept[:start])
    body = [(number, line) for number, line in kept[start : start + 2 * FIRST] if line not in above][:FIRST]
    over = [(number, line) for number, line in written if number < body[0][0]]
    heading = _heading(over, body, width, None if delimiter == " " else mark)
    titles = [cut(title) for title in heading.titles] or [f"column {place + 1}" for place in range(width)]
    if len(set(titles)) != len(titles):
        raise DiagnosisError(f"names two columns alike: {cut(', '.join(titles))}")
    first = table_of([(0, line) for _, line in body if line.count(mark) < width], titles, mark)
    comma = delimiter != "," and decimal_comma([entry for column in first.columns for entry in column.to_pylist()])
    return layout._replace(titles=titles, heading=heading, above=above, comma=comma), start


def _heading(above: list[tuple[int, str]], body: list[tuple[int, str]], width: int, mark: str | None) -> Heading:
    """What the lines above the data, or an oscilloscope's settings beside its first readings, tell of the columns."""
    told = [line.lstrip("#%/ ") if COMMENT.match(line) and not QUOTED.match(line) else line for _, line in above]
    rows = [_words("\t".join(line.split()) if mark is None else line, mark or "\t") for line in told if line.strip()]
    first = [_words(line, mark or "\t") for _, line in body[:50]]
    used = max((place + 1 for words in first for place, word in enumerate(words) if word), default=1)
    beside = [words for words in first if len(words) >= used > 1 and re.match("[A-Za-z]", words[0])]
    return read_heading(rows or [words for words in beside if is_number(words[used - 1])], width, used)


def _words(line: str, mark: str) -> list[str]:
    return [word[:LONGEST].strip(' "') for word in line.split(mark)]


def delimiter_of(first: str, tail: list[str]) -> str:
    """Delimiter of the last lines below a first one; "," stands for none if there is one column."""
    unquoted = [re.sub('"[^"]*"', "", line) for line in tail]
    numbers = {
        mark: sum(is_entry(word) for line in tail for word in _words(line, mark))
        for mark in ("\t", ";", "|")
        if sum(mark in line for line in unquoted) > 0.5 * len(tail)
    }
    if numbers:
        return max(numbers, key=lambda mark: numbers[mark])
    words = [line.split() for line in tail]
    spaced = sum(len(row) > 1 and all(map(is_number, row)) for row in words) > 0.5 * len(tail)
    if spaced and not any(word.endswith(",") for row in words for word in row):
        return " "
    single = [row for row in (line.strip().split(",") for line in tail) if is_number(row[0])]
    decimal = all(
        len(row) == 2 and re.fullmatch(r"[+-]?\d+", row[0]) and re.fullmatch(r"\d+", row[1]) for row in single
    )
    if single and decimal and not _two_columns(first, single):
        return ";"
    return ","


def _two_columns(heading: str, rows: list[list[str]]) -> bool:
    """Whether ``48,9`` is two whole numbers: the heading says so, or the first one counts."""
    if not is_number(heading.split(",")[0]):
        return "," in heading
    steps = {int(after[0]) - int(before[0]) for before, after in pairwise(rows)}
    return steps == {1} or len(rows) < 2


def table_of(body: list[Line], titles: list[str], mark: str) -> Any:
    """Columns of text; rows that end early are filled up with blanks, and quotes that are not closed are left out."""
    if any(line.count('"') % 2 for _, line in body):
        body = [(number, line.replace('"', "")) for number, line in body]
    width = len(titles)
    padded = []
    for number, line in body:
        columns = line.count(mark) + 1
        if columns > width and '"' not in line and line.rstrip(mark + " ").count(mark) >= width:
            raise DiagnosisError(f"line {number} has {columns} columns; allowed: {width}")
        short = line if columns <= width or '"' in line else line.rstrip(" ")[: -(columns - width)]
        padded.append(short + mark * max(0, width - columns))
    return pyarrow.csv.read_csv(
        io.BytesIO("\n".join(padded).encode()),
        read_options=pyarrow.csv.ReadOptions(column_names=titles),
        parse_options=pyarrow.csv.ParseOptions(delimiter=mark, ignore_empty_lines=False),
        convert_options=pyarrow.csv.ConvertOptions(
            column_types=dict.fromkeys(titles, pa.string()), strings_can_be_null=False
        ),
    )
