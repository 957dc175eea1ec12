"""Machines of a few modes and several joints: tables of each set of pressed surfaces, made when it is first visited.

What friction does at a pressed surface, sticking or sliding to either side, makes a set of its own.

sets = PressedSets(stiffness, damping, shape, springs, dampers)     # of a structure, whatever drives it
tables = JointTables(sets, frequency, level, drive, static_force, step_phase)     # at one speed
outcome, done = tables.advance(stops, state, bouncing, arrays, ExactEvents())
"""

import itertools
import math
from threading import Lock
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.core import status
from chaosgym.core.compilation import call
from chaosgym.core.cycle import CycleArrays
from chaosgym.core.joints.batch import JointModel, displacement_weights
from chaosgym.core.joints.cycle import advance_joints, room_for
from chaosgym.core.joints.sets import put_sets, set_length
from chaosgym.core.joints.space import JointRun, new_space, work_space
from chaosgym.core.joints.tables import MOST_LEVELS, Rubs, layout, read_at_rest
from chaosgym.core.lanes import unset
from chaosgym.core.tangent import Tangents
from chaosgym.errors import ParameterError
from chaosgym.machines.integrators import ExactEvents
from chaosgym.machines.modal_blocks import largest_modulus, modal_blocks, settled

MOST_SETS = 1_000_000
"""Sets of pressed surfaces that a machine may have."""

MOST_BYTES = 500_000_000
"""Memory for the tables of a machine at one speed; when it is full they are made anew as they are visited."""

FRICTION_MODES = 3
"""What friction does at a pressed surface: it sticks, slides up or slides down."""

LIKELY = 12
"""Sets that are made at once at another speed or drive, those that were visited first."""


class Sliders(NamedTuple):
    """Joints with friction.

    Attributes
    ----------
    joint : (f,) int
        Which joints these are.
    shape : (f, n)
        Tangential displacement [kg^-1/2].
    friction, speed : (f,)
        Coefficient of friction; speed of the surfaces [m/s].
    springs : (f, 2)
        Tangential springs at the upper and the lower surface [N/m].
    """

    joint: NDArray[np.int64]
    shape: Array
    friction: Array
    speed: Array
    springs: Array

    @property
    def numbers(self) -> Array:
        """As the kernels take them, (f, 4)."""
        return np.column_stack([self.friction, self.springs, self.speed])


def no_sliders(modes: int) -> Sliders:
    """No friction, of a structure of some modes."""
    return Sliders(np.empty(0, np.int64), np.empty((0, modes)), np.empty(0), np.empty(0), np.empty((0, 2)))


class PressedSet(NamedTuple):
    """A structure with some surfaces pressed: blocks as in ``Regimes``, and where it rests per position of each.

    ``rest``, ``drift`` (m, 2n) are those of ``settled``; ``constants`` (m + 2f, m) what each channel reads then,
    counted from its surface where it presses; ``lag`` (m,) damper over spring [s] of those that act; ``rubs`` is what
    friction does.
    """

    generator: Array
    to_modal: Array
    from_modal: Array
    fastest: float
    rest: Array
    drift: Array
    constants: Array
    lag: Array
    rubs: Rubs


