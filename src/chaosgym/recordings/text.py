"""Columns of a text: CSV with any common delimiter, decimal comma, encoding, comments and headings."""

import io
import re
from collections import Counter
from datetime import date
from itertools import pairwise
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError
from chaosgym.recordings.heading import Heading, read_heading
from chaosgym.recordings.naming import MOST_MISSING
from chaosgym.recordings.raw import Column, Data, Raw

DELIMITERS = {"\t": "tabs", ";": "semicolons", "|": "bars", ",": "commas", " ": "blanks"}
"""Delimiters in the order in which they are tried."""

HEADING = 2000
"""Lines among which a heading ends."""

MOST_COLUMNS = 4096
"""Columns that a text may have."""

FOOTER, FEWEST_BEFORE_FOOTER = 50, 20
"""Most lines without numbers that may follow the data, and fewest lines of data before them."""

MISSING = re.compile(
    r"[+-]?1?\.?#(QNAN|SNAN|IND|INF)0*|#?N/?[AV]|#NUM!|#DIV/0!|#VALUE!|n\.?a\.?|nan|null|none|OVR|OVL|OL|OVER(LOAD|FLOW|RANGE)?|"
    r"-{1,4}|\*+|\?+",
    re.IGNORECASE,
)
"""How recorders mark a reading that they have not."""

COMMENT = re.compile(r"\s*(#|%|//|\")")
QUOTED = re.compile(r'\s*"[^"]*"\s*($|[,;\t|])')
"""A line whose first entry is in quotes."""

TORN = re.compile(r'\s*"\s*[+-]?[\d.,]')
"""A line that begins with a quote and a number."""

NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?|[+-]?(nan|inf(inity)?)", re.IGNORECASE)


def read_text(data: Data) -> Raw:
    """Columns of a text with what stands above them.

    Data begin where all columns that the end of the file has hold numbers; what stands above names them.
    """
    text = _decoded(bytes(data))
    if "\0" in text:
        raise DiagnosisError("is neither text nor a format that is known (CSV, Parquet, .npy, .mat, WAV, UFF)")
    written = [(number, line.rstrip("\r")) for number, line in enumerate(text.split("\n"), start=1)]
    kept = [
        (number, line)
        for number, line in written
        if line.strip(" ,;|\t") and not (COMMENT.match(line) and not QUOTED.match(line) and not TORN.match(line))
    ]
    if not kept:
        raise DiagnosisError("holds no numbers")
    delimiter = _delimiter([line for _, line in kept])
    if delimiter == ",":
        kept = _without_thousands(kept)
    if delimiter == " ":
        kept = [(number, "\t".join(line.split())) for number, line in kept]
    mark = "\t" if delimiter == " " else delimiter
    width = Counter(line.count(mark) + 1 for _, line in kept[-200:]).most_common(1)[0][0]
    if width > MOST_COLUMNS:
        raise DiagnosisError(f"has {width} columns; allowed: {MOST_COLUMNS}; keep those of forces, times and speeds")
    start, end, steady = _body([line for _, line in kept], mark, width)
    above = {line for _, line in kept[:start]}
    again = [number for number, line in kept[start:end] if line in above]
    body = [(number, line) for number, line in kept[start:end] if line not in above]
    heading = _heading(written[: body[0][0] - 1], body, width, None if delimiter == " " else mark)
    titles = heading.titles or [f"column {place + 1}" for place in range(width)]
    if len(set(titles)) != len(titles):
        raise DiagnosisError(f"names two columns alike: {', '.join(titles)}")
    lines = tuple(number for number, _ in body)
    torn = [number for number, line in body if line.count('"') % 2]
    table = _table([(number, line.replace('"', "")) for number, line in body] if torn else body, titles, mark)
    comma = delimiter != "," and _decimal_comma([v or "" for column in table.columns for v in column[:50].to_pylist()])
    columns = []
    for title, unit, column, held in zip(titles, heading.units, table.columns, steady, strict=True):
        values, problem = _entries(column, comma, lines)
        if torn:
            problem = f"line {torn[0]}: a quote is not closed, as in {len(torn)} of {len(lines)} lines"
        if heading.titles or held or not (problem or values is None) or not any(steady):
            instant = values is not None and _is_instant(str(column[0]))
            columns.append(Column(title, values, {"unit": "s" if instant else unit}, problem=problem))
    form = "CSV" if width == 1 else f"CSV, {DELIMITERS[delimiter]}"
    form += ", decimal comma" if comma else ""
    form += f", {len(kept) - end} lines from line {kept[end][0]} on left out" if end < len(kept) else ""
    if again:
        form += f", a heading repeated amid the data left out, first in line {again[0]}"
    return Raw(form, columns, heading.stated, lines, bool(heading.titles))


