"""The scorecard: every simulated statement of the thesis, judged.

Near, missed and not computed statements count as not hit. Statements that the text itself contradicts are shown and
left out of the ratio.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.version import __version__
from thesis.machines import MACHINES
from thesis.scorecard.jobs import Job, run_jobs
from thesis.scorecard.observation import THOROUGH, Effort
from thesis.scorecard.quantities import QUANTITIES
from thesis.scorecard.verdicts import COUNTED, Judged, judge
from thesis.statements import Comparison, read_comparisons


@dataclass(frozen=True)
class Scorecard:
    """Every statement, judged."""

    judged: tuple[Judged, ...]

    def totals(self) -> dict[str, dict[str, dict[str, int]]]:
        """Return {machine: {group: {hit, near, miss, contradictory, total}, "all": ...}}.

        What is not computed counts in the total alone, so it is no hit.
        """
        found: dict[str, dict[str, Counter[str]]] = {}
        for one in self.judged:
            groups = found.setdefault(one.comparison.machine, {})
            for group in (one.comparison.group, "all"):
                groups.setdefault(group, Counter())[one.verdict] += 1
        return {
            machine: {
                group: {**{name: count[name] for name in COUNTED}, "total": count.total()}
                for group, count in sorted(groups.items(), key=lambda item: item[0] == "all")
            }
            for machine, groups in found.items()
        }

    def hit_rate(self, machine: str, part: str | None = None) -> tuple[int, int]:
        """Hits, and statements that count, of a machine; of one part of them if one is named."""
        counted = [
            one
            for one in self.judged
            if one.comparison.machine == machine
            and one.verdict != "contradictory"
            and part in (None, one.comparison.part)
        ]
        return sum(one.verdict == "hit" for one in counted), len(counted)

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "version": __version__,
            "targets": [one.as_dict() for one in self.judged],
            "totals": self.totals(),
        }


def scorecard(
    machines: Iterable[str] | None = None,
    *,
    bases: Mapping[str, Machine] | None = None,
    efforts: Mapping[str, Effort] = THOROUGH,
    folder: Path | None = None,
    workers: int | None = None,
    progress: bool = False,
) -> Scorecard:
    """Judge every simulated statement of the thesis about some machines.

    Parameters
    ----------
    machines
        Names; all by default.
    bases
        Machines to judge instead of the thesis' machines, by name.
    efforts
        How long the runs are, by machine.
    folder
        Where results of runs are kept, so that a second call is quick; None keeps none.
    workers
        Number of threads; all processors by default.
    progress
        Show a progress bar on standard error.
    """
    wanted = set(MACHINES) if machines is None else set(machines)
    comparisons = [one for one in read_comparisons().compared if one.machine in wanted]
    made = {name: (bases or {}).get(name) or MACHINES[name] for name in wanted}
    return Scorecard(
        evaluate(
            comparisons,
            made,
            efforts=efforts,
            folder=folder,
            workers=workers,
            progress="scorecard" if progress else None,
        )
    )


def evaluate(
    comparisons: Sequence[Comparison],
    bases: Mapping[str, Machine],
    *,
    efforts: Mapping[str, Effort],
    folder: Path | None = None,
    workers: int | None = None,
    progress: str | None = None,
) -> tuple[Judged, ...]:
    """Judge some comparisons on given machines; see ``scorecard``."""
    plans: list[list[tuple[Machine, list[Job]]]] = []
    for one in comparisons:
        machines = [] if one.not_computed else [with_settings(bases[one.machine], at) for at in one.at]
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
