"""How large the contact forces of a mechanism can be: in its nominal motion, and in the worst impact."""

import math
from functools import lru_cache

import numpy as np

from chaosgym.machines.mechanism.equations import assembled
from chaosgym.machines.mechanism.joints import ACROSS
from chaosgym.machines.mechanism.nominal import even_angles
from chaosgym.machines.mechanism.opened import OpenedMechanism


@lru_cache(maxsize=256)
def heaviest_load(machine: OpenedMechanism) -> float:
    """Ten times the largest load [N] of a gap in the nominal motion."""
    powers = assembled(machine.scaled(), machine.revolution, matrices=False).load_at(even_angles(72))
    across = [
        machine.degrees_of_freedom.index(f"{joint.name} {ACROSS}") for joint in machine.mechanism.joints if joint.opened
    ]
    return 10.0 * max(
        1.0, float(np.abs(np.einsum("k,kbn->bn", machine.crank_rate ** np.arange(3), powers)[:, across]).max())
    )


def largest_force(machine: OpenedMechanism) -> float:
    """Force [N] of an impact of all masses at ten times the speed of the nominal motion."""
    mechanism = machine.scaled()
    theta = even_angles(72)
    z, mass, fastest, load = machine.nominal_places(theta), 0.0, 0.0, 0.0
    for link in mechanism.links:
        own, places = z[:, mechanism.at[link.name]], (*link.points.values(), link.masses)
        moved = np.concatenate([each.moved(own) for each in places], axis=1)
        fastest = max(fastest, float(np.ptp(moved, axis=0).max(initial=0.0)))
        mass += float(link.mass.sum() + link.inertia.sum() / max(machine.revolution.length, 1e-9) ** 2)
    for force in mechanism.forces:
        load += float(np.abs(force.at(theta)).max())
    for spring in mechanism.springs:
        apart = mechanism.apart(z, spring.first, spring.second)[0]
        load += spring.stiffness * float(np.abs(np.linalg.norm(apart, axis=1) - spring.free_length).max())
    gravity = math.hypot(*mechanism.gravity)
    speed = 10.0 * (fastest * machine.crank_rate + math.sqrt(gravity * machine.revolution.length))
    speed += 10.0 * load * machine.cycle_period / mass
    damper = max(contact.damping for contact in machine.contacts)
    largest = (math.sqrt(machine.stiffest * mass) + damper) * speed
    if machine.hertz:
        stiffness = max(contact.stiffness for contact in machine.contacts)
        largest = (1.25 * mass * speed**2) ** 0.6 * stiffness**0.4 * (1.0 + damper * speed)
    return largest