def _heading(above: list[tuple[int, str]], body: list[tuple[int, str]], width: int, mark: str | None) -> Heading:
    """What the lines above the data, or an oscilloscope's settings beside its first readings, tell of the columns."""
    told = [line.lstrip("#%/ ") if COMMENT.match(line) and not QUOTED.match(line) else line for _, line in above]
    rows = [line.split() if mark is None else _words(line, mark) for line in told if line.strip()]
    first = [_words(line, mark or "\t") for _, line in body[:50]]
    used = max((place + 1 for words in first for place, word in enumerate(words) if word), default=1)
    beside = [words for words in first if len(words) >= used > 1 and re.match("[A-Za-z]", words[0])]
    return read_heading(rows or [words for words in beside if _is_number(words[used - 1])], width, used)


def _decimal_comma(entries: list[str]) -> bool:
    """Whether the comma is the decimal mark; beside points it is the last one of a number."""
    points = [entry for entry in entries if GROUPED.fullmatch(entry) and entry.rfind(".") > entry.rfind(",")]
    return any("," in entry for entry in entries) and not points


def _words(line: str, mark: str) -> list[str]:
    return [word.strip(' "') for word in line.split(mark)]


def _body(lines: list[str], mark: str, width: int) -> tuple[int, int, list[bool]]:
    """(first line of the data, first line after them, which columns hold numbers at the end of the file)."""
    tail = [words for words in (_words(line, mark) for line in lines[-200:]) if len(words) == width]
    held = [sum(map(_is_entry, (words[c] for words in tail))) > 0.5 * len(tail) for c in range(width)]
    steady = [c for c in range(width) if held[c]]

    def is_data(line: str) -> bool:
        words = _words(line, mark)
        entries = [words[c] for c in steady if c < len(words)]
        told = [_is_entry(word) or not word or MISSING.fullmatch(word) is not None for word in entries]
        return any(map(_is_entry, entries)) and all(told)

    def begins(line: str) -> bool:
        words = _words(line, mark)
        return len(words) == width and any(map(_is_entry, words)) and (not steady or is_data(line))

    start = next((i for i, line in enumerate(lines[:HEADING]) if begins(line)), None)
    if start is None:
        raise DiagnosisError("holds no numbers")
    again = next((i for i in range(start + 1, len(lines)) if lines[i].startswith("***")), len(lines))
    end = again
    while end > start + FEWEST_BEFORE_FOOTER and end > again - FOOTER and not is_data(lines[end - 1]):
        end -= 1
    return start, end if end > start + FEWEST_BEFORE_FOOTER and is_data(lines[end - 1]) else again, held


