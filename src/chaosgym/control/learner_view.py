"""How does a learner see and move a machine? With a memory of what it felt, or a belief, and in steps of the drive.

A machine is hidden from the agent, but it answers the same way when a speed is tried again. The memory adds, for every
bin of speed, the mean and the standard deviation of the peak forces measured there in this job, and their number. The
belief adds what these say about the machine, among those within the tolerances, and about the speeds in reach.
Increments let an action say by how much the speed shall change instead of where it shall end; with a belief, by how
much it shall differ from the belief's own plan (residual learning: T. Silver et al., arXiv:1812.06298).
"""

from collections.abc import Callable
from typing import Any, Literal, cast, get_args

import gymnasium as gym
import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from chaosgym.control.belief import Plan, SpeedBelief
from chaosgym.control.identification import Identification
from chaosgym.control.machine_search import point_of
from chaosgym.control.robust_regimes import robust_regimes
from chaosgym.envs.observation import FIRST_PEAK, SPEED, Observation
from chaosgym.envs.pools import Pool
from chaosgym.envs.regimes import nearest
from chaosgym.envs.tasks import Task
from chaosgym.errors import ParameterError
from chaosgym.machines.machine import Machine

Array = NDArray[np.float64]
Actions = NDArray[np.float32]
Numbers = NDArray[np.int64]

Memory = Literal["none", "speeds", "belief", "identified"]
"""What a learner is given of the past of a job: nothing, ``SpeedMemory``, ``BeliefMemory`` or ``IdentifiedMemory``."""

BINS = 53
"""Bins over the range of the drive: 0.5 Hz of the beam, 4.8 rpm of the crank, centred on the speeds at both ends."""

WELL_KNOWN = 100.0
"""Peaks after which a bin counts as fully known."""


class SpeedMemory:
    """Peak forces by speed, of n jobs side by side.

    Parameters
    ----------
    space
        Of the observations, d numbers.
    """

    def __init__(self, space: Box) -> None:
        self.space = remembered_space(space)
        self._lowest, self._highest = float(space.low[0]), float(space.high[0])
        # the peaks are those entries that have the range of the force sensor
        cycles = int(np.count_nonzero(space.high[FIRST_PEAK:] == space.high[FIRST_PEAK]))
        self._peaks = slice(FIRST_PEAK, FIRST_PEAK + cycles)
        self._sums = np.zeros((0, 3, BINS))

    def start(self, observations: Observation, excluded: Numbers | None = None) -> Observation:
        """Forget everything and take in the first observations (n, d) of n jobs; return (n, d + 3 BINS).

        ``excluded`` matters to beliefs alone.
        """
        self._sums = np.zeros((len(observations), 3, BINS))
        return self.add(observations)

    def restart(
        self, which: NDArray[np.bool_], observations: Observation, excluded: Numbers | None = None
    ) -> Observation:
        """Forget k of the jobs, ``which`` (n,), and take in their first observations (k, d); return (k, d + 3 BINS)."""
        self._sums[which] = self._news(observations)
        return self._remembered(observations, self._sums[which])

    def add(self, observations: Observation) -> Observation:
        """Take in observations (n, d) and return them with what is remembered, (n, d + 3 BINS)."""
        self._sums += self._news(observations)
        return self._remembered(observations, self._sums)

    def _news(self, observations: Observation) -> Array:
        """Number, sum and sum of squares of the peaks of observations (n, d), each at its bin: (n, 3, BINS)."""
        place = (observations[:, SPEED] - self._lowest) / (self._highest - self._lowest) * (BINS - 1)
        bins, jobs = np.rint(place).astype(np.int64), np.arange(len(observations))
        peaks = observations[:, self._peaks].astype(float)
        news = np.zeros((len(peaks), 3, BINS))
        news[jobs, 0, bins] = peaks.shape[1]
        news[jobs, 1, bins] = peaks.sum(axis=1)
        news[jobs, 2, bins] = (peaks**2).sum(axis=1)
        return news

    def _remembered(self, observations: Observation, sums: Array) -> Observation:
        count, total, squares = sums[:, 0], sums[:, 1], sums[:, 2]
        mean = total / np.maximum(count, 1.0)
        deviation = np.sqrt(np.maximum(squares / np.maximum(count, 1.0) - mean**2, 0.0))
        known = np.minimum(count / WELL_KNOWN, 1.0)
        return np.concatenate([observations, mean, deviation, known], axis=1, dtype=np.float32)


