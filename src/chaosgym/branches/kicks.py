"""Kicks of a periodic motion: how large a change of the state leads to another motion, and to which."""

from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.diagnosis.diagnose import diagnose_alone
from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit
from chaosgym.machines import Machine
from chaosgym.simulation import parallel_map, simulate

KICK_CYCLES = 200
"""Cycles after which a motion that was kicked must be back."""


BACK = 1e-3
"""Distance from the orbit, relative to its size, at which it is."""


SMALLEST_KICK, LARGEST_KICK = 1e-3, 1.0
"""Sizes of kicks, relative to the size of the motion, in energy for machines of modes."""


class Attractor(NamedTuple):
    """A motion that kicks led to: its nature, period, largest peak force [N], and how many of the kicks."""

    nature: str
    period: int | None
    largest_peak: float
    kicks: int


class Kicks(NamedTuple):
    """What random kicks of the state do.

    Attributes
    ----------
    tried
        How many there were, of sizes evenly spread over a logarithmic scale.
    smallest_leaving
        Smallest of those that did not come back within 200 periods, relative to the size of the motion; None if all
        came back.
    coexisting
        Where those ended.
    """

    tried: int
    smallest_leaving: float | None
    coexisting: tuple[Attractor, ...]


def kicked(machine: Machine, orbit: PeriodicOrbit, count: int, seed: int, workers: int | None) -> Kicks:
    """What ``count`` kicks of random directions and sizes lead to."""
    weight = machine.state_weights(orbit.state)
    size = float(np.linalg.norm(weight * orbit.state)) or 1.0
    random = np.random.default_rng(seed)
    directions = random.standard_normal((count, len(orbit.state)))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    sizes = np.geomspace(SMALLEST_KICK, LARGEST_KICK, count)
    starts = orbit.state + size * sizes[:, None] * directions / weight

    def end_of(start: Array) -> Array:
        return simulate(machine, KICK_CYCLES * orbit.period, start).final_state.coordinates

    ends = parallel_map(end_of, starts, workers=workers)
    phases = [orbit.state, *simulate(machine, orbit.period, orbit.state).section[1:]]
    distance = [min(float(np.linalg.norm(weight * (end - phase))) for phase in phases) for end in ends]
    left = np.flatnonzero(np.array(distance) > BACK * size)
    smallest = float(sizes[left[0]]) if len(left) else None
    return Kicks(count, smallest, _attractors(machine, [ends[i] for i in left], workers))


def _attractors(machine: Machine, states: list[Array], workers: int | None) -> tuple[Attractor, ...]:
    """Motions that settle from some states; two count as one if nature, period and largest peak agree to 0.1 %."""
    found: list[Attractor] = []
    for verdict in parallel_map(
        lambda state: diagnose_alone(machine, initial_state=state, budget=2 * KICK_CYCLES), states, workers=workers
    ):
        peak = float(verdict.evidence["largest_peak"])
        for place, one in enumerate(found):
            alike = abs(one.largest_peak - peak) <= 1e-3 * peak or verdict.nature != "periodic"
            if (one.nature, one.period) == (verdict.nature, verdict.period) and alike:
                found[place] = one._replace(kicks=one.kicks + 1, largest_peak=max(peak, one.largest_peak))
                break
        else:
            found.append(Attractor(verdict.nature, verdict.period, peak, 1))
    return tuple(sorted(found, key=lambda one: -one.kicks))
