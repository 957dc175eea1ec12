"""A policy at a machine that is not simulated here: peaks of a step in, the next speed out.

The machine may be a rig, or another program. ``Operator`` holds no motion: it makes the observation that the
environment would make of the same readings, asks the policy, and lets the drive of the task follow the answer. It
guards a trained policy, and no policy stays at a speed that wears the joint four times as fast as the demand.
"""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.arrays import Array
from chaosgym.control.controllers import Controller
from chaosgym.control.controllers.controller import EXCESS, place_of
from chaosgym.control.evaluation import policy_of
from chaosgym.control.guard import GuardedPolicy, guarded
from chaosgym.control.policies.learned_map import LearnedMap
from chaosgym.control.readings import FIRST_FELT, usable
from chaosgym.core.compilation import call
from chaosgym.envs.drive import BACK, DEAD_BAND, MOVES, checked_actions
from chaosgym.envs.kernels.steps import drive, observe
from chaosgym.envs.observation import OBSERVATION_NAMES
from chaosgym.envs.vector_env import native_envs
from chaosgym.errors import ModelFileError, ParameterError
from chaosgym.files import contents, unpacked, write_atomically
from chaosgym.numbers import number
from chaosgym.plants.plant import FEWEST, longest_finite
from chaosgym.rating_life import LIFE_EXPONENT

