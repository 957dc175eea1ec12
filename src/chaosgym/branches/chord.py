"""Orbits of a branch between two neighbours, and where the contacts change between them."""

from collections.abc import Mapping

import numpy as np

from chaosgym.arrays import Array
from chaosgym.branches.orbit_family import CLOSED, CLOSELY, NotFollowedError, OrbitFamily
from chaosgym.branches.orbit_point import OrbitPoint

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


def between(family: OrbitFamily, a: OrbitPoint, b: OrbitPoint, share: float, closed: float = CLOSED) -> OrbitPoint:
    """The orbit of a branch between two of its orbits, at a share of the chord."""
    chord = b.x - a.x
    slope = (1.0 - share) * a.slope + share * b.slope
    unit = chord / np.linalg.norm(chord)
    return family.solve(interpolated(a, b, share), unit, slope, closed=closed, exact=False)


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
    unit = chord / np.linalg.norm(chord)
    low, high = max(one for one in known if one < share), min(one for one in known if one > share)
    before, after = known[low], known[high]
    part = (share - low) / (high - low)
    guess = interpolated(before, after, part)
    guess += (share * np.linalg.norm(chord) - unit @ (guess - a.x)) * unit
    slope = (1.0 - part) * before.slope + part * after.slope
    point = family.solve(guess, unit, slope, closed=CLOSELY, exact=False)
    if point.halved and not (a.halved or b.halved):
        raise NotFollowedError("Newton's method leads to the orbit of half the period")
    return point


def interpolated(a: OrbitPoint, b: OrbitPoint, share: float) -> Array:
    """Unknowns on the cubic through two orbits and their tangents."""
    chord = b.x - a.x
    rise, run = share * share * (3.0 - 2.0 * share), share * (1.0 - share)
    bend = run * ((1.0 - share) * along(a.tangent, chord) - share * along(b.tangent, chord))
    return np.asarray(a.x + rise * chord + bend * np.linalg.norm(chord))


def along(tangent: Array, chord: Array) -> Array:
    """A tangent scaled to grow by one chord along the chord; the chord's direction where they are nearly normal."""
    unit = chord / np.linalg.norm(chord)
    part = float(tangent @ unit)
    return tangent / part if part > 0.1 else unit


def change_of_contacts(
    family: OrbitFamily, a: OrbitPoint, b: OrbitPoint, within: float
) -> tuple[OrbitPoint, OrbitPoint]:
    """Neighbours before and after a change of contacts.

    States on the cubic between both are run for a cheap guess of where it is. Then an orbit is found on either side of
    the guess, as far from it as it may err; one that lies on the wrong side brackets the change too.
    """
    doubt = FIRST_DOUBT
    for _ in range(MOST_ROUNDS):
        length = float(np.linalg.norm(b.x - a.x))
        placed = max(within, NOISY * family.noise)
        apart = abs(float(b.x[-1] - a.x[-1]))
        if length < placed or (length < NEAR_ENOUGH and apart < placed):
            break
        doubt = min(max(doubt, 0.4 * placed / length), 0.25)
        guess = float(np.clip(_guess(family, a, b, doubt), 1.01 * doubt, 1.0 - 1.01 * doubt))
        try:
            below = between(family, a, b, guess - doubt, CLOSELY)
            above = between(family, a, b, guess + doubt, CLOSELY) if below.impacts == a.impacts else below
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
    return a, b


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
