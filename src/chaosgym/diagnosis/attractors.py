"""The motions that a machine settles on from many initial states, and how far was looked.

    random starts        independent states of a stated box, a number fixed beforehand: shares and their bounds
    rest, its mirror     further starts: they add motions, not confidence
    image and half, and
    states carried up
    and down the speed

Mapper, basin fractions and matching by distance are those of G. Datseris, K. Luiz Rossi and A. Wagemakers, Chaos 33
(2023) 073151 (Attractors.jl).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.diagnosis.attractor import Attractor
from chaosgym.diagnosis.attractor_search import Search
from chaosgym.diagnosis.carried import Carried
from chaosgym.diagnosis.diagnose import diagnose_alone
from chaosgym.diagnosis.start_box import StartBox, start_box
from chaosgym.diagnosis.verdict import MachineDiagnosis
from chaosgym.errors import DiagnosisError
from chaosgym.machines import Machine
from chaosgym.numbers import MOST_SEED, whole
from chaosgym.plain import Result

CONFIDENCE = 0.95
"""Of every bound on a share."""


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


MOST_STARTS = 10**6
"""Random starts at the most."""

STARTS = 48
"""Random starts: where all settle alike, another motion takes at most 6.1 % of such starts, with 95 % confidence."""


@dataclass(frozen=True, kw_only=True)
class Attractors(Result):
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

    shows = (
        "starts unsettled further_unsettled unseen reach=box.reach scale=box.scale carried cycles budget seed searched"
    )

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
        shares = [list(self.share(one)) if self.starts else None for one in self.motions]
        motions = [{**one.as_dict(), "share": share} for one, share in zip(self.motions, shares, strict=True)]
        return {"motions": motions, **super().as_dict()}


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
    whole("seed", seed, 0, MOST_SEED, error=DiagnosisError)
    starts = whole("starts", starts, 0, MOST_STARTS, error=DiagnosisError)
    centre = centre or diagnose_alone(machine, budget=budget)
    box = start_box(machine, centre.run)
    reached = np.asarray(centre.evidence["final_state"])
    begun = "rest" if centre.evidence["initial_state"] == "rest" else "the given state"
    named = {"its mirror image": -reached, "half of it": 0.5 * reached}
    named |= {} if carried is None else carried.here
    named |= states or {}
    named |= {} if begun == "rest" else {"rest": np.zeros(machine.n_states)}
    search = Search(machine, box, budget, workers)
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
        self._search = Search(machine, found.box, found.budget, workers, watches=False)
        self._search.known.motions = list(found.motions)

    @property
    def motions(self) -> tuple[Attractor, ...]:
        """Those of the search, then those that are new."""
        return tuple(self._search.known.motions)

    def reached(self, states: Sequence[Array | None]) -> list[int | None]:
        """Number of the motion that each state (n_states,) settles on; None where it does not, or is None."""
        places: dict[int, int] = {}
        there = [(number, state) for number, state in enumerate(states) if state is not None]
        self._search.settle([None] * len(there), [state for _, state in there], places)
        by_number = {number: places.get(at) for at, (number, _) in enumerate(there)}
        return [by_number.get(number) for number in range(len(states))]
