"""The trend of the peak force over the tolerances, which evaluates a machine of Type I (thesis 5.6)."""

import math
from dataclasses import dataclass

import numpy as np

from chaosgym.arrays import Array


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
    """
    touching = forces > 0.0
    if nominal == 0.0 or touching.sum() <= len(parameters):
        return Trend(parameters, np.zeros(len(parameters)), 0.0)
    logs = np.log(forces[touching] / nominal)
    slopes = np.asarray(np.linalg.lstsq(shares[touching], logs)[0], dtype=float)
    return Trend(parameters, slopes, float(np.std(logs - shares[touching] @ slopes)))
