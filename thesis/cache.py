"""The cache of computed results: found again by what was computed, and by the sources and the computer that decide it.

An edit of a kernel, a machine or a test of chaos makes all of them anew, and so does another processor, BLAS or version
of numpy, scipy or numba. A damaged file is computed again.
"""

import hashlib
import json
import os
import platform
import zipfile
from collections.abc import Callable, Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg  # noqa: F401 - its BLAS is named too
from llvmlite import binding
from numpy.typing import NDArray
from threadpoolctl import threadpool_info

import chaosgym
from chaosgym.files import write_atomically

LIBRARY = Path(chaosgym.__file__).parent
HERE = Path(__file__).parent

DECISIVE_SOURCES = (
    *(
        LIBRARY / name
        for name in ("core", "machines", "simulation", "series", "diagnosis", "branches", "design/peak_impacts.py")
    ),
    *(HERE / "scorecard" / f"{name}.py" for name in ("observation", "beam_runs", "crank_runs")),
    *(HERE / "figures" / f"{name}.py" for name in ("computations", "scored")),
)
"""Files and folders whose text decides a result."""

Arrays = Mapping[str, NDArray[Any]]
Plain = Mapping[str, Any]


def default_folder() -> Path:
    """Where results are kept unless another folder is named: the user's cache."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "chaosgym" / "thesis"


def digest() -> str:
    """Hash of the text of the decisive sources at the time of the call."""
    found = hashlib.sha256()
    for path in DECISIVE_SOURCES:
        for source in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            found.update(source.read_bytes())
    return found.hexdigest()


SOURCES = digest()
"""Digest of the sources at the time of import: those that run."""


@cache
def computer() -> str:
    """Processor as numba knows it, kernels of BLAS, and versions of what computes."""
    processor = os.environ.get("NUMBA_CPU_NAME") or binding.get_host_cpu_name()
    kernels = sorted({str(pool.get("architecture")) for pool in threadpool_info() if pool["user_api"] == "blas"})
    versions = [f"{name} {version(name)}" for name in ("numpy", "scipy", "numba")]
    return ", ".join([platform.machine(), processor, *kernels, *versions])


def path_of(described: str, folder: Path, suffix: str) -> Path:
    """File of a result; its description, the sources and the computer are in its name as a hash."""
    return folder / (hashlib.sha256(f"{SOURCES}\n{computer()}\n{described}".encode()).hexdigest()[:32] + suffix)


def kept_arrays(described: str, folder: Path | None, compute: Callable[[], Arrays]) -> Arrays:
    """Arrays by name, read from the folder or computed and kept there; no folder keeps nothing."""
    return _kept(described, folder, ".npz", compute, _read_arrays, _write_arrays)


def kept_values(described: str, folder: Path | None, compute: Callable[[], Plain]) -> Plain:
    """As ``kept_arrays``, for values that JSON takes."""
    return _kept(described, folder, ".json", compute, _read_values, _write_values)


def _kept(
    described: str,
    folder: Path | None,
    suffix: str,
    compute: Callable[[], Plain],
    read: Callable[[Path], Plain],
    write: Callable[[Path, Plain], None],
) -> Plain:
    if folder is None:
        return compute()
    path = path_of(described, folder, suffix)
    try:
        return read(path)
    except (OSError, EOFError, ValueError, zipfile.BadZipFile):
        found = compute()
        folder.mkdir(parents=True, exist_ok=True)
        write_atomically(path, lambda temporary: write(temporary, found))
        return found


def _read_arrays(path: Path) -> Plain:
    with path.open("rb") as file, np.load(file, allow_pickle=False) as kept:
        return {name: kept[name] for name in kept.files}


def _write_arrays(path: Path, data: Plain) -> None:
    with path.open("wb") as file:
        np.savez_compressed(file, **dict(data))


def _read_values(path: Path) -> Plain:
    found: Plain = json.loads(path.read_text())
    return found


def _write_values(path: Path, data: Plain) -> None:
    path.write_text(json.dumps(data, allow_nan=False))
