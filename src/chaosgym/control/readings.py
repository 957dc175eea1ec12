"""Which steps have no usable reading, and what every policy does then: hold, and go to the demand after a few.

A reading that is not finite is none, and neither is a mean peak force of 0 N, as of a dead sensor, or beyond the range
of the sensors. A policy does not see such a step: it is given the last usable observation of the job once more.
"""

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.envs.drive import BACK
from chaosgym.envs.kernels.steps import PLACE
from chaosgym.envs.observation import FORCE_RANGE, OBSERVATION_NAMES
from chaosgym.envs.task import Task
from chaosgym.errors import ParameterError
from chaosgym.plants.plant import LONGEST_HOLD

FIRST_FELT = PLACE.mean_peak_force
"""Column from which on the entries of an observation are readings."""

HOLD = 0
"""Discrete action that keeps the trim."""


def usable(observations: NDArray[Any], task: Task) -> NDArray[np.bool_]:
    """Which observations (n, entries) have a usable reading, (n,).

    Examples
    --------
    >>> from chaosgym.control.readings import usable
    >>> from chaosgym.envs.task import Task
    >>> observations = np.full((3, 14), 20.0)
    >>> observations[1, 6], observations[2, 9] = 1e9, np.nan  # mean peak force [N], repeat_1
    >>> usable(observations, Task())
    array([ True, False, False])
    """
    mean = observations[:, PLACE.mean_peak_force]
    plausible = (mean > 0.0) & (mean < np.float32(FORCE_RANGE * task.reference_force))
    return np.asarray(plausible & np.isfinite(observations).all(axis=1))


class Readings:
    """Readings of N jobs side by side, as a policy is given them.

    Parameters
    ----------
    task
        Of the jobs.
    count
        N.
    """

    def __init__(self, task: Task, count: int) -> None:
        self._task, self._rows, self._actions = task, np.zeros((count, 0)), np.zeros(0)
        self._missed, self._home = np.zeros(count, int), np.ones(count, np.bool_)
        self._demand, self._warned = np.full(count, np.nan), False

    def take(self, observations: NDArray[Any]) -> NDArray[Any]:
        """Return the observations (N, entries) with the last usable ones in the place of those without a reading.

        Before the first reading of a job that is the ``reference_force`` in every cycle.

        Raises
        ------
        ParameterError
            If an entry that is no reading of a sensor is not finite.
        """
        if not np.isfinite(observations[:, :FIRST_FELT]).all():
            raise ParameterError("an observation has a speed, demand or time that is not finite; allowed: finite ones")
        good, demand = usable(observations, self._task), observations[:, PLACE.demand].astype(float)
        if self._rows.shape[1] == 0:
            self._rows = observations.copy()
            self._rows[:, FIRST_FELT : len(OBSERVATION_NAMES)] = 0.0
            self._rows[:, [PLACE.mean_peak_force, PLACE.max_peak_force]] = self._task.reference_force
        self._missed = np.where(good, 0, self._missed + 1)
        self._home = ~good & (self._home | (self._missed > LONGEST_HOLD) | (demand != self._demand))
        self._demand = demand
        self._rows = np.where(good[:, None], observations, self._rows)
        self._warn(observations)
        return self._rows.copy()

    def answer(self, actions: Any) -> NDArray[Any]:
        """Return the actions of a policy, with a held trim or the demand where there is no reading."""
        given = np.array(actions)
        missed = self._missed > 0
        if missed.any():
            if self._task.action == "trim":
                given[missed] = np.where(self._home, BACK, HOLD)[missed].reshape(given[missed].shape)
            elif self._task.action == "continuous":
                given[missed] = np.column_stack([np.zeros(len(missed)), self._home])[missed]
            else:
                for job in np.flatnonzero(missed):
                    given[job] = self._demand[job] if self._home[job] else self._actions[job]
        self._actions = given.copy()
        return given

    def _warn(self, observations: NDArray[Any]) -> None:
        """Say once in a job that the sensor seems to be dead or out of its range."""
        if self._warned or self._missed.max(initial=0) <= LONGEST_HOLD:
            return
        self._warned = True
        mean = float(observations[self._missed.argmax(), PLACE.mean_peak_force])
        warnings.warn(
            f"no usable reading for {LONGEST_HOLD + 1} steps (mean peak force {mean:g} N), so the policy follows the "
            f"demand; allowed: finite readings above 0 N and below {FORCE_RANGE * self._task.reference_force:g} N, "
            f"{FORCE_RANGE:g} times reference_force",
            stacklevel=4,
        )
