"""What does the force sensor alone achieve? A PI controller that holds the measured peak force at a set point."""

from typing import Any

import gymnasium as gym
import numpy as np

from chaosgym.control.controllers.controller import Action, Controller, Observation
from chaosgym.envs.drive import checked_number

SET_POINT = 0.78
"""Set point as a share of the force limit: the best of 5 from 0.55 to 0.86 on 6 training beams."""

PROPORTIONAL, INTEGRAL = 0.01, 0.06
"""Slew limits by which the speed changes for an error of 1 N: at once, and again in each step. 0.06 is the best of 4
from 0.01 to 0.2 on the same beams."""


class ForceFeedback(Controller):
    """Goes faster while the largest peak of a step is below the set point, slower while it is above.

    Parameters
    ----------
    env
        Environment of one machine.
    set_point
        Peak force to hold [N].
    proportional, integral
        Gains in slew limits per newton; see the module's defaults.

    Raises
    ------
    ParameterError
        If a value is out of range.
    """

    knows = "measurements"

    def __init__(
        self,
        env: gym.Env[Any, Any],
        *,
        set_point: float | None = None,
        proportional: float = PROPORTIONAL,
        integral: float = INTEGRAL,
    ) -> None:
        super().__init__(env)
        force = SET_POINT * self.task.force_limit if set_point is None else set_point
        self.set_point = checked_number("set_point", force, 0.0, 1e9)
        self.proportional = checked_number("proportional", proportional, 0.0, 1e3)
        self.integral = checked_number("integral", integral, 0.0, 1e3)

    def reset(self) -> None:
        """Forget the last job."""
        self._sum = self.env.speed

    def __call__(self, observation: Observation) -> Action:
        """Return the speed that the two terms ask for."""
        error = self.set_point - self.seen(observation, "max_peak_force")
        slew = self.drive.slew_limit
        self._sum = float(np.clip(self._sum + self.integral * slew * error, *self._range()))
        return self.command(self._sum + self.proportional * slew * error)

    def _range(self) -> tuple[float, float]:
        return self.drive.lowest_speed, self.drive.highest_speed
