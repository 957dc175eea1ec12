"""How does an agent command a machine's speed? An action names a target that the drive approaches at a limited rate."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.errors import ParameterError


def checked_number(name: str, value: Any, low: float, high: float) -> float:
    """Return the value as a float.

    Raises
    ------
    ParameterError
        If it is no number from ``low`` to ``high``; names it, its value and the range.
    """
    if isinstance(value, str) or not hasattr(value, "__float__") or not low <= float(value) <= high:
        raise ParameterError(f"{name} = {value!r} is out of range; allowed: {low:g} to {high:g}")
    return float(value)


@dataclass(frozen=True, kw_only=True)
class SpeedDrive:
    """Speed range and slew limit of a drive, in the unit of the machine's speed field.

    Speeds and actions may be numbers or arrays of any shape.
    """

    lowest_speed: float
    """Target speed of action -1."""
    highest_speed: float
    """Target speed of action +1."""
    slew_limit: float
    """Largest change of speed in one step."""
    speed_grid: float = 0.0
    """Spacing of the speeds that can be commanded, from the lowest one on; 0 if all can."""
    regime_spacing: float = 1.0
    """Spacing of the speeds at which the nature of a machine's response is looked up."""

    def __post_init__(self) -> None:
        for name in ("lowest_speed", "highest_speed", "slew_limit", "speed_grid"):
            object.__setattr__(self, name, checked_number(name, getattr(self, name), 0.0, 1e6))
        object.__setattr__(self, "regime_spacing", checked_number("regime_spacing", self.regime_spacing, 1e-3, 1e6))
        if self.highest_speed <= self.lowest_speed:
            raise ParameterError(
                f"highest_speed = {self.highest_speed:g} is out of range; allowed: above lowest_speed = "
                f"{self.lowest_speed:g}"
            )
        if self.speed_grid > 0.0:
            self._check_grid()

    def _check_grid(self) -> None:
        spaces = (self.highest_speed - self.lowest_speed) / self.speed_grid
        if abs(spaces - round(spaces)) > 1e-9 * max(1.0, spaces) or self.speed_grid > self.slew_limit:
            raise ParameterError(
                f"speed_grid = {self.speed_grid:g} is out of range; allowed: 0, or up to slew_limit = "
                f"{self.slew_limit:g} and a whole number of times in the range of {self.lowest_speed:g} to "
                f"{self.highest_speed:g}"
            )

    @property
    def regime_speeds(self) -> NDArray[np.float64]:
        """Speeds from the lowest one on, ``regime_spacing`` apart, that cover the range."""
        spaces = math.ceil((self.highest_speed - self.lowest_speed) / self.regime_spacing - 1e-9)
        return np.asarray(self.lowest_speed + self.regime_spacing * np.arange(spaces + 1))

    def target_of(self, action: Any) -> tuple[Any, Any]:
        """Return actions, clipped to [-1, 1], and the target speeds that they stand for, (...) for actions (..., 1).

        Raises
        ------
        ParameterError
            If an action is not finite.
        """
        value = np.asarray(action, dtype=float)[..., 0]
        if not np.all(np.isfinite(value)):
            raise ParameterError(f"action = {action!r} is not usable; allowed: numbers from -1 to 1")
        value = np.clip(value, -1.0, 1.0)
        return value, self.rounded(self.lowest_speed + 0.5 * (value + 1.0) * (self.highest_speed - self.lowest_speed))

    def action_for(self, speed: float) -> float:
        """Return the action whose target is ``speed``."""
        return 2.0 * (speed - self.lowest_speed) / (self.highest_speed - self.lowest_speed) - 1.0

    def rounded(self, speed: Any) -> Any:
        """Return the speeds nearest to ``speed`` that can be commanded."""
        if self.speed_grid == 0.0:
            return speed
        return self.lowest_speed + self.speed_grid * np.rint((speed - self.lowest_speed) / self.speed_grid)

    def approach(self, speed: Any, target: Any) -> Any:
        """Return the speeds of the next step, between speeds that can be commanded."""
        limit = self.slew_limit
        if self.speed_grid > 0.0:
            limit = self.speed_grid * math.floor(limit / self.speed_grid * (1.0 + 1e-12))
        return self.rounded(speed + np.clip(target - speed, -limit, limit))
