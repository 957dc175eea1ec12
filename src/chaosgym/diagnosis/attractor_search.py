"""Starts that run side by side in stages until each is on a motion.

One leaves as soon as it nears a known orbit and is ten times nearer to it than to any other, or moves on a known
chaotic set. One whose section returns is handed to Newton's method, which proves a new orbit. One that is irregular for
256 cycles is diagnosed: chaotic and quasiperiodic motions are sets of states. Some starts on a set run on to the end of
the budget; if one leaves it for an orbit, all do, since that chaos is transient. Of what no test decides at the end of
the budget a few are diagnosed for longer; the rest is reported as unsettled. At last Newton's method looks for stable
orbits from states of each set that nearly return: starts seldom reach those that chaos of thousands of cycles hides.

References
----------
D. P. Lathrop, E. J. Kostelich, Characterization of an experimental strange attractor by periodic orbits, Phys. Rev. A
40 (1989) 4028-4031: near returns.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.diagnosis.attractor import Attractor, of_orbit
from chaosgym.diagnosis.diagnose import diagnose_alone
from chaosgym.diagnosis.known_motions import KnownMotions, path_of
from chaosgym.diagnosis.periodic_orbit import NEAR, PeriodicOrbit, find_periodic_orbit, primitive, returning_period
from chaosgym.diagnosis.start_box import StartBox
from chaosgym.diagnosis.verdict import MachineDiagnosis
from chaosgym.errors import SimulationError
from chaosgym.machines import Machine
from chaosgym.simulation import CycleRecord, MotionState, rest_state, simulate
from chaosgym.simulation.parallel import parallel_map

FIRST_STAGE = 16
"""Cycles of the first stage; after each the run is twice as long."""

IRREGULAR = 256
"""Cycles after which a start that neither returns nor nears a motion is diagnosed."""

MOST_DIAGNOSES = 6
"""Of irregular starts in one search."""

LONGER, MOST_LONGER = 8, 3
"""Budgets that a diagnosis takes of a start that one budget leaves undetermined, as it often does on a torus, and how
many do: one while others run, the rest at the end."""

WATCHED = 6
"""Starts on a set that run on to the end of the budget; if one leaves it, all do."""

NEAR_RETURNS = "near returns of a motion that does not repeat"
"""Name of the start of an orbit that Newton's method alone reached."""

NEWTON = 8
"""Periods that a search by Newton's method is counted as."""

RETURNS = 1e-2
"""Largest miss of a section that is handed to Newton's method, relative to the same."""

LONGEST = 6
"""Longest period that is looked for [cycles]."""

TRIED = 8
"""Nearest returns of each period from which Newton's method starts."""


@dataclass
class Start:
    """A start on its way: its number and name (None if random), where it is, the section of its last stage."""

    number: int
    name: str | None
    motion: MotionState
    record: CycleRecord | None = None
    cycles: int = 0

    @property
    def run(self) -> CycleRecord:
        """The last stage of one that could be followed."""
        assert self.record is not None
        return self.record

    @property
    def path(self) -> Array:
        """States of the last stage, (k, n_states)."""
        return path_of(self.run, len(self.run))


