"""Ctrl-C that ends a command at once, also while a kernel computes or threads are waited for."""

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

GRACE_SECONDS = 0.5
"""Time for Python to end the command by itself, which it can't while a kernel computes."""

ENDING = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
"""Signals that ask a command to end: by a person, by another program, by a terminal that is closed."""

ABORTED = 130
"""Exit code of a command that Ctrl-C ended."""


_stopping = threading.Event()
"""Set while a machine has to be brought to rest first."""


@contextmanager
def first_stopped() -> Iterator[None]:
    """Let the code inside end by itself, however long it takes to stop a machine; a second Ctrl-C ends it at once.

    Any of ``ENDING`` is a KeyboardInterrupt there.
    """
    if threading.current_thread() is not threading.main_thread():  # which alone hears signals
        yield
        return
    before = {number: signal.signal(number, signal.default_int_handler) for number in ENDING}
    _stopping.set()
    try:
        yield
    finally:
        _stopping.clear()
        for number, handler in before.items():
            signal.signal(number, handler)


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
    heard = 0
    while number := os.read(reading, 1):
        if number[0] in ENDING:
            heard += 1
            time.sleep(GRACE_SECONDS)
            if heard == 1 and _stopping.is_set():
                os.write(2, b"Stopping the machine; Ctrl-C again ends without that.\n")
                continue
            os.write(2, b"Aborted.\n")
            os._exit(ABORTED)
    os.close(reading)
