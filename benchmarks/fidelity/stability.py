r"""The stability map: every rung of a machine at every extreme of its parameters.

An extreme sets one field, or two that belong together, to the end of what is admissible. A run there ends in

    answer        every value is finite, and the motion stays within a bound that physics sets
    named error   a ``ChaosgymError`` that says what stopped it, within its budget of events and steps
    failure       anything else

The bound of the beam is passivity: neither structure, shaker nor contact gives energy away, so the energy E of the
modes grows by the work of the force alone, and sqrt(2 E) by at most F |phi_f| a second. The crank is driven by a
motor that may give any power; there a force counts as bounded while it is below that of an impact of all moving masses
at ten times the speed of the crank pin.
"""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from benchmarks.fidelity.bounds import bounded_share
from benchmarks.fidelity.extremes import extremes_of
from chaosgym.errors import ChaosgymError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of, with_settings
from chaosgym.simulation import CycleRecord, ExactEvents, Integrator, RungeKutta4, simulate
from chaosgym.simulation.parallel import parallel_map

Outcome = Literal["answer", "named error", "failure"]

CYCLES = 3
"""Cycles of each run, from rest."""

OVERSHOOT = 1e-6
"""Share by which rounding may exceed the bound."""

MODES = (1, 2, 20, 40)
"""Numbers of modes that are tried besides those of the ladder."""

COARSE_STEPS = (10, 100, 1000, 10_000)
"""Steps a cycle at which a fixed-step method is tried."""


class Run(NamedTuple):
    """One run of the map: what is varied, by which model or method, and the machine."""

    extreme: str
    model: str
    machine: Callable[[], Machine]
    integrator: Integrator | None


@dataclass(frozen=True, kw_only=True)
class StabilityCell:
    """How one run ended.

    Attributes
    ----------
    extreme, model
        Row and column of the map.
    outcome
        "answer", "named error" or "failure".
    detail
        The error's message; empty for an answer.
    largest_peak
        Largest contact force [N], None without an answer.
    share_of_bound
        Largest ratio of motion or force to its physical bound, None without an answer.
    seconds
        Processor time of the run.
    """

    extreme: str
    model: str
    outcome: Outcome
    detail: str
    largest_peak: float | None
    share_of_bound: float | None
    seconds: float


@dataclass(frozen=True)
class StabilityMap:
    """Every extreme of a machine by every model; ``cells`` row by row."""

    machine: str
    cells: tuple[StabilityCell, ...]

    @property
    def extremes(self) -> tuple[str, ...]:
        """Rows of the map."""
        return tuple(dict.fromkeys(cell.extreme for cell in self.cells))

    @property
    def models(self) -> tuple[str, ...]:
        """Columns of the map."""
        return tuple(dict.fromkeys(cell.model for cell in self.cells))

    def count(self, outcome: Outcome) -> int:
        """Return the number of runs that ended so."""
        return sum(cell.outcome == outcome for cell in self.cells)

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {"machine": self.machine, "cells": [dict(vars(cell)) for cell in self.cells]}


def stability_map(machine: Machine, *, workers: int | None = None, progress: bool = False) -> StabilityMap:
    """Run a machine at every extreme, on every rung of its ladder.

    Parameters
    ----------
    machine
        What the extremes start from; its own rung is replaced.
    workers
        Number of threads; all processors by default.
    progress
        Show a progress bar on standard error.
    """
    cells = parallel_map(try_run, runs_of(machine), workers=workers, progress="stability" if progress else None)
    return StabilityMap(machine.name, tuple(cells))


def runs_of(machine: Machine) -> list[Run]:
    """All runs of the map."""
    ladder = machine.fidelity_ladder
    fixed = [rung for rung in ladder if with_settings(machine, {"fidelity": rung}).moving.fixed_steps]
    runs = [
        Run(extreme, rung, _changed(machine, {"fidelity": rung}, fields), None)
        for extreme, fields in extremes_of(machine).items()
        for rung in ladder
    ]
    default = type(machine)().rung or "as it is"
    runs += [
        Run("1 mode" if count == 1 else f"{count} modes", default, _changed(machine, {}, {"n_modes": count}), None)
        for count in (MODES if "n_modes" in parameters_of(machine) else ())
    ]
    runs += [
        Run(f"{steps} steps a cycle", rung, _changed(machine, {"fidelity": rung}, {}), RungeKutta4(steps))
        for steps in COARSE_STEPS
        for rung in fixed
    ]
    runs += [
        Run("longest exact steps", rung, _changed(machine, {"fidelity": rung}, {}), ExactEvents(step_phase=1.0))
        for rung in ladder
    ]
    return runs


def _changed(machine: Machine, rung: Mapping[str, Any], fields: Mapping[str, Any]) -> Callable[[], Machine]:
    return lambda: with_settings(with_settings(machine, rung), fields)


def try_run(run: Run) -> StabilityCell:
    """Make the machine, run it, and judge how that ended."""
    start = time.thread_time()
    outcome: Outcome = "answer"
    detail, peak, share = "", None, None
    try:
        record = simulate(run.machine(), CYCLES, integrator=run.integrator)
        share = share_of_bound(record)
        peak = float(record.peak_force.max())
        if not share <= 1.0 + OVERSHOOT:
            outcome, detail = "failure", f"{share:.3g} times the physical bound"
            peak = share = None
    except ChaosgymError as error:
        outcome, detail = "named error", f"{type(error).__name__}: {str(error).split(';')[0]}"
    except Exception as error:
        outcome, detail = "failure", f"{type(error).__name__}: {error}"
    return StabilityCell(
        extreme=run.extreme,
        model=run.model,
        outcome=outcome,
        detail=detail,
        largest_peak=peak,
        share_of_bound=share,
        seconds=time.thread_time() - start,
    )


def share_of_bound(record: CycleRecord) -> float:
    """Largest ratio of a run from rest to its physical bound; infinite where a value is not finite."""
    values = (record.section, record.final_state.coordinates, record.peak_force, record.contact_fraction)
    if not all(np.all(np.isfinite(value)) for value in values):
        return math.inf
    states = np.vstack([record.section, record.final_state.coordinates])
    return bounded_share(record.machine, states, record.peak_force)
