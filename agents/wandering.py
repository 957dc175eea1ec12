"""What is done without any knowledge? A new random speed now and then, whatever is observed."""

from collections.abc import Callable
from typing import Any

import numpy as np

MEAN_STAY = 20
"""Steps for which a speed is kept on average."""


def wandering(seed: int) -> Callable[[Any], Any]:
    """Policy that asks for speeds drawn from the whole range, each kept for 20 steps on average."""
    generator = np.random.default_rng(seed)
    action = generator.uniform(-1.0, 1.0, 1).astype(np.float32)

    def act(observation: Any) -> Any:
        if generator.random() < 1.0 / MEAN_STAY:
            action[:] = generator.uniform(-1.0, 1.0)
        return action.copy()

    return act
