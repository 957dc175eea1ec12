r"""Kriging of the load over speed: a Gaussian process fitted in the job, and the speed of least expected cost.

The logarithm y of the mean peak force is a function of the speed x, this machine's own. Its prior is

    y(x) ~ N(0, C),   C(x, x') = a^2 + b^2 u u' + s^2 exp(-|x - x'| / l),   u = log(x / lowest speed),             (1)

a constant and a power of the speed, and a rough part on top of them. A step at x tells y(x) with an error of deviation
e. Mean and deviation at all speeds follow from the steps of the job so far. The length l, the size s and the error e
are those under which these steps are likeliest, with a wide prior of each. Several motions may exist at a speed, so the
latest step there counts most.

The first step goes to the demand. A step at x costs c(x) = d(x) + L(x), its distance from the demand and the life it
takes, L being log-normal. With b the least expected cost, trying x may save max(b - c(x), 0) in each of the H steps to
come: the rule goes where

    E c(x) - H E max(b - c(x), 0)                                                                                (2)

is least, if that is below its value at the demand by a share of the cost there. So it moves only where what may be won
exceeds what is risked.

References
----------
D. R. Jones, M. Schonlau and W. J. Welch, Journal of Global Optimization 13 (1998) 455-492: expected improvement.
C. E. Rasmussen and C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press, 2006, (2.25), (2.26), (5.8).
ISO 281:2007: life falls as the load to the power of 10/3.
"""

from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.control.controllers.controller import Controller, Observations, place_of, seen
from chaosgym.rating_life import LIFE_EXPONENT

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

LATEST = 0.5
"""Weight of the latest step at a speed, against those before; they may have been of another motion (tuned)."""

HORIZON, LEAST_GAIN = 20, 0.1
"""Steps H for which a find is used, and share of the cost at the demand that a move must win (tuned).

Chosen on machines of the pool's training split and beams of the fleet's, which no table of the documentation plays.
"""


LOG_COST = (-30.0, 9.0)
"""Logarithms of the least and the largest cost of a step that are distinguished."""


class KrigingPrior(NamedTuple):
    """One choice of l, s and e: ``covariance`` (s, s) of the speeds by (1), ``error`` e, and its ``log_density``."""

    covariance: Array
    error: float
    log_density: float


class Kriging(Controller):
    """Starts at the demand and leaves it for speeds within reach where life costs less; no model, no training.

    A step costs its distance from the demand, as a share of the range of speed, and the ``price`` times its load over
    the usual load, that at the demands so far, each to the power of 10/3.

    Parameters
    ----------
    price
        Share of the range of speed that the life of a step at usual load is worth; 2/3 is that of ``objective="life"``
        on the beam. None is what the task charges, by its own weights and reference force: under ``"irregular"`` life
        is worth next to nothing, and the rule follows the demand.

    Examples
    --------
    >>> from chaosgym.control.controllers import Kriging
    >>> from chaosgym.control.rollout import play
    >>> played = play(Kriging(), "chaosgym/ImpactBeamTolerance-v1", [3], steps=8, objective="life")
    >>> played.speed.shape
    (8, 1)
    """

    knows = "measurements"

    def __init__(self, *, price: float | None = 2.0 / 3.0) -> None:
        super().__init__()
        self.price = price

    def begin(self, envs: Any) -> None:
        """Begin without measurements."""
        grid = self.task.grid
        self._priors = _priors(grid)
        self._chosen = [self._priors[0]] * self.count
        self._counts, self._felt, self._asked = np.zeros((3, self.count, len(grid)))
        self._steps = 0

    def speeds(self, observations: Observations) -> Array:
        """The demand, or a speed that is worth more."""
        task, grid, every = self.task, self.task.grid, np.arange(self.count)
        self._feel(observations)
        demand = seen(observations, "demand")
        at = place_of(demand, task)
        self._asked[every, at] += 1.0
        mean, deviation = self.estimate()
        distance = np.abs(grid - demand[:, None])
        far = distance > task.largest_trim + 0.5 * task.trim_step
        expected, value = _values(
            distance / (grid[-1] - grid[0]), self._log_price(mean), LIFE_EXPONENT * deviation, far
        )
        best = value.argmin(axis=1)
        here = expected[every, at]
        wins = value[every, best] < value[every, at] - LEAST_GAIN * here
        return np.where(wins & (self._counts[every, at] > 0.0), grid[best], demand)

    def _log_price(self, mean: Array) -> Array:
        """Logarithm of what the life of a step costs at each speed, (n, s), if its load is the mean."""
        task = self.task
        if self.price is None:
            life = task.damage_weight * task.reference_damage / task.steps
            distance = task.deviation_weight * (task.grid[-1] - task.grid[0])
            return np.asarray(
                LIFE_EXPONENT * (mean - np.log(task.reference_force)) + np.log(max(life, 1e-9) / max(distance, 1e-9))
            )
        above = LIFE_EXPONENT * (mean - mean.max(axis=1, keepdims=True))
        usual = np.average(np.exp(above), axis=1, weights=self._asked)
        return np.asarray(above - np.log(np.maximum(usual, 1e-12))[:, None] + np.log(self.price))

    def estimate(self) -> tuple[Array, Array]:
        """Mean and deviation of the logarithm of the mean peak force at every speed of the grid, (n, s) each."""
        found = [self._estimate(job) for job in range(self.count)]
        return np.array([mean for mean, _ in found]), np.array([deviation for _, deviation in found])

    def _feel(self, observations: Observations) -> None:
        task, every = self.task, np.arange(self.count)
        least = max(task.sensor_error, 1e-3 * task.reference_force)
        place = place_of(seen(observations, "speed"), task)
        self._counts[every, place] += 1.0
        weight = np.maximum(LATEST, 1.0 / self._counts[every, place])
        told = np.log(np.maximum(seen(observations, "mean_peak_force"), least))
        self._felt[every, place] += weight * (told - self._felt[every, place])
        self._steps += 1

    def _estimate(self, job: int) -> tuple[Array, Array]:
        at = np.flatnonzero(self._counts[job])
        felt = self._felt[job, at]
        counts, middle = np.minimum(self._counts[job, at], LARGEST_COUNT), felt.mean()
        if self._steps % REFIT == 1:
            self._chosen[job] = max(self._priors, key=lambda prior: _log_posterior(prior, at, felt - middle, counts))
        prior = self._chosen[job]
        factor, whitened = _whitened(prior, at, felt - middle, counts)
        known = np.linalg.solve(factor, prior.covariance[at])
        variance = np.diag(prior.covariance) - (known**2).sum(axis=0)
        return middle + known.T @ whitened, np.sqrt(np.maximum(variance, 0.0))


