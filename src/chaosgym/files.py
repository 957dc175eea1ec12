"""Files that are either whole or not there, also after a crash, and folders that one process at a time writes into.

What comes from outside is read here: files of a bounded size, no devices; arrays without pickle, and only as large as
their bytes and a bound on the unpacked size allow.
"""

import io
import math
import os
import shutil
import stat
import tomllib
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout

from chaosgym.errors import ChaosgymError, DatasetError, UnfinishedError

LOCK_FILE = ".lock"
OWN_END = "chaosgym.tmp"
TEMPORARY = f".*.{OWN_END}"
"""Pattern of this package's temporary files; a process that was killed may leave one."""

DAMAGE = (OSError, ValueError, KeyError, TypeError, IndexError, AttributeError, EOFError, RecursionError, OverflowError)
"""What the reading of a damaged description in JSON, or of its arrays, raises."""


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Let ``write`` fill a temporary file beside ``path``, then rename it; both reach the disk before this returns.

    A link stays one: the file that it names is replaced. The new file has the mode of the old one.

    Raises
    ------
    ChaosgymError
        If there is something under the name that is no file, such as a pipe or a device, or its folder is none.
    """
    target = replaceable(path)
    if not target.parent.is_dir():
        raise ChaosgymError(f"{target.parent} is no folder; make it first, or choose another one")
    temporary = target.with_name(f".{target.name}.{os.getpid()}.{OWN_END}")
    try:
        mode = stat.S_IMODE(target.stat().st_mode) if target.exists() else None
        if mode is not None:  # never readable by more people than before, not even while it is written
            temporary.unlink(missing_ok=True)
            os.close(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600))
            os.chmod(temporary, mode | stat.S_IWUSR)
        write(temporary)
        _flush(temporary)
        if mode is not None:
            os.chmod(temporary, mode)
        os.replace(temporary, target)
        if os.name == "posix":
            _flush(target.parent)
    finally:
        temporary.unlink(missing_ok=True)


def replaceable(path: str | Path) -> Path:
    """Return the file that a name stands for, links resolved, whether it exists or not.

    Raises
    ------
    ChaosgymError
        If there is something under the name that is no file.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():
        raise ChaosgymError(f"{path} is {_kind(target.stat().st_mode)}; allowed: a file, or a name that is free")
    return target


def check_place(path: str | Path) -> None:
    """Try whether a file can be written under a name, before hours are spent on what it shall hold.

    Raises
    ------
    ChaosgymError
        If its folder takes no file, or something is under the name that is no file.
    """
    import tempfile

    target = replaceable(path)
    try:
        with tempfile.TemporaryFile(dir=target.parent):
            pass
    except OSError as error:
        raise ChaosgymError(f"{target.parent} takes no file: {error.strerror}; choose another folder") from None


def _kind(mode: int) -> str:
    kinds = ((stat.S_ISDIR, "a folder"), (stat.S_ISFIFO, "a pipe"), (stat.S_ISSOCK, "a socket"))
    return next((word for test, word in kinds if test(mode)), "a device")


def contents(path: str | Path, largest: int) -> bytes:
    """Bytes of a file.

    Parameters
    ----------
    path
        Of a file.
    largest
        Bytes that it may have.

    Raises
    ------
    ValueError
        If it is missing, no file, or larger; the message goes on after the name of the file.
    """
    try:
        about = os.stat(path)
        if not stat.S_ISREG(about.st_mode):
            raise ValueError(f"can't be read: it is {_kind(about.st_mode)}, not a file")
        if about.st_size > largest:
            raise ValueError(f"can't be read: it has {about.st_size} bytes; allowed: up to {largest}")
        with open(path, "rb") as file:
            return bounded(file, largest)
    except OSError as error:
        raise ValueError(f"can't be read: {error.strerror or error}") from None


def bounded(stream: Any, largest: int) -> bytes:
    """Bytes of a stream, read as far as the bound.

    Raises
    ------
    ValueError
        If it has more, or more than the computer can hold.
    """
    try:
        read: bytes = stream.read(largest + 1)
    except MemoryError:
        raise ValueError("can't be read: it needs more memory than there is") from None
    if len(read) > largest:
        raise ValueError(f"can't be read: it has more than {largest} bytes")
    return read


def _flush(path: Path) -> None:
    # Windows flushes only what is open for writing
    descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def held(folder: Path, *inner: str) -> Iterator[None]:
    """Keep a folder for this process, and remove temporary files of this package that a killed one left in it.

    Parameters
    ----------
    folder
        Made if it does not exist.
    inner
        Names of folders in it that are written into too.

    Raises
    ------
    UnfinishedError
        If another process holds the folder.
    """
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with FileLock(folder / LOCK_FILE, timeout=0):
            for place in (folder, *(folder / name for name in inner)):
                for path in place.glob(TEMPORARY):
                    path.unlink(missing_ok=True)
            yield
    except Timeout:
        raise UnfinishedError(
            f"another process writes into {folder}; wait until it ends, or choose another folder"
        ) from None


