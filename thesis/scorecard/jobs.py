"""Runs that comparisons need: jobs with plain results, which the cache finds again by machine, kind and settings."""

import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of
from chaosgym.simulation.parallel import parallel_map
from thesis.cache import kept_values
from thesis.scorecard.observation import Effort, Observation, observe

Run = Callable[..., Mapping[str, Any]]


class Job(NamedTuple):
    """One run: a function of a machine, and its settings."""

    run: Run
    machine: Machine
    settings: tuple[float | str, ...] = ()


def observation(machine: Machine, *effort: Any) -> dict[str, Any]:
    """What a figure of the thesis would show of a machine; see ``Observation``."""
    return observe(machine, Effort(*effort)).as_dict()


def as_observation(result: Mapping[str, Any]) -> Observation:
    """Result of an ``observation`` job."""
    other = result.get("other")
    return Observation(**{**result, "other": other and as_observation(other)})


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


def _result(job: Job, folder: Path | None) -> Mapping[str, Any]:
    return kept_values(_described(job), folder, lambda: job.run(job.machine, *job.settings))


def _described(job: Job) -> str:
    described = {
        "run": job.run.__name__,
        "machine": job.machine.name,
        "parameters": {name: getattr(job.machine, name) for name in parameters_of(job.machine)},
        "settings": job.settings,
    }
    return json.dumps(described, sort_keys=True)
