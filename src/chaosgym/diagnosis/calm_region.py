"""Where a grid over speed and clearance is of Type I: the largest clearance for all its speeds, and calm speeds.

It is what a designer asks of a map. A point counts as calm if its type, judged over the tolerances around it, is I.
Between two points of the grid nothing is known, so the answer names the grid's steps. A point of unknown type neither
passes nor fails: the limit then lies between two clearances, and the answer says what would tell more.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.diagnosis.attractors import most_unseen
from chaosgym.errors import DiagnosisError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import is_half_play, parameters_of
from chaosgym.plain import Result

ALONE = "alone; other initial states were not tried"
"""How points are judged where nothing else was run."""

FIXED_STARTS = 3
"""Initial states that are rest and two made of the state that rest leads to."""

DISPLAYED = {"m": ("mm", 1e3), "rad": ("arcmin", 10_800.0 / np.pi)}
"""By unit of a clearance: the unit in which it is told, and how many of it one is."""


class Failure(NamedTuple):
    """The first point that is known to fail: its clearance [m, rad], its speed, and its type, II or III."""

    clearance: float
    speed: float
    type: str


class CalmRange(NamedTuple):
    """Neighbouring speeds of a grid that are all of Type I, from the lowest to the highest."""

    low: float
    high: float

    def margin(self, speed: float) -> float:
        """Distance of a speed within to the nearer end, as a share of the speed; negative outside."""
        return min(speed - self.low, self.high - speed) / speed


@dataclass(frozen=True, kw_only=True)
class CalmRegion(Result):
    """Where a grid is of Type I.

    Attributes
    ----------
    machine
        Its own speed and clearance are the point that margins are told of.
    speed : (n_speeds,)
        Of the grid, rising, in the unit of the machine's speed.
    clearance : (n_clearances,)
        Of the grid, rising: half of the play [m], or [rad] of what turns; with one stop the gap to it.
    largest_clearance
        The largest up to which every point at every speed is known to be of Type I; None if the smallest is not.
    failure
        The lowest speed that fails at the smallest clearance at which one is known to. None if there is none.
    at_clearance
        The clearance of the grid that is nearest to the machine's own.
    ranges
        Speeds that are of Type I there.
    unknown
        Number of points of unknown type; they count neither as calm nor as failed.
    unknown_below
        How many of them decide the largest clearance: those below the clearance of the failure.
    unknown_beside
        How many of them are at ``at_clearance``.
    searched
        A phrase on how far was looked at each point.
    settled_by
        A phrase on what would tell unknown types; empty where nothing is known to.
    """

    shows = (
        "largest_clearance clearance_margin failure at_clearance ranges margin unknown unknown_below unknown_beside "
        "searched settled_by"
    )

    machine: Machine
    speed: tuple[float, ...]
    clearance: tuple[float, ...]
    largest_clearance: float | None
    failure: Failure | None
    at_clearance: float
    ranges: tuple[CalmRange, ...]
    unknown: int
    unknown_below: int
    unknown_beside: int
    searched: str
    settled_by: str

    @property
    def margin(self) -> float | None:
        """Distance of the machine's own speed to the end of its calm range, as a share of it; None if it is in none."""
        speed = self._own_speed
        return next((one.margin(speed) for one in self.ranges if one.low <= speed <= one.high), None)

    @property
    def clearance_margin(self) -> float | None:
        """How far the machine's own clearance is below the largest, as a share of it; negative above; None without."""
        limit = self.largest_clearance
        return None if not limit else 1.0 - float(getattr(self.machine, self.machine.clearance_field)) / limit

    @property
    def _own_speed(self) -> float:
        return float(getattr(self.machine, self.machine.speed_field))

    @property
    def lines(self) -> list[str]:
        """Return a sentence on the clearance, one on the speeds, and one on how far was looked and what tells more."""
        clearance = [self._clearance_line()] if len(self.clearance) > 1 else []
        unknown = self.unknown_below if clearance else self.unknown_beside
        settled = f"; unknown types: {self.settled_by}" if unknown and self.settled_by else ""
        return [*clearance, *self._speed_line(), f"each point is judged {self.searched}{settled}"]

    def _clearance_line(self) -> str:
        speeds = f"every speed of the grid from {self._speeds(self.speed[0], self.speed[-1])}"
        if len(self.speed) == 1:
            speeds = self._speeds(self.speed[0])
        limit, failure = self.largest_clearance, self.failure
        if limit is not None:
            begins = f"up to a clearance of {self._play(limit)}, {speeds} is {self._type_i}"
            return f"{begins}; {self._beyond}{self._own_clearance}"
        if failure is None:
            whether = f"whether a clearance keeps {speeds} at {self._type_i} is unknown"
            return f"{whether}: {self._untold}, and none is known to fail"
        fails = f"{self._speeds(failure.speed)} is Type {failure.type}"
        if not self.unknown_below:
            smallest = self._play(failure.clearance)
            return f"no clearance of the grid keeps {speeds} at {self._type_i}: at the smallest, {smallest}, {fails}"
        return (
            f"the largest clearance at which {speeds} is {self._type_i} is below {self._play(failure.clearance)}, "
            f"where {fails}; how far below is unknown: {self._untold}"
        )

    @property
    def _beyond(self) -> str:
        """What is known above the largest clearance."""
        failure = self.failure
        if failure is None:
            return f"above, {self._untold}" if self.unknown_below else "no larger one was tried"
        fails = f"{self._speeds(failure.speed)} is Type {failure.type}"
        if self.unknown_below:
            return f"the limit is below {self._length(failure.clearance)}, where {fails}: in between {self._untold}"
        return f"at the next, {self._length(failure.clearance)}, {fails}"

    @property
    def _untold(self) -> str:
        """How many types are unknown, of those that decide the largest clearance."""
        below = [one for one in self.clearance if self.failure is None or one < self.failure.clearance]
        among = len(self.speed) * sum(one > (self.largest_clearance or -1.0) for one in below)
        return f"{self.unknown_below} of {among} types are unknown"

    @property
    def _own_clearance(self) -> str:
        """How far the machine's own clearance is from the largest."""
        margin = self.clearance_margin
        if margin is None:
            return ""
        own = self._length(float(getattr(self.machine, self.machine.clearance_field)))
        return f"; its own, {own}, is " + (f"{margin:.0%} below that" if margin >= 0.0 else "above that")

    def _speed_line(self) -> list[str]:
        if len(self.speed) < 2:
            return []
        place = f"at a clearance of {self._length(self.at_clearance)}"
        step = self._speeds(float(np.diff(self.speed).max()))
        among = f"{self.unknown_beside} of {len(self.speed)} types are unknown"
        if not self.ranges:
            known = f"known to be Type I: {among}" if self.unknown_beside else self._type_i
            return [f"{place}, no speed of the grid is {known} (steps up to {step})"]
        spans = ", ".join(self._speeds(one.low, one.high) for one in self.ranges)
        besides = f"; {among}" if self.unknown_beside else ""
        return [f"{place}, {self._type_i} at {spans} (steps up to {step}){besides}; {self._own_place()}"]

    @property
    def _type_i(self) -> str:
        """Type I, and the condition under which it is said."""
        return f"Type I from {self.machine.begins_from()}" if self.searched.endswith(ALONE) else "Type I"

    def _own_place(self) -> str:
        own, margin = f"its own speed, {self._speeds(self._own_speed)},", self.margin
        if margin is None:
            return f"{own} is in none of these"
        return f"{own} is {margin:.1%} from an end of them" if margin > 0.0 else f"{own} is an end of them"

    def _speeds(self, low: float, high: float | None = None) -> str:
        unit = parameters_of(self.machine)[self.machine.speed_field].unit
        return f"{low:.4g} {unit}" if high is None or high == low else f"{low:.4g} to {high:.4g} {unit}"

    def _length(self, clearance: float) -> str:
        unit = parameters_of(self.machine)[self.machine.clearance_field].unit
        name, size = DISPLAYED.get(unit, (unit, 1.0))
        return f"{size * clearance:.4g} {name}"

    def _play(self, clearance: float) -> str:
        if not is_half_play(self.machine, self.machine.clearance_field):
            return f"{self._length(clearance)} (the gap to the stop)"
        return f"{self._length(clearance)} (half of the play; the play is {self._length(2.0 * clearance)})"