def _decoded(data: bytes) -> str:
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    if data[1:40:2].count(0) > 10 and data[0] != 0:
        return data.decode("utf-16-le", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")


def _delimiter(lines: list[str]) -> str:
    """Delimiter of the lines; "," stands for none if there is one column."""
    tail = lines[-200:]
    numbers = {
        mark: sum(_is_entry(word) for line in tail for word in _words(line, mark))
        for mark in ("\t", ";", "|")
        if sum(mark in line for line in tail) > 0.5 * len(tail)
    }
    if numbers:
        return max(numbers, key=lambda mark: numbers[mark])
    words = [line.split() for line in tail]
    spaced = sum(len(row) > 1 and all(map(_is_number, row)) for row in words) > 0.5 * len(tail)
    if spaced and not any(word.endswith(",") for row in words for word in row):
        return " "
    single = [row for row in (line.strip().split(",") for line in tail) if _is_number(row[0])]
    decimal = all(
        len(row) == 2 and re.fullmatch(r"[+-]?\d+", row[0]) and re.fullmatch(r"\d+", row[1]) for row in single
    )
    if single and decimal and not _two_columns(lines[0], single):
        return ";"
    return ","


def _two_columns(heading: str, rows: list[list[str]]) -> bool:
    """Whether ``48,9`` is two whole numbers: the heading says so, or the first one counts."""
    if not _is_number(heading.split(",")[0]):
        return "," in heading
    steps = {int(after[0]) - int(before[0]) for before, after in pairwise(rows)}
    return steps == {1} or len(rows) < 2


GROUPS = re.compile(r'"([+-]?\d{1,3}(?:,\d{3})+(?:\.\d*)?|[+-]?\d+,\d+)"')
"""A number in quotes with commas."""


def _without_thousands(lines: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """Lines with commas between columns, where numbers in quotes have points only: ``0.1,"1,000.12"``.

    Raises
    ------
    DiagnosisError
        If these commas may be those of thousands as well as decimal ones.
    """
    quoted = [(number, word) for number, line in lines if '"' in line for word in GROUPS.findall(line)]
    if not quoted:
        return lines
    decimal = any(re.fullmatch(r"[+-]?(\d{4,},\d+|\d+,(\d{1,2}|\d{4,}))", word) for _, word in quoted)
    thousands = any(re.search(r",\d{3}[,.]", word) for _, word in quoted)
    thousands = thousands or any(re.search(r"(^|,)[+-]?\d+\.\d+(,|$)", line) for _, line in lines)
    if decimal == thousands:
        number, word = quoted[0]
        both = f"{word.replace(',', '')} or {word.replace(',', '.')}"
        raise DiagnosisError(f"line {number}: {word!r} may be {both}; write numbers without separators of thousands")
    mark = "." if decimal else ""
    return [(number, GROUPS.sub(lambda word: word[1].replace(",", mark), line)) for number, line in lines]


def _is_number(text: str) -> bool:
    return NUMBER.fullmatch(text.strip()) is not None


INSTANT = re.compile(
    r"((?P<year>\d{4})[-/](?P<month>\d\d?)[-/](?P<day>\d\d?)|(?P<a>\d\d?)[./-](?P<b>\d\d?)[./-](?P<late>\d{4}|\d\d))?"
    r"[ T]*(?P<h>\d\d?):(?P<m>\d\d):(?P<s>\d\d([.,]\d+)?)\s*(?P<half>[AP]M)?\s*(Z|[+-]\d\d:?\d\d)?",
    re.IGNORECASE,
)
"""A time of the day, with or without a date, as recorders write it."""


def _is_instant(text: str) -> bool:
    return INSTANT.fullmatch(text.strip()) is not None


def _is_entry(text: str) -> bool:
    """Whether a word is a number, with or without separators of thousands, or an instant."""
    return _is_number(text) or GROUPED.fullmatch(text) is not None or _is_instant(text)


GROUPED = re.compile(r"[+-]?\d{1,3}(([.\u00a0' ]\d{3})+(,\d+)|([,\u00a0' ]\d{3})+(\.\d+))")
"""A number with separators of thousands and a decimal mark."""


def read_instants(entries: list[str]) -> Array | None:
    """Seconds since the first entry, (n,); None if one is no instant of a form that is known."""
    found, first = np.empty(len(entries)), 0
    for place, entry in enumerate(entries):
        told = INSTANT.fullmatch((entry or "").strip())
        if told is None:
            return None
        hour = int(told["h"]) % (12 if told["half"] else 24) + (12 if (told["half"] or "").upper() == "PM" else 0)
        seconds = 3600.0 * hour + 60.0 * int(told["m"]) + float(told["s"].replace(",", "."))
        try:
            day = _day(told)
        except ValueError:
            return None
        first = first or day
        found[place] = 86400.0 * (day - first) + seconds
    return np.asarray(found - found[0])


def _day(told: re.Match[str]) -> int:
    """Number of the day of an instant; day and month are told apart where one of them is above 12."""
    if told["year"]:
        return date(int(told["year"]), int(told["month"]), int(told["day"])).toordinal()
    if told["a"]:
        a, b = int(told["a"]), int(told["b"])
        return date(int(told["late"]), *((b, a) if b <= 12 else (a, b))).toordinal()
    return 1


def _table(body: list[tuple[int, str]], titles: list[str], mark: str) -> Any:
    """Columns of text; runs that end early are filled up with blanks."""
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


def _entries(column: Any, comma: bool, lines: tuple[int, ...]) -> tuple[Array | None, str]:
    """Readings or instants of a column, as ``_numbers`` returns them."""
    instants = read_instants(column.to_pylist()) if _is_instant(str(column[0])) else None
    return _numbers(column, comma, lines) if instants is None else (instants, "")


def _numbers(column: Any, comma: bool, lines: tuple[int, ...]) -> tuple[Array | None, str]:
    """(readings, what is wrong with those down to the last entry); no readings if the column is text.

    Entries that a recorder marks as missing, and blanks, are NaN; more than a few of them are a problem.
    """
    column = pc.utf8_trim_whitespace(column.combine_chunks())
    filled = pc.not_equal(column, "").to_numpy(zero_copy_only=False)
    size = int(np.max(np.flatnonzero(filled), initial=-1)) + 1
    text = column[:size]
    if any(GROUPED.fullmatch(entry) for entry in text[:50].to_pylist()):
        text = pc.replace_substring_regex(text, "[\u00a0' ]", "")
        text = pc.replace_substring(text, "." if comma else ",", "")
    if comma:
        text = pc.replace_substring(text, ",", ".")
    good = pc.match_substring_regex(text, r"(?i)^([+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?|[+-]?(nan|inf(inity)?))$")
    good = good.to_numpy(zero_copy_only=False)
    if size and good.sum() < 0.5 * np.count_nonzero(filled[:size]):
        place = int(np.flatnonzero(filled[:size] & ~good)[0])
        return None, f"holds text: {str(text[place])[:40]!r} in line {lines[place]}"
    values = np.full(len(column), np.nan)
    values[:size][good] = text.filter(pa.array(good)).cast(pa.float64()).to_numpy(zero_copy_only=False)
    values[~np.isfinite(values)] = np.nan
    bad = np.flatnonzero(np.isnan(values[:size]))
    wrong = [place for place in bad if (entry := str(text[int(place)])) and not MISSING.fullmatch(entry)]
    if wrong or len(bad) > MOST_MISSING * size:
        place = int(wrong[0] if wrong else bad[0])
        entry = str(text[place])
        shown = repr(entry[:40]) if entry else "a blank between two numbers"
        return values, f"line {lines[place]}: {shown} is not a finite number"
    return values, ""
