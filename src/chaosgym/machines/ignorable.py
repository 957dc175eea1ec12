r"""Ignorable motion of a machine: how far a free body has gone, on which no force depends.

A gear pair that turns has the same forces at every angle, so its response repeats although its angles do not. With
modes q'' + D q' + diag(w^2) q = f - sum phi_j F_j a displacement d is ignorable if it moves no joint and no spring,

    phi_j . d = 0 for each joint,    d_i = 0 where w_i > 0

and a velocity d is if D^k d is such a displacement for every k. These are the unobservable states of the machine seen
by its contacts. What is told of a motion, its period above all, is told of the rest.

References
----------
H. Goldstein, Classical Mechanics, section 2.6 (cyclic or ignorable coordinates).
R. E. Kalman, Mathematical description of linear dynamical systems, J. SIAM Control 1 (1963) 152.
"""

from functools import lru_cache

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core.matrices import eigh, norm, product
from chaosgym.machines.machine import Machine

UNSEEN = 1e-12
"""Share of a unit displacement that joints and springs may see of an ignorable one: rounding."""


@lru_cache(maxsize=256)
def ignorable(machine: Machine) -> Array | None:
    """Orthonormal directions of states (k, n_states) on which no force depends; None where there are none.

    Examples
    --------
    >>> from chaosgym.machines.ignorable import ignorable
    >>> ignorable(chaosgym.ImpactBeam()) is None
    True
    """
    bodies = machine.free_bodies
    if bodies is None or not bodies.rigid.any():
        return None
    rigid = bodies.rigid
    sizes = np.linalg.norm(bodies.rows, axis=1)[:, None]
    displacements = np.zeros((int(rigid.sum()), len(rigid)))
    displacements[:, rigid] = np.eye(len(displacements))
    displacements = product(_unseen(bodies.rows[:, rigid] / sizes), displacements)
    if not len(displacements):
        return None
    velocities = _kept_within(displacements, bodies.damping)
    directions = np.zeros((len(displacements) + len(velocities), machine.n_states))
    directions[: len(displacements), : len(rigid)] = displacements
    directions[len(displacements) :, len(rigid) : 2 * len(rigid)] = velocities
    return directions


def _kept_within(directions: Array, damping: Array) -> Array:
    """The largest part (j, n) of the span of directions (k, n) that a damping matrix does not lead out of."""
    damping = damping / max(float(np.max(np.abs(damping))), 1e-300)
    while len(directions):
        moved = product(directions, damping.T)
        inside = _unseen((moved - product(product(moved, directions.T), directions)).T)
        if len(inside) == len(directions):
            break
        directions = product(inside, directions)
    return directions


def relative(machine: Machine, states: Array) -> Array:
    """States (..., n_states) less their ignorable part, which is 0 then."""
    directions = ignorable(machine)
    if directions is None:
        return states
    return np.asarray(states - product(product(states, directions.T), directions))


def _unseen(rows: Array) -> Array:
    """Orthonormal directions (k, n) that are 0 in all rows (m, n), each of length 1 at most."""
    directions = eigh(product(rows.T, rows))[1].T
    return directions[[norm(product(rows, each)) <= UNSEEN for each in directions]]
