r"""Bifurcations between two orbits of a branch: which there are, where, and what they are called.

    grazing            the contacts of a period change: a surface is touched at zero speed, or a contact parts
    fold               a multiplier is 1 and the branch turns back
    flip               a multiplier is -1: a motion of twice the period begins
    Neimark-Sacker     a pair of complex multipliers is on the unit circle: a torus begins
    symmetry breaking  a multiplier is 1, the branch goes on: two motions begin that mirror each other
    branch point       the same of a motion without symmetry

Roots are those of det(M - I), of det(M + I) and of the product of all (m_i m_j - 1) along the branch, by Brent's
method; a change of the contacts is halved in. Where multipliers leave the circle and no root tells how, the interval is
halved.

References
----------
Y. A. Kuznetsov, Elements of Applied Bifurcation Theory, 3rd ed., Springer 2004, chapter 10.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.branches.chord import (
    NOISY,
    PLACED,
    ROUGHLY_PLACED,
    SOMEWHERE,
    along,
    between,
    change_of_contacts,
    closely_between,
)
from chaosgym.branches.orbit_family import CLOSELY, NotFollowedError, OrbitFamily
from chaosgym.branches.orbit_point import OrbitPoint
from chaosgym.core import matrices
from chaosgym.plain import Result

Kind = Literal["grazing", "fold", "flip", "Neimark-Sacker", "symmetry breaking", "branch point"]

NEAREST = 1e-6
"""Shortest piece of a branch that is searched for multipliers that cross unseen."""

ASIDE = 0.005
"""Share of the chord at which a crossing of branches is looked at from either side."""

ROUNDING = 1e-11
"""Length of the branch within which a root is placed, in scaled unknowns."""

ROOT_ERROR = 1e-9
"""Error of a root, as a share of the field or of the range."""

MOST_CHANGES = 100
"""Changes of contacts between two neighbouring orbits: more are the error of contacts that only touch, or chatter."""

SAME_ORBIT = 1e-3
"""Distance, relative to the size of the motion, below which an orbit closes after half its period too."""


@dataclass(frozen=True, kw_only=True)
class Bifurcation(Result):
    """Where the motion of a branch changes in kind.

    Attributes
    ----------
    kind
        See the module.
    value
        Of the field.
    error
        Half width of the interval of the field in which it lies.
    period
        Of the branch, in cycles.
    multipliers : (n_states,) complex
        Of the orbit; of a grazing orbit those on the side that comes first.
    state : (n_states,)
        At the start of a cycle.
    impacts
        Contacts of each side in a period, before and after.
    largest_peak
        Of the period [N].
    loses_stability
        True if the orbits are stable on one side and not on the other.
    ends
        True if the branch ends here: beyond, its orbits are those before once more.
    """

    shows = "kind value error period largest_multiplier impacts largest_peak_N=largest_peak loses_stability ends state"

    kind: Kind
    value: float
    error: float
    period: int
    multipliers: NDArray[np.complex128]
    state: Array
    impacts: tuple[tuple[int, ...], tuple[int, ...]]
    largest_peak: float
    loses_stability: bool
    ends: bool = False

    @property
    def largest_multiplier(self) -> float:
        """Modulus of the first multiplier."""
        return float(np.abs(self.multipliers[0]))


class Found(NamedTuple):
    """A bifurcation, and the orbit there."""

    bifurcation: Bifurcation
    point: OrbitPoint


def bifurcations_between(family: OrbitFamily, a: OrbitPoint, b: OrbitPoint, *, closely: bool = True) -> Iterator[Found]:
    """All bifurcations between two neighbouring orbits of a branch, in their order.

    Unless ``closely``, a grazing that no stability depends on is placed to ``SOMEWHERE`` only.

    Raises
    ------
    NotFollowedError
        If an orbit between them can't be found, or contacts change too often.
    """
    for _ in range(MOST_CHANGES):
        if a.impacts == b.impacts:
            yield from _smooth(family, a, b)
            return
        before, after = change_of_contacts(family, a, b, PLACED if closely else SOMEWHERE)
        if not closely and (before.unstable, after.unstable) != (0, 0):
            before, after = change_of_contacts(family, before, after, PLACED)
        yield from _smooth(family, a, before)
        yield grazing(family, before, after)
        a = after
    raise NotFollowedError(f"contacts change more than {MOST_CHANGES} times from one orbit to the next")


def grazing(family: OrbitFamily, before: OrbitPoint, after: OrbitPoint) -> Found:
    """The change of contacts between two orbits on either side of it."""
    values = [family.value(point.x[-1]) for point in (before, after)]
    found = _bifurcation(family, "grazing", (before, after), before)
    return Found(replace(found, value=0.5 * sum(values), error=0.5 * abs(values[1] - values[0])), before)


def _one(point: OrbitPoint) -> float:
    return float(matrices.det(point.matrix - np.eye(len(point.matrix))))


def _minus_one(point: OrbitPoint) -> float:
    return float(matrices.det(point.matrix + np.eye(len(point.matrix))))


def _circle(point: OrbitPoint) -> float:
    first, second = np.triu_indices(len(point.multipliers), 1)
    return float(np.real(np.prod(point.multipliers[first] * point.multipliers[second] - 1.0)))


Test = Callable[[OrbitPoint], float]

TESTS: dict[str, Test] = {"one": _one, "minus one": _minus_one, "circle": _circle}
"""Functions that change their sign where a multiplier is 1 or -1, or where two have the product 1."""


def _smooth(family: OrbitFamily, a: OrbitPoint, b: OrbitPoint) -> Iterator[Found]:
    """Bifurcations between two orbits with the same contacts."""
    signs = {name: test(a) * test(b) < 0.0 for name, test in TESTS.items()}
    turns = a.tangent[-1] * b.tangent[-1] < 0.0
    if turns and not signs["one"]:
        end = _end_on_another(family, a, b)
        if end is not None:
            yield end
            return
    explained = abs(b.unstable - a.unstable) in {abs(change) for change in _changes(signs)}
    short = float(matrices.norm(b.x - a.x)) < NEAREST
    if short or (explained and turns <= signs["one"] and (turns or not _turns_twice(a, b))):
        found = []
        for name in (name for name, changes in signs.items() if changes):
            share, s, point = _root(family, a, b, name, turns)
            kind = _kind(name, turns, (a, b), point)
            if kind is not None:
                named = _bifurcation(family, kind, (a, b), point)
                doubt = abs(family.value(b.x[-1]) - family.value(a.x[-1])) if point is a or point is b else 0.0
                named = replace(named, value=family.value(s), error=max(named.error, doubt))
                found.append((share, Found(named, point)))
        yield from _told_apart(family, a, b, sorted(found, key=lambda pair: pair[0]))
        return
    middle = between(family, a, b, 0.5)
    if max(matrices.norm(middle.x - a.x), matrices.norm(b.x - middle.x)) >= matrices.norm(b.x - a.x):
        raise NotFollowedError("an orbit between two others lies far aside")
    for one, other in ((a, middle), (middle, b)):
        yield from bifurcations_between(family, one, other)


def _told_apart(family: OrbitFamily, a: OrbitPoint, b: OrbitPoint, found: list[tuple[float, Found]]) -> Iterator[Found]:
    """Bifurcations at shares between two orbits; of several, each loses stability or not by the orbits beside it."""
    shares = [share for share, _ in found]
    beside: list[OrbitPoint] = []
    if len(found) > 1:
        with suppress(NotFollowedError):
            beside = [a, *(between(family, a, b, 0.5 * sum(pair), CLOSELY) for pair in pairwise(shares)), b]
    for place, (_, each) in enumerate(found):
        if beside:
            before, after = beside[place : place + 2]
            loses = (before.unstable == 0) != (after.unstable == 0)
            each = each._replace(bifurcation=replace(each.bifurcation, loses_stability=loses))
        yield each


def _turns_twice(a: OrbitPoint, b: OrbitPoint) -> bool:
    """True if the cubic through two orbits turns back in the field and forth again: two folds, which no sign tells."""
    chord = b.x - a.x
    length = float(matrices.norm(chord))
    first, last = (length * float(along(one.tangent, chord)[-1]) for one in (a, b))
    # ds/dshare = first + linear share + square share^2
    linear, square = 6.0 * chord[-1] - 4.0 * first - 2.0 * last, 3.0 * (first + last) - 6.0 * chord[-1]
    inside = 0.0 < -linear < 2.0 * square if first > 0.0 else 0.0 > -linear > 2.0 * square
    return bool(inside and first * (first - linear**2 / (4.0 * square)) < 0.0)


def _end_on_another(family: OrbitFamily, a: OrbitPoint, b: OrbitPoint) -> Found | None:
    """Where a branch turns without a multiplier that passes 1: it began at another branch there, and comes back."""
    from scipy.optimize import minimize_scalar

    if family.period % 2 and family.machine.moving.costly and not family.machine.mirrors:
        return None  # neither a double nor one of two that mirror each other; each look would cost many runs
    side = np.sign(a.tangent[-1])

    @cache
    def orbit(share: float) -> OrbitPoint:
        return between(family, a, b, share, CLOSELY)

    turning = minimize_scalar(
        lambda share: -float(side * orbit(share).x[-1]), bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-4}
    )
    point = orbit(float(turning.x))
    if _closes_earlier(family, point):
        kind: Kind = "flip"
    elif not a.symmetric and abs(point.peaks[0] - point.peaks[-1]) < SAME_ORBIT * point.peaks.max():
        kind = "symmetry breaking"
    else:
        return None
    s = _seen_from_aside(orbit, float(turning.x), None)
    return Found(replace(_bifurcation(family, kind, (a, a), point, ends=True), value=family.value(s)), point)


def _seen_from_aside(points: Callable[[float], OrbitPoint], share: float, test: Test | None) -> float:
    """s near a share of the chord where a test function vanishes, or without one where s itself turns back.

    By cubics through four neighbours: where branches cross, the orbit itself is badly determined.
    """
    width = min(ASIDE, 0.45 * min(share, 1.0 - share))
    places = width * np.array([-2.0, -1.0, 1.0, 2.0])
    found = [points(share + place) for place in places]

    def cubic(values: list[float]) -> Any:
        return np.polynomial.Polynomial.fit(places, values, 3, domain=[-1.0, 1.0])

    s = cubic([point.x[-1] for point in found])
    roots = (s.deriv() if test is None else cubic([test(point) for point in found])).roots()
    return float(s(np.real(roots[np.argmin(np.abs(roots))])))


def _changes(signs: dict[str, bool]) -> set[int]:
    """Changes of the number of unstable multipliers that some changes of sign explain."""
    reachable = {0}
    for name, size in (("one", 1), ("minus one", 1), ("circle", 2)):
        if signs[name]:
            # two real multipliers whose product passes 1 do not cross the circle
            steps = (size, -size, 0) if name == "circle" else (size, -size)
            reachable = {total + step for total in reachable for step in steps}
    return reachable


def _root(family: OrbitFamily, a: OrbitPoint, b: OrbitPoint, name: str, turns: bool) -> tuple[float, float, OrbitPoint]:
    """Share of the chord at which a test function vanishes, s there, and the orbit.

    Where Newton's method fails on a short chord, as where branches cross near grazing, its nearer end stands for it.
    """
    from scipy.optimize import brentq

    test, known = TESTS[name], {0.0: a, 1.0: b}

    def orbit(share: float) -> OrbitPoint:
        if share not in known:
            known[share] = closely_between(family, a, b, share, known)
        return known[share]

    fine = max(1e-13, ROUNDING / float(matrices.norm(b.x - a.x)))
    try:
        share = brentq(lambda one: test(orbit(one)), 0.0, 1.0, xtol=fine, rtol=1e-14, full_output=True, disp=False)[0]
    except NotFollowedError:
        if float(matrices.norm(b.x - a.x)) > ROUGHLY_PLACED:
            raise
        share = abs(test(a)) / (abs(test(a)) + abs(test(b)))
        return share, float(a.x[-1] + share * (b.x[-1] - a.x[-1])), a if share < 0.5 else b
    point = orbit(share)
    crosses = name == "one" and not turns and 0.0 < share < 1.0 and not family.mirrored
    return share, _seen_from_aside(orbit, share, test) if crosses else float(point.x[-1]), point


def _kind(name: str, turns: bool, sides: tuple[OrbitPoint, OrbitPoint], point: OrbitPoint) -> Kind | None:
    """What a root of a test function is; None if two real multipliers only have the product 1."""
    if name == "one":
        alike = all(side.symmetric for side in sides)
        return "fold" if turns else "symmetry breaking" if alike else "branch point"
    if name == "minus one":
        return "flip"
    on_circle = np.abs(np.abs(point.multipliers) - 1.0) < 1e-5
    return "Neimark-Sacker" if np.any(on_circle & (np.abs(point.multipliers.imag) > 1e-6)) else None


def _bifurcation(
    family: OrbitFamily, kind: Kind, sides: tuple[OrbitPoint, OrbitPoint], point: OrbitPoint, ends: bool = False
) -> Bifurcation:
    (before, after), value = sides, family.value(point.x[-1])
    return Bifurcation(
        kind=kind,
        value=value,
        error=max(ROOT_ERROR * abs(value), (ROOT_ERROR + NOISY * family.noise) * abs(family.high - family.low)),
        period=family.period // 2 if kind == "flip" and ends else family.period,
        multipliers=point.multipliers,
        state=family.start(point),
        impacts=(before.impacts, after.impacts),
        largest_peak=float(point.peaks.max()),
        loses_stability=(before.unstable == 0) != (after.unstable == 0),
        ends=ends,
    )


def _closes_earlier(family: OrbitFamily, point: OrbitPoint) -> bool:
    """True if an orbit of even period closes after half of it."""
    if family.period % 2:
        return False
    half = family.with_period(family.period // 2)
    return float(matrices.norm(half.miss(point.x))) < SAME_ORBIT * float(matrices.norm(point.x[:-1]))


def direction_of(point: OrbitPoint, multiplier: float) -> Array:
    """Direction (n,) in which the orbits of a new branch differ: the null vector of M - multiplier I."""
    return np.asarray(matrices.svd(point.matrix - multiplier * np.eye(len(point.matrix))).right[-1])
