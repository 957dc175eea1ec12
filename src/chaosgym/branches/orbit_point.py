"""One periodic orbit of a family, with what continuation needs at it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array


@dataclass(frozen=True, eq=False)
class OrbitPoint:
    """One periodic orbit of a family.

    Attributes
    ----------
    x : (n + 1,)
        Scaled state z on the section, and s.
    matrix : (n, n)
        Derivative of the map of one period in scaled coordinates; its eigenvalues are the Floquet multipliers.
    slope : (n,)
        dP/ds.
    tangent : (n + 1,)
        Unit tangent of the branch, turned the way that it is followed.
    impacts : (sides,) of int
        Contacts that begin in one period, of each side: the contact sequence as far as it is told apart.
    peaks : (sides,)
        Largest contact force of the period [N].
    symmetric
        True if both sides do the same, and something.
    halved
        True if the orbit closes after half the period too: it is one of half the period.
    phase
        Of the section, in cycles.
    """

    x: Array
    matrix: Array
    slope: Array
    tangent: Array
    impacts: tuple[int, ...]
    peaks: Array
    symmetric: bool
    halved: bool
    phase: float

    @cached_property
    def multipliers(self) -> NDArray[np.complex128]:
        """Floquet multipliers (n,), largest modulus first."""
        values = np.asarray(np.linalg.eigvals(self.matrix), dtype=complex)
        return values[np.argsort(-np.abs(values))]

    @property
    def largest_multiplier(self) -> float:
        """Largest modulus of the multipliers."""
        return float(np.abs(self.multipliers[0]))

    @property
    def unstable(self) -> int:
        """How many multipliers lie outside the unit circle."""
        return int(np.sum(np.abs(self.multipliers) > 1.0))
