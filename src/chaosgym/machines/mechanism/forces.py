"""What pulls at a mechanism: forces and moments over the crank angle, a gas, springs and dampers."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.machines.loads import Cycle

STROKE_ANGLES = 1440
"""Crank angles at which the pressure of a cylinder is followed."""


class Force(NamedTuple):
    """A force on a point of a link: ``at`` gives it in ground axes, (B, 2) [N], at crank angles (B,) [rad].

    One that ``turns`` is a moment on the link at the point, (B, 1) [N m], in the plane. ``note`` says what samples
    leave out.
    """

    point: tuple[str, str]
    at: Callable[[Array], Array]
    turns: bool = False
    note: str = ""

    def times(self, factor: float) -> "Force":
        """The force times a factor."""
        return self._replace(at=lambda theta: factor * self.at(theta))

    def parts(self, dimensions: int) -> int:
        """Its components."""
        return 1 if self.turns else dimensions


class Spring(NamedTuple):
    """A spring and damper between two points: stiffness [N/m], free length [m], damping [N s/m]."""

    first: tuple[str, str]
    second: tuple[str, str]
    stiffness: float
    free_length: float
    damping: float = 0.0


class TorsionSpring(NamedTuple):
    """A spring and damper between the turns of two links, at their points: N m/rad, free angle [rad], N m s/rad."""

    first: tuple[str, str]
    second: tuple[str, str]
    stiffness: float
    free_angle: float
    damping: float = 0.0


class Along(NamedTuple):
    """Values over a cycle along a direction (2,)."""

    cycle: Cycle
    direction: Array

    def at(self, theta: Array) -> Array:
        """Vectors (B, 2) at crank angles (B,) [rad]."""
        return np.asarray(self.cycle.at(theta)[:, None] * self.direction)


class SampledForce(NamedTuple):
    """Values (s,) at equal steps of the crank angle from 0 on, straight lines between them, along a direction (2,)."""

    values: Array
    direction: Array

    def at(self, theta: Array) -> Array:
        """Vectors (B, 2) at crank angles (B,) [rad]."""
        count = len(self.values)
        place = np.mod(theta, 2.0 * np.pi) * (count / (2.0 * np.pi))
        first = np.minimum(place.astype(int), count - 1)
        share = place - first
        value = self.values[first] * (1.0 - share) + self.values[(first + 1) % count] * share
        return np.asarray(value[:, None] * self.direction)


class Gas(NamedTuple):
    """Ideal reciprocating compressor.

    Attributes
    ----------
    area
        Of the piston [m^2].
    dead_volume
        Volume above the piston at its highest place, as a share of the swept volume.
    suction, discharge, behind
        Pressures [Pa] at which the valves open, and on the other side of the piston.
    exponent
        Of the polytropic changes between them.
    """

    area: float
    dead_volume: float
    suction: float
    discharge: float
    behind: float
    exponent: float

    def pressure(self, place: Array) -> Array:
        """Pressure [Pa] over a revolution (s,) of a piston that compresses as its place (s,) [m] grows.

        It stays between suction and discharge, and follows p V^n = const while both valves are closed. A dead volume
        so large that the outlet never opens leaves what suction has filled at the lowest place.
        """
        volume = (place.max() - place) / np.ptp(place) + self.dead_volume
        lowest, pressure = int(np.argmax(volume)), np.empty(len(place))
        now = self.suction
        # the second revolution has forgotten where the first began
        for k in range(1, 2 * len(place) + 1):
            i, before = (lowest + k) % len(place), (lowest + k - 1) % len(place)
            now = now * (volume[before] / volume[i]) ** self.exponent
            now = pressure[i] = min(max(now, self.suction), self.discharge)
        return pressure

    def force(self, place: Array) -> Array:
        """Force [N] on the piston in the direction in which its place (s,) grows."""
        return np.asarray(-(self.pressure(place) - self.behind) * self.area)
