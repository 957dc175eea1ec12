"""How do many machines run side by side? Each goes on from where it is, at a speed of its own.

batch = batch_of(THESIS_IMPACT_BEAM, 256)
batch.start(0, machine)                  # from rest; the same for 1, 2, ...
batch.set_speeds(which, speeds)
cycles = batch.run(which, 5)             # one compiled call on all processors

Every machine moves as ``simulate`` moves it, bit for bit. All machines of a batch are variants of one: they differ in
numbers, not in the joints or in how many modes they have.
"""

from abc import ABC, abstractmethod
from functools import lru_cache
from threading import Lock
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from chaosgym.core import status
from chaosgym.core.batch import Motions, Settings, advance_beams, advance_rigid_beams
from chaosgym.core.compilation import call
from chaosgym.core.cycle import CycleArrays
from chaosgym.core.modal_impact import ModalImpactModel
from chaosgym.core.restitution import RestitutionModel
from chaosgym.errors import SimulationError
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.machines.slider_crank.kernels.batch import advance_cranks, advance_stepped_cranks
from chaosgym.machines.slider_crank.kernels.exact import SliderCrankModel
from chaosgym.machines.slider_crank.kernels.stepped import SteppedCrankModel
from chaosgym.machines.slider_crank.model import TABLES, KeptModel, ModelsBySpeed, models_by_speed
from chaosgym.simulation import CycleRecord, ExactEvents, MotionState, batch_arrays, rest_state, simulate

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

KEPT_MACHINES = 256
"""Machines at one speed that are kept: checking all fields of a new one takes longer than a look-up."""


class Cycles(NamedTuple):
    """What k machines did in n cycles; the last axis is the two sides, as in ``CycleRecord``.

    ``failed`` (k,) tells whose simulation failed; ``peak_force`` [N], ``impacts`` and ``bounce_duration`` [s]
    (k, n, sides) are zero there.
    """

    failed: NDArray[np.bool_]
    peak_force: Array
    impacts: NDArray[np.int64]
    bounce_duration: Array

    def of(self, chosen: NDArray[np.bool_]) -> "Cycles":
        """Return those of some of the machines."""
        return Cycles(self.failed[chosen], self.peak_force[chosen], self.impacts[chosen], self.bounce_duration[chosen])

    def until(self, end: int) -> "Cycles":
        """Return the first ``end`` cycles."""
        return Cycles(self.failed, self.peak_force[:, :end], self.impacts[:, :end], self.bounce_duration[:, :end])


@lru_cache(maxsize=KEPT_MACHINES)
def at_speed(machine: Machine, speed: float) -> Machine:
    """Return the machine at a speed, in the unit of its speed field."""
    return with_settings(machine, {machine.speed_field: speed})


class Batch(Protocol):
    """Machines that run side by side."""

    def __len__(self) -> int:
        """Return the number of machines."""
        ...

    def start(self, i: int, machine: Machine) -> None:
        """Put a machine at rest into place i."""
        ...

    def change(self, i: int, machine: Machine) -> None:
        """Put another machine into place i, whose motion goes on."""
        ...

    def set_speeds(self, which: Indices, speeds: Array) -> None:
        """Change the speeds of the machines ``which`` (k,) to ``speeds`` (k,), in the unit of their speed field."""
        ...

    def run(self, which: Indices, cycles: int) -> Cycles:
        """Run the machines ``which`` (k,) for some cycles."""
        ...

    def branch(self, i: int, which: Indices) -> None:
        """Let the machines ``which`` (k,), which differ from machine i in speed alone, go on from its motion."""
        ...


