"""Trials of a search for changes: each with its assessment, and what a search suggests of them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from chaosgym.design.changes import value_text
from chaosgym.design.fatigue import equivalent_force
from chaosgym.design.methodology import Assessment
from chaosgym.design.texts import listed
from chaosgym.plain import Result, plain


@dataclass(frozen=True)
class Trial(Result):
    """A changed machine and its assessment."""

    shows = (
        "changes cost type=assessment.type force_of_machines_N=force relative_life robustness "
        "verdict=assessment.verdict evaluation=assessment.evaluation checks=assessment.checks"
    )

    changes: Mapping[str, float]
    cost: float
    assessment: Assessment
    relative_life: float = math.nan
    """Life in operation over that of the machine as it is: by ``force``, the exponent, and the cycle's time."""
    force: float = math.nan
    """Equivalent force over the machines built [N], whatever the type, so that changes compare like with like."""

    @property
    def meets(self) -> bool:
        """Whether the changed machine meets the criteria."""
        return self.assessment.verdict == "meets"

    @property
    def life(self) -> float:
        """Life in required lives; in present ones where no life is judged."""
        required = self.assessment.criteria.life
        if required is None or not self.judges_life:
            return self.relative_life
        return self.assessment.evaluation.life_interval.low / required

    @property
    def judges_life(self) -> bool:
        """Whether a life is required, and a load rating stated, by which it follows from the force."""
        return not self.assessment.criteria.missing("life")

    @property
    def robustness(self) -> float:
        """Share of the machines in the tolerances that reach life and reliability by their own statistics.

        Where neither is required, the share of those that are periodic.
        """
        if self.assessment.criteria.judges_machines:
            return self.assessment.machines_that_meet
        runs = self.assessment.series.runs or (self.assessment.nominal,)
        return sum(run.nature == "periodic" for run in runs) / len(runs)

    @property
    def compared(self) -> str:
        """Type, force and life beside the machine as it is, for people."""
        assessed, lasts = self.assessment, self.relative_life
        life = f"life x{lasts:.3g} of the present one" if math.isfinite(lasts) else "no contact"
        force = f"equivalent {self.force:.1f} N over the machines built"
        return f"{self.told}: Type {assessed.type}, {force}, {life}, cost {self.cost:.2f}"

    @property
    def told(self) -> str:
        """The changes with their units, for people: "excitation frequency 15 Hz"; and that they end all contact."""
        machine = self.assessment.machine
        changes = ", ".join(f"{name} = {value_text(machine, name)}" for name in self.changes)
        return f"{changes} (the joint no longer touches)" if self.force == 0.0 else changes

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {**super().as_dict(), "life_in_required_lives": plain(self.life) if self.judges_life else None}


@dataclass(frozen=True)
class Improvement(Result):
    """Outcome of a search.

    Attributes
    ----------
    suggestions
        Changes that were assessed, best first: those that meet the criteria by cost, then the others by how far they
        miss. Where nothing is judged: by type, then by life.
    best
        The cheapest change found that meets the criteria; None if none does.
    screened
        Candidates that were screened besides.
    """

    shows = "best suggestions front=front_changes screened"

    suggestions: tuple[Trial, ...]
    best: Trial | None
    screened: int = 0

    @property
    def front(self) -> tuple[Trial, ...]:
        """Trials that no other beats in cost, life and robustness at once, by cost."""
        rows = [(-trial.cost, trial.life, trial.robustness) for trial in self.suggestions]
        trials = [trial for trial, keep in zip(self.suggestions, not_dominated(rows), strict=True) if keep]
        return tuple(sorted(trials, key=lambda trial: trial.cost))

    @property
    def front_changes(self) -> list[Mapping[str, float]]:
        """What each trial of the front changes."""
        return [trial.changes for trial in self.front]

    @property
    def told(self) -> str:
        """What was found if nothing suffices, for people: the change that misses least, and what it misses."""
        if not self.suggestions:
            return "no change to try is stated"
        nearest = self.suggestions[0]
        if nearest.assessment.verdict == "not judged":
            return (
                f"changes, {len(self.suggestions)} assessed, are compared by type and force, since nothing is judged; "
                f"first: {nearest.compared}"
            )
        missed = [f"{check.name} {check.told}" for check in nearest.assessment.checks if not check.met]
        return (
            f"none of {len(self.suggestions)} changes that were assessed meets all criteria; nearest: {nearest.told} "
            f"with {listed(missed) or 'a nominal response that is undetermined'}"
        )


def not_dominated(rows: Sequence[Sequence[float]]) -> list[bool]:
    """Whether no other row is as large in every column and larger in one; of equal rows the first stays.

    Examples
    --------
    >>> not_dominated([(1.0, 2.0), (2.0, 1.0), (1.0, 1.0), (2.0, 1.0)])
    [True, True, False, False]
    """

    def beaten(k: int) -> bool:
        return any(
            all(a >= b for a, b in zip(other, rows[k], strict=True)) and (tuple(other) != tuple(rows[k]) or j < k)
            for j, other in enumerate(rows)
            if j != k
        )

    return [not beaten(k) for k in range(len(rows))]


def force_of_machines(assessed: Assessment) -> float:
    """Equivalent force [N] over the machines built, each equally likely, and over the speeds of the duty."""
    exponent, forces, rates = assessed.criteria.life_exponent, list[float](), list[float]()
    for share, assessment in [(part.share, part.assessment) for part in assessed.collective] or [(1.0, assessed)]:
        runs = (assessment.nominal, *assessment.series.runs)
        forces.append(
            equivalent_force([equivalent_force(run.worse_side(exponent), exponent) for run in runs], exponent)
        )
        rates.append(share / assessment.machine.cycle_period)
    return equivalent_force(forces, exponent, np.array(rates) / sum(rates))
