"""How large the contact forces of a mechanism are in its nominal motion."""

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
