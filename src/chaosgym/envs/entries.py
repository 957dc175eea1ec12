"""Entries that a keyword adds to the observation: each has a name, bounds, and what fills it.

A field of ``AddedEntries`` is a keyword of the task, and its second choice adds the entry. A new entry is a class and
a field here; spaces, names, policies and the documentation take it from the field.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array, Indices
from chaosgym.envs.classified import RecordsAtSpeed
from chaosgym.envs.kernels.steps import PLACE
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import parameter
from chaosgym.recordings.monitor import HIGHEST, LIMIT, RepeatSums

LEAST_ERROR = 1e-6
"""Error [N] that the monitor of ideal sensors reckons with."""


class Entry:
    """One number of the observation of N jobs side by side.

    Parameters
    ----------
    task
        A ``Task``.
    nominal
        Nominal machine.
    count
        N.
    """

    name: str
    meaning: str

    def __init__(self, task: Any, nominal: Machine, count: int) -> None:
        """Make what the N jobs remember; nothing by default."""

    @staticmethod
    def bounds(task: Any) -> tuple[float, float]:
        """Least and largest value in a ``Task``."""
        raise NotImplementedError

    def forget(self, which: Indices) -> None:
        """Begin anew for the jobs ``which`` (k,)."""

    def values(self, which: Indices, peaks: Array, jobs: NDArray[np.void], seen: NDArray[np.float32]) -> Array:
        """Values (k,) after a step of the jobs ``which`` (k,).

        ``peaks`` (k, cycles) are measured forces [N], ``jobs`` (k,) records ``JOB`` of ``envs.kernels.steps``, ``seen``
        (k, entries) the observations, whose first entries are filled.
        """
        raise NotImplementedError


class MonitorLevel(Entry):
    """Level of ``chaosgym.recordings.monitor``."""

    name, meaning = "monitor_level", "level of the monitor of peak forces, an alarm above 1"

    def __init__(self, task: Any, nominal: Machine, count: int) -> None:
        self._sums, self._error = RepeatSums(count), max(task.sensor_error, LEAST_ERROR)

    @staticmethod
    def bounds(task: Any) -> tuple[float, float]:
        """From 0 to where the sums stop growing."""
        return 0.0, HIGHEST / LIMIT

    def forget(self, which: Indices) -> None:
        """Reset the sums."""
        self._sums.forget(which)

    def values(self, which: Indices, peaks: Array, jobs: NDArray[np.void], seen: NDArray[np.float32]) -> Array:
        """Level after the last of the ``peaks``."""
        for column in peaks.T:
            self._sums.add(which, column, self._error)
        return self._sums.level(which)


class SetPoint(Entry):
    """Set-point of a motor."""

    name, meaning = "set_point", "speed at which the motor gives no torque"

    @staticmethod
    def bounds(task: Any) -> tuple[float, float]:
        """From rest to the highest speed."""
        return 0.0, task.highest_speed

    def values(self, which: Indices, peaks: Array, jobs: NDArray[np.void], seen: NDArray[np.float32]) -> Array:
        """Set-point of the step."""
        return np.asarray(jobs["set_point"])


class IrregularProbability(Entry):
    """What the machine's trained sense of its motion makes of the readings at this speed.

    Attributes
    ----------
    records
        The readings of each job since its speed last changed.
    """

    name = "irregular_probability"
    meaning = "how likely the machine's trained sense holds the motion at this speed irregular"

    def __init__(self, task: Any, nominal: Machine, count: int) -> None:
        self.records = RecordsAtSpeed(nominal, task.sensor_error, count)

    @staticmethod
    def bounds(task: Any) -> tuple[float, float]:
        """A probability."""
        return 0.0, 1.0

    def forget(self, which: Indices) -> None:
        """Drop the records."""
        self.records.forget(which)

    def values(self, which: Indices, peaks: Array, jobs: NDArray[np.void], seen: NDArray[np.float32]) -> Array:
        """Probability by the readings since the last change of speed."""
        impacts, bouncing = seen[:, [PLACE.impacts_per_cycle, PLACE.bouncing_share]].astype(float).T
        self.records.add(which, jobs["speed"], peaks, impacts, bouncing)
        return self.records.irregular_probability(which)


def adds(entry: type[Entry], source: str, choices: tuple[str, str] = ("off", "on")) -> Any:
    """Make a field of a task whose second choice adds an entry; ``source`` says what the field means."""
    about = parameter(choices[0], choices=choices, provenance="assumed", source=source)
    return field(default=choices[0], metadata={**about.metadata, "entry": entry})


@dataclass(frozen=True, kw_only=True)
class AddedEntries:
    """Keywords of a task that add an entry, in the order of the entries."""

    monitor: str = adds(MonitorLevel, "whether the monitor's level is observed too")
    drive: str = adds(
        SetPoint,
        "whether the machine has the speed that is set, or its motor's torque takes it there",
        ("constant", "motor"),
    )
    classifier: str = adds(
        IrregularProbability,
        "whether it is observed how likely the machine's trained sense holds the motion irregular",
    )

    @cached_property
    def added(self) -> tuple[type[Entry], ...]:
        """Entries that follow those of every observation."""
        return tuple(
            entry for keyword, (value, entry) in keywords_of(type(self)).items() if getattr(self, keyword) == value
        )

    @cached_property
    def places(self) -> Mapping[str, int]:
        """Column of each entry of an observation, by name; the order of the observation."""
        return {name: place for place, name in enumerate((*PLACE._fields, *(one.name for one in self.added)))}


def keywords_of(task: type[AddedEntries]) -> dict[str, tuple[str, type[Entry]]]:
    """Keywords of a class of tasks that add an entry: the value that does, and the entry."""
    adding = [one for one in fields(task) if "entry" in one.metadata]
    return {one.name: (one.metadata["parameter"].choices[1], one.metadata["entry"]) for one in adding}
