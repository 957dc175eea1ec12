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
from numba import njit

from chaosgym.core.propagator import block

MAX_CONTRACTION = 8.0
"""Logarithm of the largest contraction between two orthonormalisations of several deviations."""


class Tangents(NamedTuple):
    """Deviations that travel with a motion.

    ``vectors`` (m, 2n) are advanced in place. ``log_growth`` (cycles, m) receives the logarithm of the growth of each
    in each cycle, after which they are made orthonormal again; with shape (cycles, 0) they are left as they are.
    """

    vectors: np.ndarray
    log_growth: np.ndarray


@njit(cache=True)
def carry(stiffness, regimes, r, elapsed, vectors, growth, u):
    """Advance deviations (m, 2n) by ``elapsed`` seconds in regime r; u (2n or more,) is work space.

    Several deviations that are kept orthonormal are made so after every ``MAX_CONTRACTION``: the fastest modes decay
    by factors of e^50 a cycle, which would drown the small deviations in the rounding of the large ones. ``growth``
    is their row of ``log_growth``.
    """
    n2 = vectors.shape[1]
    to_modal, from_modal, rotates, rate = regimes.to_modal, regimes.from_modal, regimes.rotates, regimes.rate
    pieces = 1
    if growth.shape[0] > 1:
        steepest = 0.0
        for j in range(n2 // 2):
            steepest = min(steepest, rate[r, j, 0] if rotates[r, j] else min(rate[r, j, 0], rate[r, j, 1]))
        pieces += int(-steepest * elapsed / MAX_CONTRACTION)
    for _ in range(pieces):
        for m in range(vectors.shape[0]):
            for i in range(n2):
                total = 0.0
                for j in range(n2):
                    total += to_modal[r, i, j] * vectors[m, j]
                u[i] = total
            for j in range(n2 // 2):
                e11, e12, e21, e22 = block(regimes, r, j, elapsed / pieces)
                u1, u2 = u[2 * j], u[2 * j + 1]
                u[2 * j], u[2 * j + 1] = e11 * u1 + e12 * u2, e21 * u1 + e22 * u2
            for i in range(n2):
                total = 0.0
                for j in range(n2):
                    total += from_modal[r, i, j] * u[j]
                vectors[m, i] = total
        if growth.shape[0] > 1:
            orthonormalise(stiffness, vectors, growth)


@njit(cache=True)
def touch(tip_shape, contact_damping, vectors):
    """Saltation at the touch of a surface."""
    n = tip_shape.shape[0]
    for m in range(vectors.shape[0]):
        shift = 0.0
        for i in range(n):
            shift += tip_shape[i] * vectors[m, i]
        for i in range(n):
            vectors[m, n + i] -= contact_damping * tip_shape[i] * shift


@njit(cache=True, inline="always")
def _product(stiffness, a, b):
    """Scalar product of energy: K q . q + q' . q'."""
    n = stiffness.shape[0]
    total = 0.0
    for i in range(n):
        total += stiffness[i] * a[i] * b[i] + a[n + i] * b[n + i]
    return total


@njit(cache=True)
def orthonormalise(stiffness, vectors, growth):
    """Make deviations orthonormal in energy (modified Gram-Schmidt, twice) and add to ``growth`` how much they grew."""
    n2 = vectors.shape[1]
    for m in range(growth.shape[0]):
        for _ in range(2):
            for k in range(m):
                overlap = _product(stiffness, vectors[k], vectors[m])
                for i in range(n2):
                    vectors[m, i] -= overlap * vectors[k, i]
        length = math.sqrt(_product(stiffness, vectors[m], vectors[m]))
        growth[m] += math.log(length) if length > 0.0 else -math.inf
        for i in range(n2):
            vectors[m, i] = vectors[m, i] / length if length > 0.0 else 0.0
