"""Compilation of kernels: once on a computer, however many processes need them.

The first call of a kernel in a process loads its machine code from the disk, or compiles it, which takes seconds, and
keeps it there. A lock lets one process do that while the others wait and then load; a message says what takes so long.
"""

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numba

from chaosgym.core import KERNEL_CACHE, source_digest

logger = logging.getLogger("chaosgym")

_ready: set[tuple[Any, int]] = set()


def call(kernel: Any, *arguments: Any) -> Any:
    """Call a kernel; the first time, compile it or load it while no other process does."""
    key = (kernel, len(arguments))
    if key not in _ready:
        prepare(kernel, *arguments)
        _ready.add(key)
    return kernel(*arguments)


def prepare(kernel: Any, *arguments: Any) -> None:
    """Compile or load a kernel for arguments of these types."""
    types = [numba.typeof(argument) for argument in arguments]
    missing = kernel.py_func.__code__.co_argcount - len(types)
    defaults = (kernel.py_func.__defaults__ or ())[-missing:] if missing else ()
    signature = (*types, *(numba.types.Omitted(default) for default in defaults))
    with _alone():
        if not is_cached(kernel):
            logger.warning("compiling %s: once on this computer, some ten seconds", name_of(kernel))
        kernel.compile(signature)


def is_cached(kernel: Any) -> bool:
    """True if machine code of a kernel lies on the disk, for arguments of some types."""
    return any(Path(KERNEL_CACHE).parent.glob(f"*/*/{name_of(kernel)}-*.nbi"))


def name_of(kernel: Any) -> str:
    """Module and name of a kernel."""
    function = kernel.py_func
    return f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}"


@contextmanager
def cached_by_content(folder: Path) -> Iterator[None]:
    """Kernels imported meanwhile are cached, as those of ``core``, in a folder named by the hash of their sources.

    Kernels outside ``core`` call those inside, so that the sources of both count.
    """
    previous = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(Path(KERNEL_CACHE).with_name(source_digest(Path(__file__).parent, folder)))
    try:
        yield
    finally:
        numba.config.CACHE_DIR = previous


@contextmanager
def _alone() -> Iterator[None]:
    """Wait until no other process compiles; without file locks on this system, don't wait."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    os.makedirs(KERNEL_CACHE, exist_ok=True)
    with open(os.path.join(KERNEL_CACHE, "compiling.lock"), "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
