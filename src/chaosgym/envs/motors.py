"""Motors of N jobs, ``drive="motor"``: the agent sets the speed at which a motor gives no torque, the crank follows.

The line of torque over speed shifts in parallel with that set-point, as of a DC motor at part of its voltage:
T = (T_m / w_0) (w_set - w), with its torque at rest T_m and its speed without load w_0 at full voltage.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array, Indices
from chaosgym.core.compilation import call
from chaosgym.core.motor import turn_cranks
from chaosgym.envs.kernels.steps import INFO, MOTOR
from chaosgym.envs.task import Task
from chaosgym.errors import ParameterError
from chaosgym.machines.batch import Cycles, put, stacked


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


class ConstantSpeed:
    """Drives of ``count`` jobs that hold the speed they are set to.

    Attributes
    ----------
    info
        Names of the columns of a report that are the info of a step.
    steady
        Whether the speed is the same in all cycles of a step.
    stalled : (N,)
        Whether the crank has stopped.
    """

    info, steady = INFO, True

    def __init__(self, nominal: Any, count: int) -> None:
        self.stalled = np.zeros(count, np.bool_)

    def start(self, which: Indices, machines: Sequence[Any], speeds: Array) -> None:
        """Let the jobs ``which`` (k,) of ``machines`` (N,) begin at ``speeds`` (k,)."""

    def turn(self, which: Indices, set_points: Array, cycles: int, last: int) -> Array:
        """Return the mean speed of each cycle (k, cycles) at set-points (k,); ``last`` cycles are a step."""
        return set_points[:, None].repeat(cycles, axis=1)

    def reached(self, which: Indices, set_points: Array, jobs: NDArray[np.void]) -> Array:
        """Write the speed of the step into ``jobs`` (N,); return that of its period (k,), in the machine's unit."""
        return set_points

    def stop(self, which: Indices, cycles: Cycles, growth: Array) -> None:
        """Count those that stalled as failed, with zeros in ``cycles`` and ``growth``."""

    def report(self, which: Indices, report: NDArray[np.void]) -> None:
        """Write what the drive adds to the ``report`` (k,)."""


class Motors(ConstantSpeed):
    """Cranks of ``count`` jobs under their motors, each at a speed of its own."""

    info, steady = (*INFO, *MOTOR), False

    def __init__(self, nominal: Any, count: int) -> None:
        super().__init__(nominal, count)
        self._cranks = stacked([nominal.crank] * count)
        self._rates = np.zeros(count)
        self._rate_at = nominal.rate_at
        self._step = np.zeros((count, 3))

    def start(self, which: Indices, machines: Sequence[Any], speeds: Array) -> None:
        """Let cranks turn at speeds [rpm]."""
        for i, speed in zip(which.tolist(), speeds.tolist(), strict=True):
            put(self._cranks, i, machines[i].crank)
            self._rates[i] = self._rate_at(speed)

    def turn(self, which: Indices, set_points: Array, cycles: int, last: int) -> Array:
        """Turn the cranks at set-points [rpm]."""
        speeds, step, stalled = (
            np.empty((len(which), cycles)),
            np.empty((len(which), 3)),
            np.empty(len(which), np.bool_),
        )
        call(turn_cranks, self._cranks, which, self._rate_at(set_points), last, self._rates, speeds, step, stalled)
        self._step[which], self.stalled[which] = step, stalled
        return speeds

    def reached(self, which: Indices, set_points: Array, jobs: NDArray[np.void]) -> Array:
        """The mean speed of the step [rpm]; the period of a motor that stalled is that of its set-point."""
        speed = jobs["speed"][which] = self._step[which, 0]
        return np.where(self.stalled[which], set_points, speed)

    def stop(self, which: Indices, cycles: Cycles, growth: Array) -> None:
        """What a stalled machine did counts for nothing."""
        cycles.failed[:] |= self.stalled[which]
        for values in (*cycles[1:], growth):
            values[cycles.failed] = 0

    def report(self, which: Indices, report: NDArray[np.void]) -> None:
        """Mean torque [N m] and power [W] of the motor over the step; of one that stalled, at rest."""
        report["motor_torque"], report["motor_power"] = self._step[which, 1:].T
