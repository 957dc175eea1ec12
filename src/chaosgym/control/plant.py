"""A job at a plant, a machine that is not simulated here (``chaosgym.plants``)."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.control.operator import Operator
from chaosgym.envs.task import Task, demand_of
from chaosgym.envs.variants import HELD_OUT_SEED
from chaosgym.errors import ParameterError
from chaosgym.files import first_line
from chaosgym.plants.plant import Plant, named, readings_of


class PlantError(ParameterError):
    """A plant failed, or returned what is no reading.

    Attributes
    ----------
    worked
        The steps that were played before; None if there were none.
    """

    worked: "Worked | None" = None


class Interrupted(KeyboardInterrupt):
    """Ctrl-C in a job, with the steps that were played before, as of ``PlantError``."""

    worked: "Worked | None" = None


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
            said = first_line(error) if error.args else "Ctrl-C"
            error.args = (f"{said}; stop() failed too: {type(other).__name__}: {first_line(other)}",)
        raise
    with named(f"{name}: stop()"):
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
        Whether a guard found the machine foreign to its policy; None without a guard.
    statement
        What it did then; "" if it did not.
    """

    speed: Array
    demand: Array
    mean_peak: Array
    measured_speed: Array | None
    largest_force: float
    damage: float
    lost: int
    foreign: bool | None
    statement: str

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
        told += [f"  {self.statement}"] if self.statement else []
        return told + ([f"  no usable reading in {self.lost} of {len(self.speed)} steps"] if self.lost else [])


@dataclass
class _Log:
    """The steps of a job so far; ``peaks`` (cycles, sides) each."""

    task: Task
    speed: list[float] = field(default_factory=list)
    demand: list[float] = field(default_factory=list)
    peaks: list[Array] = field(default_factory=list)
    measured: list[float] = field(default_factory=list)

    def worked(self, operator: Operator) -> Worked | None:
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
            lost=operator.lost,
            foreign=operator.foreign,
            statement=operator.statement,
        )


def work(plant: Plant, operator: Operator, job: int = 0, name: str = "") -> Worked:
    """Run a job of the operator's task at a plant, by demands that the number ``job`` draws, and ``stop()`` it.

    Raises
    ------
    PlantError, Interrupted
        If the plant fails, or what it returns is no reading, and after Ctrl-C; it has the steps that were played.
    """
    task, log = operator.task, _Log(operator.task)
    try:
        with _stopped(plant, name):
            _play(plant, operator, job, name, log)
    except (ParameterError, KeyboardInterrupt) as error:
        told = PlantError(str(error)) if isinstance(error, ParameterError) else Interrupted(str(error) or "Ctrl-C")
        told.worked = log.worked(operator)
        raise told from error
    worked = log.worked(operator)
    if worked is None:
        raise ParameterError(f"steps = {task.steps} is out of range; allowed: from 1 on")
    return worked


def _play(plant: Plant, operator: Operator, job: int, name: str, log: _Log) -> None:
    """Run the job, and keep its steps in the ``log``."""
    task, cycles = operator.task, operator.task.cycles_per_step
    demands = demand_of(task, np.random.default_rng([HELD_OUT_SEED, job, 1]))
    start = float(np.clip(demands[0] - task.start_below, task.lowest_speed, task.highest_speed))
    with named(name):
        plant.reset()
    speed = operator.start(speed=start, demand=float(demands[0]))
    peaks, told = readings_of(plant, speed, max(cycles, task.run_in_cycles), name, "the run-in")
    for step, demand in enumerate(demands[:-1].tolist(), 1):
        speed = operator.next(peaks[-cycles:].max(axis=-1), demand=demand, **told)
        where = f"step {step} of {task.steps}, cycles {(step - 1) * cycles + 1} to {step * cycles}"
        peaks, told = readings_of(plant, speed, cycles, name, where)
        log.speed.append(speed)
        log.demand.append(demand)
        log.peaks.append(peaks)
        log.measured.append(told.get("speed", np.nan))
