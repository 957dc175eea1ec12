"""Search for all branches of periodic orbits that a sweep along one field meets.

Every motion that rest or random starts lead to at a point of the sweep seeds a branch, if it repeats and no branch
passes through it already: with the shares of the starts that is a global continuation. Where a stable orbit flips the
doubled branch is followed too, and where it loses its symmetry one of the two new ones, which mirror each other.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from tqdm import tqdm

from chaosgym.arrays import Array
from chaosgym.branches.bifurcation import Found, direction_of
from chaosgym.branches.bifurcation_diagram import BifurcationDiagram, Branch, SweepPoint, SweptMotion
from chaosgym.branches.branch import MOST_UNSTABLE, Stretch, stretch
from chaosgym.branches.family_along import continuous_field, family_of, with_noise
from chaosgym.branches.orbit_family import NotFollowedError, OrbitFamily
from chaosgym.branches.orbit_point import OrbitPoint
from chaosgym.core import matrices
from chaosgym.core.matrices import product
from chaosgym.diagnosis.attractors import Attractors, attractors
from chaosgym.diagnosis.diagnose import diagnose
from chaosgym.diagnosis.periodic_orbit import find_periodic_orbit
from chaosgym.errors import ParameterError, SimulationError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.numbers import number, whole
from chaosgym.simulation.parallel import parallel_map

SWEEP = 41
"""Points of the sweep."""

SWEEP_BUDGET = 400
"""Cycles that each of them may take."""

SWEEP_STARTS = 16
"""Random starts at each point: what takes a fifth of them at one point is met there by 97 in 100 searches."""

SHOWN_PEAKS = 60
"""Peak forces of a point of the sweep that does not repeat."""

LONGEST_PERIOD = 4
"""Longest period of a doubled branch."""

BESIDE = 30.0
"""Largest multiplier up to which a branch that begins at a bifurcation is followed: it is stable there, or nearly."""

AMPLITUDES = {"flip": (5e-5, 2e-4, 1e-3, 4e-3), "symmetry breaking": (1e-3, 4e-3, 2e-4)}
"""Distances from a bifurcation, relative to the size of the motion, at which a new branch is looked for: a doubled
orbit may flip again soon, and one without symmetry is told from the symmetric one by its peaks."""

SAME = 1e-5
"""Relative difference of peaks and multipliers below which two orbits are one, or mirror each other."""

FAR_PEAKS = 1.3
"""Ratio of peaks beyond which an orbit is not looked for between two others."""

SAME_PLACE = 1e-6
"""Relative difference of two values at which branches meet."""

PATIENCE = 2.0
"""Time [s] after which a progress bar appears."""


def follow(
    machine: Machine,
    along: str,
    span: tuple[float, float],
    *,
    sweep: int = SWEEP,
    starts: int = SWEEP_STARTS,
    states: Sequence[tuple[float, Array, int]] = (),
    longest_period: int = LONGEST_PERIOD,
    most_unstable: float = MOST_UNSTABLE,
    workers: int | None = None,
    progress: bool = False,
) -> BifurcationDiagram:
    """Follow all branches of periodic orbits that a sweep along a field meets.

    Parameters
    ----------
    machine
        What runs; its own value of the field does not matter.
    along
        A field that varies continuously, or "speed" or "clearance".
    span
        Lowest and highest value, in the field's unit.
    sweep
        Points of the sweep that seeds branches; 0 for none.
    starts
        Random starts at each of them, beside rest; 0 for rest alone.
    states
        Further seeds: (value, state (n_states,) near a periodic orbit, period in cycles).
    longest_period
        Longest period of a branch that begins at a flip.
    most_unstable
        Largest multiplier up to which unstable orbits are followed; 30 at most where a branch begins at a bifurcation.
    workers
        Threads of the sweep; all processors by default.
    progress
        Show a progress bar on standard error if it takes more than two seconds.

    Raises
    ------
    ParameterError
        If the field is unknown or does not vary continuously, the span is empty or leaves the field's range, or a
        number is out of range.

    Examples
    --------
    >>> import chaosgym
    >>> diagram = chaosgym.follow(chaosgym.ImpactBeam(), "speed", (24.0, 26.0), sweep=3)  # doctest: +SKIP
    >>> [(one.kind, one.value) for one in diagram.bifurcations if one.loses_stability]  # doctest: +SKIP
    """
    name, (low, high) = continuous_field(machine, along), span
    sweep, longest_period = whole("sweep", sweep, 0, 10**6), whole("longest_period", longest_period, 1)
    number("most_unstable", most_unstable, 1.0)
    if not low < high:
        raise ParameterError(f"{name} = {low:g} to {high:g} is empty or reversed; allowed: the lower value first")
    for value in (low, high):
        with_settings(machine, {name: value})
    points = _swept(machine, name, np.linspace(low, high, sweep), starts, workers) if sweep else []
    found = _Branches(machine, name, low, high, longest_period, most_unstable)
    seeds = [
        (one.period, place, point.value, one.state)
        for place, (point, met) in enumerate(points)
        for one in (met.motions if met else ())
        if one.orbit is not None and one.period is not None
    ]
    seeds += [(p.period, place, p.value, p.state) for place, (p, met) in enumerate(points) if p.period and not met]
    seeds += [(period, len(points), value, np.asarray(state, dtype=float)) for value, state, period in states]
    # shorter periods first: a doubled branch then begins at its flip
    seeds.sort(key=lambda seed: seed[0])
    through: dict[int, list[int | None]] = {}
    for period, place, value, state in tqdm(seeds, desc="branch", unit="seed", delay=PATIENCE, disable=not progress):
        through.setdefault(place, []).append(found.seed(value, state, period))
    return BifurcationDiagram(
        machine=machine,
        field=name,
        low=low,
        high=high,
        branches=tuple(found.branches),
        sweep=tuple(
            _with_motions(point, met, through.get(place, []), found.branches)
            for place, (point, met) in enumerate(points)
        ),
    )


def _with_motions(
    point: SweepPoint, met: Attractors | None, through: list[int | None], branches: Sequence[Branch]
) -> SweepPoint:
    """The point with the motions that were met there, and other stable orbits of the branches.

    The branches ``through`` the proven ones of them are given in the order of their periods.
    """
    if met is None:
        return point
    proven = sorted((one for one in met.motions if one.orbit is not None), key=lambda one: one.period or 0)
    number = {id(one): branch for one, branch in zip(proven, through, strict=True)}
    there = {
        (branch, stretch): (one.period, peak)
        for branch, one in enumerate(branches, 1)
        for stretch, run in enumerate(one.stretches, 1)
        for peak in run.peaks_at(point.value)
    }
    motions = []
    for one in met.motions:
        own = number.get(id(one))
        stretch = min(
            (place for place in there if place[0] == own),
            key=lambda place: abs(there[place][1] - one.largest_peak),
            default=(own, None),
        )[1]
        motions.append(SweptMotion(own, stretch, one.nature, one.period, one.largest_peak, met.share(one)[0]))
    seen = {(one.branch, one.stretch) for one in motions}
    motions += [
        SweptMotion(*place, "periodic", period, peak, 0.0)
        for place, (period, peak) in there.items()
        if place not in seen
    ]
    return point._replace(motions=tuple(motions), starts=met.starts, unseen=met.unseen)


_Swept = tuple[SweepPoint, Attractors | None]
"""A point of the sweep, and the motions that random starts met there."""


def _swept(machine: Machine, name: str, values: Array, starts: int, workers: int | None) -> list[_Swept]:
    def one(value: float) -> _Swept:
        there = with_settings(machine, {name: value})
        verdict = diagnose(there, budget=SWEEP_BUDGET)
        repeats = verdict.period if verdict.status == "certified" else None
        peaks = verdict.run.peak_force.max(axis=1)[-(repeats or SHOWN_PEAKS) :]
        state = np.asarray(verdict.evidence["final_state"])
        point = SweepPoint(float(value), verdict.nature, repeats, peaks, state)
        if not starts:
            return point, None
        return point, attractors(there, starts=starts, budget=SWEEP_BUDGET, centre=verdict, workers=1)

    return parallel_map(one, values, workers=workers)


class _Branches:
    """Branches found so far, and how to find more."""

    def __init__(
        self, machine: Machine, name: str, low: float, high: float, longest: int, most_unstable: float
    ) -> None:
        self.branches: list[Branch] = []
        self._machine, self._name, self._low, self._high = machine, name, low, high
        self._longest, self._most_unstable = longest, most_unstable

    def seed(self, value: float, state: Array, period: int) -> int | None:
        """Follow the branch through a state, and all that begin on it, unless it is known; return its number from 1."""
        orbit = find_periodic_orbit(with_settings(self._machine, {self._name: value}), state, period)
        if orbit is None:
            return None
        family = family_of(self._machine, self._name, self._low, self._high, orbit.state, period)
        family = with_noise(family, orbit.state)
        s = (value - self._low) / (self._high - self._low)
        try:
            start = family.solve(np.append(family.weight * orbit.state, s), _upwards(family, orbit.state))
        except NotFollowedError:
            return None
        number = self._known(family, start)
        if number is not None:
            return number
        number = len(self.branches) + 1
        seed = f"seed at {self._name} = {value:.6g}"
        ahead = back = Stretch([start], [], [], seed)
        if s < 1.0:
            ahead = stretch(family, start, most_unstable=self._most_unstable)
        if s > 0.0 and not ahead.end.startswith("closed"):
            back = stretch(family, _turned(start, -1.0), most_unstable=self._most_unstable)
        self._add(_joined(family, back, ahead, seed))
        return number

    def _add(self, branch: Branch) -> None:
        self.branches.append(branch)
        for each in branch._found:
            if each.bifurcation.ends or not each.bifurcation.loses_stability:
                continue
            if each.bifurcation.kind == "flip" and 2 * branch.period <= self._longest:
                self._switch(branch._family, branch._family.with_period(2 * branch.period), each, -1.0)
            elif each.bifurcation.kind == "symmetry breaking":
                self._switch(branch._family, branch._family, each, 1.0)

    def _switch(self, parent: OrbitFamily, family: OrbitFamily, at: Found, multiplier: float) -> None:
        """Follow the branch that begins at a bifurcation of another one, unless one ends there."""
        parent, family = (one.at_phase(at.point.phase) for one in (parent, family))
        kind, value = at.bifurcation.kind, at.bifurcation.value
        if any(
            each.ends and each.kind == kind and abs(each.value - value) < SAME_PLACE * abs(value)
            for branch in self.branches
            if branch.period == family.period
            for each in branch.bifurcations
        ):
            return
        aside = np.append(direction_of(at.point, multiplier), 0.0)
        # the branch that is left must not meet the planes on which the new one is looked for
        aside -= product(aside, at.point.tangent) * at.point.tangent
        normal = aside / matrices.norm(aside)
        for amplitude in AMPLITUDES[kind]:
            try:
                start = family.solve(at.point.x + amplitude * normal, normal)
            except NotFollowedError:
                continue
            apart = matrices.norm(parent.miss(start.x)) if family.period > parent.period else np.inf
            if apart > 0.1 * amplitude and not start.symmetric:
                break
        else:
            return
        if not 0.0 <= start.x[-1] <= 1.0 or self._known(family, start) is not None:
            return
        ahead = stretch(family, start, first_step=0.01, most_unstable=min(self._most_unstable, BESIDE))
        named = f"{at.bifurcation.kind} at {self._name} = {at.bifurcation.value:.8g}"
        self._add(_joined(family, Stretch([start], [], [], named), ahead, named))

    def _known(self, family: OrbitFamily, point: OrbitPoint) -> int | None:
        """Number, from 1 on, of a branch that passes through an orbit or its mirror image; None if none does."""
        through = (
            number
            for number, branch in enumerate(self.branches, 1)
            if branch.period == family.period
            for found in _orbits_at(branch, float(point.x[-1]), point)
            if _alike(found, point)
        )
        return next(through, None)


def _upwards(family: OrbitFamily, state: Array) -> Array:
    normal = np.zeros(len(state) + 1)
    normal[-1] = 1.0
    return normal


def _turned(point: OrbitPoint, sign: float) -> OrbitPoint:
    """The orbit with its tangent the other way, if the sign is negative."""
    return replace(point, tangent=sign * point.tangent)


def _joined(family: OrbitFamily, back: Stretch, ahead: Stretch, begins: str) -> Branch:
    """One branch of two stretches that begin at the same orbit."""
    points = [*reversed(back.points), *ahead.points[1:]]
    first = len(back.points) - 1
    reverse = [
        Found(replace(each.bifurcation, impacts=each.bifurcation.impacts[::-1]), each.point)
        for each in reversed(back.found)
    ]
    found = [*reverse, *ahead.found]
    at = [*(first - 1 - place for place in reversed(back.at)), *(first + place for place in ahead.at)]
    return Branch(
        period=family.period,
        begins=begins,
        ends=(back.end, ahead.end),
        values=np.array([family.value(point.x[-1]) for point in points]),
        states=np.array([family.start(point) for point in points]),
        multipliers=np.array([point.multipliers for point in points]),
        peaks=np.array([point.peaks for point in points]),
        impacts=np.array([point.impacts for point in points]),
        bifurcations=tuple(each.bifurcation for each in found),
        at=tuple(at),
        _family=family,
        _points=tuple(points),
        _found=tuple(found),
    )


def _orbits_at(branch: Branch, s: float, like: OrbitPoint) -> Iterator[OrbitPoint]:
    """Orbits of a branch at s that may be the one sought."""
    places = np.array([point.x[-1] for point in branch._points])
    normal = np.zeros(len(like.x))
    normal[-1] = 1.0
    for i in np.flatnonzero((places[:-1] - s) * (places[1:] - s) <= 0.0):
        a, b = branch._points[i], branch._points[i + 1]
        near = np.sort([a.peaks, b.peaks], axis=1)
        sought = np.sort(like.peaks)
        if np.any(sought > FAR_PEAKS * near.max(axis=0)) or np.any(FAR_PEAKS * sought < near.min(axis=0)):
            continue
        share = (s - places[i]) / (places[i + 1] - places[i]) if places[i + 1] != places[i] else 0.0
        family = branch._family.at_phase(b.phase)
        try:
            before = a.x if a.phase == b.phase else branch._family.carried(a, b.phase)[0]
            guess = before + share * (b.x - before)
            guess[-1] = s
            yield family.solve(guess, normal)
        except (NotFollowedError, SimulationError):
            continue


def _alike(one: OrbitPoint, other: OrbitPoint) -> bool:
    """True if two orbits have the same multipliers and, on whichever sides, the same peaks."""
    peaks = np.sort(one.peaks), np.sort(other.peaks)
    leading = np.abs(one.multipliers[:2]), np.abs(other.multipliers[:2])
    return bool(
        np.allclose(*peaks, rtol=SAME, atol=SAME * max(float(peaks[0].max()), 1e-300))
        and np.allclose(*leading, rtol=1e2 * SAME, atol=1e2 * SAME)
    )
