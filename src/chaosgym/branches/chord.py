"""Orbits of a branch between two neighbours, and where the contacts change between them."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from chaosgym.arrays import Array
from chaosgym.branches.orbit_family import CLOSED, CLOSELY, NotFollowedError, OrbitFamily
from chaosgym.branches.orbit_point import OrbitPoint
from chaosgym.core import matrices
from chaosgym.core.matrices import product

NOISY = 100.0
"""What the noise of a family adds to the error of a place on a branch, in units of that noise."""

PLACED = 1e-9
"""Length of the branch within which a change of contacts is placed, in scaled unknowns."""

NEAR_ENOUGH = 1e-6
"""Length of the branch within which it is placed, if the field varies by less than ``PLACED`` there."""

SOMEWHERE = 1e-3
"""Length within which one is placed that no stability depends on, where that suffices."""

ROUGHLY_PLACED = 1e-4
"""Length at which that is given up where Newton's method fails so near grazing; ``error`` of the bifurcation tells."""

FIRST_DOUBT, LEAST_DOUBT, MOST_ROUNDS = 1e-3, 1e-4, 40
"""Share of an interval by which the first guess of a change of contacts may err, and any guess at the least; rounds of
guessing at the most."""


LEAST_GAIN = 0.5
"""Ratio of the lengths of two brackets above which the next one is not worth its orbits."""


def between(
    family: OrbitFamily,
    a: OrbitPoint,
    b: OrbitPoint,
    share: float,
    closed: float = CLOSED,
    *,
    measured: bool = True,
) -> OrbitPoint:
    """The orbit of a branch between two of its orbits, at a share of the chord; ``measured`` as for ``solve``."""
    chord = b.x - a.x
    slope = (1.0 - share) * a.slope + share * b.slope
    unit = chord / matrices.norm(chord)
    guess, near = interpolated(a, b, share), _near(a, b, share)
    alone = len(near) == 1  # on both sides of a change of contacts Newton's method fails too
    return family.solve(guess, unit, slope, near=near, closed=closed, exact=False, measured=measured, patient=alone)


def _near(a: OrbitPoint, b: OrbitPoint, share: float) -> tuple[Array, ...]:
    """Derivatives of the map between two orbits: it jumps where a contact more or less pushes at once."""
    if a.impacts == b.impacts:
        return ((1.0 - share) * a.solved + share * b.solved,)
    return (a.solved, b.solved) if share < 0.5 else (b.solved, a.solved)


def closely_between(
    family: OrbitFamily, a: OrbitPoint, b: OrbitPoint, share: float, known: Mapping[float, OrbitPoint]
) -> OrbitPoint:
    """The orbit of ``between``, closely, sought from the nearest ones that are known by their share.

    Raises
    ------
    NotFollowedError
        If Newton's method finds none, or the orbit of half the period that the branch began at.
    """
    chord = b.x - a.x
    unit = chord / matrices.norm(chord)
    low, high = max(one for one in known if one < share), min(one for one in known if one > share)
    before, after = known[low], known[high]
    part = (share - low) / (high - low)
    guess = interpolated(before, after, part)
    guess += (share * matrices.norm(chord) - product(unit, guess - a.x)) * unit
    slope = (1.0 - part) * before.slope + part * after.slope
    point = family.solve(guess, unit, slope, near=_near(before, after, part), closed=CLOSELY, exact=False)
    if point.halved and not (a.halved or b.halved):
        raise NotFollowedError("Newton's method leads to the orbit of half the period")
    return point


def interpolated(a: OrbitPoint, b: OrbitPoint, share: float) -> Array:
    """Unknowns on the cubic through two orbits and their tangents."""
    chord = b.x - a.x
    rise, run = share * share * (3.0 - 2.0 * share), share * (1.0 - share)
    bend = run * ((1.0 - share) * along(a.tangent, chord) - share * along(b.tangent, chord))
    return np.asarray(a.x + rise * chord + bend * matrices.norm(chord))


def along(tangent: Array, chord: Array) -> Array:
    """A tangent scaled to grow by one chord along the chord; the chord's direction where they are nearly normal."""
    unit = chord / matrices.norm(chord)
    part = float(product(tangent, unit))
    return tangent / part if part > 0.1 else unit


def change_of_contacts(
    family: OrbitFamily, a: OrbitPoint, b: OrbitPoint, within: float
) -> tuple[OrbitPoint, OrbitPoint]:
    """Neighbours before and after a change of contacts.

    States on the cubic between both are run for a cheap guess of where it is. Then an orbit is found on either side of
    the guess, as far from it as it may err; one that lies on the wrong side brackets the change too.
    """
    doubt, first, last = FIRST_DOUBT, a.x, b.x
    for _ in range(MOST_ROUNDS):
        length = float(matrices.norm(b.x - a.x))
        placed = max(within, NOISY * family.noise)
        apart = abs(float(b.x[-1] - a.x[-1]))
        if length < placed or (length < NEAR_ENOUGH and apart < placed):
            break
        doubt = min(max(doubt, 0.4 * placed / length), 0.25)
        guess = float(np.clip(_guess(family, a, b, doubt), 1.01 * doubt, 1.0 - 1.01 * doubt))
        try:
            below = between(family, a, b, guess - doubt, CLOSELY, measured=False)
            above = below
            if below.impacts == a.impacts:
                above = between(family, a, b, guess + doubt, CLOSELY, measured=False)
        except NotFollowedError:
            if length > ROUGHLY_PLACED:
                raise
            break
        if below.impacts != a.impacts:
            b, doubt = below, 8.0 * doubt
        elif above.impacts == a.impacts:
            a, doubt = above, 8.0 * doubt
        else:
            a, b, doubt = below, above, max(0.1 * doubt, LEAST_DOUBT)
            if float(matrices.norm(b.x - a.x)) > LEAST_GAIN * length:
                break  # the map itself jumps there, by the error of its events
    before, after = family.measured(a, exact=False), family.measured(b, exact=False)
    return _facing(before, before.x - first), _facing(after, last - after.x)


def _facing(point: OrbitPoint, way: Array) -> OrbitPoint:
    """The orbit with its tangent turned along a way: what Broyden's method learned near grazing may point back."""
    return replace(point, tangent=-point.tangent) if float(product(point.tangent, way)) < 0.0 else point


def _guess(family: OrbitFamily, a: OrbitPoint, b: OrbitPoint, resolution: float) -> float:
    """Share of the chord at which states between two orbits change their contacts, by halving."""
    low, high = 0.0, 1.0
    while high - low > resolution:
        middle = 0.5 * (low + high)
        if family.impacts(interpolated(a, b, middle)) == a.impacts:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