class PressedSets:
    """The sets of pressed surfaces of a structure, by number; each is made once.

    Parameters
    ----------
    stiffness : (n,)
        Squared natural angular frequencies of the structure free of contact [1/s^2]; 0 for the motion of a rigid body.
    damping : (n, n)
        Modal damping [1/s].
    shape : (m, n)
        Mass-normalised displacement of each joint [kg^-1/2].
    springs, dampers : (m, 2)
        Of the upper and the lower surface [N/m], [N s/m].
    two_sided : (m,) bool
        False for joints with an upper surface only.
    sliders
        Joints with friction.

    Raises
    ------
    ParameterError
        If there are more than ``MOST_SETS`` sets.
    """

    def __init__(
        self,
        stiffness: Array,
        damping: Array,
        shape: Array,
        springs: Array,
        dampers: Array,
        two_sided: Array,
        sliders: Sliders | None = None,
    ) -> None:
        self.stiffness, self.damping, self.shape = stiffness, damping, np.ascontiguousarray(shape)
        self.springs, self.dampers = springs, dampers
        differs = two_sided & ((springs[:, 0] != springs[:, 1]) | (dampers[:, 0] != dampers[:, 1]))
        self.sliders = no_sliders(len(stiffness)) if sliders is None else sliders
        self.modes = np.ones(len(shape), np.int64)
        self.modes[self.sliders.joint] = FRICTION_MODES
        self.radix = 1 + np.where(differs, 2, 1) * self.modes
        self.count = math.prod(self.radix.tolist())
        if self.count > MOST_SETS:
            raise ParameterError(
                f"{len(shape)} joints have {self.count:,} sets of pressed surfaces; allowed: {MOST_SETS:,} (fewer "
                "joints, or the same springs on both sides)"
            )
        self._made: dict[int, PressedSet] = {}

    def digits(self, code: int) -> list[int]:
        """Digit of each joint in the number of a set: 0 for none; 1 for the upper surface, or for either.

        With friction these are 1 to 3 for the upper surface: it sticks, slides up or slides down.
        """
        digits = []
        for radix in self.radix.tolist():
            digits.append(code % radix)
            code //= radix
        return digits

    def of(self, code: int) -> PressedSet:
        """Return the set of a number."""
        if code not in self._made:
            self._made[code] = self._make(code)
        return self._made[code]

    def visited(self, most: int) -> list[int]:
        """Numbers of the sets that were made first, so many at most."""
        return list(self._made)[:most]

    @property
    def fastest(self) -> float:
        """Largest modulus [1/s] of an eigenvalue, the upper surfaces pressed."""
        every = sum(math.prod(self.radix[:j].tolist()) for j in range(len(self.radix)))
        return self.of(every).fastest

    def _make(self, code: int) -> PressedSet:
        m, n = self.shape.shape
        digits = self.digits(code)
        pressed = [j for j in range(m) if digits[j]]
        springs, dampers, pushes = np.zeros(m), np.zeros(m), self.shape.copy()
        for j in pressed:
            surface = (digits[j] - 1) // self.modes[j]
            springs[j], dampers[j] = self.springs[j, surface], self.dampers[j, surface]
        held, weight, rate = self._friction(digits, springs, pushes)
        shapes = self.sliders.shape
        stiffness = np.diag(self.stiffness) + (pushes.T * springs) @ self.shape + (shapes.T * held) @ shapes
        damping = self.damping + (pushes.T * dampers) @ self.shape
        rigid = bool(np.any(self.stiffness == 0.0))
        generator, from_modal = modal_blocks(stiffness, damping, rigid, bool(rate.any()))
        to_modal: Array = np.asarray(np.linalg.inv(from_modal), dtype=np.float64)
        rest, drift = np.zeros((m, 2 * n)), np.zeros((m, 2 * n))
        for j in pressed:
            rest[j], drift[j] = settled(generator, to_modal[:, n:] @ (springs[j] * pushes[j]))
        constants = (self.shape @ from_modal[:n]) @ rest.T
        strains = (shapes @ from_modal[:n]) @ rest.T
        if rigid:
            constants[pressed, pressed] -= 1.0
        elif pressed:
            # how far a joint rests beyond its surface is small against how far the surface is away
            sticks = np.flatnonzero(held).tolist()
            some, pushed = (np.concatenate([a[pressed], shapes[sticks]]) for a in (self.shape, pushes))
            stiff = np.concatenate([springs[pressed], held[sticks]])
            compliance = (some / self.stiffness) @ pushed.T
            deep = -np.linalg.inv(np.eye(len(some)) + compliance * stiff)[:, : len(pressed)]
            constants[np.ix_(pressed, pressed)] = deep[: len(pressed)]
            strains[np.ix_(sticks, pressed)] = deep[len(pressed) :]
        lag = np.divide(dampers, springs, out=np.zeros(m), where=springs > 0.0)
        follow = np.zeros((2 * n, 2 * len(held)))
        for c in np.flatnonzero(held):
            follow[:, c] = settled(generator, to_modal[:, n:] @ (held[c] * shapes[c]))[0]
            follow[:, len(held) + c] = settled(generator, -follow[:, c])[0]
        rubs = Rubs(self.sliders.joint.astype(float), shapes, follow, weight, rate)
        shown = np.zeros((m + 2 * len(held), m))
        shown[:m] = constants
        for k, j in itertools.product(range(2 * len(held)), pressed):
            at_rest = constants[self.sliders.joint[k // 2], j], strains[k // 2, j]
            shown[m + k, j] = call(read_at_rest, generator, from_modal, self.shape, lag, rubs, k, *at_rest, drift[j])
        return PressedSet(generator, to_modal, from_modal, largest_modulus(generator), rest, drift, shown, lag, rubs)

    def _friction(self, digits: list[int], springs: Array, pushes: Array) -> tuple[Array, Array, Array]:
        """Tangential springs that hold (f,), and ``Rubs.weight``, ``Rubs.rate``; adds to what pressure pushes."""
        f = len(self.sliders.joint)
        held, weight, rate = np.zeros(f), np.zeros((2 * f, 2)), np.zeros(2 * f)
        for c, j in enumerate(self.sliders.joint.tolist()):
            if not digits[j]:
                continue
            surface, mode = divmod(digits[j] - 1, FRICTION_MODES)
            friction, spring = self.sliders.friction[c], self.sliders.springs[c, surface]
            if mode == 0:
                held[c] = spring
                weight[2 * c : 2 * c + 2] = [[friction * springs[j], -spring], [friction * springs[j], spring]]
            else:
                sign = 1.0 if mode == 1 else -1.0
                pushes[j] += sign * friction * self.sliders.shape[c]
                weight[2 * c], rate[2 * c] = (-friction * springs[j] / spring, sign), 1.0
        return held, weight, rate


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