class Search:
    """Motions met so far, and how starts are matched with them."""

    def __init__(self, machine: Machine, box: StartBox, budget: int, workers: int | None, watches: bool = True) -> None:
        self._watches = watches
        self._machine, self._budget, self._workers = machine, budget, workers
        self.known = KnownMotions(box.scale)
        self._diagnoses = self._longer = 0
        self._places: dict[int, int] = {}
        self._on_sets: dict[int, list[Start]] = {}
        self.lost: list[str | None] = []
        self.cycles = 0

    def add_centre(self, centre: MachineDiagnosis, begun: str) -> None:
        """Add the motion that a verdict is about, and the name of its initial state."""
        motion = self._of_verdict(centre)
        if motion is None:
            self.lost.append(begun)
        else:
            self.known.motions.append(replace(motion, from_starts=(begun,)))

    def sorted_motions(self) -> tuple[Attractor, ...]:
        """That of the verdict, then by share."""
        first, others = self.known.motions[:1], self.known.motions[1:]
        return (*first, *sorted(others, key=lambda one: -one.random_starts))

    def settle(
        self, names: Sequence[str | None], states: Sequence[Array], places: dict[int, int] | None = None
    ) -> None:
        """Run all starts until each is on a motion, whose number ``places`` then has, or the budget ends."""
        self._places = {} if places is None else places
        bouncing = rest_state(self._machine).bouncing
        live = [
            Start(number, name, MotionState(np.array(state), bouncing.copy()))
            for number, (name, state) in enumerate(zip(names, states, strict=True))
        ]
        for stage in _stages(self._budget):
            parallel_map(partial(self._run, until=stage), live, workers=self._workers)
            self.lost += [start.name for start in live if start.record is None]
            live = self._matched([start for start in live if start.record is not None], stage)
        self.lost += [start.name for start in self._found_later(live)]
        if self._watches:
            self._add_near_returns()
        for there in self._on_sets.values() if self._watches else ():
            if self._leave(there[:WATCHED]):
                self._leave(there[WATCHED:])

    def _found_later(self, live: list[Start]) -> list[Start]:
        """Diagnose some of what did not settle for longer, match the others with that; return what is still lost."""
        lost: list[Start] = []
        for start in live:
            place = self.known.on_a_set(start.run)
            if place is None and self._longer < MOST_LONGER and self._watches:
                place = self.known.add(self._settled_longer(start))
            if place is None:
                lost.append(start)
            else:
                self._count(start, place)
        return lost

    def _add_near_returns(self) -> None:
        """Add the stable orbits that Newton's method reaches from motions that do not repeat."""
        for one in [one for one in self.known.motions if one.period is None and not one.neutral]:
            for orbit in stable_orbits(self._machine, one.states, self.known.weight):
                known = len(self.known.motions)
                place = self.known.add(self._on_orbit(orbit))
                if place == known:
                    self.known.motions[place] = replace(self.known.motions[place], from_starts=(NEAR_RETURNS,))
            self.cycles += NEWTON * TRIED * LONGEST * (LONGEST + 1) // 2

    def _leave(self, there: list[Start]) -> bool:
        """Run starts on a set to the end of the budget; count those anew that leave it for an orbit, if any do."""
        stage, left = self._budget, False
        there = [start for start in there if start.cycles < stage]
        parallel_map(partial(self._run, until=stage), there, workers=self._workers)
        for start in there:
            if start.record is None:
                continue
            self.cycles += len(start.record)
            place = self.known.arrived(start.path)
            if place is None:
                place = self.known.add(self._proven(start))
            if place is not None:
                self._count(start, self._places[start.number], -1)
                self._count(start, place)
                left = True
        return left

    def _run(self, start: Start, until: int) -> None:
        count = until - start.cycles
        try:
            start.record = simulate(self._machine, count, start.motion)
            start.motion = start.record.final_state
        except SimulationError:
            start.record = None
        start.cycles = until

    def _matched(self, live: list[Start], stage: int) -> list[Start]:
        """Match all starts with the known motions, and with new ones; return the others."""
        self.cycles += sum(len(start.record or ()) for start in live)
        others: list[Start] = []
        for start in live:
            place = self.known.arrived(start.path)
            if place is None:
                place = self.known.add(self._proven(start))
            # a periodic motion may lie within the set of a chaotic one that died out
            if place is None:
                place = self.known.on_a_set(start.run)
            if place is None:
                others.append(start)
            else:
                self._count(start, place)
        if stage < IRREGULAR:
            return others
        waiting: list[Start] = []
        for start in others:
            place = self.known.arrived(start.path)
            if place is None:
                place = self.known.on_a_set(start.run)
            if place is None and self._diagnoses < MOST_DIAGNOSES:
                place = self.known.add(self._diagnosed(start))
            if place is None:
                waiting.append(start)
            else:
                self._count(start, place)
        return waiting

    def _count(self, start: Start, place: int, change: int = 1) -> None:
        """Count a start on a motion, or take it away."""
        motion = self.known.motions[place]
        if start.name is None:
            motion = replace(motion, random_starts=motion.random_starts + change)
        else:
            others = tuple(name for name in motion.from_starts if name != start.name)
            motion = replace(motion, from_starts=(*others, start.name) if change > 0 else others)
        self.known.motions[place] = motion
        self._places[start.number] = place
        if change > 0 and motion.period is None and not motion.neutral:
            self._on_sets.setdefault(place, []).append(start)

    def _proven(self, start: Start) -> Attractor | None:
        """The orbit that a start nears, if its section returns and Newton's method proves it."""
        path = path_of(start.run, len(start.run))
        period = returning_period(path, max(1, len(path) // 4))
        size = max(1.0, matrices.norm(self.known.weight * path[-1]))
        if _miss(self.known.weight * path, period) > RETURNS * size:
            return None
        orbit = find_periodic_orbit(self._machine, start.motion, period)
        self.cycles += NEWTON * period
        if orbit is None or not orbit.proven or orbit.distance > NEAR:
            return None
        return self._on_orbit(orbit)

    def _on_orbit(self, orbit: PeriodicOrbit) -> Attractor:
        shortest = primitive(self._machine, orbit)
        self.cycles += shortest.period
        return of_orbit(self._machine, shortest)

    def _diagnosed(self, start: Start) -> Attractor | None:
        self._diagnoses += 1
        motion = self._settled_in(start, self._budget)
        return motion or (None if self._longer else self._settled_longer(start))

    def _settled_longer(self, start: Start) -> Attractor | None:
        self._longer += 1
        return self._settled_in(start, LONGER * self._budget)

    def _settled_in(self, start: Start, budget: int) -> Attractor | None:
        """The motion that a diagnosis of so many cycles tells."""
        try:
            verdict = diagnose_alone(self._machine, initial_state=start.motion, budget=budget)
        except SimulationError:
            return None
        self.cycles += verdict.evidence["cycles_used"]
        return self._of_verdict(verdict)

    def _of_verdict(self, verdict: MachineDiagnosis) -> Attractor | None:
        """The motion that a verdict is about, once settled; None if it is undetermined."""
        if verdict.nature == "undetermined":
            return None
        record, period = verdict.run, verdict.period
        if verdict.orbit is not None:
            self.cycles += verdict.orbit.period
            return of_orbit(self._machine, verdict.orbit)
        settled = record.after(len(record) // 2 if period is None else max(len(record) - period, 0))
        return Attractor(
            nature=verdict.nature,
            period=period,
            peaks=settled.peak_force.max(axis=0),
            state=settled.states[0],
            states=settled.states,
        )


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


def stable_orbits(machine: Machine, states: Array, weight: Array) -> Iterator[PeriodicOrbit]:
    """Certified orbits that Newton's method reaches from near returns; one may come several times.

    Parameters
    ----------
    machine
        What runs.
    states : (k, n_states)
        Of a motion that does not repeat, a cycle apart.
    weight : (n_states,)
        Of a distance between states.

    Examples
    --------
    >>> import numpy as np
    >>> from chaosgym.diagnosis.attractor_search import stable_orbits
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=30.0)
    >>> states = chaosgym.simulate(beam, 200, transient=200).states
    >>> list(stable_orbits(beam, states, np.ones(states.shape[1])))
    []
    """
    scaled = weight * states
    for period in range(1, min(LONGEST, len(states) - 1) + 1):
        apart = np.linalg.norm(scaled[period:] - scaled[:-period], axis=1)
        for place in np.argsort(apart, kind="stable")[:TRIED].tolist():
            orbit = find_periodic_orbit(machine, states[place], period)
            if orbit is not None and orbit.certified:
                yield orbit
