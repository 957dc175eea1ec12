"""The smallest shock that leads from a motion to another one: its minimal fatal shock.

A knock changes the velocity of a place, a joint or a named point of a machine of modes: an impulse along its motion,
which changes the velocities of the modes by phi / |phi|^2 for every metre a second there. Knocks of both directions, at
some instants of the cycle where the machine has a section there, are tried from small to large; the smallest that
leaves, by the energy that it adds to the machine at rest, is halved towards the largest below it that comes back.
Smaller ones may leave at places or instants that were not tried.

L. Halekotte, U. Feudel, Minimal fatal shocks in multistable complex networks, Sci. Rep. 10 (2020) 11783.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices, status
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
    """A sudden change of a place's velocity.

    ``at`` is the place, such as "the joint" or "point drive"; ``velocity`` in m/s, or rad/s where the joint turns,
    upwards positive; ``phase`` is the instant, as a share of the cycle.
    """

    at: str
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
    """The smallest knock at a place that leads from the first motion of a search to another.

    Parameters
    ----------
    machine
        What runs.
    found
        Its motions; the first must be a proven orbit.
    knocks
        How many are tried, over places, directions, instants and sizes.
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
    kinematics = machine.kinematics
    rows = {} if kinematics is None else kinematics.unit_knocks
    if not rows:
        return Shock(0, 0.0, None, None)
    phases = [k / PHASES for k in range(PHASES)] if machine.section_at(0.0) is not None else [0.0]
    ways = [(place, phase, sign) for place in rows for phase in phases for sign in (1.0, -1.0)]
    sizes = np.geomspace(SMALLEST, 1.0, max(2, knocks // len(ways)))
    half = machine.n_velocities
    fastest = float(found.box.reach * matrices.norm(found.box.scale[half : 2 * half]))
    largest = {place: fastest / float(matrices.norm(row)) for place, row in rows.items()}
    mapper = Mapper(machine, found, workers)

    def ends(some: Sequence[Knock]) -> list[int | None]:
        return mapper.reached([knocked(machine, found, one.velocity * rows[one.at], one.phase) for one in some])

    tried = [Knock(place, sign * size * largest[place], phase) for place, phase, sign in ways for size in sizes]
    reached = ends(tried)
    left = [number for number, place in enumerate(reached) if place != 0]
    if not left:
        return Shock(len(tried), max(largest.values()), None, None)
    # the smallest by what it adds to the energy of a machine of modes
    first = min(left, key=lambda number: abs(tried[number].velocity) / largest[tried[number].at])
    knock, place = tried[first], reached[first]
    low, high = (abs(knock.velocity) * sizes[0] / sizes[1], abs(knock.velocity))
    for _ in range(HALVINGS):
        middle = knock._replace(velocity=float(np.sign(knock.velocity) * np.sqrt(low * high)))
        (end,) = ends([middle])
        if end == 0:
            low = abs(middle.velocity)
        else:
            knock, place, high = middle, end, abs(middle.velocity)
    return Shock(len(tried) + HALVINGS, max(largest.values()), knock, place)


def knock_words(machine: Machine, knock: Knock) -> str:
    """A knock in the machine's units, such as "a knock of 0.08 mm/s at the joint, 0.25 of a cycle after its start"."""
    turns = parameters_of(machine)[machine.clearance_field].unit == "rad"
    size = f"{abs(knock.velocity):.3g} rad/s" if turns else f"{1e3 * abs(knock.velocity):.3g} mm/s"
    joint = knock.at.startswith("the joint")
    side = "upper" if knock.velocity > 0.0 else "lower"
    way = f"to its {side} stop" if joint else "along its motion" if knock.velocity > 0.0 else "against its motion"
    return f"a knock of {size} at {knock.at}, {way}, {knock.phase:.3g} of a cycle after its start"


def knocked(machine: Machine, found: Attractors, change: Array, phase: float) -> Array | None:
    """State (n_states,) at the end of the cycle in which the velocities of the first motion change at a phase.

    None if it can't be followed.
    """
    half, begun = machine.n_velocities, found.motions[0].state
    there = _part(machine, begun, 0.0, phase) if phase else begun
    if there is None:
        return None
    state = there.copy()
    state[half : 2 * half] += change
    return _part(machine, state, phase, 1.0 - phase) if phase else state


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
