"""Tables of the sets that a machine with several joints visits, made at the first visit, and runs by them.

One machine, or many side by side:

tables = JointTables(sets, frequency, level, drive, static_force, step_phase)     # at one speed
outcome, done = tables.advance(stops, state, bouncing, arrays, ExactEvents())
"""

import time
from threading import Lock
from typing import Any

import numpy as np

from chaosgym.arrays import Array, Indices
from chaosgym.core import status
from chaosgym.core.compilation import call, call_on_threads
from chaosgym.core.cycle import CycleArrays
from chaosgym.core.joints.batch import JointModel, advance_joint_machines, displacement_weights
from chaosgym.core.joints.cycle import advance_joints, room_for
from chaosgym.core.joints.sets import put_sets, set_length
from chaosgym.core.joints.space import JointRun, new_space, work_space
from chaosgym.core.joints.tables import MOST_LEVELS, layout
from chaosgym.core.lanes import unset
from chaosgym.core.matrices import product
from chaosgym.core.tangent import Tangents
from chaosgym.errors import ParameterError
from chaosgym.machines.batch import VaryingBatch, put, stacked
from chaosgym.machines.integrators import ExactEvents
from chaosgym.machines.joint_sets import PressedSets
from chaosgym.machines.modal_blocks import settled

MOST_BYTES = 500_000_000
"""Memory for the tables of a machine at one speed; when it is full they are made anew as they are visited."""

LIKELY = 12
"""Sets that are made at once at another speed or drive, those that were visited first."""


class JointTables:
    """Tables of a structure under one drive, and runs by them; several threads may run at once.

    Parameters
    ----------
    sets
        Of the structure.
    frequency
        Of the cycle [Hz].
    level, drive
        As of ``put_sets``.
    static_force : (n,)
        Constant modal force.
    step_phase
        Angle [rad] by which the fastest mode turns in the shortest interval.
    """

    def __init__(
        self, sets: PressedSets, frequency: float, level: float, drive: Array, static_force: Array, step_phase: float
    ) -> None:
        self._sets, self._static, self._step_phase = sets, static_force, step_phase
        self._level, self._drive, self.frequency = level, np.ascontiguousarray(drive), frequency
        m, n = sets.shape.shape
        of_row = call(layout, n, drive.shape[1], m, len(sets.sliders.joint), MOST_LEVELS)
        self._at = call(work_space, of_row, sets.radix, sets.sliders.joint)
        self._stiffness = np.concatenate([sets.stiffness, sets.sliders.springs[:, 0]])
        self._row, self._length = map(int, call(set_length, self._at))
        self._most = max(1, MOST_BYTES // (8 * self._length))
        self._lock = Lock()
        self._forget()

    def _forget(self) -> None:
        self._tables = np.empty(0)
        self._rows = np.full(self._sets.count, -1, np.int64)
        self._kept = 0

    def _make(self, code: int) -> None:
        """Make the tables of a set; arrays in which a run may still be are left as they are."""
        found = self._sets.of(code)
        load = product(found.to_modal[:, len(self._static) :], self._static)
        of_structure = (found.generator, found.to_modal, found.from_modal, found.lag, found.rest, found.drift)
        parts = (
            np.array(found.fastest),
            *of_structure,
            found.constants,
            *found.rubs,
            settled(found.generator, load)[0],
            load,
        )
        row = np.zeros(self._length)
        row[self._row : self._row + sum(part.size for part in parts)] = np.concatenate([part.ravel() for part in parts])
        driven = (self._step_phase, self.frequency, self._level, self._drive)
        call(put_sets, self._at, self._sets.shape, *driven, row)
        with self._lock:
            if self._rows[code] >= 0:
                return
            if self._kept == self._most:
                self._forget()
            begin = self._kept * self._length
            if begin == len(self._tables):
                tables = unset(min(max(2 * self._kept, 8), self._most) * self._length)
                tables[:begin] = self._tables
                self._tables = tables
            self._tables[begin : begin + self._length] = row
            rows = self._rows.copy()
            rows[code] = begin
            self._rows = rows
            self._kept += 1

    def provide(self, code: int, made: int) -> bool:
        """Make the tables of a set; False if so many, ``made`` since a cycle ended, are more than the memory holds."""
        if made > self._most:
            return False
        if self._kept == 0:
            # at another speed these sets were visited: they likely are at this one
            for likely in self._sets.visited(min(LIKELY, self._most - 1)):
                self._make(likely)
        self._make(code)
        return True

    def space(self, stops: Array) -> Array:
        """Work space of a run; ``stops`` (m, 2) are positions [m]."""
        sets = self._sets
        space: Array = call(
            new_space, self._at, sets.shape, stops, sets.springs, sets.dampers, sets.sliders.shape, sets.sliders.numbers
        )
        return space

    def model(self, own: Array) -> JointModel:
        """Return the machine that moves in a work space; it holds addresses, so tables and space must be kept."""
        rows, kept = self._rows, self._kept
        places = (self._tables.ctypes.data, kept, rows.ctypes.data, len(rows), own.ctypes.data)
        structure = self._at, self._sets.shape, self._stiffness
        return JointModel(*places, *structure, self._drive, self._level, self.frequency)

    def advance(
        self,
        stops: Array,
        state: Array,
        bouncing: Array,
        arrays: CycleArrays,
        integrator: ExactEvents,
        tangents: Tangents,
    ) -> tuple[int, int]:
        """Run as many cycles as ``arrays`` has rows; see ``Machine.run``. ``stops`` (m, 2) are positions [m]."""
        done, cycles, made, own = 0, len(arrays.section), 0, self.space(stops)
        weights = call(displacement_weights, self._stiffness, self.frequency)
        kept, rubs = room_for(self._at, bouncing, tangents), True if len(self._sets.sliders.joint) else None
        while True:
            part = CycleArrays(*(values[done:] for values in arrays))
            along = tangents._replace(log_growth=tangents.log_growth[done:])
            with self._lock:
                tables, rows = self._tables, self._rows
            run = JointRun(tables, own, self._at, 1.0 / self.frequency, integrator.event_tolerance / self._step_phase)
            motion = (state, bouncing, part, integrator.event_budget, along)
            outcome, finished, code = call(advance_joints, run, rows, weights, *motion, kept, rubs)
            done += finished
            made = 1 if finished else made + 1
            if outcome != status.NEEDS_SET or not self.provide(code, made):
                return outcome, min(done, cycles)


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
            call_on_threads(advance_joint_machines, ahead.size, self._batch, which, ahead, speeds, *moved)
            count = max(1, int(count * min(MAX_GROWTH, CALL_SECONDS / max(time.perf_counter() - began, 1e-9))))
            for k in ahead[outcome[ahead] == status.NEEDS_SET].tolist():
                made[k] = 1 if done[k] > before[k] else made[k] + 1
                i, tables = int(which[k]), self._tables[which[k]]
                tables.frequency = float(self._batch.frequency[i])
                if tables.provide(int(needed[k]), int(made[k])):
                    outcome[k] = status.OK
                    put(self._batch, i, tables.model(self._own[i]))
        self._speeds[which] = speeds[:, -1]