class BeliefMemory:
    """A belief over the map of speeds, of n jobs side by side.

    Attributes
    ----------
    planned : (n, 1)
        Speeds that it goes to next.
    held : (n, 1)
        Whether it goes there whatever the learner says, for an experiment.

    Parameters
    ----------
    space
        Of the observations, d numbers.
    pool
        Of the jobs.
    task
        Of the jobs.
    """

    def __init__(self, space: Box, pool: Pool, task: Task) -> None:
        self._pool, self._belief = pool, SpeedBelief(pool.possible, task)
        low, high = self._belief.feature_bounds
        self.space = Box(
            np.concatenate([space.low, low]).astype(np.float32), np.concatenate([space.high, high]).astype(np.float32)
        )
        self.planned, self.held = np.zeros((0, 1)), np.zeros((0, 1), np.bool_)

    def start(self, observations: Observation, excluded: Numbers | None = None) -> Observation:
        """Forget everything and take in the first observations (n, d) of n jobs; return (n, d + features).

        ``excluded`` (n,) are the machines of the training pool that they are, if they are: they would be found too
        easily among their own tables.
        """
        self.planned, self.held = np.zeros((len(observations), 1)), np.zeros((len(observations), 1), np.bool_)
        return self._told(self._belief.start(observations, excluded), observations, np.arange(len(observations)))

    def restart(
        self, which: NDArray[np.bool_], observations: Observation, excluded: Numbers | None = None
    ) -> Observation:
        """Forget k of the jobs, ``which`` (n,), and take in their first observations (k, d); return (k, d + features).

        ``excluded`` (k,) as in ``start``.
        """
        plan = self._belief.restart(which, observations, excluded)
        return self._told(plan, observations, np.flatnonzero(which))

    def add(self, observations: Observation) -> Observation:
        """Take in observations (n, d) and return them with what is believed, (n, d + features)."""
        return self._told(self._belief.add(observations), observations, np.arange(len(observations)))

    def settling(self, speeds: Array) -> Array:
        """Return speeds (...) that a learner can keep exactly, so that the motion can settle: the nearest of the map.

        Where the clearance grows no motion settles, and the speeds stay as they are.
        """
        known = self._belief.speeds
        return speeds if self._pool.wears else np.asarray(known[nearest(known, speeds)])

    def _told(self, plan: Plan, observations: Observation, jobs: Numbers) -> Observation:
        self.planned[jobs, 0], self.held[jobs] = self._belief.speeds[plan.target], False
        return np.concatenate([observations, self._belief.features(plan)], axis=1, dtype=np.float32)


class IdentifiedMemory(BeliefMemory):
    """A belief that becomes certain as soon as the machine is identified, of n jobs side by side.

    Its tables are computed then, which takes seconds to minutes. A machine of the training pool is known as soon as
    there is a record to look for it by, without a search.

    Parameters
    ----------
    space, pool, task
        As in ``BeliefMemory``.
    """

    def __init__(self, space: Box, pool: Pool, task: Task) -> None:
        super().__init__(space, pool, task)
        self._task = task

    def start(self, observations: Observation, excluded: Numbers | None = None) -> Observation:
        """Forget everything and take in the first observations (n, d) of n jobs; return (n, d + features)."""
        self._number = np.full(len(observations), -1) if excluded is None else excluded.copy()
        self._looking = [
            self._identification(number, first)
            for number, first in zip(self._number.tolist(), observations, strict=True)
        ]
        return super().start(observations, excluded)

    def restart(
        self, which: NDArray[np.bool_], observations: Observation, excluded: Numbers | None = None
    ) -> Observation:
        """Forget k of the jobs, ``which`` (n,), and take in their first observations (k, d), as in ``start``."""
        self._number[which] = -1 if excluded is None else excluded
        for job, observation in zip(np.flatnonzero(which).tolist(), observations, strict=True):
            self._looking[job] = self._identification(int(self._number[job]), observation)
        return super().restart(which, observations, excluded)

    def add(self, observations: Observation) -> Observation:
        """Take in observations (n, d) and return them with what is believed, (n, d + features)."""
        for job, (identification, observation) in enumerate(zip(self._looking, observations, strict=True)):
            if machines := identification.add(observation):
                self._know(job, machines)
            self._belief.distrust(job, identification.failed)
        told = super().add(observations)
        targets = [identification.target for identification in self._looking]
        for job, target in enumerate(targets):
            if target is not None:
                self.planned[job], self.held[job] = target, True
        return told

    def _identification(self, number: int, observation: Observation) -> Identification:
        """Begin to look for a machine, which is found by its first record if its number in the pool is not -1."""
        truth = None if number < 0 else point_of(self._pool, number)
        identification = Identification(self._pool, self._task, truth)
        identification.add(observation)
        return identification

    def _know(self, job: int, machines: list[Machine]) -> None:
        """Trust the tables of a machine of the pool, or of the one that was found."""
        if self._number[job] >= 0:
            self._belief.know(job, int(self._number[job]))
        else:
            self._belief.know_tables(job, robust_regimes(self._pool, self._task, machines))


