"""Can a margin be learned? Exact margins of a dataset's periodic beams, and what trees make of the parameters.

A margin is how far the speed may move, as a share of it, before the proven orbit loses its stability; 6 % where it
keeps it. Trees learn its logarithm. Their interval is that of split conformal prediction (Lei et al., Journal of the
American Statistical Association 113, 2018): the 90 % quantile of the errors on the machines of the validation.
"""

import time
from typing import Any

import numpy as np
from tqdm import tqdm

from chaosgym.arrays import Array
from chaosgym.branches.margins import margins
from chaosgym.diagnosis import default_tolerances, find_periodic_orbit
from chaosgym.diagnosis.diagnose import diagnose_alone
from chaosgym.errors import ChaosgymError
from chaosgym.machines import Machine
from chaosgym.sweeps.dataset import LabelledSweep
from chaosgym.sweeps.plan import GOLDEN

REACH = 3.0
"""Tolerances of the speed up to which a margin is followed."""

LEAST = 1e-4
"""Smallest margin that counts as one."""

COVERAGE = 0.9


def exact_margin(machine: Machine, budget: int) -> tuple[float, Array, float] | None:
    """Margin of the speed as a share of it, figures of the orbit (4,), and processor time [s] of the margin alone.

    None unless the response is proven to be periodic.
    """
    try:
        verdict = diagnose_alone(machine, budget=budget)
        if verdict.status != "certified" or verdict.period is None:
            return None
        orbit = find_periodic_orbit(machine, verdict.evidence["final_state"], verdict.period)
        if orbit is None:
            return None
        field = machine.speed_field
        began = time.process_time()
        found = margins(machine, orbit, {field: default_tolerances(machine)[field]}, reach=REACH)
    except ChaosgymError:
        return None
    spent = time.process_time() - began
    speed = getattr(machine, field)
    ends = [abs(one.value / speed - 1.0) for one in found.margins if one.kind is not None]
    impacts = float(verdict.judged.impacts.sum(axis=1).mean())
    figures = [np.log(max(orbit.largest_multiplier, 1e-6)), impacts, verdict.evidence["largest_peak"], verdict.period]
    return min(ends, default=np.inf), np.array(figures), spent


def learned_margin(sweep: LabelledSweep, points: int, *, progress: bool = False) -> dict[str, Any]:
    """What is learned from the centres of a sweep's crosses, by the split of its machines."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    plan = sweep.plan
    centres = np.flatnonzero(sweep.column("status") == "certified")
    centres = centres[centres % 5 == 0]
    chosen = centres[np.argsort((np.arange(len(centres)) * GOLDEN) % 1.0)][:points]
    columns = {name: sweep.column(name) for name in plan.fields}
    rows, split = [], []
    for row in tqdm(chosen, desc="margins", disable=not progress):
        point = {name: float(values[row]) for name, values in columns.items()}
        found = exact_margin(plan.machine_at(point), plan.budget)
        if found is not None:
            rows.append((np.array(list(point.values())), *found))
            split.append(sweep.column("split")[row])
    parameters, margin, figures, seconds = (np.array(column) for column in zip(*rows, strict=True))
    most = REACH * default_tolerances(plan.machine)[plan.machine.speed_field].value
    target, part = np.log(np.clip(margin, LEAST, most)), np.array(split)
    train, validation, test = (part == name for name in ("train", "validation", "test"))
    told: dict[str, Any] = {
        "machines": len(rows),
        "margins_within_reach": float(np.isfinite(margin).mean()),
        "exact_milliseconds": {"median": 1e3 * float(np.median(seconds)), "mean": 1e3 * float(seconds.mean())},
    }
    for name, inputs in {"parameters": parameters, "and the orbit": np.hstack([parameters, figures])}.items():
        trees = HistGradientBoostingRegressor(max_iter=150, max_leaf_nodes=8, learning_rate=0.06, random_state=0)
        trees.fit(inputs[train], target[train])
        width = float(np.quantile(np.abs(trees.predict(inputs[validation]) - target[validation]), COVERAGE))
        missed = trees.predict(inputs[test]) - target[test]
        told[name] = {
            "r_squared": 1.0 - float(np.mean(missed**2) / target[test].var()),
            "interval_factor": float(np.exp(width)),
            "coverage": float(np.mean(np.abs(missed) <= width)),
        }
    return told
