r"""Search for the cheapest change with which a machine meets its criteria (phase VII of thesis 5.6).

Candidates follow the thesis: less clearance, more damping, another speed, a stiffer member; then preload, stiffness of
the contact and mass. Every value that is stated is assessed over the tolerances. Values between them, those that the
map, the life against speed and the sensitivities suggest, and pairs of fields are screened: a few machines of the
tolerances run for some cycles. Those that lie on the front of cost against life and robustness as screened are then
assessed like any other, so that no suggestion rests on a screening or an extrapolation: responses of Type II and III
have no derivative to trust.

Where nothing is judged, nothing says what suffices. The values that are stated are then assessed alone and compared by
type, by force and by the life beside the present one; none is called sufficient, and nothing is screened.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any, get_args

import numpy as np
from tqdm import tqdm

from chaosgym.arrays import Array
from chaosgym.design.bearing import BearingEvaluation, evaluate
from chaosgym.design.changes import (
    allowed,
    between,
    change_cost,
    default_changes,
    differing,
    distinct,
    part_of,
)
from chaosgym.design.checks import Check, enough
from chaosgym.design.collective import assess_duty
from chaosgym.design.methodology import SERIES_SIZE, Assessment
from chaosgym.design.runs import deviating, sobol_shares, worse_side
from chaosgym.design.trials import Improvement, Trial, force_of_machines, not_dominated
from chaosgym.errors import DesignError, ParameterError, SimulationError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.series import Type
from chaosgym.simulation import simulate
from chaosgym.simulation.parallel import parallel_map

SCREENED_MACHINES, SCREENED_CYCLES = 8, 60
"""Machines of the tolerances, and cycles before and while peaks are taken, that screen a candidate."""

MOST_PAIRS = 60
"""Pairs of fields that are screened at the most, by cost."""

MOST_VERIFIED = 8
"""Screened candidates that are assessed over the tolerances at the most."""

SPARE = 3
"""Of these, candidates beside the front of cost against life and robustness."""

REFINEMENTS = 3
"""Bisections between the change that suffices and the nominal value."""


def improve(
    assessment: Assessment,
    changes: Mapping[str, Iterable[float]] | None = None,
    weights: Mapping[str, float] | None = None,
    *,
    seeds: Sequence[Mapping[str, float]] = (),
    series_size: int = SERIES_SIZE,
    seed: int = 0,
    workers: int | None = None,
    progress: bool = False,
) -> Improvement:
    """Search the cheapest change with which a machine meets its criteria; without any, compare the changes.

    Every value of ``changes`` is assessed alone. Further candidates are screened, and those on the front of cost
    against life and robustness are assessed too. The cheapest one that suffices is then taken back towards the nominal
    value as far as it goes on to suffice.

    Parameters
    ----------
    assessment
        Of the machine as it is.
    changes
        Values to try, by field; ``default_changes`` if None.
    weights
        Cost weight by field; 1 if not given.
    seeds
        Further candidates to screen: changes of one field or of several.
    series_size, seed, workers
        As for ``assess``.
    progress
        Show a progress bar on standard error.

    Raises
    ------
    ParameterError
        If a change names no field, or a weight is negative.

    Examples
    --------
    >>> from chaosgym.design import Criteria, assess
    >>> from chaosgym.design.improve import improve
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=20.0)
    >>> found = assess(beam, criteria=Criteria(load_rating=60.0, life=5.0), series_size=2)
    >>> improvement = improve(found, {"excitation_frequency": [12.0]}, series_size=2)
    >>> found.verdict, improvement.suggestions[0].assessment.verdict
    ('fails', 'fails')
    """
    machine = assessment.machine
    nominal = getattr(machine, machine.speed_field)
    duty = {part.speed / nominal: part.share for part in assessment.collective}
    values = {name: tuple(row) for name, row in (default_changes(machine) if changes is None else changes).items()}
    for name, weight in (weights or {}).items():
        if name not in values or not weight >= 0.0:
            raise ParameterError(f"cost of {name} = {weight:g} is out of range; allowed: 0 or more, of a changed field")
    force = assessment.evaluation.force

    def attempt(change: Mapping[str, float]) -> Trial | None:
        try:
            changed = with_settings(machine, change)
            result = assess_duty(
                changed,
                assessment.region,
                assessment.criteria,
                duty,
                series_size=series_size,
                bending=None if assessment.bending is None else assessment.bending.bending,
                wear=None if assessment.wear is None else assessment.wear.wear,
                seed=seed,
                workers=workers,
            )
        except (SimulationError, ParameterError, DesignError):
            return None
        after = force_of_machines(result)
        return Trial(
            dict(change), change_cost(machine, change, weights, force), result, _lives(assessment, result, after), after
        )

    stated = [
        {name: float(value)} for name, row in values.items() for value in row if value != getattr(machine, name, None)
    ]
    singles: list[Mapping[str, float]] = [one for one in stated if allowed(machine, one, force)]
    proposed = [differing(machine, one) for one in (*seeds, *between(machine, values, force))]
    further = distinct([one for one in proposed if one and allowed(machine, one, force)], singles)
    pairs = distinct([{**a, **b} for a, b in combinations([*singles, *further], 2) if a.keys().isdisjoint(b)], [])
    pairs = sorted(pairs, key=lambda one: change_cost(machine, one, weights, force))[:MOST_PAIRS]
    candidates = [*further, *pairs] if assessment.checks else []
    with tqdm(total=len(singles), desc="changes", disable=not progress, unit="machine") as bar:
        trials = []
        for change in singles:
            trials.append(attempt(change))
            bar.update()
        chosen = _front_of_screened(assessment, candidates, weights, seed, workers, progress)
        bar.total += len(chosen) + REFINEMENTS
        for change in chosen:
            trials.append(attempt(change))
            bar.update()
        done = [trial for trial in trials if trial is not None]
        best = _cheapest(done)
        if best is not None:
            best = _taken_back(machine, best, attempt)
        bar.update(REFINEMENTS)
    if best is not None and all(trial is not best for trial in done):
        done.append(best)
    return Improvement(tuple(sorted(done, key=_rank)), best, len(candidates))


def _lives(present: Assessment, changed: Assessment, after: float) -> float:
    """Life in operation of a changed machine, with its force [N], in lives of the present one."""
    before = force_of_machines(present)
    if after == 0.0:
        return math.inf if before else 1.0
    slower = changed.cycle_period / present.cycle_period
    return float((before / after) ** present.criteria.life_exponent * slower)


def _front_of_screened(
    assessment: Assessment,
    candidates: Sequence[Mapping[str, float]],
    weights: Mapping[str, float] | None,
    seed: int,
    workers: int | None,
    progress: bool,
) -> list[Mapping[str, float]]:
    """Candidates that seem to suffice and that none beats in cost, life and robustness; else the longest-lived."""
    screened = _screened(assessment, candidates, seed, workers, progress)
    force = assessment.evaluation.force
    rows = [(-change_cost(assessment.machine, one, weights, force), *screened[k]) for k, one in enumerate(candidates)]
    least = assessment.criteria.machines_that_meet or 0.0
    lasting = 0.0 if assessment.criteria.missing("life") else 1.0
    likely = [k for k, row in enumerate(rows) if row[1] >= lasting and row[2] >= least]
    if not likely:
        best = sorted(range(len(rows)), key=lambda k: (-rows[k][2], -rows[k][1]))
        return [candidates[k] for k in best[: MOST_VERIFIED // 2]]
    by_cost = sorted(likely, key=lambda k: -rows[k][0])
    kept = [k for k, keep in zip(by_cost, not_dominated([rows[k] for k in by_cost]), strict=True) if keep]
    front = [kept[k] for k in sorted(set(np.linspace(0, len(kept) - 1, MOST_VERIFIED - SPARE).astype(int).tolist()))]
    others = [k for k in by_cost if k not in front]  # a screening may be wrong: the cheapest of the rest stand in
    return [candidates[k] for k in [*front, *others[: MOST_VERIFIED - len(front)]]]


def _screened(
    assessment: Assessment,
    candidates: Sequence[Mapping[str, float]],
    seed: int,
    workers: int | None,
    progress: bool,
) -> list[tuple[float, float]]:
    """Life in required lives, at most 100 of them, and share of machines that meet, from few short runs of each.

    Where no life is judged, it is in lives of the machine as it is, by the force alone.
    """
    if not candidates:
        return []
    present = force_of_machines(assessment) or 1.0
    region, criteria, exponent = assessment.region, assessment.criteria, assessment.criteria.life_exponent
    shares = sobol_shares(len(region), SCREENED_MACHINES, seed) if region else np.zeros((1, 0))

    def run(task: tuple[Mapping[str, float], Array]) -> BearingEvaluation | None:
        try:
            machine = deviating(with_settings(assessment.machine, task[0]), region, task[1])
            peaks = simulate(machine, SCREENED_CYCLES, transient=SCREENED_CYCLES).peak_force
        except (SimulationError, ParameterError):
            return None
        own = criteria.at(machine.cycle_period) if criteria.hours else criteria
        judged = evaluate([worse_side(peaks, exponent)], own, "")
        if own.life is None or own.missing("life"):
            return replace(judged, life=min((present / judged.force) ** exponent if judged.force else 1e6, 1e6))
        return replace(judged, life=min(judged.life / own.life, 1e6))

    relative = criteria if criteria.life is None else replace(criteria, life=1.0, hours=None)
    tasks = [(one, row) for one in candidates for row in shares]
    found = parallel_map(run, tasks, workers=workers, progress="screened" if progress else None)
    answers = []
    for k in range(len(candidates)):
        runs = found[k * len(shares) : (k + 1) * len(shares)]
        kept = [one for one in runs if one is not None]
        life = len(kept) / sum(1.0 / one.life for one in kept) if len(kept) == len(runs) else 0.0
        meets = sum(enough(one.life, one.reliability, relative) for one in kept) / len(runs)
        answers.append((min(life, 100.0), meets))
    return answers


def _cheapest(trials: list[Trial]) -> Trial | None:
    return min((trial for trial in trials if trial.meets), key=lambda trial: trial.cost, default=None)


def _taken_back(machine: Machine, best: Trial, attempt: Any) -> Trial:
    """Bisect, in the logarithm, between the nominal machine and the change that suffices."""
    low, high, full = 0.0, 1.0, dict(best.changes)
    for _ in range(REFINEMENTS):
        share = 0.5 * (low + high)
        trial = attempt({name: part_of(getattr(machine, name), value, share) for name, value in full.items()})
        if trial is not None and trial.meets:
            best, high = trial, share
        else:
            low = share
    return best


def _rank(trial: Trial) -> tuple[bool, tuple[float, ...]]:
    """Those that meet the criteria by cost, the others by the factors by which they miss, the largest one first.

    Where nothing is judged: by type, then by life.
    """
    if not trial.assessment.checks:
        return False, (get_args(Type).index(trial.assessment.type), -trial.life)
    if trial.meets:
        return False, (trial.cost,)
    return True, tuple(sorted((_shortfall(check) for check in trial.assessment.checks), reverse=True))


def _shortfall(check: Check) -> float:
    if check.name == "reliability":
        return (1.0 - check.reached) / (1.0 - check.required)
    return check.required / max(check.reached, 1e-9)
