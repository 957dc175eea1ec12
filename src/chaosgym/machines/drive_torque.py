"""Torque that the drive of a mechanism gives over a revolution, and what follows for motor and flywheel."""

import math
from typing import Any, NamedTuple

import numpy as np

from chaosgym.arrays import Array

SWING = 0.01
"""Swing of the speed, as a share of it, for which a flywheel is told."""

LEAST_SWING = 1e-9
"""Least swing for which a flywheel can be asked."""

ROUNDING = 1e-12
"""Share of the largest torque below which a mean is rounding."""


class DriveTorque(NamedTuple):
    """Torque of a drive that turns at constant speed, while every gap stays in its middle; friction is included.

    Knocks in the gaps add to it within a cycle, and what they dissipate adds to its mean.

    Attributes
    ----------
    torque : (B,)
        [N m] at equal steps of a revolution from crank angle 0 on; positive where it drives the crank on.
    rate
        Angular velocity of the drive [rad/s].

    Examples
    --------
    >>> from chaosgym.machines.drive_torque import DriveTorque
    >>> drive = DriveTorque(2.0 + np.sin(np.arange(360) * np.pi / 180.0), rate=100.0)
    >>> round(drive.mean_power), round(drive.energy_swing, 3)
    (200, 2.0)
    """

    torque: Array
    rate: float

    @property
    def mean(self) -> float:
        """Mean torque [N m]; zero where it is rounding."""
        mean = float(self.torque.mean())
        return mean if abs(mean) > ROUNDING * float(np.abs(self.torque).max()) else 0.0

    @property
    def mean_power(self) -> float:
        """Mean power [W]."""
        return self.rate * self.mean

    @property
    def largest_power(self) -> float:
        """Largest power [W]."""
        return self.rate * float(self.torque.max())

    @property
    def energy_swing(self) -> float:
        """Work [J] that a flywheel takes up and gives back in a revolution, if the motor gives the mean torque."""
        work = np.cumsum(self.torque - self.mean) * (2.0 * math.pi / len(self.torque))
        return float(np.ptp(work))

    def flywheel(self, swing: float) -> float:
        """Inertia [kg m^2] with which highest and lowest speed differ by a share ``swing`` of the mean one.

        It is that of a small swing, (work taken up) / (swing rate^2), as in any textbook on machine dynamics.

        Raises
        ------
        ParameterError
            If the swing is not a share above 0.
        """
        from chaosgym.numbers import number

        number("swing", swing, LEAST_SWING, 2.0)
        return self.energy_swing / (swing * self.rate**2)

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON, with their units."""
        return {
            "torque_N_m": {
                "mean": self.mean,
                "smallest": float(self.torque.min()),
                "largest": float(self.torque.max()),
            },
            "mean_power_W": self.mean_power,
            "largest_power_W": self.largest_power,
            "energy_swing_J": self.energy_swing,
        }

    @property
    def told(self) -> tuple[str, ...]:
        """Lines for people."""
        return (
            f"drive: torque {self.torque.min():.4g} to {self.torque.max():.4g} N m, mean {self.mean:.4g} N m; "
            f"power {self.mean_power:.4g} W on average, up to {self.largest_power:.4g} W",
            f"flywheel: {self.flywheel(SWING):.3g} kg m^2 would hold the speed within {SWING:.0%} "
            f"(it takes up {self.energy_swing:.3g} J)",
        )
