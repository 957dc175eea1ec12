"""Which machine is it? A job goes on, with experiments on the way, until a machine is found that repeats them.

A record can be repeated in simulation where the motion before it is known: from rest, if machines move regularly there,
or from an orbit that the motion has settled on. Small changes of speed from such an orbit are an experiment. Where the
motion does not settle, other speeds are tried.

References
----------
L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall, 1999, chapter 13 (experiment design).
"""

import numpy as np
from numpy.typing import NDArray

from chaosgym.envs.jobs import RUN_IN_CYCLES
from chaosgym.envs.machine_search import EQUAL, MachineSearch, Record, machine_at
from chaosgym.envs.observation import BOUNCING, LAST_ACTION, REMAINING, SPEED, Observation
from chaosgym.envs.pools import Pool
from chaosgym.envs.tasks import Task
from chaosgym.machines.machine import Machine

Array = NDArray[np.float64]

FROM_REST = (9, 17)
"""Observations after which the machine is looked for by its record from rest; assumed."""

SETTLING_CYCLES = 60
"""Cycles from rest after which a machine is taken to have settled where the one observed has; calibrated: enough for
most training cranks to repeat what they did."""

EXPERIMENT = (-1, 0, 0, 1, 0, 0, -2, 0, 0, 2, 0)
"""Speeds of the steps after the motion has settled, as changes from there in quarters of the slew limit; calibrated on
training cranks: after longer stays elsewhere fewer of them come back to what can be repeated."""

EXPERIMENTS = 3
"""Experiments of a job at most, each at another speed; assumed."""

WORTHWHILE = 50
"""Steps that a job must still have for an experiment, or a search for a place for it; assumed."""

PATIENCE, HELD, LONGEST = 6, 4, 5
"""Steps at one speed without a sign of settling after which other speeds are tried, how many steps each of them is
held, and the longest pattern, in steps, that is a sign; assumed."""

PRECISION, ALIKE = 1e-6, 8
"""Usual error of estimates, in tolerances, calibrated on training beams, and how many machines stand for what is
possible within it, assumed."""


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
        Deviation of each field from its nominal value, in tolerances; None as long as none repeats a record.
    target : float or None
        Speed that an experiment, or the way to one, asks for next, if any; who goes elsewhere ends it.
    """

    def __init__(self, pool: Pool, task: Task) -> None:
        self._pool, self._task = pool, task
        self.start()

    def start(self) -> None:
        """Forget the last job."""
        self.estimate: Array | None = None
        self.target: float | None = None
        self._speeds: list[float] = []
        self._ratios: list[float] = []
        self._shares: list[float] = []
        self._experiment: int | None = None
        self._sweep = 0.0
        self._tried: set[float] = set()

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
        self._note(observation)
        if self.estimate is not None:
            return []
        if self.target is not None and not np.isclose(self._speeds[-1], self.target, rtol=1e-6):
            self._experiment, self._sweep = None, 0.0
        if search := self._search_from_rest() or self._search_by_experiment():
            self.estimate = search.found()
        left = float(observation[REMAINING]) * self._task.steps
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

    def _search_from_rest(self) -> MachineSearch | None:
        """Return a search by the record of the whole job, if it is time and machines move regularly from rest."""
        if len(self._speeds) not in FROM_REST:
            return None
        search = self._search(0, max(RUN_IN_CYCLES, self._task.cycles_per_step))
        return search if search.is_smooth() else None

    def _search_by_experiment(self) -> MachineSearch | None:
        """Return a search by the record of an experiment, if one is done."""
        if self._experiment is None or len(self._speeds) <= self._experiment + len(EXPERIMENT):
            return None
        first, self._experiment = self._experiment, None
        return self._search(first, SETTLING_CYCLES)

    def _wanted(self) -> float | None:
        """Speed to go to next: that of the experiment, or where an experiment may become possible."""
        if self._experiment is None and self._is_settled and len(self._tried) < EXPERIMENTS:
            self._experiment = len(self._speeds) - 1
            self._tried.add(self._speeds[-1])
        if self._experiment is not None:
            self._sweep = 0.0
            change = EXPERIMENT[len(self._speeds) - 1 - self._experiment] * self._pool.drive.slew_limit / 4.0
            return self._commanded(self._speeds[self._experiment] + change)
        if self._has_pattern:
            return None
        if self._held >= (HELD if self._sweep else PATIENCE):
            return self._commanded(self._next_of_sweep())
        return self._speeds[-1] if self._sweep else None

    def _next_of_sweep(self) -> float:
        """Speed after the present one: up to the highest, and back down between the speeds of the way up."""
        drive = self._pool.drive
        self._sweep = self._sweep or drive.slew_limit
        if self._speeds[-1] >= drive.highest_speed and self._sweep > 0.0:
            self._sweep = -drive.slew_limit
            return self._speeds[-1] - 0.5 * drive.slew_limit
        return self._speeds[-1] + self._sweep

    def _commanded(self, speed: float) -> float:
        drive = self._pool.drive
        return float(drive.rounded(np.clip(speed, drive.lowest_speed, drive.highest_speed)))

    @property
    def _held(self) -> int:
        """Steps at the present speed without a break."""
        held = 0
        while held < len(self._speeds) and self._speeds[-1 - held] == self._speeds[-1]:
            held += 1
        return held

    @property
    def _is_settled(self) -> bool:
        """Whether the motion repeats itself step by step, at a speed where no experiment has been made."""
        steady = self._held > 1 and abs(self._shares[-1] - self._shares[-2]) < EQUAL
        return steady and self._speeds[-1] not in self._tried

    @property
    def _has_pattern(self) -> bool:
        """Whether the motion repeats itself after some steps at the present speed."""
        before = np.array(self._shares[-self._held :][:-1][-LONGEST:])
        return bool((np.abs(before - self._shares[-1]) < EQUAL).any())

    def _search(self, first: int, cycles: int) -> MachineSearch:
        """Search by the record from an observation on, at whose end the machine has run for some cycles from rest."""
        before = [self._ratios[max(first - 1, 0)], *self._ratios[first:-1]]
        speeds, shares = np.array(self._speeds[first:]), np.array(self._shares[first:])
        return MachineSearch(self._pool, self._task, Record(cycles, speeds, np.array(before), shares))
