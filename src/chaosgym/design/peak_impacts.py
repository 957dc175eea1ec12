r"""The Peak Impact Diagram: where on the bearing the peak impacts act (thesis 5.4.1 and 5.4.3).

Each cycle gives one point: the place of its peak force on the bearing surface and the force. In a slider joint that is
the place of the slider on its guide, in a ball joint the polar angle on the housing. A periodic response gives a point
or a few, a chaotic one a cloud. Its filling tells how many cycles a statistic needs: the diagram is divided
into sections, and the share of impacts that fall into sections already visited is, by Good and Turing,

    coverage(n) = 1 - (sections visited exactly once in n cycles) / n

References
----------
I. J. Good, The population frequencies of species and the estimation of population parameters, Biometrika 40 (1953).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.errors import DesignError
from chaosgym.rating_life import LIFE_EXPONENT
from chaosgym.simulation import CycleRecord

SECTIONS = 5
"""Sections of the diagram in either direction."""

COVERAGE = 0.95
"""Share of impacts that must fall into visited sections for the diagram to have taken shape."""


@dataclass(frozen=True)
class PeakImpactDiagram:
    """Place and size of the peak force of each cycle that has one.

    Attributes
    ----------
    location : (impacts,)
        Place on the bearing surface, in ``unit``.
    force : (impacts,)
        [N].
    unit
        "m" along a guide, "deg" around a bearing, or "deg of the cycle" where the contact stays in one place.
    elevation : (impacts,) or None
        Around a ball joint that moves in space: how far [deg] each impact leans out of the plane of ``location``.
    """

    location: Array
    force: Array
    unit: str
    elevation: Array | None = None

    @property
    def spread(self) -> float:
        """Length of the bearing, in ``unit``, over which the peak impacts spread."""
        return float(np.ptp(self.location)) if len(self.location) else 0.0


def peak_impacts(record: CycleRecord, side: int | None = None) -> PeakImpactDiagram:
    """Peak Impact Diagram of one bearing surface, or of a whole bearing.

    Impacts lie at the machine's ``bearing_place``, and else at the phase of the cycle [deg], relative to its mean.

    Parameters
    ----------
    record
        Of a machine whose contact travels; of another one with a time history, whose samples are then the resolution of
        the instant.
    side
        Number of the surface, 0 for the one on which the contact force is positive. None takes the largest force of
        the cycle, whichever surface carries it: a ball joint is one surface all around.

    Raises
    ------
    SimulationError
        If the machine's contact stays in one place and the record has no time history.

    Examples
    --------
    >>> from chaosgym.design.peak_impacts import peak_impacts
    >>> record = chaosgym.simulate(chaosgym.SliderCrank(crank_speed=200.0), cycles=50, transient=50)
    >>> len(peak_impacts(record).force)
    50
    """
    sides = np.argmax(record.peak_force, axis=1) if side is None else np.full(len(record), side)
    peaks = record.peak_force[np.arange(len(record)), sides]
    hit = np.flatnonzero(peaks > 0.0)
    sides, peaks = sides[hit], peaks[hit]
    phase = _phases(record, hit, sides)
    if record.peak_vector is None:
        return PeakImpactDiagram(np.degrees(_unrolled(phase) - _middle(phase)), peaks, "deg of the cycle")
    machine: Any = record.machine
    vector = record.peak_vector[hit, sides]
    place, unit = machine.bearing_place(phase, vector)
    if unit == "m":
        return PeakImpactDiagram(place, peaks, unit)
    elevation = np.degrees(np.arcsin(vector[:, 2] / peaks)) if np.any(vector[:, 2]) else None
    return PeakImpactDiagram(np.degrees(_unrolled(np.radians(place))), peaks, unit, elevation)


def worn_side(record: CycleRecord, exponent: float = LIFE_EXPONENT) -> int | None:
    """Side for ``peak_impacts``: the surface that fatigues faster, or None if the bearing is one surface all around.

    Examples
    --------
    >>> from chaosgym.design.peak_impacts import worn_side
    >>> one_stop = chaosgym.read_machine("docs/machines/moon-shaw-1983.toml")
    >>> worn_side(chaosgym.simulate(one_stop, cycles=50, transient=200))
    0
    """
    if getattr(record.machine, "round_bearing", False):
        return None
    return int(np.argmax(np.sum(record.peak_force**exponent, axis=0)))


def _phases(record: CycleRecord, cycles: NDArray[np.int64], sides: NDArray[np.int64]) -> Array:
    """Phases [rad] at which the peaks of some cycles act, (n,)."""
    if record.peak_phase is not None:
        return np.asarray(record.peak_phase[cycles, sides])
    samples = len(record.time) // len(record)
    return np.asarray(2.0 * np.pi * np.argmax(record.surface_force[cycles, :, sides], axis=1) / samples)


def _middle(angle: Array) -> float:
    """Mean direction [rad] of angles."""
    return float(np.angle(np.sum(np.exp(1j * angle))))


def _unrolled(angle: Array) -> Array:
    """Angles [rad] within half a turn of their mean direction, so that no cluster is cut."""
    middle = _middle(angle)
    return np.asarray(middle + np.angle(np.exp(1j * (angle - middle))))


def coverage(diagram: PeakImpactDiagram) -> Array:
    """Share of impacts that fall into sections already visited, estimated after each impact, (impacts,).

    Examples
    --------
    >>> from chaosgym.design.peak_impacts import coverage, peak_impacts
    >>> record = chaosgym.simulate(chaosgym.SliderCrank(crank_speed=200.0), cycles=50, transient=50)
    >>> bool(coverage(peak_impacts(record))[-1] > 0.9)
    True
    """
    if len(diagram.force) == 0:
        raise DesignError("the Peak Impact Diagram is empty: no cycle has contact")
    cell = _section(diagram.location) * SECTIONS + _section(diagram.force)
    visits = np.zeros(SECTIONS * SECTIONS, dtype=np.int64)
    once = 0
    shares = np.empty(len(cell))
    for n, place in enumerate(cell):
        visits[place] += 1
        once += {1: 1, 2: -1}.get(int(visits[place]), 0)
        shares[n] = 1.0 - once / (n + 1)
    return shares


def filling_cycles(diagram: PeakImpactDiagram) -> int | None:
    """Impacts after which the diagram has taken shape for good; None if it has not.

    Examples
    --------
    >>> from chaosgym.design.peak_impacts import filling_cycles, peak_impacts
    >>> record = chaosgym.simulate(chaosgym.SliderCrank(crank_speed=300.0), cycles=200, transient=50)
    >>> filling_cycles(peak_impacts(record)) < 60
    True
    """
    low = np.flatnonzero(coverage(diagram) < COVERAGE)
    first = int(low[-1]) + 2 if len(low) else 1
    return first if first <= len(diagram.force) else None


def _section(values: Array) -> NDArray[np.int64]:
    low, width = float(np.min(values)), float(np.ptp(values))
    if width <= 1e-9 * max(abs(low), 1e-300):
        return np.zeros(len(values), dtype=np.int64)
    return np.minimum((values - low) / width * SECTIONS, SECTIONS - 1).astype(np.int64)
