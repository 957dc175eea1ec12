r"""Small deviations of a motion with modal impacts, carried through every contact.

Within a regime a deviation w of the state decays freely: w' = A w, so the exact propagators carry it in one step from
one contact event to the next. At an event the two neighbours change their regime at slightly different instants, which
multiplies w by the saltation matrix I + (f_after - f_before) grad(e)' / (grad(e)' f_before). The contact force is
continuous wherever it ends at zero, so only the touch of a surface jumps, where the damper acts at once:

    touch      delta q' <- delta q' - d phi_t (phi_t . delta q)          determinant 1
    release, return into the gap, touch from beyond the surface          no jump

Hence the sum of all Lyapunov exponents per cycle is the integral of the trace, -tr(D) T - d |phi_t|^2 t_contact.

References
----------
R. I. Leine, H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, Springer 2004, chapter 7.
"""

import math
from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable

from chaosgym.core.kernel import leaf, njit

MAX_CONTRACTION = 8.0
"""Logarithm of the largest contraction between two orthonormalisations of several deviations."""


VANISHED = 1e-300
"""Length below which a deviation has died out; a new one takes its place, and its growth counts as this at most."""


class Tangents(NamedTuple):
    """Deviations that travel with a motion.

    ``vectors`` (m, 2n) are advanced in place; with friction of f joints they are (m, 2n + f), its springs behind.
    ``log_growth`` (cycles, m) receives the logarithm of the growth of each in each cycle, after which they are made
    orthonormal again; with shape (cycles, 0) they are left as they are.
    """

    vectors: np.ndarray
    log_growth: np.ndarray


@register_jitable
def no_tangents(states: int, cycles: int) -> Tangents:
    """Return no deviations of a machine of so many states over so many cycles."""
    return Tangents(np.empty((0, states)), np.empty((cycles, 0)))


@njit(cache=True, inline="always")
def _product(weights, vectors, a, b):
    """Scalar product of energy of two deviations: sum w q q + q' q', and w z z of tangential springs."""
    n = vectors.shape[1] - weights.shape[0]
    total = 0.0
    for i in range(n):
        total += weights[i] * vectors[a, i] * vectors[b, i] + vectors[a, n + i] * vectors[b, n + i]
    for i in range(n, weights.shape[0]):
        total += weights[i] * vectors[a, n + i] * vectors[b, n + i]
    return total


@leaf
def orthonormalise(weights, tangents, cycle):
    """Make deviations orthonormal in energy (modified Gram-Schmidt, twice); note in ``log_growth`` how much they grew.

    ``weights`` (n,) [1/s^2] are those of displacements: the stiffness of each mode. Behind them may be those of
    tangential springs (f,).
    """
    vectors, growth = tangents.vectors, tangents.log_growth
    n2 = vectors.shape[1]
    for m in range(growth.shape[1]):
        for _ in range(2):
            for k in range(m):
                overlap = _product(weights, vectors, k, m)
                for i in range(n2):
                    vectors[m, i] -= overlap * vectors[k, i]
        length = math.sqrt(_product(weights, vectors, m, m))
        growth[cycle, m] += math.log(max(length, VANISHED))
        for i in range(n2):
            if length > VANISHED:
                vectors[m, i] /= length
            else:
                vectors[m, i] = 1.0 if i == n2 // 2 + m % (n2 // 2) else 0.0
