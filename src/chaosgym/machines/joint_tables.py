"""Tables of the sets that a machine with several joints visits, made at the first visit, and runs by them.

tables = JointTables(sets, frequency, level, drive, static_force, step_phase)     # at one speed
outcome, done = tables.advance(stops, state, bouncing, arrays, ExactEvents())
"""

from threading import Lock

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import status
from chaosgym.core.compilation import call
from chaosgym.core.cycle import CycleArrays
from chaosgym.core.joints.batch import JointModel, displacement_weights
from chaosgym.core.joints.cycle import advance_joints, room_for
from chaosgym.core.joints.sets import put_sets, set_length
from chaosgym.core.joints.space import JointRun, new_space, work_space
from chaosgym.core.joints.tables import MOST_LEVELS, layout
from chaosgym.core.lanes import unset
from chaosgym.core.tangent import Tangents
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
        load = found.to_modal[:, len(self._static) :] @ self._static
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
