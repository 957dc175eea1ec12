"""Branches of periodic orbits of a machine along one field, with their bifurcations and the sweep that seeded them."""

from collections.abc import Iterator
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


@dataclass(frozen=True, kw_only=True)
class Branch:
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

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "period": self.period,
            "begins": self.begins,
            "ends": list(self.ends),
            "values": self.values.tolist(),
            "largest_multiplier": self.largest_multiplier.tolist(),
            "stable": self.stable.tolist(),
            "peaks_N": self.peaks.tolist(),
            "impacts": self.impacts.tolist(),
            "bifurcations": [
                {**one.as_dict(), "after_orbit": place} for one, place in zip(self.bifurcations, self.at, strict=True)
            ],
        }


class SweptMotion(NamedTuple):
    """A motion that a machine has at one value.

    ``branch`` is the number of the branch through it, from 1 on, or None; ``largest_peak`` in newton; ``share`` that of
    the random starts that settle on it.
    """

    branch: int | None
    nature: str
    period: int | None
    largest_peak: float
    share: float


class SweepPoint(NamedTuple):
    """What a machine does at one value from rest: its nature, its period if it has one, and its peak forces [N].

    ``motions`` are all that a search met, that from rest first; empty without one.
    """

    value: float
    nature: str
    period: int | None
    peaks: Array
    state: Array
    motions: tuple[SweptMotion, ...] = ()


@dataclass(frozen=True, kw_only=True)
class BifurcationDiagram:
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

    @property
    def not_followed(self) -> tuple[str, ...]:
        """One line for each end of a branch that is neither an end of the range nor a bifurcation."""
        return tuple(end for branch in self.branches for end in branch.ends if "not followed" in end)

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "machine": self.machine.name,
            "field": self.field,
            "unit": parameters_of(self.machine)[self.field].unit,
            "low": self.low,
            "high": self.high,
            "branches": [branch.as_dict() for branch in self.branches],
            "sweep": [
                {
                    "value": p.value,
                    "nature": p.nature,
                    "period": p.period,
                    "peaks_N": p.peaks.tolist(),
                    "motions": [motion._asdict() for motion in p.motions],
                }
                for p in self.sweep
            ],
            "not_followed": list(self.not_followed),
        }

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
