"""Curves of a bifurcation over two parameters: where a motion ends, over speed and clearance.

Step by step in the second parameter: the orbit of the last bifurcation leads to one on the new branch, on the plane
normal to the last branch; along the new branch the bifurcation is placed as on any other. The step is halved where that
fails, and where what is found lies far from the straight line through the last two points: it may belong to another
curve. So a curve ends where it turns back in the second parameter.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.branches.bifurcation import TESTS, Bifurcation, Found, Kind, bifurcations_between
from chaosgym.branches.family_along import continuous_field, family_of, with_noise
from chaosgym.branches.orbit_family import NotFollowedError, OrbitFamily
from chaosgym.branches.orbit_point import OrbitPoint
from chaosgym.core import matrices
from chaosgym.errors import ParameterError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings

STEPS = 33
"""Values of the second parameter over its range."""

SHORTEST = 1.0 / 32.0
"""Share of a step down to which it is halved."""

MOST_TRIES = 3
"""Steps that are tried for each value of the second parameter, on average."""

WINDOW = 0.05
"""Range of the first parameter around a bifurcation that counts as 1 in scaled unknowns, as a share of its value."""

MOST_BEND, RESOLVED = 0.5, 1e-3
"""How far a point may lie from where the last two lead, as a share of the step and beside; a curve bends less if the
step is halved, while the way to another curve stays as long."""

LOOKS = (3e-3, 1e-2, 3e-2, 0.1, 0.3)
"""Distances along a new branch at which the bifurcation is looked for where the secant method fails."""

FIRST_STEP, LONGEST_STEP, MOST_SECANTS = 1e-3, 0.1, 12
"""Steps along a new branch of the secant method, and how many there may be."""

BRACKETS = (1e-3, 1e-2)
"""Distances from what it finds at which the bifurcation lies between two orbits."""

TEST_OF: dict[Kind, str] = {
    "fold": "one",
    "symmetry breaking": "one",
    "branch point": "one",
    "flip": "minus one",
    "Neimark-Sacker": "circle",
}
"""Test function of ``bifurcation`` that vanishes at each kind."""


@dataclass(frozen=True, kw_only=True)
class BifurcationCurve:
    """Points of one bifurcation, in the order of the second parameter.

    Attributes
    ----------
    kind, period
        Of the bifurcation.
    along, against
        Fields.
    along_values, against_values : (n,)
        Where it lies.
    ends
        Why it was not followed further, below and above.
    """

    kind: Kind
    period: int
    along: str
    against: str
    along_values: Array
    against_values: Array
    ends: tuple[str, str]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "kind": self.kind,
            "period": self.period,
            self.along: self.along_values.tolist(),
            self.against: self.against_values.tolist(),
            "ends": list(self.ends),
        }


def follow_bifurcation(
    machine: Machine,
    bifurcation: Bifurcation,
    along: str,
    against: str,
    span: tuple[float, float],
    *,
    steps: int = STEPS,
) -> BifurcationCurve:
    """Follow a bifurcation over a second parameter.

    Parameters
    ----------
    machine
        For whose value of the second parameter the bifurcation holds.
    bifurcation
        One of ``follow(machine, along, ...)``.
    along, against
        First and second parameter: fields, or "speed" or "clearance".
    span
        Lowest and highest value of the second one; the machine's own lies between.
    steps
        Values over the span.

    Raises
    ------
    ParameterError
        If a field does not vary continuously, or the machine's own value lies outside of the span.

    Examples
    --------
    >>> from chaosgym.branches.bifurcation_curve import follow_bifurcation
    >>> beam = chaosgym.ImpactBeam(n_modes=1, fitted_modes=0)
    >>> diagram = chaosgym.follow(beam, "speed", (14.2, 14.3))
    >>> fold = next(one for one in diagram.bifurcations if one.kind == "fold")
    >>> curve = follow_bifurcation(beam, fold, "speed", "clearance", (1.25e-4, 1.28e-4), steps=3)
    >>> curve.kind
    'fold'
    """
    first, second = continuous_field(machine, along), continuous_field(machine, against)
    own = float(getattr(machine, second))
    if not span[0] <= own <= span[1] or not span[0] < span[1]:
        raise ParameterError(
            f"{second} = {own:g} of the machine lies outside of {span[0]:g} to {span[1]:g}; allowed: a range around it"
        )
    parts, ends = [], []
    for end in span:
        points, why = _part(machine, bifurcation, first, second, end, (span[1] - span[0]) / (steps - 1))
        parts.append(points)
        ends.append(why)
    places = [*reversed(parts[0]), (bifurcation.value, own), *parts[1]]
    return BifurcationCurve(
        kind=bifurcation.kind,
        period=bifurcation.period,
        along=first,
        against=second,
        along_values=np.array([place[0] for place in places]),
        against_values=np.array([place[1] for place in places]),
        ends=(ends[0], ends[1]),
    )


def _part(
    machine: Machine, start: Bifurcation, first: str, second: str, end: float, step: float
) -> tuple[list[tuple[float, float]], str]:
    """Points (first, second) from a bifurcation to one end of the span, and why there are no more."""
    at = float(getattr(machine, second))
    places, states, here, share = [(start.value, at)], [start.state], start, 1.0
    for _ in range(MOST_TRIES * round(abs(end - at) / step + 1.0)):
        if at == end:
            break
        reach = share * step * np.sign(end - at)
        value = end if abs(end - at) <= abs(reach) * (1.0 + 1e-9) else at + reach
        guess = float(_extrapolated([place[0] for place in places], places, value))
        state = np.asarray(_extrapolated(states, places, value))
        try:
            found = _near(with_settings(machine, {second: value, first: guess}), here, state, first, guess).bifurcation
            if len(places) > 1 and _bends(here, (guess, state), found):
                raise NotFollowedError("what is found beyond may belong to another curve")
        except (NotFollowedError, ParameterError) as reason:
            if len(places) == 2:  # nothing has confirmed the first step yet
                share = min(share, abs(at - places[0][1]) / step)
                places, states, here, at = places[:1], states[:1], start, places[0][1]
            share *= 0.5
            if share < SHORTEST:
                return places[1:], f"not followed beyond {second} = {at:.6g}: {reason}"
            continue
        places.append((found.value, value))
        states.append(found.state)
        at, here, share = value, found, min(1.0, 2.0 * share)
    if at == end:
        return places[1:], f"end of the range at {second} = {end:.6g}"
    return places[1:], f"not followed beyond {second} = {at:.6g}: its steps became too short"


def _extrapolated(known: list[Any], places: list[tuple[float, float]], value: float) -> Any:
    """What is known at the last two places of a curve, at a value of the second parameter beyond them."""
    if len(places) == 1:
        return known[0]
    (_, q1), (_, q2) = places[-2:]
    return known[-1] + (known[-1] - known[-2]) * (value - q2) / (q2 - q1)


def _bends(last: Bifurcation, expected: tuple[float, Array], found: Bifurcation) -> bool:
    """True if a bifurcation lies too far from the value and the state at which the last two lead to expect it."""

    def way(value: float, state: Array) -> float:
        aside = matrices.norm(found.state - state) / max(float(matrices.norm(found.state)), 1e-300)
        return float(np.hypot((found.value - value) / (WINDOW * found.value), aside))

    return way(*expected) > MOST_BEND * way(last.value, last.state) + RESOLVED


def _near(machine: Machine, last: Bifurcation, state: Array, field: str, guess: float) -> Found:
    """The bifurcation of the same kind as the last one near a state and a value of the first parameter."""
    half = WINDOW * abs(guess)
    family = family_of(machine, field, guess - half, guess + half, state, last.period)
    family = with_noise(family, state)
    x = np.append(family.weight * state, 0.5)
    try:
        normal = family.tangent(x, np.append(np.zeros(len(x) - 1), 1.0))
    except NotFollowedError:
        normal = np.append(np.zeros(len(x) - 1), 1.0)
    here = family.solve(x, normal)
    if last.kind == "grazing":
        return _looked_for(family, here, last.kind)

    def orbit(way: float) -> OrbitPoint:
        return family.solve(here.x + way * here.tangent, here.tangent)

    try:
        place = _root(lambda way: TESTS[TEST_OF[last.kind]](orbit(way)))
        for half in BRACKETS:
            for found in bifurcations_between(family, orbit(place - half), orbit(place + half), closely=False):
                if found.bifurcation.kind == last.kind:
                    return found
    except NotFollowedError:
        pass
    return _looked_for(family, here, last.kind)


def _root(test: Callable[[float], float]) -> float:
    """About where a test function vanishes along a branch, by the secant method from 0."""
    last, here = (0.0, test(0.0)), (FIRST_STEP, test(FIRST_STEP))
    for _ in range(MOST_SECANTS):
        rise = here[1] - last[1]
        way = -here[1] * (here[0] - last[0]) / rise if rise else 0.0
        step = float(np.clip(way, -LONGEST_STEP, LONGEST_STEP))
        if abs(step) < BRACKETS[0] / 10.0:
            return here[0] + step
        there = here[0] + step
        if abs(there) > LOOKS[-1]:
            break
        last, here = here, (there, test(there))
    raise NotFollowedError("the search for the bifurcation does not converge")


def _looked_for(family: OrbitFamily, here: OrbitPoint, kind: Kind) -> Found:
    """The bifurcation of a kind nearest to an orbit, from orbit to orbit to either side."""
    test = TESTS.get(TEST_OF.get(kind, ""))
    sides = {sign: here for sign in (1.0, -1.0)}
    for reach in LOOKS:
        for sign in (1.0, -1.0):
            before, there = sides[sign], family.solve(here.x + sign * reach * here.tangent, sign * here.tangent)
            sides[sign] = there
            if test is not None and test(before) * test(there) > 0.0:
                continue
            for found in bifurcations_between(family, before, there, closely=test is None):
                if found.bifurcation.kind == kind:
                    return found
    raise NotFollowedError(f"no {kind} is near")
