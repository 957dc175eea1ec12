"""Rows of tables that another speed or drive rewrites in place: each is followed by what it is made of."""

import math

from chaosgym.core.joints.tables import HARMONICS, JOINTS, MODES, ROW, SHORTEST, put_drive, put_structure
from chaosgym.core.kernel import njit
from chaosgym.core.lanes import padded


@njit(cache=True)
def set_length(at):
    """Length of a row, and of a row with its set: the ``parts`` of ``put_sets`` one after the other."""
    n, m = at[MODES], at[JOINTS]
    return at[ROW], padded(at[ROW] + 1 + 8 * n + 8 * n * n + m + 4 * n * m + m * m)


@njit(cache=True, nogil=True)
def put_sets(at, shape, step_phase, frequency, level, drive, values):
    """Write the rows of some sets, one behind the other in ``values``, for a frequency of the cycle [Hz].

    Parameters
    ----------
    at
        From ``layout``.
    shape : (m, n)
        Displacement of each joint per unit modal coordinate.
    step_phase
        Angle [rad] by which neither the fastest mode nor the drive turns further in the shortest interval.
    level, drive : (2, H, 2, n)
        Factor of the drive, and the drive as in ``ModalImpactModel``.
    values
        Rows, zeros at first, with the parts behind each: largest modulus of an eigenvalue [1/s], generator, to_modal,
        from_modal, lag, rest, drift, constants, load_rest, load, as ``put_structure`` and ``put_drive`` take them.
    """
    n, m, omega = at[MODES], at[JOINTS], 2.0 * math.pi * frequency
    force = level * (drive[0] + omega * omega * drive[1])
    row, length = set_length(at)
    for begin in range(0, values.shape[0], length):
        own = values[begin : begin + length]
        part = own[row + 1 :]
        generator, part = part[: 4 * n].reshape((4, n)), part[4 * n :]
        to_modal, part = part[: 4 * n * n].reshape((2 * n, 2 * n)), part[4 * n * n :]
        from_modal, part = part[: 4 * n * n].reshape((2 * n, 2 * n)), part[4 * n * n :]
        lag, part = part[:m], part[m:]
        rest, part = part[: 2 * n * m].reshape((m, 2 * n)), part[2 * n * m :]
        drift, part = part[: 2 * n * m].reshape((m, 2 * n)), part[2 * n * m :]
        constants, part = part[: m * m].reshape((m, m)), part[m * m :]
        shortest = step_phase / max(own[row], at[HARMONICS] * omega)
        if own[SHORTEST] != shortest:
            put_structure(at, generator, to_modal, from_modal, shape, lag, shortest, rest, drift, constants, own)
        put_drive(
            at, generator, to_modal, from_modal, shape, lag, omega, force, part[: 2 * n], part[2 * n : 4 * n], own
        )
