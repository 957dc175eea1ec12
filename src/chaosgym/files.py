"""Files that are either whole or not there, also after a crash, and folders that one process at a time writes into."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from chaosgym.errors import UnfinishedError

LOCK_FILE = ".lock"
TEMPORARY = ".*.tmp"
"""Pattern of temporary files; a process that was killed may leave one."""


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Let ``write`` fill a temporary file beside ``path``, then rename it; both reach the disk before this returns."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        write(temporary)
        _flush(temporary)
        os.replace(temporary, path)
        if os.name == "posix":
            _flush(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def _flush(path: Path) -> None:
    # Windows flushes only what is open for writing
    descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Keep a folder for this process, and remove temporary files that a killed one left in it.

    Raises
    ------
    UnfinishedError
        If another process holds the folder.
    """
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with FileLock(folder / LOCK_FILE, timeout=0):
            for path in folder.rglob(TEMPORARY):
                path.unlink(missing_ok=True)
            yield
    except Timeout:
        raise UnfinishedError(
            f"another process writes into {folder}; wait until it ends, or choose another folder"
        ) from None


def is_empty(folder: Path) -> bool:
    """True if a folder holds nothing but a lock and temporary files."""
    return all(path.name == LOCK_FILE or path.match(TEMPORARY) for path in folder.iterdir())
