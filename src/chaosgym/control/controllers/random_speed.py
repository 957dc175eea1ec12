"""What does chance achieve? A target drawn anew at every step."""

from typing import Any

import gymnasium as gym
import numpy as np

from chaosgym.control.controllers.controller import Action, Controller, Observation


class RandomSpeed(Controller):
    """Actions drawn uniformly; the same ``seed`` and the same job, the same draws, whatever was run before."""

    def __init__(self, env: gym.Env[Any, Any], seed: int = 0) -> None:
        super().__init__(env)
        self._seed = seed
        self.reset()

    def reset(self) -> None:
        """Begin draws that belong to the job: to the state of the environment's own generator."""
        super().reset()
        job = self.env.np_random.bit_generator.state["state"]["state"]
        self._generator = np.random.default_rng([self._seed, job])

    def __call__(self, observation: Observation) -> Action:
        """Return the next draw."""
        return self._generator.uniform(-1.0, 1.0, 1).astype(np.float32)
