"""The push of least energy that leads from a motion to another one: a change of all velocities at once.

Pushes in random directions are tried from small to large. About the smallest that leaves, or the smallest knock, ever
smaller ones are tried in directions and at instants nearby, until none leaves. Smaller ones may leave in directions
that were not tried.

References
----------
L. Halekotte, U. Feudel, Minimal fatal shocks in multistable complex networks, Sci. Rep. 10 (2020) 11783. The search on
shrinking spheres is that of Attractors.jl (G. Datseris, K. Luiz Rossi and A. Wagemakers, Chaos 33 (2023) 073151).
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.matrices import product
from chaosgym.diagnosis.attractors import Attractors, Mapper
from chaosgym.diagnosis.shock import PHASES, SMALLEST, Knock, Shock, knocked
from chaosgym.machines import Machine
from chaosgym.machines.abilities import Kinematics
from chaosgym.machines.parameters import parameters_of

ROUND = 16
"""Pushes that are tried at once."""

SHRINKS = 0.9
"""Size of a push beside that of the smallest that leaves."""

WIDEST, NARROWEST, NARROWER = 1.0, 0.02, 0.7
"""Spread of directions about that of the smallest, at first and at last, and what a round in which none leaves makes of
it."""

HALVINGS = 6
"""Of the interval between the last push that leaves and ``SHRINKS`` of it."""


class Push(NamedTuple):
    """The push of least energy that leaves a motion, of those that were tried.

    Attributes
    ----------
    tried
        Pushes that were tried.
    largest
        Largest energy of them [J].
    energy
        What it gives the machine at rest [J]; None if all come back.
    change : (n_velocities,)
        Of the velocities of all coordinates, in their units.
    places
        What it changes the velocities of joints and named points by [m/s, or rad/s of a joint that turns].
    phase
        Instant, as a share of the cycle.
    leads_to
        Number of the motion that it leads to; None if that is not one of those met, or not settled.
    """

    tried: int
    largest: float
    energy: float | None = None
    change: tuple[float, ...] = ()
    places: Mapping[str, float] = {}
    phase: float = 0.0
    leads_to: int | None = None


class _Leaving(NamedTuple):
    """A push that leaves, in coordinates (n,) of which half the squared norm is its energy, and where it leads."""

    push: Array
    phase: float
    leads_to: int | None

    @property
    def size(self) -> float:
        return float(matrices.norm(self.push))


class _Trials:
    """Pushes that are tried on the first motion of a search."""

    def __init__(self, machine: Machine, motions: Attractors, mobility: Array, workers: int | None) -> None:
        values, vectors = matrices.eigh(mobility)
        self.root = np.asarray(vectors * np.sqrt(values))
        self.tried = 0
        self._machine, self._motions, self._mapper = machine, motions, Mapper(machine, motions, workers)

    def smallest(self, pushes: Array, phases: list[float]) -> _Leaving | None:
        """The smallest of some pushes (k, n) that leaves, or None."""
        states = [
            knocked(self._machine, self._motions, product(self.root, push), phase)
            for push, phase in zip(pushes, phases, strict=True)
        ]
        self.tried += len(pushes)
        left = [
            _Leaving(push, phase, end)
            for push, phase, end in zip(pushes, phases, self._mapper.reached(states), strict=True)
            if end != 0
        ]
        return min(left, key=lambda one: one.size, default=None)


def smallest_push(
    machine: Machine, motions: Attractors, shock: Shock, *, pushes: int = 384, workers: int | None = None
) -> Push | None:
    """The push of least energy that leads from the first motion of a search to another.

    Parameters
    ----------
    machine
        What runs.
    motions
        Its motions; the first must be a proven orbit.
    shock
        The smallest knock of a place, from which the search goes on.
    pushes
        How many are tried at the most.
    workers
        Number of threads; all processors by default.

    Returns
    -------
    Push or None
        None where the inertia is not told, and on a machine of one coordinate, whose pushes are knocks.

    Examples
    --------
    >>> from chaosgym.diagnosis import attractors
    >>> from chaosgym.diagnosis.push import smallest_push
    >>> from chaosgym.diagnosis.shock import smallest_shock
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=10.0)
    >>> motions = attractors(beam)
    >>> smallest_push(beam, motions, smallest_shock(beam, motions, knocks=32), pushes=32).energy is None
    True
    """
    kinematics, half = machine.kinematics, machine.n_velocities
    if kinematics is None or half == 1:
        return None
    trials, random = _Trials(machine, motions, kinematics.mobility, workers), np.random.default_rng(0)
    moves = machine.section_at(0.0) is not None
    phases = [k / PHASES for k in range(PHASES)] if moves else [0.0]
    fastest = motions.box.reach * motions.box.scale[half : 2 * half]
    largest = float(matrices.norm(matrices.solve(trials.root, fastest)))
    sizes = largest * np.geomspace(SMALLEST, 1.0, max(ROUND, pushes // 4))
    ahead = sizes[:, None] * _units(random.standard_normal((len(sizes), half)))
    left = trials.smallest(ahead, [phases[k] for k in random.integers(len(phases), size=len(sizes))])
    by_knock = None if shock.knock is None else _of_knock(kinematics, trials.root, shock.knock, shock.leads_to)
    if by_knock is not None and (left is None or by_knock.size < left.size):
        left = by_knock
    if left is None:
        return Push(trials.tried, 0.5 * largest**2)
    spread = WIDEST
    while trials.tried + ROUND + HALVINGS <= pushes and spread > NARROWEST:
        beside = left.push / left.size + spread * random.standard_normal((ROUND, half)) / np.sqrt(half)
        at = [(left.phase + k / PHASES) % 1.0 if moves else 0.0 for k in random.integers(-1, 2, size=ROUND)]
        nearer = trials.smallest(SHRINKS * left.size * _units(beside), at)
        if nearer is None:
            spread *= NARROWER
        else:
            left = nearer
    low = SHRINKS
    high = 1.0
    last = left
    for _ in range(HALVINGS):
        share = 0.5 * (low + high)
        nearer = trials.smallest(share * last.push[None], [last.phase])
        low, high, left = (share, high, left) if nearer is None else (low, share, nearer)
    change = product(trials.root, left.push)
    rows = {place: row for place, row in kinematics.places.items() if row.any()}
    return Push(
        tried=trials.tried,
        largest=0.5 * largest**2,
        energy=0.5 * left.size**2,
        change=tuple(change.tolist()),
        places={place: float(product(row, change)) for place, row in rows.items()},
        phase=left.phase,
        leads_to=left.leads_to,
    )


def push_words(machine: Machine, push: Push) -> str:
    """A push in the machine's units: its energy, what it does to joints and named points, and its instant."""
    turns = parameters_of(machine)[machine.clearance_field].unit == "rad"
    changes = [
        f"{place} by {velocity:+.3g} rad/s" if turns else f"{place} by {1e3 * velocity:+.3g} mm/s"
        for place, velocity in push.places.items()
    ]
    energy = 0.0 if push.energy is None else push.energy
    return (
        f"one of {1e3 * energy:.3g} mJ that changes {', '.join(changes)}, {push.phase:.3g} of a cycle after its start"
    )


def _units(rows: Array) -> Array:
    """Rows (k, n) of length 1."""
    return np.asarray(rows / np.array([matrices.norm(row) for row in rows])[:, None])


def _of_knock(kinematics: Kinematics, root: Array, knock: Knock, leads_to: int | None) -> _Leaving:
    change = knock.velocity * kinematics.unit_knocks[knock.at]
    return _Leaving(np.asarray(matrices.solve(root, change)), knock.phase, leads_to)
