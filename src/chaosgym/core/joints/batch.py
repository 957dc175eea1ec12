"""Many machines with several joints at once, each cycle at a speed of its own: by ``advance_joints``.

Tables, work space and numbers of the sets stay where they are, and a batch holds their addresses.
"""

from typing import NamedTuple

import numpy as np
from numba import carray

from chaosgym.core.addresses import pointer
from chaosgym.core.joints.cycle import advance_joints, room_for
from chaosgym.core.joints.sets import put_sets, set_length
from chaosgym.core.joints.space import OWN, JointRun
from chaosgym.core.kernel import njit
from chaosgym.core.tangent import Tangents
from chaosgym.core.varied import cycle_of


class JointModel(NamedTuple):
    """A machine with several joints, or a batch of N of them, with one more axis in front.

    Attributes
    ----------
    tables, made : int
        Address of the rows by ``put_sets``, and their number.
    rows, sets : int
        Address of where the row of each set begins, as of ``advance_joints``, and the number of sets.
    own : int
        Address of the work space.
    at : (...,) int
        As of ``JointRun``.
    shape : (m, n)
        Displacement of each joint per unit modal coordinate.
    stiffness : (n + f,)
        Squared natural angular frequencies [1/s^2], and tangential springs of joints with friction [N/m].
    drive, level : (2, H, 2, n), float
        As of ``put_sets``.
    frequency : float
        Of the cycle [Hz] for which the rows were made.
    """

    tables: int
    made: int
    rows: int
    sets: int
    own: int
    at: np.ndarray
    shape: np.ndarray
    stiffness: np.ndarray
    drive: np.ndarray
    level: float
    frequency: float


@njit(cache=True, nogil=True)
def displacement_weights(stiffness, frequency):
    """Weights (n + f,) of displacements in ``orthonormalise``; a rigid body counts as if it swung once a cycle."""
    omega = 2.0 * np.pi * frequency
    return np.where(stiffness != 0.0, stiffness, omega * omega)


# cycles are looped over in a function of its own, as in ``core.varied``
@njit(cache=True)
def _advance(batch, i, speeds, motions, vectors, growth, arrays, settings, until, k, done):
    """Status of machine i, and the set that it needs; ``done`` (k,) goes on to ``until`` if nothing fails."""
    at, code = batch.at[i], 0
    length = set_length(at)[1]
    tables = carray(pointer(batch.tables[i]), (batch.made[i] * length,), np.float64)
    rows = carray(pointer(batch.rows[i]), (batch.sets[i],), np.int64)
    own = carray(pointer(batch.own[i]), (at[OWN],), np.float64)
    weights = displacement_weights(batch.stiffness[i], speeds[k, done[k]])
    kept = room_for(at, motions.bouncing[i], Tangents(vectors[i], growth[k]))
    while done[k] < until:
        frequency = speeds[k, done[k]]
        if batch.frequency[i] != frequency:
            put_sets(at, batch.shape[i], settings.step_phase, frequency, batch.level[i], batch.drive[i], tables)
            weights = displacement_weights(batch.stiffness[i], frequency)
            batch.frequency[i] = frequency
        outcome, _, code = advance_joints(
            JointRun(tables, own, at, 1.0 / frequency, settings.event_tolerance / settings.step_phase),
            rows,
            weights,
            motions.coordinates[i],
            motions.bouncing[i],
            cycle_of(arrays, k, done[k]),
            settings.event_budget,
            Tangents(vectors[i], growth[k, done[k] : done[k] + 1]),
            kept,
            True,
        )
        if outcome != 0:
            return outcome, code
        done[k] += 1
    return 0, code


@njit(nogil=True)
def advance_joint_machines(
    first, end, batch, which, ahead, speeds, motions, vectors, growth, arrays, settings, until, done, outcome, needed
):
    """Go on with those machines of ``which`` (k,) whose places are ``ahead``, to cycle ``until``, unless they fail.

    ``speeds`` (k, cycles) [Hz]; ``vectors`` (N, 1, 2n + f) and ``growth`` (k, cycles, 1) are of deviations, as in
    ``advance_varied_beams``, or none, (N, 0, 2n + f) and (k, cycles, 0). ``done``, ``outcome`` and ``needed`` (k,) are
    the cycles that each has finished, its status, and with NEEDS_SET the number of the set.
    """
    for place in range(first, end):
        k = ahead[place]
        outcome[k], needed[k] = _advance(
            batch, which[k], speeds, motions, vectors, growth, arrays, settings, until, k, done
        )
