"""Motors of N jobs, ``drive="motor"``: the agent sets the speed at which a motor gives no torque, the crank follows.

The line of torque over speed shifts in parallel with that set-point, as of a DC motor at part of its voltage:
T = (T_m / w_0) (w_set - w), with its torque at rest T_m and its speed without load w_0 at full voltage.
"""

from typing import Any

import numpy as np

from chaosgym.arrays import Array, Indices
from chaosgym.core.compilation import call
from chaosgym.core.motor import turn_cranks
from chaosgym.envs.task import Task
from chaosgym.errors import ParameterError
from chaosgym.machines.batch import put, stacked


def refuse_drive(task: Task, nominal: Any) -> None:
    """Refuse a motor that the machine does not have, or set-points beyond its speed without load.

    Raises
    ------
    ParameterError
        If so.
    """
    if task.drive != "motor":
        return
    if not nominal.has_motor:
        raise ParameterError(
            f"drive = 'motor' needs a motor, and {nominal.name} has none; allowed: 'constant', or the file of a "
            "mechanism with [motor]: stall_torque, no_load_speed and inertia"
        )
    fastest = nominal.motor_no_load_speed
    if task.highest_speed > fastest:
        raise ParameterError(
            f"highest_speed = {task.highest_speed:g} rpm is beyond the motor's speed without load; allowed: "
            f"highest_speed and highest_demand up to no_load_speed = {fastest:g} rpm"
        )


class Motors:
    """Cranks of ``count`` jobs under their motors, each at a speed of its own.

    Attributes
    ----------
    told : (N, 3)
        Mean speed [rpm], torque [N m] and power [W] of the motor over the last step; of one that stalled, at rest.
    stalled : (N,)
        Whether the crank has stopped.
    """

    def __init__(self, nominal: Any, count: int) -> None:
        self._cranks = stacked([nominal.crank] * count)
        self._rates = np.zeros(count)
        self._rate_at = nominal.rate_at
        self.told, self.stalled = np.zeros((count, 3)), np.zeros(count, np.bool_)

    def start(self, i: int, machine: Any, speed: float) -> None:
        """Let job i begin with a crank that turns at a speed [rpm]."""
        put(self._cranks, i, machine.crank)
        self._rates[i] = self._rate_at(speed)

    def turn(self, which: Indices, set_points: Array, cycles: int, last: int) -> Array:
        """Turn the cranks ``which`` (k,) at set-points (k,) [rpm]; ``last`` cycles are told.

        Returns the mean speed of each cycle (k, cycles) [rpm].
        """
        speeds, told, stalled = (
            np.empty((len(which), cycles)),
            np.empty((len(which), 3)),
            np.empty(len(which), np.bool_),
        )
        call(turn_cranks, self._cranks, which, self._rate_at(set_points), last, self._rates, speeds, told, stalled)
        self.told[which], self.stalled[which] = told, stalled
        return speeds
