"""Files that are either whole or not there, also after a crash, and folders that one process at a time writes into.

Archives of arrays are read without pickle, and only as far as a bound on their unpacked size allows. Tables are CSV or
Parquet by the end of the name.
"""

import io
import os
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout
from numpy.typing import ArrayLike

from chaosgym.errors import DatasetError, UnfinishedError

LOCK_FILE = ".lock"
TEMPORARY = ".*.tmp"
"""Pattern of temporary files; a process that was killed may leave one."""

DAMAGE = (
    *(OSError, ValueError, KeyError, TypeError, IndexError, AttributeError, EOFError, RecursionError),
    *(zipfile.BadZipFile, zlib.error),
)
"""What the reading of a damaged archive raises, and of a description in JSON."""


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


def unpacked(archive: bytes, largest: int) -> dict[str, Any]:
    """Arrays of a ``.npz`` file, by name; a small file may not unpack to a large one.

    Parameters
    ----------
    archive
        Bytes of the file.
    largest
        Bytes that all its members may have together, unpacked.

    Raises
    ------
    ValueError
        If they have more, an array claims more than its member holds, or holds Python objects.
    zipfile.BadZipFile, EOFError
        If the file is damaged.
    """
    with zipfile.ZipFile(io.BytesIO(archive)) as members:
        size = sum(member.file_size for member in members.infolist())
        if size > largest:
            raise ValueError(f"unpacked it has {size} bytes; allowed: up to {largest}")
        return {member.filename.removesuffix(".npy"): _array(members.read(member)) for member in members.infolist()}


def _array(member: bytes) -> Any:
    try:
        return np.load(io.BytesIO(member), allow_pickle=False)
    except MemoryError:
        raise ValueError("an array claims more bytes than the computer has") from None


def check_target(path: str | Path, overwrite: bool) -> None:
    """Check that a table may be written before it is computed.

    Raises
    ------
    DatasetError
        If the name ends in neither .csv nor .parquet, the folder is missing, or the file exists.
    """
    target = Path(path)
    if target.suffix not in (".csv", ".parquet"):
        raise DatasetError(f"{path} ends in {target.suffix or 'nothing'}; allowed: .csv, .parquet")
    if not target.absolute().parent.is_dir():
        raise DatasetError(f"{target.absolute().parent} is no folder; choose another file")
    if target.exists() and not overwrite:
        raise DatasetError(f"{path} exists; use --overwrite or another name")


def write_table(columns: Mapping[str, ArrayLike], path: str | Path) -> None:
    """Write columns by name as CSV or Parquet."""
    import pyarrow as pa
    import pyarrow.csv
    import pyarrow.parquet as pq

    table = pa.table({name: pa.array(values) for name, values in columns.items()})
    if Path(path).suffix == ".csv":
        options = pyarrow.csv.WriteOptions(quoting_style="none")
        write_atomically(Path(path), lambda target: pyarrow.csv.write_csv(table, target, write_options=options))
    else:
        write_atomically(Path(path), lambda target: pq.write_table(table, target))
