"""Whether a coarse grid's points are typed by runs of their own, where nobody said.

On a fine grid a type rests on the neighbours. Where the steps are wider than the tolerances it needs further runs. A
map is read for its types, so they are computed where that is expected to take less than a minute.
"""

from dataclasses import replace
from os import cpu_count
from pathlib import Path
from time import process_time
from typing import NamedTuple

import numpy as np

from chaosgym.sweeps.folder import PLAN_FILE, read_plan_file
from chaosgym.sweeps.label import full_type
from chaosgym.sweeps.plan import SweepPlan

AFFORDABLE = 60.0
"""Seconds that types may take by default."""

TIMED = 4
"""Points that are timed at the most, after one that warms up."""

PATIENCE = 3.0
"""Seconds after which no further point is timed."""


class TypesByDefault(NamedTuple):
    """A plan with its choice, and how long all types were expected to take [s]; None where nothing was timed."""

    plan: SweepPlan
    seconds: float | None


def with_affordable_types(plan: SweepPlan, folder: str | Path, workers: int | None = None) -> TypesByDefault:
    """Return the plan with a type of every point, if its grid needs runs of their own and these are affordable.

    The plan stays as it is where neighbours are points of the grid, and where points do not form a grid. A folder that
    holds a sweep keeps its choice, so that the same command resumes on a slower computer too.

    Parameters
    ----------
    plan
        A plan that asks for no full types.
    folder
        Of the sweep; it need not exist.
    workers
        Threads of the sweep; all processors by default.

    Raises
    ------
    DatasetError
        If the folder's plan can't be read.
    """
    if plan.sampling != "grid" or plan.type_reach():
        return TypesByDefault(plan, None)
    held = Path(folder) / PLAN_FILE
    if held.is_file():
        share = read_plan_file(held).get("full_types")
        return TypesByDefault(replace(plan, full_types=1.0) if share == 1.0 else plan, None)
    seconds = seconds_of_a_type(plan) * len(plan) / (workers or cpu_count() or 1)
    return TypesByDefault(replace(plan, full_types=1.0) if seconds <= AFFORDABLE else plan, seconds)


def seconds_of_a_type(plan: SweepPlan) -> float:
    """Mean processor time [s] of a few types, spread over the grid: that of other programs does not count."""
    rows = np.linspace(0, len(plan) - 1, TIMED + 2).round().astype(int)[1:].tolist()
    took = list[float]()
    for row in rows:
        begun = process_time()
        point = {name: float(column[0]) for name, column in plan.points(range(row, row + 1)).items()}
        full_type(plan.machine_at(point), plan)
        took.append(process_time() - begun)
        if sum(took) > PATIENCE:
            break
    return float(np.mean(took[1:] or took))
