"""How do jobs go on? The bookkeeping of machines at work, whether one runs or a thousand side by side."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from chaosgym.envs.drive import SpeedDrive
from chaosgym.envs.observation import Observation, observe, sensor_readings
from chaosgym.envs.tasks import LONGEST_PERIOD, Status, Step, Task, judged_cycles
from chaosgym.errors import SimulationError
from chaosgym.fleet import Cycles, Fleet, at_speed
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import with_settings

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Generators = Sequence[np.random.Generator]

RUN_IN_CYCLES = 20
"""Cycles at the starting speed before the job begins; at least a step."""


class Rules(NamedTuple):
    """What all jobs have in common.

    ``machine`` the nominal one; ``drive``; ``task``; ``space`` of an observation; ``tolerances`` half width of each
    field that varies, as a share of its nominal value, all multiplied by ``tolerance``; ``sensor_error`` [N] half width
    of the error of a measured peak; ``is_type_iii`` tells which steps count as Type III.
    """

    machine: Machine
    drive: SpeedDrive
    task: Task
    space: Box
    tolerances: Mapping[str, float]
    tolerance: float
    sensor_error: float
    is_type_iii: Callable[[Step], NDArray[np.bool_]]


class Outcome(NamedTuple):
    """What a step of k jobs gave: (k, ...) observations, (k,) rewards, (k,) whether they ended, and info by name."""

    observation: Observation
    reward: Array
    terminated: NDArray[np.bool_]
    info: dict[str, NDArray[Any]]


class Jobs:
    """Jobs on the machines of a fleet.

    Attributes
    ----------
    machines
        As drawn for the current job of each, at its starting speed.
    speed : (N,)
        In the unit of the machine's speed field.
    damage : (N, sides)
        Share of its life that each surface has used up.
    """

    def __init__(self, rules: Rules, fleet: Fleet) -> None:
        count, cycles = len(fleet), rules.task.cycles_per_step
        self.rules, self.fleet = rules, fleet
        self.machines = [rules.machine] * count
        self.speed = np.full(count, rules.drive.lowest_speed)
        self.damage = np.zeros((count, len(rules.machine.sides)))
        self._action = np.zeros(count)
        self._cycles_done = np.zeros(count, np.int64)
        self._recent_peaks = np.zeros((count, judged_cycles(cycles) + LONGEST_PERIOD))
        self._peaks = np.zeros((count, cycles))
        self._impacts = np.zeros(count)
        self._bouncing = np.zeros(count)
        self._job_time = rules.task.job_cycles * float(rules.machine.period_at(rules.drive.highest_speed))

    def machine_at(self, i: int) -> Machine:
        """Machine of job i at its current speed."""
        return at_speed(self.machines[i], float(self.speed[i]))

    def start(self, which: Indices, speed: float, generators: Generators) -> tuple[Observation, dict[str, Any]]:
        """Start the jobs ``which`` (k,), each on a new machine that is run in from rest at a speed.

        Returns
        -------
        (observation, info)
            (k, ...) and arrays (k,) by name.

        Raises
        ------
        SimulationError
            If a machine can't be simulated at its starting speed.
        """
        task = self.rules.task
        for i, generator in zip(which.tolist(), generators, strict=True):
            self.machines[i] = at_speed(self._draw_machine(generator), speed)
            self.fleet.start(i, self.machines[i])
        speeds = np.full(len(which), speed)
        self.speed[which], self._action[which] = speeds, self.rules.drive.action_for(speed)
        self.damage[which], self._cycles_done[which] = 0.0, 0
        cycles = self.fleet.run(which, max(RUN_IN_CYCLES, task.cycles_per_step))
        if cycles.failed.any():
            machine = self.machines[which[int(cycles.failed.argmax())]]
            raise SimulationError(f"a job can't start at a speed of {speed:g}; {machine}")
        self._note(which, speeds, cycles)
        info = {
            "speed": speeds,
            "damage": np.zeros(len(which)),
            "status": np.full(len(which), int(Status.RUNNING)),
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
        self.fleet.set_speeds(which, speed)
        cycles = self.fleet.run(which, task.cycles_per_step)

        before = self.damage[which]
        after = before + task.damage(cycles.peak_force)
        self.damage[which] = after
        self._cycles_done[which] += np.where(cycles.failed, 0, task.cycles_per_step)
        self._note(which, speed, cycles)

        worse = after.max(axis=-1)
        status = task.status(cycles.failed, self._cycles_done[which], worse)
        duration = task.cycles_per_step * self.rules.machine.period_at(speed)
        step = Step(speed, duration, cycles.peak_force, self._recent_peaks[which])
        reward, named = task.judge(
            step, status, type_iii=self.rules.is_type_iii(step), damage_increase=worse - before.max(axis=-1),
            job_time=self._job_time,
        )  # fmt: skip
        info = named | {"speed": speed, "damage": worse, "status": status, "is_success": status == int(Status.JOB_DONE)}
        return Outcome(self._observe(which, generators), reward, status != int(Status.RUNNING), info)

    def _draw_machine(self, generator: np.random.Generator) -> Machine:
        rules = self.rules
        if rules.tolerance == 0.0:
            return rules.machine
        widths = np.array(list(rules.tolerances.values()))
        factors = 1.0 + rules.tolerance * generator.uniform(-1.0, 1.0, len(widths)) * widths
        drawn = {
            name: getattr(rules.machine, name) * float(factor)
            for name, factor in zip(rules.tolerances, factors, strict=True)
        }
        return with_settings(rules.machine, drawn)

    def _note(self, which: Indices, speed: Array, cycles: Cycles) -> None:
        """Keep what the next observation and judgement need, of the machines that did not fail."""
        if cycles.failed.any():
            ran = ~cycles.failed
            which, speed, cycles = which[ran], speed[ran], cycles.of(ran)
        monitored = cycles.peak_force[..., 0]
        kept = self._recent_peaks.shape[1]
        self._recent_peaks[which] = np.concatenate([self._recent_peaks[which], monitored], axis=1)[:, -kept:]
        n = self._peaks.shape[1]
        self._peaks[which] = monitored[:, -n:]
        sides = (len(which), n * self.damage.shape[1])
        self._impacts[which] = cycles.impacts[:, -n:].reshape(sides).sum(axis=1) / n
        period = self.rules.machine.period_at(speed)
        self._bouncing[which] = 2.0 * cycles.bounce_duration[:, -n:].reshape(sides).mean(axis=1) / period

    def _observe(self, which: Indices, generators: Generators) -> Observation:
        rules = self.rules
        return observe(
            rules.space, self.speed[which], self._action[which],
            1.0 - self._cycles_done[which] / rules.task.job_cycles, self._impacts[which], self._bouncing[which],
            sensor_readings(self._peaks[which], rules.sensor_error, generators),
        )  # fmt: skip
