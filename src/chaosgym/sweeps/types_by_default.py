"""Whether a coarse grid's points are typed by runs of their own, where nobody said, and how long that takes.

On a fine grid a type rests on the neighbours. Where the steps are wider than the tolerances it needs further runs. A
map is read for its types, so they are computed where that is expected to take less than a minute. A few points spread
over the plan are timed; what they give is kept.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from os import cpu_count
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

import numpy as np

from chaosgym.errors import ParameterError
from chaosgym.files import claimed
from chaosgym.simulation.parallel import number_of_workers, parallel_map
from chaosgym.sweeps.folder import PLAN_FILE, SWEEP, read_plan_file
from chaosgym.sweeps.label import full_type
from chaosgym.sweeps.plan import SweepPlan, spread

AFFORDABLE = 60.0
"""Seconds that types may take by default."""

TIMED = 24
"""Points that are timed, after one that warms up: types of one grid differ in cost by a factor of ten and more."""

ENOUGH = 4
"""Points after which timing ends if types are far from affordable, for these points are then of no use."""

FAR = 2.0
"""Multiple of what is affordable that is far from it."""

PATIENCE = 20.0
"""Processor time [s] after which no further point is timed, and above which the first one counts."""


class TimedTypes(NamedTuple):
    """Types of a few points by their rows, and the mean processor time of one [s], that of other programs left out."""

    known: Mapping[int, dict[str, Any]]
    seconds: float


class TypesByDefault(NamedTuple):
    """A plan with its choice, and the types that were timed for it; None where nothing was timed."""

    plan: SweepPlan
    timed: TimedTypes | None


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
        If the folder's plan can't be read, or it holds anything else: nothing is timed for a sweep that can't be kept.
    """
    if plan.sampling != "grid" or plan.type_reach():
        return TypesByDefault(plan, None)
    held = claimed(folder, PLAN_FILE, what=SWEEP) / PLAN_FILE
    if held.is_file():
        share = read_plan_file(held).get("full_types")
        return TypesByDefault(replace(plan, full_types=1.0) if share == 1.0 else plan, None)
    affordable = AFFORDABLE * (workers or cpu_count() or 1) / len(plan)
    typed = replace(plan, full_types=1.0)
    timed = timed_types(typed, workers, affordable)
    return TypesByDefault(typed if timed.seconds <= affordable else plan, timed)


def timed_types(plan: SweepPlan, workers: int | None = None, affordable: float = math.inf) -> TimedTypes:
    """Types of a few points of a plan that have one; fewer where they take long, far more than ``affordable`` [s]."""
    typed = np.flatnonzero(plan.with_full_type(range(len(plan))))
    rows = typed[spread(len(typed))[: TIMED + 1]].tolist()
    together = number_of_workers(workers)
    known, seconds, counted = dict[int, dict[str, Any]](), 0.0, 0
    for part in (rows[:1], *(rows[first : first + together] for first in range(1, len(rows), together))):
        begun = process_time()
        known |= _typed(plan, part, workers)
        took = process_time() - begun
        if part == rows[:1] and took <= PATIENCE:
            continue
        seconds, counted = seconds + took, counted + len(part)
        if seconds > PATIENCE or (counted >= ENOUGH and seconds > FAR * affordable * counted):
            break
    return TimedTypes(known, seconds / max(counted, 1))


def _typed(plan: SweepPlan, rows: list[int], workers: int | None) -> dict[int, dict[str, Any]]:
    """Types of some rows; none where there is no machine, of which the sweep says so in its row."""

    def one(row: int) -> dict[str, Any]:
        point = {name: float(column[0]) for name, column in plan.points(range(row, row + 1)).items()}
        try:
            return full_type(plan.machine_at(point), plan)
        except ParameterError:
            return {}

    return dict(zip(rows, parallel_map(one, rows, workers=workers), strict=True))
