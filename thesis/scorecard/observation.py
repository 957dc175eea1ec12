"""What a reader of the thesis' figures sees of a run: its nature and the peak forces of 100 cycles.

The thesis judges a response by the dots of its figures, one a cycle (``plotted_peaks``): one dot is periodic, a few are
a subharmonic, a distribution is chaos (3.5.1). Two dots closer than the width of a dot are one; ``READING_ERROR`` is
that width, for every figure. Dots that do not repeat are judged by the whole diagnosis. What the exact test says of the
same cycles, state and both surfaces, is kept beside it.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.diagnosis import Diagnosis, diagnose, two_step_test
from chaosgym.errors import SimulationError
from chaosgym.machines import ImpactBeam, Machine
from chaosgym.simulation import CycleRecord, simulate

Array = NDArray[np.float64]

READING_ERROR = 0.5
"""Half the width of a dot [N]: half a per cent of a force axis of 100 N."""

DOT = 2.0 * READING_ERROR
"""Width of a dot [N]."""


class Effort(NamedTuple):
    """How long a run is: cycles skipped, cycles recorded, and the budget of the diagnosis (0: Two-Step Test alone)."""

    transient: int
    cycles: int
    budget: int


THOROUGH: Mapping[str, Effort] = {"impact-beam": Effort(200, 100, 800), "slider-crank": Effort(60, 50, 200)}
"""For the scorecard, by machine: 100 and 50 cycles recorded, as in the thesis (3.5.1, 4.4.1)."""

QUICK: Mapping[str, Effort] = {"impact-beam": Effort(60, 48, 0), "slider-crank": Effort(30, 32, 0)}
"""For a calibration, which makes many thousand runs."""


@dataclass(frozen=True)
class Observation:
    """What one run shows.

    Attributes
    ----------
    nature
        As read from a figure: "periodic", "quasiperiodic", "chaotic" or "undetermined"; "failed" if the run could not
        be finished.
    period
        Cycles after which it repeats; None if it does not.
    exact_nature
        By the Two-Step Test without a reading error; with a budget of 0, ``nature`` again.
    low, mean, high
        Smallest, mean and largest of the plotted peak forces [N].
    bounce_share, longest_bounce_share
        Median and largest duration of bouncing, as a share of half the cycle.
    settle_cycle
        Cycle from which on the run from rest repeats within the reading error; None if it does not.
    """

    nature: str
    period: int | None = None
    exact_nature: str = "failed"
    low: float = 0.0
    mean: float = 0.0
    high: float = 0.0
    bounce_share: float = 0.0
    longest_bounce_share: float = 0.0
    settle_cycle: int | None = None

    @property
    def is_periodic(self) -> bool:
        """True if a reader of the figure sees one dot or a few."""
        return self.nature == "periodic"

    @property
    def is_chaotic(self) -> bool:
        """True if the dots are distributed, and the diagnosis calls them chaos."""
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


def read_dots(machine: Machine, peaks: Array, budget: int) -> Diagnosis:
    """Judge the plotted peaks (cycles,) [N] of a machine; dots that do not repeat by a diagnosis of ``budget`` cycles.

    With a budget of 0 all of them are chaos (3.5.1). Chaotic dots stay so if the machine turns periodic after the
    plotted cycles: that is transient chaos, which counts as chaotic (5.2.3).
    """
    read = two_step_test(peaks, sensor_error=READING_ERROR)
    if read.nature == "periodic":
        return read
    if not budget:
        return replace(read, nature="chaotic")
    found = diagnose(machine, budget=budget, sensor_error=READING_ERROR)
    later = found.period is not None and np.any(np.abs(peaks[found.period :] - peaks[: -found.period]) > DOT)
    return read if later and read.nature == "chaotic" else found


def observe(machine: Machine, effort: Effort) -> Observation:
    """Run a machine from rest and read its peak forces as from a figure of the thesis."""
    try:
        record = simulate(machine, effort.transient + effort.cycles)
        settled, plotted = record.after(effort.transient), plotted_peaks(record)
        peaks = plotted[effort.transient :]
        read = read_dots(machine, peaks, effort.budget)
    except SimulationError:
        return Observation("failed")
    exact = two_step_test(settled) if effort.budget else read
    settle = two_step_test(plotted, sensor_error=READING_ERROR).settle_cycle if effort.budget else None
    shares = settled.bounce_duration[settled.bounce_duration > 0.0] / (0.5 * machine.cycle_period)
    return Observation(
        nature=read.nature,
        period=read.period,
        exact_nature=exact.nature,
        low=float(peaks.min()),
        mean=float(peaks.mean()),
        high=float(peaks.max()),
        bounce_share=float(np.median(shares)) if len(shares) else 0.0,
        longest_bounce_share=float(shares.max()) if len(shares) else 0.0,
        settle_cycle=settle if read.nature == "periodic" else None,
    )
