r"""A memory of load over speed: a Gaussian process of what was felt in this job, and the speed of least expected cost.

The logarithm y of the mean peak force is a function of the speed x, this machine's own. Its prior is

    y(x) ~ N(0, C),   C(x, x') = a^2 + b^2 u u' + s^2 exp(-|x - x'| / l),   u = log(x / lowest speed),             (1)

a constant and a power of the speed, and a rough part on top of them. A step at x tells y(x) with an error of deviation
e. Mean and deviation at all speeds follow from the steps of the job so far. The length l, the size s and the error e
are those under which these steps are likeliest, with a wide prior of each.

References
----------
C. E. Rasmussen and C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press, 2006, (2.25), (2.26), (5.8).
ISO 281:2007: life falls as the load to the power of 10/3.
"""

from itertools import product
from typing import Any, NamedTuple

import numpy as np

from chaosgym.control.controllers.controller import Array, Controller, Observations, place_of, seen
from chaosgym.design.rating_life import LIFE_EXPONENT

CONSTANT, POWER = 3.0, 2.0
"""Deviations a and b: the force within a factor of 20 of its mean, as speed^-2 to speed^2 (assumed)."""

LENGTHS, SIZES, ERRORS = (0.04, 0.08, 0.16, 0.32), (0.05, 0.15, 0.45, 1.35), (0.01, 0.03, 0.1)
"""Values of l, as a share of the range of speed, of s and of e that are tried (assumed)."""

MIDDLE, WIDTH = (0.16, 0.15, 0.03), (1.0, 1.5, 1.5)
"""Prior of l, s and e: middle, and deviation of the logarithm (assumed)."""

REFIT = 5
"""Steps after which l, s and e are chosen anew (assumed)."""

LARGEST_COUNT = 3.0
"""Steps at one speed that count: what is alike in them does not average out (assumed)."""


class Prior(NamedTuple):
    """One choice of l, s and e: ``covariance`` (s, s) of the speeds by (1), ``error`` e, and its ``log_density``."""

    covariance: Array
    error: float
    log_density: float


class Kriging(Controller):
    """Goes to the speed of least expected cost within reach of the demand; no model, no training.

    A step costs its distance from the demand, as a share of the range of speed, and the ``price`` times its load over
    the mean load of the job so far, each to the power of 10/3.

    Parameters
    ----------
    price
        Share of the range of speed that the life of a step is worth. 2/3 is that of ``objective="life"`` on the beam.
    optimism
        Deviations by which doubt makes a speed look better, so that speeds are tried at all; chosen on beams, cranks
        and published machines that no comparison plays.

    Examples
    --------
    >>> from chaosgym.control.controllers import Kriging
    >>> from chaosgym.control.rollout import play
    >>> played = play(Kriging(), "chaosgym/ImpactBeamTolerance-v1", [3], steps=8, objective="life")
    >>> played.speed.shape
    (8, 1)
    """

    knows = "measurements"

    def __init__(self, *, price: float = 2.0 / 3.0, optimism: float = 0.75) -> None:
        super().__init__()
        self.price, self.optimism = price, optimism

    def begin(self, envs: Any) -> None:
        """Know nothing."""
        grid = self.task.grid
        self._priors = _priors(grid)
        self._chosen = [self._priors[0]] * self.count
        self._counts, self._sums = np.zeros((2, self.count, len(grid)))
        self._steps = 0

    def speeds(self, observations: Observations) -> Array:
        """The speed of least expected cost."""
        task, grid = self.task, self.task.grid
        self._feel(observations)
        mean, deviation = self.estimate()
        usual = self._sums.sum(axis=1) / self._counts.sum(axis=1)
        hoped = mean - self.optimism * deviation - usual[:, None]
        distance = np.abs(grid - seen(observations, "demand")[:, None])
        cost = distance / (grid[-1] - grid[0]) + self.price * np.exp(np.clip(LIFE_EXPONENT * hoped, -8.0, 3.0))
        cost[distance > task.largest_trim + 0.5 * task.trim_step] = np.inf
        return np.asarray(grid[cost.argmin(axis=1)])

    def estimate(self) -> tuple[Array, Array]:
        """Mean and deviation of the logarithm of the mean peak force at every speed of the grid, (n, s) each."""
        found = [self._estimate(job) for job in range(self.count)]
        return np.array([mean for mean, _ in found]), np.array([deviation for _, deviation in found])

    def _feel(self, observations: Observations) -> None:
        task, every = self.task, np.arange(self.count)
        least = max(task.sensor_error, 1e-3 * task.load_rating)
        place = place_of(seen(observations, "speed"), task)
        self._counts[every, place] += 1.0
        self._sums[every, place] += np.log(np.maximum(seen(observations, "mean_peak_force"), least))
        self._steps += 1

    def _estimate(self, job: int) -> tuple[Array, Array]:
        at = np.flatnonzero(self._counts[job])
        felt = self._sums[job, at] / self._counts[job, at]
        counts, middle = np.minimum(self._counts[job, at], LARGEST_COUNT), felt.mean()
        if self._steps % REFIT == 1:
            self._chosen[job] = max(self._priors, key=lambda prior: _log_posterior(prior, at, felt - middle, counts))
        prior = self._chosen[job]
        factor, whitened = _whitened(prior, at, felt - middle, counts)
        known = np.linalg.solve(factor, prior.covariance[at])
        variance = np.diag(prior.covariance) - (known**2).sum(axis=0)
        return middle + known.T @ whitened, np.sqrt(np.maximum(variance, 0.0))


def _priors(grid: Array) -> list[Prior]:
    """All choices of l, s and e for the speeds of a grid."""
    u = np.log(grid / grid[0]) if grid[0] > 0.0 else (grid - grid[0]) / (grid[-1] - grid[0])
    smooth = CONSTANT**2 + POWER**2 * u[:, None] * u
    share = np.abs(grid[:, None] - grid) / (grid[-1] - grid[0])
    priors = []
    for chosen in product(LENGTHS, SIZES, ERRORS):
        length, size, error = chosen
        density = -0.5 * np.sum((np.log(np.divide(chosen, MIDDLE)) / WIDTH) ** 2)
        priors.append(Prior(smooth + size**2 * np.exp(-share / length), error, float(density)))
    return priors


def _whitened(prior: Prior, at: Any, felt: Array, counts: Array) -> tuple[Array, Array]:
    """Cholesky factor of the covariance of what was felt, and its inverse times that."""
    covariance = prior.covariance[np.ix_(at, at)] + np.diag(prior.error**2 / counts)
    factor = np.asarray(np.linalg.cholesky(covariance), float)
    return factor, np.asarray(np.linalg.solve(factor, felt))


def _log_posterior(prior: Prior, at: Any, felt: Array, counts: Array) -> float:
    """Logarithm of the posterior density of a choice of l, s and e, but for a constant."""
    factor, whitened = _whitened(prior, at, felt, counts)
    return float(prior.log_density - 0.5 * whitened @ whitened - np.log(np.diag(factor)).sum())
