"""A learned map: irregularity and load of a machine at every speed, predicted from the measurements of the job.

A network was trained on machines of a fleet to predict their behaviour at all speeds from measurements at some of
them. In a job its prediction replaces the machine's own map, and the next speed is that of least expected cost within
reach. The weights of the task enter in this cost alone, so one network serves every objective.
"""

import warnings
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.control.controllers.controller import Controller, Observations, place_of, seen
from chaosgym.control.policies.network import Network
from chaosgym.envs import environment
from chaosgym.envs.levels import task_of
from chaosgym.envs.memory import irregularity
from chaosgym.envs.task import Task
from chaosgym.errors import ModelFileError
from chaosgym.rating_life import damage_in_a_million

READINGS = ("mean peak", "scatter", "irregularity", "impacts", "bouncing")
"""What is remembered of a speed; the first three as logarithms [log N]."""

NOISE = np.array([1.0, 0.3, 0.3])
"""Added before the logarithm of the first three, in errors of the sensor (assumed)."""

LARGEST = 5.0
"""Readings are cut off here, in standard deviations from what is usual at a speed."""

CHANNELS = 2 + len(READINGS)
"""Numbers remembered of each speed: visited, settled there, and the readings."""

AFRESH = 0.5
"""Weight of the last settled step at a speed against those before it there."""


def readings_of(observations: NDArray[Any], task: Task) -> Array:
    """Readings (n, 5) of observations (n, entries)."""
    forces = [seen(observations, "mean_peak_force"), seen(observations, "std_peak_force"), irregularity(observations)]
    others = [seen(observations, "impacts_per_cycle"), seen(observations, "bouncing_share")]
    return np.column_stack([*np.log(np.column_stack(forces) + task.sensor_error * NOISE).T, *others])


