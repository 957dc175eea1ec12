"""Machines of the jobs: drawn within tolerances, without limit, or kept for evaluation.

A draw is a point of a cube: for each field that varies a share from -1 to 1 of its half width. A split is a part of
that cube, or what lies around it, so that no two splits share a machine:

    train       three of four cells of a checkerboard with eight cells to a side
    test        the fourth of them
    outside     one field, in turn, at one to two half widths from the nominal value, the others within
    corner      every field at one to one and a half half widths

Each cell of the test has cells of training on all sides: a policy interpolates there. In ``outside`` and ``corner`` it
extrapolates.

``other_simulator`` has the machines of the test, simulated by Exudyn.
"""

from collections.abc import Mapping, Sequence
from hashlib import sha256
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.errors import ParameterError
from chaosgym.machines.batch import CompiledBatch
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import by_field, with_settings
from chaosgym.numbers import shown
from chaosgym.version import __version__

HELD_OUT, SEALED = 256, 512
"""Machines of an evaluation, and of the sealed one."""

HELD_OUT_SEED = 34_000_000
"""Machine k of the evaluation is drawn by the generator of (this, k), and its job is reset with this + k."""

DRAWN = -1
"""Number of a machine that was drawn for its job."""

OTHER_SIMULATOR = "other_simulator"

IN_EXUDYN = "impact-beam"
"""Machine that runs in Exudyn too."""

SPLITS = ("train", "test", "outside", "corner", OTHER_SIMULATOR)

ELSEWHERE = {
    "other_machines": "chaosgym/AnyMachine-v0 has it, and `chaosgym compare FILE` plays a machine's file",
    OTHER_SIMULATOR: "the impact beam alone has it, such as chaosgym/ImpactBeamTolerance-v1",
}
"""Which environment has a split that not all have."""

CELLS, EVERY = 8, 4
"""Cells along a side of the checkerboard, and of how many neighbours one is the test's."""


def sealed_seed() -> int:
    """Seed of the sealed machines: another one for each release, so that no development has played them."""
    return 1_000_000_000 + int.from_bytes(sha256(f"chaosgym {__version__}".encode()).digest()[:3])


