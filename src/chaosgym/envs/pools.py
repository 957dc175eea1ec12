"""Which machines does an agent meet? Fixed, seeded pools, one to learn on and one held out, with their regime tables.

A machine is the nominal one times factors drawn uniformly within the manufacturing tolerances. The tables are shipped,
remade by ``chaosgym regimes make``; where the nominal machine is another one, each machine of its pools gets its tables
when it is first used.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import trange

from chaosgym.envs.drive import SpeedDrive
from chaosgym.envs.regimes import HORIZON, RegimeTable, regimes_of
from chaosgym.errors import ParameterError
from chaosgym.files import write_atomically
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.simulation.batch import at_speed
from chaosgym.version import __version__

Array = NDArray[np.float64]

WORN = (1.0, 1.2, 1.4, 1.6, 1.8, 2.0)
"""Clearances, as multiples of that of the new machine, at which the regimes of a wearing machine are known."""

SIZES = {
    "tolerance": {"nominal": 1, "training": 128, "held-out": 32},
    "wear": {"nominal": 1, "training": 32, "held-out": 16},
}
"""Machines of each pool, by what happens to them."""

SEEDS = {"tolerance": 8_001, "wear": 8_002}
"""Of the factors."""


@dataclass(frozen=True, eq=False)
class PoolFile:
    """Machines of the pools of one nominal machine and task, one row each, those of ``SIZES`` in turn.

    Tables may be missing for the last rows.

    Attributes
    ----------
    about
        The nominal machine, the tolerances of the fields that vary, and how the file was made.
    factors : (m, fields)
        On the nominal values.
    speeds : (n,)
        Of the tables.
    nature, equivalent_force, peak_force : (rows with tables, levels, n)
        As in ``RegimeTable``, at each clearance.
    """

    about: Mapping[str, Any]
    factors: Array
    speeds: Array
    nature: NDArray[np.int8]
    equivalent_force: NDArray[np.float32]
    peak_force: NDArray[np.float32]

    def tables(self, row: int, speeds: slice) -> tuple[RegimeTable, ...]:
        """Tables of one machine over a part of the speeds, one for each clearance."""
        levels = zip(self.nature[row], self.equivalent_force[row], self.peak_force[row], strict=True)
        return tuple(
            RegimeTable(self.speeds[speeds], nature[speeds], force[speeds].astype(float), peak[speeds].astype(float))
            for nature, force, peak in levels
        )


def worn(machine: Machine, ratio: float) -> Machine:
    """Return a machine with a multiple of its clearance."""
    return with_settings(machine, {machine.clearance_field: ratio * getattr(machine, machine.clearance_field)})


@lru_cache
def shipped(name: str, task: str) -> PoolFile | None:
    """Read the pools of a machine for a task, "tolerance" or "wear"; None if there are none."""
    path = resources.files("chaosgym") / "envs" / "tables" / f"{name}-{task}.npz"
    if not path.is_file():
        return None
    with resources.as_file(path) as file, np.load(file, allow_pickle=False) as kept:
        arrays = {key: kept[key] for key in kept.files}
    return PoolFile(json.loads(str(arrays.pop("about"))), **arrays)


class Pool:
    """Machines that jobs are drawn from.

    Parameters
    ----------
    nominal
        What the machines are variants of.
    drive
        Whose range the tables cover.
    tolerances
        Half width of each field that varies, as a share of its nominal value.
    name
        "nominal" for the nominal machine alone, "training" or "held-out".
    wear
        Whether clearances grow.

    Raises
    ------
    ParameterError
        If there is no such pool.
    """

    def __init__(
        self,
        nominal: Machine,
        drive: SpeedDrive,
        tolerances: Mapping[str, float],
        name: str = "nominal",
        wear: bool = False,
    ) -> None:
        self.nominal, self.drive, self.tolerances = at_speed(nominal, drive.lowest_speed), drive, dict(tolerances)
        self.name, self.task = name, "wear" if wear else "tolerance"
        self.levels = np.array(WORN if wear else WORN[:1])
        sizes = SIZES[self.task]
        if name not in sizes:
            raise ParameterError(f"pool = {name!r} is not one of {', '.join(sizes)}")
        self._first = sum(list(sizes.values())[: list(sizes).index(name)])
        self._size = sizes[name]
        self.factors = drawn_factors(list(tolerances.values()), sum(sizes.values()) - 1, SEEDS[self.task])
        self._kept: dict[int, tuple[RegimeTable, ...]] = {}

    @property
    def drawn(self) -> Array:
        """Factors of the machines of this pool, (machines, fields)."""
        return self.factors[self._first : self._first + self._size]

    def sister(self, name: str) -> "Pool":
        """Return the pool of another name with the same nominal machine."""
        return Pool(self.nominal, self.drive, self.tolerances, name, self.wears)

    @property
    def possible(self) -> "Pool":
        """Machines that an agent has to reckon with: those of the training pool, or the nominal one that it knows."""
        return self if self.name == "nominal" else self.sister("training")

    @property
    def wears(self) -> bool:
        """Whether clearances grow."""
        return len(self.levels) > 1

    def __len__(self) -> int:
        return self._size

    def __getitem__(self, k: int) -> Machine:
        """Machine k, new and at the lowest speed."""
        return self.machine_with(self.factors[self._first + k])

    def machine_with(self, factors: Array) -> Machine:
        """Return the nominal machine times factors (fields,), at the lowest speed."""
        pairs = zip(self.tolerances, factors.tolist(), strict=True)
        return with_settings(self.nominal, {name: getattr(self.nominal, name) * factor for name, factor in pairs})

    def regimes_of(self, machine: Machine) -> tuple[RegimeTable, ...]:
        """Return tables of any machine, one for each of ``levels``, computed unless they are kept on disk."""
        return self._computed(machine, self.speeds)

    def regimes(self, k: int) -> tuple[RegimeTable, ...]:
        """Tables of machine k, one for each of ``levels``."""
        return self._tables(self._first + k)

    @property
    def nominal_regimes(self) -> tuple[RegimeTable, ...]:
        """Tables of the nominal machine, one for each of ``levels``."""
        return self._tables(0)

    @cached_property
    def speeds(self) -> Array:
        """Speeds of the tables, (n,): those of the shipped ones, as far as the drive needs them, or its own."""
        return self.drive.regime_speeds if self._shipped is None else self._shipped.speeds[self._needed]

    def checked(self, machine: Any) -> NDArray[np.int64]:
        """Return numbers of machines (...).

        Raises
        ------
        ParameterError
            If they are not whole numbers from 0 to the size of the pool less one.
        """
        numbers = np.asarray(machine)
        if numbers.dtype.kind not in "iu" or np.any((numbers < 0) | (numbers >= len(self))):
            raise ParameterError(
                f"options['machine'] = {machine!r} is out of range; allowed: whole numbers from 0 to {len(self) - 1}"
            )
        return numbers.astype(np.int64)

    @cached_property
    def _shipped(self) -> PoolFile | None:
        """The shipped tables, if they are those of these machines and cover the range of the drive."""
        file = shipped(self.nominal.name, self.task)
        if file is None or not np.array_equal(file.factors, self.factors):
            return None
        same = file.about["machine"] == repr(at_speed(self.nominal, float(file.speeds[0])))
        covers = file.speeds[0] <= self.drive.lowest_speed and self.drive.highest_speed <= file.speeds[-1]
        return file if same and covers else None

    @cached_property
    def _needed(self) -> slice:
        """Part of the shipped speeds that covers the range of the drive."""
        assert self._shipped is not None
        speeds, (lowest, highest) = self._shipped.speeds, (self.drive.lowest_speed, self.drive.highest_speed)
        return slice(int(np.searchsorted(speeds, lowest, "right")) - 1, int(np.searchsorted(speeds, highest)) + 1)

    def _tables(self, row: int) -> tuple[RegimeTable, ...]:
        if row not in self._kept:
            file = self._shipped
            if file is None or row >= len(file.nature):
                self._kept[row] = self.computed(row, self.speeds)
            else:
                self._kept[row] = file.tables(row, self._needed)
        return self._kept[row]

    def computed(self, row: int, speeds: Array) -> tuple[RegimeTable, ...]:
        """Tables of the machine of a row at some speeds (n,), computed unless they are kept on disk."""
        return self._computed(self.machine_with(self.factors[row]), speeds)

    def _computed(self, machine: Machine, speeds: Array) -> tuple[RegimeTable, ...]:
        return tuple(regimes_of(worn(machine, ratio), speeds) for ratio in self.levels.tolist())


def make_pools(pool: Pool, folder: Path, command: str, machines: int | None = None) -> tuple[Path, PoolFile]:
    """Compute the tables of the machines of a pool and its sisters, and write them to a file in a folder.

    What is computed is kept on disk, so a run that was stopped goes on. ``command`` makes the file, for the record.
    ``machines`` are looked at, the nominal one first; all by default.
    """
    rows = trange(len(pool.factors[:machines]), desc=f"{pool.task} pools of {pool.nominal.name}", unit="machine")
    speeds = pool.drive.regime_speeds
    tables = [pool.computed(row, speeds) for row in rows]
    about = {
        "machine": repr(pool.nominal),
        "tolerances": pool.tolerances,
        "levels": pool.levels.tolist(),
        "seed": SEEDS[pool.task],
        "horizon": HORIZON,
        "chaosgym": __version__,
        "command": command,
    }
    nature, equivalent, peak = (
        np.array([[getattr(table, name) for table in row] for row in tables])
        for name in ("nature", "equivalent_force", "peak_force")
    )
    file = PoolFile(about, pool.factors, speeds, nature, equivalent.astype(np.float32), peak.astype(np.float32))
    path = folder / f"{pool.nominal.name}-{pool.task}.npz"
    write_atomically(path, lambda temporary: _save(temporary, file))
    return path, file


def drawn_factors(widths: Sequence[float], count: int, seed: int) -> Array:
    """Draw factors within tolerances, (1 + count, fields); those of the first row are one."""
    shares = np.random.default_rng(seed).uniform(-1.0, 1.0, (count, len(widths)))
    return np.concatenate([np.ones((1, len(widths))), 1.0 + shares * np.array(widths)])


def _save(path: Path, file: PoolFile) -> None:
    arrays = {name: value for name, value in vars(file).items() if name != "about"}
    with path.open("wb") as stream:
        np.savez_compressed(stream, about=np.array(json.dumps(file.about)), **arrays)