class SerialBatch:
    """Machines that run one after the other; ``records`` holds the last cycles of each that did not fail."""

    def __init__(self, count: int) -> None:
        self._machines: list[Machine | None] = [None] * count
        self._motions: list[MotionState | None] = [None] * count
        self.records: list[CycleRecord | None] = [None] * count

    def __len__(self) -> int:
        return len(self._machines)

    def start(self, i: int, machine: Machine) -> None:
        """Put a machine at rest into place i."""
        self._machines[i], self._motions[i] = machine, None

    def change(self, i: int, machine: Machine) -> None:
        """Put another machine into place i, whose motion goes on."""
        self._machines[i] = machine

    def set_speeds(self, which: Indices, speeds: Array) -> None:
        """Change the speeds of the machines ``which`` (k,) to ``speeds`` (k,), in the unit of their speed field."""
        for i, speed in zip(which.tolist(), speeds.tolist(), strict=True):
            machine = self._machines[i]
            assert machine is not None
            self._machines[i] = at_speed(machine, speed)

    def run(self, which: Indices, cycles: int) -> Cycles:
        """Run the machines ``which`` (k,) for some cycles."""
        shape = (len(which), cycles, 2)
        results = Cycles(np.zeros(len(which), np.bool_), np.zeros(shape), np.zeros(shape, np.int64), np.zeros(shape))
        for k, i in enumerate(which.tolist()):
            machine = self._machines[i]
            assert machine is not None
            try:
                record = simulate(machine, cycles, self._motions[i])
            except SimulationError:
                results.failed[k] = True
                continue
            self._motions[i], self.records[i] = record.final_state, record
            results.peak_force[k] = record.peak_force
            results.impacts[k] = record.impacts
            results.bounce_duration[k] = record.bounce_duration
        return results

    def branch(self, i: int, which: Indices) -> None:
        """Let the machines ``which`` (k,), which differ from machine i in speed alone, go on from its motion."""
        for k in which.tolist():
            self._motions[k] = self._motions[i]


def stacked(models: list[Any]) -> Any:
    """Batch of models: a model whose fields have one more axis in front."""
    return type(models[0])(*(np.array(values) for values in zip(*models, strict=True)))


def put(batch: Any, i: int, model: Any) -> None:
    """Write a model into place i of a batch."""
    for column, value in zip(batch, model, strict=True):
        column[i] = value


_one_call_at_a_time = Lock()
"""Some of numba's threading layers abort the process if two threads call parallel kernels at once."""


class _CompiledBatch(ABC):
    """Machines that move in one compiled call; ``change``, ``set_speeds`` and ``_advance`` know their kind."""

    def __init__(self, machine: Machine, count: int, integrator: ExactEvents | None = None) -> None:
        integrator = integrator or ExactEvents()
        self._settings = Settings(integrator.step_phase, integrator.event_tolerance, integrator.event_budget)
        rest = rest_state(machine)
        self._machine = machine
        self._motions = Motions(np.tile(rest.coordinates, (count, 1)), np.tile(rest.bouncing, (count, 1)))

    def __len__(self) -> int:
        return len(self._motions.bouncing)

    def start(self, i: int, machine: Machine) -> None:
        """Put a machine at rest into place i."""
        self._motions.coordinates[i] = 0.0
        self._motions.bouncing[i] = 0.0
        self.change(i, machine)

    def run(self, which: Indices, cycles: int) -> Cycles:
        """Run the machines ``which`` (k,) for some cycles."""
        arrays = batch_arrays(self._machine, len(which), cycles)
        outcome = np.empty(len(which), np.int64)
        with _one_call_at_a_time:
            self._advance(which, arrays, outcome)
        failed = outcome != status.OK
        results = Cycles(failed, arrays.peak_force, arrays.impacts, arrays.bounce_time)
        if failed.any():
            for values in results[1:]:
                values[failed] = 0
        return results

    def branch(self, i: int, which: Indices) -> None:
        """Let the machines ``which`` (k,), which differ from machine i in speed alone, go on from its motion."""
        for values in self._motions:
            values[which] = values[i]

    @abstractmethod
    def change(self, i: int, machine: Machine) -> None:
        """Put another machine into place i, whose motion goes on."""

    @abstractmethod
    def set_speeds(self, which: Indices, speeds: Array) -> None:
        """Change the speeds of the machines ``which`` (k,) to ``speeds`` (k,), in the unit of their speed field."""

    @abstractmethod
    def _advance(self, which: Indices, arrays: CycleArrays, outcome: Indices) -> None:
        """Run the machines ``which`` (k,) in place; rows of ``arrays`` and ``outcome`` (k,) in that order."""


class BeamBatch(_CompiledBatch):
    """Impact beams."""

    def __init__(self, machine: Machine, count: int) -> None:
        super().__init__(machine, count)
        model = machine.reduce()
        self._regimes = stacked([model.regimes] * count)
        self._batch = stacked([model._replace(regimes=0.0)] * count)

    def change(self, i: int, machine: Machine) -> None:
        """Put another machine into place i, whose motion goes on."""
        model = machine.reduce()
        put(self._regimes, i, model.regimes)
        put(self._batch, i, model._replace(regimes=0.0))

    def set_speeds(self, which: Indices, speeds: Array) -> None:
        """Change the excitation frequencies [Hz]."""
        self._batch.excitation_frequency[which] = speeds

    def _advance(self, which: Indices, arrays: CycleArrays, outcome: Indices) -> None:
        call(advance_beams, self._batch, self._regimes, which, self._motions, arrays, self._settings, outcome)


