"""One periodic orbit of a family, with what continuation needs at it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.core import matrices


@dataclass(frozen=True, eq=False)
class OrbitPoint:
    """One periodic orbit of a family.

    Attributes
    ----------
    x : (n + 1,)
        Scaled state z on the section, and s.
    matrix : (n, n)
        Derivative of the map of one period in scaled coordinates; its eigenvalues are the Floquet multipliers.
    solved : (n, n)
        Derivative of the map that was solved: of half a period on orbits of a mirrored family.
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
    measured
        False if the derivative is what Broyden's method learned of it: good for steps, not for multipliers.
    """

    x: Array
    matrix: Array
    solved: Array
    slope: Array
    tangent: Array
    impacts: tuple[int, ...]
    peaks: Array
    symmetric: bool
    halved: bool
    phase: float
    measured: bool = True

    @cached_property
    def multipliers(self) -> NDArray[np.complex128]:
        """Floquet multipliers (n,), largest modulus first."""
        values = np.asarray(matrices.eigvals(self.matrix), dtype=complex)
        return values[np.argsort(-matrices.modulus(values), kind="stable")]

    @property
    def largest_multiplier(self) -> float:
        """Largest modulus of the multipliers."""
        return float(np.abs(self.multipliers[0]))

    @property
    def unstable(self) -> int:
        """How many multipliers lie outside the unit circle."""
        return int(np.sum(np.abs(self.multipliers) > 1.0))
