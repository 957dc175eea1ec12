"""Control of chaos at the demanded speed: small corrections, once a cycle, may hold an unstable orbit.

OGY, after Ott, Grebogi and Yorke: of the orbits of period 1 that the chaotic motion passes by, the least unstable one
is found by Newton's method, and the speed is corrected by u = -K (x - x*), with x the state at the start of a cycle,
x* that of the orbit, and K from the linear map of deviations and speed by the Riccati equation. It is told the full
state.

Delayed feedback, after Pyragas in its extended form: u_k = K s_k, s_k = F_k - F_(k-1) + R s_(k-1), with F the measured
peak force of a cycle. Nothing is known of the orbit.

References
----------
Ott, Grebogi, Yorke, Controlling chaos, Physical Review Letters 64 (1990) 1196.
Romeiras, Grebogi, Ott, Dayawansa, Controlling chaotic dynamical systems, Physica D 58 (1992) 165: pole placement.
Pyragas, Continuous control of chaos by self-controlling feedback, Physics Letters A 170 (1992) 421.
Socolar, Sukow, Gauthier, Stabilizing unstable periodic orbits in fast dynamical systems, Phys. Rev. E 50 (1994) 3245.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, solve_discrete_are

from chaosgym.control.controllers.controller import Array, Controller, Observations, seen
from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit, find_periodic_orbit
from chaosgym.errors import SimulationError
from chaosgym.machines.machine import Machine
from chaosgym.simulation import simulate

SEARCHED_CYCLES, PASSES = 200, 8
"""Cycles in which close returns are looked for, after as many to settle, and how many of them Newton's method tries."""

CLOSED = 1e-8
"""Largest miss of an orbit, relative to its size."""


class Hold(NamedTuple):
    """How a speed is held: ``state`` (n,) of the orbit, ``gain`` (n,) of the speed for deviations from it."""

    state: Array
    gain: Array


class OGY(Controller):
    """Goes to the demand and, where an orbit of period 1 is found there, corrects the speed by the state."""

    knows = "machine"

    def begin(self, envs: Any) -> None:
        """Forget the orbits."""
        self._jobs = envs.jobs
        self._holds: list[Hold | None] = [None] * self.count
        self._demand = np.full(self.count, np.nan)

    def speeds(self, observations: Observations) -> Array:
        """The demand, corrected where the motion is near its orbit."""
        demand, speed = seen(observations, "demand"), seen(observations, "speed")
        limit = 0.5 * self.task.slew_limit
        target = demand.copy()
        for i in range(self.count):
            if demand[i] != self._demand[i]:
                self._holds[i] = orbit_to_hold(self._jobs.machine_at(i).at(float(demand[i])), limit)
            hold = self._holds[i]
            if hold is not None and abs(speed[i] - demand[i]) <= 1.01 * limit:
                wanted = -float(hold.gain @ (self._jobs.batch.motion(i)[0] - hold.state))
                target[i] += wanted if abs(wanted) <= limit else 0.0
        self._demand = demand
        return target


class DelayedFeedback(Controller):
    """Goes to the demand and corrects the speed by the differences of successive measured peak forces.

    Parameters
    ----------
    gain
        K in slew limits per newton.
    memory
        R, from 0 to below 1.
    """

    knows = "measurements"

    def __init__(self, *, gain: float = -0.009, memory: float = 0.2) -> None:
        super().__init__()
        self.gain, self.memory = gain, memory

    def begin(self, envs: Any) -> None:
        """Forget the forces."""
        self._last, self._sum = np.full(self.count, np.nan), np.zeros(self.count)

    def speeds(self, observations: Observations) -> Array:
        """The demand, corrected by at most half a slew limit."""
        force, slew = seen(observations, "mean_peak_force"), self.task.slew_limit
        known = np.isfinite(self._last)
        self._sum = np.where(known, force - self._last + self.memory * self._sum, 0.0)
        self._last = force
        return seen(observations, "demand") + np.clip(self.gain * slew * self._sum, -0.5 * slew, 0.5 * slew)


def orbit_to_hold(machine: Machine, limit: float) -> Hold | None:
    """Orbit of period 1 and the gain that holds it by corrections of up to ``limit``; None where there is none."""
    try:
        section = simulate(machine, SEARCHED_CYCLES, transient=SEARCHED_CYCLES).section
        orbit = _least_unstable(machine, section)
        return None if orbit is None else _hold(machine, orbit, np.ptp(section, axis=0), limit)
    except SimulationError:
        return None


def _least_unstable(machine: Machine, section: Array) -> PeriodicOrbit | None:
    """Orbit of period 1 near the closest returns of the section (cycles, n)."""
    size = np.ptp(section, axis=0).clip(1e-12 * np.abs(section).max())
    returns = np.linalg.norm(np.diff(section, axis=0) / size, axis=1)
    found = [find_periodic_orbit(machine, section[k], 1, iterations=15) for k in np.argsort(returns)[:PASSES]]
    orbits = [orbit for orbit in found if orbit is not None and orbit.residual < CLOSED]
    return min(orbits, key=lambda orbit: orbit.largest_multiplier, default=None)


def _hold(machine: Machine, orbit: PeriodicOrbit, spread: Array, limit: float) -> Hold | None:
    """Gain of the linear map, in units of the spread of the motion and the limit; None where there is none."""
    speed, step = float(getattr(machine, machine.speed_field)), 1e-3 * limit
    ends = [simulate(machine.at(speed + sign * step), 1, orbit.state).final_state for sign in (1.0, -1.0)]
    by_speed = (ends[0].coordinates - ends[1].coordinates) / (2.0 * step)
    size = spread.clip(1e-6 * np.abs(orbit.state).max())
    deviations = orbit.derivative * size / size[:, None]
    inputs = (by_speed * limit / size)[:, None]
    try:
        cost = solve_discrete_are(deviations, inputs, np.eye(len(size)), np.eye(1))
        gain = np.linalg.solve(np.eye(1) + inputs.T @ cost @ inputs, inputs.T @ cost @ deviations)[0]
    except (LinAlgError, ValueError):
        return None
    return Hold(orbit.state, limit * gain / size)
