"""A job at a machine that is not simulated here: a class of yours, or a program that reads and writes lines.

A plant has two methods: ``reset()``, before a job, and ``run(speed, cycles)``, which runs it for some cycles at
a speed and returns the largest force of each cycle [N]; with two stops (cycles, 2), the largest and the smallest force
of each. A mapping may tell more: ``peaks``, the measured ``speed``, and what a trained policy looks at, ``impacts``
(contacts a cycle) and ``bouncing`` (share of the half cycle on one side). A method ``stop()`` brings the machine to
rest; it is called after every job, however that ends.
"""

import json
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from queue import Empty, Queue
from threading import Thread
from typing import Any, Protocol, TextIO

import numpy as np

from chaosgym.arrays import Array
from chaosgym.control.operator import Operator
from chaosgym.envs.task import Task, demand_of
from chaosgym.envs.variants import HELD_OUT_SEED
from chaosgym.errors import ParameterError
from chaosgym.files import first_line

EXTRAS = ("impacts", "bouncing", "speed")
"""What ``run`` may tell beside the peaks."""

ANSWER_SECONDS = 600.0
"""Time for which a program behind lines is waited for."""


class Plant(Protocol):
    """A machine at work. It may have ``stop()`` too, which brings it to rest after a job."""

    def reset(self) -> None:
        """Bring the machine to rest, before a job."""
        ...

    def run(self, speed: float, cycles: int) -> Any:
        """Run ``cycles`` operating cycles at a speed; return the peaks [N], (cycles,), or a mapping with them."""
        ...


class PlantError(ParameterError):
    """A plant failed, or returned what is no reading.

    Attributes
    ----------
    worked
        The steps that were played before; None if there were none.
    """

    worked: "Worked | None" = None


class Lines:
    """A plant behind two streams of text, one line each way.

    It is told ``reset``, which has no answer, and ``run SPEED CYCLES``, whose answer is a line of as many forces [N],
    or one JSON object with ``peaks`` and what else the sensors tell; ``done`` comes last.

    Parameters
    ----------
    heard, told
        What the program writes, and what it reads.
    seconds
        For which an answer is waited for.
    """

    def __init__(self, heard: TextIO, told: TextIO, seconds: float = ANSWER_SECONDS) -> None:
        self._heard, self._told, self._seconds = heard, told, seconds
        self._lines: Queue[str] | None = None

    def reset(self) -> None:
        """Tell the plant to come to rest."""
        print("reset", file=self._told, flush=True)

    def run(self, speed: float, cycles: int) -> Any:
        """Request a step, and read the line that answers it."""
        print(f"run {speed:.10g} {cycles}", file=self._told, flush=True)
        if self._lines is None:
            self._lines = Queue()
            Thread(target=self._listen, args=(self._lines,), daemon=True).start()
        try:
            line = self._lines.get(timeout=self._seconds)
        except Empty:
            raise ParameterError(f"no answer came within {self._seconds:g} s; allowed: a line of forces [N]") from None
        if not line:
            raise ParameterError("standard input ended; allowed: a line of forces for each line run SPEED CYCLES")
        try:
            return json.loads(line) if line.lstrip().startswith("{") else [float(word) for word in line.split()]
        except ValueError:
            raise ParameterError(f"{line.strip()[:60]!r} is no line of forces [N]; allowed: 81.2 80.9 ...") from None

    def _listen(self, lines: "Queue[str]") -> None:
        while line := self._heard.readline():
            lines.put(line)
        lines.put("")

    def done(self) -> None:
        """Tell the plant that the jobs have ended, if it still listens."""
        try:
            print("done", file=self._told, flush=True)
        except OSError:  # what is left in the buffer goes nowhere at the end of the process
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._told.fileno())


def plant_of(name: str, **arguments: Any) -> Plant:
    """Make the plant ``module:Class``, found from the current folder too; ``-`` is standard input and output.

    ``arguments`` are those of the class; of ``-``, ``seconds`` for which an answer is waited for.

    Raises
    ------
    ParameterError
        If there is no such class, if it can't be made, or if it has no ``reset`` or ``run``.
    """
    if name == "-":
        with _named(name):
            return Lines(sys.stdin, sys.stdout, **arguments)
    module, colon, kind = name.partition(":")
    if not (module and colon and kind):
        raise ParameterError(
            f"plant = {name!r} is not usable; allowed: module:Class, or - for standard input and output"
        )
    with _named(name), _from_here():
        made = getattr(import_module(module), kind)(**arguments)
    for method in ("reset", "run"):
        if not callable(getattr(made, method, None)):
            raise ParameterError(f"plant {name} has no method {method}; it needs reset() and run(speed, cycles)")
    plant: Plant = made
    return plant