class RigidBeamBatch(BeamBatch):
    """Impact beams whose impacts take no time."""

    def _advance(self, which: Indices, arrays: CycleArrays, outcome: Indices) -> None:
        call(advance_rigid_beams, self._batch, self._regimes, which, self._motions, arrays, self._settings, outcome)


SPEED_FIELDS = ("bin_duration", "steps", "order")
"""Fields of a slider crank's model that change with its speed, apart from the tables."""


class CrankBatch(_CompiledBatch):
    """Slider cranks that ``has_propagators``."""

    def __init__(self, machine: Any, count: int) -> None:
        super().__init__(machine, count)
        model = machine.reduce()
        self._bins = model.acceleration.shape[1]
        self._batch = stacked([model._replace(**dict.fromkeys(TABLES, 0))] * count)
        self._models = [models_by_speed(machine)] * count
        self._speeds = np.full(count, np.nan)
        # the tables live as long as the batch holds their addresses
        self._kept: list[KeptModel | None] = [None] * count

    def change(self, i: int, machine: Any) -> None:
        """Put another machine into place i, whose motion goes on."""
        put(self._batch, i, machine.reduce()._replace(**dict.fromkeys(TABLES, 0)))
        self._models[i] = models_by_speed(machine)
        self._speeds[i] = np.nan
        self.set_speeds(np.array([i]), np.array([machine.crank_speed]))

    def set_speeds(self, which: Indices, speeds: Array) -> None:
        """Change the speeds of the cranks [rpm]."""
        changed = self._speeds[which] != speeds
        if not changed.any():
            return
        which, speeds = which[changed], speeds[changed]
        self._speeds[which] = speeds
        # machines of one make are often at one speed: each pair is looked up once
        distinct: dict[tuple[ModelsBySpeed, float], int] = {}
        pairs = zip(which.tolist(), speeds.tolist(), strict=True)
        row = [distinct.setdefault((self._models[i], speed), len(distinct)) for i, speed in pairs]
        kept = [models.at(speed) for models, speed in distinct]
        for name in SPEED_FIELDS:
            getattr(self._batch, name)[which] = np.array([getattr(each.model, name) for each in kept])[row]
        for k, name in enumerate(TABLES):
            getattr(self._batch, name)[which] = np.array([each.addresses[k] for each in kept])[row]
        for i, place in zip(which.tolist(), row, strict=True):
            self._kept[i] = kept[place]

    def _advance(self, which: Indices, arrays: CycleArrays, outcome: Indices) -> None:
        call(advance_cranks, self._batch, self._bins, which, self._motions, arrays, self._settings, outcome)


class SteppedCrankBatch(_CompiledBatch):
    """Slider cranks that need the stepper."""

    def __init__(self, machine: Machine, count: int) -> None:
        super().__init__(machine, count)
        self._machines = [machine] * count
        self._batch = stacked([machine.reduce()] * count)

    def change(self, i: int, machine: Machine) -> None:
        """Put another machine into place i, whose motion goes on."""
        self._machines[i] = machine
        put(self._batch, i, machine.reduce())

    def set_speeds(self, which: Indices, speeds: Array) -> None:
        """Change the speeds of the cranks [rpm]."""
        for i, speed in zip(which.tolist(), speeds.tolist(), strict=True):
            if getattr(self._machines[i], self._machine.speed_field) != speed:
                self.change(i, at_speed(self._machines[i], speed))

    def _advance(self, which: Indices, arrays: CycleArrays, outcome: Indices) -> None:
        call(advance_stepped_cranks, self._batch, which, self._motions, arrays, self._settings, outcome)


_COMPILED: dict[type, type[BeamBatch] | type[CrankBatch] | type[SteppedCrankBatch]] = {
    ModalImpactModel: BeamBatch,
    RestitutionModel: RigidBeamBatch,
    SliderCrankModel: CrankBatch,
    SteppedCrankModel: SteppedCrankBatch,
}
"""By model: who moves many at once. Machines of another model run one after the other."""


def batch_of(machine: Machine, count: int) -> Batch:
    """Return a batch of ``count`` variants of a machine, compiled if its model can be."""
    compiled = _COMPILED.get(type(machine.reduce()))
    return SerialBatch(count) if compiled is None else compiled(machine, count)
