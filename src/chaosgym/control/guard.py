"""A guard for any policy: it runs at the demand first, and replaces a policy that was wrong in this job.

Under each demand the guard goes to the demand. Where that is calm it stays. Where the peaks do not repeat for
``patience`` steps it lets the policy set the speed, within the band of trims that the task allows. If what the policy
finds is irregular too for ``strikes`` steps under this demand, backing off takes over, and does so at once under the
demands to come. So a policy that fits the machine saves the search, and one that does not costs a few steps of a job.
On beams it was nowhere worse than backing off with certainty, on some cranks it was (docs/controllers.md).
"""

from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.control.controllers import BackOff
from chaosgym.control.controllers.controller import THRESHOLD, Controller, Observations, irregular, seen
from chaosgym.control.rollout import Policy
from chaosgym.envs.drive import BACK, MOVES
from chaosgym.errors import ParameterError


class GuardedPolicy(Controller):
    """Asks a policy where the demand is irregular, and backs off where the policy is contradicted.

    Parameters
    ----------
    policy
        Trained policy of trims, or a controller.
    patience
        Irregular steps at the demand before the policy is asked; as of backing off.
    strikes
        Irregular steps under the policy before backing off takes over (calibrated, on beams of no evaluation).

    Examples
    --------
    >>> from chaosgym.control.guard import GuardedPolicy
    >>> from chaosgym.control.policies import shipped_policy
    >>> from chaosgym.control.rollout import play
    >>> beam = "chaosgym/ImpactBeamTolerance-v1"
    >>> played = play(GuardedPolicy(shipped_policy(beam)), beam, [3], steps=8)
    >>> played.speed.shape
    (8, 1)
    """

    knows = "measurements"

    def __init__(self, policy: Policy, *, patience: int = 2, strikes: int = 3) -> None:
        super().__init__()
        self.policy, self.patience, self.strikes = policy, patience, strikes
        self._back_off = BackOff(patience=patience)

    @property
    def keywords(self) -> dict[str, Any]:
        """Of the environment: that of a controller, and what the policy observes."""
        return getattr(self.policy, "keywords", {}) | super().keywords

    def begin(self, envs: Any) -> None:
        """Begin with the policy.

        Raises
        ------
        ParameterError
            If irregular motion costs nothing: then the guard has nothing to go by.
        """
        if self.task.type_iii_weight == 0.0:
            raise ParameterError("a guard goes by irregular motion; allowed: type_iii_weight above 0")
        begin: Any = getattr(self.policy, "begin", None)
        if isinstance(self.policy, Controller):
            self.policy.start(envs)
        elif begin is None or self.policy.keywords.get("action") != "trim":
            raise ParameterError(
                f"{type(self.policy).__name__} can't be guarded; allowed: a controller, or a trained policy of trims"
            )
        else:
            begin(self.task, self.count)
        self._back_off.start(envs)
        self.trusted, self._asked = np.ones(self.count, np.bool_), np.zeros(self.count, np.bool_)
        self._wild, self._demand = np.zeros(self.count, int), np.full(self.count, np.nan)

    def speeds(self, observations: Observations) -> Array:
        """The demand, the policy's speed, or that of backing off."""
        demand, trim = seen(observations, "demand"), seen(observations, "trim")
        wild = irregular(observations, self.task, THRESHOLD, 1e-3) > 0.5
        backed = self._back_off.speeds(observations)
        band = self.task.largest_trim
        if isinstance(self.policy, Controller):
            wanted = np.clip(self.policy.speeds(observations) - demand, -band, band)
        else:
            wanted = self._trims(np.asarray(self.policy(observations)), trim)
        new = demand != self._demand
        at_demand = np.abs(seen(observations, "offset")) < 0.01 * self.task.trim_step
        self._demand = demand
        self._asked &= ~new
        self._wild = np.where(new, 0, self._wild + (wild & (self._asked | at_demand)))
        self.trusted &= ~(self._asked & (self._wild >= self.strikes))
        asks = ~self._asked & ~new & (self._wild >= self.patience)
        self._wild[asks] = 0
        self._asked |= asks
        return np.where(self.trusted, np.where(self._asked, demand + wanted, demand), backed)

    def _trims(self, actions: Any, trim: Array) -> Array:
        """Trims that the policy's actions ask for, within the band that the task allows."""
        move = MOVES[np.minimum(actions, BACK - 1)] * self.task.trim_step
        wanted = np.clip(trim + move, -self.task.largest_trim, self.task.largest_trim)
        return np.where(actions == BACK, 0.0, wanted)
