"""A guard for trained policies: where a machine's readings were unlikely in training, it asks the policy no more.

A trained policy knows what is usual at each speed: mean and deviation of its readings over the machines of training.
The guard takes the mean square of the readings of a settled step in these units, and its mean over the last steps of
the job. On a machine of training that is about 1. Above ``UNLIKELY`` the policy is not asked again in this job. Until
the first settled step, which is one at the demand, it is not asked either.

Who plays then is the shipped map of the machine's fleet, which met more machines, behind a guard of its own. Where that
finds the machine foreign too, or there is none, the demand is followed.
"""

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.control.controllers.controller import Controller, Observations, seen
from chaosgym.control.policies.learned_map import LearnedMap
from chaosgym.control.policies.policy import TrainedPolicy
from chaosgym.control.policies.shipped import map_of_the_fleet
from chaosgym.control.rollout import Policy
from chaosgym.envs.drive import BACK, MOVES
from chaosgym.errors import ParameterError

UNLIKELY = 2.0
"""Mean square of the readings, in deviations of training, above which a machine is foreign to a policy.

Calibrated on machines of training, which no table of the documentation plays; ``python -m benchmarks mismatch`` prints
the share of machines that were foreign, on those of training too.
"""

LEAST_GAIN = 0.3
"""Expected gain of a step for which the map of the fleet leaves the demand of a machine that is foreign to the policy.

Where nothing can be won it must not lose: chosen among 0, 0.1, 0.2 and 0.3 on 64 beams with twice the structural
damping and 10 % less force, which no table of the documentation plays. It was the one that lost on none of them.
"""

MEMORY = 10
"""Settled steps that the mean is over."""


def can_guard(policy: Any) -> bool:
    """Whether a policy sets speeds or trims, and knows what was usual in training."""
    of_speeds = isinstance(policy, Controller) or policy.keywords.get("action") == "trim"
    return of_speeds and hasattr(policy, "unusual") and getattr(policy, "usual", True) is not None


def guarded(policy: Policy) -> Policy:
    """The policy behind a guard, or as it is where it can't be guarded: of a trained one that is warned of."""
    if can_guard(policy):
        return GuardedPolicy(policy)
    if isinstance(policy, TrainedPolicy):
        warnings.warn(
            "this policy does not know what was usual in training, so it can't be guarded and does not tell whether a "
            "machine is foreign to it",
            stacklevel=3,
        )
    return policy


class GuardedPolicy(Controller):
    """Asks a trained policy while the machine is like those of its training, and plays safer after that.

    Parameters
    ----------
    policy
        A learned map, or a trained policy of trims with a memory of speeds.
    unlikely
        As ``UNLIKELY``.
    fleet
        Whether the shipped map of the machine's fleet plays where the policy is not asked, while the machine is like
        those of the fleet; else the demand is followed.

    Attributes
    ----------
    trusted : (n,)
        Whether the policy is still asked, of each job.
    followed : (n,)
        Whether the demand is followed instead, of each job, and no map of a fleet asked.

    Raises
    ------
    ParameterError
        If the policy does not know what is usual at each speed.

    Examples
    --------
    >>> from chaosgym.control.guard import GuardedPolicy
    >>> from chaosgym.control.policies import shipped_policy
    >>> from chaosgym.control.rollout import play
    >>> beam = "chaosgym/ImpactBeamTolerance-v1"
    >>> guard = GuardedPolicy(shipped_policy(beam))
    >>> played = play(guard, beam, [3], steps=8, contact_stiffness=0.75e7)
    >>> guard.trusted
    array([False])
    """

    knows = "measurements"

    def __init__(self, policy: Policy, *, unlikely: float = UNLIKELY, fleet: bool = True) -> None:
        super().__init__()
        self.policy: Any = policy
        self.unlikely, self._fleet = unlikely, fleet
        self._wider: GuardedPolicy | None = None
        if not can_guard(policy):
            raise ParameterError(
                f"{type(policy).__name__} can't be guarded; allowed: a learned map, or a trained policy of trims with "
                "a memory, which know what is usual"
            )

    @property
    def keywords(self) -> dict[str, Any]:
        """Of the environment: that of a controller, and what the policy observes."""
        return {**self.policy.keywords, **super().keywords}

    def begin(self, envs: Any) -> None:
        """Begin with trust in the policy, and no reading."""
        if isinstance(self.policy, Controller):
            self.policy.start(envs)
        else:
            if hasattr(envs, "nominal"):  # a plant has no model that could be compared
                self.policy.check_machine(envs)
            self.policy.begin(self.task, self.count)
        self._wider = _wider(self.policy, envs) if self._fleet else None
        if self._wider is not None:
            self._wider.start(envs)
        self.trusted = np.ones(self.count, np.bool_)
        self._settled, self._miss = np.zeros((2, self.count))
        self._last = np.full(self.count, np.nan)

    @property
    def followed(self) -> NDArray[np.bool_]:
        """Whether neither the policy nor the map of the fleet is asked any more, of each job."""
        return np.asarray(~self.trusted & (True if self._wider is None else ~self._wider.trusted))

    def statement(self, job: int = 0) -> str:
        """What a guard that found the machine of a job foreign did; "" if it did not."""
        did = "followed the demand" if self.followed[job] else "asked the shipped map of the fleet"
        return "" if self.trusted[job] else f"this machine is foreign to the policy, so its guard {did}"

    def speeds(self, observations: Observations) -> Array:
        """The policy's speed, that of the map of the fleet, or the demand."""
        demand, speed = seen(observations, "demand"), seen(observations, "speed")
        settled = np.abs(speed - self._last) < 0.3 * self.task.trim_step
        self._last = speed
        self._settled += settled
        weight = np.where(settled, np.maximum(1.0 / np.maximum(self._settled, 1.0), 1.0 / MEMORY), 0.0)
        self._miss += weight * ((self.policy.unusual(observations) ** 2).mean(axis=1) - self._miss)
        self.trusted &= self._miss <= self.unlikely
        asked = self._asked(observations, demand)
        safer = demand if self._wider is None else self._wider.speeds(observations)
        return np.where(self._settled > 0.0, np.where(self.trusted, asked, safer), demand)

    def _asked(self, observations: Observations, demand: Array) -> Array:
        """Speeds that the policy asks for, within the band that the task allows."""
        band = self.task.largest_trim
        if isinstance(self.policy, Controller):
            return demand + np.clip(self.policy.speeds(observations) - demand, -band, band)
        actions = np.asarray(self.policy(observations))
        move = MOVES[np.minimum(actions, BACK - 1)] * self.task.trim_step
        wanted = np.clip(seen(observations, "trim") + move, -band, band)
        return demand + np.where(actions == BACK, 0.0, wanted)


def _wider(policy: Any, envs: Any) -> GuardedPolicy | None:
    """Map of the fleet of the machine that a policy knows, guarded, if it is another one and fits the task."""
    found = map_of_the_fleet(policy.machine) if hasattr(envs, "nominal") else None
    if found is None or len(found.mean) != len(envs.task.grid):
        return None
    itself = isinstance(policy, LearnedMap) and np.array_equal(policy.mean, found.mean)
    return None if itself else GuardedPolicy(replace(found, least_gain=LEAST_GAIN, wary=False), fleet=False)
