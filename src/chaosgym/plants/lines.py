"""A plant behind lines of text, in any language."""

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from queue import Empty, Queue
from threading import Thread
from typing import IO, Any, TextIO

from chaosgym.errors import ParameterError

ANSWER_SECONDS = 600.0
"""Time for which a program behind lines is waited for."""


class Answers:
    """Lines of a stream, each of which is waited for only so long."""

    def __init__(self, stream: IO[str], seconds: float) -> None:
        self._stream, self._seconds = stream, seconds
        self._lines: Queue[str] | None = None

    def next(self) -> str | None:
        """Return the next line; "" at the end of the stream, None if none came in time."""
        if self._lines is None:
            self._lines = Queue()
            Thread(target=self._listen, args=(self._lines,), daemon=True).start()
        try:
            return self._lines.get(timeout=self._seconds)
        except Empty:
            return None

    def _listen(self, lines: "Queue[str]") -> None:
        try:
            while line := self._stream.readline():
                lines.put(line)
        except ValueError:  # the stream was closed
            pass
        lines.put("")


class Lines:
    """A plant behind two streams of text, one line each way.

    It is told ``reset``, which has no answer, and ``run SPEED CYCLES``, whose answer is a line of as many forces [N],
    or one JSON object with ``peaks`` and what else the sensors tell; ``done`` comes last.

    Parameters
    ----------
    heard, told
        What the program writes, and what it reads.
    seconds
        For which an answer is waited for.
    """

    def __init__(self, heard: TextIO, told: TextIO, seconds: float = ANSWER_SECONDS) -> None:
        self._answers, self._told, self._seconds = Answers(heard, seconds), told, seconds

    def reset(self) -> None:
        """Tell the plant to come to rest."""
        print("reset", file=self._told, flush=True)

    def run(self, speed: float, cycles: int) -> Any:
        """Request a step, and read the line that answers it."""
        print(f"run {speed:.10g} {cycles}", file=self._told, flush=True)
        line = self._answers.next()
        if line is None:
            raise ParameterError(f"no answer came within {self._seconds:g} s; allowed: a line of forces [N]")
        if not line:
            raise ParameterError("standard input ended; allowed: a line of forces for each line run SPEED CYCLES")
        try:
            return json.loads(line) if line.lstrip().startswith("{") else [float(word) for word in line.split()]
        except ValueError:
            raise ParameterError(f"{line.strip()[:60]!r} is no line of forces [N]; allowed: 81.2 80.9 ...") from None


@contextmanager
def saying_done() -> Iterator[None]:
    """Tell the program behind standard output ``done`` at the end, however that comes, if it still listens."""
    try:
        yield
    finally:
        try:
            print("done", flush=True)
        except OSError:  # what is left in the buffer goes nowhere at the end of the process
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