@contextmanager
def _from_here() -> Any:
    sys.path.insert(0, "")
    try:
        yield
    finally:
        sys.path.remove("")


@contextmanager
def _named(name: str) -> Iterator[None]:
    """Report any error in the code of a plant in one line."""
    try:
        yield
    except ParameterError:
        raise
    except Exception as error:
        raise ParameterError(f"plant {name} failed: {type(error).__name__}: {first_line(error)}") from error


@contextmanager
def _stopped(plant: Plant, name: str) -> Iterator[None]:
    """Call ``stop()`` of a plant that has it, whatever happens: an error there is told beside the one before."""
    stop = getattr(plant, "stop", None)
    try:
        yield
    except BaseException as error:
        try:
            if stop:
                stop()
        except Exception as other:
            error.args = (f"{first_line(error)}; stop() failed too: {type(other).__name__}: {first_line(other)}",)
        raise
    with _named(f"{name}: stop()"):
        if stop:
            stop()


@dataclass(frozen=True)
class Worked:
    """A job at a plant.

    Attributes
    ----------
    speed, demand, mean_peak : (steps,)
        Of each step: the speed that was set, and the force in newton, NaN where no peak is finite.
    measured_speed : (steps,) or None
        That the plant told; NaN in steps without one.
    largest_force
        Of all cycles [N].
    damage
        Of the joint by the peaks that were measured, see ``chaosgym.envs.task``.
    lost
        Steps without a usable reading, see ``chaosgym.control.readings``.
    foreign
        Whether a guard found the machine foreign to its policy, and followed the demand; None without a guard.
    """

    speed: Array
    demand: Array
    mean_peak: Array
    measured_speed: Array | None
    largest_force: float
    damage: float
    lost: int
    foreign: bool | None

    @property
    def ran(self) -> Array:
        """Speed of each step, (steps,): as measured, and as set where it was not."""
        if self.measured_speed is None:
            return self.speed
        return np.where(np.isfinite(self.measured_speed), self.measured_speed, self.speed)

    def as_dict(self) -> dict[str, Any]:
        """As plain values."""
        told: dict[str, Any] = {
            "mean_deviation": float(np.abs(self.ran - self.demand).mean()),
            "damage": self.damage,
            "largest_force_N": self.largest_force,
            "speed": self.speed.tolist(),
            "demand": self.demand.tolist(),
            "mean_peak_force_N": [value if np.isfinite(value) else None for value in self.mean_peak.tolist()],
            "steps_without_reading": self.lost,
        }
        if self.foreign is not None:
            told["foreign"] = self.foreign
        if self.measured_speed is not None:
            told["measured_speed"] = self.ran.tolist()
            told["largest_miss_of_the_drive"] = float(np.abs(self.ran - self.speed).max())
        return told

    def lines(self, who: str) -> list[str]:
        """For people, one line for each thing to know."""
        deviation = np.abs(self.ran - self.demand).mean()
        peaks = self.mean_peak[np.isfinite(self.mean_peak)]
        told = [
            f"{who}: {deviation:.2f} off the demand"
            + (" by the speeds that were set (none was measured)" if self.measured_speed is None else "")
            + (f", mean peak {peaks.mean():.1f} N, largest force {self.largest_force:.1f} N" if len(peaks) else "")
        ]
        miss = np.abs(self.ran - self.speed)
        if miss.max() > 0.01 * self.speed.max():
            at = int(miss.argmax())
            told.append(
                f"  the drive did not reach the speed that was set: {miss.mean():.2f} off on average, at worst "
                f"{self.ran[at]:.2f} instead of {self.speed[at]:.2f} in step {at + 1}"
            )
        if self.foreign:
            told.append("  this machine is foreign to the policy, so the guard followed the demand")
        return told + ([f"  no usable reading in {self.lost} of {len(self.speed)} steps"] if self.lost else [])


