"""How do jobs go on? The bookkeeping of machines at work, whether one runs or a thousand side by side."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from chaosgym.envs.drive import SpeedDrive
from chaosgym.envs.observation import Observation, observe, sensor_readings
from chaosgym.envs.pools import Pool, worn
from chaosgym.envs.regimes import RegimeTable, nearest
from chaosgym.envs.tasks import Status, Step, Task
from chaosgym.errors import SimulationError
from chaosgym.machines.machine import Machine
from chaosgym.simulation.batch import Batch, Cycles, at_speed

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Generators = Sequence[np.random.Generator]

RUN_IN_CYCLES = 20
"""Cycles at the starting speed before the job begins; at least a step."""


class Rules(NamedTuple):
    """What all jobs have in common.

    ``machine`` the nominal one; ``drive``; ``task``; ``space`` of an observation; ``pool`` of the machines;
    ``sensor_error`` [N] half width of the error of a measured peak.
    """

    machine: Machine
    drive: SpeedDrive
    task: Task
    space: Box
    pool: Pool
    sensor_error: float


class Outcome(NamedTuple):
    """What a step of k jobs gave: (k, ...) observations, (k,) rewards, (k,) whether they ended, and info by name."""

    observation: Observation
    reward: Array
    terminated: NDArray[np.bool_]
    info: dict[str, NDArray[Any]]


def bouncing_share(cycles: Cycles, last: int, period: Any) -> Array:
    """Share of the half cycle that k machines spent bouncing on one side in their ``last`` cycles of a period [s]."""
    duration = cycles.bounce_duration[:, -last:]
    return np.asarray(2.0 * duration.reshape(len(duration), math.prod(duration.shape[1:])).mean(axis=1) / period)


def impacts_per_cycle(cycles: Cycles, last: int) -> Array:
    """Contacts begun in a cycle by k machines, mean of their ``last`` cycles."""
    return np.asarray(cycles.impacts[:, -last:].sum(axis=(1, 2)) / last)


class Jobs:
    """Jobs on the machines of a batch.

    Attributes
    ----------
    machines
        As drawn for the current job of each, with its present clearance, at its starting speed.
    chosen : (N,)
        Their numbers in the pool.
    speed : (N,)
        In the unit of the machine's speed field.
    damage : (N, sides)
        Share of its life that each surface has used up.
    """

    def __init__(self, rules: Rules, batch: Batch) -> None:
        count, cycles = len(batch), rules.task.cycles_per_step
        self.rules, self.batch = rules, batch
        self.machines = [rules.machine] * count
        self._new = [rules.machine] * count
        self.chosen = np.zeros(count, np.int64)
        self.speed = np.full(count, rules.drive.lowest_speed)
        self.damage = np.zeros((count, len(rules.machine.sides)))
        self._action = np.zeros(count)
        self._cycles_done = np.zeros(count, np.int64)
        self._type_iii = np.zeros((count, len(rules.pool.levels), len(rules.pool.speeds)), np.bool_)
        self._peaks = np.zeros((count, cycles))
        self._impacts = np.zeros(count)
        self._bouncing = np.zeros(count)
        self._job_time = rules.task.job_cycles * float(rules.machine.period_at(rules.drive.highest_speed))

    def machine_at(self, i: int) -> Machine:
        """Machine of job i at its current speed."""
        return at_speed(self.machines[i], float(self.speed[i]))

    def regimes_at(self, i: int) -> RegimeTable:
        """Regimes of the machine of job i with its present clearance."""
        return self.rules.pool.regimes(int(self.chosen[i]))[int(self._levels(np.array([i]))[0])]

    def nominal_regimes_at(self, i: int) -> RegimeTable:
        """Regimes of the nominal machine, worn as that of job i is."""
        return self.rules.pool.nominal_regimes[int(self._levels(np.array([i]))[0])]

    def start(
        self, which: Indices, speed: float, generators: Generators, chosen: Indices | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start the jobs ``which`` (k,), each on a new machine that is run in from rest at a speed.

        ``chosen`` (k,) are the numbers of the machines in the pool; drawn by default.

        Returns
        -------
        (observation, info)
            (k, ...) and arrays (k,) by name.

        Raises
        ------
        SimulationError
            If a machine can't be simulated at its starting speed.
        """
        task, pool = self.rules.task, self.rules.pool
        drawn = np.array([generator.integers(len(pool)) for generator in generators])
        self.chosen[which] = drawn if chosen is None else chosen
        for i, k in zip(which.tolist(), self.chosen[which].tolist(), strict=True):
            self._type_iii[i] = [table.type_iii for table in pool.regimes(k)]
            self.machines[i] = self._new[i] = at_speed(pool[k], speed)
            self.batch.start(i, self.machines[i])
        speeds = np.full(len(which), speed)
        self.speed[which], self._action[which] = speeds, self.rules.drive.action_for(speed)
        self.damage[which], self._cycles_done[which] = 0.0, 0
        cycles = self.batch.run(which, max(RUN_IN_CYCLES, task.cycles_per_step))
        if cycles.failed.any():
            machine = self.machines[which[int(cycles.failed.argmax())]]
            raise SimulationError(f"a job can't start at a speed of {speed:g}; {machine}")
        self._note(which, speeds, cycles)
        info = {
            "speed": speeds,
            "damage": np.zeros(len(which)),
            "status": np.full(len(which), int(Status.RUNNING)),
            "machine": self.chosen[which],
        }
        return self._observe(which, generators), info

    def step(self, which: Indices, actions: NDArray[np.float32], generators: Generators) -> Outcome:
        """Run the jobs ``which`` (k,) for a step; a simulation that fails ends its job.

        Raises
        ------
        ParameterError
            If an action is not finite.
        """
        drive, task = self.rules.drive, self.rules.task
        self._action[which], target = drive.target_of(actions)
        speed = drive.approach(self.speed[which], target)
        self.speed[which] = speed
        self.batch.set_speeds(which, speed)
        if self.rules.pool.wears:
            self._wear(which)
        levels = self._levels(which)
        cycles = self.batch.run(which, task.cycles_per_step)

        before = self.damage[which]
        after = before + task.damage(cycles.peak_force)
        self.damage[which] = after
        self._cycles_done[which] += np.where(cycles.failed, 0, task.cycles_per_step)
        self._note(which, speed, cycles)

        worse = after.max(axis=-1)
        status = task.status(cycles.failed, self._cycles_done[which], worse)
        duration = task.cycles_per_step * self.rules.machine.period_at(speed)
        reward, named = task.judge(
            Step(speed, duration, cycles.peak_force),
            status,
            type_iii=self._type_iii[which, levels, nearest(self.rules.pool.speeds, speed)],
            damage_increase=worse - before.max(axis=-1),
            job_time=self._job_time,
        )
        info = named | {
            "speed": speed,
            "damage": worse,
            "status": status,
            "is_success": status == int(Status.JOB_DONE),
            "machine": self.chosen[which],
        }
        return Outcome(self._observe(which, generators), reward, status != int(Status.RUNNING), info)

    def _levels(self, which: Indices) -> Indices:
        """Which regime tables hold at the present clearances (k,)."""
        return nearest(self.rules.pool.levels, 1.0 + self.damage[which].max(axis=-1))

    def _wear(self, which: Indices) -> None:
        """Let clearances grow with the damage; the motion goes on."""
        for i, damage in zip(which.tolist(), self.damage[which].max(axis=-1).tolist(), strict=True):
            self.machines[i] = worn(self._new[i], 1.0 + damage)
            self.batch.change(i, self.machine_at(i))

    def _note(self, which: Indices, speed: Array, cycles: Cycles) -> None:
        """Keep what the next observation and judgement need, of the machines that did not fail."""
        if cycles.failed.any():
            ran = ~cycles.failed
            which, speed, cycles = which[ran], speed[ran], cycles.of(ran)
        monitored = cycles.peak_force[..., 0]
        n = self._peaks.shape[1]
        self._peaks[which] = monitored[:, -n:]
        self._impacts[which] = impacts_per_cycle(cycles, n)
        self._bouncing[which] = bouncing_share(cycles, n, self.rules.machine.period_at(speed))

    def _observe(self, which: Indices, generators: Generators) -> Observation:
        rules = self.rules
        return observe(
            rules.space,
            self.speed[which],
            self._action[which],
            1.0 - self._cycles_done[which] / rules.task.job_cycles,
            self._impacts[which],
            self._bouncing[which],
            sensor_readings(self._peaks[which], rules.sensor_error, generators),
            self.damage[which].max(axis=-1) if rules.pool.wears else None,
        )
