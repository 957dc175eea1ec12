"""Many machines side by side: each goes on from where it is, at a speed of its own.

batch = batch_of(ImpactBeam(), 256)
batch.start(0, machine)                  # from rest; the same for 1, 2, ...
batch.set_speeds(which, speeds)
cycles = batch.run(which, 5)             # one compiled call on all processors

Every machine moves as ``simulate`` moves it, bit for bit.
"""

from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from chaosgym.errors import SimulationError
from chaosgym.machines.batch import Cycles
from chaosgym.machines.machine import Machine
from chaosgym.simulation.record import CycleRecord, MotionState
from chaosgym.simulation.run import rest_state, simulate

__all__ = ["Batch", "Cycles", "KickedBatch", "SerialBatch", "VariedBatch", "batch_of"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


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

    def set_clearances(self, which: Indices, clearances: Array) -> None:
        """Change the clearances of the machines ``which`` (k,) to ``clearances`` (k,) [m]."""
        ...

    def run(self, which: Indices, cycles: int) -> Cycles:
        """Run the machines ``which`` (k,) for some cycles."""
        ...

    def branch(self, i: int, which: Indices) -> None:
        """Let the machines ``which`` (k,), which differ from machine i in speed alone, go on from its motion."""
        ...

    def motion(self, i: int) -> tuple[Array, Array]:
        """Return copies of the coordinates and the bouncing of machine i, as in a ``MotionState``."""
        ...

    def kick(self, which: Indices, shares: Array) -> None:
        """Change the velocities of the machines ``which`` (k,) by ``shares`` (k, n_states / 2) of their largest."""
        ...


@runtime_checkable
class VariedBatch(Protocol):
    """A batch whose machines take along a small deviation each, at a speed that changes from cycle to cycle."""

    def run_varied(self, which: Indices, speeds: Array) -> tuple[Cycles, Array]:
        """Run a cycle at each of the ``speeds`` (k, cycles); also the logarithms of what a deviation grew by."""
        ...


@runtime_checkable
class KickedBatch(Protocol):
    """A batch whose machines are kicked and run for many cycles in one call."""

    def run_kicked(self, which: Indices, kicks: Array) -> Cycles:
        """``kick`` the machines by each of the shares (k, cycles, n_states / 2) and run them a cycle."""
        ...


class SerialBatch:
    """Machines that run one after the other; ``records`` holds the last cycles of each that did not fail."""

    def __init__(self, count: int) -> None:
        self._machines: list[Any] = [None] * count
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
            self._machines[i] = self._machines[i].at(speed)

    def set_clearances(self, which: Indices, clearances: Array) -> None:
        """Change the clearances of the machines ``which`` (k,) to ``clearances`` (k,) [m]."""
        for i, clearance in zip(which.tolist(), clearances.tolist(), strict=True):
            self._machines[i] = self._machines[i].at(clearance=clearance)

    def run(self, which: Indices, cycles: int) -> Cycles:
        """Run the machines ``which`` (k,) for some cycles."""
        sides = len(self._machines[which[0]].sides) if len(which) else 2
        shape = (len(which), cycles, sides)
        results = Cycles(np.zeros(len(which), np.bool_), np.zeros(shape), np.zeros(shape, np.int64), np.zeros(shape))
        for k, i in enumerate(which.tolist()):
            try:
                record = simulate(self._machines[i], cycles, self._motions[i])
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

    def motion(self, i: int) -> tuple[Array, Array]:
        """Return copies of the coordinates and the bouncing of machine i, as in a ``MotionState``."""
        coordinates, bouncing = self._motions[i] or rest_state(self._machines[i])
        return coordinates.copy(), bouncing.copy()

    def kick(self, which: Indices, shares: Array) -> None:
        """Change the velocities of the machines ``which`` (k,) by ``shares`` (k, n_states / 2) of their largest."""
        for i, share in zip(which.tolist(), shares, strict=True):
            coordinates, bouncing = self.motion(i)
            record = self.records[i]
            section = np.abs(coordinates) if record is None else np.abs(record.section).max(axis=0)
            coordinates[len(share) :] += share * section[len(share) :]
            self._motions[i] = MotionState(coordinates, bouncing)


def batch_of(machine: Machine, count: int) -> Batch:
    """Return ``count`` variants of a machine, in one compiled call if its kernel can."""
    return machine.batch(count) or SerialBatch(count)
