"""Jobs of one machine or a thousand side by side: start, step, reward and observation."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from chaosgym.arrays import Array, Indices
from chaosgym.core.compilation import call
from chaosgym.core.motor import round_speeds
from chaosgym.envs.drive import DEAD_BAND, MOVES
from chaosgym.envs.judge import ExponentJudge, Judge, RecurrenceJudge
from chaosgym.envs.kernels.steps import JOB, REPORT, drive, observe, settle
from chaosgym.envs.motors import ConstantSpeed, Motors
from chaosgym.envs.observation import Observation, sensed
from chaosgym.envs.pool import Pool
from chaosgym.envs.task import Status, Task, demand_of
from chaosgym.envs.variants import DRAWN, Variants
from chaosgym.errors import SimulationError
from chaosgym.machines.batch import Cycles, KickedBatch, VaryingBatch
from chaosgym.machines.ignorable import ignorable
from chaosgym.machines.machine import Machine

Generators = Sequence[np.random.Generator]


DRAWS = 20
"""Times that other machines are drawn for those whose motor stalls before the job begins."""


class StepResult(NamedTuple):
    """What a step of k jobs gave: (k, ...) observations, (k,) rewards, and (k,) records ``REPORT``, the info."""

    observation: Observation
    reward: Array
    report: NDArray[np.void]


class Segment(NamedTuple):
    """Part of a step: a ``machine`` at ``speeds`` (cycles,), from a state as in a ``MotionState``."""

    machine: Machine
    speeds: Array
    coordinates: Array
    bouncing: Array


class Jobs:
    """Jobs of a ``task`` on machines that run side by side, with observations of a ``space``.

    Each machine does ``of_each`` jobs in turn.

    Attributes
    ----------
    machines
        As drawn for the current job of each, with the clearance of the new machine.
    state : (N,)
        Records ``JOB``, whose ``machine`` is the number among those kept for evaluation, -1 if drawn.
    demand : (N, steps + 1)
        Of every step of the job.
    damage : (N, sides)
        Of each surface; 1 ends a job.
    entries
        What fills the entries that keywords add to the observation.
    told
        Names of the columns of a report that are the info of a step.
    force : (N,)
        What a force of the task is a share of [N].
    traced
        Number of the first jobs of which ``segments`` keeps where the last step began, for pictures; a list each.
    """

    def __init__(self, task: Task, variants: Variants | Pool, space: Box, count: int, of_each: int = 1) -> None:
        nominal = variants.nominal
        self.task, self.variants, self.space, self.batch = task, variants, space, variants.batch(count)
        # how far a free body has gone outgrows the rest of a deviation that the batch carries
        exact = isinstance(self.batch, VaryingBatch) and ignorable(nominal) is None
        self.judge: Judge = (ExponentJudge if exact else RecurrenceJudge)(count)
        self.entries = [entry(task, nominal, count) for entry in task.added]
        self._drive = (Motors if task.drive == "motor" else ConstantSpeed)(nominal, count)
        self.told = self._drive.info
        self.machines: list[Machine] = [nominal] * count
        self.state = np.zeros(count, JOB)
        self.state["speed"], self.state["machine"] = task.lowest_speed, DRAWN
        self.demand = np.zeros((count, task.steps + 1))
        self.damage = np.zeros((count, len(nominal.sides)))
        self._lowest, self._span, self.force = np.zeros(count), np.ones(count), np.ones(count)
        self._job_time = np.ones(count)
        self._velocities = nominal.n_velocities
        self._of_each, self._begun = of_each, np.zeros(count, np.int64)
        self._drawn_by: list[np.random.Generator | None] = [None] * count
        self.traced = 0
        self.segments: list[list[Segment]] = [[] for _ in range(count)]

    @property
    def speed(self) -> Array:
        """Speeds (N,) of the last step, in the unit of the task."""
        return self.state["speed"]

    def machine_at(self, i: int) -> Machine:
        """Machine of job i at its current speed and clearance."""
        # of one that stalled, at its usual speed
        return self.machines[i].at(self._speed_of(i) or None, float(self.state["worn"][i]))

    def _speed_of(self, i: int) -> float:
        """Speed of job i, in the unit of its machine."""
        return float(self._lowest[i] + self._span[i] * self.speed[i])

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
        task, variants = self.task, self.variants
        count = max(task.run_in_cycles, task.cycles_per_step)
        same = self._same_machine(which, generators, numbers)
        self._draw(which, generators, numbers, speed, same)
        if numbers is None:
            self._redraw_stalled(which, generators, speed, count)
        state = self.state[which]
        state["trim"], state["worn"] = 0.0, state["clearance"]
        state["machine"] = np.where(same, state["machine"], DRAWN if numbers is None else numbers)
        for name in ("done", "changed", "off", "irregular", "seconds", "largest_force"):
            state[name] = 0
        self.state[which], self.damage[which] = state, 0.0
        self.judge.start(which)
        for entry in self.entries:
            entry.forget(which)
        for i in which.tolist():
            self.batch.start(i, self.machines[i].at(self._speed_of(i)))
        self._start_drive(which)
        cycles, growth, period = self._run(which, count, generators)
        if (stalled := self._drive.stalled[which]).any():
            first = int(which[int(stalled.argmax())])
            whose = (
                f", on {DRAWS} other machines drawn too" if numbers is None else ", on a machine kept for evaluation"
            )
            raise SimulationError(
                f"the motor stalls at a set-point of {self.state['set_point'][first]:g} rpm{whose}; give a higher "
                "lowest_speed, or a [motor] with more stall_torque or inertia"
            )
        if cycles.failed.any():
            first = int(which[int(cycles.failed.argmax())])
            raise SimulationError(f"a job can't start at a speed of {self._speed_of(first):g}; {self.machines[first]}")
        self.judge.verdict(which, growth, variants.nominal.sensed(cycles.peak_force))
        info = {
            "speed": self.speed[which],
            "demand": self.demand[which, 0],
            "damage": np.zeros(len(which)),
            "status": np.full(len(which), int(Status.RUNNING)),
            "machine": state["machine"],
            "clearance": state["clearance"],
        }
        return self._observe(which, cycles, period, generators), info

    def _same_machine(self, which: Indices, generators: Generators, numbers: Indices | None) -> NDArray[np.bool_]:
        """Whether the jobs ``which`` (k,) begin on the machine of the last one; a new generator begins with another."""
        new = np.array([one is not self._drawn_by[i] for i, one in zip(which.tolist(), generators, strict=True)])
        for i, one in zip(which.tolist(), generators, strict=True):
            self._drawn_by[i] = one
        begun = np.where(new | (numbers is not None), 0, self._begun[which])
        self._begun[which] = begun + 1
        return np.asarray(begun % self._of_each != 0)

    def _draw(
        self,
        which: Indices,
        generators: Generators,
        numbers: Indices | None,
        speed: float | None,
        same: NDArray[np.bool_],
    ) -> None:
        """Give the jobs ``which`` machines, unless they have the ``same``, demands and speeds."""
        task, variants = self.task, self.variants
        for k, (i, generator) in enumerate(zip(which.tolist(), generators, strict=True)):
            drawn = variants.drawn(generator)
            self.demand[i] = demand_of(task, generator)
            if not same[k]:
                self.machines[i] = drawn if numbers is None else variants.held_out(int(numbers[k]))
            self.state["clearance"][i] = getattr(self.machines[i], drawn.clearance_field)
            self._lowest[i], self._span[i], self.force[i] = units = variants.units(self.machines[i])
            top = units.lowest + units.span * task.highest_speed
            self._job_time[i] = task.job_cycles * float(self.machines[i].period_at(top))
        wanted = self.demand[which, 0] - task.start_below if speed is None else np.full(len(which), speed)
        speeds = np.clip(wanted, task.lowest_speed, task.highest_speed)
        if task.speed_grid > 0.0:
            speeds = task.speed_grid * np.rint(speeds / task.speed_grid)
        self.state["speed"][which] = self.state["set_point"][which] = speeds

    def _redraw_stalled(self, which: Indices, generators: Generators, speed: float | None, count: int) -> None:
        """Draw others for those of the jobs ``which`` whose motor would stall within ``count`` cycles."""
        for _ in range(DRAWS):
            set_points = self._start_drive(which)
            self._drive.turn(which, set_points, count, self.task.cycles_per_step)
            stalled = self._drive.stalled[which]
            if not stalled.any():
                return
            generators = [each for each, again in zip(generators, stalled, strict=True) if again]
            which = which[stalled]
            self._draw(which, generators, None, speed, np.zeros(len(which), np.bool_))

    def _start_drive(self, which: Indices) -> Array:
        """Let machines turn at the speeds of their jobs, which are returned in the unit of the machine."""
        speeds = self._lowest[which] + self._span[which] * self.speed[which]
        self._drive.start(which, self.machines, speeds)
        return speeds

    def step(self, which: Indices, actions: Array, generators: Generators) -> StepResult:
        """Run the jobs ``which`` (k,) for a step by checked actions; a simulation that fails ends its job."""
        task, demands, state = self.task, self.demand, self.state
        call(drive, task.numbers, actions, MOVES, DEAD_BAND, which, demands, state)
        if task.wear > 0.0:
            self.batch.set_clearances(which, state["worn"][which])
        cycles, growth, period = self._run(which, task.cycles_per_step, generators)
        peaks = cycles.peak_force
        verdict = self.judge.verdict(which, growth, self.variants.nominal.sensed(peaks))
        report, reward = np.empty(len(which), REPORT), np.empty(len(which))
        outcome = np.where(cycles.failed, Status.SIMULATION_FAILED, Status.RUNNING)
        outcome[self._drive.stalled[which]] = Status.STALLED
        given = (task.numbers, self._job_time, self.force, which, demands, outcome, peaks, task.damage(peaks), period)
        call(settle, *given, *verdict, state, self.damage, report, reward)
        report["set_point"] = state["set_point"][which]
        self._drive.report(which, report)
        return StepResult(self._observe(which, cycles, period, generators), reward, report)

    def _run(self, which: Indices, count: int, generators: Generators) -> tuple[Cycles, Array, Array]:
        """Run machines for cycles whose speed ripples, with kicks; forces are in the task's unit.

        Returns cycles, their growth, which is zero where it is not known, and the period (k,) [s].
        """
        speed = self._lowest[which] + self._span[which] * self.speed[which]
        speeds = self._drive.turn(which, speed, count, self.task.cycles_per_step)
        speed = self._drive.reached(which, speed, self.state)
        cycles, growth = self._moved(which, speeds, generators)
        self._drive.stop(which, cycles, growth)
        cycles.peak_force[:] /= self.force[which][:, None, None]
        return cycles, growth, self.variants.nominal.period_at(speed)

    def _moved(self, which: Indices, speeds: Array, generators: Generators) -> tuple[Cycles, Array]:
        """Cycles of machines at speeds (k, cycles), and their growth."""
        task, count = self.task, speeds.shape[1]
        steady = task.speed_ripple == 0.0 and self._drive.steady
        if task.speed_ripple > 0.0:
            speeds *= 1.0 + task.speed_ripple * np.array([g.standard_normal(count) for g in generators])
        if not self._drive.steady:
            call(round_speeds, speeds)
        kicks = None
        if task.kick > 0.0:
            kicks = task.kick * np.array([g.standard_normal((count, self._velocities)) for g in generators])
        if self.traced:
            for i in which[which < self.traced].tolist():
                self.segments[i] = []
        if kicks is None and isinstance(self.batch, VaryingBatch):
            self._trace(which, speeds)
            cycles, growth = self.batch.run_varied(which, speeds)
            growth[cycles.failed] = 0.0
            return cycles, growth
        if kicks is None and steady:
            self.batch.set_speeds(which, speeds[:, 0])
            self._trace(which, speeds)
            return self.batch.run(which, count), np.zeros(speeds.shape)
        if kicks is not None and steady and not self.traced and isinstance(self.batch, KickedBatch):
            self.batch.set_speeds(which, speeds[:, 0])
            return self.batch.run_kicked(which, kicks), np.zeros(speeds.shape)
        return self._run_cycles(which, speeds, kicks)

    def _run_cycles(self, which: Indices, speeds: Array, kicks: Array | None) -> tuple[Cycles, Array]:
        """Run machines cycle by cycle; one that fails stays where it is."""
        single: list[Cycles] = []
        growth = np.zeros(speeds.shape)
        for cycle in range(speeds.shape[1]):
            if kicks is not None:
                self.batch.kick(which, kicks[:, cycle])
            column = speeds[:, cycle : cycle + 1]
            self._trace(which, column)
            if isinstance(self.batch, VaryingBatch):
                done, growth[:, cycle : cycle + 1] = self.batch.run_varied(which, column)
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
            self.segments[i].append(Segment(self.machine_at(i), speeds[k], *self.batch.motion(i)))

    def _observe(self, which: Indices, cycles: Cycles, period: Array, generators: Generators) -> Observation:
        space, task = self.space, self.task
        last = task.cycles_per_step
        drawn = sensed(task, cycles.impacts[:, -last:], generators)
        measured, values = np.empty((len(which), last)), np.empty((len(which), *space.shape), np.float32)
        sensed_peaks = self.variants.nominal.sensed(cycles.peak_force)
        given = (task.numbers, which, self.demand, self.state, sensed_peaks, cycles.bounce_duration, period)
        call(observe, *given, *drawn, space.low, space.high, measured, values)
        for entry in self.entries:
            values[:, task.places[entry.name]] = entry.values(which, measured, self.state[which], values)
        return values
