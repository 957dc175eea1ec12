"""Rows of a dataset labelled again: does it still say what this installation computes?

The same sources and packages on the same kind of processor give the same bits. Elsewhere the last bit of a sine
differs, which a chaotic response amplifies, and a few rows near a boundary change their nature.
"""

import random
from dataclasses import dataclass
from typing import Any

import numpy as np
from tqdm import tqdm

from chaosgym.errors import DatasetError
from chaosgym.sweeps.dataset import LabelledSweep
from chaosgym.sweeps.label import provenance
from chaosgym.sweeps.run import relabel

SOURCES = ("commit",)
"""Entries of a provenance that move no bit: ``physics`` is the digest of the sources that do."""

SAME_NATURE = 0.96
"""Least share of natures that must be equal on another platform."""

FROM_NEIGHBOURS = ("response_type", "type_neighbours")
"""Columns that a row alone does not decide."""


@dataclass(frozen=True)
class Check:
    """Rows labelled again.

    Attributes
    ----------
    rows
        Their numbers.
    identical, same_nature
        How many agree bit for bit, and how many in their nature.
    same_platform
        Whether the dataset was computed by these sources, with these packages, on this kind of processor.
    """

    rows: tuple[int, ...]
    identical: int
    same_nature: int
    same_platform: bool

    @property
    def sound(self) -> bool:
        """All rows are identical on the same platform, 96 % of the natures on another one."""
        if self.same_platform:
            return self.identical == len(self.rows)
        return self.same_nature >= SAME_NATURE * len(self.rows)

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "points": len(self.rows),
            "identical": self.identical,
            "same_nature": self.same_nature,
            "same_platform": self.same_platform,
            "sound": self.sound,
        }


def check_rows(sweep: LabelledSweep, points: int, *, seed: int | None = None, progress: bool = False) -> Check:
    """Label some rows of a sweep again.

    Parameters
    ----------
    sweep
        All columns of it.
    points
        Number of rows.
    seed
        Of the rows; different ones at every call if there is none.
    progress
        Show a progress bar on standard error.

    Raises
    ------
    DatasetError
        If there are not as many rows.
    """
    if not 1 <= points <= len(sweep.table):
        raise DatasetError(f"points = {points} is out of range; allowed: 1 to {len(sweep.table)}, the rows")
    rows = sorted(random.Random(seed).sample(range(len(sweep.table)), points))
    own = [name for name in sweep.table.column_names if name not in FROM_NEIGHBOURS]
    identical = same_nature = 0
    for row in tqdm(rows, desc="check", unit="row", disable=not progress):
        before, after = sweep.table.slice(row, 1), relabel(sweep, [row])
        identical += all(_same(before.column(name)[0].as_py(), after.column(name)[0].as_py()) for name in own)
        same_nature += before.column("nature")[0].as_py() == after.column("nature")[0].as_py()
    return Check(tuple(rows), identical, same_nature, _same_platform(sweep))


def _same(before: Any, after: Any) -> bool:
    """Whether two values of a column are equal; what is not a number equals itself."""
    if isinstance(before, float | list) and type(before) is type(after):
        return bool(np.array_equal(before, after, equal_nan=True))
    return bool(before == after)


def _same_platform(sweep: LabelledSweep) -> bool:
    here = provenance()
    return all(
        made.get(name) == value for made in sweep.provenance for name, value in here.items() if name not in SOURCES
    )
