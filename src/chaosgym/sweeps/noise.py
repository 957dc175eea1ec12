"""Label noise: how often a label changes under variations of a point that ought to leave it alone.

Points are drawn from a sweep and diagnosed again: from two other initial states (the mirror image of the state that
rest leads to, and half that state), with twice the cycles, and with 0.1 % in every parameter, at once with random signs
and one at a time. A nature that differs counts as changed; so does a largest peak force more than 10 % away, by itself.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.diagnosis import Diagnosis, default_tolerances
from chaosgym.diagnosis.diagnose import diagnose_alone
from chaosgym.diagnosis.type_rule import FORCE_CHANGE
from chaosgym.errors import DatasetError, ParameterError, SimulationError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.simulation import MotionState, parallel_map, rest_state
from chaosgym.sweeps.dataset import LabelledSweep

SHIFT = 1e-3
"""Share by which parameters are changed."""

INTERVAL = 1.96
"""Standard errors on either side of a share: 95 %."""


def label_noise(
    sweep: LabelledSweep, points: int, *, seed: int = 0, workers: int | None = None, progress: bool = False
) -> dict[str, Any]:
    """Measure how often labels of a sweep change.

    Parameters
    ----------
    sweep
        Where the points are drawn from, those that are periodic or chaotic.
    points
        How many.
    seed
        Of the draw, and of the signs of the shifts.
    workers, progress
        Number of threads; show a progress bar on standard error.

    Returns
    -------
    dict
        ``points``, ``seed``, ``budget`` and ``changes``: by variant the share of natures that changed with the half
        width of its 95 % interval, and the share of periodic points whose largest peak moved by more than 10 %.
    """
    plan = sweep.plan
    natures = sweep.column("nature")
    usable = np.flatnonzero((natures == "periodic") | (natures == "chaotic"))
    if not 1 <= points <= len(usable):
        raise DatasetError(f"points = {points} is out of range; allowed: 1 to {len(usable)}, the rows with a nature")
    rows = np.sort(np.random.default_rng(seed).choice(usable, points, replace=False))
    names = list(dict.fromkeys([*plan.fields, *default_tolerances(plan.machine)]))
    signs = np.random.default_rng([seed, 1]).choice((-1.0, 1.0), (points, len(names)))

    def changes(index: int) -> dict[str, tuple[bool, bool]] | None:
        row = int(rows[index])
        point = {name: float(column[0]) for name, column in plan.points(range(row, row + 1)).items()}
        return _changes(plan.machine_at(point), plan.budget, dict(zip(names, signs[index], strict=True)))

    found = parallel_map(changes, range(points), workers=workers, progress="label noise" if progress else None)
    known = [change for change in found if change is not None]
    variants = dict.fromkeys(name for change in known for name in change)
    return {
        "points": len(known),
        "seed": seed,
        "budget": plan.budget,
        "changes": {name: _share([change[name] for change in known if name in change]) for name in variants},
    }


def _changes(machine: Machine, budget: int, signs: dict[str, float]) -> dict[str, tuple[bool, bool]] | None:
    """By variant: whether the nature changed, and whether the largest peak of a periodic point moved."""
    try:
        truth = diagnose_alone(machine, budget=budget)
    except SimulationError:
        return None
    reached, bouncing = truth.run.final_state.coordinates, rest_state(machine).bouncing
    variants: dict[str, Callable[[], Diagnosis]] = {}

    def add(name: str, other: Machine, start: NDArray[np.float64] | None = None, cycles: int = budget) -> None:
        state = None if start is None else MotionState(start, bouncing)
        variants[name] = lambda: diagnose_alone(other, initial_state=state, budget=cycles)

    add("mirrored initial state", machine, -reached)
    add("half the initial state", machine, 0.5 * reached)
    add("twice the cycles", machine, cycles=2 * budget)
    moved = {name: getattr(machine, name) * (1.0 + sign * SHIFT) for name, sign in signs.items()}
    add("0.1 % in every parameter", with_settings(machine, moved))
    for name, value in moved.items():
        add(f"0.1 % in {name}", with_settings(machine, {name: value}))
    answers = {}
    for name, run in variants.items():
        try:
            answers[name] = _compare(truth, run())
        except (ParameterError, SimulationError):
            continue
    return answers


def _compare(truth: Diagnosis, other: Diagnosis) -> tuple[bool, bool]:
    peak, moved = truth.evidence["largest_peak"], other.evidence["largest_peak"]
    periodic = truth.nature == other.nature == "periodic"
    return truth.nature != other.nature, periodic and abs(moved - peak) > FORCE_CHANGE * min(moved, peak)


def _share(changes: list[tuple[bool, bool]]) -> dict[str, float]:
    nature, peak = np.mean(changes, axis=0)
    error = INTERVAL * float(np.sqrt(nature * (1.0 - nature) / len(changes)))
    return {"points": len(changes), "nature": float(nature), "half_interval": error, "largest_peak": float(peak)}