class Variants:
    """Machines within tolerances of a nominal one.

    Parameters
    ----------
    nominal
        What they are variants of.
    tolerances
        Half width of each field that varies, as a share of its nominal value; uniform within.
    split
        One of ``SPLITS``; None for all that lies within the tolerances.
    sealed
        Whether the machines kept for evaluation are those of the release.

    Raises
    ------
    ParameterError
        If a field is unknown, a tolerance is no number from 0 to 0.9, or a split is unknown or of one machine.
    """

    def __init__(
        self, nominal: Machine, tolerances: Mapping[str, float], split: str | None = None, *, sealed: bool = False
    ) -> None:
        for name, width in tolerances.items():
            if isinstance(width, str | bool) or not hasattr(width, "__float__") or not 0.0 <= float(width) <= 0.9:
                raise ParameterError(f"tolerances[{name!r}] = {width!r} is out of range; allowed: 0 to 0.9")
        tolerances = by_field(nominal, tolerances)
        with_settings(nominal, {name: getattr(nominal, name, None) for name in tolerances})
        check_split(split, SPLITS if nominal.name == IN_EXUDYN else SPLITS[:-1])
        if split is not None and not any(tolerances.values()):
            raise ParameterError(f"split = {split!r} needs machines that differ; there is one without tolerances")
        self.nominal, self.split = nominal, split
        self.tolerances = {name: float(width) for name, width in tolerances.items()}
        self.count, self.seed = (SEALED, sealed_seed()) if sealed else (HELD_OUT, HELD_OUT_SEED)

    def drawn(self, generator: np.random.Generator, number: int | None = None) -> Machine:
        """Draw a machine; ``number`` selects the field that lies outside, where one does."""
        shares = self.shares(generator, number)
        items = zip(self.tolerances.items(), shares.tolist(), strict=True)
        values = {name: getattr(self.nominal, name) * _factor(width, share) for (name, width), share in items}
        return with_settings(self.nominal, values) if values else self.nominal

    def shares(self, generator: np.random.Generator, number: int | None = None) -> NDArray[np.float64]:
        """Draw the shares (fields,) of a machine: how far each field lies from its nominal value, in half widths."""
        shares = generator.uniform(-1.0, 1.0, len(self.tolerances))
        if self.split == "outside":
            row = int(generator.integers(2 * len(shares))) if number is None else number % (2 * len(shares))
            shares[row // 2] = (1.0 + generator.random()) * (1.0, -1.0)[row % 2]
        elif self.split == "corner":
            shares = np.copysign(1.0 + 0.5 * np.abs(shares), shares)
        elif self.split is not None:
            while in_test(shares) != (self.split != "train"):
                shares = generator.uniform(-1.0, 1.0, len(shares))
        return np.asarray(shares)

    def batch(self, count: int) -> CompiledBatch:
        """Return ``count`` machines that move side by side, in the simulator of the split.

        Raises
        ------
        ChaosgymError
            If Exudyn is needed and not installed.
        """
        if self.split != OTHER_SIMULATOR:
            return self.nominal.batch(count)
        from chaosgym.envs.exudyn_beam import ExudynBatch

        return ExudynBatch(self.nominal, count)

    def held_out(self, number: int) -> Machine:
        """Return machine ``number`` of the evaluation."""
        return self.drawn(np.random.default_rng([self.seed, number]), number)

    def units(self, machine: Machine) -> "Units":
        """Speeds and forces of a task are the machine's own."""
        return OWN

    def checked_numbers(self, given: Any, count: int) -> NDArray[np.int64]:
        """Return numbers of held-out machines for ``count`` jobs, (count,); raises as ``numbers_of``."""
        return numbers_of(given, count, self.count)


class Units(NamedTuple):
    """What a task's speeds and forces are on a machine: its speed is ``lowest + span`` times that of the task, in the
    unit of its speed field, and a force of the task is a share of ``force`` [N]."""

    lowest: float
    span: float
    force: float


OWN = Units(0.0, 1.0, 1.0)


def numbers_of(given: Any, count: int, kept: int) -> NDArray[np.int64]:
    """Return numbers of held-out machines, of which there are ``kept``, for ``count`` jobs, (count,).

    Raises
    ------
    ParameterError
        If they are not one whole number below that of the machines, or one for each job.
    """
    numbers = np.asarray(given)
    whole = np.issubdtype(numbers.dtype, np.integer) and numbers.shape in ((), (count,))
    if not whole or numbers.min() < 0 or numbers.max() >= kept:
        raise ParameterError(
            f"options['machine'] = {shown(given)} is out of range; allowed: a whole number from 0 to {kept - 1}"
            + (f", or {count} of them" if count > 1 else "")
        )
    return np.broadcast_to(numbers, count).astype(np.int64)


def check_split(split: str | None, allowed: Sequence[str]) -> None:
    """Raise ``ParameterError`` if there is no such split, with who has it."""
    if split is not None and split not in allowed:
        elsewhere = f"; {ELSEWHERE[split]}" if split in ELSEWHERE else ""
        raise ParameterError(f"split = {split!r} is not one of {', '.join(allowed)}{elsewhere}")


def in_test(shares: NDArray[np.float64]) -> bool:
    """Whether a draw (fields,) of shares lies in a cell of the test."""
    cells = np.floor(0.5 * CELLS * (shares + 1.0)).astype(int)
    return int(cells.sum()) % EVERY == 1


def _factor(width: float, share: float) -> float:
    """Value over the nominal one; below -1 by powers, so that it stays positive."""
    return 1.0 + width * share if share >= -1.0 else float((1.0 - width) ** -share)
