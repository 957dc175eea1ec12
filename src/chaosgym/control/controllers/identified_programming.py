"""What is a model worth to one who does not know which machine it is? Identify the machine, then plan with its tables.

Until the record tells which machine within the tolerances it is, the best schedule of the expected map is played, but
for the detours that an experiment asks for. It keeps away from speeds whose experiments have failed, while there are
others to be made. Then the tables of the machine that was found are computed, some seconds for each, and take the place
of the others and of what was felt.
"""

from typing import Any

import gymnasium as gym

from chaosgym.control.controllers.belief_programming import BeliefProgramming
from chaosgym.control.controllers.controller import Action, Observation
from chaosgym.control.identification import Identification
from chaosgym.control.robust_regimes import robust_regimes


class IdentifiedProgramming(BeliefProgramming):
    """Plays the best schedule of the machine that repeats what was observed (certainty equivalence).

    It knows the equations of motion and the tolerances, and believes that both are exact: what it earns is what a
    perfect model is worth.
    """

    knows = "tolerance range"

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        super().__init__(env)
        self._identification = Identification(self.env.pool, self.task)

    def reset(self) -> None:
        """Forget what was felt."""
        super().reset()
        self._identification.start()

    def __call__(self, observation: Observation) -> Action:
        """Look whether the machine is known by now; take the step of an experiment, or that of the largest worth."""
        if machines := self._identification.add(observation):
            self._belief.know_tables(0, robust_regimes(self.env.pool, self.task, machines))
        if self._began:
            self._belief.distrust(0, self._identification.failed)
        planned = super().__call__(observation)
        target = self._identification.target
        return planned if target is None else self.command(target)
