"""Can the last peak forces alone calm the motion? Delayed feedback after Pyragas, in its extended form.

    u_k = K s_k,    s_k = F_k - F_(k-1) + R s_(k-1)

F is the measured peak force of a cycle and u the correction of the speed in the next one: nothing is known of the orbit
that is sought, and the correction dies out on it. It acts each cycle, as ``OGY`` does.

References
----------
Pyragas, Continuous control of chaos by self-controlling feedback, Physics Letters A 170 (1992) 421.
Socolar, Sukow, Gauthier, Stabilizing unstable periodic orbits in fast dynamical systems, Phys. Rev. E 50 (1994) 3245.
Nakajima, On analytical properties of delayed feedback control of chaos, Phys. Lett. A 232 (1997) 207: not every orbit
can be held.
"""

from typing import Any

import gymnasium as gym
import numpy as np

from chaosgym.control.controllers.controller import Action, Controller, Observation
from chaosgym.control.controllers.ogy import needs_single_cycles
from chaosgym.envs.drive import checked_number

GAIN = -0.009
"""Slew limits by which the speed changes for a difference of 1 N: -0.0018 Hz on the beam. Of 18 gains of either sign it
is one of few that calm the nominal beam anywhere, at 20.5 Hz from some states; at most speeds none does."""

MEMORY = 0.2
"""Share R of the earlier differences that is kept."""


class DelayedFeedback(Controller):
    """Goes to a speed and corrects it by the differences of successive peak forces.

    Parameters
    ----------
    env
        Environment of one machine, with ``cycles_per_step=1``.
    speed
        In the unit of the machine's speed field; the highest by default.
    gain
        K in slew limits per newton.
    memory
        R, from 0 to below 1.

    Raises
    ------
    ParameterError
        If a step has more than one cycle, or a value is out of range.
    """

    knows = "measurements"

    def __init__(
        self, env: gym.Env[Any, Any], speed: float | None = None, *, gain: float = GAIN, memory: float = MEMORY
    ) -> None:
        super().__init__(env)
        needs_single_cycles(self)
        wanted = self.drive.highest_speed if speed is None else speed
        self.speed = checked_number("speed", wanted, self.drive.lowest_speed, self.drive.highest_speed)
        self.gain = checked_number("gain", gain, -1e3, 1e3)
        self.memory = checked_number("memory", memory, 0.0, 1.0 - 1e-9)

    def reset(self) -> None:
        """Forget the last job."""
        self._last: float | None = None
        self._sum = 0.0

    def __call__(self, observation: Observation) -> Action:
        """Correct the speed by at most half a slew limit."""
        force = float(self.peaks(observation)[0])
        if self._last is not None:
            self._sum = force - self._last + self.memory * self._sum
        self._last = force
        slew = self.drive.slew_limit
        return self.command(self.speed + float(np.clip(self.gain * slew * self._sum, -0.5 * slew, 0.5 * slew)))
