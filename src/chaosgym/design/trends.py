r"""Life against speed or clearance, over a whole range (thesis figure 5.12).

Life is relative to the first value of the range, by the cubic law: the statistical mean life (eq. 5.4), and what the
largest and the smallest peak alone would suggest. Where the response is chaotic the two are far apart.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.design.fatigue import CUBIC_EXPONENT, equivalent_force, relative_life
from chaosgym.design.runs import SettledRun, settled_run
from chaosgym.diagnosis import Nature
from chaosgym.errors import DesignError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.simulation import parallel_map

Array = NDArray[np.float64]

HISTORY_SAMPLES = 2880
"""Samples a cycle of a time history: an eighth of a degree, and about ten samples an impact of the beam at 30 Hz."""


@dataclass(frozen=True)
class LifeTrend:
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
        Life relative to the statistical life at the first value.
    largest_peak, mean_peak : (n,)
        [N].
    """

    field: str
    values: Array
    nature: tuple[Nature, ...]
    lowest: Array
    highest: Array
    statistical: Array
    largest_peak: Array
    mean_peak: Array


def life_against(
    machine: Machine,
    field: str,
    values: ArrayLike,
    exponent: float = CUBIC_EXPONENT,
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
        In its unit; the first one is the reference.
    exponent
        Of the life law.
    workers
        Number of threads; all processors by default.
    progress
        Show a progress bar on standard error.

    Raises
    ------
    ParameterError
        If the field does not exist or a value is out of its range.
    DesignError
        If there is no contact at the first value.
    """
    chosen = np.atleast_1d(np.asarray(values, dtype=float))
    machines = [with_settings(machine, {field: float(value)}) for value in chosen]
    runs: list[SettledRun] = parallel_map(
        settled_run, machines, workers=workers, progress=f"life against {field}" if progress else None
    )
    peaks = [run.worse_side(exponent) for run in runs]
    reference = equivalent_force(peaks[0], exponent)
    if reference == 0.0:
        raise DesignError(f"{field} = {chosen[0]:g} can't be the reference of a relative life: there is no contact")
    lives = np.array([relative_life(each, reference, exponent) for each in peaks])
    return LifeTrend(
        field,
        chosen,
        tuple(run.nature for run in runs),
        lives[:, 0],
        lives[:, 1],
        lives[:, 2],
        np.array([run.largest_peak for run in runs]),
        np.array([float(np.mean(each)) for each in peaks]),
    )
