r"""The rule of thesis 5.5: which type follows from what a response and its neighbourhood do.

    III           the centre is not periodic; or points that are not periodic surround it; or attractors that coexist
                  at the centre have largest peaks more than 10 % apart
    II            otherwise, if some point exceeds the centre's largest peak by 10 % or is not periodic
    I             the rest
    undetermined  if the centre is

Points surround the centre if it lies in their convex hull: on both sides along one parameter, or, of machines that
deviate in several parameters at once, on no one side of it. So periodic and chaotic responses are mixed around it (case
III of 5.5.1); otherwise the chaotic ones fill a part of the region that the centre is beside (case II).

A point that is undetermined is not known to be periodic, and counts as not periodic.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.diagnosis.response import Type
from chaosgym.errors import DiagnosisError

FORCE_CHANGE = 0.10
"""Change of the largest peak force that matters: a quarter of the fatigue life (thesis 5.5.2)."""


CROSS = ((0, 0), (-1, 0), (1, 0), (0, -1), (0, 1))
"""The smallest neighbourhood: a point and, in tolerances of speed and of clearance, the four beside it."""


class Neighbour(NamedTuple):
    """One point of the neighbourhood: along which parameter, on which side (-1 or +1), and what it does."""

    parameter: str
    side: int
    nature: str
    largest_peak: float

    @property
    def place(self) -> str:
        """Where it lies, for people."""
        return f"{'above' if self.side > 0 else 'below'} the nominal {self.parameter}"


class Built(NamedTuple):
    """A machine of the region: its deviation in each parameter, in tolerances, and what it does."""

    shares: Mapping[str, float]
    nature: str
    largest_peak: float


def judge_type(
    nature: str,
    largest_peak: float,
    neighbours: Iterable[Neighbour],
    coexisting_peaks: Sequence[float] = (),
    built: Sequence[Built] = (),
) -> tuple[Type, str]:
    """Type of a response and its reason, from what the centre and its neighbourhood do.

    Parameters
    ----------
    nature, largest_peak
        Of the centre; the peak force in any unit.
    neighbours
        Points of the neighbourhood.
    coexisting_peaks
        Largest peaks at the centre from other initial states.
    built
        Machines that deviate in several parameters at once.

    Examples
    --------
    >>> judge_type("periodic", 50.0, [Neighbour("speed", 1, "chaotic", 60.0)])
    ('II', 'chaotic above the nominal speed')
    """
    neighbours = list(neighbours)
    if nature == "undetermined":
        return "undetermined", "the nominal response is undetermined"
    if nature != "periodic":
        return "III", f"the nominal response is {nature}"
    for peak in coexisting_peaks:
        if abs(peak - largest_peak) > FORCE_CHANGE * min(peak, largest_peak):
            return "III", f"another initial state leads to {peak:.3g} N instead of {largest_peak:.3g} N"
    restless = [point for point in neighbours if point.nature != "periodic"]
    for name in dict.fromkeys(point.parameter for point in restless):
        if len({point.side for point in restless if point.parameter == name}) == 2:
            return "III", f"not periodic on both sides along {name}"
    wild = [one for one in built if one.nature != "periodic"]
    found = f"{len(wild)} of {len(built)} machines in the tolerances are not periodic"
    found += f" ({sum(one.nature == 'undetermined' for one in wild)} undetermined)" if wild else ""
    if wild and surrounded([one.shares for one in wild] + [{point.parameter: point.side} for point in restless]):
        return "III", f"{found}, on all sides of the nominal one"
    if restless:
        return "II", f"{restless[0].nature} {restless[0].place}"
    if wild:
        return "II", found
    for point in neighbours:
        if point.largest_peak > (1.0 + FORCE_CHANGE) * largest_peak:
            more = point.largest_peak / largest_peak - 1.0 if largest_peak > 0.0 else np.inf
            return "II", f"peak force {more:.0%} higher {point.place}"
    worst = max((one.largest_peak for one in built), default=0.0)
    if worst > (1.0 + FORCE_CHANGE) * largest_peak:
        return "II", f"peak force up to {worst:.4g} N in the tolerances, nominal {largest_peak:.4g} N"
    return "I", "periodic throughout the neighbourhood, peak force less than 10 % higher"


def surrounded(points: Sequence[Mapping[str, float]]) -> bool:
    """Whether the origin lies in the convex hull of points, each given by its coordinates that are not zero.

    Examples
    --------
    >>> surrounded([{"speed": -1.0}, {"speed": 0.5}])
    True
    >>> surrounded([{"speed": 1.0, "gap": 0.2}, {"speed": 0.5, "gap": -1.0}])
    False
    """
    from scipy.optimize import nnls  # slow to import, and few questions need it

    names = sorted({name for point in points for name in point})
    places = np.array([[point.get(name, 0.0) for name in names] for point in points])
    equations = np.vstack([places.T, np.ones(len(places))])  # weights of sum 1 whose mean place is the origin
    return float(nnls(equations, np.append(np.zeros(len(names)), 1.0))[1]) < 1e-9


def type_of_cross(
    natures: Sequence[str] | NDArray[np.str_],
    largest_peaks: ArrayLike,
    fields: tuple[str, str] = ("speed", "clearance"),
) -> tuple[Type, str]:
    """Type and its reason of the centre of a cross, from natures and largest peaks (5,) in the order of ``CROSS``."""
    peaks = np.asarray(largest_peaks).tolist()
    around = [
        Neighbour(fields[0] if speed else fields[1], speed or clearance, nature, peak)
        for (speed, clearance), nature, peak in list(zip(CROSS, natures, peaks, strict=True))[1:]
    ]
    return judge_type(natures[0], peaks[0], around)


def types_on_grid(
    natures: ArrayLike, largest_peaks: ArrayLike, axes: Sequence[int] | None = None, reach: Sequence[int] | int = 2
) -> NDArray[np.str_]:
    """Types of all points of a grid whose neighbours are the points of the grid up to ``reach`` steps away.

    Parameters
    ----------
    natures : (...) of str
        Nature at each point.
    largest_peaks : (...)
        Largest peak force at each point.
    axes
        Axes along which tolerances lie; all by default. At the border neighbours of one side are missing.
    reach
        Steps of the grid in one tolerance, for all of ``axes`` or for each.

    Returns
    -------
    array of "I", "II", "III" or "undetermined", of the same shape.
    """
    nature, peak = np.asarray(natures), np.asarray(largest_peaks)
    if nature.shape != peak.shape:
        raise DiagnosisError(f"natures have shape {nature.shape} and peaks {peak.shape}; allowed: the same shape")
    chosen = range(nature.ndim) if axes is None else axes
    reaches = [reach] * len(chosen) if isinstance(reach, int) else reach
    types = np.empty(nature.shape, dtype="<U12")
    for index in np.ndindex(nature.shape):
        neighbours = []
        for axis, far in zip(chosen, reaches, strict=True):
            for step in range(-far, far + 1):  # 0 is the point itself, which differs from itself in nothing
                place = index[axis] + step
                if 0 <= place < nature.shape[axis]:
                    at = (*index[:axis], place, *index[axis + 1 :])
                    neighbours.append(Neighbour(f"axis {axis}", int(np.sign(step)), nature[at], float(peak[at])))
        types[index] = judge_type(str(nature[index]), float(peak[index]), neighbours)[0]
    return types
