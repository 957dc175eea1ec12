"""Readings of a stream, line by line: one column of each, with its delimiter, decimal mark, unit and calibration."""

import queue
import re
import threading
from collections.abc import Iterable, Iterator

import numpy as np

from chaosgym.errors import DiagnosisError
from chaosgym.recordings.columns import calibration, check_unit
from chaosgym.recordings.heading import COMMENT, QUOTED, TORN
from chaosgym.recordings.lines import NUMBER
from chaosgym.recordings.quantities import FORCES, as_unit, other_quantity, split_unit

AMBIGUOUS = re.compile(r"[+-]?\d{1,3},\d{3}")
"""1.1, or the columns 1 and 100, or eleven hundred."""


class LineReader:
    """Reads one number from each line of a stream.

    Parameters
    ----------
    column
        Name or number, from 1, of the column; needed where lines have several.
    delimiter
        Between columns; found from each line if None. With any but a comma, a comma is a decimal mark.
    unit, scale
        As for ``choose_force``; a unit of the heading counts where none is stated.

    Raises
    ------
    DiagnosisError
        If unit or scale are none.
    """

    def __init__(
        self, column: str | None = None, delimiter: str | None = None, unit: str | None = None, scale: str | None = None
    ) -> None:
        self.column, self.delimiter, self.unit, self.scale = column, delimiter, unit, scale
        self._names: list[str] = []
        self._factor: float | None = None
        if unit or not scale:
            self.factor(unit or "")

    def factor(self, written: str) -> float:
        """Newton in one reading."""
        if self.scale:
            factor, target = calibration(self.scale, written)
        else:
            factor, target = FORCES.get(as_unit(written) or written or "N", 0.0), "N"
        if target != "N" or not factor:
            raise DiagnosisError(
                "the monitor asks for forces; allowed: --read scale='100 mV/N', or --read unit=UNIT of "
                f"{', '.join(FORCES)}"
            )
        return factor

    def read(self, line: str, number: int, *, first: bool) -> float | None:
        """Force [N] of a line; None for a blank line, a comment, or a heading before the first reading.

        Raises
        ------
        DiagnosisError
            If the line holds no finite number in the column, or it is not clear which.
        """
        text = line.lstrip("\ufeff").strip()
        if not text or (COMMENT.match(text) and not QUOTED.match(text) and (first or not TORN.match(text))):
            return None
        words = self._words(text, number)
        if first and not any(NUMBER.fullmatch(word) for word in words):
            self._names = [split_unit(word)[0].casefold() for word in words]
            place = self._place(words, number, heading=True)
            title, unit = split_unit(words[place]) if place < len(words) else ("", "")
            other, stated = other_quantity(title), self.unit or ""
            check_unit("standard input", title, "N" if other else as_unit(stated) or stated, unit, other)
            self._factor = self.factor(self.unit or unit)
            return None
        place = self._place(words, number)
        word = words[place] if place < len(words) else ""
        value = float(word.replace(",", ".")) if NUMBER.fullmatch(word) else np.nan
        if not np.isfinite(value):
            raise DiagnosisError(f"standard input, line {number}: {(word or text)[:40]!r} is not a finite number")
        if self._factor is None:
            self._factor = self.factor(self.unit or "")
        return value * self._factor

    def _words(self, text: str, number: int) -> list[str]:
        if self.delimiter is None and self.column is None:
            text = text.rstrip(",;")
            text = text.strip('"') if QUOTED.match(text) else text
            if AMBIGUOUS.fullmatch(text):
                raise DiagnosisError(
                    f"standard input, line {number}: {text!r} may be a decimal comma or two columns; state "
                    "--column, or --delimiter ';' for a decimal comma"
                )
            return [text]
        mark = self.delimiter or next((mark for mark in ("\t", ";", "|", ",") if mark in text), None)
        return [word.strip(' "') for word in (text.split() if mark in (None, " ") else text.split(mark))]

    def _place(self, words: list[str], number: int, *, heading: bool = False) -> int:
        asked = (self.column or "1").strip()
        if asked.casefold() in self._names:
            return self._names.index(asked.casefold())
        if asked.isdecimal() and 1 <= int(asked) <= max(1, len(words)):
            return int(asked) - 1
        if heading and len(words) == 1:
            return 0
        raise DiagnosisError(f"standard input, line {number}: there is no column {asked!r}; lines have {len(words)}")


def stalls(lines: Iterable[str], timeout: float | None) -> Iterator[tuple[int, str | None]]:
    """(number, line) of a stream, and (number, None) once each time that nothing has come for ``timeout`` seconds."""
    if timeout is None:
        yield from enumerate(lines, start=1)
        return
    waiting: queue.Queue[str | None] = queue.Queue(maxsize=1000)

    def read() -> None:
        for line in lines:
            waiting.put(line)
        waiting.put(None)

    threading.Thread(target=read, daemon=True).start()
    number, told = 0, False
    while True:
        try:
            line = waiting.get(timeout=None if told else timeout)
        except queue.Empty:
            told = True
            yield number, None
            continue
        if line is None:
            return
        number, told = number + 1, False
        yield number, line
