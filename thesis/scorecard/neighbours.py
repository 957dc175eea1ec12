"""Neighbours of a machine: what it would be if the constants that are not in print were a little different.

A neighbour has every fitted or assumed constant up to 1 % off, runs at speeds up to half a step of the printed grid
off, and begins from another initial state.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from chaosgym.errors import ParameterError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of
from thesis.scorecard.evaluation import evaluate
from thesis.scorecard.observation import QUICK
from thesis.scorecard.verdicts import Judged
from thesis.statements import Comparison
from thesis.statements.comparisons import Axis

NUDGE = 0.01
"""Largest relative change of a constant."""

GRID = {"impact-beam": 1.0, "slider-crank": 10.0}
"""Steps of the thesis' sweeps over the speed [Hz, rpm] (3.5.1, 4.5.1)."""

HASTENED: Mapping[str, Mapping[str, Any]] = {"slider-crank": {"matrix_update_interval": 5.0}}
"""Fields by which quick runs differ from thorough ones, by machine: the thesis itself updates every 5 deg (5.2.2)."""


class Neighbour(NamedTuple):
    """A neighbour: its machine, how far [Hz, rpm] its speeds are shifted, and cycles at another speed that begin it."""

    machine: Machine
    shift: float
    start: int

    def judge(
        self,
        asked: Sequence[Comparison],
        *,
        folder: Path | None = None,
        workers: int | None = None,
        unprinted: Mapping[str, float] | None = None,
    ) -> tuple[Judged, ...]:
        """Judge statements on this neighbour by quick runs; the other arguments are those of ``evaluate``."""
        name = self.machine.name
        moved = [shifted(one, self.machine.speed_field, self.shift) for one in asked]
        efforts = {name: QUICK[name]._replace(start=self.start)}
        bases = {name: self.machine}
        return evaluate(moved, bases, efforts=efforts, folder=folder, workers=workers, unprinted=unprinted)


def neighbour_of(machine: Machine, k: int, seed: int = 0) -> Neighbour:
    """The k-th neighbour of a machine; the same k and seed differ from every machine by the same shares."""
    rng = np.random.default_rng((seed, k))
    nearby = nudged(machine, rng)
    return Neighbour(nearby, float(rng.uniform(-0.5, 0.5)) * GRID[machine.name], 1 + k)


def nudged(machine: Machine, rng: np.random.Generator) -> Machine:
    """The machine with every constant that is not in print up to 1 % off."""
    described = parameters_of(machine)
    while True:
        factors = {
            name: getattr(machine, name) * (1.0 + NUDGE * rng.uniform(-1.0, 1.0))
            for name, about in described.items()
            if about.provenance in ("calibrated", "assumed") and isinstance(getattr(machine, name), float)
        }
        factors.pop("matrix_update_interval", None)
        try:
            return replace(machine, **factors, **HASTENED.get(machine.name, {}))
        except ParameterError:  # an inertia just below what its offset mass requires
            continue


def shifted(one: Comparison, field: str, shift: float) -> Comparison:
    """The statement at speeds that are shifted, where it has any."""
    at = tuple({**here, field: here[field] + shift} if field in here else here for here in one.at)
    return replace(one, at=at, along=_moved(one.along, field, shift), across=_moved(one.across, field, shift))


def _moved(axis: Axis | None, field: str, shift: float) -> Axis | None:
    if axis is None or axis.field != field:
        return axis
    return axis._replace(low=axis.low + shift, high=axis.high + shift)
