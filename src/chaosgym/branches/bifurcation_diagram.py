"""Branches of periodic orbits of a machine along one field, with their bifurcations and the sweep that seeded them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.branches.bifurcation import Bifurcation, Found
from chaosgym.branches.orbit_family import OrbitFamily
from chaosgym.branches.orbit_point import OrbitPoint
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of
from chaosgym.plain import Result, plain

SAME_VALUE = 1e-9
"""Relative difference of two values of a field that are one."""


@dataclass(frozen=True, kw_only=True)
class Branch(Result):
    """A branch of periodic orbits, in the order in which it is passed.

    Attributes
    ----------
    period
        Cycles.
    begins
        Where it comes from: the seed, or the bifurcation of another branch.
    ends
        Why it was not followed further, at either end.
    values : (n,)
        Of the field.
    states : (n, n_states)
        At the start of a cycle.
    multipliers : (n, n_states) complex
        Floquet multipliers, largest modulus first.
    peaks : (n, sides)
        Largest contact force of the period [N].
    impacts : (n, sides) int
        Contacts of a period.
    bifurcations
        In the same order.
    at
        For each bifurcation, the number of the orbit before it.
    """

    shows = "period begins ends values largest_multiplier stable peaks_N=peaks impacts"

    period: int
    begins: str
    ends: tuple[str, str]
    values: Array
    states: Array
    multipliers: NDArray[np.complex128]
    peaks: Array
    impacts: NDArray[np.int64]
    bifurcations: tuple[Bifurcation, ...]
    at: tuple[int, ...]
    _family: OrbitFamily = field(repr=False)
    _points: tuple[OrbitPoint, ...] = field(repr=False)
    _found: tuple[Found, ...] = field(repr=False)

    def __len__(self) -> int:
        return len(self.values)

    @property
    def largest_multiplier(self) -> Array:
        """Largest modulus of the multipliers, (n,)."""
        return np.asarray(np.abs(self.multipliers[:, 0]))

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Where the orbits attract, (n,)."""
        return np.asarray(self.largest_multiplier < 1.0)

    @property
    def stretches(self) -> tuple["StableRun", ...]:
        """Each run of stable orbits, up to the bifurcations at its ends, in the order in which the branch is passed."""
        edges = np.flatnonzero(np.diff([False, *self.stable.tolist(), False])).reshape(-1, 2)
        runs = [self._stretch(int(first), int(after) - 1) for first, after in edges]
        if len(runs) > 1 and self.stable[0] and self.stable[-1] and any(end.startswith("closed") for end in self.ends):
            last = runs.pop()  # goes on where the branch began
            runs[0] = StableRun(*(np.concatenate(parts) for parts in zip(last, runs[0], strict=True)))
        return tuple(runs)

    def _stretch(self, first: int, last: int) -> "StableRun":
        ends = [(place, one) for one, place in zip(self.bifurcations, self.at, strict=True) if one.loses_stability]
        before = [one for place, one in ends if place == first - 1][-1:]
        behind = [one for place, one in ends if place == last][:1]
        values = [*(one.value for one in before), *self.values[first : last + 1], *(one.value for one in behind)]
        peaks = self.peaks[first : last + 1].max(axis=1)
        heights = [*(one.largest_peak for one in before), *peaks, *(one.largest_peak for one in behind)]
        return StableRun(np.array(values), np.array(heights))

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        after = zip(self.bifurcations, self.at, strict=True)
        return {**super().as_dict(), "bifurcations": [{**one.as_dict(), "after_orbit": place} for one, place in after]}


class StableRun(NamedTuple):
    """Values of the field along a run of stable orbits, and the largest peak force of each [N], both (n,)."""

    values: Array
    peaks: Array

    def peaks_at(self, value: float) -> list[float]:
        """Largest peak forces of its orbits at a value of the field; more than one where it turns without a loss."""
        offset = self.values - value
        offset[np.abs(offset) <= SAME_VALUE * abs(value)] = 0.0
        crossed = np.flatnonzero(offset[:-1] * offset[1:] < 0.0)
        shares = offset[crossed] / (offset[crossed] - offset[crossed + 1])
        between = (1.0 - shares) * self.peaks[crossed] + shares * self.peaks[crossed + 1]
        return [*self.peaks[offset == 0.0].tolist(), *between.tolist()]


