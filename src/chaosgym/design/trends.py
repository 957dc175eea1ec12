r"""Trends: of the peak force over the tolerances (thesis 5.6), of life and of where impacts fall over a whole range.

Life against speed or clearance (figure 5.12) is relative to the first value of the range, by the cubic law: the
statistical mean life (eq. 5.4), and what the largest and the smallest peak alone would suggest. Where the response is
chaotic the two are far apart. Where impacts fall is the Peak Impact Diagram's question (5.4.1).

A larger clearance lets peaks grow, and may spread them over more of the bearing; life counts the force alone.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.design.fatigue import CUBIC_EXPONENT, equivalent_force, relative_life
from chaosgym.design.peak_impacts import peak_impacts, worn_side
from chaosgym.design.runs import SettledRun, settled_run, worse_side
from chaosgym.errors import DesignError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import quantity_of, with_settings
from chaosgym.plain import Result
from chaosgym.series import Nature
from chaosgym.simulation import simulate
from chaosgym.simulation.parallel import parallel_map

HISTORY_SAMPLES = 2880
"""Samples a cycle of a time history: an eighth of a degree, and about ten samples an impact of the beam at 30 Hz."""


DIAGRAM_CYCLES = 200
"""Cycles of a Peak Impact Diagram."""


class ImpactPlace(NamedTuple):
    """Where impacts fall at one clearance [m].

    Forces are in N: the equivalent one and the largest. The spread of the peaks over the bearing is in ``unit``.
    """

    clearance: float
    force: float
    largest_peak: float
    spread: float
    unit: str

    def told(self, machine: Machine) -> str:
        """One line for people, on the machine at any clearance."""
        size, unit = (1e3, "mm") if self.unit == "m" else (1.0, self.unit)
        name = machine.clearance_field
        clearance = quantity_of(with_settings(machine, {name: self.clearance}), name)
        forces = f"equivalent {self.force:.4g} N, largest {self.largest_peak:.4g} N"
        return f"at {name.replace('_', ' ')} {clearance}: {forces}, peaks spread over {size * self.spread:.3g} {unit}"


def impacts_against(
    machine: Machine, clearances: Sequence[float], exponent: float = CUBIC_EXPONENT, *, workers: int | None = None
) -> tuple[ImpactPlace, ...]:
    """Force and spread of the peak impacts at some clearances [m], each from rest, transient left out (thesis 5.4.1).

    Raises
    ------
    ParameterError
        If a clearance is out of its range.
    SimulationError
        If a run can't be finished.

    Examples
    --------
    >>> from chaosgym.design.trends import impacts_against
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=12.0)
    >>> [round(one.clearance * 1e3, 3) for one in impacts_against(beam, [5e-5, 1e-4])]
    [0.05, 0.1]
    """

    def run(clearance: float) -> ImpactPlace:
        at = with_settings(machine, {machine.clearance_field: clearance})
        record = simulate(at, DIAGRAM_CYCLES, transient=DIAGRAM_CYCLES, samples_per_cycle=HISTORY_SAMPLES)
        diagram = peak_impacts(record, worn_side(record, exponent))
        force = equivalent_force(worse_side(record.peak_force, exponent), exponent)
        return ImpactPlace(clearance, force, float(np.max(record.peak_force)), diagram.spread, diagram.unit)

    return tuple(parallel_map(run, list(clearances), workers=workers))


VISIBLE = 1.05
"""Ratio of lives from which a bar between them is seen."""


@dataclass(frozen=True)
class LifeTrend(Result):
    """Life along a range of one field.

    Attributes
    ----------
    field
        Name of the field.
    values : (n,)
        In its unit.
    nature : (n,) of str
        Of the response at each value.
    lowest, highest, statistical : (n,)
        Life relative to the statistical life at ``reference``; infinite without contact.
    reference
        First value of the field with contact.
    largest_peak, mean_peak : (n,)
        [N].
    """

    shows = "speed=values reference_speed=reference nature relative_life=statistical lowest highest"

    field: str
    values: Array
    nature: tuple[Nature, ...]
    lowest: Array
    highest: Array
    statistical: Array
    largest_peak: Array
    mean_peak: Array
    reference: float

    @property
    def scatters(self) -> bool:
        """Whether peaks of one machine differ enough for the largest and the smallest to suggest other lives."""
        touching = np.isfinite(self.lowest)
        return bool(np.any(self.highest[touching] > VISIBLE * self.lowest[touching]))

    def longer_lived(self, nominal: float, factor: float) -> list[float]:
        """Values nearest to nominal, one on either side, whose life is longer by a factor, and one without contact.

        The values beside them must do as well, so that none is a narrow window.
        """
        own = float(self.statistical[int(np.argmin(np.abs(self.values - nominal)))])
        calm = np.array([nature == "periodic" for nature in self.nature]) & (self.statistical >= factor * own)
        found = []
        for suits in (np.isinf(self.statistical), calm):
            wide = suits & np.append(True, suits[:-1]) & np.append(suits[1:], True)
            below, above = self.values[wide & (self.values < nominal)], self.values[wide & (self.values > nominal)]
            found += [*below[-1:].tolist(), *above[:1].tolist()]
        return sorted(set(found))


def life_against(
    machine: Machine,
    field: str,
    values: ArrayLike,
    *,
    workers: int | None = None,
    progress: bool = False,
) -> LifeTrend:
    """Relative life along a range of one field, each machine from rest (thesis figure 5.12 over crank speed).

    Parameters
    ----------
    machine
        Base machine.
    field
        Field that varies.
    values : (n,)
        In its unit; the first one with contact is the reference.
    workers
        Number of threads; all processors by default.
    progress
        Show a progress bar on standard error.

    Raises
    ------
    ParameterError
        If the field does not exist or a value is out of its range.
    DesignError
        If there is contact at none of the values.

    Examples
    --------
    >>> from chaosgym.design.trends import life_against
    >>> life_against(chaosgym.ImpactBeam(), "excitation_frequency", [10.0, 22.0]).nature
    ('periodic', 'chaotic')
    """
    chosen = np.atleast_1d(np.asarray(values, dtype=float))
    machines = [with_settings(machine, {field: float(value)}) for value in chosen]
    runs: list[SettledRun] = parallel_map(
        settled_run, machines, workers=workers, progress=f"life against {field}" if progress else None
    )
    peaks = [run.worse_side(CUBIC_EXPONENT) for run in runs]
    forces = [equivalent_force(each, CUBIC_EXPONENT) for each in peaks]
    touching = np.flatnonzero(forces)
    if not len(touching):
        raise DesignError(f"no life against {field}: no contact from {chosen[0]:g} to {chosen[-1]:g}")
    reference = forces[int(touching[0])]
    lives = np.array([relative_life(each, reference, CUBIC_EXPONENT) for each in peaks])
    return LifeTrend(
        field,
        chosen,
        tuple(run.nature for run in runs),
        lives[:, 0],
        lives[:, 1],
        lives[:, 2],
        np.array([run.largest_peak for run in runs]),
        np.array([float(np.mean(each)) for each in peaks]),
        float(chosen[int(touching[0])]),
    )


@dataclass(frozen=True)
class Trend:
    """How the equivalent peak force follows the tolerances.

    Attributes
    ----------
    parameters
        Names of the toleranced fields.
    slopes : (parameters,)
        Change of log force for one tolerance.
    unexplained
        Standard deviation of log force over the series that the trend leaves.
    """

    parameters: tuple[str, ...]
    slopes: Array
    unexplained: float

    @property
    def worst_factor(self) -> float:
        """Force in the unfavourable corner of the region, relative to nominal."""
        return math.exp(float(np.sum(np.abs(self.slopes))))


def fit_trend(parameters: tuple[str, ...], shares: Array, forces: Array, nominal: float) -> Trend:
    """Fit the trend through the nominal force by least squares.

    Parameters
    ----------
    parameters
        Names of the columns of ``shares``.
    shares : (machines, parameters)
        Deviations from nominal in tolerances.
    forces : (machines,)
        Equivalent peak forces [N]; machines without contact are left out.
    nominal
        Force of the nominal machine [N].

    Examples
    --------
    A clearance that is larger by a tolerance raises the force by 10 %:

    >>> import numpy as np
    >>> from chaosgym.design.trends import fit_trend
    >>> shares = np.array([[-1.0], [0.0], [1.0]])
    >>> trend = fit_trend(("clearance",), shares, 50.0 * 1.1 ** shares[:, 0], 50.0)
    >>> trend.parameters, np.exp(trend.slopes).round(3).tolist()
    (('clearance',), [1.1])
    """
    touching = forces > 0.0
    if nominal == 0.0 or touching.sum() <= len(parameters):
        return Trend(parameters, np.zeros(len(parameters)), 0.0)
    logs = np.log(forces[touching] / nominal)
    slopes = np.asarray(np.linalg.lstsq(shares[touching], logs)[0], dtype=float)
    return Trend(parameters, slopes, float(np.std(logs - shares[touching] @ slopes)))
