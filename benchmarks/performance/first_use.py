"""What the first use costs: a command with and without compiled kernels, and the functions that it compiles.

Each command runs in a process of its own. Kernels are compiled into a new folder, which is removed; the user's is left
alone. All figures are processor time, but for ``wall_seconds``.
"""

import contextlib
import io
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from typing import Any

from numba.core import event

COLD = (("diagnose", "impact-beam"), ("diagnose", "slider-crank"))
WARM = (
    ("info",),
    ("classify", "impact-beam"),
    ("show", "impact-beam"),
    ("show", "slider-crank"),
    ("simulate", "impact-beam"),
    *COLD,
)
REPEATS = 5

_PICTURE = """
import asyncio, os
from bokeh.document import Document
from bokeh.events import DocumentReady
from chaosgym.explore.page import Page
from chaosgym.machines import ImpactBeam

async def picture():
    document = Document()
    page = Page(document, ImpactBeam())
    document.callbacks.trigger_event(DocumentReady())
    while not len(page._sources["motion"].data["time"]):
        await asyncio.sleep(0.005)
        for told in document.session_callbacks:
            document.remove_next_tick_callback(told)
            told.callback()

asyncio.run(picture())
os._exit(0)  # whatever the diagram is at
"""
"""Opens the page of explore, without a browser, until the first picture is there."""

_CHILD = "import sys; from benchmarks.performance.first_use import compiled; compiled(sys.argv[1:])"
"""Prints what each function takes that a command compiles, in one process."""


class _Spent(event.Listener):  # type: ignore[misc] # numba has no types
    """Processor time of this thread in each function that is compiled, without that of those within."""

    def __init__(self) -> None:
        self.rows: list[tuple[str, float]] = []
        self._open: list[list[float]] = []

    def on_start(self, event: event.Event) -> None:
        self._open.append([time.thread_time(), 0.0])

    def on_end(self, event: event.Event) -> None:
        began, within = self._open.pop()
        whole = time.thread_time() - began
        if self._open:
            self._open[-1][1] += whole
        function = event.data["dispatcher"].py_func
        self.rows.append((f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}", whole - within))


def compiled(words: Sequence[str]) -> None:
    """Run a command of this package and print what each function took that it compiled [s], as rows of a table."""
    from chaosgym.cli import app

    spent = _Spent()
    with event.install_listener("numba:compile", spent), contextlib.redirect_stdout(io.StringIO()):
        app(list(words), standalone_mode=False)
    for name, seconds in spent.rows:
        print(f"{seconds:.3f} {name}")


def _processor_seconds(command: Sequence[str], environment: dict[str, str] | None = None) -> tuple[float, str]:
    """Processor time [s] of a process and its children, and what it printed."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    found = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return seconds, found.stdout.decode()


def cold_start(commands: Sequence[Sequence[str]] = COLD) -> dict[str, Any]:
    """Run commands without any compiled kernels, shipped ones included.

    Returns
    -------
    dict
        By command: ``wall_seconds``, ``seconds`` of processor time, and ``functions``, a list of (name, seconds
        without those within), the dearest first; a function that is compiled for several types is there as often.
    """
    result = {}
    for words in commands:
        with tempfile.TemporaryDirectory() as folder:
            began = time.perf_counter()
            environment = {**os.environ, "NUMBA_CACHE_DIR": folder, "CHAOSGYM_KERNELS": "none"}
            seconds, printed = _processor_seconds([sys.executable, "-c", _CHILD, *words], environment)
            wall = time.perf_counter() - began
        rows = [line.split() for line in printed.splitlines()]
        functions = sorted(((name, float(spent)) for spent, name in rows), key=lambda row: -row[1])
        result[" ".join(words)] = {"wall_seconds": wall, "seconds": seconds, "functions": functions}
    return result


def warm_start(commands: Sequence[Sequence[str]] = WARM, repeats: int = REPEATS) -> dict[str, float]:
    """Least processor time [s] of some runs of commands whose kernels are compiled; the first run is not counted.

    The first picture of ``explore`` is among them.
    """
    result = {}
    work = {" ".join(words): ["-m", "chaosgym", *words] for words in commands}
    for name, arguments in (work | {"explore, first picture": ["-c", _PICTURE]}).items():
        command = [sys.executable, *arguments]
        _processor_seconds(command)
        result[name] = min(_processor_seconds(command)[0] for _ in range(repeats))
    return result
