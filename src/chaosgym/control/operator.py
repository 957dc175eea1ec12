"""A policy at a machine that is not simulated here: peaks of a step in, the next speed out.

The machine may be a rig, or another program. ``Operator`` holds no motion: it makes the observation that the
environment would make of the same readings, asks the policy, and lets the drive of the task follow the answer.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.arrays import Array
from chaosgym.control.controllers import Controller
from chaosgym.control.evaluation import policy_of
from chaosgym.control.guard import GuardedPolicy
from chaosgym.control.policies.learned_map import LearnedMap
from chaosgym.control.readings import FIRST_FELT, usable
from chaosgym.core.compilation import call
from chaosgym.envs.drive import DEAD_BAND, MOVES, checked_actions
from chaosgym.envs.kernels.steps import drive, observe
from chaosgym.envs.observation import OBSERVATION_NAMES
from chaosgym.envs.vector_env import native_envs
from chaosgym.errors import ParameterError

FEWEST = 5
"""Cycles of a step at least: peaks are compared with those four cycles before."""

BEFORE_THE_FIRST = -1
"""Steps done before the machine was measured at the speed of the start."""

_FIRST = np.zeros(1, np.int64)


class Operator:
    """Runs a machine by a policy.

    Parameters
    ----------
    policy
        As for ``chaosgym.evaluate``; ``chaosgym.control.controllers.Kriging()`` needs no training.
    env
        Id of an environment, or the file of a machine: range of speed, slew limit and sensors are its task's.
    keywords
        Of the environment.

    Attributes
    ----------
    lost
        Steps since the start that had no usable reading.

    Raises
    ------
    ModelFileError
        If the policy can't be read.
    ParameterError
        If a keyword is out of range.

    Examples
    --------
    >>> import chaosgym
    >>> from chaosgym.control.controllers import Kriging
    >>> operator = chaosgym.Operator(Kriging(), "chaosgym/ImpactBeamTolerance-v1")
    >>> speed = operator.start(speed=20.0, demand=22.0)
    >>> for _ in range(3):
    ...     speed = operator.next([81.0, 80.2, 79.6, 80.4, 80.9])  # [N] of the last five cycles at this speed
    >>> 20.0 <= speed <= 24.0
    True
    """

    def __init__(self, policy: Any, env: str = "chaosgym/ImpactBeamTolerance-v1", **keywords: Any) -> None:
        self.policy = policy_of(policy)
        self._envs = native_envs(env, 1, **(keywords | self.policy.keywords))
        self.task, self._job = self._envs.task, self._envs.jobs.state
        if self.task.drive == "motor":
            raise ParameterError(
                "an operator is told peak forces, and not the speed to which a motor slips; allowed: "
                "drive = 'constant', for a drive that holds the speed it is given"
            )
        if self.task.added:
            raise ParameterError(
                f"an operator observes the {len(OBSERVATION_NAMES)} usual entries; allowed: a policy and keywords "
                f"without {', '.join(entry.name for entry in self.task.added)}"
            )
        self.demand, self.lost = float("nan"), 0

    @property
    def foreign(self) -> bool | None:
        """Whether the machine is foreign to a guarded policy; None without a guard."""
        return not self.policy.trusted[0] if isinstance(self.policy, GuardedPolicy) else None

    @property
    def speed(self) -> float:
        """Speed that the machine is to run at, in the unit of the machine's speed field."""
        return float(self._job["set_point"][0])

    def start(self, *, speed: float, demand: float) -> float:
        """Begin at a speed, with a demand, and drop earlier measurements; the first ``next`` gives those at this speed.

        Raises
        ------
        ParameterError
            If the speed or the demand lies outside the range of the drive.
        ModelFileError
            If the policy is of another machine.
        """
        job = np.zeros(1, self._job.dtype)
        job["speed"] = job["set_point"] = self._within("speed", speed)
        job["done"] = BEFORE_THE_FIRST
        demand = self._within("demand", demand)
        self._job[:], self.lost = job, 0
        self._ask(demand)
        self._job["changed"] = 0
        self.policy.start(self._envs)
        return self.speed

    def next(
        self,
        peaks: ArrayLike,
        *,
        demand: float | None = None,
        impacts: float | None = None,
        bouncing: float | None = None,
        speed: float | None = None,
    ) -> float:
        """Return the speed of the next step, after a step at ``speed``.

        Parameters
        ----------
        peaks : (cycles,)
            Largest force of each operating cycle of the step [N], five cycles or more. The longest stretch of finite
            ones is the reading; if it is shorter than five cycles the step has none. Without a reading the trim is
            held for two steps, and the demand followed from the third one on.
        demand
            Of the next step; by default that of the last one.
        impacts
            Contacts counted in a cycle, mean over the step. Trained policies look at it.
        bouncing
            Share of the half cycle spent bouncing on one side, from 0 to 1. Trained policies look at it.
        speed
            That the machine had in the step, as measured; by default, or if it is not finite, the one that was set.

        Raises
        ------
        ParameterError
            Before ``start``, if a reading is not usable, or if the policy looks at one that is not given.
        """
        if np.isnan(self.demand):
            raise ParameterError("the machine does not run; call start(speed=..., demand=...) first")
        try:
            felt = np.asarray(peaks, float)
        except (TypeError, ValueError):
            raise ParameterError(f"peaks = {peaks!r} are no numbers; allowed: {FEWEST} or more forces [N]") from None
        if felt.ndim != 1 or len(felt) < FEWEST or (felt < 0.0).any():
            raise ParameterError(
                f"peaks of shape {felt.shape} are not usable; allowed: {FEWEST} or more forces from 0 N on"
            )
        inner = self.policy.policy if isinstance(self.policy, GuardedPolicy) else self.policy
        looks = isinstance(inner, LearnedMap) or not isinstance(inner, Controller)
        if looks and (impacts is None or bouncing is None):
            raise ParameterError("a trained policy looks at impacts and bouncing too; give both, or use Kriging()")
        for name, value, high in (("impacts", impacts, np.inf), ("bouncing", bouncing, 1.0)):
            if value is not None and (value < 0.0 or value > high):
                raise ParameterError(f"{name} = {value!r} is out of range; allowed: 0 to {high:g}")
        if demand is not None:
            self._within("demand", demand)
        self._count_a_step()
        self._ask(self.demand if demand is None else demand)
        self._job["speed"] = self._job["set_point"] if speed is None or not np.isfinite(speed) else speed
        observation = self._observed(felt, impacts or 0.0, bouncing or 0.0)
        self.lost += int(not usable(observation, self.task)[0])
        actions = checked_actions(self.task, self.policy(observation), 1)
        call(drive, self.task.numbers, actions, MOVES, DEAD_BAND, _FIRST, self._envs.jobs.demand, self._job)
        return self.speed

    def _count_a_step(self) -> None:
        """Count a step, up to the last one of a job."""
        if self._job["done"][0] < self.task.steps - 1:
            self._job["done"] += 1
        else:
            self._job["changed"] -= 1

    def _ask(self, demand: float) -> None:
        """Demand of the coming step."""
        if demand != self.demand:
            self._job["changed"] = self._job["done"]
        self.demand = float(demand)
        self._envs.jobs.demand[:] = demand

    def _within(self, name: str, value: float) -> float:
        low, high = self.task.lowest_speed, self.task.highest_speed
        if not low <= value <= high:
            raise ParameterError(f"{name} = {value!r} is out of range; allowed: {low:g} to {high:g}")
        return float(value)

    def _observed(self, peaks: Array, impacts: float, bouncing: float) -> NDArray[np.float32]:
        """Observation (1, 14) of readings, which have their errors already; not a number where there is none."""
        peaks = _longest_finite(peaks)
        if len(peaks) < FEWEST or not np.isfinite([impacts, bouncing]).all():
            values = self._observed(np.ones(FEWEST), 0.0, 0.0)
            values[:, FIRST_FELT:] = np.nan
            return values
        space, cycles = self._envs.settings.space, len(peaks)
        period = np.array([float(self._envs.nominal.period_at(self.speed))])
        duration = np.full((1, cycles, 1), 0.5 * bouncing * period[0])
        values = np.empty((1, *space.shape), np.float32)
        given = (self.task.numbers, _FIRST, self._envs.jobs.demand, self._job, peaks[None], duration, period)
        drawn = (np.full((1, cycles + 1), 0.5), np.array([impacts * cycles]))
        call(observe, *given, *drawn, space.low, space.high, np.empty((1, cycles)), values)
        return values


def _longest_finite(peaks: Array) -> Array:
    """The longest stretch of finite peaks, since peaks are compared with those of cycles before."""
    bad = np.flatnonzero(~np.isfinite(peaks))
    edges = np.array([-1, *bad, len(peaks)])
    first = int(np.diff(edges).argmax())
    return peaks[edges[first] + 1 : edges[first + 1]]
