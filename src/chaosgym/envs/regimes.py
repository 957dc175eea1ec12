"""At which speeds is a machine Type III? A table over the range of its drive, by a full diagnosis at each speed.

Reward and score use this table, never a classifier that an agent may see. A table is computed once on a computer, with
a progress bar, and kept beside the compiled kernels under a hash of everything that it depends on.
"""

import hashlib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from os import cpu_count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from chaosgym.core import KERNEL_CACHE
from chaosgym.design.rating_life import LIFE_EXPONENT
from chaosgym.errors import SimulationError
from chaosgym.files import write_atomically
from chaosgym.machines.machine import Machine
from chaosgym.simulation.batch import at_speed
from chaosgym.version import __version__

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

HORIZON = 400
"""Cycles from rest after which a response that has not become periodic counts as irregular."""

PERIODIC = 0
"""Number of "periodic" in ``chaosgym.diagnosis.NATURES``."""


def nearest(grid: Array, values: Any) -> NDArray[np.int64]:
    """Return the places of the entries of an evenly spaced grid (n,) that are nearest to values (...)."""
    spacing = grid[1] - grid[0] if len(grid) > 1 else 1.0
    places = np.rint((np.asarray(values) - grid[0]) / spacing)
    return np.asarray(np.clip(places, 0, len(grid) - 1), np.int64)


@dataclass(frozen=True, eq=False)
class RegimeTable:
    """Response of one machine, from rest, at evenly spaced speeds.

    Attributes
    ----------
    speeds : (n,)
        In the unit of the machine's speed field.
    nature : (n,)
        As int8: 0 periodic, 1 quasiperiodic, 2 chaotic, 3 undetermined.
    equivalent_force : (n,)
        Constant force [N] that wears the worse surface as the settled peak forces do: (mean of F^p)^(1/p), p = 10/3.
    peak_force : (n,)
        Largest settled peak force [N].
    """

    speeds: Array
    nature: NDArray[np.int8]
    equivalent_force: Array
    peak_force: Array

    @property
    def periodic(self) -> Flags:
        """Where the response is periodic, (n,)."""
        return np.asarray(self.nature == PERIODIC)

    @cached_property
    def type_iii(self) -> Flags:
        """Where the response is not periodic, or that of both neighbours is not, (n,)."""
        irregular = np.pad(~self.periodic, 1)
        return np.asarray(irregular[1:-1] | (irregular[:-2] & irregular[2:]))

    def index_of(self, speed: Any) -> NDArray[np.int64]:
        """Return the places of the speeds in the table nearest to ``speed`` (...)."""
        return nearest(self.speeds, speed)

    def is_type_iii(self, speed: Any) -> Flags:
        """Tell which speeds (...) count as Type III."""
        return np.asarray(self.type_iii[self.index_of(speed)])


def regimes_of(machine: Machine, speeds: Array) -> RegimeTable:
    """Return the table of a machine at evenly spaced speeds (n,): the one kept on disk, or computed now.

    Parameters
    ----------
    machine
        At any speed.
    speeds
        In the unit of the machine's speed field.
    """
    path = _kept_at(machine, speeds)
    if not path.is_file():
        points = diagnosed([at_speed(machine, speed) for speed in speeds.tolist()])
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, lambda temporary: _save(temporary, points))
    nature, equivalent, peak = np.load(path, allow_pickle=False).T
    return RegimeTable(speeds, nature.astype(np.int8), equivalent, peak)


def diagnosed(machines: Sequence[Machine]) -> Array:
    """Diagnose machines side by side, with a progress bar: nature and forces as in a table, (n, 3)."""
    with ThreadPoolExecutor(cpu_count()) as threads:
        points = threads.map(_diagnose, machines)
        bar = tqdm(
            points, total=len(machines), desc=f"regimes of {machines[0].name}", unit="speed", delay=1.0, leave=False
        )
        return np.array(list(bar))


def _diagnose(machine: Machine) -> tuple[float, float, float]:
    """Nature, equivalent force and largest peak force [N]; a motion that can't be followed is undetermined."""
    from chaosgym.diagnosis.diagnose import diagnosed_run
    from chaosgym.diagnosis.response import NATURES

    try:
        verdict, record = diagnosed_run(machine, budget=HORIZON)
    except SimulationError:
        return float(NATURES.index("undetermined")), np.inf, np.inf
    forces = record.peak_force[len(record) // 2 :]
    equivalent = np.mean(forces**LIFE_EXPONENT, axis=0) ** (1.0 / LIFE_EXPONENT)
    return float(NATURES.index(verdict.nature)), float(equivalent.max()), float(forces.max())


def _kept_at(machine: Machine, speeds: Array) -> Path:
    """File of a table: what it depends on is in its name as a hash."""
    at_rest = at_speed(machine, float(speeds[0]))
    described = f"{__version__}\n{HORIZON}\n{speeds.tolist()}\n{at_rest!r}"
    return Path(KERNEL_CACHE, "regimes", f"{hashlib.sha256(described.encode()).hexdigest()[:16]}.npy")


def _save(path: Path, points: Array) -> None:
    with path.open("wb") as file:
        np.save(file, points, allow_pickle=False)
