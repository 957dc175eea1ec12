"""How far two labellings of the same rows agree.

The same sources and packages on the same kind of processor give the same bits. Elsewhere the last bit of a sine
differs, which a chaotic response amplifies, and a few rows near a boundary change their nature.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

SOURCES = ("commit",)
"""Entries of a provenance that move no bit: ``physics`` is the digest of the sources that do."""

SAME_NATURE = 0.96
"""Least share of natures that must be equal on another platform."""

FROM_NEIGHBOURS = ("response_type", "type_neighbours")
"""Columns that a row alone does not decide."""

Provenance = Iterable[Mapping[str, str]]


@dataclass(frozen=True)
class Agreement:
    """Rows labelled twice.

    Attributes
    ----------
    rows
        How many.
    identical, same_nature
        How many agree bit for bit, and how many in their nature.
    same_platform
        Whether both were computed by the same sources, with the same packages, on the same kind of processor.
    """

    rows: int
    identical: int
    same_nature: int
    same_platform: bool

    @property
    def sound(self) -> bool:
        """All rows are identical on the same platform, 96 % of the natures on another one."""
        if self.same_platform:
            return self.identical == self.rows
        return self.same_nature >= SAME_NATURE * self.rows

    @property
    def line(self) -> str:
        """Counts, and what was to be expected."""
        same = "the same sources, packages and processor: all must be identical"
        other = f"other sources, packages or processor: {SAME_NATURE:.0%} of the natures must agree"
        return (
            f"{self.identical} of {self.rows} rows identical, {self.same_nature} of the same nature "
            f"({same if self.same_platform else other})"
        )

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "points": self.rows,
            "identical": self.identical,
            "same_nature": self.same_nature,
            "same_platform": self.same_platform,
            "sound": self.sound,
        }


def agreement(before: pa.Table, after: pa.Table, made_before: Provenance, made_after: Provenance) -> Agreement:
    """Compare two labellings of the same rows in the columns of the first, but for those that rest on neighbours."""
    own = [name for name in before.column_names if name not in FROM_NEIGHBOURS and name in after.column_names]
    pairs = zip(before.select(own).to_pylist(), after.select(own).to_pylist(), strict=True)
    identical = same_nature = 0
    for first, second in pairs:
        identical += all(_same(first[name], second[name]) for name in own)
        same_nature += first["nature"] == second["nature"]
    return Agreement(len(before), identical, same_nature, _same_platform([*made_before], [*made_after]))


def _same(before: Any, after: Any) -> bool:
    """Whether two values of a column are equal; what is not a number equals itself."""
    if isinstance(before, float | list) and type(before) is type(after):
        return bool(np.array_equal(before, after, equal_nan=True))
    return bool(before == after)


def _same_platform(before: list[Mapping[str, str]], after: list[Mapping[str, str]]) -> bool:
    return all(
        made.get(name) == value
        for made in before
        for other in after
        for name, value in other.items()
        if name not in SOURCES
    )
