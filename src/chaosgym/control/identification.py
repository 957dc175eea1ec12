"""Which machine is it? A job goes on, with experiments on the way, until a machine is found that repeats them.

A record can be repeated in simulation where the motion before it is known: from rest, if machines move regularly there,
or from an orbit that the motion has settled on. A stay a little beside the speed of such an orbit is an experiment:
where the motion settles there too, its shares change smoothly with the parameters and the search is short.

References
----------
L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall, 1999, chapter 13 (experiment design).
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from chaosgym.control.machine_search import EQUAL, MachineSearch, Record, machine_at
from chaosgym.envs.jobs import RUN_IN_CYCLES
from chaosgym.envs.observation import BOUNCING, IMPACTS, LAST_ACTION, REMAINING, SPEED, Observation
from chaosgym.envs.pools import Pool
from chaosgym.envs.tasks import Task
from chaosgym.machines.machine import Machine

Array = NDArray[np.float64]

FROM_REST = (9, 17)
"""Observations after which the machine is looked for by its record from rest; assumed."""

SETTLING_CYCLES = 60
"""Cycles from rest after which a machine is taken to have settled where the one observed has; calibrated: enough for
most training cranks to repeat what they did."""

STAY = 3
"""Steps of an experiment beside the speed of the orbit, and then as many back at it; calibrated on training cranks:
most settle within two."""

EXPERIMENT = (1,) * STAY + (0,) * STAY
"""Speeds of the steps after the motion has settled, as changes from there in quarters of the slew limit."""

SIDES = (-1, 1)
"""Factors of an experiment, the first one first: a speed is left downwards, and upwards if no machine is found;
assumed."""

EXPERIMENTS = 6
"""Experiments of a job at most; assumed."""

WORTHWHILE = 50
"""Steps that a job must still have for an experiment; assumed."""

LONGEST = 4
"""Longest period in steps of an orbit that an experiment begins on; assumed."""

PRECISION, ALIKE = 1e-6, 8
"""Usual error of estimates, in tolerances, calibrated on training beams, and how many machines stand for what is
possible within it, assumed."""


@lru_cache(maxsize=16)
def is_regular_from_rest(pool: Pool, task: Task) -> bool:
    """Whether what most machines of a pool do in the first steps of full acceleration changes smoothly with them."""
    drive = pool.drive
    speeds = np.minimum(drive.lowest_speed + drive.slew_limit * np.arange(FROM_REST[0]), drive.highest_speed)
    none, new = np.zeros(len(speeds)), np.ones(len(speeds))
    record = Record(_run_in(task), none[:1], speeds, new, none, none).of_any_number()
    return MachineSearch(pool, task, record).is_smooth()


def _run_in(task: Task) -> int:
    """Cycles from rest to the end of the first observation of a job."""
    return max(RUN_IN_CYCLES, task.cycles_per_step)


class Identification:
    """The machine of one job, as a point within the tolerances.

    Parameters
    ----------
    pool
        Whose nominal machine and tolerances are known; nothing is looked for where it has one machine alone.
    task
        Of the job.
    truth : (fields,), optional
        What a search comes to; searched by default.

    Attributes
    ----------
    estimate : (fields,) or None
        Deviation of each field from its nominal value, in tolerances; None as long as none repeats a record.
    target : float or None
        Speed that an experiment asks for next, if there is one; who goes elsewhere ends it.
    failed : set of float
        Speeds on both sides of which experiments have failed, as long as more can be made elsewhere.
    """

    def __init__(self, pool: Pool, task: Task, truth: Array | None = None) -> None:
        self._pool, self._task, self._truth = pool, task, truth
        self._is_needless = len(pool.possible) == 1
        self.start()

    def start(self) -> None:
        """Forget the last job."""
        self.estimate: Array | None = None
        self.target: float | None = None
        self.failed: set[float] = set()
        self._speeds: list[float] = []
        self._ratios: list[float] = []
        self._shares: list[float] = []
        self._impacts: list[float] = []
        self._experiment: int | None = None
        self._period = self._side = 1
        self._tried: set[tuple[float, int]] = set()

    @property
    def machines(self) -> list[Machine]:
        """Machines that the record does not tell apart, the most probable one first; none if none repeats it.

        Each is new and at the lowest speed. They are ``ALIKE``, at the distance by which estimates err.
        """
        if self.estimate is None:
            return []
        shares = np.random.default_rng(0).uniform(-1.0, 1.0, (ALIKE - 1, len(self.estimate)))
        return [machine_at(self._pool, point) for point in [self.estimate, *(self.estimate + PRECISION * shares)]]

    def add(self, observation: Observation) -> list[Machine]:
        """Take in an observation (d,) and look for the machine if it is time to; return ``machines`` if found now."""
        if self._is_needless or self.estimate is not None:
            return []
        self._note(observation)
        if self.target is not None and abs(self._speeds[-1] - self.target) > 1e-6 * self.target:
            self._experiment = None
        experiment = self._experiment
        if record := self._due():
            search = MachineSearch(self._pool, self._task, record)
            self.estimate = search.found() if self._truth is None else self._truth
        if experiment is not None and self._experiment is None and not self._untried(self._speeds[experiment]):
            self.failed.add(self._speeds[experiment])
        left = float(observation[REMAINING]) * self._task.steps
        if self.estimate is not None or left <= WORTHWHILE or self._is_used_up:
            self.failed.clear()
        self.target = self._wanted() if self.estimate is None and left > WORTHWHILE else None
        return self.machines

    def _note(self, observation: Observation) -> None:
        drive = self._pool.drive
        if self._speeds:
            target = drive.target_of(observation[[LAST_ACTION]])[1]
            self._speeds.append(float(drive.approach(self._speeds[-1], target)))
        else:
            self._speeds.append(float(drive.rounded(float(observation[SPEED]))))
        self._ratios.append(1.0 + float(observation[-1]) if self._pool.wears else 1.0)
        self._shares.append(float(observation[BOUNCING]))
        self._impacts.append(float(observation[IMPACTS]))

    def _due(self) -> Record | None:
        """Return what to search by now: the record of the whole job, if it is time and machines move regularly from
        rest, or that of an experiment that is done."""
        if len(self._speeds) in FROM_REST and is_regular_from_rest(self._pool, self._task):
            # impacts are not compared from rest: the published comparisons of the beams were made without
            return self._record(0, _run_in(self._task)).of_any_number()
        if self._experiment is None or len(self._speeds) <= self._experiment + len(EXPERIMENT):
            return None
        first, self._experiment = self._experiment, None
        return self._record(first, SETTLING_CYCLES, self._period)

    def _wanted(self) -> float | None:
        """Speed to go to next: that of an experiment, which begins as soon as the motion has settled."""
        if self._experiment is None:
            period, speed = self._period_of_steps, self._speeds[-1]
            sides = self._untried(speed)
            if period is None or not sides or self._is_used_up:
                return None
            self._experiment, self._period, self._side = len(self._speeds) - 1, period, sides[0]
            self._tried.add((speed, sides[0]))
        change = EXPERIMENT[len(self._speeds) - 1 - self._experiment] * self._side
        return self._beside(self._speeds[self._experiment], change)

    @property
    def _is_used_up(self) -> bool:
        """Whether as many experiments have been made as a job may have, and none is going on."""
        return self._experiment is None and len(self._tried) == EXPERIMENTS

    def _untried(self, speed: float) -> list[int]:
        """Sides of a speed, as far as the drive goes, that no experiment has been made on."""
        return [side for side in SIDES if (speed, side) not in self._tried and self._beside(speed, side) != speed]

    def _beside(self, speed: float, change: int) -> float:
        """Speed that is some quarters of the slew limit beside another, as far as the drive goes."""
        drive = self._pool.drive
        beside = speed + change * drive.slew_limit / 4.0
        return float(drive.rounded(np.clip(beside, drive.lowest_speed, drive.highest_speed)))

    @property
    def _period_of_steps(self) -> int | None:
        """After how many steps at the present speed the motion repeats itself; None if it does not."""
        for period in range(1, min(LONGEST, len(self._speeds) - 1) + 1):
            stays = len(set(self._speeds[-1 - period :])) == 1
            if stays and abs(self._shares[-1] - self._shares[-1 - period]) < EQUAL:
                return period
        return None

    def _record(self, first: int, cycles: int, period: int = 1) -> Record:
        """Return the record from an observation on, at whose end the machine has run for some cycles from rest, or
        where it has settled by then on an orbit of some steps."""
        before = [self._ratios[max(first - 1, 0)], *self._ratios[first:-1]]
        orbit = np.array(self._shares[first + 1 - period : first + 1])
        seen = (self._speeds[first:], before, self._shares[first:], self._impacts[first:])
        return Record(cycles, orbit, *map(np.array, seen))