LARGEST_MEMORY = 1_000_000
"""Bytes of a file of what was felt."""

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
    guard
        Whether a trained policy that knows what was usual in training is guarded: on a machine that is foreign to it
        the shipped map of the fleet plays, or the demand is followed. Of one that does not know that is warned.
    memory
        File of what a learned map felt in earlier jobs of this very machine: each start goes on from it, once ``keep``
        has written it. Delete it when the machine was changed or has worn.
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
        If a keyword is out of range, or the policy keeps no memory from job to job.

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

    def __init__(
        self,
        policy: Any,
        env: str = "chaosgym/ImpactBeamTolerance-v1",
        *,
        guard: bool = True,
        memory: str | Path | None = None,
        **keywords: Any,
    ) -> None:
        played = policy_of(policy)
        self.policy = guarded(played) if guard else played
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
        self._memory = None if memory is None else Path(memory)
        if memory is not None and not isinstance(self._inner, LearnedMap):
            raise ParameterError(
                f"memory = {str(memory)!r}: {type(self._inner).__name__} keeps no memory from job to job; allowed: a "
                "learned map"
            )
        self.demand, self.lost = float("nan"), 0

    @property
    def _inner(self) -> Any:
        """The policy, without its guard."""
        return self.policy.policy if isinstance(self.policy, GuardedPolicy) else self.policy

    def keep(self) -> None:
        """Write what was felt in the jobs of this machine into the file ``memory``, if there is one.

        Raises
        ------
        ParameterError
            Before ``start``.
        """
        if self._memory is None:
            return
        if np.isnan(self.demand):
            raise ParameterError("nothing was felt yet; call start(speed=..., demand=...) first")
        buffer = BytesIO()
        np.savez(buffer, felt=self._inner.memory, mean=self._inner.mean)
        write_atomically(self._memory, lambda path: path.write_bytes(buffer.getvalue()))

    def _recall(self) -> None:
        """Go on from what was felt in earlier jobs."""
        if self._memory is None or not self._memory.exists():
            return
        try:
            arrays = unpacked(contents(self._memory, LARGEST_MEMORY), LARGEST_MEMORY)
            felt, mean = arrays["felt"], arrays["mean"]
        except (ValueError, KeyError) as error:
            raise ModelFileError(f"{self._memory} can't be read as a memory: {error}") from None
        if not np.array_equal(mean, self._inner.mean):
            raise ModelFileError(f"{self._memory} is a memory of another policy; give another file")
        self._inner.memory = felt

    @property
    def foreign(self) -> bool | None:
        """Whether the machine is foreign to a guarded policy; None without a guard."""
        return not bool(self.policy.trusted[0]) if isinstance(self.policy, GuardedPolicy) else None

    @property
    def statement(self) -> str:
        """What the guard did on a machine that is foreign to its policy; "" on another one, and without a guard."""
        return self.policy.statement() if isinstance(self.policy, GuardedPolicy) else ""

    @property
    def unit(self) -> str:
        """Unit of speeds and demands."""
        return self._envs.settings.unit

    @property
    def speed(self) -> float:
        """Speed that the machine is to run at, in the unit of the machine's speed field."""
        return float(self._job["set_point"][0])

    def start(self, *, speed: float, demand: float) -> float:
        """Begin at a speed, with a demand, and drop earlier measurements but those of the file ``memory``.

        The first ``next`` gives the measurements at this speed.

        Raises
        ------
        ParameterError
            If the speed or the demand lies outside the range of the drive.
        ModelFileError
            If the policy is of another machine, or the memory of another policy.
        """
        job = np.zeros(1, self._job.dtype)
        job["speed"] = job["set_point"] = self._within("speed", speed)
        job["done"] = BEFORE_THE_FIRST
        demand = self._within("demand", demand)
        self._job[:], self.lost = job, 0
        self._load = np.full(len(self.task.grid), np.nan)
        self._ask(demand)
        self._job["changed"] = 0
        self.policy.start(self._envs)
        self._recall()
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
        looks = isinstance(self._inner, LearnedMap) or not isinstance(self._inner, Controller)
        if looks and (impacts is None or bouncing is None):
            raise ParameterError("a trained policy looks at impacts and bouncing too; give both, or use Kriging()")
        for name, value, high in (("impacts", impacts, np.inf), ("bouncing", bouncing, 1.0)):
            if value is not None and np.isfinite(value):  # else a step without a reading
                number(name, value, 0.0, high)
        if demand is not None:
            self._within("demand", demand)
        self._count_a_step()
        self._ask(self.demand if demand is None else demand)
        self._job["speed"] = self._job["set_point"] if speed is None or not np.isfinite(speed) else speed
        observation = self._observed(felt, impacts or 0.0, bouncing or 0.0)
        self.lost += int(not usable(observation, self.task)[0])
        self._feel(felt)
        actions = checked_actions(self.task, self.policy(observation), 1)
        trial = self._job.copy()
        self._drive(actions, trial)
        if self._wears(float(trial["speed"][0])):
            actions = self._back
        self._drive(actions, self._job)
        return self.speed

    def _drive(self, actions: Array, job: Any) -> None:
        """Let the drive follow checked actions."""
        call(drive, self.task.numbers, actions, MOVES, DEAD_BAND, _FIRST, self._envs.jobs.demand, job)

    @property
    def _back(self) -> Array:
        """Action that goes to the demand."""
        action = {"trim": [float(BACK)], "continuous": [0.0, 1.0], "speed": [self.demand]}[self.task.action]
        return np.array([action])

    def _feel(self, peaks: Array) -> None:
        """Keep the load at the speed of the step: the constant force that wears as much as its peaks."""
        finite = peaks[np.isfinite(peaks)]
        if len(finite):
            scale = max(float(finite.max()), 1e-300)
            load = scale * float(np.mean((finite / scale) ** LIFE_EXPONENT)) ** (1.0 / LIFE_EXPONENT)
            self._load[place_of(self._job["speed"], self.task)] = load

    def _wears(self, speed: float) -> bool:
        """Whether the load at a speed was ``EXCESS`` times that at the demand, each when last felt."""
        to, at = (self._load[int(place_of(np.array([each]), self.task)[0])] for each in (speed, self.demand))
        return self.task.damage_weight > 0.0 and bool(to > EXCESS * at)

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
        return number(name, value, self.task.lowest_speed, self.task.highest_speed)

    def _observed(self, peaks: Array, impacts: float, bouncing: float) -> NDArray[np.float32]:
        """Observation (1, 14) of readings, which have their errors already; not a number where there is none."""
        peaks = longest_finite(peaks)
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
