"""The motions that a machine settles on from many initial states, and how far was looked.

    random starts        independent states of a stated box, a number fixed beforehand: shares and their bounds
    rest, its mirror     further starts: they add motions, not confidence
    image and half, and
    states carried up
    and down the speed

All starts run side by side in stages. One leaves as soon as it nears a known orbit and is ten times nearer to it than
to any other, or moves on a known chaotic set. One whose section returns is handed to Newton's method, which proves a
new orbit. One that is irregular for 256 cycles is diagnosed: chaotic and quasiperiodic motions are sets of states. Some
starts on a set run on to the end of the budget; if one leaves it for an orbit, all do, since that chaos is transient.
What no test decides at the end of the budget is reported as unsettled.

Mapper, basin fractions and matching by distance are those of G. Datseris, K. Luiz Rossi and A. Wagemakers, Chaos 33
(2023) 073151 (Attractors.jl).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.diagnosis.carried import Carried
from chaosgym.diagnosis.diagnose import diagnose_alone
from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit, find_periodic_orbit
from chaosgym.diagnosis.proof import NEAR, primitive, returning_period
from chaosgym.diagnosis.start_box import StartBox, start_box
from chaosgym.diagnosis.verdict import MachineDiagnosis
from chaosgym.errors import DiagnosisError, SimulationError
from chaosgym.machines import Machine
from chaosgym.series.verdict import Nature
from chaosgym.simulation import CycleRecord, MotionState, parallel_map, rest_state, simulate

STARTS = 48
"""Random starts: where all settle alike, another motion takes at most 6.1 % of such starts, with 95 % confidence."""

CONFIDENCE = 0.95
"""Of every bound on a share."""

FIRST_STAGE = 16
"""Cycles of the first stage; after each the run is twice as long."""

IRREGULAR = 256
"""Cycles after which a start that neither returns nor nears a motion is diagnosed."""

MOST_DIAGNOSES = 6
"""Of irregular starts in one search."""

WATCHED = 6
"""Starts on a set that run on to the end of the budget; if one leaves it, all do."""

ARRIVED, APART = 1e-2, 0.1
"""Distance from an orbit at which a start has arrived, relative to the larger of orbit and box, and the largest ratio
of it to the distance from any other orbit."""

APPROACHES, CLOSELY = 3, 1e-6
"""Periods over which the distance of a start that has arrived must have fallen, and the one at which it need not."""

RETURNS = 1e-2
"""Largest miss of a section that is handed to Newton's method, relative to the same."""

SAME = 1e-3
"""Distance of two orbits that are one, and miss of a motion that repeats."""

NEUTRAL = 1.0 - 1e-6
"""Largest multiplier from which on an orbit is neutral: it belongs to a family of orbits that lie side by side, such as
all that friction holds."""

WITHIN = 3.0
"""Ratio of the distances between neighbouring states, from a start to a set and within the set, up to which the start
moves on the set."""

TAIL, LEAST_SET = 64, 100
"""States of a start that are compared with a set, and the fewest states of a set."""


@dataclass(frozen=True, kw_only=True)
class Attractor:
    """A motion that a machine settles on.

    Attributes
    ----------
    nature, period
        As of a verdict.
    peaks : (sides,)
        Largest contact force on each surface [N].
    state : (n_states,)
        One of its states, at the start of a cycle.
    states : (k, n_states)
        All of a period, or those of the diagnosed run.
    orbit
        The proven orbit, or None.
    random_starts
        How many of the random starts settle on it.
    from_starts
        Names of the other starts that do, such as "rest".
    """

    nature: Nature
    period: int | None
    peaks: Array
    state: Array = field(repr=False)
    states: Array = field(repr=False)
    orbit: PeriodicOrbit | None = field(default=None, repr=False)
    random_starts: int = 0
    from_starts: tuple[str, ...] = ()

    @property
    def largest_peak(self) -> float:
        """Largest contact force [N]."""
        return float(self.peaks.max())

    @property
    def neutral(self) -> bool:
        """True for a family of orbits side by side, of which each start settles on another; its force is the largest.

        Motions of undamped modes without contact are such a family too.
        """
        if self.period is None:
            return not self.peaks.any()
        return self.orbit is not None and self.orbit.largest_multiplier > NEUTRAL

    @property
    def words(self) -> str:
        """Nature, period and force, such as "periodic, period 1, up to 0.317 N"."""
        period = f", period {self.period}" if self.period else ""
        force = f"up to {self.largest_peak:.3g} N" if self.largest_peak > 0.0 else "without contact"
        return f"{self.nature}{period}, {'neutral, ' if self.neutral else ''}{force}"

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "nature": self.nature,
            "period": self.period,
            "largest_peak": self.largest_peak,
            "peaks_N": self.peaks.tolist(),
            "random_starts": self.random_starts,
            "from_starts": list(self.from_starts),
            "largest_multiplier": None if self.orbit is None else self.orbit.largest_multiplier,
            "state": self.state.tolist(),
        }


