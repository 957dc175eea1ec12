"""Can small corrections of the speed hold an unstable orbit? Control of chaos after Ott, Grebogi and Yorke.

Of the orbits of period 1 that the chaotic motion passes by, the least unstable one is found by Newton's method. Once a
cycle, where the motion is near it, the speed is corrected by

    u = -K (x - x*)                        x the state at the start of the cycle, x* that of the orbit

with K from the linear map of deviations and speed, by the Riccati equation. It acts each cycle, so it wants an
environment with ``cycles_per_step=1`` and a fifth of the slew limit, which leaves the drive as it is. It is told the
full state, by a copy that moves as the machine does.

References
----------
Ott, Grebogi, Yorke, Controlling chaos, Physical Review Letters 64 (1990) 1196.
Romeiras, Grebogi, Ott, Dayawansa, Controlling chaotic dynamical systems, Physica D 58 (1992) 165: pole placement.
"""

from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solve_discrete_are

from chaosgym.control.controllers.controller import Action, Controller, Observation
from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit, find_periodic_orbit
from chaosgym.envs.drive import checked_number
from chaosgym.envs.jobs import RUN_IN_CYCLES
from chaosgym.errors import ParameterError
from chaosgym.machines.machine import Machine
from chaosgym.simulation import MotionState, simulate
from chaosgym.simulation.batch import at_speed

Array = NDArray[np.float64]

SEARCHED_CYCLES, PASSES = 300, 12
"""Cycles in which close returns are looked for, after as many to settle, and how many of them Newton's method tries."""

CLOSED = 1e-8
"""Largest miss of an orbit, relative to its size."""

REHEARSED_CYCLES, SETTLED_CYCLES, SETTLED = 300, 50, 0.01
"""An orbit counts as held if, in a rehearsal, its last peak forces spread by less than this share of their mean."""


class Hold(NamedTuple):
    """How a speed is held: ``state`` (n,) of the orbit, ``gain`` (n,) of the speed for deviations from it."""

    speed: float
    state: Array
    gain: Array
    limit: float

    def correction(self, state: Array) -> float:
        """Return by how much the speed changes for the next cycle; not at all while that would be too much."""
        wanted = -float(self.gain @ (state - self.state))
        return wanted if abs(wanted) <= self.limit else 0.0


class OGY(Controller):
    """Goes to the highest speed at which an orbit of period 1 can be held, and holds it.

    Parameters
    ----------
    env
        Environment of one machine, with ``cycles_per_step=1``.
    speed
        First speed to try, then slower ones of the table of regimes; the highest by default.

    Raises
    ------
    ParameterError
        If a step has more than one cycle, or the drive can't go at the speed.
    """

    knows = "machine"

    def __init__(self, env: gym.Env[Any, Any], speed: float | None = None) -> None:
        super().__init__(env)
        needs_single_cycles(self)
        wanted = self.drive.highest_speed if speed is None else speed
        self.speed = checked_number("speed", wanted, self.drive.lowest_speed, self.drive.highest_speed)

    def reset(self) -> None:
        """Find the orbit to hold, and start the copy."""
        self.hold = held_orbit(self.env.machine, self._speeds_to_try(), 0.5 * self.drive.slew_limit)
        self._state: MotionState | None = None

    def _speeds_to_try(self) -> list[float]:
        speeds = self.env.regimes.speeds
        return [self.speed, *speeds[speeds < self.speed][::-1].tolist()]

    def __call__(self, observation: Observation) -> Action:
        """Correct the speed if the motion is near the orbit."""
        cycles = RUN_IN_CYCLES if self._state is None else 1
        self._state = simulate(self.env.machine, cycles, self._state).final_state
        near = abs(self.env.speed - self.hold.speed) <= self.hold.limit * (1.0 + 1e-9)
        return self.command(self.hold.speed + (self.hold.correction(self._state.coordinates) if near else 0.0))


def needs_single_cycles(controller: Controller) -> None:
    """Refuse an environment in which a controller that acts each cycle can't.

    Raises
    ------
    ParameterError
        If a step has more than one cycle.
    """
    cycles = controller.task.cycles_per_step
    if cycles != 1:
        raise ParameterError(
            f"{type(controller).__name__} acts each cycle, and a step has {cycles}; allowed: an environment with "
            "cycles_per_step=1, and with a slew limit that is shorter by as much"
        )


def held_orbit(machine: Machine, speeds: list[float], limit: float) -> Hold:
    """Return the first speed at which an orbit of period 1 can be held, by rehearsal.

    Parameters
    ----------
    machine
        What runs.
    speeds
        To try, in turn; at the last one no orbit need be held.
    limit
        Largest correction, in the unit of the machine's speed field.
    """
    for speed in speeds:
        at = at_speed(machine, speed)
        record = simulate(at, SEARCHED_CYCLES, transient=SEARCHED_CYCLES)
        orbit = _least_unstable(at, record.section)
        hold = None if orbit is None else _hold(at, speed, orbit, np.ptp(record.section, axis=0), limit)
        if hold is not None and _is_held(at, hold, record.final_state):
            return hold
    return Hold(speed, record.final_state.coordinates, np.zeros(record.section.shape[1]), limit)


def _least_unstable(machine: Machine, section: Array) -> PeriodicOrbit | None:
    """Orbit of period 1 near the closest returns of the section (cycles, n)."""
    size = np.ptp(section, axis=0).clip(1e-12 * np.abs(section).max())
    returns = np.linalg.norm(np.diff(section, axis=0) / size, axis=1)
    found = [find_periodic_orbit(machine, section[k], 1, iterations=20) for k in np.argsort(returns)[:PASSES]]
    orbits = [orbit for orbit in found if orbit is not None and orbit.residual < CLOSED]
    return min(orbits, key=lambda orbit: orbit.largest_multiplier, default=None)


def _hold(machine: Machine, speed: float, orbit: PeriodicOrbit, spread: Array, limit: float) -> Hold | None:
    """Gain of the linear map, in units of the spread of the motion and the limit; None where there is none."""
    step = 1e-3 * limit
    ends = [simulate(at_speed(machine, speed + sign * step), 1, orbit.state).final_state for sign in (1.0, -1.0)]
    by_speed = (ends[0].coordinates - ends[1].coordinates) / (2.0 * step)
    size = spread.clip(1e-6 * np.abs(orbit.state).max())
    deviations = orbit.derivative * size / size[:, None]
    inputs = (by_speed * limit / size)[:, None]
    try:
        cost = solve_discrete_are(deviations, inputs, np.eye(len(size)), np.eye(1))
    except (LinAlgError, ValueError):
        return None
    gain = np.linalg.solve(np.eye(1) + inputs.T @ cost @ inputs, inputs.T @ cost @ deviations)[0]
    return Hold(speed, orbit.state, limit * gain / size, limit)


def _is_held(machine: Machine, hold: Hold, state: MotionState) -> bool:
    peaks = []
    for _ in range(REHEARSED_CYCLES):
        record = simulate(at_speed(machine, hold.speed + hold.correction(state.coordinates)), 1, state)
        state = record.final_state
        peaks.append(float(record.peak_force[0, 0]))
    last = np.array(peaks[-SETTLED_CYCLES:])
    return bool(last.std() < SETTLED * last.mean())