def _values(distance: Array, log_price: Array, deviation: Array, far: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Expected cost and the value (2) of each speed, (n, s); ``deviation`` is that of ``log_price``."""
    from scipy.special import ndtr

    deviation = np.maximum(deviation, 1e-9)
    life = np.exp(np.clip(log_price + 0.5 * deviation**2, *LOG_COST))
    expected = np.where(far, np.inf, distance + life)
    room = expected.min(axis=1, keepdims=True) - distance
    below = (np.log(np.maximum(room, 1e-12)) - log_price) / deviation
    saved = room * ndtr(below) - life * ndtr(below - deviation)
    return expected, np.where(far, np.inf, expected - HORIZON * np.where(room > 0.0, np.maximum(saved, 0.0), 0.0))


def _priors(grid: Array) -> list[KrigingPrior]:
    """All choices of l, s and e for the speeds of a grid."""
    u = np.log(grid / grid[0]) if grid[0] > 0.0 else (grid - grid[0]) / (grid[-1] - grid[0])
    smooth = CONSTANT**2 + POWER**2 * u[:, None] * u
    share = np.abs(grid[:, None] - grid) / (grid[-1] - grid[0])
    priors = []
    for chosen in product(LENGTHS, SIZES, ERRORS):
        length, size, error = chosen
        density = -0.5 * np.sum((np.log(np.divide(chosen, MIDDLE)) / WIDTH) ** 2)
        priors.append(KrigingPrior(smooth + size**2 * np.exp(-share / length), error, float(density)))
    return priors


def _whitened(prior: KrigingPrior, at: Any, felt: Array, counts: Array) -> tuple[Array, Array]:
    """Cholesky factor of the covariance of the measured values, and its inverse times that."""
    covariance = prior.covariance[np.ix_(at, at)] + np.diag(prior.error**2 / counts)
    factor = np.asarray(np.linalg.cholesky(covariance), float)
    return factor, np.asarray(np.linalg.solve(factor, felt))


def _log_posterior(prior: KrigingPrior, at: Any, felt: Array, counts: Array) -> float:
    """Logarithm of the posterior density of a choice of l, s and e, but for a constant."""
    factor, whitened = _whitened(prior, at, felt, counts)
    return float(prior.log_density - 0.5 * whitened @ whitened - np.log(np.diag(factor)).sum())
