"""How is a result found again? Under a hash of what it depends on: version, sources and the whole description."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.files import write_atomically
from chaosgym.version import __version__
from thesis.figures.computations import Computation, Data
from thesis.scorecard.jobs import DECISIVE_SOURCES, digest

SOURCES = digest((*DECISIVE_SOURCES, "atlas", "design/peak_impacts.py", "figures/computations.py", "figures/scored.py"))
"""Digest of the sources that decide a result."""


def result_path(computation: Computation, folder: Path) -> Path:
    """File of a result; machines, settings, version and sources are in its name as a hash."""
    described = "\n".join((__version__, SOURCES, repr(computation)))
    digest = hashlib.sha256(described.encode()).hexdigest()[:16]
    return folder / f"{type(computation).__name__.lower()}-{digest}.npz"


def computed(computation: Computation, folder: Path, workers: int | None = None) -> Data:
    """Read a result if it is kept in the folder; compute and keep it otherwise."""
    path = result_path(computation, folder)
    if path.exists():
        with np.load(path, allow_pickle=False) as kept:
            return {name: kept[name] for name in kept.files}
    data = computation.run(workers)
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(path, lambda temporary: _save(temporary, data))
    return data


def _save(path: Path, data: Data) -> None:
    arrays: dict[str, NDArray[Any]] = dict(data)
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
