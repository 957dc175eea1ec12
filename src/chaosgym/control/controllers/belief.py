"""Planning on a belief: which of many simulated machines would have had the mean peaks that were felt?

The model is one rung coarser than the machine, and speed ripple keeps a simulation from repeating a record: this is
what a model is worth to someone who measures.
"""

from typing import Any

import numpy as np

from chaosgym.control.controllers.controller import Array, Controller, Observations, irregular, seen
from chaosgym.control.maps import Maps


class Belief(Controller):
    """Goes to the speed of least expected cost over simulated machines, weighed by how well their mean peaks fit.

    Parameters
    ----------
    fleet
        Maps of models within tolerances.
    spread
        Miss of a mean peak, in units of the sensor's error, that is nothing unusual.
    temper
        Share of the evidence of a step that counts, since steps are alike.
    """

    knows = "tolerances"

    def __init__(self, fleet: Maps, *, spread: float = 1.33, temper: float = 0.5) -> None:
        super().__init__()
        self.fleet, self.spread, self.temper = fleet, spread, temper

    def begin(self, envs: Any) -> None:
        """Believe in all simulated machines alike."""
        shape = (self.count, len(self.fleet.speeds))
        self._fit = np.zeros((self.count, len(self.fleet.share)))
        self._wild, self._visits = np.zeros(shape), np.zeros(shape)
        self._speed = np.full(self.count, np.nan)

    def speeds(self, observations: Observations) -> Array:
        """The best speed on the expected map, what was felt at a speed counted in."""
        speed, every = seen(observations, "speed"), np.arange(self.count)
        held = np.abs(speed - self._speed) < 0.5 * self.task.trim_step
        self._speed = speed
        place = self.fleet.nearest(speed)
        error = self.spread * max(self.task.sensor_error, 1e-3 * self.task.load_rating)
        miss = (seen(observations, "mean_peak_force")[:, None] - self.fleet.mean_peak[:, place].T) / error
        self._fit -= self.temper * np.where(held[:, None], np.log1p(0.5 * miss**2), 0.0)
        weight = np.exp(self._fit - self._fit.max(axis=1, keepdims=True))
        weight /= weight.sum(axis=1, keepdims=True)
        self._wild[every, place] += irregular(observations, self.task, 1.17, 0.1) * held
        self._visits[every, place] += held
        share = (weight @ self.fleet.share + self._wild) / (1.0 + self._visits)
        grid = self.fleet.speeds
        return np.asarray(grid[self.cost(share, seen(observations, "demand"), grid).argmin(axis=1)])
