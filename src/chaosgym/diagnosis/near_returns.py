"""Stable orbits beside a motion that does not repeat, by Newton's method from where it nearly does.

Chaos that lasts for thousands of cycles hides the orbits that it may end on: starts seldom reach them within a budget.
Newton's method does from afar, since it needs a guess alone.

References
----------
D. P. Lathrop, E. J. Kostelich, Characterization of an experimental strange attractor by periodic orbits, Phys. Rev. A
40 (1989) 4028-4031: near returns.
"""

from collections.abc import Iterator

import numpy as np

from chaosgym.arrays import Array
from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit, find_periodic_orbit
from chaosgym.machines import Machine

LONGEST = 6
"""Longest period that is looked for [cycles]."""

TRIED = 8
"""Nearest returns of each period from which Newton's method starts."""


def stable_orbits(machine: Machine, states: Array, weight: Array) -> Iterator[PeriodicOrbit]:
    """Certified orbits that Newton's method reaches from near returns; one may come several times.

    Parameters
    ----------
    machine
        What runs.
    states : (k, n_states)
        Of a motion that does not repeat, a cycle apart.
    weight : (n_states,)
        Of a distance between states.

    Examples
    --------
    >>> import numpy as np
    >>> from chaosgym.diagnosis.near_returns import stable_orbits
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=30.0)
    >>> states = chaosgym.simulate(beam, 200, transient=200).states
    >>> list(stable_orbits(beam, states, np.ones(states.shape[1])))
    []
    """
    scaled = weight * states
    for period in range(1, min(LONGEST, len(states) - 1) + 1):
        apart = np.linalg.norm(scaled[period:] - scaled[:-period], axis=1)
        for place in np.argsort(apart, kind="stable")[:TRIED].tolist():
            orbit = find_periodic_orbit(machine, states[place], period)
            if orbit is not None and orbit.certified:
                yield orbit