@contextmanager
def made_whole(folder: str | Path) -> Iterator[Path]:
    """Another folder to fill, which takes the name once that is done; what a killed process left of it is removed.

    Raises
    ------
    DatasetError
        If something is under the name already, but for an empty folder.
    UnfinishedError
        If another process makes the same folder.
    """
    target = claimed(folder, what="empty folder")
    begun = target.with_name(f".{target.name}.{OWN_END}")
    with held(begun):
        for left in begun.iterdir():
            if left.name != LOCK_FILE:
                shutil.rmtree(left) if left.is_dir() and not left.is_symlink() else left.unlink()
        try:
            yield begun
        except BaseException:
            shutil.rmtree(begun, ignore_errors=True)
            raise
    (begun / LOCK_FILE).unlink(missing_ok=True)
    if target.is_dir():
        shutil.rmtree(target)  # empty, but for what ``is_empty`` overlooks
    os.replace(begun, target)


def claimed(folder: str | Path, *marks: str, what: str) -> Path:
    """Return a folder that may be written into: new, empty, or holding one of the files that mark it as begun.

    Raises
    ------
    DatasetError
        If it holds anything else. Nothing in it is touched.
    """
    path = Path(folder)
    begun = path.is_dir() and (any((path / mark).is_file() for mark in marks) or is_empty(path))
    if os.path.lexists(path) and not begun:
        raise DatasetError(f"{path} exists and is no {what}; choose another folder")
    return path


def is_empty(folder: Path) -> bool:
    """True if a folder holds nothing but a lock and temporary files."""
    return all(path.name == LOCK_FILE or path.match(TEMPORARY) for path in folder.iterdir())


LARGEST_TOML = 1_000_000
"""Bytes that a file which people write may have."""


def toml_of(path: str | Path) -> tuple[str, dict[str, Any]]:
    """Text and values of a TOML file.

    Raises
    ------
    ValueError
        If it can't be read, or is no TOML; the message goes on after the name of the file.
    """
    content = contents(path, LARGEST_TOML)
    try:
        text = content.decode("utf-8")
        return text, tomllib.loads(text)
    except RecursionError:
        raise ValueError("is not valid TOML: too many brackets") from None
    except ValueError as error:  # of tomllib, of the encoding, and of whole numbers with thousands of digits
        told = first_line(error).split(";")[0]
        twice = "; allowed: each key once, and [[NAME]] for each of several tables" if "Cannot" in told else ""
        raise ValueError(f"is not valid TOML: {told}{twice}") from None


def first_line(error: BaseException) -> str:
    """First line of an error's message, or its kind; at most two hundred letters."""
    return (str(error).strip().split("\n")[0] or type(error).__name__)[:200]


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
        If they have more, the file is damaged, or an array is.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(archive)) as members:
            size = sum(member.file_size for member in members.infolist())
            if size > largest:
                raise ValueError(f"unpacked it has {size} bytes; allowed: up to {largest}")
            found = {member.filename.removesuffix(".npy"): members.read(member) for member in members.infolist()}
    except ValueError:
        raise
    except Exception as error:  # zipfile lets through whatever its decompressors raise
        raise ValueError(f"the archive is damaged: {first_line(error)}") from None
    return {name: array_of(member) for name, member in found.items()}


HEADS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
"""Readers of the head of a ``.npy`` file, by its version."""


def array_of(content: bytes) -> Any:
    """Array of a ``.npy`` file, which has as many bytes as its head says; no Python objects.

    Raises
    ------
    ValueError
        If the file is damaged, or claims more than it holds.
    """
    stream = io.BytesIO(content)
    try:
        version = np.lib.format.read_magic(stream)
        if version not in HEADS:
            raise ValueError(f"an array has format {version}; allowed: {', '.join(map(str, HEADS))}")
        shape, _, kind = HEADS[version](stream)
        if kind.hasobject:
            raise ValueError("an array holds objects, which only pickle reads")
        claimed, held = math.prod(shape) * kind.itemsize, len(content) - stream.tell()
        if any(side < 0 for side in shape) or claimed != held:
            raise ValueError(f"an array claims {claimed} bytes and has {held}")
        stream.seek(0)
        return np.load(stream, allow_pickle=False)
    except ValueError:
        raise
    except Exception as error:  # numpy reads the head with Python's own parser
        raise ValueError(f"an array is damaged: {first_line(error)}") from None