@dataclass(frozen=True, kw_only=True)
class Attractors:
    """The motions of a machine, and how far was looked.

    Attributes
    ----------
    motions
        The one that the verdict is about first, then by their share of the random starts.
    starts
        Random starts.
    unsettled
        How many of them did not settle within the budget, or could not be followed.
    further_unsettled
        Names of the other starts that did not.
    box
        Where the random starts come from.
    carried
        Names of the states that were carried along the speed, such as "run-up from 0.5 Hz".
    cycles
        Cycles of all runs, Newton's method included.
    budget
        Cycles that a start may take.
    seed
        Of the random starts.
    """

    motions: tuple[Attractor, ...]
    starts: int
    unsettled: int
    further_unsettled: tuple[str, ...]
    box: StartBox = field(repr=False)
    carried: tuple[str, ...]
    cycles: int
    budget: int
    seed: int

    @property
    def unseen(self) -> float:
        """Bound on the share of the random starts that other motions take, which were not seen; see ``most_unseen``."""
        return most_unseen(self.unsettled, self.starts) if self.starts else 1.0

    def share(self, motion: Attractor) -> tuple[float, float, float]:
        """Share of the random starts that settle on a motion, with its exact 95 % interval (Clopper and Pearson)."""
        return share_of(motion.random_starts, self.starts)

    @property
    def searched(self) -> str:
        """A phrase on how far was looked, and what follows from it."""
        random = f"{self.starts} random starts up to {self.box.reach:.2g} {self.box.measure}"
        looked = ", ".join([random] if self.starts else ["rest", "its mirror image", "half of it"])
        looked = " and ".join([looked, *self.carried])
        if len(self.motions) == 1:
            came = "all came back" if not self.unsettled and not self.further_unsettled else "the others came back"
        else:
            came = f"{len(self.motions)} motions were met"
        lost = f", {self.unsettled} of them unsettled after {self.budget} cycles" if self.unsettled else ""
        lost += f"; not settled from {', '.join(self.further_unsettled)}" if self.further_unsettled else ""
        if not self.starts:
            return f"{looked}{lost}: {came}; random starts were not tried"
        kind = "another motion takes" if len(self.motions) == 1 else "motions not met take"
        return f"{looked}{lost}: {came}; {kind} at most {self.unseen:.1%} of such starts (95 %)"

    @property
    def other_motions(self) -> tuple[str, ...]:
        """A phrase on every motion but the first, with its share of the starts."""
        lasts = f" for at least {self.budget} cycles"
        return tuple(
            f"{one.words}{'' if one.nature == 'periodic' else lasts}, {self._reached(one)}" for one in self.motions[1:]
        )

    def told_of(self, verdict: MachineDiagnosis) -> MachineDiagnosis:
        """The verdict on the first motion, with the others and how far was looked."""
        return replace(verdict, other_motions=self.other_motions, searched=self.searched)

    def _reached(self, one: Attractor) -> str:
        ways = list(one.from_starts)
        if one.random_starts:
            share, low, high = self.share(one)
            ways.insert(0, f"{one.random_starts} of {self.starts} random starts ({share:.0%}; {low:.0%} to {high:.0%})")
        return f"from {', '.join(ways)}"

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        shares = [self.share(one) if self.starts else None for one in self.motions]
        return {
            "motions": [
                {**one.as_dict(), "share": None if share is None else list(share)}
                for one, share in zip(self.motions, shares, strict=True)
            ],
            "starts": self.starts,
            "unsettled": self.unsettled,
            "further_unsettled": list(self.further_unsettled),
            "unseen": self.unseen,
            "reach": self.box.reach,
            "scale": self.box.scale.tolist(),
            "carried": list(self.carried),
            "cycles": self.cycles,
            "budget": self.budget,
            "seed": self.seed,
            "searched": self.searched,
        }