class SweptMotion(NamedTuple):
    """A motion that a machine has at one value.

    ``branch`` is the number of the branch through it, from 1 on, or None; ``stretch`` that of the run of stable orbits
    of this branch, from 1 on; ``largest_peak`` in newton; ``share`` that of the random starts that settle on it, 0 of
    one that only its branch tells of.
    """

    branch: int | None
    stretch: int | None
    nature: str
    period: int | None
    largest_peak: float
    share: float

    @property
    def place(self) -> tuple[int | None, int | None]:
        """Branch and stretch: the same of motions that follow from each other along the field."""
        return self.branch, self.stretch


class SweepPoint(NamedTuple):
    """What a machine does at one value from rest: its nature, its period if it has one, and its peak forces [N].

    ``motions`` are all that a search met, that from rest first, then other stable orbits of the branches; empty
    without a search. ``starts`` are its random starts, of which motions that it did not meet take ``unseen`` at most
    (95 %).
    """

    value: float
    nature: str
    period: int | None
    peaks: Array
    state: Array
    motions: tuple[SweptMotion, ...] = ()
    starts: int = 0
    unseen: float = 1.0

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        own = {name: value for name, value in self._asdict().items() if name not in ("peaks", "state")}
        return {**plain(own), "peaks_N": self.peaks.tolist()}


@dataclass(frozen=True, kw_only=True)
class BifurcationDiagram(Result):
    """Branches of periodic orbits of a machine along one field, and the sweep that seeded them.

    Attributes
    ----------
    machine, field, low, high
        What was varied, and how far.
    branches
        In the order in which they were found.
    sweep
        Points of the sweep, by value.
    """

    shows = "machine=machine.name field unit low high branches sweep not_followed"

    machine: Machine
    field: str
    low: float
    high: float
    branches: tuple[Branch, ...]
    sweep: tuple[SweepPoint, ...]

    @property
    def bifurcations(self) -> tuple[Bifurcation, ...]:
        """Those of all branches, by value."""
        return tuple(sorted((each for one in self.branches for each in one.bifurcations), key=lambda b: b.value))

    def places(self, points: Sequence[SweepPoint]) -> list[tuple[int | None, int | None]]:
        """Branches and stretches on which motions of some points lie, in order; those on no branch last."""
        there = {one.place for point in points for one in point.motions}
        return sorted(there, key=lambda place: [(part is None, part or 0) for part in place])

    @property
    def not_followed(self) -> tuple[str, ...]:
        """One line for each end of a branch that is neither an end of the range nor a bifurcation."""
        return tuple(end for branch in self.branches for end in branch.ends if "not followed" in end)

    @property
    def unit(self) -> str:
        """Unit of the field."""
        return parameters_of(self.machine)[self.field].unit

    def rows(self) -> Iterator[dict[str, Any]]:
        """One row for each orbit, and for each bifurcation where it lies, for a table."""
        for number, branch in enumerate(self.branches, 1):
            for i in range(len(branch)):
                yield {
                    "branch": number,
                    "period": branch.period,
                    self.field: float(branch.values[i]),
                    "kind": "orbit",
                    "largest_multiplier": float(branch.largest_multiplier[i]),
                    "stable": bool(branch.stable[i]),
                    **{f"peak_{side}_N": float(branch.peaks[i, j]) for j, side in enumerate(self.machine.sides)},
                    **{f"impacts_{side}": int(branch.impacts[i, j]) for j, side in enumerate(self.machine.sides)},
                }
                for one, place in zip(branch.bifurcations, branch.at, strict=True):
                    if place == i:
                        yield {
                            "branch": number,
                            "period": one.period,
                            self.field: one.value,
                            "kind": one.kind,
                            "largest_multiplier": float(np.abs(one.multipliers[0])),
                            "largest_peak_N": one.largest_peak,
                        }
