"""Does any loophole pay? Each is played on the machines of an evaluation, beside following the demand.

Standing off, dithering, jitter around the demand, and backing to the demand at every step; control of chaos is among
the contenders of ``chaosgym compare``.
"""

from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.control.controllers import Controller, Follow
from chaosgym.control.controllers.controller import Observations, seen
from chaosgym.control.rollout import play


class StandOff(Controller):
    """Stays at one speed, whatever is demanded: the lowest one that a drive has."""

    def speeds(self, observations: Observations) -> Array:
        """The lowest speed."""
        return np.full(self.count, self.task.lowest_speed)


class Dither(Controller):
    """Changes sides of the demand by some trim steps at every step, so that no motion settles.

    Parameters
    ----------
    size
        In trim steps.
    """

    def __init__(self, size: int) -> None:
        super().__init__()
        self.size = size

    def begin(self, envs: Any) -> None:
        """Start above the demand."""
        self._sign = 1.0

    def speeds(self, observations: Observations) -> Array:
        """The demand, and the size to the other side."""
        self._sign = -self._sign
        return np.asarray(seen(observations, "demand") + self._sign * self.size * self.task.trim_step)


def audit(env: str, machines: int = 64) -> dict[str, dict[str, float]]:
    """Mean return, share of Type III and deviation of each loophole, by name."""
    players = {
        "follow the demand": Follow(),
        "stand off": StandOff(),
        "dither by 1": Dither(1),
        "dither by 4": Dither(4),
    }
    found = {}
    for name, player in players.items():
        played = play(player, env, range(machines), progress=name)
        found[name] = {
            "return": float(played.returns.mean()),
            "type_iii": float(played.type_iii_share.mean()),
            "deviation": float(played.deviation.mean()),
            "best_step": float(np.nanmax(played.reward)),
        }
    return found