def most_unseen(seen: int, starts: int) -> float:
    """Largest share that agrees with so many of some starts, at 95 % confidence, one-sided (Clopper and Pearson).

    Examples
    --------
    >>> from chaosgym.diagnosis.attractors import most_unseen
    >>> round(most_unseen(0, 48), 4)
    0.0605
    """
    from scipy.special import betaincinv  # slow to import

    return 1.0 if seen == starts else float(betaincinv(seen + 1, starts - seen, CONFIDENCE))


def share_of(seen: int, starts: int) -> tuple[float, float, float]:
    """Share, and the ends of its exact 95 % interval, two-sided (Clopper and Pearson).

    Examples
    --------
    >>> from chaosgym.diagnosis.attractors import share_of
    >>> [round(value, 3) for value in share_of(12, 48)]
    [0.25, 0.136, 0.396]
    """
    from scipy.special import betaincinv

    aside = 0.5 * (1.0 - CONFIDENCE)
    low = float(betaincinv(seen, starts - seen + 1, aside)) if seen else 0.0
    high = float(betaincinv(seen + 1, starts - seen, 1.0 - aside)) if seen < starts else 1.0
    return seen / starts, low, high


def attractors(
    machine: Machine,
    *,
    starts: int = STARTS,
    seed: int = 0,
    budget: int = 1600,
    centre: MachineDiagnosis | None = None,
    carried: Carried | None = None,
    states: Mapping[str, Array] | None = None,
    workers: int | None = None,
) -> Attractors:
    """Motions that a machine settles on, each with its share of random starts.

    Parameters
    ----------
    machine
        What runs.
    starts
        Random starts, a number fixed beforehand; 0 for none.
    seed
        Of them.
    budget
        Cycles that each start may take, at least 100.
    centre
        Verdict on the machine from rest, if it is known.
    carried
        States carried to this speed from below and from above, by ``carried_states``; none by default.
    states
        Further initial states (n_states,) by name.
    workers
        Number of threads; all processors by default.

    Raises
    ------
    DiagnosisError
        If ``starts`` is negative or the budget too small.
    SimulationError
        If the run from rest can't be finished.

    Examples
    --------
    >>> found = chaosgym.diagnosis.attractors(chaosgym.ImpactBeam(excitation_frequency=10.0))
    >>> len(found.motions), found.motions[0].random_starts
    (1, 48)
    """
    if starts < 0:
        raise DiagnosisError(f"starts = {starts} is out of range; allowed: 0 or more")
    centre = centre or diagnose_alone(machine, budget=budget)
    box = start_box(machine, centre.run)
    reached = np.asarray(centre.evidence["final_state"])
    begun = "rest" if centre.evidence["initial_state"] == "rest" else "the given state"
    named = {"its mirror image": -reached, "half of it": 0.5 * reached}
    named |= {} if carried is None else carried.here
    named |= states or {}
    named |= {} if begun == "rest" else {"rest": np.zeros(machine.n_states)}
    search = _Search(machine, box, budget, workers)
    search.add_centre(centre, begun)
    random = box.draw(starts, seed)
    search.settle([*([None] * starts), *named], [*random, *named.values()])
    return Attractors(
        motions=search.sorted_motions(),
        starts=starts,
        unsettled=search.lost.count(None),
        further_unsettled=tuple(name for name in search.lost if name is not None),
        box=box,
        carried=() if carried is None else tuple(carried.here),
        cycles=search.cycles + centre.evidence["cycles_used"] + (0 if carried is None else carried.cycles),
        budget=budget,
        seed=seed,
    )