def remembered_space(space: Box) -> Box:
    """Return the space of observations with memory, of the space of those without."""
    ranges = np.repeat([space.high[FIRST_PEAK], space.high[FIRST_PEAK], 1.0], BINS)
    return Box(
        np.concatenate([space.low, np.zeros(3 * BINS)]).astype(np.float32),
        np.concatenate([space.high, ranges]).astype(np.float32),
    )


def commanded(
    answers: Actions,
    observations: Observation,
    memory: SpeedMemory | BeliefMemory | None,
    space: Box,
    largest: float | None,
) -> Actions:
    """Return the actions (n, 1) of an environment that a learner's answers (n, 1) stand for.

    An increment changes the observed speed, or with a belief the planned one, to a speed at which the motion can
    settle. An experiment goes to the planned speed, whatever the answer is.

    Parameters
    ----------
    answers
        Target speeds or increments, each from -1 to 1.
    observations
        The last ones, (n, d), without memory.
    memory
        That has taken them in.
    space
        Of the observations.
    largest
        Change of speed for an increment of 1, in the machine's unit; None for target speeds.
    """

    def action_for(target: Array) -> Actions:
        low, high = space.low[0], space.high[0]
        return np.asarray(np.clip(2.0 * (target - low) / (high - low) - 1.0, -1.0, 1.0), np.float32)

    change = None if largest is None else largest * np.clip(answers, -1.0, 1.0)
    if isinstance(memory, BeliefMemory):
        asked = answers if change is None else action_for(memory.settling(memory.planned + change))
        return np.where(memory.held, action_for(memory.planned), asked)
    return answers if change is None else action_for(observations[:, SPEED, None].astype(float) + change)


def memory_of(space: Box, attribute: Callable[[str], Any], memory: Memory) -> SpeedMemory | BeliefMemory | None:
    """Return what a view remembers with; ``attribute`` gives those of the environment by name.

    Raises
    ------
    ParameterError
        If there is no such memory.
    """
    if memory not in get_args(Memory):
        raise ParameterError(f"memory = {memory!r} is not one of {', '.join(get_args(Memory))}")
    if memory in ("belief", "identified"):
        kind = BeliefMemory if memory == "belief" else IdentifiedMemory
        return kind(space, attribute("pool"), attribute("task"))
    return SpeedMemory(space) if memory == "speeds" else None


class LearnerView(gym.Wrapper[Observation, Actions, Observation, Actions]):
    """One environment with a memory, moved by increments: for instance as ``env_wrapper`` of rl-zoo.

    Parameters
    ----------
    env
        A chaosgym environment.
    memory
        Of the job.
    increments
        Whether actions are changes of speed; target speeds otherwise.

    Raises
    ------
    ParameterError
        If there is no such memory.
    """

    def __init__(self, env: gym.Env[Observation, Actions], memory: Memory = "belief", increments: bool = True) -> None:
        super().__init__(env)
        self._space = cast(Box, env.observation_space)
        self._memory = memory_of(self._space, env.get_wrapper_attr, memory)
        self._largest = env.get_wrapper_attr("drive").slew_limit if increments else None
        if self._memory:
            self.observation_space = cast(Space[Observation], self._memory.space)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start a job, with nothing remembered."""
        self._last, info = self.env.reset(seed=seed, options=options)
        learns = self.env.get_wrapper_attr("pool").name == "training"
        excluded = np.array([info["machine"]]) if learns else None
        return self._memory.start(self._last[None], excluded)[0] if self._memory else self._last, info

    def step(self, action: Actions) -> tuple[Observation, Any, bool, bool, dict[str, Any]]:
        """Run a step and remember it."""
        action = commanded(action[None], self._last[None], self._memory, self._space, self._largest)[0]
        self._last, reward, terminated, truncated, info = self.env.step(action)
        seen = self._memory.add(self._last[None])[0] if self._memory else self._last
        return seen, reward, terminated, truncated, info
