"""Statements judged on given machines: the runs that they need, each made once, and what they show."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from chaosgym.machines import THESIS_SLIDER_CRANK, ImpactBeam, Machine
from chaosgym.machines.parameters import with_settings
from thesis.scorecard.jobs import Job, run_jobs
from thesis.scorecard.observation import Effort
from thesis.scorecard.quantities import QUANTITIES
from thesis.scorecard.verdicts import Judged, judge
from thesis.statements import Comparison, conditions, read_comparisons

THESIS_MACHINES: Mapping[str, Machine] = {one.name: one for one in (ImpactBeam(), THESIS_SLIDER_CRANK)}
"""By name: what the scorecard judges and the figures show."""


def evaluate(
    comparisons: Sequence[Comparison],
    bases: Mapping[str, Machine],
    *,
    efforts: Mapping[str, Effort],
    folder: Path | None = None,
    workers: int | None = None,
    progress: str | None = None,
    unprinted: Mapping[str, float] | None = None,
) -> tuple[Judged, ...]:
    """Judge some comparisons on given machines.

    Parameters
    ----------
    comparisons
        What to judge.
    bases
        Machines by name.
    efforts, folder, workers, unprinted
        As for ``scorecard``.
    progress
        Name of a progress bar on standard error; None shows none.
    """
    known = {name: one.value for name, one in read_comparisons().unprinted.items()} | dict(unprinted or {})
    plans: list[list[tuple[Machine, list[Job]]]] = []
    for one in comparisons:
        machines = (
            [] if one.not_computed else [with_settings(bases[one.machine], conditions(at, known)) for at in one.at]
        )
        effort = efforts[one.machine]
        plans.append([(machine, QUANTITIES[one.quantity].jobs(machine, one, effort)) for machine in machines])
    jobs = [job for plan in plans for _, needed in plan for job in needed]
    results = run_jobs(jobs, folder=folder, workers=workers, progress=progress)
    return tuple(
        judge(
            one,
            [
                QUANTITIES[one.quantity].finding(machine, one, [results[job] for job in needed])
                for machine, needed in plan
            ],
        )
        for one, plan in zip(comparisons, plans, strict=True)
    )
