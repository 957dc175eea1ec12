"""The answer of a command: a table for people, or one JSON object; and a sign of life while it is computed."""

import json
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import click

NOBODY_READS = 141
"""Exit code where the reader of standard output has gone, as of any program that a broken pipe ends."""

PATIENCE_SECONDS = 2.0
"""Time after which a computation says that it goes on."""


def emit(result: Mapping[str, Any], as_json: bool, lines: Callable[[], list[str]]) -> None:
    """Print the result as JSON, or the lines for people; end quietly if nobody reads them."""
    try:
        for line in [json.dumps(result, allow_nan=False)] if as_json else lines():
            click.echo(line, nl=False)  # Python overlooks that a single large write was cut off; the next one is not
            click.echo()
        sys.stdout.flush()
    except BrokenPipeError:
        # what is left in the buffer goes nowhere at the end of the process
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(NOBODY_READS)


@contextmanager
def patience(what: str) -> Iterator[None]:
    """Say on standard error, after two seconds and then every ten, that ``what`` goes on; on a terminal in one line."""
    done = threading.Event()

    def tell() -> None:
        began, pause, shown = time.monotonic(), PATIENCE_SECONDS, sys.stderr.isatty()
        while not done.wait(pause):
            pause = 1.0 if shown else 10.0
            text = f"{what}: {time.monotonic() - began:.0f} s"
            click.echo(f"\r{text}" if shown else text, err=True, nl=not shown)
        if shown and pause != PATIENCE_SECONDS:
            click.echo("\r" + " " * (len(what) + 10) + "\r", err=True, nl=False)

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield
    finally:
        done.set()
        teller.join()
