"""Ctrl-C that ends a command at once, also while a kernel computes or threads are waited for."""

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

GRACE_SECONDS = 0.5
"""Time for Python to end the command by itself, which it can't while a kernel computes."""

ABORTED = 130
"""Exit code of a command that Ctrl-C ended."""


@contextmanager
def heard_at_once() -> Iterator[None]:
    """Let a thread end the process if Ctrl-C has not done so half a second later.

    That loses nothing: files are whole or not there, and what was kept before goes on with the same command.
    """
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    before = signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    threading.Thread(target=_end_after_interrupt, args=(reading,), daemon=True).start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(writing)


def _end_after_interrupt(reading: int) -> None:
    """Read the numbers of signals until the pipe is closed."""
    while number := os.read(reading, 1):
        if number[0] == signal.SIGINT:
            time.sleep(GRACE_SECONDS)
            os.write(2, b"Aborted.\n")
            os._exit(ABORTED)
    os.close(reading)
