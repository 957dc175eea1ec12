r"""Where does a machine still answer, and where does it say that it can't? Every rung at every extreme.

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
from numpy.typing import NDArray

from chaosgym.errors import ChaosgymError
from chaosgym.machines import ImpactBeam, Machine, SliderCrank
from chaosgym.machines.impact_beam.parameters import modal_analysis
from chaosgym.machines.parameters import parameters_of, with_settings
from chaosgym.simulation import CycleRecord, ExactEvents, Integrator, RungeKutta4, parallel_map, simulate

Array = NDArray[np.float64]
Outcome = Literal["answer", "named error", "failure"]

CYCLES = 3
"""Cycles of each run, from rest."""

OVERSHOOT = 1e-6
"""Share by which rounding may exceed the bound."""

_UNDAMPED = {"damping_ratio": 0.0, "shaker_damping": 0.0, "contact_damping": 0.0}

EXTREMES: Mapping[str, Mapping[str, Mapping[str, Any]]] = {
    ImpactBeam.name: {
        "clearance 0": {"clearance": 0.0},
        "clearance 1e-9 m": {"clearance": 1e-9},
        "clearance 1 m": {"clearance": 1.0},
        "0.01 Hz": {"excitation_frequency": 0.01},
        "1000 Hz": {"excitation_frequency": 1000.0},
        "contact stiffness 1e3 N/m": {"contact_stiffness": 1e3},
        "contact stiffness 1e9 N/m": {"contact_stiffness": 1e9},
        "contact stiffness 1e12 N/m": {"contact_stiffness": 1e12},
        "contact damping 0": {"contact_damping": 0.0},
        "contact damping 1e4 N s/m": {"contact_damping": 1e4},
        "contact damping 1e6 N s/m": {"contact_damping": 1e6},
        "damping ratio 0": {"damping_ratio": 0.0},
        "damping ratio 1": {"damping_ratio": 1.0},
        "damping ratio 100": {"damping_ratio": 100.0},
        "shaker damping 0": {"shaker_damping": 0.0},
        "shaker damping 1e3 N s/m": {"shaker_damping": 1e3},
        "shaker damping 1e6 N s/m": {"shaker_damping": 1e6},
        "no damping at all": _UNDAMPED,
        "force 0": {"force_amplitude": 0.0},
        "force 1e6 N": {"force_amplitude": 1e6},
    },
    SliderCrank.name: {
        "clearance 0": {"slider_clearance": 0.0},
        "clearance 1e-9 m": {"slider_clearance": 1e-9},
        "clearance 20 mm": {"slider_clearance": 0.02},
        "1 rpm": {"crank_speed": 1.0},
        "5000 rpm": {"crank_speed": 5000.0},
        "contact stiffness 1e3 N/m": {"contact_stiffness": 1e3},
        "contact stiffness 1e10 N/m": {"contact_stiffness": 1e10},
        "contact stiffness 1e12 N/m": {"contact_stiffness": 1e12},
        "contact damping ratio 0": {"contact_damping_ratio": 0.0},
        "contact damping ratio 1": {"contact_damping_ratio": 1.0},
        "contact damping ratio 100": {"contact_damping_ratio": 100.0},
        "damping ratio 0": {"damping_ratio": 0.0},
        "damping ratio 1": {"damping_ratio": 1.0},
        "damping ratio 100": {"damping_ratio": 100.0},
        "friction 0.5": {"friction_coefficient": 0.5},
        "Hertzian contact": {"contact_law": "hertz"},
        "gravity 100 m/s2": {"gravity": 100.0},
    },
}
"""By machine: the extremes, as fields."""

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

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return dict(vars(self))


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
        return {"machine": self.machine, "cells": [cell.as_dict() for cell in self.cells]}


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
    ladder: Mapping[str, Any] = getattr(machine, "fidelity_ladder", {})
    runs = [
        Run(extreme, rung, _changed(machine, {"fidelity": rung}, fields), None)
        for extreme, fields in EXTREMES[machine.name].items()
        for rung in ladder
    ]
    default = str(getattr(type(machine)(), "rung", ""))
    runs += [
        Run("1 mode" if count == 1 else f"{count} modes", default, _changed(machine, {}, {"n_modes": count}), None)
        for count in MODES
    ]
    runs += [
        Run(f"{steps} steps a cycle", rung, _changed(machine, {"fidelity": rung}, {}), RungeKutta4(steps))
        for steps in COARSE_STEPS
        for rung in ladder
        if rung != "restitution"
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
    machine = record.machine
    if isinstance(machine, ImpactBeam):
        return _share_of_passive_bound(machine, record)
    assert isinstance(machine, SliderCrank)
    return float(record.peak_force.max()) / _crank_force_bound(machine)


def _share_of_passive_bound(beam: ImpactBeam, record: CycleRecord) -> float:
    modes = modal_analysis(beam)
    n = beam.n_modes
    states = np.vstack([record.section, record.final_state.coordinates])
    energy = np.sum(states[:, n:] ** 2 + (modes.angular_frequency * states[:, :n]) ** 2, axis=1)
    instants = np.arange(len(states)) * beam.cycle_period
    speed = beam.force_amplitude * float(np.linalg.norm(modes.force_shape)) * instants
    surface = math.sqrt(beam.contact_stiffness) + beam.contact_damping * float(np.linalg.norm(modes.tip_shape))
    force = surface * speed[1:]
    if beam.force_amplitude == 0.0:
        return 0.0 if not energy.any() and not record.peak_force.any() else math.inf
    return max(float(np.max(np.sqrt(energy[1:]) / speed[1:])), float(np.max(record.peak_force.max(axis=1) / force)))


def _crank_force_bound(crank: SliderCrank) -> float:
    rod = crank.density * crank.rod_length * math.pi / 4.0 * crank.rod_diameter**2
    mass = crank.slider_mass + crank.yoke_mass + crank.housing_mass + rod
    speed = 10.0 * (crank.crank_radius * crank.crank_rate + math.sqrt(crank.gravity * crank.rod_length))
    damping = crank.contact_damping * math.sqrt(mass / (crank.slider_mass + crank.yoke_mass))
    bound = (math.sqrt(crank.contact_stiffness * mass) + damping) * speed
    if crank.contact_law == "hertz":
        # k of the secant at the reference force; stiffer in proportion to the cube root of a larger force
        bound *= max(1.0, bound / crank.hertz_reference_force) ** 0.2
    return bound


def admissible_box(machine: type) -> dict[str, tuple[float, float] | tuple[str, ...]]:
    """Range or choices of every field of a machine."""
    return {name: about.choices or (about.low, about.high) for name, about in parameters_of(machine).items()}
