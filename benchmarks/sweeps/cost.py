"""Processor time of rows labelled again, against every axis, and what larger sweeps would take.

Rows are independent, so the time of a sweep is the mean cost times the points, over the processors. Joining the chunks
reads and writes them once more, a few seconds for each million rows.
"""

from collections.abc import Sequence
from time import thread_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from chaosgym.errors import DatasetError
from chaosgym.sweeps.dataset import LabelledSweep
from chaosgym.sweeps.label import label_point

PARTS = 3
"""Equal parts of the rows, by the value of a field."""

SIZES, CORES = (10**6, 10**9), (2, 64, 4096)
"""Points and processors of the extrapolation."""


def labelling_cost(sweep: LabelledSweep, points: int, *, seed: int = 0, progress: bool = False) -> dict[str, Any]:
    """Label some rows again on one thread and say what they cost.

    Returns
    -------
    dict
        ``seconds``: mean processor time of a point; ``points_per_second``, on one core; ``standard_error`` of
        ``seconds``; ``by``: the same by nature and by thirds of every varied field; ``hours``: of 10^6 and 10^9 points

    Raises
    ------
    DatasetError
        If there are not as many rows.
    """
    plan = sweep.plan
    if not PARTS <= points <= len(sweep.table):
        raise DatasetError(f"points = {points} is out of range; allowed: {PARTS} to {len(sweep.table)}, the rows")
    rows = np.sort(np.random.default_rng(seed).choice(len(sweep.table), points, replace=False))
    values = {name: sweep.column(name)[rows] for name in plan.fields}
    machines = [plan.machine_at({name: float(column[i]) for name, column in values.items()}) for i in range(points)]
    label_point(machines[0], plan.budget)  # compiles what is not yet compiled
    seconds = np.empty(points)
    for index, row in enumerate(tqdm(rows, desc="cost", unit="point", disable=not progress)):
        machines[index].reduce()
        began = thread_time()
        label_point(machines[index], plan.budget, signals=bool(plan.with_signals(range(row, row + 1))[0]))
        seconds[index] = thread_time() - began
    by: dict[str, Any] = {"nature": _by_name([str(name) for name in sweep.column("nature")[rows]], seconds)}
    by |= {name: _by_part(column, seconds) for name, column in values.items()}
    mean = float(seconds.mean())
    return {
        "machine": plan.machine.name,
        "points": points,
        "seconds": mean,
        "standard_error": float(seconds.std(ddof=1) / np.sqrt(points)),
        "points_per_second": 1.0 / mean,
        "by": by,
        "hours": {f"{size:.0e}": {str(cores): size * mean / cores / 3600.0 for cores in CORES} for size in SIZES},
    }


def _by_name(names: Sequence[str], seconds: NDArray[np.float64]) -> dict[str, float]:
    return {name: float(seconds[np.array(names) == name].mean()) for name in sorted(set(names))}


def _by_part(values: NDArray[np.float64], seconds: NDArray[np.float64]) -> dict[str, float]:
    """Mean cost of the lowest, middle and highest third, by their ranges."""
    parts = np.array_split(np.argsort(values, kind="stable"), PARTS)
    return {f"{values[part].min():.4g} to {values[part].max():.4g}": float(seconds[part].mean()) for part in parts}
