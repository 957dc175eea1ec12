"""What a reader of the thesis' figures sees of a run: its nature and the peak forces of 100 cycles.

The thesis judges a response by the dots of its figures, one a cycle (``plotted_peaks``): "the nature of the response -
periodic, subharmonic or chaotic - is indicated by the distribution of dots" (4.5.1; likewise 3.5.1). One dot is
periodic, a few are a subharmonic, a distribution is chaos. Two dots closer than the width of a dot are one;
``READING_ERROR`` is half that width, for every figure. What our own diagnosis says of the machine stands beside it.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.diagnosis import diagnose
from chaosgym.errors import SimulationError
from chaosgym.machines import ImpactBeam, Machine
from chaosgym.machines.integrators import ExactEvents, RungeKutta4
from chaosgym.series import Diagnosis, two_step_test
from chaosgym.series.stroboscopic import MIN_REPEATS, class_residuals, irregularity
from chaosgym.simulation import CycleRecord, MotionState, simulate

READING_ERROR = 0.5
"""Half the width of a dot [N]: half a per cent of a force axis of 100 N."""

BLOCK, REPEATING, CLOSE = 20, 12, 0.02
"""Cycles after which a hasty run looks whether its dots repeat, those it looks at, and how close [N] they must lie."""

FEW = 6
"""Dots that are still a few: the longest period of a response whose irregularity is small."""

DOT = 2.0 * READING_ERROR
"""Width of a dot [N]."""


class Effort(NamedTuple):
    """How long a run is: cycles skipped, cycles recorded, and those of the diagnosis beside it (0: none).

    A ``hasty`` run ends as soon as its dots repeat closely. ``start`` cycles at a speed 5 % higher give the initial
    state, which is rest in the middle after none. A ``step`` [us] is a fixed one of Runge-Kutta's, as the thesis may
    have taken (5.2.2); 0 stands for exact contacts.
    """

    transient: int
    cycles: int
    budget: int
    hasty: int = 0
    start: int = 0
    step: float = 0.0

    def simulate(self, machine: Machine, cycles: int, state: MotionState | None = None) -> CycleRecord:
        """Cycles of a machine from a state, or from rest."""
        integrator = RungeKutta4(math.ceil(1e6 * machine.cycle_period / self.step)) if self.step else ExactEvents()
        return simulate(machine, cycles, state, integrator=integrator)

    def initial_state(self, machine: Machine) -> MotionState | None:
        """State after ``start`` cycles at a speed 5 % higher; None, which is rest, after none."""
        if not self.start:
            return None
        return self.simulate(machine.at(1.05 * getattr(machine, machine.speed_field)), self.start).final_state


THOROUGH: Mapping[str, Effort] = {"impact-beam": Effort(200, 100, 800), "slider-crank": Effort(60, 50, 200)}
"""For the scorecard, by machine: 100 and 50 cycles recorded, as in the thesis (3.5.1, 4.4.1)."""

QUICK: Mapping[str, Effort] = {"impact-beam": Effort(120, 48, 0, 1), "slider-crank": Effort(30, 32, 0, 1)}
"""For a calibration, which makes many thousand runs."""


@dataclass(frozen=True)
class Observation:
    """What one run shows.

    Attributes
    ----------
    nature
        As read from a figure: "periodic" or "chaotic"; "failed" if the run could not be finished.
    period
        Cycles after which it repeats; None if it does not.
    certificate
        Nature by the diagnosis, which may also be "quasiperiodic" or "undetermined"; empty if none was asked for.
    irregularity
        Amplitude by which the plotted peak forces do not repeat [N], with any period up to six.
    low, mean, high
        Smallest, mean and largest of the plotted peak forces [N].
    bounce_share
        Median duration of bouncing, as a share of half the cycle.
    settle_cycle
        Cycle from which on the run from rest repeats within the reading error; None if it does not.
    other
        The same of the other side of the bearing, where the machine is its own mirror image; None elsewhere.
    """

    nature: str
    period: int | None = None
    certificate: str = ""
    irregularity: float = 0.0
    low: float = 0.0
    mean: float = 0.0
    high: float = 0.0
    bounce_share: float = 0.0
    settle_cycle: int | None = None
    other: "Observation | None" = None

    @property
    def sides(self) -> "tuple[Observation, ...]":
        """What each side shows that the thesis may have plotted: of two mirror images a last digit decides which."""
        return (self,) if self.other is None else (self, self.other)

    @property
    def is_periodic(self) -> bool:
        """True if a reader of the figure sees one dot or a few."""
        return self.nature == "periodic"

    @property
    def is_chaotic(self) -> bool:
        """True if the dots are distributed."""
        return self.nature == "chaotic"

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self)


def plotted_peaks(record: CycleRecord) -> Array:
    """The peak force of every cycle as the thesis plots it [N], (cycles,).

    Of the beam on one side of the bearing (3.4, figures 3.6 d and 3.7 e); of the crank's joints the resultant (4.6):
    the larger of both surfaces in a revolution.
    """
    forces = record.peak_force
    return np.asarray(forces[:, 0] if isinstance(record.machine, ImpactBeam) else forces.max(axis=1))


def _plotted_sides(record: CycleRecord) -> Array:
    """Peaks (cycles, 1 or 2) that the thesis may have plotted: both sides where a machine is its own mirror image."""
    own = plotted_peaks(record)[:, None]
    return record.peak_force if isinstance(record.machine, ImpactBeam) and record.machine.mirrors else own


def _seen(sides: list[Observation]) -> Observation:
    """One or two sides in one."""
    return replace(sides[0], other=sides[1]) if len(sides) > 1 else sides[0]


def read_dots(peaks: Array) -> Diagnosis:
    """Judge plotted peaks (cycles,) [N] as a reader does: one dot or a few are periodic, a distribution is chaos.

    Chaos that ends after the plotted cycles counts as chaos, as in the thesis (5.2.3).
    """
    read = two_step_test(peaks, sensor_error=READING_ERROR)
    return read if read.nature == "periodic" else replace(read, nature="chaotic")


def observe(machine: Machine, effort: Effort) -> Observation:
    """Run a machine and read its peak forces as from a figure of the thesis."""
    if effort.hasty:
        return _glance(machine, effort)
    try:
        record = effort.simulate(machine, effort.transient + effort.cycles, effort.initial_state(machine))
        certificate = diagnose(machine, budget=effort.budget).labelled("thesis").nature if effort.budget else ""
    except SimulationError:
        return Observation("failed")
    settled = record.after(effort.transient)
    shares = settled.bounce_duration[settled.bounce_duration > 0.0] / (0.5 * machine.cycle_period)
    bounce_share = float(np.median(shares)) if len(shares) else 0.0
    return _seen(
        [_watched(plotted, effort.transient, certificate, bounce_share) for plotted in _plotted_sides(record).T]
    )


def _watched(plotted: Array, transient: int, certificate: str, bounce_share: float) -> Observation:
    """What the plotted peaks (cycles,) of one side show after a transient."""
    peaks = plotted[transient:]
    read = read_dots(peaks)
    return Observation(
        nature=read.nature,
        period=read.period,
        certificate=certificate,
        irregularity=irregularity(peaks, FEW),
        low=float(peaks.min()),
        mean=float(peaks.mean()),
        high=float(peaks.max()),
        bounce_share=bounce_share,
        settle_cycle=two_step_test(plotted, sensor_error=READING_ERROR).settle_cycle if read.period else None,
    )


def _glance(machine: Machine, effort: Effort) -> Observation:
    """What a hasty run shows: no longer than needed where the response settles soon; nature and forces alone."""
    blocks, least, cycles = list[Array](), np.inf, 0
    try:
        state = effort.initial_state(machine)
        while least > CLOSE and cycles < effort.transient + effort.cycles:
            record = effort.simulate(machine, BLOCK, state)
            state, cycles = record.final_state, cycles + BLOCK
            blocks.append(_plotted_sides(record))
            least = max(irregularity(peaks, 3) for peaks in blocks[-1][-REPEATING:].T)
    except SimulationError:
        return Observation("failed")
    shares = record.bounce_duration[record.bounce_duration > 0.0] / (0.5 * machine.cycle_period)
    bounce_share = float(np.median(shares)) if len(shares) else 0.0
    last = REPEATING if least <= CLOSE else effort.cycles
    return _seen([_glimpsed(whole, last, bounce_share) for whole in np.concatenate(blocks).T])


def _glimpsed(whole: Array, last: int, bounce_share: float) -> Observation:
    """What the peaks (cycles,) of one side show by the last of them."""
    peaks = whole[-last:]
    residuals = class_residuals(peaks[:, None], min(FEW, len(peaks) // MIN_REPEATS))
    period, spread = 1 + int(np.argmax(residuals <= max(CLOSE, residuals.min()))), float(residuals.min())
    return Observation(
        nature="periodic" if spread <= READING_ERROR else "chaotic",
        period=period if spread <= READING_ERROR else None,
        irregularity=spread,
        low=float(peaks.min()),
        mean=float(peaks.mean()),
        high=float(peaks.max()),
        bounce_share=bounce_share,
        settle_cycle=_repeats_from(whole, period) if spread <= READING_ERROR else None,
    )


def _repeats_from(peaks: Array, period: int) -> int:
    """First cycle from which peak forces repeat with a period within the width of a dot."""
    off = np.flatnonzero(np.abs(peaks[period:] - peaks[:-period]) > DOT)
    return int(off[-1]) + 1 if len(off) else 0
