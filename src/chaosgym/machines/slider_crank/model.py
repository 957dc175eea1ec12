"""What is held over bins of crank angle of a slider crank: its equations and its friction."""

import math

import numpy as np

from chaosgym.machines.binned.equations import Held, held, middles_and_nodes
from chaosgym.machines.slider_crank.equations import equations
from chaosgym.machines.slider_crank.parameters import CrankParameters


def held_of(machine: CrankParameters) -> Held:
    """Held accelerations of a crank."""
    middles, nodes = middles_and_nodes(machine.bins)
    found = equations(machine, middles, nodes)
    # friction has the sign of the nominal velocity of the slider, ramped through zero
    ramp = machine.friction_ramp * machine.crank_radius
    friction = machine.friction_coefficient * np.clip(found.slider_rate / ramp, -1.0, 1.0)
    return held(found.mass, found.damping, found.stiffness, found.load, friction[:, None] * found.slider_along)


def force_bound(crank: CrankParameters) -> float:
    """Force [N] of an impact of all moving masses at ten times the speed of the crank pin.

    The motor may give any power, so that there is no bound of energy. What turns with the rod counts as the mass at its
    end that has the same inertia.
    """
    rod = crank.density * crank.rod_length * math.pi / 4.0 * crank.rod_diameter**2
    turning = (crank.yoke_inertia + crank.housing_inertia) / crank.rod_length**2
    mass = crank.slider_mass + crank.yoke_mass + crank.housing_mass + rod + turning
    speed = 10.0 * (crank.crank_radius * crank.crank_rate + math.sqrt(crank.gravity * crank.rod_length))
    damping = crank.contact_damping * math.sqrt(mass / (crank.slider_mass + crank.yoke_mass))
    bound = (math.sqrt(crank.contact_stiffness * mass) + damping) * speed
    if crank.contact_law == "hertz":
        # k of the secant at the reference force; stiffer in proportion to the cube root of a larger force
        bound *= max(1.0, bound / crank.hertz_reference_force) ** 0.2
    return bound
