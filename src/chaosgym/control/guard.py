"""A guard for trained policies: on a machine whose readings were unlikely in training, it follows the demand.

A trained policy knows what is usual at each speed: mean and deviation of its readings over the machines of training.
The guard takes the mean square of the readings of a settled step in these units, and its mean over the last steps of
the job. On a machine of training that is about 1. Above ``UNLIKELY`` the policy is not asked again in this job. Until
the first settled step, which is one at the demand, it is not asked either.
"""

from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.control.controllers.controller import Controller, Observations, seen
from chaosgym.control.rollout import Policy
from chaosgym.envs.drive import BACK, MOVES
from chaosgym.errors import ParameterError

UNLIKELY = 2.0
"""Mean square of the readings, in deviations of training, above which a machine is foreign to a policy.

Calibrated on machines of training, which no table of the documentation plays; ``python -m benchmarks mismatch`` prints
the share of machines that were foreign, on those of training too.
"""

MEMORY = 10
"""Settled steps that the mean is over."""


def can_guard(policy: Any) -> bool:
    """Whether a policy sets speeds or trims, and knows what was usual in training."""
    of_speeds = isinstance(policy, Controller) or policy.keywords.get("action") == "trim"
    return of_speeds and hasattr(policy, "unusual") and getattr(policy, "usual", True) is not None


class GuardedPolicy(Controller):
    """Asks a trained policy while the machine is like those of its training, and follows the demand after that.

    Parameters
    ----------
    policy
        A learned map, or a trained policy of trims with a memory of speeds.
    unlikely
        As ``UNLIKELY``.

    Attributes
    ----------
    trusted : (n,)
        Whether the policy is still asked, of each job.

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

    def __init__(self, policy: Policy, *, unlikely: float = UNLIKELY) -> None:
        super().__init__()
        self.policy: Any = policy
        self.unlikely = unlikely
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
            self.policy.begin(self.task, self.count)
        self.trusted = np.ones(self.count, np.bool_)
        self._settled, self._miss = np.zeros((2, self.count))
        self._last = np.full(self.count, np.nan)

    def speeds(self, observations: Observations) -> Array:
        """The policy's speed, or the demand."""
        demand, speed = seen(observations, "demand"), seen(observations, "speed")
        settled = np.abs(speed - self._last) < 0.3 * self.task.trim_step
        self._last = speed
        self._settled += settled
        weight = np.where(settled, np.maximum(1.0 / np.maximum(self._settled, 1.0), 1.0 / MEMORY), 0.0)
        self._miss += weight * ((self.policy.unusual(observations) ** 2).mean(axis=1) - self._miss)
        self.trusted &= self._miss <= self.unlikely
        asked = self._asked(observations, demand)
        return np.where(self.trusted & (self._settled > 0.0), asked, demand)

    def _asked(self, observations: Observations, demand: Array) -> Array:
        """Speeds that the policy asks for, within the band that the task allows."""
        band = self.task.largest_trim
        if isinstance(self.policy, Controller):
            return demand + np.clip(self.policy.speeds(observations) - demand, -band, band)
        actions = np.asarray(self.policy(observations))
        move = MOVES[np.minimum(actions, BACK - 1)] * self.task.trim_step
        wanted = np.clip(seen(observations, "trim") + move, -band, band)
        return demand + np.where(actions == BACK, 0.0, wanted)
