"""Broyden's method: a root without derivatives, where each of them costs many runs.

It starts from a derivative nearby and learns from the misses.

References
----------
C. G. Broyden, A class of methods for solving nonlinear simultaneous equations, Math. Comp. 19 (1965) 577-593.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.matrices import product

MOST_STEPS = 14
"""Steps at the most."""

SLOWEST = 0.5
"""Ratio of successive misses above which the derivative serves no longer."""


class Root(NamedTuple):
    """Unknowns (m,), derivative (n, m) of the misses as far as it was learned, and the size of the miss there."""

    x: Array
    derivative: Array
    miss: float


def root_near(
    misses: Callable[[Array], Array],
    guess: Array,
    derivative: Array,
    closed: float,
    normal: Array | None = None,
) -> Root:
    """Unknowns nearer to a root, as far as the method converges well.

    Parameters
    ----------
    misses
        Of unknowns (m,), (n,): n = m, or m - 1 on a plane.
    guess, derivative : (m,), (n, m)
        Unknowns to start from, and the derivative of the misses nearby.
    closed
        Size of a miss that suffices.
    normal : (m,)
        Of the plane through the guess in which the root is sought.

    Examples
    --------
    >>> from chaosgym.diagnosis.broyden import root_near
    >>> root_near(lambda x: x**2 - 2.0, np.array([1.4]), np.array([[2.8]]), 1e-12).x
    array([1.41421356])
    """
    x, known, size, last, step = guess, derivative, np.inf, np.inf, np.zeros_like(guess)
    for _ in range(MOST_STEPS):
        miss = misses(x)
        size = float(matrices.norm(miss))
        if size <= closed:
            break
        if not size < SLOWEST * last:
            x, size = x - step, last
            break
        if step.any():
            known = known + np.outer(miss, step) / product(step, step)
        system, wanted = known, -miss
        if normal is not None:
            system, wanted = np.vstack([known, normal]), np.append(wanted, -product(normal, x - guess))
        step = np.asarray(matrices.solve(system, wanted))
        last, x = size, x + step
    return Root(x, known, size)
