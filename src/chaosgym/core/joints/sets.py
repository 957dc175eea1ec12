"""Rows of tables that another speed or drive rewrites in place: each is followed by what it is made of."""

import math

from chaosgym.core.joints.tables import HARMONICS, JOINTS, MODES, ROW, SHORTEST, SLIDERS, Rubs, put_drive, put_structure
from chaosgym.core.kernel import njit
from chaosgym.core.lanes import padded


@njit(cache=True)
def set_length(at):
    """Length of a row, and of a row with its set: the ``parts`` of ``put_sets`` one after the other."""
    n, m, f = at[MODES], at[JOINTS], at[SLIDERS]
    return at[ROW], padded(at[ROW] + 1 + 8 * n + 8 * n * n + m + 4 * n * m + (m + 2 * f) * m + (7 + 5 * n) * f)


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
        from_modal, lag, rest, drift, constants, those of ``Rubs``, load_rest, load, as ``put_structure`` and
        ``put_drive`` take them.
    """
    n, m, f, omega = at[MODES], at[JOINTS], at[SLIDERS], 2.0 * math.pi * frequency
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
        constants, part = part[: (m + 2 * f) * m].reshape((m + 2 * f, m)), part[(m + 2 * f) * m :]
        joint, part = part[:f], part[f:]
        slip, part = part[: f * n].reshape((f, n)), part[f * n :]
        follow, part = part[: 4 * f * n].reshape((2 * n, 2 * f)), part[4 * f * n :]
        weight, part = part[: 4 * f].reshape((2 * f, 2)), part[4 * f :]
        rubs, part = Rubs(joint, slip, follow, weight, part[: 2 * f]), part[2 * f :]
        shortest = step_phase / max(own[row], at[HARMONICS] * omega)
        if own[SHORTEST] != shortest:
            put_structure(at, generator, to_modal, from_modal, shape, lag, shortest, rest, drift, constants, rubs, own)
        put_drive(
            at, generator, to_modal, from_modal, shape, lag, omega, force, part[: 2 * n], part[2 * n : 4 * n], rubs, own
        )
