r"""Reliability of a surface under the stress of impacts (thesis 5.4.2).

    S_e >= SF K_f s                                        (5.6)  single values
    R = P(S_e > s)                                         (5.7)
    R = int f(s) int_s^inf f(S) dS ds                      (5.8)
    R = Phi((mu_S - mu_s) / sqrt(sigma_S^2 + sigma_s^2))   (5.9)  both normal

S strength, s stress. Over the stresses of n recorded cycles the outer integral of (5.8) is the mean of P(S > s_i):
nothing is fitted, and every peak of a multi-peak distribution counts. (5.9) beside it shows what a normal fit says.

The stress is the largest Hertzian pressure of a ball of radius R on a flat surface,

    s = (6 F E*^2 / (pi^3 R^2))^(1/3),   1 / E* = (1 - nu_1^2) / E_1 + (1 - nu_2^2) / E_2

Intervals come from bootstrap over blocks of successive cycles, because these are not independent.

References
----------
K. L. Johnson, Contact Mechanics, Cambridge, 1985, section 4.2.
H. R. Kuensch, The jackknife and the bootstrap for general stationary observations, Annals of Statistics 17 (1989).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.errors import DesignError
from chaosgym.numbers import number

RESAMPLES = 2000
"""Bootstrap samples of an interval."""

BLOCKS = 20
"""Blocks into which a record is cut for the bootstrap."""


class Strength(NamedTuple):
    """Hertzian endurance strength of a surface, normally distributed: mean and standard deviation [Pa]."""

    mean: float
    deviation: float

    def exceeds(self, stress: ArrayLike) -> Array:
        """Probability that the strength exceeds each stress [Pa]; the inner integral of eq. 5.8."""
        if self.deviation == 0.0:
            return np.where(np.less(stress, self.mean), 1.0, 0.0)
        return _normal_cdf(np.subtract(self.mean, stress) / self.deviation)


def _normal_cdf(values: ArrayLike) -> Array:
    from scipy.special import ndtr  # slow to import, and few questions need it

    return np.asarray(ndtr(values))


def hertz_pressure(forces: ArrayLike, radius: float, modulus: float) -> Array:
    """Largest contact pressure [Pa] of a ball on a flat surface.

    Parameters
    ----------
    forces
        Any shape [N].
    radius
        Of the ball [m].
    modulus
        Contact modulus E* [Pa].

    Examples
    --------
    >>> from chaosgym.design.reliability import hertz_pressure
    >>> hertz_pressure([10.0, 80.0], radius=8e-3, modulus=1.15e11).round(-6)
    array([7.370e+08, 1.473e+09])
    """
    if not (radius > 0.0 and modulus > 0.0):
        raise DesignError(f"radius = {radius:g} m and modulus = {modulus:g} Pa are out of range; allowed: above 0")
    return np.asarray(np.cbrt(6.0 * np.asarray(forces) * modulus**2 / (math.pi**3 * radius**2)))


def safety_factor(stress: float, strength: float, fatigue_factor: float = 1.0) -> float:
    """Safety factor SF of eq. 5.6; infinite without stress.

    Examples
    --------
    >>> from chaosgym.design.reliability import safety_factor
    >>> safety_factor(stress=8e8, strength=1.6e9)
    2.0
    """
    return math.inf if stress == 0.0 else strength / (fatigue_factor * stress)


def reliability(stresses: ArrayLike, strength: Strength) -> float:
    """Reliability over recorded stresses [Pa], eq. 5.8.

    Examples
    --------
    >>> from chaosgym.design.reliability import Strength, reliability
    >>> round(reliability([1.3e9, 1.5e9], Strength(1.6e9, 0.1e9)), 4)
    0.92
    """
    return float(np.mean(strength.exceeds(stresses)))


def normal_reliability(
    stress_mean: float, stress_deviation: float, strength_mean: float, strength_deviation: float
) -> float:
    """Reliability of normal stress and normal strength, eq. 5.9.

    Examples
    --------
    >>> from chaosgym.design.reliability import normal_reliability
    >>> round(normal_reliability(1.3e9, 0.1e9, 1.6e9, 0.1e9), 4)
    0.9831
    """
    spread = math.hypot(stress_deviation, strength_deviation)
    if spread == 0.0:
        return float(strength_mean > stress_mean)
    return float(_normal_cdf((strength_mean - stress_mean) / spread))


class Interval(NamedTuple):
    """Ends of a confidence interval."""

    low: float
    high: float


def time_blocks(values: ArrayLike, blocks: int = BLOCKS) -> list[Array]:
    """Cut a record into blocks of successive cycles, at least one cycle each.

    Examples
    --------
    >>> from chaosgym.design.reliability import time_blocks
    >>> time_blocks([1.0, 2.0, 3.0, 4.0], blocks=2)
    [array([1., 2.]), array([3., 4.])]
    """
    record = np.asarray(values)
    return np.array_split(record, min(blocks, len(record)))


def mean_interval(blocks: Sequence[ArrayLike], confidence: float = 0.95, seed: int = 0) -> Interval:
    """Confidence interval of a mean over blocks of values that are independent of one another.

    Parameters
    ----------
    blocks
        Values of each block: successive cycles, or the cycles of one machine of a series.
    confidence
        Probability that the interval holds the mean.
    seed
        Of the bootstrap; same seed, same interval.

    Examples
    --------
    >>> from chaosgym.design.reliability import mean_interval
    >>> mean_interval([[1.0, 3.0]] * 10)
    Interval(low=2.0, high=2.0)
    """
    number("confidence", confidence, 0.0, 1.0, inside=True, error=DesignError)
    means = np.array([np.mean(np.asarray(block)) for block in blocks])
    if np.ptp(means) == 0.0:
        return Interval(float(means[0]), float(means[0]))
    drawn = np.random.default_rng(seed).choice(means, (RESAMPLES, len(means)))
    tail = 50.0 * (1.0 - confidence)
    low, high = np.percentile(drawn.mean(axis=1), [tail, 100.0 - tail])
    return Interval(float(low), float(high))
