"""Lines of a text, read block by block and arranged as rows of a table, and the numbers and instants in them."""

import codecs
import re
from collections.abc import Callable, Iterator, Sequence
from datetime import date
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from chaosgym.arrays import Array
from chaosgym.recordings.naming import MOST_MISSING
from chaosgym.recordings.quantities import as_unit
from chaosgym.recordings.raw import LONGEST, Data, TooMuch, give_back, pieces

BLOCK, LONGEST_LINE = 2**20, 2**25
"""Bytes that are looked through at a time, and letters of a line at the most."""

Line = tuple[int, str]
"""Number of a line, from 1, and its text."""


def blocks_of(data: Data, encoding: str) -> Iterator[list[Line]]:
    """Lines of a text, those of some megabytes at a time.

    Raises
    ------
    TooMuch
        If a line is too long.
    """
    decoder, rest, number = codecs.getincrementaldecoder(encoding)("replace"), "", 1
    held: list[Line] = []
    for piece in pieces(data, BLOCK):
        text = rest + decoder.decode(piece)
        whole, mark, rest = text.removeprefix("\ufeff" * (number == 1)).rpartition("\n")
        if len(rest) > LONGEST_LINE:
            raise TooMuch(f"has a line of more than {LONGEST_LINE:,} letters; write one reading a line")
        if mark:
            if held:
                yield held
            held = [(number + place, line.rstrip("\r")) for place, line in enumerate(whole.split("\n"))]
            number += len(held)
    yield [*held, (number, (rest + decoder.decode(b"", True)).rstrip("\r"))]


def last_lines(data: Data, encoding: str) -> list[str]:
    """Lines of the last megabytes of a text."""
    start = max(0, len(data) - BLOCK) // 4 * 4
    lines = data[start:].decode(encoding, "replace").split("\n")
    give_back(data)
    return [line.rstrip("\r") for line in lines[start > 0 :]]


