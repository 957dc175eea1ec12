"""The smallest shock that leads from a motion to another one: its minimal fatal shock.

A knock changes the velocity of a joint: an impulse along the joint's motion, which changes the velocities of a machine
of modes by phi / |phi|^2 for every metre a second at the joint. Knocks of both directions, at some instants of the
cycle where the machine has a section there, are tried from small to large; the smallest that leaves is halved towards
the largest below it that comes back. Smaller ones may leave in directions or at instants that were not tried.

L. Halekotte, U. Feudel, Minimal fatal shocks in multistable complex networks, Sci. Rep. 10 (2020) 11783.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import status
from chaosgym.diagnosis.attractors import Attractors, Mapper
from chaosgym.diagnosis.periodic_orbit import PRECISE
from chaosgym.errors import SimulationError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of

PHASES = 8
"""Instants of a cycle at which knocks are tried, on machines that have a section there."""

SMALLEST = 1e-3
"""Smallest knock, as a share of the largest."""

HALVINGS = 12
"""Of the interval between a knock that comes back and one that leaves."""


class Knock(NamedTuple):
    """A sudden change of a joint's velocity.

    ``joint`` is its name, empty where there is one; ``velocity`` in m/s, or rad/s where the joint turns, upwards
    positive; ``phase`` is the instant, as a share of the cycle.
    """

    joint: str
    velocity: float
    phase: float


class Shock(NamedTuple):
    """The smallest knock that leaves a motion.

    Attributes
    ----------
    tried
        Knocks that were tried.
    largest
        The largest of them, by magnitude [m/s, or rad/s].
    knock
        The smallest that leaves; None if all come back.
    leads_to
        Number of the motion that it leads to; None if that is not one of those met, or not settled.
    """

    tried: int
    largest: float
    knock: Knock | None
    leads_to: int | None


def smallest_shock(machine: Machine, found: Attractors, *, knocks: int = 384, workers: int | None = None) -> Shock:
    """The smallest knock at a joint that leads from the first motion of a search to another.

    Parameters
    ----------
    machine
        What runs.
    found
        Its motions; the first must be a proven orbit.
    knocks
        How many are tried, over joints, directions, instants and sizes.
    workers
        Number of threads; all processors by default.

    Examples
    --------
    >>> from chaosgym.diagnosis import attractors
    >>> from chaosgym.diagnosis.shock import smallest_shock
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=10.0)
    >>> smallest_shock(beam, attractors(beam), knocks=32).knock is None
    True
    """
    rows = machine.unit_knocks
    phases = [k / PHASES for k in range(PHASES)] if machine.section_at(0.0) is not None else [0.0]
    ways = [(joint, phase, sign) for joint in range(len(rows)) for phase in phases for sign in (1.0, -1.0)]
    sizes = np.geomspace(SMALLEST, 1.0, max(2, knocks // len(ways)))
    half = machine.n_velocities
    largest = [
        float(found.box.reach * np.linalg.norm(found.box.scale[half : 2 * half]) / (float(np.linalg.norm(row)) or 1.0))
        for row in rows
    ]
    mapper = Mapper(machine, found, workers)

    def ends(some: Sequence[Knock]) -> list[int | None]:
        return mapper.reached([_knocked(machine, found, rows, one) for one in some])

    tried = [
        Knock(_name(machine, joint), sign * size * largest[joint], phase)
        for joint, phase, sign in ways
        for size in sizes
    ]
    reached = ends(tried)
    left = [number for number, place in enumerate(reached) if place != 0]
    if not left:
        return Shock(len(tried), max(largest), None, None)
    first = min(left, key=lambda number: abs(tried[number].velocity))
    knock, place = tried[first], reached[first]
    low, high = (abs(knock.velocity) * sizes[0] / sizes[1], abs(knock.velocity))
    for _ in range(HALVINGS):
        middle = knock._replace(velocity=float(np.sign(knock.velocity) * np.sqrt(low * high)))
        (end,) = ends([middle])
        if end == 0:
            low = abs(middle.velocity)
        else:
            knock, place, high = middle, end, abs(middle.velocity)
    return Shock(len(tried) + HALVINGS, max(largest), knock, place)


def knock_words(machine: Machine, knock: Knock) -> str:
    """A knock in the machine's units, such as "a knock of 0.08 mm/s at the joint, 0.25 of a cycle after its start"."""
    turns = parameters_of(machine)[machine.clearance_field].unit == "rad"
    size = f"{abs(knock.velocity):.3g} rad/s" if turns else f"{1e3 * abs(knock.velocity):.3g} mm/s"
    way = "to its upper stop" if knock.velocity > 0.0 else "to its lower stop"
    where = f"the joint {knock.joint}" if knock.joint else "the joint"
    return f"a knock of {size} at {where}, {way}, {knock.phase:.3g} of a cycle after its start"


def _name(machine: Machine, joint: int) -> str:
    return machine.joints[joint] if machine.joints else ""


def _knocked(machine: Machine, found: Attractors, rows: Sequence[Array], knock: Knock) -> Array | None:
    """State (n_states,) at the end of the cycle in which the first motion is knocked; None if it can't be followed."""
    row = rows[machine.joints.index(knock.joint) if machine.joints else 0]
    half, begun = machine.n_velocities, found.motions[0].state
    there = _part(machine, begun, 0.0, knock.phase) if knock.phase else begun
    if there is None:
        return None
    state = there.copy()
    state[half : 2 * half] += knock.velocity * row
    return _part(machine, state, knock.phase, 1.0 - knock.phase) if knock.phase else state


def _part(machine: Machine, state: Array, phase: float, share: float) -> Array | None:
    """State after a share of a cycle that begins at a phase."""
    section = machine.section_at(phase, share)
    assert section is not None
    coordinates = np.array(state)
    try:
        outcome, _ = section.run(coordinates, np.zeros(3), section.arrays(1), PRECISE)
    except SimulationError:
        return None
    return coordinates if outcome == status.OK else None
