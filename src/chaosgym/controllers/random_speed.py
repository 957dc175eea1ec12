"""What does chance achieve? A target drawn anew at every step."""

from typing import Any

import gymnasium as gym
import numpy as np

from chaosgym.controllers.controller import Action, Controller, Observation


class RandomSpeed(Controller):
    """Actions drawn uniformly; the same ``seed``, the same jobs."""

    def __init__(self, env: gym.Env[Any, Any], seed: int = 0) -> None:
        super().__init__(env)
        self._generator = np.random.default_rng(seed)

    def __call__(self, observation: Observation) -> Action:
        """Return the next draw."""
        return self._generator.uniform(-1.0, 1.0, 1).astype(np.float32)
