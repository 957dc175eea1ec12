"""What a controller is: a rule that turns the observations of many jobs into speeds, and says what it knows.

controller = Follow()
controller.start(envs)                   # a native vector environment with action="speed", after its reset
actions = controller(observations)       # (n, 1)
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.control.readings import Readings
from chaosgym.envs.kernels.steps import PLACE
from chaosgym.envs.memory import irregularity
from chaosgym.envs.sense import has_sense
from chaosgym.envs.task import Task
from chaosgym.errors import ParameterError

Observations = NDArray[np.float32]


EXCESS = 1.5
"""Mean peak force over that at the demand above which no controller that goes by measurements stays (assumed): it wears
the joint four times as fast. A task with a ``damage_weight`` of 0 allows any force."""


class Controller:
    """A rule for many machines side by side; a subclass has ``speeds`` and, for what it remembers, ``begin``.

    One that goes by measurements alone leaves a speed whose force is ``EXCESS`` times that at the demand.
    """

    knows: str = "nothing"
    """Beside the demand: "measurements", the nominal "model", models within "tolerances", or this very "machine"; and
    the demands to come ("future")."""

    def __init__(self) -> None:
        self.task: Task

    @property
    def keywords(self) -> dict[str, Any]:
        """Keywords of the environment that it plays in."""
        return {"action": "speed"}

    def start(self, envs: Any) -> None:
        """Begin the jobs of a vector environment that has been reset."""
        self.task, self.count = envs.task, envs.num_envs
        known = hasattr(envs, "nominal") and has_sense(envs.nominal.name)  # a plant has no model
        self.sure = SURE if known else SURE_OF_RECORDS
        self._readings = Readings(self.task, self.count)
        self._force = np.full((self.count, len(self.task.grid)), np.nan)
        self.begin(envs)

    def begin(self, envs: Any) -> None:
        """Forget the last jobs."""

    def __call__(self, observations: Observations) -> NDArray[np.float32]:
        """Return the actions (n, 1); a step without a usable reading holds, as ``control.readings`` says.

        Raises
        ------
        ParameterError
            If it has not been started.
        """
        if not hasattr(self, "_readings"):
            raise ParameterError(
                f"{type(self).__name__} knows no task yet; call start(envs) of it first, or evaluate(policy, id)"
            )
        observations = self._readings.take(observations)
        speeds = self._lighter(observations, self.speeds(observations))
        if self.task.drive == "motor":  # the set-point is ahead by what the motor slipped in the last step
            speeds = speeds + added(observations, self.task, "set_point") - seen(observations, "speed")
        speeds = np.clip(speeds, self.task.lowest_speed, self.task.highest_speed)
        return self._readings.answer(speeds[:, None].astype(np.float32))

    def _lighter(self, observations: Observations, speeds: Array) -> Array:
        """The speeds, but the demand where the force was ``EXCESS`` times that at the demand, each when last felt."""
        if self.knows != "measurements" or self.task.damage_weight == 0.0:
            return speeds
        every, demand = np.arange(self.count), seen(observations, "demand")
        self._force[every, place_of(seen(observations, "speed"), self.task)] = seen(observations, "mean_peak_force")
        at, to = (self._force[every, place_of(values, self.task)] for values in (demand, speeds))
        return np.where(to > EXCESS * at, demand, speeds)

    def speeds(self, observations: Observations) -> Array:
        """Return the speeds (n,) to go to."""
        raise NotImplementedError

    def cost(self, share: Array, damage: Array, demand: Array, grid: Array) -> Array:
        """What a step at each speed of a grid costs, (n, s), by share of Type III and damage there, (s,) or (n, s)."""
        task = self.task
        felt = task.type_iii_weight * share + task.damage_weight * damage
        return np.asarray(task.deviation_weight * np.abs(grid - demand[:, None]) + felt)


def seen(observations: Observations, name: str) -> Array:
    """One entry that every observation has, (n,)."""
    return observations[:, getattr(PLACE, name)].astype(float)


def added(observations: Observations, task: Task, name: str) -> Array:
    """One entry that a keyword of the task adds to the observations, (n,)."""
    return observations[:, task.places[name]].astype(float)


def place_of(speeds: Array, task: Task) -> NDArray[np.int64]:
    """Places of the nearest speeds of the task's grid, (n,)."""
    places = np.rint((speeds - task.lowest_speed) / task.trim_step)
    return np.asarray(places.clip(0, len(task.grid) - 1), np.int64)


THRESHOLD = 1.17
"""Measured irregularity, in units of the sensor's error, above which motion is irregular (set on other machines)."""


SURE = 0.7
"""Probability of the trained sense above which motion is irregular (chosen on machines of training)."""


SURE_OF_RECORDS = 0.9
"""The same where no sense is shipped and the classifier of records answers (calibrated on other machines): fluctuations
of the speed, which it was not trained with, look slightly irregular to it."""


def irregular(observations: Observations, task: Task, threshold: float, softness: float, sure: float) -> Array:
    """Probability (n,) that the motion is irregular, by the measured irregularity in units of the sensor's error.

    Where the task gives that of the trained sense, 1 if it is above ``sure`` and 0 if not.
    """
    if task.classifier == "on":
        return (added(observations, task, "irregular_probability") > sure).astype(float)
    felt = irregularity(observations) / max(task.sensor_error, 1e-3 * task.reference_force)
    return np.asarray(0.5 + 0.5 * np.tanh(0.5 * (felt - threshold) / softness))
