"""Columns of a text: CSV with any common delimiter, decimal comma, encoding, comments and headings.

The first and the last lines tell how the text is written; then its lines are read block by block, so that it needs
little more memory than its numbers.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, pairwise
from typing import Any

import numpy as np

from chaosgym.errors import DiagnosisError, NoRecordingError
from chaosgym.recordings.heading import COMMENT, QUOTED, TORN, Layout, delimiter_of, layout_of, table_of
from chaosgym.recordings.lines import (
    BLOCK,
    FIRST,
    TAIL,
    Entries,
    Line,
    arranged,
    blocks_of,
    encoding_of,
    last_lines,
    turned,
)
from chaosgym.recordings.raw import LONGEST, MOST_READINGS, Data, Raw, RawColumn, TooMuch, check_readings, pieces

DELIMITERS = {"\t": "tabs", ";": "semicolons", "|": "bars", ",": "commas", " ": "blanks"}
"""Delimiters in the order in which they are tried."""


FOOTER, FEWEST_BEFORE_FOOTER = 50, 20
"""Most lines without numbers that may follow the data, and fewest lines of data before them."""

MOST_TURNED = 2**26
"""Bytes of a text of a few long rows."""

GROUPS = re.compile(r'"([+-]?\d{1,3}(?:,\d{3})+(?:\.\d*)?|[+-]?\d+,\d+)"')
"""A number in quotes with commas."""

AGAIN = "***"
"""How the heading of a further part begins, above which the data end."""


SEPARATORS = np.array([chr(byte) in "\t\n ;|" for byte in range(256)])
"""Bytes between entries."""


def read_text(data: Data) -> Raw:
    """Columns of a text with what stands above them.

    Entries are counted first, and words are cut to ``LONGEST`` letters before patterns are tried on them.

    Data begin where all columns that the end of the file has hold numbers; what stands above names them.
    """
    check_readings(_entries_of(data))
    encoding, rows = encoding_of(data), _lines_of(data)
    if b"\0" in data[:LONGEST] and not encoding.startswith("utf-16"):
        raise NoRecordingError("is neither text nor a format that is known (CSV, Parquet, .npy, .mat, WAV, UFF)")
    blocks, tail = blocks_of(data, encoding), last_lines(data, encoding)
    if rows <= 2 * TAIL:
        if len(data) > MOST_TURNED:
            raise TooMuch(f"has {rows} lines in {len(data):,} bytes; write one reading a line")
        few = list(chain.from_iterable(blocks))
        if (table := turned([line for _, line in few])) is not None:
            raw = read_text("\n".join(table[0]).encode())
            return replace(raw, form=f"{raw.form}, {table[1]}", lines=())
        blocks = iter([few])
    if (other := arranged(tail)) is None:
        return _read(blocks, tail, rows)
    rows += len(other.heading)
    made = ([(number, row) for number, line in block if (row := other.row(line)) is not None] for block in blocks)
    heading = [[(0, line) for line in other.heading]] if other.heading else []
    last = [row for line in tail if (row := other.row(line)) is not None]
    raw = _read(_joined(chain(heading, made)), last, rows)
    return replace(raw, form=f"{raw.form}, {other.how}", lines=())


def _lines_of(data: Data) -> int:
    """Lines of a text at the most."""
    return 1 + sum(piece.count(b"\n") for piece in pieces(data, BLOCK))


def _entries_of(data: Data) -> int:
    """Entries that a text has at the least: runs of separators; commas count where there are no others in a line."""
    if len(data) <= 2 * MOST_READINGS:
        return 0
    separators = SEPARATORS.copy()
    separators[ord(",")] = not any(mark in data[:BLOCK] for mark in (b"\t", b";", b"|"))
    count = 0
    for piece in pieces(data, BLOCK):
        between = separators[np.frombuffer(piece, np.uint8)]
        count += int(np.count_nonzero(between[1:] & ~between[:-1]))
    return count


def _joined(blocks: Iterable[list[Line]]) -> Iterator[list[Line]]:
    """Blocks of lines, a heading together with the lines below it."""
    blocks = iter(blocks)
    first = next(blocks, [])
    yield [*first, *next(blocks, [])]
    yield from blocks


def _read(blocks: Iterator[list[Line]], tail: list[str], rows: int) -> Raw:
    """Columns of the lines of a table, of which the last are known."""
    written = next(blocks)
    if any("\0" in line for _, line in written):
        raise NoRecordingError("is neither text nor a format that is known (CSV, Parquet, .npy, .mat, WAV, UFF)")
    kept, last = _of_data(written), [line for _, line in _of_data(enumerate(tail, start=1))][-TAIL:]
    if not kept or not last:
        raise NoRecordingError("holds no numbers")
    delimiter = delimiter_of(kept[0][1], last)
    prepare = _Prepared(delimiter)
    layout, start = layout_of(written, prepare(kept), [line for _, line in prepare(list(enumerate(last)))], delimiter)
    body = _Body(layout, rows)
    held = prepare(kept)[start:]
    for block in blocks:
        body.take(held[:-FOOTER])
        held = [*held[-FOOTER:], *prepare(_of_data(block))]
    body.take(held, last=True)
    return body.raw()


def _of_data(lines: Iterable[Line]) -> list[Line]:
    """Lines that are neither blank nor comments."""
    return [
        (number, line)
        for number, line in lines
        if line.strip(" ,;|\t") and not (COMMENT.match(line) and not QUOTED.match(line) and not TORN.match(line))
    ]


class _Prepared:
    """Lines whose columns are told by one mark: without commas in quotes, with a tab for any number of blanks."""

    def __init__(self, delimiter: str) -> None:
        self._delimiter = delimiter
        self._mark: str | None = None

    def __call__(self, lines: list[Line]) -> list[Line]:
        """The lines, of which a comma or a point of a number in quotes may be that of thousands.

        Raises
        ------
        DiagnosisError
            If commas may be those of thousands as well as decimal ones.
        """
        if self._delimiter == " ":
            return [(number, "\t".join(line.split())) for number, line in lines]
        if self._delimiter != ",":
            return lines
        quoted = [(number, word) for number, line in lines if '"' in line for word in GROUPS.findall(line)]
        if not quoted:
            return lines
        if self._mark is None:
            self._mark = _decimal_mark(quoted, lines)
        mark = self._mark
        return [(number, GROUPS.sub(lambda word: word[1].replace(",", mark), line)) for number, line in lines]


def _decimal_mark(quoted: list[Line], lines: list[Line]) -> str:
    """What stands for the comma of numbers in quotes: a point if it is decimal, nothing if it is that of thousands."""
    decimal = any(re.fullmatch(r"[+-]?(\d{4,},\d+|\d+,(\d{1,2}|\d{4,}))", word) for _, word in quoted)
    thousands = any(re.search(r",\d{3}[,.]", word) for _, word in quoted)
    thousands = thousands or any(re.search(r"(^|,)[+-]?\d+\.\d+(,|$)", line) for _, line in lines)
    if decimal == thousands:
        number, word = quoted[0]
        both = f"{word.replace(',', '')} or {word.replace(',', '.')}"
        raise DiagnosisError(f"line {number}: {word!r} may be {both}; write numbers without separators of thousands")
    return "." if decimal else ""


class _Body:
    """Columns of the lines below a heading, which are taken block by block."""

    def __init__(self, layout: Layout, rows: int) -> None:
        self._layout, self._rows = layout, rows
        self._columns: list[Entries] = []
        self._lines, self._size = np.empty(rows, np.int32), 0
        self._again: list[int] = []
        self._torn: list[int] = []
        self._left: list[int] = []
        self._ended = False

    def take(self, lines: list[Line], *, last: bool = False) -> None:
        """Take lines, of which the last ones of all may be no data."""
        if self._ended:
            self._left += [number for number, _ in lines]
            return
        stop = next((place for place, (_, line) in enumerate(lines) if line.startswith(AGAIN)), len(lines))
        self._ended = stop < len(lines)
        end = self._without_footer(lines[:stop]) if last or self._ended else stop
        self._left += [number for number, _ in lines[end:]]
        again = {number for number, _ in self._again_of(lines[:end])}
        body = [(number, line) for number, line in lines[:end] if number not in again]
        self._again += sorted(again)
        if not body:
            return
        check_readings((self._size + len(body)) * self._layout.width)
        table = table_of(body, self._layout.titles, self._layout.mark)
        self._torn += [number for number, line in body if line.count('"') % 2]
        if not self._columns:
            comma = self._layout.comma
            self._columns = [Entries(self._rows, one[:FIRST].to_pylist(), comma) for one in table.columns]
        numbers = [number for number, _ in body]
        self._lines[self._size : self._size + len(body)] = numbers
        self._size += len(body)
        for column, texts in zip(self._columns, table.columns, strict=True):
            column.take(texts, numbers)

    def _again_of(self, lines: list[Line]) -> list[Line]:
        """Lines of a heading that is repeated, and of a title above it."""
        above = self._layout.above
        if not any(line in above for _, line in lines):
            return []
        follows = [*(line in above for _, line in lines[1:]), False]
        return [
            (number, line)
            for (number, line), title in zip(lines, follows, strict=True)
            if line in above or (title and not self._layout.is_data(line))
        ]

    def _without_footer(self, lines: list[Line]) -> int:
        """How many of the last lines belong to the data."""
        fewest, end = FEWEST_BEFORE_FOOTER - self._size, len(lines)
        while end > max(fewest, len(lines) - FOOTER, 0) and not self._layout.is_data(lines[end - 1][1]):
            end -= 1
        return end if end > max(fewest, 0) and self._layout.is_data(lines[end - 1][1]) else len(lines)

    def raw(self) -> Raw:
        """The columns, and what was left out."""
        layout, columns = self._layout, []
        lines: Any = self._lines[: self._size]
        if len(lines) and lines[-1] - lines[0] == len(lines) - 1:
            lines = range(int(lines[0]), int(lines[-1]) + 1)
        for title, unit, entries, held in zip(
            layout.titles, layout.heading.units, self._columns, layout.steady, strict=True
        ):
            values, problem = entries.finished()
            if self._torn:
                problem = f"line {self._torn[0]}: a quote is not closed, as in {len(self._torn)} of {len(lines)} lines"
            if layout.heading.titles or held or not (problem or values is None) or not any(layout.steady):
                columns.append(RawColumn(title, values, {"unit": "s" if entries.instants else unit}, problem=problem))
        form = "CSV" if layout.width == 1 else f"CSV, {DELIMITERS[layout.delimiter]}"
        form += ", decimal comma" if layout.comma else ""
        form += f", {len(self._left)} lines from line {self._left[0]} on left out" if self._left else ""
        if self._again:
            form += f", a heading repeated amid the data left out, first in line {self._again[0]}"
        blocks = _blocks(lines, columns)
        if len(blocks) > 1:
            first, last = max(blocks, key=lambda block: block[1] - block[0])
            columns = [replace(one, values=None if one.values is None else one.values[first:last]) for one in columns]
            sizes = ", ".join(str(end - begin) for begin, end in blocks[:8])
            form += f", {len(blocks)} blocks of {sizes} rows of which the one from line {lines[first]} on is read"
            lines = lines[first:last]
        return Raw(form, columns, layout.heading.stated, lines, bool(layout.heading.titles))


def _blocks(lines: Sequence[int], columns: list[RawColumn]) -> list[tuple[int, int]]:
    """First and last places of the blocks of a recorder that was started again.

    A new block begins below a line that is no reading, such as a heading, where a column that else only rises falls.
    """
    apart = np.empty(0, int) if isinstance(lines, range) else np.flatnonzero(np.diff(lines) > 1) + 1
    for column in columns if len(apart) else ():
        if column.values is None:
            continue
        falls = np.flatnonzero(np.diff(column.values) < 0.0) + 1
        if len(falls) and np.isin(falls, apart).all():
            ends = [0, *falls.tolist(), len(column.values)]
            return list(pairwise(ends))
    return [(0, len(lines))]
