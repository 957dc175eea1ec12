"""Batches: variants of one machine that move side by side in one compiled call.

batch = ImpactBeam().batch(256)
batch.start(0, machine)                  # from rest; the same for 1, 2, ...
batch.set_speeds(which, speeds)
cycles = batch.run(which, 5)             # on all processors

They differ in numbers, not in their joints or in how many modes they have. Each goes on from where it is, and moves as
``simulate`` moves it, bit for bit.
"""

from abc import ABC, abstractmethod
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array, Indices
from chaosgym.core import matrices, status
from chaosgym.core.batch import Motions, Settings, TablesOfMany, advance_beams
from chaosgym.core.compilation import call_on_threads
from chaosgym.core.cycle import CycleArrays
from chaosgym.core.varied import advance_varied_beams
from chaosgym.machines.integrators import ExactEvents


class BatchedMachine(Protocol):
    """What a batch asks of a machine; see ``Machine``."""

    @property
    def n_states(self) -> int:
        """Numbers of its state."""
        ...

    @property
    def n_velocities(self) -> int:
        """Those of them that are velocities."""
        ...

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of its joints; none if it has one."""
        ...

    def arrays(self, cycles: int, samples: int = 0) -> CycleArrays:
        """Return the arrays into which cycles are written."""
        ...

    def reduce(self) -> Any:
        """Return the model that the kernels integrate."""
        ...


class Cycles(NamedTuple):
    """What k machines did in n cycles; the last axis is the two sides, as in ``CycleRecord``.

    ``failed`` (k,) tells whose simulation failed; ``peak_force`` [N], ``impacts`` and ``bounce_duration`` [s]
    (k, n, sides) are zero there.
    """

    failed: NDArray[np.bool_]
    peak_force: Array
    impacts: NDArray[np.int64]
    bounce_duration: Array


def stacked(models: list[Any]) -> Any:
    """Batch of models: a model whose fields have one more axis in front."""
    return type(models[0])(*(np.array(values) for values in zip(*models, strict=True)))


def put(batch: Any, i: int, model: Any) -> None:
    """Write a model into place i of a batch."""
    for column, value in zip(batch, model, strict=True):
        column[i] = value


class CompiledBatch(ABC):
    """Machines that move in one compiled call.

    ``change``, ``set_speeds``, ``set_clearances`` and ``_advance`` know their kind.
    """

    def __init__(self, machine: BatchedMachine, count: int) -> None:
        integrator = ExactEvents()
        self._settings = Settings(integrator.step_phase, integrator.event_tolerance, integrator.event_budget)
        self._machine = machine
        self._columns = [(array.shape[1:], array.dtype, len(array)) for array in machine.arrays(1)]
        self._arrays: CycleArrays | None = None
        self._motions = Motions(np.zeros((count, machine.n_states)), np.zeros((count, 3 * max(1, len(machine.joints)))))
        self._scale = np.zeros_like(self._motions.coordinates)

    def __len__(self) -> int:
        return len(self._motions.bouncing)

    def start(self, i: int, machine: BatchedMachine) -> None:
        """Put a machine at rest into place i."""
        self._motions.coordinates[i] = 0.0
        self._motions.bouncing[i] = 0.0
        self._scale[i] = 0.0
        self.change(i, machine)

    def motion(self, i: int) -> tuple[Array, Array]:
        """Return copies of the coordinates and the bouncing of machine i, as in a ``MotionState``."""
        return self._motions.coordinates[i].copy(), self._motions.bouncing[i].copy()

    def kick(self, which: Indices, shares: Array) -> None:
        """Change the velocities of the machines ``which`` (k,) by ``shares`` (k, n_velocities) of their largest."""
        half = self._machine.n_velocities
        np.maximum(self._scale, np.abs(self._motions.coordinates), out=self._scale)
        self._motions.coordinates[which, half : 2 * half] += shares * self._scale[which, half : 2 * half]

    def run(self, which: Indices, cycles: int) -> Cycles:
        """Run the machines ``which`` (k,) for some cycles."""
        arrays, outcome = self._empty(len(which), cycles)
        self._advance(which, arrays, outcome)
        return self._cycles(arrays, outcome)

    def _empty(self, count: int, cycles: int) -> tuple[CycleArrays, Indices]:
        """Arrays and outcome for a number of machines and cycles; the next run may overwrite them."""
        if self._arrays is None or self._arrays.events.shape != (count, cycles):
            # columns that the machine doesn't write have no rows
            columns = (np.empty((count, cycles * rows, *shape), dtype) for shape, dtype, rows in self._columns)
            self._arrays = CycleArrays(*columns)
        return self._arrays, np.empty(count, np.int64)

    def _cycles(self, arrays: CycleArrays, outcome: Indices) -> Cycles:
        failed = outcome != status.OK
        results = Cycles(failed, arrays.peak_force.copy(), arrays.impacts.copy(), arrays.bounce_time.copy())
        if True in failed.tolist():
            for values in results[1:]:
                values[failed] = 0
        return results

    def branch(self, i: int, which: Indices) -> None:
        """Let the machines ``which`` (k,), which differ from machine i in speed alone, go on from its motion."""
        for values in self._motions:
            values[which] = values[i]

    @abstractmethod
    def change(self, i: int, machine: BatchedMachine) -> None:
        """Put another machine into place i, whose motion goes on."""

    @abstractmethod
    def set_speeds(self, which: Indices, speeds: Array) -> None:
        """Change the speeds of the machines ``which`` (k,) to ``speeds`` (k,), in the unit of their speed field."""

    @abstractmethod
    def set_clearances(self, which: Indices, clearances: Array) -> None:
        """Change the clearances of the machines ``which`` (k,) to ``clearances`` (k,) [m]."""

    @abstractmethod
    def _advance(self, which: Indices, arrays: CycleArrays, outcome: Indices) -> None:
        """Run the machines ``which`` (k,) in place; rows of ``arrays`` and ``outcome`` (k,) in that order."""


class KickedBatch(CompiledBatch):
    """Machines that are kicked and run for many cycles in one call."""

    @abstractmethod
    def run_kicked(self, which: Indices, kicks: Array) -> Cycles:
        """``kick`` the machines ``which`` (k,) by each of the shares (k, cycles, n_velocities) and run them a cycle."""


class VaryingBatch(CompiledBatch):
    """Machines that take along a small deviation each, at a speed that may change from cycle to cycle."""

    def __init__(self, machine: BatchedMachine, count: int) -> None:
        super().__init__(machine, count)
        self._deviations = np.ones((count, 1, machine.n_states))

    def start(self, i: int, machine: BatchedMachine) -> None:
        """Put a machine at rest into place i."""
        super().start(i, machine)
        self._deviations[i] = matrices.cos(1.0 + np.arange(self._deviations.shape[2]))

    def run_varied(self, which: Indices, speeds: Array) -> tuple[Cycles, Array]:
        """Run the machines ``which`` (k,) for a cycle at each of the ``speeds`` (k, cycles), in the speed field's unit.

        Returns
        -------
        (cycles, growth)
            ``growth`` (k, cycles) is the logarithm of what a small deviation grew by in each cycle.
        """
        arrays, outcome = self._empty(len(which), speeds.shape[1])
        growth = np.zeros((*speeds.shape, 1))
        self._vary(which, speeds, self._deviations, growth, arrays, outcome)
        return self._cycles(arrays, outcome), growth[:, :, 0]

    @abstractmethod
    def _vary(
        self, which: Indices, speeds: Array, vectors: Array, growth: Array, arrays: CycleArrays, outcome: Indices
    ) -> None:
        """As ``_advance``, with deviations ``vectors`` (N, 1, n_states) that grow by ``growth`` (k, cycles, 1)."""


class ModalImpactBatch(VaryingBatch):
    """Machines of a few modes and one gap; those that share a structure share its tables."""

    def __init__(self, machine: BatchedMachine, count: int) -> None:
        super().__init__(machine, count)
        model = machine.reduce()
        self._batch, self._regimes, self._tables = (stacked([part] * count) for part in _parts(model))
        self._machines: list[Any] = [machine] * count
        # tables live as long as the batch holds their address
        self._values: list[Array] = [model.tables.values] * count

    def __getstate__(self) -> dict[str, Any]:
        """State without addresses, which mean nothing in another process."""
        return vars(self) | {"_tables": self._tables._replace(address=None)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take over a state, wherever its tables lie."""
        vars(self).update(state)
        self._tables = self._tables._replace(address=np.array([values.ctypes.data for values in self._values]))

    def change(self, i: int, machine: BatchedMachine) -> None:
        """Put another machine into place i, whose motion goes on."""
        model = machine.reduce()
        for batch, part in zip((self._batch, self._regimes, self._tables), _parts(model), strict=True):
            put(batch, i, part)
        self._machines[i], self._values[i] = machine, model.tables.values

    def set_speeds(self, which: Indices, speeds: Array) -> None:
        """Change the excitation frequencies [Hz]."""
        self._batch.excitation_frequency[which] = speeds

    def set_clearances(self, which: Indices, clearances: Array) -> None:
        """Change the clearances [m]."""
        for i, clearance in zip(which.tolist(), clearances.tolist(), strict=True):
            self._batch.stops[i] = self._machines[i].stops_at(clearance)

    def _advance(self, which: Indices, arrays: CycleArrays, outcome: Indices) -> None:
        given = (self._batch, self._regimes, self._tables, which, self._motions, arrays, self._settings, outcome)
        call_on_threads(advance_beams, len(which), *given)

    def _vary(
        self, which: Indices, speeds: Array, vectors: Array, growth: Array, arrays: CycleArrays, outcome: Indices
    ) -> None:
        given = (self._batch, self._regimes, self._tables, which, speeds, self._motions, vectors, growth, arrays)
        call_on_threads(advance_varied_beams, len(which), *given, self._settings, outcome)


def _parts(model: Any) -> tuple[Any, Any, TablesOfMany]:
    """A model without the parts that are models themselves, and these: regimes and where its tables lie."""
    values = model.tables.values
    tables = TablesOfMany(model.tables.step_phase, model.tables.shortest, values.ctypes.data, np.array(values.shape))
    return model._replace(regimes=0.0, tables=0.0), model.regimes, tables
