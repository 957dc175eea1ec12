r"""The rule of thesis 5.5.1: which type follows from what a response and the region of its tolerances do.

    Case I      "If all the responses over the selected region are periodic": Type I where they are "well-behaved as
                the parameters vary", Type II where they "change irregularly"
    Case II     "If chaotic responses occur in a subset of the selected region, they are Type III"; the periodic rest
                is Type I or II
    Case III    "If periodic and chaotic responses distribute irregularly in the selected region, the responses are
                Type III": the periodic ones too

In numbers, for the point in the middle of its region:

    III           it is not periodic (case II; a quasiperiodic response is Type III by 5.5.2); or no straight cut
                  through the region parts the points that are periodic from those that are not (case III); or
                  a motion that coexists in the middle is not periodic, or its largest peak more than 10 % away
    II            otherwise, if some point of the region is not periodic, or has a largest peak more than 10 % higher
    I             the rest
    undetermined  if the point is, or if it is not III but other initial states do not settle

A cut is a plane in the space of the deviations, measured in tolerances. Along one parameter periodic and chaotic points
are mixed if their nature changes more than once. A point that is undetermined is not known to be periodic, and counts
as not periodic.
"""

from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.errors import DiagnosisError
from chaosgym.series.verdict import Type

FORCE_CHANGE = 0.10
"""Change of the largest peak force that matters: a quarter of the fatigue life (thesis 5.5.2)."""


CROSS = ((0, 0), (-1, 0), (1, 0), (0, -1), (0, 1))
"""The smallest neighbourhood: a point and, in tolerances of speed and of clearance, the four beside it."""


UNSETTLED = "undetermined"
"""Nature of what other initial states do that do not settle within the budget."""


class Coexisting(NamedTuple):
    """Another motion in the middle of the region, from another initial state; its nature may be ``UNSETTLED``."""

    nature: str
    largest_peak: float


class Neighbour(NamedTuple):
    """A point of the region: its deviation in each parameter that deviates, in tolerances, and what it does."""

    shares: Mapping[str, float]
    nature: str
    largest_peak: float

    @property
    def place(self) -> str:
        """Where it lies, for people."""
        sides = (f"{'above' if share > 0 else 'below'} the nominal {name}" for name, share in self.shares.items())
        return " and ".join(sides)


def judge_type(
    nature: str, largest_peak: float, neighbours: Iterable[Neighbour], coexisting: Sequence[Coexisting] = ()
) -> tuple[Type, str]:
    """Type of a response and its reason, from what it and the region around it do.

    Parameters
    ----------
    nature, largest_peak
        Of the point in the middle; the peak force in any unit.
    neighbours
        The other points of the region.
    coexisting
        The other motions in the middle.

    Examples
    --------
    >>> judge_type("periodic", 50.0, [Neighbour({"speed": 1.0}, "chaotic", 60.0)])
    ('II', 'chaotic above the nominal speed')
    >>> judge_type("periodic", 50.0, [Neighbour({"speed": s}, "chaotic", 60.0) for s in (-1.0, 1.0)])
    ('III', '2 of 3 points in the tolerances are not periodic, mixed with periodic ones')
    """
    points = list(neighbours)
    if nature == "undetermined":
        return "undetermined", "the nominal response is undetermined"
    if nature != "periodic":
        return "III", f"the nominal response is {nature}"
    settled = [one for one in coexisting if one.nature != UNSETTLED]
    for other in settled:
        if other.nature != "periodic":
            return "III", f"another initial state leads to a {other.nature} motion, up to {other.largest_peak:.3g} N"
        if apart(other.largest_peak, largest_peak):
            return "III", f"another initial state leads to {other.largest_peak:.3g} N instead of {largest_peak:.3g} N"
    kind, reason = _by_the_region(points, largest_peak)
    if kind != "III" and len(settled) < len(coexisting):
        return "undetermined", "other initial states do not settle within the budget"
    return kind, reason


def _by_the_region(points: Sequence[Neighbour], largest_peak: float) -> tuple[Type, str]:
    """Type of a periodic response and its reason, by the points around it alone."""
    restless = [point for point in points if point.nature != "periodic"]
    if restless:
        are = "is" if len(restless) == 1 else "are"
        found = f"{len(restless)} of {len(points) + 1} points in the tolerances {are} not periodic"
        unknown = sum(point.nature == "undetermined" for point in restless)
        found += f" ({unknown} undetermined)" if unknown else ""
        calm = [point.shares for point in points if point.nature == "periodic"]
        if mixed([point.shares for point in restless], [{}, *calm]):
            return "III", f"{found}, mixed with periodic ones"
        nearest = min(restless, key=lambda point: len(point.shares))
        return "II", f"{nearest.nature} {nearest.place}" if len(nearest.shares) == 1 else found
    highest = max(points, key=lambda point: point.largest_peak, default=None)
    if highest is not None and highest.largest_peak > (1.0 + FORCE_CHANGE) * largest_peak:
        more = highest.largest_peak / largest_peak - 1.0 if largest_peak > 0.0 else np.inf
        return "II", f"peak force {more:.0%} higher {highest.place}"
    return "I", "periodic throughout the tolerances, peak force less than 10 % higher"