class FeltSpeeds:
    """Measurements of N jobs at each speed of a task's grid.

    Parameters
    ----------
    task
        Whose speeds they are.
    count
        N.
    mean, deviation
        Of the readings at each speed over the machines of training, (speeds, 5).

    Attributes
    ----------
    settled : (N,)
        Whether the last step held the speed of the one before.
    """

    def __init__(self, task: Task, count: int, mean: Array, deviation: Array) -> None:
        self.task, self.mean, self.deviation = task, mean, deviation
        self._felt = np.zeros((count, len(task.grid), CHANNELS), np.float32)
        self._last, self._jobs = np.full(count, np.nan), np.arange(count)
        self.settled = np.zeros(count, np.bool_)

    @property
    def memory(self) -> NDArray[np.float32]:
        """What is remembered of each speed, (N, speeds, 7)."""
        return self._felt.copy()

    @memory.setter
    def memory(self, values: NDArray[np.float32]) -> None:
        self._felt[:] = values

    def felt(self, places: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whether anything was felt in this job at a place of the grid, (N,) each."""
        return np.asarray(self._felt[self._jobs, places, 0] > 0.0)

    def unusual(self, observations: Observations) -> Array:
        """How far the readings lie from what is usual at their speed, in standard deviations, (N, 5)."""
        place = place_of(seen(observations, "speed"), self.task)
        far = (readings_of(observations, self.task) - self.mean[place]) / self.deviation[place]
        return np.asarray(far.clip(-LARGEST, LARGEST))

    def add(self, observations: Observations) -> NDArray[np.float32]:
        """Take in a step (N, entries); return what is remembered and the share of the job to do, (N, 7 speeds + 1)."""
        speed = seen(observations, "speed")
        place = place_of(speed, self.task)
        readings = self.unusual(observations)
        self.settled = np.abs(speed - self._last) < 0.3 * self.task.trim_step
        self._last = speed
        before = self._felt[self._jobs, place]
        had = before[:, 1] > 0.0
        # a step on the way counts only until the speed was held
        weight = np.where(self.settled, np.where(had, AFRESH, 1.0), np.where(had, 0.0, 1.0))[:, None]
        self._felt[self._jobs, place, 0] = 1.0
        self._felt[self._jobs, place, 1] = self.settled | had
        mixed = (1.0 - weight) * before[:, 2:] + weight * readings
        self._felt[self._jobs, place, 2:] = mixed
        left = seen(observations, "remaining_share")[:, None].astype(np.float32)
        return np.concatenate([self._felt.reshape(len(speed), -1), left], axis=1)


def warn_of_other_steps(learned: int, envs: Any) -> None:
    """Warn if steps have another number of cycles than a policy learned from, 0 for the machine's own task.

    The scatter of few peaks is another number than that of many, so what is usual does not hold.
    """
    learned, here = learned or task_of(envs.nominal, "nominal").cycles_per_step, envs.task.cycles_per_step
    if here != learned:
        warnings.warn(
            f"the policy learned from steps of {learned} cycles and plays with {here}; give cycles_per_step={learned}",
            stacklevel=2,
        )


@dataclass
class LearnedMap(Controller):
    """Goes to the speed of least expected cost within the band of trims, by a network's map of this machine.

    Attributes
    ----------
    env
        Environment of the training: its id, or the file of the machine.
    network
        From what ``FeltSpeeds`` remembers to 2 numbers for each speed: the logit of the share of irregular cycles, and
        the logarithm of the mean peak [log N].
    mean, deviation
        As for ``FeltSpeeds``.
    machine
        ``definition`` of the machine that it was trained on; by default the name in the environment's id.
    cycles_per_step
        Cycles of the steps that it learned from; 0 for those of the machine's own task.
    least_gain
        Expected gain of a step for which it leaves the demand.
    wary
        Whether a demand that was not felt yet counts as calm, the lower bound of its share.

    Raises
    ------
    ModelFileError
        If the parts do not fit each other.

    Examples
    --------
    >>> from chaosgym.control.policies import shipped_policy
    >>> policy = shipped_policy("chaosgym/ImpactBeamTolerance-v1", "fleet")
    >>> len(policy.mean)  # speeds of which it knows what is usual
    57
    """

    env: str
    network: Network
    mean: Array
    deviation: Array
    machine: str = ""
    cycles_per_step: int = 0
    least_gain: float = 0.0
    wary: bool = False
    knows: str = "measurements"
    _felt: FeltSpeeds = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__init__()
        self.machine = self.machine or environment(self.env).kwargs["machine"]
        shape = (len(self.mean), len(READINGS))
        for name, values in (("mean", self.mean), ("deviation", self.deviation)):
            if values.shape != shape or not np.isfinite(values).all():
                raise ModelFileError(f"the {name} of the readings is {values.shape}; expected: {shape}, all finite")
        if not (self.deviation > 0.0).all():
            raise ModelFileError("a deviation of the readings is not positive")
        if not 0.0 <= self.least_gain < np.inf:
            raise ModelFileError(f"the least gain is {self.least_gain}; allowed: 0 or more")
        self.network.check(CHANNELS * shape[0] + 1, 2 * shape[0])

    def begin(self, envs: Any) -> None:
        """Forget the last jobs.

        Raises
        ------
        ModelFileError
            If it is of another machine, or knows other speeds than those of the task.
        """
        here = envs.nominal.definition
        if here != self.machine:
            raise ModelFileError(
                f"the policy was trained on {self.env} (machine {self.machine}); this is {envs.nominal.name} "
                f"(machine {here})"
            )
        if len(self.mean) != len(self.task.grid):
            raise ModelFileError(
                f"the policy of {self.env} knows {len(self.mean)} speeds; this task has {len(self.task.grid)}"
            )
        warn_of_other_steps(self.cycles_per_step, envs)
        self._felt = FeltSpeeds(self.task, self.count, self.mean, self.deviation)

    @property
    def settled(self) -> NDArray[np.bool_]:
        """Whether the last step held the speed of the one before, of each job."""
        return self._felt.settled

    @property
    def memory(self) -> NDArray[np.float32]:
        """What was felt at each speed in the jobs that were started, (N, speeds, 7).

        Set it after a start to go on from an earlier job of the same machines, whose clearances are as they were then.
        """
        return self._felt.memory

    @memory.setter
    def memory(self, values: NDArray[np.float32]) -> None:
        if np.shape(values) != self._felt.memory.shape or not np.isfinite(values).all():
            raise ModelFileError(
                f"a memory of shape {np.shape(values)} is none of this policy; expected: {self._felt.memory.shape}, "
                "all finite"
            )
        self._felt.memory = values

    def unusual(self, observations: Observations) -> Array:
        """How far the readings lie from what was usual in training, in standard deviations, (n, 5)."""
        return self._felt.unusual(observations)

    def predicted(self, observations: Observations) -> tuple[Array, Array]:
        """Share of irregular cycles and mean peak [N] at each speed, (N, speeds) each, by all that was felt."""
        answer, _ = self.network(self._felt.add(observations), None)
        share, peak = np.split(answer.astype(float), 2, axis=1)
        return 0.5 + 0.5 * np.tanh(0.5 * share), np.exp(peak.clip(-10.0, 20.0))

    def speeds(self, observations: Observations) -> Array:
        """The speed of least expected cost."""
        task, grid = self.task, self.task.grid
        share, peak = self.predicted(observations)
        lost = damage_in_a_million(peak, task.reference_force) * task.reference_damage / task.steps
        demand = seen(observations, "demand")
        cost = self.cost(share, lost, demand, grid)
        cost[np.abs(grid - demand[:, None]) > task.largest_trim + 0.5 * task.trim_step] = np.inf
        best, least = grid[cost.argmin(axis=1)], cost.min(axis=1)
        if self.least_gain == 0.0 and not self.wary:
            return np.asarray(best)
        every, at = np.arange(self.count), place_of(demand, task)
        unknown = share[every, at] * (self.wary & ~self._felt.felt(at))
        return np.where(least < cost[every, at] - task.type_iii_weight * unknown - self.least_gain, best, demand)
