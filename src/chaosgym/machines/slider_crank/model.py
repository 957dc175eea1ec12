"""What is held over bins of crank angle of a slider crank: its equations and its friction."""

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