def apart(peak: float, other: float) -> bool:
    """Whether two largest peak forces differ by what matters."""
    return abs(peak - other) > FORCE_CHANGE * min(peak, other)


def mixed(some: Sequence[Mapping[str, float]], others: Sequence[Mapping[str, float]]) -> bool:
    """Whether no plane parts two sets of points, each point given by its coordinates that are not zero.

    That is so exactly where the convex hulls of the two sets meet.

    Examples
    --------
    >>> mixed([{"speed": 1.0}, {"speed": 0.5, "gap": 1.0}], [{}, {"speed": -1.0}])
    False
    >>> mixed([{"speed": 0.5}], [{}, {"speed": 1.0}])
    True
    """
    names = sorted({name for point in (*some, *others) for name in point})
    first, second = (
        np.array([[point.get(name, 0.0) for name in names] for point in points]) for points in (some, others)
    )
    across = first.mean(axis=0) - second.mean(axis=0)  # parts most sets that can be parted
    if (first @ across).min() > (second @ across).max():
        return False
    from scipy.optimize import linprog  # slow to import, and few questions need it

    # weights of each set, of sum 1, with the same mean point
    equations = np.block(
        [
            [first.T, -second.T],
            [np.ones(len(first)), np.zeros(len(second))],
            [np.zeros(len(first)), np.ones(len(second))],
        ]
    )
    found = linprog(np.zeros(equations.shape[1]), A_eq=equations, b_eq=[0.0] * len(names) + [1.0, 1.0])
    return bool(found.status == 0)


def type_of_cross(
    natures: Sequence[str] | NDArray[np.str_],
    largest_peaks: ArrayLike,
    fields: tuple[str, str] = ("speed", "clearance"),
) -> tuple[Type, str]:
    """Type and its reason of the centre of a cross, from natures and largest peaks (5,) in the order of ``CROSS``."""
    peaks = np.asarray(largest_peaks).tolist()
    around = [
        Neighbour({fields[0] if speed else fields[1]: float(speed or clearance)}, nature, peak)
        for (speed, clearance), nature, peak in list(zip(CROSS, natures, peaks, strict=True))[1:]
    ]
    return judge_type(natures[0], peaks[0], around)


def types_on_grid(
    natures: ArrayLike, largest_peaks: ArrayLike, axes: Sequence[int] | None = None, reach: Sequence[int] | int = 2
) -> NDArray[np.str_]:
    """Types of all points of a grid, each over the points of the grid up to ``reach`` steps away along each axis.

    Parameters
    ----------
    natures : (...) of str
        Nature at each point.
    largest_peaks : (...)
        Largest peak force at each point.
    axes
        Axes along which tolerances lie; all by default. At the border a part of the region is missing.
    reach
        Steps of the grid in one tolerance, for all of ``axes`` or for each.

    Returns
    -------
    array of "I", "II", "III" or "undetermined", of the same shape.
    """
    nature, peak = np.asarray(natures), np.asarray(largest_peaks)
    if nature.shape != peak.shape:
        raise DiagnosisError(f"natures have shape {nature.shape} and peaks {peak.shape}; allowed: the same shape")
    chosen = list(range(nature.ndim) if axes is None else axes)
    reaches = [reach] * len(chosen) if isinstance(reach, int) else list(reach)
    names = [f"axis {axis}" for axis in chosen]
    moves = [range(-far, far + 1) for _, far in zip(chosen, reaches, strict=True)]
    region = [dict(zip(names, steps, strict=True)) for steps in product(*moves) if any(steps)]
    types = np.empty(nature.shape, dtype="<U12")
    for index in np.ndindex(nature.shape):
        neighbours = []
        for steps in region if nature[index] == "periodic" else ():
            at = list(index)
            for axis, step in zip(chosen, steps.values(), strict=True):
                at[axis] += step
            if all(0 <= place < size for place, size in zip(at, nature.shape, strict=True)):
                shares = {name: float(step) for name, step in steps.items() if step}
                neighbours.append(Neighbour(shares, str(nature[tuple(at)]), float(peak[tuple(at)])))
        types[index] = judge_type(str(nature[index]), float(peak[index]), neighbours)[0]
    return types
