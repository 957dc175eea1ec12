"""Records of runs: one row of results per operating cycle, and the state from which it goes on."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.errors import SimulationError
from chaosgym.machines.machine import Machine

Array = NDArray[np.float64]


class MotionState(NamedTuple):
    """All that a run needs to go on, bit for bit, from the end of a cycle.

    ``coordinates`` (n_states,) are the states of the equations of motion, ``bouncing`` (3,) the side of the current
    episode of bouncing and the instants of its first and last touch [s] before now.
    """

    coordinates: Array
    bouncing: Array


@dataclass(frozen=True)
class CycleRecord:
    """What happened in each operating cycle; two columns are the two sides of the monitored joint.

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

    def __len__(self) -> int:
        return len(self.section)

    @property
    def time(self) -> Array:
        """Instants [s] of the samples of ``history`` from the first recorded cycle on, (n_cycles * samples,)."""
        if self.history is None:
            raise SimulationError("the run kept no time history; simulate with samples_per_cycle above 0")
        cycles, samples, _ = self.history.shape
        instants: Array = np.arange(cycles * samples) * (self.machine.cycle_period / samples)
        return instants

    def after(self, cycles: int) -> "CycleRecord":
        """Return the record without its first cycles."""
        return self._with_rows(lambda name: getattr(self, name)[cycles:])

    def until(self, cycles: int) -> "CycleRecord":
        """Return the record's first cycles; ``final_state`` stays that of the whole."""
        return self._with_rows(lambda name: getattr(self, name)[:cycles])

    def followed_by(self, later: "CycleRecord") -> "CycleRecord":
        """Return this record and the one that goes on from its final state, as one."""
        return later._with_rows(lambda name: np.concatenate([getattr(self, name), getattr(later, name)]))

    def _with_rows(self, rows: Callable[[str], Any]) -> "CycleRecord":
        changes: dict[str, Any] = {name: rows(name) for name in _PER_CYCLE if getattr(self, name) is not None}
        return replace(self, **changes)


_PER_CYCLE = tuple(field.name for field in fields(CycleRecord) if field.name not in ("machine", "final_state"))
