"""The periodic orbit that a motion approaches, as Newton's method proves it."""

from dataclasses import replace

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit, find_periodic_orbit
from chaosgym.machines import Machine
from chaosgym.machines.ignorable import relative
from chaosgym.simulation import CycleRecord, simulate

NEAR = 0.05
"""How far Newton's method may move, relative to the size of the motion, to find the orbit that the motion nears."""


def proven_orbit(machine: Machine, record: CycleRecord, period: int) -> tuple[PeriodicOrbit | None, int]:
    """The orbit that a motion approaches, if Newton's method proves one of this period, and the cycles that took.

    It attracts or is neutral.
    """
    found = find_periodic_orbit(machine, record.final_state, period)
    if found is None or not found.proven or not _approaches(machine, record, found):
        return None, 8 * period
    return primitive(machine, found), 14 * period


def returning_period(section: Array, longest: int, seen: int = 4, back: float = 0.0) -> int:
    """Period, at most ``longest``, after which the last ``seen`` states of a section (cycles, n_states) come back best.

    A state that is nearer than ``back``, relative to the size of the motion, has come back.
    """
    states = section / np.ptp(section, axis=0).clip(1e-300)
    last = states[-seen:]
    periods = range(1, min(longest, len(states) // 2) + 1)
    gaps = np.array([matrices.norm(last - states[-seen - k : -k]) for k in periods])
    return int(np.argmax(gaps <= max(1.5 * float(gaps.min()), back))) + 1


def primitive(machine: Machine, orbit: PeriodicOrbit) -> PeriodicOrbit:
    """The orbit with its smallest period: a multiple of it closes too."""
    if orbit.period == 1:
        return orbit
    states = simulate(machine, orbit.period, orbit.state).states
    size = np.maximum(np.abs(orbit.state), 1e-9 * np.max(np.abs(orbit.state)))
    for divisor in (d for d in range(1, orbit.period) if orbit.period % d == 0):
        if np.max(np.abs(states[divisor] - orbit.state) / size) < 1e-4:
            shorter = find_periodic_orbit(machine, orbit.state, divisor)
            if shorter is not None and shorter.proven:
                return replace(shorter, distance=orbit.distance)
    return orbit


def _approaches(machine: Machine, record: CycleRecord, orbit: PeriodicOrbit) -> bool:
    """True if the motion is near the orbit, and nearer four periods later unless it is there already."""
    if orbit.distance > NEAR:
        return False
    if orbit.distance < 1e-6:
        return True
    later = relative(machine, simulate(machine, 4 * orbit.period, record.final_state).final_state.coordinates)
    now = relative(machine, record.final_state.coordinates) - orbit.state
    size = np.maximum(np.abs(orbit.state), 1e-9 * np.max(np.abs(orbit.state)))
    return bool(matrices.norm((later - orbit.state) / size) < matrices.norm(now / size))
