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
from numba.extending import register_jitable

from chaosgym.core.kernel import leaf
from chaosgym.core.propagator import block

MAX_CONTRACTION = 8.0
"""Logarithm of the largest contraction between two orthonormalisations of several deviations."""


VANISHED = 1e-300
"""Length below which a deviation has died out; a new one takes its place, and its growth counts as this at most."""

ABREAST = 4
"""Deviations that are carried side by side."""


class Tangents(NamedTuple):
    """Deviations that travel with a motion.

    ``vectors`` (m, 2n) are advanced in place. ``log_growth`` (cycles, m) receives the logarithm of the growth of each
    in each cycle, after which they are made orthonormal again; with shape (cycles, 0) they are left as they are.
    """

    vectors: np.ndarray
    log_growth: np.ndarray


@register_jitable
def no_tangents(states: int, cycles: int) -> Tangents:
    """Return no deviations of a machine of so many states over so many cycles."""
    return Tangents(np.empty((0, states)), np.empty((cycles, 0)))


@leaf
def carry(weights, regimes, r, elapsed, tangents, cycle, work):
    """Advance deviations (m, 2n) by ``elapsed`` seconds in regime r; ``work`` (8n or more,) is work space.

    Several deviations that are kept orthonormal are made so after every ``MAX_CONTRACTION``: the fastest modes decay
    by factors of e^50 a cycle, which would drown the small deviations in the rounding of the large ones.
    """
    vectors, generator = tangents.vectors, regimes.generator[r]
    n2 = vectors.shape[1]
    several = tangents.log_growth.shape[1] > 1
    pieces = 1
    if several:
        steepest = 0.0
        for j in range(n2 // 2):
            steepest = min(steepest, generator[0, j], generator[3, j])
        pieces += int(-steepest * elapsed / MAX_CONTRACTION)
    last = vectors.shape[0] - 1
    for _ in range(pieces):
        for m in range(0, last + 1, ABREAST):
            # sums of several deviations side by side: one alone waits for each of its own additions
            a, b, c, d = m, min(m + 1, last), min(m + 2, last), min(m + 3, last)
            for i in range(n2):
                first, second, third, fourth = 0.0, 0.0, 0.0, 0.0
                for j in range(n2):
                    factor = regimes.to_modal[r, i, j]
                    first += factor * vectors[a, j]
                    second += factor * vectors[b, j]
                    third += factor * vectors[c, j]
                    fourth += factor * vectors[d, j]
                work[i], work[n2 + i], work[2 * n2 + i], work[3 * n2 + i] = first, second, third, fourth
            _move_abreast(generator, work, elapsed / pieces)
            for i in range(n2):
                first, second, third, fourth = 0.0, 0.0, 0.0, 0.0
                for j in range(n2):
                    factor = regimes.from_modal[r, i, j]
                    first += factor * work[j]
                    second += factor * work[n2 + j]
                    third += factor * work[2 * n2 + j]
                    fourth += factor * work[3 * n2 + j]
                vectors[a, i], vectors[b, i], vectors[c, i], vectors[d, i] = first, second, third, fourth
        if several:
            orthonormalise(weights, tangents, cycle)


@leaf
def _move_abreast(generator, u, time):
    """u = exp(B time) u for modal coordinates (2n,) of deviations one after the other."""
    n = generator.shape[1]
    for j in range(n):
        e11, e12, e21, e22 = block(generator, j, time)
        for k in range(ABREAST):
            first, second = u[2 * n * k + j], u[2 * n * k + n + j]
            u[2 * n * k + j] = e11 * first + e12 * second
            u[2 * n * k + n + j] = e21 * first + e22 * second


@leaf
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
def _product(weights, vectors, a, b):
    """Scalar product of energy of two deviations: sum w q q + q' q'."""
    n = weights.shape[0]
    total = 0.0
    for i in range(n):
        total += weights[i] * vectors[a, i] * vectors[b, i] + vectors[a, n + i] * vectors[b, n + i]
    return total


@leaf
def orthonormalise(weights, tangents, cycle):
    """Make deviations orthonormal in energy (modified Gram-Schmidt, twice); note in ``log_growth`` how much they grew.

    ``weights`` (n,) [1/s^2] are those of displacements: the stiffness of each mode.
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
