"""The operating points at which rungs are compared: the same every time, a third of them chaotic."""

import numpy as np

from chaosgym.arrays import Array
from chaosgym.machines import Machine
from chaosgym.numbers import whole
from chaosgym.series.two_step import two_step_test
from chaosgym.simulation import simulate

CHAOTIC_SHARE = 3
"""One point in so many is chaotic, if the machine has enough of them."""

MAX_DRAWS = 20
"""Candidates that are judged for each point of the sample at most."""


def operating_points(machine: Machine, count: int) -> Array:
    """Speeds and clearances over the usual ranges, (count, 2): a Halton sequence, even in the logarithm."""
    from scipy.stats import qmc  # slow to import

    whole("points", count, 1, 10**6)
    low, high = np.log([machine.usual_ranges[f] for f in (machine.speed_field, machine.clearance_field)]).T
    spread = qmc.Halton(2, scramble=False).random(count + 1)[1:]
    return np.asarray(np.exp(low + spread * (high - low)))


def balanced_points(machine: Machine, count: int) -> Array:
    """Speeds and clearances of the fixed sample, (count, 2), a third of them chaotic where there are enough.

    Of ``operating_points`` those that come first of either kind; the machine itself tells the kinds apart.
    """
    wanted = {True: count // CHAOTIC_SHARE, False: count - count // CHAOTIC_SHARE}
    chosen: list[Array] = []
    spare: list[Array] = []
    for point in operating_points(machine, MAX_DRAWS * count):
        if not any(wanted.values()):
            break
        record = simulate(machine.at(*point.tolist()), 100, transient=100)
        chaotic = two_step_test(record).labelled("thesis").nature == "chaotic"
        if wanted[chaotic] > 0:
            wanted[chaotic] -= 1
            chosen.append(point)
        else:
            spare.append(point)
    return np.array([*chosen, *spare][:count])
