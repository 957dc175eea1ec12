r"""The next change, and the cheapest one that suffices: phase VII of thesis 5.6, closed.

Candidates follow the thesis: less clearance, more damping, another speed, a stiffer member. Each is built and assessed
anew, so that its effect is simulated and not extrapolated: responses of Type II and III have no derivative to trust.

The cost of changing a field from a to b is its weight times |ln(b / a)|, so that halving costs as much as doubling;
changes of several fields add up.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

from tqdm import tqdm

from chaosgym.design.collective import assess_duty
from chaosgym.design.methodology import SERIES_SIZE, Assessment, Check
from chaosgym.diagnosis import default_tolerances
from chaosgym.errors import ParameterError, SimulationError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of, quantity_of, with_settings

CLEARANCE_FACTORS = (0.75, 0.5, 0.25)
DAMPING_FACTORS = (2.0, 4.0)
SPEED_FACTORS = (0.8, 0.9, 1.1)
SECTION_FACTORS = (1.1, 1.25)
"""Factors that are tried by default."""

SECTION_FIELDS = ("height", "rod_diameter")
"""Fields that make a member stiffer."""

REFINEMENTS = 3
"""Bisections between the change that suffices and the nominal value."""


@dataclass(frozen=True)
class Trial:
    """A changed machine and what the methodology says of it."""

    changes: Mapping[str, float]
    cost: float
    assessment: Assessment

    @property
    def meets(self) -> bool:
        """Whether the changed machine meets the criteria."""
        return self.assessment.verdict == "meets"

    @property
    def told(self) -> str:
        """The changes with their units, for people: "excitation frequency 15 Hz"."""
        machine = self.assessment.machine
        return ", ".join(f"{name} = {quantity_of(machine, name)}" for name in self.changes)

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        result = self.assessment.as_dict()
        kept = ("verdict", "evaluation", "checks")
        return {
            "changes": dict(self.changes),
            "cost": self.cost,
            "type": self.assessment.type,
            **{name: result[name] for name in kept},
        }


@dataclass(frozen=True)
class Improvement:
    """Outcome of a search.

    Attributes
    ----------
    suggestions
        Single changes, best first: those that meet the criteria by cost, then the others by how far they miss.
    best
        The cheapest change found that meets the criteria; None if none does.
    """

    suggestions: tuple[Trial, ...]
    best: Trial | None


def default_changes(machine: Machine) -> dict[str, tuple[float, ...]]:
    """Values worth trying, by field: less clearance, more damping, other speed, stiffer member."""
    factors: dict[str, tuple[float, ...]] = {machine.clearance_field: CLEARANCE_FACTORS}
    factors |= {name: DAMPING_FACTORS for name in default_tolerances(machine) if "damping" in name}
    factors[machine.speed_field] = SPEED_FACTORS
    factors |= {name: SECTION_FACTORS for name in SECTION_FIELDS if name in parameters_of(machine)}
    return {
        name: tuple(_rounded(getattr(machine, name) * factor, 4) for factor in row) for name, row in factors.items()
    }


def change_cost(machine: Machine, changes: Mapping[str, float], weights: Mapping[str, float] | None = None) -> float:
    """Cost of a set of changes: the sum of weight times |ln(new / old)|; a weight is 1 unless given."""
    weights = weights or {}
    total = 0.0
    for name, value in changes.items():
        nominal = getattr(machine, name)
        if nominal <= 0.0 or value <= 0.0:
            raise ParameterError(f"{name}: the cost of a change from {nominal:g} to {value:g} needs values above 0")
        total += weights.get(name, 1.0) * abs(math.log(value / nominal))
    return total


def improve(
    assessment: Assessment,
    changes: Mapping[str, Iterable[float]] | None = None,
    weights: Mapping[str, float] | None = None,
    *,
    series_size: int = SERIES_SIZE,
    most_pairs: int = 20,
    seed: int = 0,
    workers: int | None = None,
    progress: bool = False,
) -> Improvement:
    """Search the cheapest change with which a machine meets its criteria.

    Single changes are all tried; if none suffices, pairs of fields in the order of their cost. The one that suffices
    is then taken back towards the nominal value as far as it goes on to suffice.

    Parameters
    ----------
    assessment
        Of the machine as it is.
    changes
        Values to try, by field; ``default_changes`` if None.
    weights
        Cost weight by field; 1 if not given.
    series_size, seed, workers
        As for ``assess``.
    most_pairs
        Pairs that are tried at most.
    progress
        Show a progress bar on standard error.

    Raises
    ------
    ParameterError
        If a change names no field, or a weight is negative.
    """
    machine = assessment.machine
    nominal = getattr(machine, machine.speed_field)
    duty = {part.speed / nominal: part.share for part in assessment.collective}
    values = changes or default_changes(machine)
    for name, weight in (weights or {}).items():
        if name not in values or not weight >= 0.0:
            raise ParameterError(f"cost of {name} = {weight:g} is out of range; allowed: 0 or more, of a changed field")

    def attempt(change: Mapping[str, float]) -> Trial | None:
        try:
            changed = with_settings(machine, change)
            result = assess_duty(
                changed,
                assessment.region,
                assessment.criteria,
                duty,
                series_size=series_size,
                seed=seed,
                workers=workers,
            )
        except SimulationError:
            return None
        return Trial(dict(change), change_cost(machine, change, weights), result)

    singles = [{name: float(value)} for name, row in values.items() for value in row if _allowed(machine, name, value)]
    with tqdm(total=len(singles), desc="changes", disable=not progress, unit="machine") as bar:
        trials = []
        for change in singles:
            trials.append(attempt(change))
            bar.update()
        done = [trial for trial in trials if trial is not None]
        best = _cheapest(done)
        if best is None:
            pairs = sorted(
                ({**one, **other} for one, other in combinations(singles, 2) if one.keys() != other.keys()),
                key=lambda change: change_cost(machine, change, weights),
            )
            bar.total += len(pairs[:most_pairs])
            for change in pairs[:most_pairs]:
                trial = attempt(change)
                bar.update()
                if trial is not None and trial.meets:
                    best = trial
                    break
        if best is not None:
            bar.total += REFINEMENTS
            best = _taken_back(machine, best, attempt)
            bar.update(REFINEMENTS)
    return Improvement(tuple(sorted(done, key=_rank)), best)


def _allowed(machine: Machine, name: str, value: float) -> bool:
    """Whether a machine with the value can be built; an unknown field is an error."""
    if name not in parameters_of(machine):
        with_settings(machine, {name: value})
    try:
        with_settings(machine, {name: value})
    except ParameterError:
        return False
    return bool(value > 0.0) and getattr(machine, name) > 0.0


def _cheapest(trials: list[Trial]) -> Trial | None:
    return min((trial for trial in trials if trial.meets), key=lambda trial: trial.cost, default=None)


def _taken_back(machine: Machine, best: Trial, attempt: Any) -> Trial:
    """Bisect, in the logarithm, between the nominal machine and the change that suffices."""
    low, high = 0.0, 1.0
    full = {name: math.log(value / getattr(machine, name)) for name, value in best.changes.items()}
    for _ in range(REFINEMENTS):
        share = 0.5 * (low + high)
        trial = attempt({name: _rounded(getattr(machine, name) * math.exp(share * full[name])) for name in full})
        if trial is not None and trial.meets:
            best, high = trial, share
        else:
            low = share
    return best


def _rounded(value: float, digits: int = 3) -> float:
    """A change is an engineering figure."""
    return float(f"{value:.{digits}g}")


def _rank(trial: Trial) -> tuple[bool, float]:
    """Those that meet the criteria by cost, the others by the largest factor by which they miss."""
    if trial.meets:
        return False, trial.cost
    return True, max(_shortfall(check) for check in trial.assessment.checks)


def _shortfall(check: Check) -> float:
    if check.name == "reliability":
        return (1.0 - check.reached) / (1.0 - check.required)
    return check.required / max(check.reached, 1e-9)
