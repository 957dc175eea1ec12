"""The scorecard's verdict on a statement, for a figure about it, from the same runs."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from chaosgym.machines import Machine
from thesis.cache import default_folder
from thesis.figures.computations import Computation, Data
from thesis.figures.figure import Finding, Parts
from thesis.figures.printed import comparison
from thesis.scorecard.evaluation import THESIS_MACHINES, evaluate
from thesis.scorecard.observation import THOROUGH
from thesis.statements import Comparison


@dataclass(frozen=True, kw_only=True)
class Scored:
    """One statement, judged as in the scorecard; its runs are kept where the scorecard keeps them.

    Gives ``hit``, ``value`` (what was found, with its unit) and ``notes`` on it, (): the last two are words.
    """

    comparison: Comparison
    machine: Machine

    def run(self, workers: int | None = None) -> Data:
        """Simulate what is not known yet, and judge."""
        machines = {self.machine.name: self.machine}
        (judged,) = evaluate([self.comparison], machines, efforts=THOROUGH, folder=default_folder(), workers=workers)
        return {
            "hit": np.array(judged.error <= 1.0),
            "value": np.array(judged.shown_value),
            "notes": np.array(judged.notes),
        }


def scored(*targets: str) -> Mapping[str, Computation]:
    """Parts of a figure: some statements, each under its name."""
    compared = {target: comparison(target) for target in targets}
    return {target: Scored(comparison=one, machine=THESIS_MACHINES[one.machine]) for target, one in compared.items()}


def agrees(parts: Parts, *targets: str) -> bool:
    """Whether all of some statements are hits."""
    return all(bool(parts[target]["hit"]) for target in targets)


def scored_finding(parts: Parts, target: str, printed: str, *, more: str = "", sensitivity: str = "") -> Finding:
    """A statement in words beside what the scorecard found, and ``more`` that the figure shows."""
    told = (str(parts[target][name]) for name in ("value", "notes"))
    here = "; ".join(part for part in (*told, more) if part)
    return Finding(printed, here, agrees(parts, target), (target,), sensitivity, scored=not more)
