"""How do jobs go on? The bookkeeping of machines at work, whether one runs or a thousand side by side."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from chaosgym.envs.drive import approached, trimmed
from chaosgym.envs.judge import ExponentJudge, Judge, RecurrenceJudge
from chaosgym.envs.observation import COMMANDED, OBSERVATION_NAMES, Observation, felt
from chaosgym.envs.task import Status, Task, demand_of
from chaosgym.envs.variants import DRAWN, Variants
from chaosgym.errors import SimulationError
from chaosgym.machines.batch import Cycles
from chaosgym.machines.machine import Machine
from chaosgym.monitor import RepeatSums
from chaosgym.simulation.batch import batch_of

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Generators = Sequence[np.random.Generator]


LEAST_ERROR = 1e-6
"""Error [N] that the monitor of ideal sensors reckons with."""


class Rules(NamedTuple):
    """What all jobs have in common: ``task``, ``variants`` of the machine, ``space`` of an observation."""

    task: Task
    variants: Variants
    space: Box


class Outcome(NamedTuple):
    """What a step of k jobs gave: (k, ...) observations, (k,) rewards, (k,) whether they ended, and info by name."""

    observation: Observation
    reward: Array
    terminated: NDArray[np.bool_]
    info: dict[str, NDArray[Any]]


class Piece(NamedTuple):
    """Part of a step: a ``machine`` at ``speeds`` (cycles,), from a state as in a ``MotionState``."""

    machine: Machine
    speeds: Array
    coordinates: Array
    bouncing: Array


class Jobs:
    """Jobs on machines that run side by side.

    Attributes
    ----------
    machines
        As drawn for the current job of each, with the clearance of the new machine.
    number : (N,)
        Their numbers among those kept for evaluation, -1 if drawn.
    speed, trim : (N,)
        Of the last step, in the unit of the machine's speed field.
    demand : (N, steps + 1)
        Of every step of the job.
    done : (N,)
        Steps done.
    damage : (N, sides)
        Share of its life that each surface has used up.
    traced
        Number of the first jobs of which ``pieces`` keeps where the last step began, for pictures; a list each.
    """

    def __init__(self, rules: Rules, count: int) -> None:
        task, nominal = rules.task, rules.variants.nominal
        self.rules, self.batch = rules, batch_of(nominal, count)
        self.judge: Judge = (ExponentJudge if hasattr(self.batch, "run_varied") else RecurrenceJudge)(count)
        self._monitor = RepeatSums(count) if task.monitor == "on" else None
        self.machines: list[Machine] = [nominal] * count
        self.number = np.full(count, DRAWN)
        self.speed, self.trim = np.full(count, task.lowest_speed), np.zeros(count)
        self.demand = np.zeros((count, task.steps + 1))
        self.done = np.zeros(count, np.int64)
        self.damage = np.zeros((count, len(nominal.sides)))
        self._changed = np.zeros(count, np.int64)
        self._clearance = np.zeros(count)
        self._job_time = task.job_cycles * float(nominal.period_at(task.highest_speed))
        self.traced = 0
        self.pieces: list[list[Piece]] = [[] for _ in range(count)]

    def machine_at(self, i: int) -> Machine:
        """Machine of job i at its current speed and clearance."""
        return self.machines[i].at(float(self.speed[i]), float(self._worn(np.array([i]))[0]))

    def start(
        self, which: Indices, generators: Generators, numbers: Indices | None = None, speed: float | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start the jobs ``which`` (k,), each on a new machine that is run in from rest.

        ``numbers`` (k,) of machines kept for evaluation; drawn by default. ``speed`` of the start; by default below the
        first demand.

        Returns
        -------
        (observation, info)
            (k, ...) and arrays (k,) by name.

        Raises
        ------
        SimulationError
            If a machine can't be simulated at its starting speed.
        """
        task, variants = self.rules.task, self.rules.variants
        for k, (i, generator) in enumerate(zip(which.tolist(), generators, strict=True)):
            drawn = variants.drawn(generator)
            self.demand[i] = demand_of(task, generator)
            self.machines[i] = drawn if numbers is None else variants.held_out(int(numbers[k]))
            self._clearance[i] = getattr(self.machines[i], drawn.clearance_field)
        self.number[which] = DRAWN if numbers is None else numbers
        wanted = self.demand[which, 0] - task.start_below if speed is None else np.full(len(which), speed)
        speeds = np.clip(wanted, task.lowest_speed, task.highest_speed)
        if task.speed_grid > 0.0:
            speeds = task.speed_grid * np.rint(speeds / task.speed_grid)
        self.speed[which], self.trim[which] = speeds, 0.0
        self.damage[which], self.done[which], self._changed[which] = 0.0, 0, 0
        self.judge.start(which)
        if self._monitor is not None:
            self._monitor.forget(which)
        for i in which.tolist():
            self.batch.start(i, self.machines[i].at(float(self.speed[i])))
        count = max(task.run_in_cycles, task.cycles_per_step)
        cycles, growth = self._run(which, speeds, count, generators)
        if cycles.failed.any():
            first = int(which[int(cycles.failed.argmax())])
            raise SimulationError(f"a job can't start at a speed of {self.speed[first]:g}; {self.machines[first]}")
        self.judge.verdict(which, growth, cycles.peak_force[:, :, 0])
        info = {
            "speed": speeds.copy(),
            "demand": self.demand[which, 0],
            "damage": np.zeros(len(which)),
            "status": np.full(len(which), int(Status.RUNNING)),
            "machine": self.number[which],
            "clearance": self._clearance[which],
        }
        return self._observe(which, cycles, generators), info

    def step(self, which: Indices, actions: NDArray[Any], generators: Generators) -> Outcome:
        """Run the jobs ``which`` (k,) for a step by checked actions; a simulation that fails ends its job."""
        task = self.rules.task
        now = self.done[which]
        demand = self.demand[which, now]
        self.trim[which] = trimmed(task, actions, demand, self.trim[which])
        speed = approached(task, self.speed[which], demand + self.trim[which])
        self.speed[which] = speed
        if task.wear > 0.0:
            self.batch.set_clearances(which, self._worn(which))
        cycles, growth = self._run(which, speed, task.cycles_per_step, generators)

        type_iii, irregularity = self.judge.verdict(which, growth, cycles.peak_force[:, :, 0])
        before = self.damage[which]
        after = before + task.damage(cycles.peak_force)
        self.damage[which] = after
        worse = after.max(axis=-1)
        done = now + 1
        self.done[which] = done
        changed = self.demand[which, done] != demand
        if changed.any():
            self._changed[which[changed]] = done[changed]
        status = task.status(cycles.failed, done, worse)
        deviation, charged = np.abs(speed - demand), type_iii * ~cycles.failed
        terms = task.rewards(
            deviation=deviation,
            type_iii=charged,
            damage=worse - before.max(axis=-1),
            time=task.cycles_per_step * self.rules.variants.nominal.period_at(speed) / self._job_time,
            failed=(status == int(Status.FRACTURE)) | (status == int(Status.SIMULATION_FAILED)),
            steps_left=(task.steps - now).astype(float),
        )
        info = terms | {
            "speed": speed,
            "demand": demand,
            "deviation": deviation,
            "type_iii": charged,
            "cost": charged,
            "irregularity": irregularity,
            "largest_force": cycles.peak_force.reshape(len(which), -1).max(axis=1),
            "damage": worse,
            "status": status,
            "is_success": status == int(Status.JOB_DONE),
            "machine": self.number[which],
            "clearance": self._worn(which),
        }
        reward = np.asarray(sum(terms.values()))
        return Outcome(self._observe(which, cycles, generators), reward, status != int(Status.RUNNING), info)

    def _worn(self, which: Indices) -> Array:
        """Clearances (k,) [m] after the steps done."""
        task, clearance = self.rules.task, self._clearance[which]
        return clearance if task.wear == 0.0 else clearance * (1.0 + task.wear * self.done[which] / task.steps)

    def _run(self, which: Indices, speed: Array, count: int, generators: Generators) -> tuple[Cycles, Array]:
        """Run machines at speeds (k,) that ripple, with kicks; growth is zero where it is not known."""
        task = self.rules.task
        speeds = np.repeat(speed[:, None], count, axis=1)
        if task.speed_ripple > 0.0:
            speeds *= 1.0 + task.speed_ripple * np.array([g.standard_normal(count) for g in generators])
        half = self.rules.variants.nominal.n_states // 2
        kicks = None
        if task.kick > 0.0:
            kicks = task.kick * np.array([g.standard_normal((count, half)) for g in generators])
        if self.traced:
            for i in which[which < self.traced].tolist():
                self.pieces[i] = []
        if kicks is None and isinstance(self.judge, ExponentJudge):
            self._trace(which, speeds)
            cycles, growth = self.batch.run_varied(which, speeds)  # type: ignore[attr-defined]
            growth[cycles.failed] = 0.0
            return cycles, growth
        if kicks is None and task.speed_ripple == 0.0:
            self.batch.set_speeds(which, speed)
            self._trace(which, speeds)
            return self.batch.run(which, count), np.zeros_like(speeds)
        if task.speed_ripple == 0.0 and not self.traced and hasattr(self.batch, "run_kicked"):
            self.batch.set_speeds(which, speed)
            return self.batch.run_kicked(which, kicks), np.zeros_like(speeds)
        return self._run_cycles(which, speeds, kicks)

    def _run_cycles(self, which: Indices, speeds: Array, kicks: Array | None) -> tuple[Cycles, Array]:
        """Run machines cycle by cycle; one that fails stays where it is."""
        single: list[Cycles] = []
        growth = np.zeros_like(speeds)
        for cycle in range(speeds.shape[1]):
            if kicks is not None:
                self.batch.kick(which, kicks[:, cycle])
            column = speeds[:, cycle : cycle + 1]
            self._trace(which, column)
            if isinstance(self.judge, ExponentJudge):
                done, growth[:, cycle : cycle + 1] = self.batch.run_varied(which, column)  # type: ignore[attr-defined]
            else:
                self.batch.set_speeds(which, column[:, 0])
                done = self.batch.run(which, 1)
            single.append(done)
        failed = np.any([done.failed for done in single], axis=0)
        results = [np.concatenate(parts, axis=1) for parts in list(zip(*single, strict=True))[1:]]
        for values in (*results, growth):
            values[failed] = 0
        return Cycles(failed, *results), growth

    def _trace(self, which: Indices, speeds: Array) -> None:
        if not self.traced:
            return
        for k in np.flatnonzero(which < self.traced).tolist():
            i = int(which[k])
            self.pieces[i].append(Piece(self.machine_at(i), speeds[k], *self.batch.motion(i)))

    def _observe(self, which: Indices, cycles: Cycles, generators: Generators) -> Observation:
        rules, task = self.rules, self.rules.task
        values = np.empty((len(which), rules.space.shape[0]), np.float32)
        speed, done = self.speed[which], self.done[which]
        demand = self.demand[which, done]
        age = np.minimum(done - self._changed[which], task.shortest_hold)
        entries = (speed, demand, self.trim[which], speed - demand, 1.0 - done / task.steps, age)
        for column, entry in enumerate(entries):
            values[:, column] = entry
        period = rules.variants.nominal.period_at(speed)
        features, peaks = felt(task, cycles, task.cycles_per_step, period, generators)
        values[:, len(COMMANDED) : len(OBSERVATION_NAMES)] = features
        if self._monitor is not None:
            for column in peaks.T:
                self._monitor.add(which, column, max(task.sensor_error, LEAST_ERROR))
            values[:, -1] = self._monitor.level(which)
        return values.clip(rules.space.low, rules.space.high, out=values)
