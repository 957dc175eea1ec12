"""Records of runs: one row of results per operating cycle, and the state from which it goes on."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.errors import ParameterError, SimulationError
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import suggestion


class MotionState(NamedTuple):
    """All that a run needs to go on, bit for bit, from the end of a cycle.

    ``coordinates`` (n_states,) are the states of the equations of motion, ``bouncing`` (3,) the side of the current
    episode of bouncing and the instants of its first and last touch [s] before now; (3m,) of m joints, all sides first.
    """

    coordinates: Array
    bouncing: Array


@dataclass(frozen=True)
class CycleRecord:
    """What happened in each operating cycle; two columns are the two sides of the monitored joint.

    A machine with m joints has 2m columns, which its ``sides`` name. Displacement, velocity and history are those of
    one joint: the one that the machine monitors, or the one with the largest force of the record; ``of_joint`` gives
    those of another.

    Attributes
    ----------
    machine : Machine
        What was simulated.
    section : (n_cycles, n_states)
        Stroboscopic section: the state at the start of each cycle.
    displacement, velocity : (n_cycles,)
        Stroboscopic displacement [m] and velocity [m/s] of the monitored joint.
    peak_force : (n_cycles, 2)
        Largest contact force of the cycle [N]; 0 without contact.
    impacts : (n_cycles, 2) int
        Contacts that began in the cycle.
    contact_fraction : (n_cycles, 2)
        Share of the cycle in contact.
    bounce_duration : (n_cycles, 2)
        Time [s] from the first touch of a surface to the beginning of its last contact before the other surface is
        touched: how long the joint bounced before sustained contact (thesis 5.3.2). Stands in the cycle in which the
        other surface is touched; 0 where no episode ends.
    final_state : MotionState
        Where the run ended; pass it as ``initial_state`` to go on.
    history : (n_cycles, samples_per_cycle, 3) or None
        Displacement [m], velocity [m/s] and contact force [N] (upper side positive) at equal intervals.
    peak_phase : (n_cycles, 2) or None
        Phase [rad] of the cycle at which each peak force acted; None for a machine whose contact stays in one place.
    peak_vector : (n_cycles, 2, 3) or None
        Components [N] of each peak force. On the slider: along the guide, up, sideways. On the housing of a ball
        joint: along the rod towards the slider, across it in its plane of swing, sideways.
    sensor_peak : (n_cycles, n_sensors) or None
        Largest force of the cycle [N] on each of the machine's ``sensors``; None for a machine without any.
    joint : int
        Number of the joint that is shown; 0 for a machine with one.
    chosen : str or None
        Its name, if ``of_joint`` chose it.
    motions : (n_cycles, 2m) or None
        Stroboscopic displacement and velocity of each of m joints; None for a machine with one.
    histories : (n_cycles, samples_per_cycle, 3m) or None
        ``history`` of each of m joints.
    operation : (n_cycles,) with a column for each field, or None
        Values of the machine's fields that changed from cycle to cycle, such as ``operation["speed"]``; None if none
        did. ``machine`` is then that of the last cycle.

    Examples
    --------
    >>> record = chaosgym.simulate(chaosgym.ImpactBeam(excitation_frequency=12.0), cycles=20, transient=200)
    >>> record
    <20 cycles of impact-beam>
    >>> record.peak_force.shape
    (20, 2)
    >>> float(record.after(10).peak_force.max().round(1))
    32.4
    """

    machine: Machine
    section: Array
    displacement: Array
    velocity: Array
    peak_force: Array
    impacts: NDArray[np.int64]
    contact_fraction: Array
    bounce_duration: Array
    final_state: MotionState
    history: Array | None = None
    peak_phase: Array | None = None
    peak_vector: Array | None = None
    sensor_peak: Array | None = None
    joint: int = 0
    chosen: str | None = None
    motions: Array | None = None
    histories: Array | None = None
    operation: NDArray[Any] | None = None

    def __len__(self) -> int:
        return len(self.section)

    def __repr__(self) -> str:
        return f"<{len(self)} cycles of {self.machine.name}>"

    @property
    def states(self) -> Array:
        """``section`` less how far free bodies have gone, on which no force depends, (n_cycles, n_states)."""
        from chaosgym.machines.ignorable import relative  # a simulation alone does without

        return relative(self.machine, self.section)

    @property
    def time(self) -> Array:
        """Instants [s] of the samples of ``history`` from the first recorded cycle on, (n_cycles * samples,)."""
        if self.history is None:
            raise SimulationError("the run kept no time history; simulate with samples_per_cycle above 0")
        cycles, samples, _ = self.history.shape
        if self.operation is None or self.machine.speed_field not in (self.operation.dtype.names or ()):
            return np.asarray(np.arange(cycles * samples) * (self.machine.cycle_period / samples))
        periods = self.machine.period_at(self.operation[self.machine.speed_field])
        begins = np.concatenate([[0.0], np.cumsum(periods)[:-1]])
        return np.asarray((begins[:, None] + periods[:, None] * np.arange(samples) / samples).ravel())

    @property
    def joint_name(self) -> str | None:
        """Name of the joint that is shown; None for a machine with one."""
        return None if self.motions is None else self.machine.joints[self.joint]

    @property
    def surface_force(self) -> Array:
        """Force [N] on each surface at the samples, less that on the opposite one: (n_cycles, samples, sides).

        Raises
        ------
        SimulationError
            If the run kept no time history.
        """
        every = self.history if self.histories is None else self.histories
        if every is None:
            raise SimulationError("the run kept no time history; simulate with samples_per_cycle above 0")
        force = every[:, :, 2::3]
        return np.stack([force, -force], axis=-1).reshape(*force.shape[:2], -1)

    @property
    def peaks(self) -> Array:
        """Peak force [N] of each cycle on the first side; on ``worst_side`` where there are several joints.

        It is what data sets keep and the classifier reads, (n_cycles,).
        """
        return np.asarray(self.peak_force[:, 0 if self.motions is None else self.worst_side])

    def of_joint(self, name: str | None = None) -> "CycleRecord":
        """Return the record with displacement, velocity and history of a joint.

        Without a name it is the joint that the machine monitors or, where that is left open, the one with the largest
        force of the record.

        Raises
        ------
        ParameterError
            If the machine has no joint of that name.
        """
        names = self.machine.joints
        if name is not None and name not in names:
            raise ParameterError(f"there is no joint {name!r}{suggestion(name, names)}")
        if self.motions is None:
            return self
        chosen, name = name, name or getattr(self.machine, "monitored", None)
        largest = int(np.argmax(self.peak_force.max(axis=0))) // 2 if len(self) else 0
        j = names.index(name) if name in names else largest
        return replace(
            self,
            joint=j,
            chosen=chosen,
            displacement=self.motions[:, 2 * j],
            velocity=self.motions[:, 2 * j + 1],
            history=None if self.histories is None else self.histories[:, :, 3 * j : 3 * j + 3],
        )

    @property
    def worst_side(self) -> int:
        """Column of the surface of the joint that is shown with the largest peak force; the first of equal ones."""
        first = 2 * self.joint
        forces = self.peak_force if self.motions is None else self.peak_force[:, first : first + 2]
        largest = forces.max(axis=0)
        return first + int(np.argmax(largest >= (1.0 - 1e-9) * largest.max()))

    def after(self, cycles: int) -> "CycleRecord":
        """Return the record without its first cycles."""
        return self._with_rows(lambda name: getattr(self, name)[cycles:])

    def until(self, cycles: int) -> "CycleRecord":
        """Return the record's first cycles; ``final_state`` stays that of the whole."""
        return self._with_rows(lambda name: getattr(self, name)[:cycles])

    def followed_by(self, later: "CycleRecord") -> "CycleRecord":
        """Return this record and the one that goes on from its final state, as one.

        Raises
        ------
        SimulationError
            If other fields changed from cycle to cycle in one than in the other.
        """
        return joined([self, later])

    def _with_rows(self, rows: Callable[[str], Any]) -> "CycleRecord":
        changes: dict[str, Any] = {name: rows(name) for name in _PER_CYCLE if getattr(self, name) is not None}
        return replace(self, **changes).of_joint(self.chosen)


def joined(records: Sequence[CycleRecord]) -> CycleRecord:
    """Return records, each of which goes on from the final state of the one before, as one."""
    if len({None if record.operation is None else record.operation.dtype for record in records}) > 1:
        raise SimulationError(
            "one record has fields that changed from cycle to cycle and another has not; allowed: the same fields"
        )
    return records[-1]._with_rows(lambda name: np.concatenate([getattr(record, name) for record in records]))


_PER_CYCLE = tuple(
    field.name for field in fields(CycleRecord) if field.name not in ("machine", "final_state", "joint", "chosen")
)
