"""The scorecard: every simulated statement of the thesis, judged.

Near, missed and not computed statements count as not hit. Statements that the text itself contradicts are shown and
left out of the ratio. What the thesis measured is judged apart.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from chaosgym.machines import Machine
from chaosgym.version import __version__
from thesis.scorecard.evaluation import THESIS_MACHINES, evaluate
from thesis.scorecard.firmness import Firmness, firmness_of
from thesis.scorecard.observation import THOROUGH, Effort
from thesis.scorecard.verdicts import COUNTED, Judged
from thesis.statements import read_comparisons, read_measured


@dataclass(frozen=True)
class Scorecard:
    """Every statement, judged.

    Attributes
    ----------
    judged
        Statements about simulations.
    firmness
        What is known of the neighbours, by machine.
    measured
        Statements about measurements, judged apart: no search is shown them, and no total counts them.
    """

    judged: tuple[Judged, ...]
    firmness: Mapping[str, Firmness] = field(default_factory=dict)
    measured: tuple[Judged, ...] = ()

    def totals(self) -> dict[str, dict[str, Any]]:
        """Return {machine: {"all": {hit, near, miss, contradictory, total}, "groups": {group: the same}, ...}}.

        Further "left_out": {hit, total} of statements whose figure a search did not see; "firm": {hit, total} of the
        statements that were asked of neighbours and that at least half of them hit, "expected": {mean, low, high} of
        the hits of a neighbour among these, both None if none was asked; and "exclusive": pairs of statements that
        exclude each other. What is not computed counts in the total alone, so it is no hit.
        """
        found: dict[str, dict[str, Counter[str]]] = {}
        for one in self.judged:
            groups = found.setdefault(one.comparison.machine, {})
            for group in (one.comparison.group, "all"):
                groups.setdefault(group, Counter())[one.verdict] += 1
        return {machine: self._totals(machine, groups) for machine, groups in found.items()}

    def _totals(self, machine: str, groups: Mapping[str, Counter[str]]) -> dict[str, Any]:
        counts = {
            group: {**{name: count[name] for name in COUNTED}, "total": count.total()}
            for group, count in groups.items()
        }
        known = self.firmness.get(machine)
        hits, total = known.left_out if known else (0, 0)
        return {
            "all": counts.pop("all"),
            "groups": counts,
            "left_out": {"hit": hits, "total": total},
            "firm": {"hit": len(known.firm), "total": len(known.neighbours)} if known else None,
            "expected": dict(zip(("mean", "low", "high"), known.expected, strict=True)) if known else None,
            "exclusive": [list(pair) for pair in known.exclusive] if known else [],
        }

    def share(self, one: Judged) -> float | None:
        """Share of the machine's neighbours that hit a statement; None if it is not known."""
        known = self.firmness.get(one.comparison.machine)
        return known.neighbours.get(one.comparison.id) if known else None

    def hit_rate(self, machine: str) -> tuple[int, int]:
        """Hits, and statements that count, of a machine."""
        counted = [one for one in self.judged if one.comparison.machine == machine and one.verdict != "contradictory"]
        return sum(one.verdict == "hit" for one in counted), len(counted)

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "version": __version__,
            "measured": [one.as_dict() for one in self.measured],
            "targets": [{**one.as_dict(), "neighbours": self.share(one)} for one in self.judged],
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
    unprinted: Mapping[str, float] | None = None,
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
    unprinted
        Conditions that are not in print, by name, in place of those of the table.
    """
    wanted = set(THESIS_MACHINES) if machines is None else set(machines)
    comparisons = [one for one in read_comparisons().compared if one.machine in wanted]
    made = {name: (bases or {}).get(name, THESIS_MACHINES[name]) for name in wanted}
    further = [one for one in read_measured().compared if one.machine in wanted]
    judged = evaluate(
        [*comparisons, *further],
        made,
        efforts=efforts,
        folder=folder,
        workers=workers,
        progress="scorecard" if progress else None,
        unprinted=unprinted,
    )
    count = len(comparisons)
    known = {name: firmness_of(machine) for name, machine in made.items()}
    firm = {name: one for name, one in known.items() if one is not None}
    return Scorecard(judged[:count], firm, judged[count:])
