"""Which runs does a comparison need, and which are known already? Jobs with plain results, kept on disk.

A result is found again by machine, kind of run, settings, and a digest of the sources that decide it; an edit of a
kernel, a machine or a test of chaos makes all of them anew.
"""

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import chaosgym
from chaosgym.files import write_atomically
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of
from chaosgym.simulation import parallel_map
from thesis.scorecard.observation import Effort, Observation, observe

DECISIVE_SOURCES = (
    "core",
    "machines",
    "diagnosis",
    "simulation.py",
    "atlas/observation.py",
    "atlas/beam_runs.py",
    "atlas/crank_runs.py",
)
"""Sources of the package that decide the result of a job."""

Run = Callable[..., Mapping[str, Any]]


class Job(NamedTuple):
    """One run: a function of a machine, and its settings."""

    run: Run
    machine: Machine
    settings: tuple[float | str, ...] = ()


def observation(machine: Machine, *effort: int) -> dict[str, Any]:
    """What a figure of the thesis would show of a machine; see ``Observation``."""
    return observe(machine, Effort(*effort)).as_dict()


def as_observation(result: Mapping[str, Any]) -> Observation:
    """Result of an ``observation`` job."""
    return Observation(**result)


def run_jobs(
    jobs: Iterable[Job], *, folder: Path | None = None, workers: int | None = None, progress: str | None = None
) -> dict[Job, Mapping[str, Any]]:
    """Run every job once, side by side on threads.

    Parameters
    ----------
    jobs
        What to run; equal jobs are run once.
    folder
        Where results are kept; None keeps none.
    workers
        Number of threads; all processors by default.
    progress
        Name of a progress bar on standard error; None shows none.
    """
    wanted = list(dict.fromkeys(jobs))
    results = parallel_map(lambda job: _result(job, folder), wanted, workers=workers, progress=progress)
    return dict(zip(wanted, results, strict=True))


def default_folder() -> Path:
    """Where results are kept unless another folder is named: the user's cache."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "chaosgym" / "atlas"


def _result(job: Job, folder: Path | None) -> Mapping[str, Any]:
    if folder is None:
        return job.run(job.machine, *job.settings)
    path = folder / f"{_key(job)}.json"
    try:
        known: Mapping[str, Any] = json.loads(path.read_text())
    except (OSError, ValueError):
        known = job.run(job.machine, *job.settings)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, lambda temporary: temporary.write_text(json.dumps(known, allow_nan=False)))
    return known


def _key(job: Job) -> str:
    described = {
        "run": job.run.__name__,
        "machine": job.machine.name,
        "parameters": {name: getattr(job.machine, name) for name in parameters_of(job.machine)},
        "settings": job.settings,
        "sources": SOURCES,
    }
    return hashlib.sha256(json.dumps(described, sort_keys=True).encode()).hexdigest()[:32]


def digest(names: Iterable[str]) -> str:
    """Hash of the text of some sources of the package, files or folders, at the time of the call."""
    root = Path(chaosgym.__file__).parent
    found = hashlib.sha256()
    for name in names:
        path = root / name
        for source in sorted(path.glob("*.py")) if path.is_dir() else [path]:
            found.update(source.read_bytes())
    return found.hexdigest()


SOURCES = digest(DECISIVE_SOURCES)
"""Digest of the sources at the time of import: those that run."""
