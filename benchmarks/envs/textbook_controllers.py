"""Textbook controllers that lose to following the demand or to backing off, and the command that shows it.

Hill climbing, extremum seeking and force feedback act in every step of a job, from what is felt. Control of chaos acts
in every cycle: small corrections of the speed may hold an unstable orbit at the demand.

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
Krstic, Wang, Stability of extremum seeking for general nonlinear dynamic systems, Automatica 36 (2000) 595.
Socolar, Sukow, Gauthier, Stabilizing unstable periodic orbits in fast dynamical systems, Phys. Rev. E 50 (1994) 3245.
"""

from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from scipy.linalg import LinAlgError, solve_discrete_are

from chaosgym.arrays import Array
from chaosgym.control.comparison import Contenders, job_rows
from chaosgym.control.controllers.controller import THRESHOLD, Controller, Observations, irregular, seen
from chaosgym.control.rollout import play
from chaosgym.control.scores import ONE, SAFE, ZERO, Scores
from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit, find_periodic_orbit
from chaosgym.envs.vector_env import native_envs
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


class HillClimbing(Controller):
    """Perturb and observe: goes on while the felt cost falls, else turns; a step of the trim every three steps."""

    knows = "measurements"
    dwell = 3

    def begin(self, envs: Any) -> None:
        """Start at the demand."""
        self._trim, self._sign = np.zeros(self.count), -np.ones(self.count)
        self._best, self._sum, self._steps = np.full(self.count, np.inf), np.zeros(self.count), 0
        self._demand = np.full(self.count, np.nan)

    def speeds(self, observations: Observations) -> Array:
        """The demand and the trim."""
        task, demand = self.task, seen(observations, "demand")
        cost = task.deviation_weight * np.abs(seen(observations, "offset"))
        self._sum += cost + task.type_iii_weight * irregular(observations, task, THRESHOLD, 0.23)
        new = demand != self._demand
        self._demand = demand
        self._trim[new], self._best[new], self._sum[new] = 0.0, np.inf, 0.0
        self._steps += 1
        if self._steps % self.dwell == 0:
            mean = self._sum / self.dwell
            climbs = mean >= 0.15
            self._sign = np.where(climbs & (mean > self._best), -self._sign, self._sign)
            moved = self._trim + self._sign * task.trim_step
            self._trim = np.where(climbs, np.clip(moved, -task.largest_trim, task.largest_trim), self._trim)
            self._best, self._sum = mean, np.zeros(self.count)
        return np.asarray(demand + self._trim)


class ExtremumSeeking(Controller):
    """A slow sine on the trim, and a drift against the part of the felt cost that moves with it (Krstic and Wang)."""

    knows = "measurements"
    period = 8
    gain = 2.0

    def begin(self, envs: Any) -> None:
        """Start at the demand."""
        self._trim, self._mean, self._step = np.zeros(self.count), np.zeros(self.count), 0

    def speeds(self, observations: Observations) -> Array:
        """The demand, the trim and the sine."""
        task = self.task
        cost = task.deviation_weight * np.abs(seen(observations, "offset"))
        cost = cost + task.type_iii_weight * irregular(observations, task, THRESHOLD, 0.23)
        self._mean += (cost - self._mean) / self.period
        wave = np.sin(2.0 * np.pi * self._step / self.period)
        self._trim -= self.gain * task.trim_step * (cost - self._mean) * wave
        self._trim = np.clip(self._trim, -task.largest_trim, task.largest_trim)
        self._step += 1
        ahead = np.sin(2.0 * np.pi * self._step / self.period)
        return np.asarray(seen(observations, "demand") + self._trim + task.trim_step * ahead)


class ForceFeedback(Controller):
    """Integral control of the scatter of the peak forces: slower while it is above the sensor's own, else back."""

    knows = "measurements"
    gain = 1.0

    def begin(self, envs: Any) -> None:
        """Start at the demand."""
        self._trim = np.zeros(self.count)

    def speeds(self, observations: Observations) -> Array:
        """The demand less what the scatter asks for."""
        task = self.task
        scatter = seen(observations, "std_peak_force") / max(task.sensor_error, 1e-3 * task.load_rating)
        self._trim = np.clip(self._trim - self.gain * task.trim_step * (scatter - 1.0), -task.largest_trim, 0.0)
        return np.asarray(seen(observations, "demand") + self._trim)


BY_STEP = {"hill climbing": HillClimbing, "extremum seeking": ExtremumSeeking, "force feedback": ForceFeedback}
BY_CYCLE = {"delayed feedback": DelayedFeedback, "OGY": OGY}
"""Controllers that act once a step, and once a cycle."""


def cycle_keywords(task: Any) -> dict[str, Any]:
    """Keywords of the same job with an action in each cycle instead of each step."""
    n = task.cycles_per_step
    whole = {name: n * getattr(task, name) for name in ("steps", "shortest_hold", "longest_hold")}
    parts = ("type_iii_weight", "deviation_weight", "failure_weight", "slew_limit")
    return {"cycles_per_step": 1, "speed_grid": 0.0, **whole, **{name: getattr(task, name) / n for name in parts}}


def textbook_scores(env: str, machines: int, progress: bool = True) -> dict[str, dict[str, Any]]:
    """What the textbook controllers achieve on the first machines kept for evaluation, as ``Scores.summary``."""
    numbers = range(machines)
    known = Contenders(env, {}, progress).makers(numbers)
    players: dict[str, Any] = {name: known[name] for name in (ZERO, ONE, SAFE)} | BY_STEP | BY_CYCLE
    task = native_envs(env).task
    rows = []
    for name, make in players.items():
        player, keywords = make(), cycle_keywords(task) if name in BY_CYCLE else {}
        played = play(player, env, numbers, progress=name if progress else None, **keywords)
        rows.append(job_rows(name, player.knows, 0, played, env))
    return Scores(pa.concat_tables(rows)).summary()
