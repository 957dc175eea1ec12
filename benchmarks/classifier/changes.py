"""Changes of regime inside one run, for monitors: peaks of a machine whose speed or clearance jumps while it runs.

A run settles, is recorded, and goes on from its state at another operating point: one tolerance away ("near"), or
anywhere in the range ("far"). Regular is what scatters by less than a third of the sensor's error without noise,
irregular what scatters by more than it; anything between is left out.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from chaosgym.diagnosis import default_tolerances
from chaosgym.errors import ChaosgymError
from chaosgym.machines import Machine
from chaosgym.series.stroboscopic import irregularity
from chaosgym.simulation import simulate
from chaosgym.sweeps import Axis, SweepPlan

SETTLE, BEFORE, AFTER, STATIONARY = 250, 150, 100, 400
"""Cycles that a run settles for, that are seen before and after the change, and of a run without one."""

SENSOR_ERROR = 3.0
"""Largest error of a peak [N]."""


@dataclass(frozen=True)
class Trace:
    """Peaks (n,) [N] as a sensor reads them; ``kind``: "stationary", "to irregular", "to regular"."""

    peaks: NDArray[np.float64]
    kind: str
    near: bool
    change: int


def traces(
    machine: Machine, axes: list[dict[str, Any]], count: int, seed: int, *, progress: bool = False
) -> list[Trace]:
    """``count`` traces of each kind of change, half of them near where such exist, and as many stationary ones."""
    generator = np.random.default_rng(seed)
    found: list[Trace] = []
    wanted = {("stationary", False): count} | {
        (kind, near): count // 2 for kind in ("to irregular", "to regular") for near in (True, False)
    }
    bar = tqdm(total=sum(wanted.values()), desc="changes", unit="trace", disable=not progress)
    for one, other, near in _pairs(machine, axes, generator):
        if not any(wanted.values()):
            break
        try:
            trace = _trace(one, other, near, wanted, generator)
        except ChaosgymError:
            continue
        if trace is not None:
            wanted[trace.kind, trace.near] -= 1
            found.append(trace)
            bar.update()
    bar.close()
    return found


def _pairs(
    machine: Machine, axes: list[dict[str, Any]], generator: np.random.Generator
) -> Iterator[tuple[Machine, Machine, bool]]:
    """Endless machines and where each jumps, near and far in turn."""
    plan = SweepPlan(
        machine,
        tuple(Axis(**{**axis, "count": None}) for axis in axes),
        "random",
        10**6,
        int(generator.integers(2**31)),
    )
    fields = (machine.speed_field, machine.clearance_field)
    tolerances = default_tolerances(machine)
    for row in range(len(plan)):
        point = {name: float(column[0]) for name, column in plan.points(range(row, row + 1)).items()}
        one = plan.machine_at(point)
        near = bool(row % 2)
        if near:
            field = fields[int(generator.integers(2))]
            other = plan.machine_at(
                point | {field: tolerances[field].at(point[field], float(generator.choice([-1, 1])))}
            )
        else:
            far = plan.points(range(len(plan) - row - 1, len(plan) - row))
            other = plan.machine_at(point | {field: float(far[field][0]) for field in fields})
        yield one, other, near


def _trace(
    one: Machine, other: Machine, near: bool, wanted: dict[tuple[str, bool], int], generator: np.random.Generator
) -> Trace | None:
    """The trace of a pair, if it is of a kind that is wanted."""
    before = simulate(one, BEFORE, transient=SETTLE)
    if _regularity(before.peak_force[:, 0]) != "regular":
        return None
    if wanted["stationary", False] > 0:
        more = simulate(one, STATIONARY - BEFORE, before.final_state)
        whole = np.concatenate([before.peak_force[:, 0], more.peak_force[:, 0]])
        return Trace(_read(whole, generator), "stationary", False, len(whole))
    if not any(number for (_, nearness), number in wanted.items() if nearness == near):
        return None
    after = simulate(other, AFTER, before.final_state)
    late = simulate(other, 64, after.final_state).peak_force[:, 0]
    regular, later = _regularity(after.peak_force[-64:, 0]), _regularity(late)
    if regular != later or regular == "between":
        return None
    kind = f"to {regular}"
    if wanted[kind, near] <= 0:
        return None
    peaks = np.concatenate([before.peak_force[:, 0], after.peak_force[:, 0]])
    return Trace(_read(peaks, generator), kind, near, BEFORE)


def _regularity(peaks: NDArray[np.float64]) -> str:
    scatter = irregularity(peaks[-64:])
    return "regular" if scatter < SENSOR_ERROR / 3.0 else "irregular" if scatter > SENSOR_ERROR else "between"


def _read(peaks: NDArray[np.float64], generator: np.random.Generator) -> NDArray[np.float64]:
    return np.asarray(np.maximum(peaks + SENSOR_ERROR * generator.uniform(-1.0, 1.0, len(peaks)), 0.0))
