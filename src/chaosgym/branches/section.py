r"""Where the section of a stroboscopic map lies best: far from contacts.

An orbit is one whatever the phase at which the map takes its state, and so are its multipliers. But while a surface
presses, the state turns within the duration of a contact: orbits of a branch that meets the section there lie far from
each other, and steps along it are short. The section then moves to the middle of the longest flight.
"""

import numpy as np

from chaosgym.branches.orbit_family import NotFollowedError, OrbitFamily
from chaosgym.branches.orbit_point import OrbitPoint
from chaosgym.core import status
from chaosgym.diagnosis.periodic_orbit import PRECISE
from chaosgym.errors import ParameterError, SimulationError

SAMPLES = 256
"""Instants of a cycle at which it is seen whether a surface presses."""

NEAR = 0.25
"""Distance from a contact, in lengths of the longest flight, at which the section moves."""


def better_section(family: OrbitFamily, point: OrbitPoint) -> tuple[OrbitFamily, OrbitPoint]:
    """The family and an orbit of it, on another section where a contact is near, which machines of one gap have."""
    phase = _phase_away_from_contacts(family, point)
    if phase is None:
        return family, point
    try:
        x, tangent = family.carried(point, phase)
        other = family.at_phase(phase)
        return other, other.solve(x, tangent)
    except (SimulationError, ParameterError, NotFollowedError):
        return family, point


def _phase_away_from_contacts(family: OrbitFamily, point: OrbitPoint) -> float | None:
    """Middle of the longest flight, in cycles after the start of the period; None if the section lies well."""
    machine = family.machine_at(point.x[-1])
    if machine.section_at(0.0) is None or not any(point.impacts):
        return None
    arrays, period = machine.arrays(family.period, SAMPLES), family.period
    outcome, _ = machine.run(family.state(point.x), np.zeros(3), arrays, PRECISE)
    if outcome != status.OK:
        return None
    pressed = np.flatnonzero(arrays.history[:, :, 2].ravel() != 0.0)
    total = period * SAMPLES
    if len(pressed) == 0:
        return None
    flights = np.diff(pressed, append=pressed[0] + total)
    longest = int(np.argmax(flights))
    if min(pressed[0], total - pressed[-1]) >= NEAR * flights[longest]:
        return None
    return float((point.phase + (pressed[longest] + 0.5 * flights[longest]) / SAMPLES) % period)
