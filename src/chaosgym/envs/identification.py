"""Which machine is it? The one whose simulation repeats what was observed: identification by the output error.

What fits is the share of the half cycle spent bouncing, which no sensor error blurs. It changes smoothly with the
parameters, but for jumps where a bounce more or less belongs to it: most steps are met exactly or missed by far. So
many starting points go through Gauss-Newton steps under Cauchy weights side by side, until one repeats the record.

References
----------
L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall, 1999, chapter 7 (output error) and 15
(robust norms).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from chaosgym.envs.jobs import RUN_IN_CYCLES, bouncing_share
from chaosgym.envs.observation import BOUNCING, LAST_ACTION, SPEED, Observation
from chaosgym.envs.pools import Pool, worn
from chaosgym.envs.tasks import Task
from chaosgym.fleet import at_speed, fleet_of
from chaosgym.machines.machine import Machine

Array = NDArray[np.float64]

SCREENED, STARTS, ITERATIONS = 256, 16, 20
"""Machines that are tried first, how many of them are followed up, and for how many steps; calibrated: enough for
most training beams at the first attempt (``pytest -m slow tests/envs/test_identification.py``)."""

EQUAL = 1e-6
"""Difference of shares that counts as none: some units in the last place of an observation; derived."""

LAST_PLACE = 3e-8
"""Rounding error of an observed share; derived from its 24 bits."""

JUMP = 2e-3
"""Difference of shares that the screening takes for a jump; assumed."""

SEARCHED = 5
"""Observations that a machine is searched by, before the whole record is looked at: irregular motion that goes on for
longer leaves no valley to descend in. Calibrated on training beams."""

STRANGERS = 2
"""Observations of a longer record that need not be repeated: those where a bounce more or less counts; assumed."""

ATTEMPTS = (9, 17)
"""Observations after which the machine is looked for; assumed."""

PRECISION, ALIKE = 1e-6, 8
"""Usual error of estimates, in tolerances, calibrated on training beams, and how many machines stand for what is
possible within it, assumed."""

PROBE = 1e-5
"""Change of a factor, in tolerances, that derivatives are taken with; assumed."""

STEEP = 50.0
"""Derivative of a share by a factor in tolerances that is none: a jump lies in between; assumed."""

FARTHEST = 0.3
"""Largest step of an iteration, in tolerances; assumed."""


class Identification:
    """The machine of one job, as a point within the tolerances.

    Parameters
    ----------
    pool
        Whose nominal machine and tolerances are known.
    task
        Of the job.

    Attributes
    ----------
    estimate : (fields,) or None
        Deviation of each field from its nominal value, in tolerances; None as long as none repeats the record.
    """

    def __init__(self, pool: Pool, task: Task) -> None:
        self._pool, self._task = pool, task
        self._count = len(pool.tolerances)
        self.start()

    def start(self) -> None:
        """Forget the last job."""
        self.estimate: Array | None = None
        self._speeds: list[float] = []
        self._shares: list[float] = []

    @property
    def machines(self) -> list[Machine]:
        """Machines that the record does not tell apart, the most probable one first; none if none repeats it.

        Each is new and at the lowest speed. They are ``ALIKE``, at the distance by which estimates err.
        """
        if self.estimate is None:
            return []
        shares = np.random.default_rng(0).uniform(-1.0, 1.0, (ALIKE - 1, self._count))
        points = [self.estimate, *(self.estimate + PRECISION * shares)]
        return [self._pool.machine_with(self._factors(point)) for point in points]

    def add(self, observation: Observation) -> list[Machine]:
        """Take in an observation (d,) and look for the machine if it is time to; return ``machines`` if found now."""
        drive = self._pool.drive
        if self._speeds:
            target = drive.target_of(observation[[LAST_ACTION]])[1]
            self._speeds.append(float(drive.approach(self._speeds[-1], target)))
        else:
            self._speeds.append(float(drive.rounded(float(observation[SPEED]))))
        self._shares.append(float(observation[BOUNCING]))
        if self.estimate is not None or len(self._speeds) not in ATTEMPTS:
            return []
        self.estimate = self._found()
        return self.machines

    def _found(self) -> Array | None:
        """Search the whole range by the first observations; None if nothing repeats the record."""
        grid = 2.0 * qmc.Sobol(self._count, seed=len(self._speeds)).random(SCREENED) - 1.0
        cost = np.log1p((self._errors(grid, SEARCHED) / JUMP) ** 2).sum(axis=1)
        points = grid[np.argsort(cost, kind="stable")[:STARTS]]
        for iteration in range(ITERATIONS):
            errors, slopes = self._linearised(points, SEARCHED)
            repeats = (np.abs(errors) < EQUAL).all(axis=1)
            if repeats.any():
                return self._checked(self._refined(points[repeats.argmax()]))
            spread = np.median(np.abs(errors), axis=1) if iteration else np.full(STARTS, JUMP)
            points = points + _steps(errors, slopes, spread, 1e-3 * 0.3**iteration)
            points = np.clip(points, -1.0, 1.0)
        return None

    def _checked(self, estimate: Array) -> Array | None:
        """Return the estimate if it repeats the whole record."""
        repeated = np.abs(self._errors(estimate[None])[0]) < EQUAL
        return estimate if np.count_nonzero(~repeated) <= STRANGERS else None

    def _refined(self, estimate: Array) -> Array:
        """Improve an estimate as long as that brings the record closer."""
        best, least = estimate, np.inf
        point = estimate[None]
        for _ in range(ITERATIONS):
            errors, slopes = self._linearised(point)
            cost = float(np.log1p((errors / EQUAL) ** 2).sum())
            if cost >= least:
                break
            best, least = point[0], cost
            point = point + _steps(errors, slopes, np.full(1, EQUAL), 1e-9)
        return best

    def _linearised(self, points: Array, first: int | None = None) -> tuple[Array, Array]:
        """Errors of points (k, fields), (k, steps), and their derivatives (k, steps, fields); zero across jumps."""
        probes = points[:, None] + PROBE * np.vstack([np.zeros(self._count), np.eye(self._count)])
        errors = self._errors(probes.reshape(-1, self._count), first).reshape(len(points), self._count + 1, -1)
        slopes = (errors[:, 1:] - errors[:, :1]).transpose(0, 2, 1) / PROBE
        smooth = np.abs(slopes).max(axis=2, keepdims=True) < STEEP
        return errors[:, 0], np.where(smooth, slopes, 0.0)

    def _factors(self, point: Array) -> Array:
        return np.asarray(1.0 + point * np.array(list(self._pool.tolerances.values())))

    def _errors(self, points: Array, first: int | None = None) -> Array:
        """Simulated less observed shares of machines (k, fields), (k, steps); of the first observations, or of all."""
        pool, task = self._pool, self._task
        machines = [at_speed(pool.machine_with(self._factors(point)), self._speeds[0]) for point in points]
        fleet, which = fleet_of(machines[0], len(machines)), np.arange(len(machines))
        for place, machine in enumerate(machines):
            fleet.start(place, machine)
        damage = np.zeros((len(machines), len(machines[0].sides)))
        cycles = fleet.run(which, max(RUN_IN_CYCLES, task.cycles_per_step))
        shares = [bouncing_share(cycles, task.cycles_per_step, pool.nominal.period_at(self._speeds[0]))]
        for speed in self._speeds[1:first]:
            if pool.wears:
                for place, worse in enumerate(damage.max(axis=1).tolist()):
                    fleet.change(place, at_speed(worn(machines[place], 1.0 + worse), speed))
            fleet.set_speeds(which, np.full(len(which), speed))
            cycles = fleet.run(which, task.cycles_per_step)
            damage += task.damage(cycles.peak_force)
            shares.append(bouncing_share(cycles, task.cycles_per_step, pool.nominal.period_at(speed)))
        return np.asarray(np.array(shares).T - np.array(self._shares[:first]))


def _steps(errors: Array, slopes: Array, spread: Array, damping: float) -> Array:
    """Gauss-Newton steps (k, fields) under Cauchy weights of a spread (k,); a damping as share of the mean curvature
    holds still what the record says nothing of."""
    weight = 1.0 / (1.0 + (errors / np.maximum(spread, LAST_PLACE)[:, None]) ** 2)
    weighted = (slopes * weight[:, :, None]).transpose(0, 2, 1)
    curvature = weighted @ slopes
    mean = np.trace(curvature, axis1=1, axis2=2) / slopes.shape[2]
    curvature += (damping * mean + 1e-12)[:, None, None] * np.eye(slopes.shape[2])
    steps = -np.linalg.solve(curvature, weighted @ errors[:, :, None])[:, :, 0]
    return np.asarray(steps * np.minimum(1.0, FARTHEST / np.maximum(np.abs(steps).max(axis=1), 1e-30))[:, None])