def calm_region(
    machine: Machine,
    speeds: ArrayLike,
    clearances: ArrayLike,
    types: ArrayLike,
    searched: str = f"by runs from rest {ALONE}",
    settled_by: str = "",
) -> CalmRegion:
    """Find where a grid of types is I: the largest clearance for all its speeds, and the calm ranges of speed.

    Parameters
    ----------
    machine
        The machine as it is.
    speeds, clearances : (n_speeds,), (n_clearances,)
        Of the grid, in any order; in the units of the fields.
    types : (n_speeds, n_clearances) of str
        "I", "II", "III" or "undetermined".
    searched
        How far was looked at each point, as it follows "is judged".
    settled_by
        What would tell unknown types, as it follows a colon.

    Raises
    ------
    DiagnosisError
        If the shapes do not fit.

    Examples
    --------
    >>> types = [["I", "I", "I"], ["I", "I", "III"], ["I", "II", "III"]]
    >>> found = calm_region(chaosgym.ImpactBeam(), [10.0, 12.0, 14.0], [1e-4, 2e-4, 3e-4], types)
    >>> found.largest_clearance, found.failure
    (0.0001, Failure(clearance=0.0002, speed=14.0, type='II'))
    >>> found.ranges
    (CalmRange(low=10.0, high=14.0),)
    """
    speed, clearance, kind = np.asarray(speeds, float), np.asarray(clearances, float), np.asarray(types, str)
    if not speed.size or not clearance.size or kind.shape != (speed.size, clearance.size):
        raise DiagnosisError(
            f"types have shape {kind.shape}; allowed: {(speed.size, clearance.size)}, speeds by clearances, none empty"
        )
    up, across = np.argsort(clearance), np.argsort(speed)
    speed, clearance, kind = speed[across], clearance[up], kind[np.ix_(across, up)]
    calm, unknown = kind == "I", kind == "undetermined"
    first = int(np.argmin([*calm.all(axis=0), False]))
    failing = np.argwhere((~calm & ~unknown).T)[:1].tolist()
    failure = None
    for at, which in failing:
        failure = Failure(float(clearance[at]), float(speed[which]), str(kind[which, at]))
    below = failing[0][0] if failing else len(clearance)
    own = int(np.argmin(np.abs(clearance - getattr(machine, machine.clearance_field))))
    edges = np.flatnonzero(np.diff([False, *calm[:, own], False]))
    return CalmRegion(
        machine=machine,
        speed=tuple(speed.tolist()),
        clearance=tuple(clearance.tolist()),
        largest_clearance=float(clearance[first - 1]) if first else None,
        failure=failure,
        at_clearance=float(clearance[own]),
        ranges=tuple(
            CalmRange(float(speed[low]), float(speed[high - 1])) for low, high in edges.reshape(-1, 2).tolist()
        ),
        unknown=int(unknown.sum()),
        unknown_below=int(unknown[:, :below].sum()),
        unknown_beside=int(unknown[:, own].sum()),
        searched=searched,
        settled_by=settled_by,
    )


def searched_by(machine: Machine, initial_states: int) -> str:
    """How far ``initial_states`` of ``response_type`` look at each point of a machine, as it follows "is judged".

    Examples
    --------
    >>> from chaosgym.diagnosis.calm_region import searched_by
    >>> searched_by(chaosgym.ImpactBeam(), 3)
    'by runs from rest over its tolerances, and at the point by the mirror image and the half of the state they lead to'
    """
    if initial_states == 1:
        return f"by runs from {machine.begins_from()} {ALONE}"
    others = f"{random_starts(initial_states)} and states carried along the speed"
    if initial_states == FIXED_STARTS:
        others = "the mirror image and the half of the state they lead to"
    return f"by runs from {machine.begins_from()} over its tolerances, and at the point by {others}"


def random_starts(starts: int) -> str:
    """Random starts that all settle as one does, and what that says of others.

    Examples
    --------
    >>> from chaosgym.diagnosis.calm_region import random_starts
    >>> random_starts(48)
    '48 random starts (a motion that was not met takes at most 6.1% of them, 95 %)'
    """
    return (
        f"{starts} random starts (a motion that was not met takes at most {most_unseen(0, starts):.1%} of them, 95 %)"
    )
