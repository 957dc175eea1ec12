"""Any machine: which one of a pool is at work, and what its speeds and forces are shares of.

The pool was drawn from ``chaosgym.machines.family`` and filtered; its file tells kind and number of each machine that
was kept, and its rated force, by ``python -m benchmarks pool``. A split is a part of the file:

    train             driven by a force or an unbalance
    test              others of these kinds
    other_machines    two kinds on which nothing was tuned: on a moving base, and gear pairs
"""

from functools import lru_cache
from importlib import resources
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.envs.task import Task
from chaosgym.envs.variants import HELD_OUT_SEED, Units, check_split, numbers_of
from chaosgym.machines.batch import CompiledBatch
from chaosgym.machines.family import KINDS, Ranged, drawn_machine
from chaosgym.machines.machine import Machine

ANY = "any"
"""What ``machine`` is where each job draws one of the pool."""

SHARE = "of the range"
"""Unit of its speeds; a measured force is a share of the rated one."""

SPLITS = ("train", "test", "other_machines")

POOL_SEED = 51_000_000
"""Machine k of a kind is drawn by the generator of (this, place of the kind, k)."""


TRIM, REACH = 1.0 / 56.0, 8
"""Smallest change of the trim, as a share of the range of speed, and the largest trim in these."""


class Kept(NamedTuple):
    """A machine of the pool: its ``split``, ``kind`` and ``number``, and its rated ``force`` [N]."""

    split: str
    kind: str
    number: int
    force: float


def read_pool() -> list[Kept]:
    """Read the machines of the pool."""
    lines = resources.files("chaosgym.envs").joinpath("pool.csv").read_text().split()[1:]
    rows = (line.split(",") for line in lines)
    return [Kept(split, kind, int(number), float(force)) for split, kind, number, force in rows]


@lru_cache(maxsize=2048)
def machine_of(kind: str, number: int) -> Ranged:
    """Machine of a kind by its number."""
    return drawn_machine(kind, np.random.default_rng([POOL_SEED, KINDS.index(kind), number]))


class Pool:
    """Machines of the pool, as ``Variants`` are of one machine.

    Parameters
    ----------
    split
        "train", "test" or "other_machines"; None draws those of training, and keeps those of the test for evaluation.

    Raises
    ------
    ParameterError
        If there is no such split.
    """

    def __init__(self, split: str | None = None) -> None:
        check_split(split, SPLITS)
        self.split, self.seed = split, HELD_OUT_SEED
        self.tolerances: dict[str, float] = {}
        kept = read_pool()
        self._drawn = [row for row in kept if row.split == (split or "train")]
        self._held_out = [row for row in kept if row.split == (split or "test")]
        self.count = len(self._held_out)
        self._force: dict[Machine, tuple[Ranged, float]] = {}
        self.nominal: Machine = self._made(self._drawn[0])

    def _made(self, row: Kept) -> Machine:
        found = machine_of(row.kind, row.number)
        self._force[found.machine] = found, row.force
        return found.machine

    def drawn(self, generator: np.random.Generator) -> Machine:
        """Draw a machine."""
        return self._made(self._drawn[int(generator.integers(len(self._drawn)))])

    def batch(self, count: int) -> CompiledBatch:
        """As ``Variants.batch``."""
        return self.nominal.batch(count)

    def held_out(self, number: int) -> Machine:
        """Return machine ``number`` of the evaluation."""
        return self._made(self._held_out[number])

    def units(self, machine: Machine) -> Units:
        """Its range of speed [Hz] and its rated force [N]."""
        found, force = self._force[machine]
        return Units(found.lowest, found.highest - found.lowest, force)

    def checked_numbers(self, given: Any, count: int) -> NDArray[np.int64]:
        """As ``Variants.checked_numbers``."""
        return numbers_of(given, count, self.count)


def pool_task() -> Task:
    """Task of any machine: speeds are shares of its range, forces of its rated force; as that of a file of one's own.

    Whoever follows the demand has as much damage in a job as on the beam.
    """
    return Task(
        lowest_speed=0.0,
        highest_speed=1.0,
        slew_limit=1.0 / 7.0,
        trim_step=TRIM,
        largest_trim=REACH * TRIM,
        lowest_demand=1.0 / 7.0,
        highest_demand=1.0,
        smallest_change=1.0 / 14.0,
        largest_change=2.0 / 7.0,
        start_below=1.0 / 7.0,
        deviation_weight=3.5,
        speed_ripple=0.002,
        sensor_error=0.0125,
        reference_force=1.0,
    )
