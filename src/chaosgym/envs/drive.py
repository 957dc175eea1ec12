"""How does an agent command a machine's speed? An action names a target that the drive approaches at a limited rate."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from chaosgym.errors import ParameterError
from chaosgym.machines.parameters import parameter, validate


@dataclass(frozen=True, kw_only=True)
class SpeedDrive:
    """Speed range and slew limit of a drive, in the unit of the machine's speed field."""

    lowest_speed: float = parameter(4.0, low=0.0, high=1e6, provenance="printed", source="thesis 3.5.1: 4 to 30 Hz")
    """Target speed of action -1."""
    highest_speed: float = parameter(30.0, low=0.0, high=1e6, provenance="printed", source="thesis 3.5.1: 4 to 30 Hz")
    """Target speed of action +1."""
    slew_limit: float = parameter(1.0, low=0.0, high=1e6, provenance="assumed", source="26 steps for the whole range")
    """Largest change of speed in one step."""

    def __post_init__(self) -> None:
        validate(self)
        if self.highest_speed <= self.lowest_speed:
            raise ParameterError(
                f"highest_speed = {self.highest_speed:g} is out of range; allowed: above lowest_speed = "
                f"{self.lowest_speed:g}"
            )

    def target_of(self, action: Any) -> tuple[float, float]:
        """Return the action, clipped to [-1, 1], and the target speed that it stands for.

        Raises
        ------
        ParameterError
            If the action is not one finite number.
        """
        value = float(action[0]) if np.shape(action) == (1,) else math.nan
        if not math.isfinite(value):
            raise ParameterError(f"action = {action!r} is not usable; allowed: one number from -1 to 1, shape (1,)")
        value = min(max(value, -1.0), 1.0)
        return value, self.lowest_speed + 0.5 * (value + 1.0) * (self.highest_speed - self.lowest_speed)

    def action_for(self, speed: float) -> float:
        """Return the action whose target is ``speed``."""
        return 2.0 * (speed - self.lowest_speed) / (self.highest_speed - self.lowest_speed) - 1.0

    def approach(self, speed: float, target: float) -> float:
        """Return the speed of the next step."""
        return speed + min(max(target - speed, -self.slew_limit), self.slew_limit)
