"""What do drives do today? They skip bands of speed: the reference waits at the edge, and the ramp crosses quickly.

The bands are the Type III speeds of the nominal machine. A demand inside a band is held at the edge on whose side it
came from, until it passes the middle of the band by a share of its width: that share is the hysteresis. Then the ramp
goes to the other edge at the full rate.

References
----------
Rockwell, Kinetix 5700 drives: skip speeds, hysteresis of a quarter of the band.
ABB, ACQ580 firmware manual, critical speeds: the reference is frozen until it leaves the band, that is a half.
"""

from typing import Any

import gymnasium as gym
import numpy as np

from chaosgym.control.controllers.constant import HighestSpeed
from chaosgym.control.controllers.controller import Action, Controller, Observation
from chaosgym.envs.drive import checked_number

Band = tuple[float, float]


class SkipBands(Controller):
    """Passes a demand on, but for the skipped bands.

    Parameters
    ----------
    env
        Environment of one machine.
    demand
        Controller whose actions are the demand; the highest speed by default.
    margin
        By how much a band is widened at both ends, in the unit of the machine's speed field.
    hysteresis
        Share of a band's width, from its middle on, that a demand must pass to get to the other side.

    Raises
    ------
    ParameterError
        If the margin or the hysteresis is out of range.
    """

    knows = "nominal"

    def __init__(
        self, env: gym.Env[Any, Any], demand: Controller | None = None, *, margin: float = 0.0, hysteresis: float = 0.25
    ) -> None:
        super().__init__(env)
        self.demand = demand or HighestSpeed(env)
        reach = self.drive.highest_speed - self.drive.lowest_speed
        self.margin = checked_number("margin", margin, 0.0, reach)
        self.hysteresis = checked_number("hysteresis", hysteresis, 0.0, 0.5)

    def reset(self) -> None:
        """Read the bands from the nominal table; the reference starts where the machine is."""
        self.demand.reset()
        table = self.env.nominal_regimes
        self.bands = skipped_bands(table.speeds, table.type_iii, self.margin)
        self._reference = float(self.env.speed)

    def __call__(self, observation: Observation) -> Action:
        """Return the demand, or the edge at which it is held."""
        wanted = float(self.drive.target_of(self.demand(observation))[1])
        self._reference = self._held(wanted)
        return self.command(self._reference)

    def _held(self, wanted: float) -> float:
        for low, high in self.bands:
            if not low < wanted < high:
                continue
            above = self._reference > 0.5 * (low + high)
            beyond = (wanted - 0.5 * (low + high)) * (-1.0 if above else 1.0)
            crosses = beyond >= self.hysteresis * (high - low)
            if high > self.drive.highest_speed:
                return low
            if low < self.drive.lowest_speed:
                return high
            return low if above == crosses else high
        return wanted


def skipped_bands(speeds: Any, type_iii: Any, margin: float) -> list[Band]:
    """Bands between speeds that may be held, from the Type III flags (n,) of a table's speeds (n,).

    A band without such a speed at one end reaches beyond the table.
    """
    spacing = float(speeds[1] - speeds[0])
    edges = np.diff(np.concatenate([[False], type_iii, [False]]).astype(int))
    found = zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True)
    bands: list[Band] = []
    for first, after in found:
        low = float(speeds[first]) - spacing - margin
        high = float(speeds[after - 1]) + spacing + margin
        if bands and low < bands[-1][1]:
            low = bands.pop()[0]
        bands.append((low, high))
    return bands
