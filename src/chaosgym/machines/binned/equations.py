"""The equations of a mechanism, whose matrices are held at the middle of each bin of crank angle.

Loads follow as cubics in the time of a bin. Mass matrices, loads and contacts of all bins depend neither on the speed
nor on the clearance; they are kept for machines that differ only in these.
"""

import math
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.binned.model import FORCING_TERMS, LINEAR
from chaosgym.core.matrices import product
from chaosgym.errors import ParameterError
from chaosgym.machines.parameters import refuse_not_finite

STEP_PHASE = 0.5
"""Angle [rad] by which the fastest motion turns in half an interval of a look, by default."""

MOST_STEPS = 1e9
"""Steps of a bin; a cycle's budget ends by default long before."""


class Contact(NamedTuple):
    """A surface, or two opposite ones; more than one row is a ball in a shell.

    Attributes
    ----------
    row : (R, n)
        Displacement in each direction per unit coordinate.
    gap, stiffness, damping
        Clearance [m]; k [N/m] and d [N s/m], or K [N/m^n] and chi [s/m] of a Hertzian surface.
    two_sided
        False if a contact with one row has a surface only where row . p is positive.
    reading : (R, 3)
        Recorded force (along, upward or across, sideways) per newton along each row; zero of another joint.
    slides
        Its friction among those of ``Held``, or -1.
    share : (bins,) or None
        Factor of stiffness and damping over the cycle.
    exponent
        n of a Hertzian surface, or LINEAR.
    """

    row: Array
    gap: float
    stiffness: float
    damping: float
    two_sided: bool
    reading: Array
    slides: int = -1
    share: Array | None = None
    exponent: float = LINEAR


class Held(NamedTuple):
    """Accelerations of all bins by powers of the rate w of the drive, whatever the speed and the clearance.

    Attributes
    ----------
    inverse_mass : (bins, n, n)
    free : (3, bins, 2n, n)
        Per unit of coordinates and velocities.
    forcing : (powers, bins, 4, n)
        Of the forcing, a cubic in the time of a bin, by powers 0 and 2, or 0, 1 and 2.
    friction : (S, bins, n)
        What one newton of contact force drives by each friction.
    tangent : (S, bins)
        Of the angle by which friction of a pin turns its contact force.
    """

    inverse_mass: Array
    free: Array
    forcing: Array
    friction: Array
    tangent: Array


def held(
    mass: Array,
    damping: Array,
    stiffness: Array,
    loads: Array,
    friction: Array | None = None,
    tangent: Array | None = None,
) -> Held:
    """Held accelerations of M p'' + D p' + K p = -loads, of all bins.

    Parameters
    ----------
    mass, damping, stiffness
        (bins, n, n), (2, bins, n, n) and (3, bins, n, n) at the middles of the bins, by powers of the rate.
    loads : (powers, 3 bins, n)
        At the nodes of the forcing, three a bin from the beginning of the first on.
    friction, tangent : (S, bins, n), (S, bins)
        As in ``Held``; none if omitted.
    """
    bins, n = mass.shape[:2]
    inverse_mass = np.asarray(matrices.inv(mass), dtype=np.float64)
    free = np.zeros((3, bins, 2 * n, n))
    free[:, :, :n] = -np.swapaxes(product(inverse_mass, stiffness), -1, -2)
    free[:2, :, n:] = -np.swapaxes(product(inverse_mass, damping), -1, -2)
    found = Held(
        inverse_mass,
        free,
        _forcing(inverse_mass, loads),
        friction := np.zeros((0, bins, n)) if friction is None else friction,
        np.zeros(friction.shape[:2]) if tangent is None else tangent,
    )
    refuse_not_finite("the equations of a mechanism", *found)
    return found


def largest_rate(accelerations: Array) -> float:
    """Largest modulus [1/s] of an eigenvalue of p'' = (p, p') A, for accelerations A (b, 2n, n) of some bins."""
    n = accelerations.shape[-1]
    system = np.zeros((len(accelerations), 2 * n, 2 * n))
    system[:, n:, :n] = np.eye(n)
    system[:, :, n:] = accelerations
    return float(np.max(matrices.modulus(matrices.eigvals(system))))


def middles_and_nodes(bins: int) -> tuple[Array, Array]:
    """Angles [rad] of the middles of the bins, and of the nodes of the forcing."""
    width = 2.0 * math.pi / bins
    nodes = FORCING_TERMS - 1
    middles = (np.arange(bins, dtype=np.float64) + 0.5) * width
    return middles, np.arange(bins * nodes, dtype=np.float64) * width / nodes


def _forcing(inverse_mass: Array, loads: Array) -> Array:
    """Cubics in the time of each bin through the loads at its nodes, as accelerations: (2, bins, 4, n)."""
    bins, nodes = len(inverse_mass), FORCING_TERMS - 1
    at = (np.arange(bins)[:, None] * nodes + np.arange(FORCING_TERMS)) % (bins * nodes)
    coefficients = matrices.inv(np.vander(np.arange(FORCING_TERMS) / nodes, increasing=True))
    return np.asarray(-np.einsum("bij,kbcj->kbci", inverse_mass, product(coefficients, loads[:, at])))


def even_powers(forcing: Array, rate: float) -> Array:
    """Forcing by powers 0 and 2 of a rate, (2, ...): what grows with its first power is summed into the constant."""
    return forcing if len(forcing) == 2 else np.stack([forcing[0] + rate * forcing[1], forcing[2]])


def whole_steps(wanted: float) -> int:
    """Steps of a bin, whole and at least one; refused where no kernel would ever end."""
    if not wanted < MOST_STEPS:
        raise ParameterError(
            f"the fastest motion takes {wanted:.1e} steps in a bin; allowed: up to {MOST_STEPS:g}, with more mass and "
            "inertia, less stiffness and damping, or a higher speed"
        )
    return max(1, math.ceil(wanted))