@dataclass
class _Log:
    """The steps of a job so far; ``peaks`` (cycles, sides) each."""

    task: Task
    speed: list[float] = field(default_factory=list)
    demand: list[float] = field(default_factory=list)
    peaks: list[Array] = field(default_factory=list)
    measured: list[float] = field(default_factory=list)

    def worked(self, lost: int, foreign: bool | None) -> Worked | None:
        """The job; None without a step."""
        if not self.peaks:
            return None
        peaks = np.array(self.peaks)
        finite = np.where(np.isfinite(peaks), peaks, 0.0)
        sensed = peaks.max(axis=-1)
        counted = np.isfinite(sensed)
        total = np.where(counted, sensed, 0.0).sum(axis=1)
        with np.errstate(invalid="ignore"):
            mean = total / counted.sum(axis=1)
        measured = np.array(self.measured)
        return Worked(
            speed=np.array(self.speed),
            demand=np.array(self.demand),
            mean_peak=mean,
            measured_speed=measured if np.isfinite(measured).any() else None,
            largest_force=float(finite.max()),
            damage=float(self.task.damage(finite.reshape(-1, finite.shape[-1])).max()),
            lost=lost,
            foreign=foreign,
        )


def work(plant: Plant, operator: Operator, job: int = 0, name: str = "") -> Worked:
    """Run a job of the operator's task at a plant, by demands that the number ``job`` draws, and ``stop()`` it.

    Raises
    ------
    PlantError
        If the plant fails, or what it returns is no reading; it has the steps that were played.
    """
    task, log = operator.task, _Log(operator.task)
    try:
        with _stopped(plant, name):
            _play(plant, operator, job, name, log)
    except ParameterError as error:
        told = PlantError(str(error))
        told.worked = log.worked(operator.lost, operator.foreign)
        raise told from error
    worked = log.worked(operator.lost, operator.foreign)
    if worked is None:
        raise ParameterError(f"steps = {task.steps} is out of range; allowed: from 1 on")
    return worked


def _play(plant: Plant, operator: Operator, job: int, name: str, log: _Log) -> None:
    """Run the job, and keep its steps in the ``log``."""
    task, cycles = operator.task, operator.task.cycles_per_step
    demands = demand_of(task, np.random.default_rng([HELD_OUT_SEED, job, 1]))
    start = float(np.clip(demands[0] - task.start_below, task.lowest_speed, task.highest_speed))
    with _named(name):
        plant.reset()
    speed = operator.start(speed=start, demand=float(demands[0]))
    peaks, told = _readings(plant, speed, max(cycles, task.run_in_cycles), name, "the run-in")
    for step, demand in enumerate(demands[:-1].tolist(), 1):
        speed = operator.next(peaks[-cycles:].max(axis=-1), demand=demand, **told)
        where = f"step {step} of {task.steps}, cycles {(step - 1) * cycles + 1} to {step * cycles}"
        peaks, told = _readings(plant, speed, cycles, name, where)
        log.speed.append(speed)
        log.demand.append(demand)
        log.peaks.append(peaks)
        log.measured.append(told.get("speed", np.nan))


def _readings(plant: Plant, speed: float, cycles: int, name: str, where: str) -> tuple[Array, dict[str, float]]:
    """Peaks (cycles, sides) [N] of a step, and what else the plant told."""
    try:
        with _named(name):
            answer = plant.run(speed, cycles)
            readings: Mapping[str, Any] = answer if isinstance(answer, Mapping) else {"peaks": answer}
            peaks = np.array(readings.get("peaks", ()), float)
            told = {extra: float(readings[extra]) for extra in EXTRAS if readings.get(extra) is not None}
        if peaks.shape not in ((cycles,), (cycles, 2)):
            raise ParameterError(
                f"plant {name} returned peaks of shape {peaks.shape}; allowed: {cycles} forces, or {cycles} pairs of "
                "the largest and the smallest one"
            )
        if peaks.ndim == 1 and (bad := np.flatnonzero(peaks < 0.0)).size:
            raise ParameterError(
                f"plant {name} returned a peak of {peaks[bad[0]]:g} N in cycle {bad[0] + 1} of the step; allowed: "
                "forces from 0 N on, or pairs of the largest and the smallest one"
            )
    except ParameterError as error:
        raise ParameterError(f"{error} ({where})") from error
    return np.abs(peaks.reshape(cycles, -1)), told
