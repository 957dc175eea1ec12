r"""The flexible connecting rod, with a housing and a yoke at its ends, in its own frame.

The frame sits at the nominal ball centre A, x along the nominal rod towards the slider pivot B, and turns at the rate
Omega. A point at s moves by u(s, t) along the rod and w(s, t) across it, small against the nominal motion:

    acceleration along  = a_d + u'' - 2 Omega w' - Omega' w - Omega^2 (s + u)
    acceleration across = a_n + w'' + 2 Omega u' + Omega' (s + u) - Omega^2 w

with a the acceleration of A plus gravity's reaction. Projected on the shape functions of the finite elements:

    M q'' + (C + 2 Omega G) q' + (K + K_geo + Omega' G - Omega^2 M_t) q = Q - load(a, Omega, Omega')

M holds the central rotary inertias of the end bodies, M_t does not: only translating mass has a centrifugal term.
Component mode synthesis (Craig and Bampton) keeps the translations of both ends, whose static shapes are straight
lines, and the lowest modes of the rod that is pinned at both ends and carries the end bodies.

References
----------
Craig and Bampton, Coupling of substructures for dynamic analyses, AIAA Journal 6 (1968); thesis 2.2 and 4.3.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.machines.beam_element import bending_matrices, fitted_modes, interpolation

Array = NDArray[np.float64]

ALONG_A, ACROSS_A, ALONG_B, ACROSS_B, MODES = 0, 1, 2, 3, 4
"""Rod coordinates: translations of the ends along and across the nominal rod, then the modes."""


class EndBody(NamedTuple):
    """A rigid body at a rod end: mass [kg], inertia about the end [kg m^2], centre of gravity along and across [m].

    The offset along counts in the direction from A to B.
    """

    mass: float
    inertia: float
    along: float
    across: float


class Bar(NamedTuple):
    """A round bar: length and diameter [m], Young's modulus [Pa], density [kg/m^3]."""

    length: float
    diameter: float
    youngs_modulus: float
    density: float


class Load(NamedTuple):
    """Inertia loads of the nominal motion on the rod coordinates, each (n,).

    ``along`` and ``across`` per unit of a_d and a_n, ``spin`` per unit of Omega', ``centrifugal`` per unit of
    -Omega^2.
    """

    along: Array
    across: Array
    spin: Array
    centrifugal: Array


class ConnectingRod(NamedTuple):
    """The rod with its end bodies in n rod coordinates.

    Attributes
    ----------
    mass, translating_mass, gyroscopic, stiffness : (n, n)
        M, M_t, G and K of the module's equation.
    tension : (3, n, n)
        Geometric stiffness of a tension 1, s / l and (s / l)^2 along the rod.
    end_rotation : (2, n, n)
        Squared rotation of housing and yoke: geometric stiffness of their offset centres of gravity.
    load : Load
    mode_frequency : (n_modes,)
        Angular frequencies [rad/s] of the modes.
    line_mass : float
        Mass per length of the bar [kg/m].
    position, weight : (p,)
        Integration points along the bar, and the lengths [m] they stand for.
    mode_shape : (p, n_modes)
        Deflection of the modes at the integration points.
    mode_slope : (2, n_modes)
        Slope of the modes at A and B [1/m].
    """

    mass: Array
    translating_mass: Array
    gyroscopic: Array
    stiffness: Array
    tension: Array
    end_rotation: Array
    load: Load
    mode_frequency: Array
    line_mass: float
    position: Array
    weight: Array
    mode_shape: Array
    mode_slope: Array


def _symmetric(matrix: Array) -> Array:
    return 0.5 * (matrix + np.swapaxes(matrix, -1, -2))


