r"""One branch of periodic orbits, followed step by step through folds, grazing and loss of stability.

Pseudo-arclength continuation: from an orbit x with the tangent t the next one is sought on the plane that is normal to
t at the distance of a step, where the branch may turn back in the field. A step is halved if Newton's method fails, if
it ends far from where the tangent points, or if the tangent turns too far.

References
----------
H. B. Keller, Numerical solution of bifurcation and nonlinear eigenvalue problems, in: Applications of Bifurcation
Theory, Academic Press 1977, 359-384.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.branches.bifurcation import Bifurcation, Found, bifurcations_between, grazing
from chaosgym.branches.chord import between, interpolated
from chaosgym.branches.orbit_family import NotFollowedError, OrbitFamily
from chaosgym.branches.orbit_point import OrbitPoint
from chaosgym.branches.section import better_section
from chaosgym.core import matrices
from chaosgym.core.matrices import product

LEAST_STEP = 1e-7
"""Shortest step, in scaled unknowns."""

ROUNDING = 1e-9
"""Error of an orbit that is no sign of a bend, in scaled unknowns."""

MOST_POINTS = 4000
"""Orbits of one branch."""

LEAST_COSINE = 0.8
"""Of the angle by which the tangent may turn in one step."""

BESIDE, LONG = 0.08, 1e-2
"""Sine by which the chord of a step may lie beside the mean of the tangents at its ends, and the step above which that
counts: near grazing tangents are not good enough for shorter ones."""

SHORT = 1e-3
"""Step below which Newton's method is tried where Broyden's fails: a shorter step is cheaper than its derivatives."""

NEAR, FAR = 0.05, 0.3
"""Share of a step by which the orbit should, and by which it may lie away from where it is expected."""

BEYOND, FIRST_BEYOND = (1e-7, 1e-6, 1e-5, 1e-4), 1e-5
"""Distances at which a grazing ahead is looked for, and the orbit beyond it; and the first step after it."""

LOOKED_AT = 10
"""Orbits after which it is seen whether another section serves better, and whether the branch repeats itself."""

MOST_UNSTABLE = 1000.0
"""Largest multiplier up to which a branch is followed."""

PASSED = 0.01
"""Distance of an orbit passed before from the last step, as a share of its length, at which a branch repeats itself."""


class Begun(NamedTuple):
    """Unknowns (n + 1,) and tangent (n + 1,) of the first orbit, on the section of the last one."""

    x: Array
    tangent: Array


class Bend(NamedTuple):
    """How much tangent (n + 1,) and dP/ds (n,) changed in the last step, by its length."""

    tangent: Array
    slope: Array


@dataclass(frozen=True)
class Stretch:
    """Orbits of a branch in one direction from where it begins.

    ``points`` and ``found`` are in the order in which they were passed; ``at`` is, for each of ``found``, the number of
    the orbit before it. ``end`` says why the branch was not followed further.
    """

    points: list[OrbitPoint]
    found: list[Found]
    at: list[int]
    end: str


def stretch(
    family: OrbitFamily,
    start: OrbitPoint,
    *,
    longest_step: float = 0.05,
    first_step: float = 0.01,
    until: Callable[[Bifurcation], bool] | None = None,
    most_unstable: float = MOST_UNSTABLE,
    closely: bool = True,
    most_points: int = MOST_POINTS,
) -> Stretch:
    """Follow a branch along the tangent of ``start`` until the range or the branch ends.

    Parameters
    ----------
    family, start
        The orbits, and the first one.
    longest_step, first_step
        As shares of the range, and of the size of the motion.
    until
        Stop at the first bifurcation of which this is true.
    most_unstable
        Largest modulus of a multiplier up to which the branch is followed.
    closely
        Place every grazing to 1e-9, not only those that stability depends on.
    most_points
        Orbits at the most.
    """
    family, start = family.with_mirror(start)
    points: list[OrbitPoint] = [start]
    found: list[Found] = []
    at: list[int] = []
    straight = Bend(np.zeros_like(start.x), np.zeros_like(start.slope))
    here, begun, step, bend = start, Begun(start.x, start.tangent), first_step, straight
    while len(points) < most_points:
        if len(points) % LOOKED_AT == 1:
            if _repeats(points):
                reason = "a step left the branch, which comes back to an orbit passed before"
                return Stretch(points, found, at, f"not followed beyond {_place(family, here)}: {reason}")
            moved, here = better_section(family, here)
            if moved is not family:
                family, bend = moved, straight
                begun = Begun(*family.carried(start, family.phase))
        cap = longest_step * max(1.0, float(matrices.norm(here.x[:-1])))
        step = min(step, cap, longest_step / max(abs(here.tangent[-1]), 1e-12))
        try:
            there, step = _next(family, here, step, bend)
        except NotFollowedError as reason:
            beyond = _beyond_grazing(family, here)
            if beyond is not None:
                found.append(grazing(family, here, beyond))
                at.append(len(points) - 1)
                points.append(beyond)
                here, step, bend = beyond, FIRST_BEYOND, straight
                continue
            return Stretch(points, found, at, f"not followed beyond {_place(family, here)}: {reason}")
        leaves = not 0.0 <= there.x[-1] <= 1.0
        try:
            if leaves:
                there = _at_end(family, here, there)
            for each in bifurcations_between(family, here, there, closely=closely):
                found.append(each)
                at.append(len(points) - 1)
                if each.bifurcation.ends or (until is not None and until(each.bifurcation)):
                    points.append(each.point)
                    return Stretch(points, found, at, f"{each.bifurcation.kind} at {_place(family, each.point)}")
        except NotFollowedError as reason:
            if step > 1e3 * LEAST_STEP:
                step *= 0.05
                while at and at[-1] == len(points) - 1:
                    at.pop(), found.pop()
                continue
            return Stretch(points, found, at, f"not followed beyond {_place(family, here)}: {reason}")
        points.append(there)
        if leaves or there.x[-1] in (0.0, 1.0):
            return Stretch(points, found, at, f"end of the range at {_place(family, there)}")
        if _returns(begun, here, there) and len(points) > 3:
            return Stretch(points, found, at, "closed: the branch comes back to where it began")
        if there.largest_multiplier > most_unstable:
            return Stretch(points, found, at, f"multiplier {there.largest_multiplier:.3g} at {_place(family, there)}")
        length = max(float(matrices.norm(there.x - here.x)), LEAST_STEP)
        bend = Bend((there.tangent - here.tangent) / length, (there.slope - here.slope) / length)
        here = there
    return Stretch(points, found, at, f"{most_points} orbits: not followed beyond {_place(family, here)}")


def _place(family: OrbitFamily, point: OrbitPoint) -> str:
    return f"{family.field} = {family.value(point.x[-1]):.8g}"


def _next(family: OrbitFamily, here: OrbitPoint, step: float, bend: "Bend") -> tuple[OrbitPoint, float]:
    """The next orbit, and the step to try after it."""
    reason = ""
    while step >= LEAST_STEP:
        ahead = step * here.tangent + 0.5 * step**2 * bend.tangent
        beyond = here.x[-1] + ahead[-1]
        normal, length = here.tangent, step
        if not 0.0 <= beyond <= 1.0 and abs(here.tangent[-1]) > 0.05:
            # the last step ends on the border itself: no machine beyond the range is asked for
            border = float(np.clip(beyond, 0.0, 1.0))
            length = (border - here.x[-1]) / here.tangent[-1]
            if length < LEAST_STEP:
                length = LEAST_STEP
            ahead = length * here.tangent
            ahead[-1] = border - here.x[-1]
            normal = np.zeros_like(here.tangent)
            normal[-1] = np.sign(here.tangent[-1])
        sharp = False
        try:
            slope = here.slope + step * bend.slope
            there = family.solve(
                here.x + ahead, normal, slope, near=(here.solved,), measured=False, patient=step < SHORT
            )
            off = max(float(matrices.norm(there.x - here.x - ahead)) - max(ROUNDING, 10.0 * family.noise), 0.0)
            if step > 3.0 * LEAST_STEP:
                sharp = off > FAR * length
            if not sharp:
                there = family.measured(there)
        except NotFollowedError as failed:
            reason = str(failed)
            step = 0.3 * min(step, length)
            continue
        if _crossing(here, there):
            reason = "another branch crosses"
            step = 0.3 * min(step, length)
            continue
        turned = float(product(there.tangent, here.tangent))
        beside = _beside(here, there) if length > LONG else 0.0
        if step > 3.0 * LEAST_STEP and (sharp or turned < LEAST_COSINE or beside > BESIDE):
            reason = "the branch turns too sharply"
            step = 0.4 * min(step, length)
            continue
        grows = float(np.clip(np.sqrt(NEAR * length / max(off, 1e-12)), 0.5, 2.0))
        return there, max(grows * step, 2.0 * LEAST_STEP)
    raise NotFollowedError(reason or "no step is short enough")


def _crossing(here: OrbitPoint, there: OrbitPoint) -> bool:
    """True if two orbits with contacts lie on branches that cross: one is symmetric or of half the period, one not."""
    parts = there.symmetric != here.symmetric or there.halved != here.halved
    return parts and min(there.peaks.max(), here.peaks.max()) > 0.0


def _beside(here: OrbitPoint, there: OrbitPoint) -> float:
    """How far the chord of two orbits lies beside the mean of their tangents: much if another branch was met."""
    chord = there.x - here.x
    unit = chord / max(float(matrices.norm(chord)), 1e-300)
    return float(matrices.norm(unit - 0.5 * (here.tangent + there.tangent)))


def _beyond_grazing(family: OrbitFamily, here: OrbitPoint) -> OrbitPoint | None:
    """The orbit on the other side of a grazing that is just ahead, where the branch may turn back at a sharp angle."""
    for reach in BEYOND:
        ahead = here.x + reach * here.tangent
        try:
            if family.impacts(ahead) == here.impacts:
                continue
            tangent = family.tangent(ahead, here.tangent)
        except NotFollowedError:
            continue
        for sign, distance in ((sign, distance) for distance in BEYOND for sign in (1.0, -1.0)):
            try:
                there = family.solve(here.x + sign * distance * tangent, sign * tangent)
            except NotFollowedError:
                continue
            near = float(matrices.norm(there.x - here.x)) < 10.0 * distance
            if near and there.impacts != here.impacts and not _crossing(here, there):
                return there
    return None


def _at_end(family: OrbitFamily, here: OrbitPoint, beyond: OrbitPoint) -> OrbitPoint:
    """The orbit at the border of the range between one inside and one beyond."""
    from scipy.optimize import brentq

    border = 1.0 if beyond.x[-1] > 1.0 else 0.0
    share = float(brentq(lambda one: _s_between(family, here, beyond, one) - border, 0.0, 1.0, xtol=1e-12, disp=False))
    last = between(family, here, beyond, share, measured=False)
    normal = np.zeros_like(last.tangent)
    normal[-1] = np.sign(last.tangent[-1])
    return family.solve(np.append(last.x[:-1], border), normal, last.slope, near=(last.solved,))


def _s_between(family: OrbitFamily, here: OrbitPoint, beyond: OrbitPoint, share: float) -> float:
    point = beyond if share == 1.0 else here if share == 0.0 else between(family, here, beyond, share, measured=False)
    return float(point.x[-1])


def _repeats(points: list[OrbitPoint]) -> bool:
    """True if the last step passes by an orbit of the branch, the same way: on one curve that can't be."""
    if len(points) < LOOKED_AT:
        return False
    *before, here, there = points
    chord = there.x - here.x
    length = float(matrices.norm(chord))
    low, high = sorted((here.x[-1], there.x[-1]))
    for one in before[:-1]:
        if one.phase != there.phase or not low - PASSED * length <= one.x[-1] <= high + PASSED * length:
            continue
        share = float(product(one.x - here.x, chord)) / length**2
        if not 0.0 <= share <= 1.0 + PASSED or float(product(one.tangent, there.tangent)) < 0.5:
            continue
        if float(matrices.norm(interpolated(here, there, share) - one.x)) < PASSED * length:
            return True
    return False


def _returns(start: Begun, here: OrbitPoint, there: OrbitPoint) -> bool:
    """True if a step passes by where the branch began, the same way."""
    chord = there.x - here.x
    length = float(matrices.norm(chord))
    share = float(product(start.x - here.x, chord)) / length**2
    if not 0.0 <= share <= 1.0 or float(product(start.tangent, there.tangent)) < 0.5:
        return False
    return float(matrices.norm(here.x + share * chord - start.x)) < 0.2 * length
