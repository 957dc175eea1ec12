"""The model of a machine of a few modes whose tip rattles between two stops, as the kernels take it."""

from typing import NamedTuple

import numpy as np

from chaosgym.core import matrices

FREE, UPPER_STOP, LOWER_STOP = np.int64(0), np.int64(1), np.int64(2)
"""Where the tip is pressed: nowhere, or against a stop; rows of what differs between the three. Integers of numpy, as
numba compiles a kernel anew for each plain number that it is called with."""

STOP, LOAD = 0, 1
"""Parts of a position of rest: per unit position of the stop that presses, and under the static force."""


class Regimes(NamedTuple):
    """R linear regimes of one system with n degrees of freedom, each in its own n modal blocks.

    Modal coordinates (2n,) are the first ones of all blocks, then the second ones.

    Attributes
    ----------
    generator : (R, 4, n)
        Entries 11, 12, 21, 22 of each block [1/s]; none grows.
    to_modal, from_modal : (R, 2n, 2n)
        Modal coordinates from y, and y from modal coordinates.
    output : (R, 2n)
        Displacement of the tip [m] per unit modal coordinate.
    fastest : (R,)
        Largest modulus of an eigenvalue [1/s].
    """

    generator: np.ndarray
    to_modal: np.ndarray
    from_modal: np.ndarray
    output: np.ndarray
    fastest: np.ndarray


class Tables(NamedTuple):
    """Tables of the structure, for R regimes.

    ``step_phase`` [rad] is the angle by which the fastest mode of a regime turns in its ``shortest`` (R,) interval [s];
    ``values`` (R, ...) are rows by ``joints.tables.put_structure``.
    """

    step_phase: float
    shortest: np.ndarray
    values: np.ndarray


class ModalImpactModel(NamedTuple):
    r"""A machine of n mass-normalised modes q whose tip, at x = phi_t . q, has a stop on either side.

        q'' + D q' + diag(w_i^2) q = f_0 + sum_h (f_hc cos(h w t) + f_hs sin(h w t)) - phi_t (N_upper - N_lower)

    A stop pushes with N = k p + d p', p the penetration, and never pulls.

    Attributes
    ----------
    excitation_frequency : float
        w / 2 pi [Hz].
    drive : (2, H, 2, n)
        Modal forces of the harmonics, [N kg^-1/2] and [N s^2 kg^-1/2]: constant ones, and those that grow with w^2;
        [which, harmonic, cosine or sine, mode].
    static_force : (n,)
        f_0 [N kg^-1/2].
    stops : (2,)
        Positions of the upper and the lower stop [m], infinite where there is none.
    contact_stiffness, contact_damping : (2,)
        k [N/m] and d [N s/m] of the upper and the lower stop.
    stiffness : (n,)
        Squared natural angular frequencies of the free machine [1/s^2]; 0 for the motion of a rigid body.
    damping : (n, n)
        D [1/s].
    tip_shape : (n,)
        phi_t [kg^-1/2].
    pressed : (3,) int
        Regime of FREE, UPPER_STOP and LOWER_STOP: 0, 1 and 1 or, for stops that differ, 2.
    regimes : Regimes
        The free machine, and with its tip on the spring and damper of a stop.
    rest, drift : (R, 2, 2n)
        Position of rest in modal coordinates, and their rate at the origin: of those that have no position of rest
        for the STOP, of all under the LOAD.
    rest_penetration : (R,)
        How far beyond a stop the tip rests if it lies at unit distance and holds on; negative.
    tables : Tables
        Of the regimes.
    """

    excitation_frequency: float
    drive: np.ndarray
    static_force: np.ndarray
    stops: np.ndarray
    contact_stiffness: np.ndarray
    contact_damping: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    tip_shape: np.ndarray
    pressed: np.ndarray
    regimes: Regimes
    rest: np.ndarray
    drift: np.ndarray
    rest_penetration: np.ndarray
    tables: Tables


def with_drive_from(model: ModalImpactModel, phase: float) -> ModalImpactModel:
    """The model whose cycles begin at a phase of the drive, as a share of the cycle."""
    angle = 2.0 * np.pi * phase * np.arange(1.0, model.drive.shape[1] + 1.0)
    cosine, sine, turned = matrices.cos(angle)[:, None], matrices.sin(angle)[:, None], np.empty_like(model.drive)
    turned[:, :, 0] = model.drive[:, :, 0] * cosine + model.drive[:, :, 1] * sine
    turned[:, :, 1] = model.drive[:, :, 1] * cosine - model.drive[:, :, 0] * sine
    return model._replace(drive=turned)