def encoding_of(data: Data) -> str:
    """Encoding of a text."""
    first = data[:40]
    if first[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16-le" if first[:1] == b"\xff" else "utf-16-be"
    if first[1::2].count(0) > 10 and first[0] != 0:
        return "utf-16-le"
    decoder = codecs.getincrementaldecoder("utf-8-sig")()
    try:
        for piece in pieces(data, BLOCK):
            decoder.decode(piece)
        decoder.decode(b"", True)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


TAIL = 200
"""Lines at the end of a text by which its form is told."""

ARROW = " -> "
"""What serial monitors write between the time and what a microcontroller sent."""

LABELLED = re.compile(
    r"([A-Za-z_]\w{0,40}) ?[:=] ?([+-]?\d[\d.]{0,20}(?:[eE][+-]?\d{1,3})?)"
    r"(?: ?([^\W\d_][\w/²^·]{0,8})(?=[,;\s]|$)|(?![\w:]))"
)
"""A name, its number and its unit if there is one, as in ``force:1.25`` and ``F = 1.25 kN``."""

TUPLE = re.compile(r"\s*\(.*\),?\s*")
"""Numbers in parentheses, as MicroPython prints them."""

LOG = re.compile(r"[VDIWE] \((\d{1,12})\) ")
"""How the log of ESP-IDF begins: its level, and milliseconds since the start."""

FEWEST_TURNED, MOST_TURNED = 64, 7
"""Numbers of a row that is a column, and most rows of that kind: a column of fewer readings is not judged."""


class Arranged(NamedTuple):
    """How lines were written, the heading of the table that they make, and the row of a line; None for no row."""

    how: str
    heading: list[str]
    row: Callable[[str], str | None]


def arranged(tail: list[str]) -> Arranged | None:
    """How to make a table of lines, by the last of them; None where they are one already.

    Examples
    --------
    >>> how, heading, row = arranged(["t_us:0,force:1.5", "t_us:500,force:1.75"])
    >>> how, [title.split("\\t") for title in heading], row("t_us:500,force:1.75").split("\\t")
    ('labelled values', [['t_us', 'force']], ['500', '1.75'])
    """
    tail = [line for line in tail[-TAIL:] if line.strip()]
    if 2 * sum(ARROW in line for line in tail) > len(tail):
        return Arranged("stamps of a serial monitor", [], lambda line: line.replace(ARROW, "\t", 1))
    if 2 * sum(TUPLE.fullmatch(line) is not None for line in tail) > len(tail):
        return Arranged("numbers in parentheses", [], lambda line: line.strip(" ,()"))
    if not tail or re.match(r"[\s\"']*[+-]?[\d.]", tail[-1]):
        return None
    names = [name for name, _ in _labels(tail[-1])]
    if not names or len(set(names)) < len(names):
        return None
    if 2 * sum([name for name, _ in _labels(line)] == names for line in tail) <= len(tail) or len(tail) < len(names):
        return None

    def row(line: str) -> str | None:
        numbers = dict(_labels(line))
        return "\t".join(numbers.get(name, "") for name in names) if numbers else None

    return Arranged("labelled values", ["\t".join(names)], row)


def _labels(line: str) -> list[tuple[str, str]]:
    """Names and numbers of a line."""
    line = line[:LONGEST]
    log = LOG.match(line)
    found = LABELLED.findall(line, log.end() if log else 0)
    labels = [(f"{name} [{unit}]" if as_unit(unit) else name, number) for name, number, unit in found]
    return [("time [ms]", log[1]), *labels] if log else labels


def turned(lines: list[str]) -> tuple[list[str], str] | None:
    """Lines of a table, and how they were written, of a few long rows; None where there are none."""
    rows = [line.strip() for line in lines[: 2 * TAIL] if line.strip()]
    longest = max(rows, key=len, default="")
    if len(lines) > 2 * TAIL or len(longest) < 2 * FEWEST_TURNED:
        return None
    mark = max("\t;,", key=longest.count)
    words = [row.split(mark) if mark in longest else row.split() for row in rows]
    numbers = [sum(map(is_number, row)) for row in words]
    most = max(numbers)
    long = [row for row, count in zip(words, numbers, strict=True) if most >= FEWEST_TURNED and 2 * count > most]
    if not long or len(long) > MOST_TURNED:
        return None
    firsts = [next(place for place, word in enumerate(row) if is_number(word)) for row in long]
    titles = [" ".join(word.strip() for word in row[:first]) for row, first in zip(long, firsts, strict=True)]
    wide = any(2 * len(row) > most for row in words if row not in long)
    if wide or (len(long) > 1 and not all(titles)):
        return None  # a table of many columns and few readings
    columns = [row[first:] for row, first in zip(long, firsts, strict=True)]
    apart = "\t" if len(long) > 1 else ","  # a single column has no delimiter
    above = [row.replace(mark, apart) for row, one in zip(rows, words, strict=True) if one not in long]
    heading = ["\t".join(titles)] if all(titles) else []
    size = max(map(len, columns))
    filled = [[*column, *[""] * (size - len(column))] for column in columns]
    return [*above, *heading, *("\t".join(word.strip() for word in row) for row in zip(*filled, strict=True))], (
        "one long row" if len(long) == 1 else f"{len(long)} long rows"
    )


MISSING = re.compile(
    r"[+-]?1?\.?#(QNAN|SNAN|IND|INF)0*|#?N/?[AV]|#NUM!|#DIV/0!|#VALUE!|n\.?a\.?|nan|null|none|OVR|OVL|OL|OVER(LOAD|FLOW|RANGE)?|"
    r"-{1,4}|\*+|\?+",
    re.IGNORECASE,
)
"""How recorders mark a reading that they have not."""

NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?|[+-]?(nan|inf(inity)?)", re.IGNORECASE)

INSTANT = re.compile(
    r"((?P<year>\d{4})[-/](?P<month>\d\d?)[-/](?P<day>\d\d?)|(?P<a>\d\d?)[./-](?P<b>\d\d?)[./-](?P<late>\d{4}|\d\d)|"
    r"(?P<of>\d\d?)[ -](?P<word>[a-zä]{3,9})[ -](?P<in>\d{4}))?"
    r"[ T]*(?P<h>\d\d?):(?P<m>\d\d):(?P<s>\d\d([.,]\d+|[:;]\d{3}(\d{3})?)?)\s*((?P<half>[AP]M)\s*)?(Z|[+-]\d\d:?\d\d)?",
    re.IGNORECASE,
)
"""A time of the day, with or without a date, as recorders write it."""

MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
"""Beginnings of the names of months."""

GROUPED = re.compile(r"[+-]?\d{1,3}(([.\u00a0' ]\d{3})+(,\d+)|([,\u00a0' ]\d{3})+(\.\d+))")
"""A number with separators of thousands and a decimal mark."""

FIRST = 50
"""Entries of a column by which its decimal mark and its separators are told."""


def is_number(text: str) -> bool:
    """Whether a word is a number."""
    return NUMBER.fullmatch(text[:LONGEST].strip()) is not None


def is_instant(text: str) -> bool:
    """Whether a word is a time of the day, with or without a date."""
    return INSTANT.fullmatch(text.strip()) is not None


def is_entry(text: str) -> bool:
    """Whether a word is a number, with or without separators of thousands, or an instant."""
    return is_number(text) or GROUPED.fullmatch(text) is not None or is_instant(text)


def is_missing(text: str) -> bool:
    """Whether a word stands for a reading that is missing."""
    return MISSING.fullmatch(text) is not None


def decimal_comma(entries: list[str]) -> bool:
    """Whether the comma is the decimal mark; beside points it is the last one of a number."""
    points = [entry for entry in entries if GROUPED.fullmatch(entry) and entry.rfind(".") > entry.rfind(",")]
    return any("," in entry for entry in entries) and not points


class Entries:
    """Readings or instants of a column of a text, which are taken block by block.

    Parameters
    ----------
    rows
        Readings at the most.
    first
        Texts of the first rows.
    comma
        Whether the comma is the decimal mark.
    """

    def __init__(self, rows: int, first: Sequence[str], comma: bool) -> None:
        self.instants = is_instant(first[0])
        self._values, self._size, self._comma = np.empty(rows), 0, comma
        self._grouped = any(GROUPED.fullmatch(entry) for entry in first)
        self._filled = self._good = self._bad = self._blank = self._end = self._day = 0
        self._text = self._wrong = self._missing = ""

    def take(self, column: Any, lines: Sequence[int]) -> None:
        """Take the texts of a block, whose lines are these."""
        column = pc.utf8_trim_whitespace(column.combine_chunks())
        start, self._size = self._size, self._size + len(column)
        values = self._values[start : self._size]
        if self.instants and not self._take_instants(values, column.to_pylist()):
            self.instants, self._filled = False, start
            self._text = self._text or f"holds text: {str(column[0])[:40]!r} in line {lines[0]}"
        if not self.instants:
            self._take_numbers(values, column, lines, start)

    def _take_instants(self, values: Array, entries: list[str]) -> bool:
        """Seconds since midnight of the first day; whether all entries are instants."""
        for place, entry in enumerate(entries):
            told = INSTANT.fullmatch(entry)
            if told is None:
                return False
            hour = int(told["h"]) % (12 if told["half"] else 24) + (12 if (told["half"] or "").upper() == "PM" else 0)
            seconds = 3600.0 * hour + 60.0 * int(told["m"]) + float(f"{told['s'][:2]}.{told['s'][3:]}")
            try:
                day = _day(told)
            except ValueError:
                return False
            self._day = self._day or day
            values[place] = 86400.0 * (day - self._day) + seconds
        return True

    def _take_numbers(self, values: Array, column: Any, lines: Sequence[int], start: int) -> None:
        text = column
        if self._grouped:
            text = pc.replace_substring_regex(text, "[\u00a0' ]", "")
            text = pc.replace_substring(text, "." if self._comma else ",", "")
        if self._comma:
            text = pc.replace_substring(text, ",", ".")
        filled = pc.not_equal(column, "").to_numpy(zero_copy_only=False)
        good = pc.match_substring_regex(text, r"(?i)^([+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?|[+-]?(nan|inf(inity)?))$")
        good = good.to_numpy(zero_copy_only=False)
        values[:] = np.nan
        values[good] = text.filter(pa.array(good)).cast(pa.float64()).to_numpy(zero_copy_only=False)
        values[~np.isfinite(values)] = np.nan
        self._filled += int(np.count_nonzero(filled))
        self._good += int(np.count_nonzero(good))
        bad = np.flatnonzero(np.isnan(values))
        last = int(np.max(np.flatnonzero(filled), initial=-1))
        if last >= 0:
            self._end = start + last + 1
            self._bad += self._blank + int(np.count_nonzero(bad <= last))
            self._blank = 0
        self._blank += int(np.count_nonzero(bad > last))
        if len(bad) and not self._missing:
            self._missing = _not_finite(column[int(bad[0])], lines[int(bad[0])])
        if not self._text and (odd := np.flatnonzero(filled & ~good)).size:
            self._text = f"holds text: {str(text[int(odd[0])])[:40]!r} in line {lines[int(odd[0])]}"
        if not self._wrong:
            wrong = (int(p) for p in bad if (entry := str(column[int(p)])) and not is_missing(entry))
            place = next(wrong, None)
            self._wrong = "" if place is None else _not_finite(text[place], lines[place])

    def finished(self) -> tuple[Array | None, str]:
        """(readings, what is wrong with those down to the last entry); no readings if the column is text.

        Entries that a recorder marks as missing, and blanks, are NaN; more than a few of them are a problem.
        """
        values = self._values[: self._size]
        if self.instants:
            return np.asarray(values - values[0]), ""
        if self._end and self._good < 0.5 * self._filled:
            return None, self._text
        return values, self._wrong or (self._missing if self._bad > MOST_MISSING * self._end else "")


def _not_finite(entry: Any, line: int) -> str:
    text = str(entry)
    shown = repr(text[:40]) if text else "a blank between two numbers"
    return f"line {line}: {shown} is not a finite number"


def _day(told: re.Match[str]) -> int:
    """Number of the day of an instant; day and month are told apart where one of them is above 12."""
    if told["year"]:
        return date(int(told["year"]), int(told["month"]), int(told["day"])).toordinal()
    if told["a"]:
        a, b = int(told["a"]), int(told["b"])
        return date(int(told["late"]), *((b, a) if b <= 12 else (a, b))).toordinal()
    if told["of"]:
        return date(int(told["in"]), MONTHS.index(told["word"][:3].casefold()) + 1, int(told["of"])).toordinal()
    return 1


def instants_of(entries: Sequence[str]) -> Array | None:
    """Seconds since the first of some instants as texts; None where one is none."""
    if not entries or not is_instant(entries[0]):
        return None
    column = Entries(len(entries), entries[:1], comma=False)
    column.take(pa.chunked_array([entries], pa.string()), range(1, len(entries) + 1))
    return column.finished()[0] if column.instants else None
