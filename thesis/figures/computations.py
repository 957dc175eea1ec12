"""Computations behind the figures: frozen descriptions that run, and give plain arrays.

A description holds everything that its result depends on, so that the result can be kept under it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.design.peak_impacts import peak_impacts, worn_side
from chaosgym.diagnosis import response_map
from chaosgym.errors import SimulationError
from chaosgym.machines import ImpactBeam, Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.series import two_step_test
from chaosgym.simulation import CycleRecord, simulate
from chaosgym.simulation.parallel import parallel_map
from thesis.scorecard.beam_runs import follow_modes
from thesis.scorecard.observation import READING_ERROR, THOROUGH, observe, plotted_peaks, read_dots

Data = Mapping[str, NDArray[Any]]
"""Arrays by name; every computation documents its own."""


class Computation(Protocol):
    """A frozen dataclass that describes a computation, and runs it."""

    def run(self, workers: int | None = None) -> Data:
        """Compute; ``workers`` threads, all processors by default."""
        ...


@dataclass(frozen=True, kw_only=True)
class History:
    """Time history of one machine.

    Gives ``time`` [s], ``displacement`` [m], ``velocity`` [m/s] and ``force`` [N] (upper side positive), (samples,), of
    all cycles in a row; ``section`` (cycles, 2) [m, m/s].
    """

    machine: Machine
    cycles: int
    transient: int
    samples: int = 720

    def run(self, workers: int | None = None) -> Data:
        """Simulate."""
        record = simulate(self.machine, self.cycles, transient=self.transient, samples_per_cycle=self.samples)
        return _history(record)


def _history(record: CycleRecord) -> dict[str, NDArray[Any]]:
    assert record.history is not None
    columns = record.history.reshape(-1, 3).T
    return {
        "time": record.time,
        **dict(zip(("displacement", "velocity", "force"), map(np.ascontiguousarray, columns), strict=True)),
        "section": np.column_stack([record.displacement, record.velocity]),
    }


@dataclass(frozen=True, kw_only=True)
class ForcePointHistory:
    """Motion of an impact beam where the shaker pushes; see ``follow_modes``.

    Gives what ``History`` gives, with ``displacement`` and ``velocity`` of the force point, and beside them
    ``tip_displacement`` of the kernel and ``tip_check``, the same by this route.
    """

    machine: ImpactBeam
    cycles: int
    transient: int
    samples: int = 6000

    def run(self, workers: int | None = None) -> Data:
        """Simulate, and follow the modes."""
        record = simulate(self.machine, self.cycles, transient=self.transient, samples_per_cycle=self.samples)
        data = _history(record)
        data["tip_displacement"] = data["displacement"]
        data["displacement"], data["velocity"], data["tip_check"] = follow_modes(record)
        return data


@dataclass(frozen=True, kw_only=True)
class Runs:
    """Peak forces of many machines, one run from rest each.

    Gives every field of ``fields`` (machines,), ``peaks`` (machines, cycles) [N] as the thesis plots them, ``nature``
    and ``period`` (machines,) as the scorecard reads them (period 0 where there is none), ``settle`` (machines,): the
    cycle from which the peaks repeat, -1 if they do not; ``impacts`` and ``contact`` (machines,): impacts a cycle and
    share of the cycle in contact, both sides together. A run that fails has NaN and the nature "failed".
    """

    machines: tuple[Machine, ...]
    fields: tuple[str, ...]
    cycles: int
    transient: int

    def run(self, workers: int | None = None) -> Data:
        """Simulate and judge each."""
        rows = parallel_map(self._row, self.machines, workers=workers)
        data: dict[str, NDArray[Any]] = {
            field: np.array([getattr(machine, field) for machine in self.machines]) for field in self.fields
        }
        for column, name in enumerate(("peaks", "nature", "period", "settle", "impacts", "contact")):
            data[name] = np.array([row[column] for row in rows])
        return data

    def _row(self, machine: Machine) -> tuple[Array, str, int, int, float, float]:
        try:
            record = simulate(machine, self.cycles, transient=self.transient)
        except SimulationError:
            return np.full(self.cycles, np.nan), "failed", 0, -1, np.nan, np.nan
        peaks = plotted_peaks(record)
        nature, period, settle = "undetermined", 0, -1
        if self.cycles >= 16:
            read = read_dots(peaks)
            nature, period = read.nature, read.period or 0
            repeats = two_step_test(peaks, sensor_error=READING_ERROR).settle_cycle
            settle = -1 if repeats is None else repeats
        impacts = float(record.impacts.sum(axis=1).mean())
        contact = float(record.contact_fraction.sum(axis=1).mean())
        return peaks, nature, period, settle, impacts, contact


@dataclass(frozen=True, kw_only=True)
class Types:
    """Natures and types over speed and clearance.

    Gives ``speed`` (m,) in the machine's unit, ``clearance`` (n,) [m], ``nature`` and ``type`` (m, n): natures as the
    scorecard reads them, types by the diagnosis of each point and its neighbourhood.
    """

    machine: Machine
    speeds: tuple[float, ...]
    clearances: tuple[float, ...]
    budget: int = 200
    reading_error: float = READING_ERROR

    def run(self, workers: int | None = None) -> Data:
        """Judge every point and its neighbourhood."""
        found = response_map(
            self.machine,
            self.speeds,
            self.clearances,
            budget=self.budget,
            sensor_error=self.reading_error,
            workers=workers,
        )
        speed, clearance = self.machine.speed_field, self.machine.clearance_field
        machines = [
            with_settings(self.machine, {speed: float(at), clearance: float(gap)})
            for at in found.speed
            for gap in found.clearance
        ]
        effort = THOROUGH[self.machine.name]._replace(budget=0)
        seen = parallel_map(lambda machine: observe(machine, effort).nature, machines, workers=workers)
        nature = np.array(seen).reshape(found.nature.shape)
        return {"speed": found.speed, "clearance": found.clearance, "nature": nature, "type": found.type}


@dataclass(frozen=True, kw_only=True)
class PeakImpacts:
    """Peak Impact Diagram: ``location`` (impacts,) in ``unit`` and ``force`` (impacts,) [N]."""

    machine: Machine
    cycles: int
    transient: int

    def run(self, workers: int | None = None) -> Data:
        """Simulate."""
        record = simulate(self.machine, self.cycles, transient=self.transient)
        diagram = peak_impacts(record, worn_side(record))
        return {"location": diagram.location, "force": diagram.force, "unit": np.array(diagram.unit)}
