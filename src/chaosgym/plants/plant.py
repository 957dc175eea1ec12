"""A machine that is not simulated here: a class of yours, a program that reads and writes lines, or an FMU.

A plant has two methods: ``reset()``, before a job, and ``run(speed, cycles)``, which runs it for some cycles at
a speed and returns the largest force of each cycle [N]; with two stops (cycles, 2), the largest and the smallest force
of each. A mapping may tell more: ``peaks``, the measured ``speed``, and what a trained policy looks at, ``impacts``
(contacts a cycle) and ``bouncing`` (share of the half cycle on one side). A method ``stop()`` brings the machine to
rest; it is called after every job, however that ends.
"""

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from typing import Any, Protocol

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import ParameterError
from chaosgym.files import first_line

EXTRAS = ("impacts", "bouncing", "speed")
"""What ``run`` may tell beside the peaks."""

FEWEST = 5
"""Cycles of a reading at least: peaks are compared with those four cycles before."""

LONGEST_HOLD = 2
"""Steps without a reading for which what was read last still counts (assumed)."""


class Plant(Protocol):
    """A machine at work. It may have ``stop()`` too, which brings it to rest after a job."""

    def reset(self) -> None:
        """Bring the machine to rest, before a job."""
        ...

    def run(self, speed: float, cycles: int) -> Any:
        """Run ``cycles`` operating cycles at a speed; return the peaks [N], (cycles,), or a mapping with them."""
        ...


def plant_of(name: str, **arguments: Any) -> Plant:
    """Make the plant ``module:Class``, found from the current folder too; ``-`` is standard input and output.

    ``arguments`` are those of the class; of ``-``, ``seconds`` for which an answer is waited for.

    Raises
    ------
    ParameterError
        If there is no such class, if it can't be made, or if it has no ``reset`` or ``run``.
    """
    if name == "-":
        from chaosgym.plants.lines import Lines

        with named(name):
            return Lines(sys.stdin, sys.stdout, **arguments)
    module, colon, kind = name.partition(":")
    if not (module and colon and kind):
        raise ParameterError(
            f"plant = {name!r} is not usable; allowed: module:Class, or - for standard input and output"
        )
    with named(name), _from_here():
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
def named(name: str) -> Iterator[None]:
    """Report any error in the code of a plant in one line."""
    try:
        yield
    except ParameterError:
        raise
    except (Exception, SystemExit) as error:
        raise ParameterError(f"plant {name} failed: {type(error).__name__}: {first_line(error)}") from error


def readings_of(plant: Plant, speed: float, cycles: int, name: str, where: str) -> tuple[Array, dict[str, float]]:
    """Peaks (cycles, sides) [N] of a step, and what else the plant told."""
    try:
        with named(name):
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


def longest_finite(peaks: Array) -> Array:
    """The longest stretch of finite peaks (cycles, ...), since peaks are compared with those of cycles before.

    Examples
    --------
    >>> from chaosgym.plants.plant import longest_finite
    >>> longest_finite(np.array([70.0, np.nan, 80.0, 95.0, 80.0, np.inf, 70.0]))
    array([80., 95., 80.])
    """
    good = np.isfinite(peaks.reshape(len(peaks), -1)).all(axis=1)
    edges = np.array([-1, *np.flatnonzero(~good), len(peaks)])
    first = int(np.diff(edges).argmax())
    return peaks[edges[first] + 1 : edges[first + 1]]


def filled(peaks: Array) -> Array | None:
    """Peaks (cycles, sides) of which the longest stretch of finite ones goes on as it repeats best; None without one.

    Examples
    --------
    >>> from chaosgym.plants.plant import filled
    >>> filled(np.array([np.nan, 80.0, 95.0, 80.0, 95.0, 80.0])[:, None])[:, 0]
    array([80., 95., 80., 95., 80., 95.])
    """
    whole = longest_finite(peaks)
    missing = len(peaks) - len(whole)
    if missing == 0:
        return peaks
    if len(whole) < FEWEST:
        return None
    period = min(range(1, FEWEST), key=lambda lag: float(np.abs(whole[lag:] - whole[:-lag]).mean()))
    return np.concatenate([whole, np.resize(whole[-period:], (missing, peaks.shape[1]))])
