"""Machines with several joints that move side by side."""

import time
from typing import Any

import numpy as np

from chaosgym.arrays import Array, Indices
from chaosgym.core import status
from chaosgym.core.compilation import call_side_by_side
from chaosgym.core.cycle import CycleArrays
from chaosgym.core.joints.batch import advance_joint_machines
from chaosgym.errors import ParameterError
from chaosgym.machines.batch import VaryingBatch, put, stacked

CALL_SECONDS, MAX_GROWTH = 0.2, 8.0
"""Duration [s] that calls of the kernel aim at, since Ctrl-C waits for their end; largest growth from call to call."""


class JointBatch(VaryingBatch):
    """Machines with several joints; each has tables of its own, up to ``MOST_BYTES``, made as it visits sets."""

    def __init__(self, machine: Any, count: int) -> None:
        super().__init__(machine, count)
        self._machines = [machine] * count
        self._speeds = np.full(count, machine.speed)
        self._load()

    def _load(self) -> None:
        self._tables = [machine.tables(self._settings.step_phase) for machine in self._machines]
        # the batch holds addresses of these
        self._own = [tables.space(each.stops) for tables, each in zip(self._tables, self._machines, strict=True)]
        self._batch = stacked([tables.model(own) for tables, own in zip(self._tables, self._own, strict=True)])

    def __getstate__(self) -> dict[str, Any]:
        """State without addresses, which mean nothing in another process."""
        return {name: value for name, value in vars(self).items() if name not in ("_tables", "_own", "_batch")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take over a state; its tables are made anew, to the last bit."""
        vars(self).update(state)
        self._load()

    def change(self, i: int, machine: Any) -> None:
        """Put another machine into place i, whose motion goes on.

        Raises
        ------
        ParameterError
            If friction is 0 in it where it is not in the others, or the other way round: their states differ.
        """
        if machine.rubbing != self._machines[i].rubbing:
            raise ParameterError("machines of a batch differ in which joints have friction; allowed: the same ones")
        self._machines[i], self._speeds[i] = machine, machine.speed
        self._tables[i] = machine.tables(self._settings.step_phase)
        self._own[i] = self._tables[i].space(machine.stops)
        put(self._batch, i, self._tables[i].model(self._own[i]))

    def set_speeds(self, which: Indices, speeds: Array) -> None:
        """Change the speeds [Hz]."""
        self._speeds[which] = speeds

    def set_clearances(self, which: Indices, clearances: Array) -> None:
        """Change the clearances of the monitored joint, or of the first one [m]."""
        for i, clearance in zip(which.tolist(), clearances.tolist(), strict=True):
            self._machines[i] = self._machines[i].at(clearance=clearance)
            self._own[i] = self._tables[i].space(self._machines[i].stops)
            self._batch.own[i] = self._own[i].ctypes.data

    def _advance(self, which: Indices, arrays: CycleArrays, outcome: Indices) -> None:
        speeds = np.repeat(self._speeds[which, None], arrays.events.shape[1], axis=1)
        self._vary(which, speeds, self._deviations[:, :0], np.zeros((*speeds.shape, 0)), arrays, outcome)

    def _vary(
        self, which: Indices, speeds: Array, vectors: Array, growth: Array, arrays: CycleArrays, outcome: Indices
    ) -> None:
        done, needed, made = np.zeros((3, *which.shape), np.int64)
        outcome[:] = status.OK
        until, count, cycles = 0, 1, speeds.shape[1]
        while (ahead := np.flatnonzero((outcome == status.OK) & (done < cycles))).size:
            if done[ahead].min() == until:
                until = min(until + count, cycles)
            before, began = done.copy(), time.perf_counter()
            moved = (self._motions, vectors, growth, arrays, self._settings, until, done, outcome, needed)
            call_side_by_side(advance_joint_machines, len(self), self._batch, which, ahead, speeds, *moved)
            count = max(1, int(count * min(MAX_GROWTH, CALL_SECONDS / max(time.perf_counter() - began, 1e-9))))
            for k in ahead[outcome[ahead] == status.NEEDS_SET].tolist():
                made[k] = 1 if done[k] > before[k] else made[k] + 1
                i, tables = int(which[k]), self._tables[which[k]]
                tables.frequency = float(self._batch.frequency[i])
                if tables.provide(int(needed[k]), int(made[k])):
                    outcome[k] = status.OK
                    put(self._batch, i, tables.model(self._own[i]))
        self._speeds[which] = speeds[:, -1]
