"""What can be planned on a machine that is not known, from the tolerance range and what was felt? The expected map."""

from typing import Any

import gymnasium as gym
import numpy as np

from chaosgym.control.belief import SpeedBelief
from chaosgym.control.controllers.controller import Action, Controller, Observation


class BeliefProgramming(Controller):
    """Plays the best schedule of the map that it expects, and learns the map as it goes (QMDP).

    M. L. Littman, A. R. Cassandra and L. P. Kaelbling, Learning policies for partially observable environments:
    scaling up, ICML 1995.
    """

    knows = "tolerance range"

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        super().__init__(env)
        self._belief = SpeedBelief(self.env.pool.possible, self.task)
        self._itself = self.env.pool.name == "training"

    def reset(self) -> None:
        """Forget what was felt."""
        self._began = False

    def __call__(self, observation: Observation) -> Action:
        """Take the step with the largest expected worth."""
        if self._began:
            plan = self._belief.add(observation[None])
        else:
            # among its own tables a training machine would be found too easily
            excluded = np.array([self.env.machine_number]) if self._itself else None
            plan = self._belief.start(observation[None], excluded)
            self._began = True
        return self.command(float(self._belief.speeds[plan.target[0]]))
