"""Search for all branches of periodic orbits that a sweep along one field meets.

Every periodic point of the sweep seeds a branch, unless a branch passes through it already. Where a
stable orbit flips the doubled branch is followed too, and where it loses its symmetry one of the two new ones, which
mirror each other.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from tqdm import tqdm

from chaosgym.arrays import Array
from chaosgym.branches.bifurcation import Found, direction_of
from chaosgym.branches.bifurcation_diagram import BifurcationDiagram, Branch, SweepPoint
from chaosgym.branches.branch import MOST_UNSTABLE, Stretch, stretch
from chaosgym.branches.family_along import continuous_field, family_of, with_noise
from chaosgym.branches.orbit_family import NotFollowedError, OrbitFamily
from chaosgym.branches.orbit_point import OrbitPoint
from chaosgym.diagnosis.diagnose import diagnose
from chaosgym.diagnosis.periodic_orbit import find_periodic_orbit
from chaosgym.errors import ParameterError, SimulationError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.simulation import parallel_map

SWEEP = 41
"""Points of the sweep."""

SWEEP_BUDGET = 400
"""Cycles that each of them may take."""

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
        Points of the sweep from rest that seeds branches; 0 for none.
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
        If the field is unknown or does not vary continuously, or the span is empty or leaves the field's range.

    Examples
    --------
    >>> import chaosgym
    >>> diagram = chaosgym.follow(chaosgym.ImpactBeam(), "speed", (24.0, 26.0), sweep=3)  # doctest: +SKIP
    >>> [(one.kind, one.value) for one in diagram.bifurcations if one.loses_stability]  # doctest: +SKIP
    """
    name, (low, high) = continuous_field(machine, along), span
    if not low < high:
        raise ParameterError(f"{name} = {low:g} to {high:g} is empty or reversed; allowed: the lower value first")
    for value in (low, high):
        with_settings(machine, {name: value})
    points = _swept(machine, name, np.linspace(low, high, sweep), workers) if sweep else []
    seeds = [(p.value, p.state, p.period) for p in points if p.period is not None] + list(states)
    found = _Branches(machine, name, low, high, longest_period, most_unstable)
    for value, state, period in tqdm(seeds, desc="branch", unit="seed", delay=PATIENCE, disable=not progress):
        found.seed(value, np.asarray(state, dtype=float), period)
    return BifurcationDiagram(
        machine=machine, field=name, low=low, high=high, branches=tuple(found.branches), sweep=tuple(points)
    )


def _swept(machine: Machine, name: str, values: Array, workers: int | None) -> list[SweepPoint]:
    def one(value: float) -> SweepPoint:
        verdict = diagnose(with_settings(machine, {name: value}), budget=SWEEP_BUDGET)
        repeats = verdict.period if verdict.status == "certified" else None
        peaks = verdict.run.peak_force.max(axis=1)[-(repeats or SHOWN_PEAKS) :]
        state = np.asarray(verdict.evidence["final_state"])
        return SweepPoint(float(value), verdict.nature, repeats, peaks, state)

    return parallel_map(one, values, workers=workers)


class _Branches:
    """Branches found so far, and how to find more."""

    def __init__(
        self, machine: Machine, name: str, low: float, high: float, longest: int, most_unstable: float
    ) -> None:
        self.branches: list[Branch] = []
        self._machine, self._name, self._low, self._high = machine, name, low, high
        self._longest, self._most_unstable = longest, most_unstable

    def seed(self, value: float, state: Array, period: int) -> None:
        """Follow the branch through a state, and all that begin on it, unless it is known."""
        orbit = find_periodic_orbit(with_settings(self._machine, {self._name: value}), state, period)
        if orbit is None:
            return
        family = family_of(self._machine, self._name, self._low, self._high, orbit.state, period)
        family = with_noise(family, orbit.state)
        s = (value - self._low) / (self._high - self._low)
        try:
            start = family.solve(np.append(family.weight * orbit.state, s), _upwards(family, orbit.state))
        except NotFollowedError:
            return
        if self._known(family, start):
            return
        seed = f"seed at {self._name} = {value:.6g}"
        ahead = back = Stretch([start], [], [], seed)
        if s < 1.0:
            ahead = stretch(family, start, most_unstable=self._most_unstable)
        if s > 0.0 and not ahead.end.startswith("closed"):
            back = stretch(family, _turned(start, -1.0), most_unstable=self._most_unstable)
        self._add(_joined(family, back, ahead, seed))

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
        aside -= (aside @ at.point.tangent) * at.point.tangent
        normal = aside / np.linalg.norm(aside)
        for amplitude in AMPLITUDES[kind]:
            try:
                start = family.solve(at.point.x + amplitude * normal, normal)
            except NotFollowedError:
                continue
            apart = np.linalg.norm(parent.miss(start.x)) if family.period > parent.period else np.inf
            if apart > 0.1 * amplitude and not start.symmetric:
                break
        else:
            return
        if not 0.0 <= start.x[-1] <= 1.0 or self._known(family, start):
            return
        ahead = stretch(family, start, first_step=0.01, most_unstable=min(self._most_unstable, BESIDE))
        named = f"{at.bifurcation.kind} at {self._name} = {at.bifurcation.value:.8g}"
        self._add(_joined(family, Stretch([start], [], [], named), ahead, named))

    def _known(self, family: OrbitFamily, point: OrbitPoint) -> bool:
        """True if a branch passes through an orbit, or through its mirror image."""
        return any(
            _alike(found, point)
            for branch in self.branches
            if branch.period == family.period
            for found in _orbits_at(branch, float(point.x[-1]), point)
        )


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
