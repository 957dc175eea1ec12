"""Which machine repeats a record? The one whose simulation gives the same shares of bouncing: output error.

The share of the half cycle spent bouncing has no sensor error and changes smoothly with the parameters, but for jumps
where a bounce more or less belongs to it. How many impacts there were is observed too; where a record has them and a
simulation gives another number, its share is no guide. Levenberg-Marquardt steps under Cauchy weights go down from many
starting points side by side, and then from points along the valleys that they end in, until one repeats the record.

References
----------
L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall, 1999, chapters 7 (output error) and 15
(robust norms).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc
from tqdm import tqdm

from chaosgym.envs.jobs import bouncing_share, impacts_per_cycle
from chaosgym.envs.pools import Pool, worn
from chaosgym.envs.tasks import Task
from chaosgym.machines.machine import Machine
from chaosgym.simulation.batch import Batch, Cycles, at_speed, batch_of

Array = NDArray[np.float64]

SCREENED, STARTS, ITERATIONS = 256, 8, 14
"""Machines that are tried first, how many of them are followed up side by side, and for how many steps; calibrated on
training machines (``pytest -m slow tests/envs/test_identification.py``)."""

GENERATIONS = 5
"""How often starting points are followed up, the first time those of the screening, then those along valleys;
calibrated."""

VALLEYS, EACH, FRESH, ALONG = 2, 3, 6, 0.8
"""Starting points of a later generation: in how many valleys, how many in each, how many more of the screening; and how
far along a valley at most, in tolerances; assumed."""

ROUGH, FINE = (2e-3, 1e-4), (3e-4, 3e-5)
"""Errors of a share, at the first and the last step, that weigh a half: after the screening and along valleys;
assumed."""

EQUAL = 1e-6
"""Difference of shares that counts as none: some units in the last place of an observation; derived."""

REPEATED = 7
"""Observations of a record that a machine has to repeat: more than there are parameters; of a record from rest not all,
since a bounce more or less may count, of one of an experiment all; assumed."""

PROBE = 1e-6
"""Change of a factor, in tolerances, that derivatives are taken with; assumed."""

STEEP = 5.0
"""Derivative of a share by a factor in tolerances that is none: a jump lies in between; assumed."""

OTHER_BRANCH = 0.1
"""Error of a share that belongs to another number of impacts than was counted: near shares mean nothing there;
assumed."""

SMOOTH = 0.5
"""Share of the observations that has to change smoothly with the parameters for a search to make sense; assumed."""

FARTHEST = 0.3
"""Largest step of an iteration, in tolerances; assumed."""

DAMPING, EASED, HELD_BACK = 1e-5, 0.2, 6.0
"""Damping of the first step, as share of the mean curvature, and its factors after a step that gains and after one that
does not; assumed."""


class Record(NamedTuple):
    """Observations (n,) that a simulation from rest can repeat.

    ``cycles`` from rest to the end of the first of them, at its speed, if ``orbit`` is that observation's share alone;
    where it is those of several steps, the last ones up to it, a motion that repeats itself after so many steps, it has
    settled after ``cycles`` and goes on to the same phase. ``speeds`` of the steps; ``ratios`` of the clearance to that
    of the new machine during them; ``shares`` of the half cycle spent bouncing; ``impacts`` a cycle, nan where any
    number of them will do.
    """

    cycles: int
    orbit: Array
    speeds: Array
    ratios: Array
    shares: Array
    impacts: Array

    def of_any_number(self) -> "Record":
        """Return the record without its number of impacts."""
        return self._replace(impacts=np.full(len(self.shares), np.nan))


def machine_at(pool: Pool, point: Array) -> Machine:
    """Return the machine at a point (fields,) within the tolerances of a pool, new and at the lowest speed."""
    return pool.machine_with(1.0 + point * np.array(list(pool.tolerances.values())))


def point_of(pool: Pool, number: int) -> Array:
    """Return the point (fields,) within the tolerances of a pool that one of its machines is at."""
    return np.asarray((pool.drawn[number] - 1.0) / np.array(list(pool.tolerances.values())))


class MachineSearch:
    """A search among the machines within the tolerances, points (fields,) from -1 to 1, for one that repeats a record.

    Parameters
    ----------
    pool
        Whose nominal machine and tolerances are known.
    task
        That the record is of.
    record
        To be repeated.
    """

    def __init__(self, pool: Pool, task: Task, record: Record) -> None:
        self._pool, self._task, self.record = pool, task, record
        self._fields = len(pool.tolerances)
        self._felt: NDArray[np.bool_] = np.ones(self._fields, np.bool_)
        """Fields (fields,) that the record changes with at all: not those of a joint that the machine lacks."""

    def found(self) -> Array | None:
        """Return the point (fields,) that repeats the record; None if none is found. Shows progress after 2 s."""
        grid = self._spread(SCREENED)
        promising = grid[np.argsort(_cost(self.errors(grid), ROUGH[0]), kind="stable")]
        points, scales, ends = promising[:STARTS], ROUGH, list[_End]()
        self._felt = np.asarray(self._slopes(points, self.errors(points)).any(axis=(0, 1)))
        if not self._felt.any():
            return None
        generator = np.random.default_rng(0)
        for generation in tqdm(range(GENERATIONS), desc="identification", unit="round", leave=False, delay=2.0):
            ends += self._descend(points, np.geomspace(*scales, ITERATIONS))
            ends.sort(key=lambda end: end.cost)
            if hits := [end.point for end in ends if end.repeated >= REPEATED]:
                return self._descend(np.array(hits[:1]), np.full(ITERATIONS, EQUAL))[0].point
            lengths = generator.uniform(-ALONG, ALONG, (VALLEYS, EACH, 1))
            along = [end.point + length * end.valley for end, length in zip(ends, lengths, strict=False)]
            fresh = STARTS + generation * FRESH
            points = np.clip(np.vstack([*along, promising[fresh : fresh + FRESH]]), -1.0, 1.0)
            scales = FINE
        return None

    def is_smooth(self) -> bool:
        """Whether most shares of the record change smoothly with the parameters of most machines."""
        points = self._spread(STARTS)
        slopes = self._slopes(points, self.errors(points))
        return bool(np.median(slopes.any(axis=2).mean(axis=1)) >= SMOOTH)

    def errors(self, points: Array) -> Array:
        """Simulated less observed shares of machines at points (k, fields), (k, n); those of another number of impacts
        than was counted are ``OTHER_BRANCH``."""
        shares, impacts = self._simulated(points)
        differ = np.abs(impacts - self.record.impacts) > 0.5 / self._task.cycles_per_step
        return np.where(differ, OTHER_BRANCH, shares - self.record.shares)

    def _simulated(self, points: Array) -> tuple[Array, Array]:
        """Shares and impacts a cycle of machines at points (k, fields) in the steps of the record, (k, n) each."""
        record, machines = self.record, [machine_at(self._pool, point) for point in points]
        batch, which = batch_of(machines[0], len(machines)), np.arange(len(machines))
        shares = np.empty((len(machines), len(record.shares)))
        impacts = np.empty_like(shares)
        for step, (speed, ratio) in enumerate(zip(record.speeds.tolist(), record.ratios.tolist(), strict=True)):
            if step == 0 or ratio != record.ratios[step - 1]:
                put = batch.change if step else batch.start
                for place, machine in enumerate(machines):
                    put(place, at_speed(worn(machine, ratio) if self._pool.wears else machine, speed))
            batch.set_speeds(which, np.full(len(which), speed))
            if step == 0:
                self._begin(batch)
            cycles = batch.run(which, self._task.cycles_per_step)
            shares[:, step], impacts[:, step] = self._observed(cycles, speed)
        return shares, impacts

    def _begin(self, batch: Batch) -> None:
        """Run machines from rest to the beginning of the first observation, at the phase that fits the orbit best."""
        orbit, each, all_of_them = self.record.orbit, self._task.cycles_per_step, np.arange(len(batch))
        if len(orbit) == 1:
            batch.run(all_of_them, self.record.cycles - each)
            return
        period = each * len(orbit)
        cycles = batch.run(all_of_them, self.record.cycles + 2 * period - 1)
        ends = self.record.cycles + np.arange(period)[:, None] + each * (1 + np.arange(len(orbit)))
        shares = [[self._observed(cycles.until(end), self.record.speeds[0])[0] for end in row] for row in ends.tolist()]
        fitting = np.abs(np.array(shares) - orbit[:, None]).max(axis=1).argmin(axis=0)
        for phase in range(period):
            # from the end of the last phase to the same point of a later period, but for the step to be observed
            batch.run(np.flatnonzero(fitting == phase), (phase + 1 - each) % period)

    def _observed(self, cycles: Cycles, speed: float) -> tuple[Array, Array]:
        """Shares and impacts a cycle (k,) of the last step of k machines."""
        each = self._task.cycles_per_step
        period = self._pool.nominal.period_at(speed)
        return bouncing_share(cycles, each, period), impacts_per_cycle(cycles, each)

    def _spread(self, count: int) -> Array:
        """Points (count, fields) that cover the tolerances."""
        return np.asarray(2.0 * qmc.Sobol(self._fields, seed=len(self.record.speeds)).random(count) - 1.0)

    def _descend(self, points: Array, scales: Array) -> "list[_End]":
        """Go down from points (k, fields) side by side, with errors of ``scales`` in turn that weigh a half."""
        errors = self.errors(points)
        slopes = self._slopes(points, errors)
        damping = np.full(len(points), DAMPING)
        for scale in scales:
            trial = np.clip(points + _steps(errors, slopes, scale, damping), -1.0, 1.0)
            found = self.errors(trial)
            better = _cost(found, scale) < _cost(errors, scale)
            points, errors = np.where(better[:, None], trial, points), np.where(better[:, None], found, errors)
            slopes[better] = self._slopes(points[better], errors[better])
            damping *= np.where(better, EASED, HELD_BACK)
            if scale > EQUAL and (_repeated(errors) >= REPEATED).any():
                break
        costs = _cost(errors, FINE[1])
        return [_End(*each) for each in zip(costs.tolist(), _repeated(errors).tolist(), points, slopes, strict=True)]

    def _slopes(self, points: Array, errors: Array) -> Array:
        """Derivatives (k, n, fields) of the errors (k, n) at points (k, fields), zero across jumps."""
        slopes = np.zeros((*errors.shape, self._fields))
        if len(points):
            probes = points[:, None] + PROBE * np.eye(self._fields)[self._felt]
            beside = self.errors(probes.reshape(-1, self._fields)).reshape(*probes.shape[:2], -1)
            slopes[:, :, self._felt] = (beside - errors[:, None]).transpose(0, 2, 1) / PROBE
        return np.where(np.abs(slopes).max(axis=2, keepdims=True) < STEEP, slopes, 0.0)


class _End(NamedTuple):
    """Where a descent ended: its cost, how many observations are repeated, the point (fields,), and slopes there."""

    cost: float
    repeated: int
    point: Array
    slopes: Array

    @property
    def valley(self) -> Array:
        """Direction (fields,) in which the record changes least, among parameters that it changes with at all."""
        felt = np.asarray(self.slopes.any(axis=0))
        direction = np.zeros(len(felt))
        if felt.any():
            direction[felt] = np.linalg.svd(self.slopes[:, felt])[2][-1]
        return direction


def _repeated(errors: Array) -> NDArray[np.int64]:
    """How many of the observations are repeated, (k,) of errors (k, n)."""
    return np.asarray(np.count_nonzero(np.abs(errors) < EQUAL, axis=1))


def _cost(errors: Array, scale: float) -> Array:
    """Cauchy's robust cost (k,) of errors (k, n)."""
    return np.asarray(np.log1p((errors / scale) ** 2).sum(axis=1))


def _steps(errors: Array, slopes: Array, scale: float, damping: Array) -> Array:
    """Levenberg-Marquardt steps (k, fields) under Cauchy weights, with a damping (k,) as share of mean curvatures."""
    weighted = (slopes / (1.0 + (errors / scale) ** 2)[:, :, None]).transpose(0, 2, 1)
    curvature = weighted @ slopes
    held = damping * np.trace(curvature, axis1=1, axis2=2) / slopes.shape[2] + 1e-17
    curvature += held[:, None, None] * np.eye(slopes.shape[2])
    steps = -np.linalg.solve(curvature, weighted @ errors[:, :, None])[:, :, 0]
    return np.asarray(steps * np.minimum(1.0, FARTHEST / np.maximum(np.abs(steps).max(axis=1), 1e-30))[:, None])
