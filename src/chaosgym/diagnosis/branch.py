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
from numpy.typing import NDArray

from chaosgym.diagnosis.bifurcation import Bifurcation, Found, between, bifurcations_between, grazing
from chaosgym.diagnosis.orbit_family import NotFollowedError, OrbitFamily, OrbitPoint

Array = NDArray[np.float64]

LEAST_STEP = 1e-7
"""Shortest step, in scaled unknowns."""

ROUNDING = 1e-9
"""Error of an orbit that is no sign of a bend, in scaled unknowns."""

MOST_POINTS = 4000
"""Orbits of one branch."""

LEAST_COSINE = 0.8
"""Of the angle by which the tangent may turn in one step."""

NEAR, FAR = 0.05, 0.3
"""Share of a step by which the orbit should, and by which it may lie away from where it is expected."""

BEYOND, FIRST_BEYOND = (1e-7, 1e-6, 1e-5, 1e-4), 1e-5
"""Distances at which a grazing ahead is looked for, and the orbit beyond it; and the first step after it."""

MOST_UNSTABLE = 30.0
"""Largest multiplier up to which a branch is followed."""


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
    """
    points: list[OrbitPoint] = [start]
    found: list[Found] = []
    at: list[int] = []
    here, step, bend = start, first_step, Bend(np.zeros_like(start.x), np.zeros_like(start.slope))
    while len(points) < MOST_POINTS:
        cap = longest_step * max(1.0, float(np.linalg.norm(here.x[:-1])))
        step = min(step, cap, longest_step / max(abs(here.tangent[-1]), 1e-12))
        try:
            there, step = _next(family, here, step, bend)
        except NotFollowedError as reason:
            beyond = _beyond_grazing(family, here)
            if beyond is not None:
                found.append(grazing(family, here, beyond))
                at.append(len(points) - 1)
                points.append(beyond)
                here, step, bend = beyond, FIRST_BEYOND, Bend(np.zeros_like(start.x), np.zeros_like(start.slope))
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
        if _returns(start, here, there) and len(points) > 3:
            return Stretch(points, found, at, "closed: the branch comes back to where it began")
        if there.largest_multiplier > most_unstable:
            return Stretch(points, found, at, f"multiplier {there.largest_multiplier:.3g} at {_place(family, there)}")
        length = max(float(np.linalg.norm(there.x - here.x)), LEAST_STEP)
        bend = Bend((there.tangent - here.tangent) / length, (there.slope - here.slope) / length)
        here = there
    return Stretch(points, found, at, f"{MOST_POINTS} orbits: not followed beyond {_place(family, here)}")


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
        try:
            there = family.solve(here.x + ahead, normal, here.slope + step * bend.slope)
        except NotFollowedError as failed:
            reason = str(failed)
            step = 0.3 * min(step, length)
            continue
        touching = min(there.peaks.max(), here.peaks.max()) > 0.0
        if there.symmetric != here.symmetric and touching and step > 3.0 * LEAST_STEP:
            reason = "another branch crosses"
            step = 0.3 * min(step, length)
            continue
        off = max(float(np.linalg.norm(there.x - here.x - ahead)) - max(ROUNDING, 10.0 * family.noise), 0.0)
        turned = float(there.tangent @ here.tangent)
        if step > 3.0 * LEAST_STEP and (off > FAR * length or turned < LEAST_COSINE):
            reason = "the branch turns too sharply"
            step = 0.4 * min(step, length)
            continue
        grows = float(np.clip(np.sqrt(NEAR * length / max(off, 1e-12)), 0.5, 2.0))
        return there, max(grows * step, 2.0 * LEAST_STEP)
    raise NotFollowedError(reason or "no step is short enough")


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
            if there.impacts != here.impacts and float(np.linalg.norm(there.x - here.x)) < 10.0 * distance:
                return there
    return None


def _at_end(family: OrbitFamily, here: OrbitPoint, beyond: OrbitPoint) -> OrbitPoint:
    """The orbit at the border of the range between one inside and one beyond."""
    from scipy.optimize import brentq

    border = 1.0 if beyond.x[-1] > 1.0 else 0.0
    share = float(brentq(lambda one: _s_between(family, here, beyond, one) - border, 0.0, 1.0, xtol=1e-12, disp=False))
    last = between(family, here, beyond, share)
    normal = np.zeros_like(last.tangent)
    normal[-1] = np.sign(last.tangent[-1])
    return family.solve(np.append(last.x[:-1], border), normal)


def _s_between(family: OrbitFamily, here: OrbitPoint, beyond: OrbitPoint, share: float) -> float:
    point = beyond if share == 1.0 else here if share == 0.0 else between(family, here, beyond, share)
    return float(point.x[-1])


def _returns(start: OrbitPoint, here: OrbitPoint, there: OrbitPoint) -> bool:
    """True if a step passes by where the branch began, the same way."""
    chord = there.x - here.x
    length = float(np.linalg.norm(chord))
    share = float((start.x - here.x) @ chord) / length**2
    if not 0.0 <= share <= 1.0 or float(start.tangent @ there.tangent) < 0.5:
        return False
    return float(np.linalg.norm(here.x + share * chord - start.x)) < 0.2 * length