class Mapper:
    """Tells on which motion of a search a state settles; motions that are new are added behind the others."""

    def __init__(self, machine: Machine, found: Attractors, workers: int | None = None) -> None:
        self._search = _Search(machine, found.box, found.budget, workers, watches=False)
        self._search.motions = list(found.motions)

    @property
    def motions(self) -> tuple[Attractor, ...]:
        """Those of the search, then those that are new."""
        return tuple(self._search.motions)

    def reached(self, states: Sequence[Array | None]) -> list[int | None]:
        """Number of the motion that each state (n_states,) settles on; None where it does not, or is None."""
        places: dict[int, int] = {}
        there = [(number, state) for number, state in enumerate(states) if state is not None]
        self._search.settle([None] * len(there), [state for _, state in there], places)
        by_number = {number: places.get(at) for at, (number, _) in enumerate(there)}
        return [by_number.get(number) for number in range(len(states))]


@dataclass
class _Start:
    """A start on its way: its number and name (None if random), where it is, the section of its last stage."""

    number: int
    name: str | None
    motion: MotionState
    record: CycleRecord | None = None
    cycles: int = 0


class _Search:
    """Motions met so far, and how starts are matched with them."""

    def __init__(self, machine: Machine, box: StartBox, budget: int, workers: int | None, watches: bool = True) -> None:
        self._watches = watches
        self._machine, self._budget, self._workers = machine, budget, workers
        with np.errstate(divide="ignore"):
            weight = np.where(box.scale > 0.0, 1.0 / box.scale, 0.0)
        self._weight = weight / math.sqrt(int(np.count_nonzero(weight)) or 1)
        self.motions: list[Attractor] = []
        self._diagnoses = 0
        self._places: dict[int, int] = {}
        self._on_sets: dict[int, list[_Start]] = {}
        self.lost: list[str | None] = []
        self.cycles = 0

    def add_centre(self, centre: MachineDiagnosis, begun: str) -> None:
        """Add the motion that a verdict is about, and the name of its initial state."""
        motion = self._of_verdict(centre)
        if motion is None:
            self.lost.append(begun)
        else:
            self.motions.append(replace(motion, from_starts=(begun,)))

    def sorted_motions(self) -> tuple[Attractor, ...]:
        """That of the verdict, then by share."""
        first, *others = self.motions
        return (first, *sorted(others, key=lambda one: -one.random_starts))

    def settle(
        self, names: Sequence[str | None], states: Sequence[Array], places: dict[int, int] | None = None
    ) -> None:
        """Run all starts until each is on a motion, whose number ``places`` then has, or the budget ends."""
        self._places = {} if places is None else places
        bouncing = rest_state(self._machine).bouncing
        live = [
            _Start(number, name, MotionState(np.array(state), bouncing.copy()))
            for number, (name, state) in enumerate(zip(names, states, strict=True))
        ]
        for stage in _stages(self._budget):
            parallel_map(partial(self._run, until=stage), live, workers=self._workers)
            self.lost += [start.name for start in live if start.record is None]
            live = self._matched([start for start in live if start.record is not None], stage)
        self.lost += [start.name for start in live]
        for there in self._on_sets.values() if self._watches else ():
            if self._leave(there[:WATCHED]):
                self._leave(there[WATCHED:])

    def _leave(self, there: list[_Start]) -> bool:
        """Run starts on a set to the end of the budget; count those anew that leave it for an orbit, if any do."""
        stage, left = self._budget, False
        there = [start for start in there if start.cycles < stage]
        parallel_map(partial(self._run, until=stage), there, workers=self._workers)
        for start in there:
            if start.record is None:
                continue
            self.cycles += len(start.record)
            place = self._arrived(start)
            if place is None:
                place = self._added(self._proven(start, stage))
            if place is not None:
                self._count(start, self._places[start.number], -1)
                self._count(start, place)
                left = True
        return left

    def _run(self, start: _Start, until: int) -> None:
        count = until - start.cycles
        try:
            start.record = simulate(self._machine, count, start.motion)
            start.motion = start.record.final_state
        except SimulationError:
            start.record = None
        start.cycles = until

    def _matched(self, live: list[_Start], stage: int) -> list[_Start]:
        """Match all starts with the known motions, and with new ones; return the others."""
        self.cycles += sum(len(start.record or ()) for start in live)
        others: list[_Start] = []
        for start in live:
            place = self._arrived(start)
            if place is None:
                place = self._added(self._proven(start, stage))
            # a periodic motion may lie within the set of a chaotic one that died out
            if place is None:
                place = self._on_a_set(start)
            if place is None:
                others.append(start)
            else:
                self._count(start, place)
        if stage < IRREGULAR:
            return others
        waiting: list[_Start] = []
        for start in others:
            place = self._arrived(start)
            if place is None:
                place = self._on_a_set(start)
            if place is None and self._diagnoses < MOST_DIAGNOSES:
                place = self._added(self._diagnosed(start))
            if place is None:
                waiting.append(start)
            else:
                self._count(start, place)
        return waiting

    def _count(self, start: _Start, place: int, change: int = 1) -> None:
        """Count a start on a motion, or take it away."""
        motion = self.motions[place]
        if start.name is None:
            motion = replace(motion, random_starts=motion.random_starts + change)
        else:
            others = tuple(name for name in motion.from_starts if name != start.name)
            motion = replace(motion, from_starts=(*others, start.name) if change > 0 else others)
        self.motions[place] = motion
        self._places[start.number] = place
        if change > 0 and motion.period is None and not motion.neutral:
            self._on_sets.setdefault(place, []).append(start)

    def _distances(self, states: Array) -> Array:
        """Smallest distance of each state (k, n) from each of the motions: (motions, k)."""
        return np.array(
            [
                np.min(np.linalg.norm(self._weight * (states[:, None] - one.states), axis=2), axis=1)
                for one in self.motions
            ]
        )

    def _size(self, motion: Attractor) -> float:
        return max(1.0, float(np.max(np.linalg.norm(self._weight * motion.states, axis=1))))

    def _arrived(self, start: _Start) -> int | None:
        """Number of the repeating motion on which a start is, or None."""
        path = self._path(start)
        orbits = [place for place, one in enumerate(self.motions) if one.period]
        if orbits:
            now = self._distances(path[-1:])[:, 0]
            nearest = min(orbits, key=lambda place: now[place])
            one = self.motions[nearest]
            beside = min((now[place] for place in orbits if place != nearest), default=np.inf)
            near = now[nearest] < ARRIVED * self._size(one) and now[nearest] <= APART * beside
            if near and self._nears(path, one):
                return nearest
        return None

    def _on_a_set(self, start: _Start) -> int | None:
        """Number of the set of states on which a start moves, or None."""
        path = self._path(start)
        assert start.record is not None
        free = len(start.record) >= TAIL and not start.record.peak_force.any()
        for place, one in enumerate(self.motions):
            if one.period is None and (free if one.neutral else self._on_set(path, one)):
                return place
        return None

    def _path(self, start: _Start) -> Array:
        """The last states of a start, (k, n_states)."""
        assert start.record is not None
        return np.vstack([start.record.section[-TAIL:], start.record.final_state.coordinates])

    def _nears(self, path: Array, motion: Attractor) -> bool:
        """Whether a path came nearer to an orbit from period to period at the end, or is on it."""
        back = path[:: -(motion.period or 1)][: APPROACHES + 1]
        distance = np.min(np.linalg.norm(self._weight * (back[:, None] - motion.states), axis=2), axis=1)
        return bool(distance[0] < CLOSELY or np.all(distance[:-1] <= distance[1:]))

    def _on_set(self, path: Array, motion: Attractor) -> bool:
        """Whether a start moves on a set."""
        if len(motion.states) < LEAST_SET or len(path) < TAIL:
            return False
        from scipy.spatial import cKDTree  # slow to import, and few searches need it

        tree = cKDTree(self._weight * motion.states)
        within = float(np.median(tree.query(self._weight * motion.states, k=2)[0][:, 1]))
        return float(np.median(tree.query(self._weight * path[-TAIL:])[0])) <= WITHIN * within

    def _proven(self, start: _Start, stage: int) -> Attractor | None:
        """The orbit that a start nears, if its section returns and Newton's method proves it."""
        assert start.record is not None
        path = np.vstack([start.record.section, start.record.final_state.coordinates])
        period = returning_period(path, max(1, len(path) // 4))
        size = max(1.0, float(np.linalg.norm(self._weight * path[-1])))
        if _miss(self._weight * path, period) > RETURNS * size:
            return None
        orbit = find_periodic_orbit(self._machine, start.motion, period)
        self.cycles += 8 * period
        if orbit is None or not orbit.certified or orbit.distance > NEAR:
            return None
        return self._of_orbit(primitive(self._machine, orbit))

    def _of_orbit(self, orbit: PeriodicOrbit) -> Attractor:
        record = simulate(self._machine, orbit.period, orbit.state)
        self.cycles += orbit.period
        peaks = record.peak_force.max(axis=0)
        return Attractor(
            nature="periodic", period=orbit.period, peaks=peaks, state=orbit.state, states=record.section, orbit=orbit
        )

    def _diagnosed(self, start: _Start) -> Attractor | None:
        self._diagnoses += 1
        try:
            verdict = diagnose_alone(self._machine, initial_state=start.motion, budget=self._budget)
        except SimulationError:
            return None
        self.cycles += verdict.evidence["cycles_used"]
        return self._of_verdict(verdict)

    def _of_verdict(self, verdict: MachineDiagnosis) -> Attractor | None:
        """The motion that a verdict is about, once settled; None if it is undetermined."""
        if verdict.nature == "undetermined":
            return None
        record, period = verdict.run, verdict.period
        if period is not None:
            orbit = find_periodic_orbit(self._machine, record.final_state, period)
            self.cycles += 8 * period
            if orbit is not None and orbit.certified and orbit.distance < NEAR:
                return self._of_orbit(primitive(self._machine, orbit))
            settled = record.after(max(len(record) - period, 0))
            nature: Nature = "periodic"
        else:
            settled, nature = record.after(len(record) // 2), verdict.nature
        return Attractor(
            nature=nature,
            period=period,
            peaks=settled.peak_force.max(axis=0),
            state=settled.section[0],
            states=settled.section,
        )

    def _added(self, motion: Attractor | None) -> int | None:
        """Number of a motion, which is added unless it is known."""
        if motion is None:
            return None
        for place, one in enumerate(self.motions):
            if (one.period, one.neutral) != (motion.period, motion.neutral):
                continue
            if one.neutral:
                self.motions[place] = replace(one, peaks=np.maximum(one.peaks, motion.peaks))
                return place
            near = one.period and self._distances(motion.state[None])[place, 0] < SAME * self._size(one)
            alike = np.allclose(one.peaks, motion.peaks, rtol=SAME, atol=SAME * one.largest_peak)
            if near or (one.period and one.orbit is None and alike):
                return place
        self.motions.append(motion)
        return len(self.motions) - 1


def _stages(budget: int) -> list[int]:
    """Cycles up to which each stage runs."""
    stages = [FIRST_STAGE]
    while 2 * stages[-1] < budget:
        stages.append(2 * stages[-1])
    return [*stages, budget] if budget > FIRST_STAGE else [budget]


def _miss(path: Array, period: int) -> float:
    """Largest of the last distances between states (k, n) that lie a period apart."""
    last = min(4, len(path) - period)
    return float(np.max(np.linalg.norm(path[-last:] - path[-last - period : len(path) - period], axis=1)))