def connecting_rod(
    bar: Bar, housing: EndBody, yoke: EndBody, n_modes: int, elements: int, fitted: int = 0
) -> ConnectingRod:
    """Assemble the finite elements and keep the ends' translations, ``n_modes`` modes and those fitted to all others.

    Parameters
    ----------
    bar
        The rod itself.
    housing, yoke
        End bodies at A and B.
    n_modes
        Number of bending modes; 0 for a rod that stays straight.
    elements
        Number of finite elements, at least two.
    fitted
        Number of modes that stand for those left out, as inertia that the slider's end feels.
    """
    area = math.pi * bar.diameter**2 / 4.0
    line_mass = bar.density * area
    lengths = np.full(elements, bar.length / elements)
    bending_mass, bending_stiffness = bending_matrices(
        lengths, bar.youngs_modulus * math.pi * bar.diameter**4 / 64.0, line_mass
    )
    points = interpolation(lengths)
    size = 2 + len(bending_mass)
    bend = slice(2, size)
    # degrees of freedom: u_A, u_B, then deflection and slope node by node
    along = np.zeros((len(points.position), size))
    along[:, 0], along[:, 1] = 1.0 - points.position / bar.length, points.position / bar.length
    across = np.zeros_like(along)
    across[:, bend] = points.deflection
    slope = np.zeros_like(along)
    slope[:, bend] = points.slope
    weighted = (line_mass * points.weight)[:, None]

    translating = along.T @ (weighted * along)
    translating[bend, bend] += bending_mass
    gyroscopic = across.T @ (weighted * along) - along.T @ (weighted * across)
    stiffness = np.zeros((size, size))
    stiffness[:2, :2] = bar.youngs_modulus * area / bar.length * np.array([[1.0, -1.0], [-1.0, 1.0]])
    stiffness[bend, bend] += bending_stiffness
    tension = np.stack(
        [slope.T @ ((points.weight * (points.position / bar.length) ** k)[:, None] * slope) for k in range(3)]
    )
    load = np.stack(
        [
            along.T @ weighted[:, 0],
            across.T @ weighted[:, 0],
            across.T @ (weighted[:, 0] * points.position),
            along.T @ (weighted[:, 0] * points.position),
        ]
    )

    inertia = np.zeros((size, size))
    end_rotation = np.zeros((2, size, size))
    for end, (body, u, w) in enumerate(((housing, 0, 2), (yoke, 1, size - 2))):
        motion = np.zeros((2, size))
        motion[0, u] = motion[1, w] = 1.0
        motion[0, w + 1], motion[1, w + 1] = -body.across, body.along
        translating += body.mass * motion.T @ motion
        gyroscopic += body.mass * (np.outer(motion[1], motion[0]) - np.outer(motion[0], motion[1]))
        central = body.inertia - body.mass * (body.along**2 + body.across**2)
        inertia[w + 1, w + 1] = central
        end_rotation[end, w + 1, w + 1] = 1.0
        x, y = end * bar.length + body.along, body.across
        load[0] += body.mass * motion[0]
        load[1] += body.mass * motion[1]
        load[2] += body.mass * (x * motion[1] - y * motion[0])
        load[2, w + 1] += central
        load[3] += body.mass * (x * motion[0] + y * motion[1])
    mass = translating + inertia

    inner = [i for i in range(3, size) if i != size - 2]
    basis = np.zeros((size, 4 + n_modes + fitted))
    node = np.linspace(0.0, 1.0, elements + 1)
    basis[0, ALONG_A] = basis[1, ALONG_B] = 1.0
    basis[2::2, ACROSS_A], basis[2::2, ACROSS_B] = 1.0 - node, node
    basis[3::2, ACROSS_A], basis[3::2, ACROSS_B] = -1.0 / bar.length, 1.0 / bar.length
    frequency = np.zeros(0)
    if n_modes:
        from scipy.linalg import eigh

        at = np.ix_(inner, inner)
        last = len(inner) if fitted else n_modes
        squares, shapes = eigh(stiffness[at], mass[at], subset_by_index=[0, last - 1])
        frequency = np.sqrt(squares)
        if fitted:
            driven = shapes.T @ (mass @ basis[:, ACROSS_B])[inner]
            replaced, mix = fitted_modes(frequency[n_modes:], driven[n_modes:], fitted)
            frequency = np.concatenate([frequency[:n_modes], replaced])
            shapes = np.hstack([shapes[:, :n_modes], shapes[:, n_modes:] @ mix])
        basis[inner, MODES:] = shapes * np.where(shapes[0] < 0.0, -1.0, 1.0)

    def reduced(matrix: Array) -> Array:
        return np.asarray(basis.T @ matrix @ basis)

    return ConnectingRod(
        mass=_symmetric(reduced(mass)),
        translating_mass=_symmetric(reduced(translating)),
        gyroscopic=reduced(gyroscopic),
        stiffness=_symmetric(reduced(stiffness)),
        tension=_symmetric(reduced(tension)),
        end_rotation=_symmetric(reduced(end_rotation)),
        load=Load(*(load @ basis)),
        mode_frequency=frequency,
        line_mass=line_mass,
        position=points.position,
        weight=points.weight,
        mode_shape=across @ basis[:, MODES:],
        mode_slope=basis[[3, size - 1], MODES:],
    )
