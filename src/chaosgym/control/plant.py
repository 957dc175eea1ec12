"""A job at a machine that is not simulated here: a class of yours, or a program that reads and writes lines.

A plant has two methods: ``reset()``, before a job, and ``run(speed, cycles)``, which runs it for some cycles at
a speed and returns the largest force of each cycle [N]. Where a trained policy plays, ``run`` returns a mapping with
``peaks``, ``impacts`` (contacts a cycle) and ``bouncing`` (share of the half cycle on one side).
"""

import json
import sys
from collections.abc import Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Protocol, TextIO

import numpy as np

from chaosgym.arrays import Array
from chaosgym.control.operator import Operator
from chaosgym.envs.task import demand_of
from chaosgym.envs.variants import HELD_OUT_SEED
from chaosgym.errors import ParameterError
from chaosgym.files import first_line

EXTRAS = ("impacts", "bouncing")
"""What ``run`` may tell beside the peaks."""


class Plant(Protocol):
    """A machine at work."""

    def reset(self) -> None:
        """Bring the machine to rest, before a job."""
        ...

    def run(self, speed: float, cycles: int) -> Any:
        """Run ``cycles`` operating cycles at a speed; return the peaks [N], (cycles,), or a mapping with them."""
        ...


class Lines:
    """A plant behind two streams of text, one line each way.

    It is told ``reset``, which has no answer, and ``run SPEED CYCLES``, whose answer is a line of as many forces [N],
    or one JSON object with ``peaks`` and what else the sensors tell; ``done`` comes last.
    """

    def __init__(self, heard: TextIO, told: TextIO) -> None:
        self._heard, self._told = heard, told

    def reset(self) -> None:
        """Tell the plant to come to rest."""
        print("reset", file=self._told, flush=True)

    def run(self, speed: float, cycles: int) -> Any:
        """Request a step, and read the line that answers it."""
        print(f"run {speed:.10g} {cycles}", file=self._told, flush=True)
        line = self._heard.readline()
        if not line:
            raise ParameterError("standard input ended; allowed: a line of forces for each line run SPEED CYCLES")
        try:
            return json.loads(line) if line.lstrip().startswith("{") else [float(word) for word in line.split()]
        except ValueError:
            raise ParameterError(f"{line.strip()[:60]!r} is no line of forces [N]; allowed: 81.2 80.9 ...") from None

    def done(self) -> None:
        """Tell the plant that the job has ended."""
        print("done", file=self._told, flush=True)


def plant_of(name: str) -> Plant:
    """Make the plant ``module:Class``, found from the current folder too; ``-`` is standard input and output.

    Raises
    ------
    ParameterError
        If there is no such class, if it can't be made, or if it has no ``reset`` or ``run``.
    """
    if name == "-":
        return Lines(sys.stdin, sys.stdout)
    module, colon, kind = name.partition(":")
    if not (module and colon and kind):
        raise ParameterError(
            f"plant = {name!r} is not usable; allowed: module:Class, or - for standard input and output"
        )
    with _told(name), _from_here():
        found = getattr(import_module(module), kind)()
    for method in ("reset", "run"):
        if not callable(getattr(found, method, None)):
            raise ParameterError(f"plant {name} has no method {method}; it needs reset() and run(speed, cycles)")
    plant: Plant = found
    return plant


@contextmanager
def _from_here() -> Any:
    sys.path.insert(0, "")
    try:
        yield
    finally:
        sys.path.remove("")


@contextmanager
def _told(name: str) -> Any:
    """Report any error in the code of a plant in one line."""
    try:
        yield
    except ParameterError:
        raise
    except Exception as error:
        raise ParameterError(f"plant {name} failed: {type(error).__name__}: {first_line(error)}") from error


@dataclass(frozen=True)
class Worked:
    """A job at a plant.

    Attributes
    ----------
    speed, demand, mean_peak : (steps,)
        Of each step; the force in newton.
    largest_force
        Of all cycles [N].
    damage
        Of the joint by the peaks that were measured, see ``chaosgym.envs.task``.
    """

    speed: Array
    demand: Array
    mean_peak: Array
    largest_force: float
    damage: float

    def as_dict(self) -> dict[str, Any]:
        """As plain values."""
        return {
            "mean_deviation": float(np.abs(self.speed - self.demand).mean()),
            "damage": self.damage,
            "largest_force_N": self.largest_force,
            "speed": self.speed.tolist(),
            "demand": self.demand.tolist(),
            "mean_peak_force_N": self.mean_peak.tolist(),
        }


def work(plant: Plant, operator: Operator, job: int = 0, name: str = "") -> Worked:
    """Run a job of the operator's task at a plant, with demands that the number ``job`` draws.

    Raises
    ------
    ParameterError
        If the plant fails, or what it returns is not usable.
    """
    task = operator.task
    demands = demand_of(task, np.random.default_rng([HELD_OUT_SEED, job, 1]))
    start = float(np.clip(demands[0] - task.start_below, task.lowest_speed, task.highest_speed))
    with _told(name):
        plant.reset()
    speed, cycles = operator.start(speed=start, demand=float(demands[0])), task.cycles_per_step
    kept: list[tuple[float, Array]] = []
    readings = _readings(plant, speed, max(cycles, task.run_in_cycles), name)
    for demand in demands[:-1].tolist():
        last = readings["peaks"][-cycles:]
        told = {extra: readings[extra] for extra in EXTRAS if extra in readings}
        speed = operator.next(last, demand=demand, **told)
        readings = _readings(plant, speed, cycles, name)
        kept.append((speed, np.asarray(readings["peaks"], float)))
    peaks = np.array([felt for _, felt in kept])
    return Worked(
        speed=np.array([speed for speed, _ in kept]),
        demand=demands[:-1],
        mean_peak=peaks.mean(axis=1),
        largest_force=float(peaks.max()),
        damage=float(task.damage(peaks.reshape(-1, 1)).max()),
    )


def _readings(plant: Plant, speed: float, cycles: int, name: str) -> Mapping[str, Any]:
    """Validated readings of a step."""
    with _told(name):
        found = plant.run(speed, cycles)
        readings: Mapping[str, Any] = found if isinstance(found, Mapping) else {"peaks": found}
        peaks: Sequence[float] | Array = readings.get("peaks", ())
        felt = np.asarray(peaks, float)
    if felt.shape != (cycles,) or not np.isfinite(felt).all() or felt.min() < 0.0:
        raise ParameterError(
            f"plant {name} returned peaks of shape {felt.shape}; allowed: {cycles} finite forces from 0 N on"
        )
    return readings
