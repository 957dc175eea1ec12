"""How good is one speed for the whole job? The lowest, the highest, the safest over a pool, and this machine's best."""

from typing import Any

import gymnasium as gym
import numpy as np

from chaosgym.control.controllers.controller import Action, Controller, Observation, single
from chaosgym.control.forecast import constant_returns, forecast_for, training_forecasts
from chaosgym.envs.drive import checked_number


class ConstantSpeed(Controller):
    """Goes to one speed and stays there.

    Parameters
    ----------
    env
        Environment of one machine.
    speed
        In the unit of the machine's speed field.

    Raises
    ------
    ParameterError
        If the drive can't go at that speed.
    """

    def __init__(self, env: gym.Env[Any, Any], speed: float) -> None:
        super().__init__(env)
        self.speed = checked_number("speed", speed, self.drive.lowest_speed, self.drive.highest_speed)

    def __call__(self, observation: Observation) -> Action:
        """Return the action of that speed."""
        return self.command(self.speed)


class LowestSpeed(ConstantSpeed):
    """The drive's lowest speed."""

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        super().__init__(env, single(env).drive.lowest_speed)


class HighestSpeed(ConstantSpeed):
    """The drive's highest speed."""

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        super().__init__(env, single(env).drive.highest_speed)


class SafeConstant(ConstantSpeed):
    """The constant speed with the best mean return over the training pool, by its tables of regimes."""

    knows = "tolerance range"

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        forecasts = training_forecasts(single(env))
        speeds = forecasts[0].speeds
        mean = np.mean([constant_returns(forecast, 0) for forecast in forecasts], axis=0)
        super().__init__(env, float(speeds[mean.argmax()]))


class ClairvoyantConstant(Controller):
    """The best constant speed for this very machine, by its table of regimes."""

    knows = "machine"

    def reset(self) -> None:
        """Look the machine up."""
        forecast = forecast_for(self.env, "machine")
        returns = constant_returns(forecast, int(forecast.place_of(self.env.speed)))
        self.speed = float(forecast.speeds[returns.argmax()])

    def __call__(self, observation: Observation) -> Action:
        """Return the action of that speed."""
        return self.command(self.speed)
