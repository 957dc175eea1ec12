"""At which speeds does a hidden machine run calmly? A belief over its map of speeds, from what was felt so far.

The machine is one like those of the training pool, whose regime tables are known; where it wears, at the clearance that
it has by now. Every step makes those machines more probable that are calm or irregular where this one is, and that
strike as hard; and what was felt at a speed itself counts there in any case, since no two machines have the same map.
A motion that settles repeats the share of bouncing, which has no sensor error; in the first step at a speed, and where
the clearance grows, the scatter of the peaks has to tell. The best schedule of the expected map is a plan.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import entropy

from chaosgym.control.forecast import forecast_of
from chaosgym.envs.observation import BOUNCING, FIRST_PEAK, REMAINING, SPEED, Observation
from chaosgym.envs.pools import Pool
from chaosgym.envs.regimes import RegimeTable, nearest
from chaosgym.envs.tasks import Task

Array = NDArray[np.float64]
Places = NDArray[np.int64]

SCATTER = (0.5, 1.5, 2.5, 3.5, 5.0, 7.5, 12.0)
"""Standard deviations [N] of a step's peaks at which a ``Sense`` is known; in between it is interpolated."""


DIFFERENCE = (1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
"""Differences of the share spent bouncing from that of an earlier step at which a ``Sense`` is known; in between it is
interpolated by their logarithm."""

COMPARED = 5
"""Steps back with which a share is compared: a motion that repeats itself after so many is periodic; assumed."""


class Sense(NamedTuple):
    """What a step tells, under the sensor error of the environments.

    By how much do the log odds of Type III change? ``moving`` and ``staying`` say it by the scatter of the peaks, at
    ``SCATTER``, when the speed has just changed and later. Where the clearance does not grow, ``repeating`` says it
    instead of ``staying``, by how closely the share spent bouncing repeats, at ``DIFFERENCE``: a row for the first
    step that can be compared, one for the second, and one for all later ones. ``force_error`` [N] is the error of the
    mean peak as a measure of the table's force.
    """

    moving: tuple[float, ...]
    staying: tuple[float, ...]
    repeating: tuple[tuple[float, ...], ...]
    force_error: float


SENSES = {
    "impact-beam": Sense(
        moving=(-1.9, -1.5, -0.5, 0.6, 1.4, 2.0, 2.3),
        staying=(-1.6, -1.4, 0.2, 1.7, 2.3, 2.8, 3.5),
        repeating=(
            (-3.9, -3.7, -2.6, -2.1, -2.1, -1.4, 0.3),
            (-3.9, -3.9, -3.9, -2.1, -0.7, 1.2, 2.8),
            (-2.2, -1.1, -0.6, 0.9, 2.5, 3.5, 3.9),
        ),
        force_error=6.0,
    ),
    "slider-crank": Sense(
        moving=(-0.8, -0.4, 0.6, 0.7, 1.2, 3.7, 3.7),
        staying=(-0.8, -0.5, 1.5, 1.5, 1.5, 3.9, 3.9),
        repeating=(
            (-3.0, -3.0, -3.0, -2.6, -1.9, -1.0, 0.6),
            (-2.3, -2.3, -2.1, -1.9, -0.8, 0.0, 1.6),
            (-2.0, -1.2, -0.6, 0.1, 1.1, 2.9, 3.5),
        ),
        force_error=3.0,
    ),
}
"""Calibrated on the training pools, rounded from what ``agents/calibrate_belief.py`` counts. Those of the scatter on
the beam are somewhat more careful, those of the first comparison on the crank end at -3, and both errors of the force
are larger: the score of the plan on the training pool does not tell 4 from 9 N on the beam, or 1.5 from 3 N on the
crank."""

TEMPERATURE = 2.0
"""By which the evidence of a step for a machine is divided: steps at one speed are not independent. Calibrated: from 1
to 3 the score on the beam's training pool is the same within 0.08."""

FORCE_LIMIT = 6.0
"""Squared error, in units of its variance, above which a force surprises no more; assumed."""

LOCAL, NEIGHBOUR = 0.5, 0.25
"""Share of the evidence that counts at the speed itself, and of that at the neighbouring speeds of the table;
calibrated: 0.25 to 1 score the same within 0.08."""

CERTAIN = (-3.0, 5.0)
"""Limits of the log odds that a speed gathers by itself; assumed."""

DOUBTS = (0.02, 0.98)
"""Limits of the probability that the tables alone give: no table is that of the machine at hand; assumed."""

WORST = -10.0
"""Least worth that a learner is told of, in steps of Type III; assumed."""

UNHEARD_OF = 1_000.0
"""Force [N] in place of that of a motion that could not be followed."""

HORIZON = 60
"""Steps that a plan looks ahead: more than the drive needs to reach any speed."""


class Plan(NamedTuple):
    """What is believed and what is best, of n jobs.

    ``irregular`` (n, speeds) probability of Type III; ``gathered`` (n, speeds) log odds of it that were felt at the
    speed itself; ``worth`` (n, speeds) of a step at a speed of the table and of the best ones after it; ``place`` (n,)
    where each job is, ``target`` (n,) the place in reach that is worth most; ``doubt`` (n,) entropy of the machine's
    identity, from 0 to 1.
    """

    irregular: Array
    gathered: Array
    worth: Array
    place: Places
    target: Places
    doubt: Array


class SpeedBelief:
    """Beliefs of n jobs side by side.

    Parameters
    ----------
    pool
        Machines that are possible, with their tables.
    task
        What their steps are worth.
    """

    def __init__(self, pool: Pool, task: Task) -> None:
        self._pool, self._task, self._sense = pool, task, SENSES[pool.nominal.name]
        # speeds, moves and times are the same for all
        self._forecast, self._levels = forecast_of(pool, pool.regimes(0), task), pool.levels
        # by machine, clearance and speed
        self._tables = [self._of_tables(pool.regimes(k)) for k in range(len(pool))]
        self._stack()
        self._machine, self._local = np.zeros((0, len(pool))), np.zeros((0, len(self.speeds)))
        self._last, self._shares, self._known = np.zeros(0), np.zeros((0, COMPARED)), np.zeros(0, np.bool_)
        self._distrusted = np.zeros((0, len(self.speeds)), np.bool_)

    def _of_tables(self, tables: Sequence[RegimeTable]) -> Array:
        """Type III, force [N] and loss by wear of a machine by clearance and speed, (3, levels, speeds)."""
        forecast = forecast_of(self._pool, tables, self._task)
        wear = forecast.damage_weight * forecast.wear[forecast.level_of(self._levels - 1.0)]
        force = np.minimum([table.equivalent_force for table in tables], UNHEARD_OF)
        return np.array([np.array([table.type_iii for table in tables]), force, wear])

    def _stack(self) -> None:
        self._type_iii, self._force, self._wear = np.array(self._tables).swapaxes(0, 1)

    @property
    def speeds(self) -> Array:
        """Of the map, (n,)."""
        return self._forecast.speeds

    def know(self, job: int, machine: int) -> None:
        """Be certain from now on that a job runs a machine of the pool, whatever is felt."""
        self._known[job], self._machine[job] = True, -np.inf
        self._machine[job, machine] = 0.0

    def know_tables(self, job: int, tables: Sequence[RegimeTable]) -> None:
        """Be certain from now on that a job runs a machine with these tables, one for each clearance."""
        self._tables.append(self._of_tables(tables))
        self._stack()
        self._machine = np.pad(self._machine, ((0, 0), (0, 1)), constant_values=-np.inf)
        self.know(job, len(self._tables) - 1)

    def distrust(self, job: int, speeds: Iterable[float]) -> None:
        """Reckon with Type III at these speeds and no others, whatever is felt there, until the machine is known."""
        self._distrusted[job] = False
        for speed in speeds:
            self._distrusted[job, self._forecast.place_of(np.array([speed]))] = True

    def start(self, observations: Observation, excluded: Places | None = None) -> Plan:
        """Begin n jobs with their first observations (n, d); ``excluded`` (n,) are machines that can't be the one."""
        count = len(observations)
        del self._tables[len(self._pool) :]
        self._stack()
        self._machine = np.zeros((count, len(self._tables)))
        self._local = np.zeros((count, len(self.speeds)))
        self._last, self._shares, self._known = np.zeros(count), np.zeros((count, COMPARED)), np.zeros(count, np.bool_)
        self._distrusted = np.zeros((count, len(self.speeds)), np.bool_)
        return self.restart(np.ones(count, np.bool_), observations, excluded)

    def restart(self, which: NDArray[np.bool_], observations: Observation, excluded: Places | None = None) -> Plan:
        """Begin k of the jobs anew, ``which`` (n,), with observations (k, d) and ``excluded`` (k,); plans of these."""
        jobs = np.flatnonzero(which)
        self._machine[jobs], self._local[jobs], self._last[jobs], self._known[jobs] = 0.0, 0.0, np.nan, False
        self._distrusted[jobs] = False
        self._machine[jobs, len(self._pool) :] = -np.inf
        if excluded is not None:
            self._machine[jobs, excluded] = -np.inf
        self._learn(jobs, observations)
        return self._plan(jobs, observations)

    def features(self, plan: Plan) -> Array:
        """Return what a learner is told of plans, (n, count): for each place in reach, its probability of Type III,
        what was felt there, and its worth less the largest in steps of Type III; the target's place; the doubt."""
        near, inside = self._within_reach(plan.place)
        irregular, gathered, worth = (
            np.take_along_axis(values, near, axis=1) for values in (plan.irregular, plan.gathered, plan.worth)
        )
        worth = (worth - worth.max(axis=1, keepdims=True)) / self._task.type_iii_step
        beyond = (~inside).astype(float)
        ahead = (plan.target - plan.place) / self._forecast.moves
        columns = [np.maximum(irregular, beyond), gathered / CERTAIN[1], np.maximum(worth, WORST) + WORST * beyond]
        return np.concatenate([*columns, ahead[:, None], plan.doubt[:, None]], axis=1)

    @property
    def feature_bounds(self) -> tuple[Array, Array]:
        """Lowest and highest features, (count,) each."""
        reach = 2 * self._forecast.moves + 1
        low = np.repeat([0.0, CERTAIN[0] / CERTAIN[1], 2.0 * WORST], reach)
        high = np.repeat([1.0, 1.0, 0.0], reach)
        return np.append(low, [-1.0, 0.0]), np.append(high, [1.0, 1.0])

    def add(self, observations: Observation) -> Plan:
        """Take in the observations (n, d) of a step."""
        jobs = np.arange(len(observations))
        self._learn(jobs, observations)
        return self._plan(jobs, observations)

    def _learn(self, jobs: Places, observations: Observation) -> None:
        speed = observations[:, SPEED]
        peaks = observations[:, FIRST_PEAK : FIRST_PEAK + self._task.cycles_per_step].astype(float)
        place, moved = self._forecast.place_of(speed), speed != self._last[jobs]
        self._last[jobs] = speed
        odds = self._odds(jobs, moved, peaks.std(axis=1), observations[:, BOUNCING].astype(float))
        level = self._level_of(observations)
        surprise = ((peaks.mean(axis=1)[:, None] - self._force[:, level, place].T) / self._sense.force_error) ** 2
        evidence = odds[:, None] * self._type_iii[:, level, place].T - 0.5 * np.minimum(surprise, FORCE_LIMIT)
        self._machine[jobs] += evidence / TEMPERATURE
        for offset, share in ((-1, NEIGHBOUR), (0, 1.0), (1, NEIGHBOUR)):
            at, inside = place + offset, (place + offset >= 0) & (place + offset < len(self.speeds))
            self._local[jobs[inside], at[inside]] += LOCAL * share * odds[inside]
        np.clip(self._local, *CERTAIN, out=self._local)

    def _odds(self, jobs: Places, moved: NDArray[np.bool_], scatter: Array, share: Array) -> Array:
        """By how much the log odds of Type III change (k,), with the scatter of peaks and the shares of bouncing."""
        sense, before = self._sense, self._shares[jobs]
        before[moved] = np.nan
        self._shares[jobs] = np.column_stack([share, before[:, :-1]])
        arriving = np.interp(scatter, SCATTER, sense.moving)
        if len(self._levels) > 1:
            return np.where(moved, arriving, np.interp(scatter, SCATTER, sense.staying))
        difference = np.fmin.reduce(np.abs(before - share[:, None]), axis=1)
        closeness = np.log10(np.maximum(difference, DIFFERENCE[0]))
        staying = np.array([np.interp(closeness, np.log10(DIFFERENCE), row) for row in sense.repeating])
        compared = np.count_nonzero(np.isfinite(before), axis=1)
        row = np.clip(compared - 1, 0, len(staying) - 1)
        return np.where(compared == 0, arriving, staying[row, np.arange(len(jobs))])

    def _plan(self, jobs: Places, observations: Observation) -> Plan:
        """Best schedules of the expected maps, of jobs (k,) with observations (k, d)."""
        score, gathered = self._machine[jobs], np.where(self._distrusted[jobs], CERTAIN[1], self._local[jobs])
        gathered[self._known[jobs]] = 0.0
        weight = np.exp(score - score.max(axis=1, keepdims=True))
        weight /= weight.sum(axis=1, keepdims=True)
        level = self._level_of(observations)
        chance = np.clip(_expected(weight, self._type_iii, level), *DOUBTS)
        irregular = 1.0 / (1.0 + (1.0 / chance - 1.0) * np.exp(-gathered))
        wear = _expected(weight, self._wear, level)
        reward = self._forecast.time - self._task.type_iii_step * irregular - wear
        left = np.rint(observations[:, REMAINING].astype(float) * self._task.steps)
        worth = reward.copy()
        for step in range(1, min(HORIZON, int(left.max()))):
            ahead = reward + self._forecast.best_within_reach(worth)
            worth = np.where((step < left)[:, None], ahead, worth)
        place = self._forecast.place_of(observations[:, SPEED])
        near, inside = self._within_reach(place)
        best = np.where(inside, np.take_along_axis(worth, near, axis=1), -np.inf).argmax(axis=1)
        doubt = entropy(weight, axis=1) / np.log(max(len(self._pool), 2))
        return Plan(irregular, gathered, worth, place, place - self._forecast.moves + best, doubt)

    def _level_of(self, observations: Observation) -> Places:
        """Place of each clearance among those of the tables, by the damage that is observed where it grows."""
        if len(self._levels) == 1:
            return np.zeros(len(observations), np.int64)
        return nearest(self._levels, 1.0 + observations[:, -1])

    def _within_reach(self, place: Places) -> tuple[Places, NDArray[np.bool_]]:
        """Places that a step reaches from places (n,), (n, reach), and which lie inside; others are the ends."""
        reach = place[:, None] + np.arange(-self._forecast.moves, self._forecast.moves + 1)
        near = np.clip(reach, 0, len(self.speeds) - 1)
        return near, reach == near


def _expected(weight: Array, values: Array, level: Places) -> Array:
    """Mean of values (machines, levels, speeds) by weights (k, machines), at a level for each of the k."""
    mean = np.empty((len(weight), values.shape[2]))
    for each in np.unique(level):
        mean[level == each] = weight[level == each] @ values[:, each]
    return mean
