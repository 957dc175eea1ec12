r"""The flexible connecting rod, with a housing and a yoke at its ends, in its own frame.

Component mode synthesis (Craig and Bampton) keeps the translations of both ends, whose static shapes are straight
lines, and the lowest modes of the rod that is pinned at both ends and carries the end bodies. A point at s then lies
across the rod by

    w(s) = (1 - s / l) w_A + (s / l) w_B + sum W_k(s) q_k

References
----------
Craig and Bampton, Coupling of substructures for dynamic analyses, AIAA Journal 6 (1968); thesis 2.2 and 4.3.
"""

import math
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.machines.beam_element import bending_matrices, fitted_modes, interpolation
from chaosgym.machines.slider_crank.parameters import CrankParameters

ELEMENTS = 10
"""Finite elements of the rod, at least: its third natural frequency is right to 0.01 %. More modes take two a mode."""


class EndBody(NamedTuple):
    """A rigid body at a rod end: mass [kg], inertia about the end [kg m^2], centre of gravity along the rod [m].

    The offset along counts in the direction from A to B.
    """

    mass: float
    inertia: float
    along: float


class Bar(NamedTuple):
    """A round bar: length and diameter [m], Young's modulus [Pa], density [kg/m^3]."""

    length: float
    diameter: float
    youngs_modulus: float
    density: float


class ConnectingRod(NamedTuple):
    """The rod's shapes in a plane, for the ends' translations across it and m modes.

    Attributes
    ----------
    line_mass : float
        Mass per length of the bar [kg/m].
    stretch : float
        Stiffness E A / l [N/m] of the bar along itself.
    mode_frequency : (m,)
        Angular frequencies [rad/s] of the modes, whose modal masses are 1.
    position, weight : (p,)
        Integration points along the bar, and the lengths [m] they stand for.
    shape : (p, 2 + m)
        Deflection at the integration points.
    end_slope : (2, m)
        Slope of the modes at A and B [1/m].
    tension : (3, 2 + m, 2 + m)
        Geometric stiffness of a tension 1, s / l and (s / l)^2 along the rod.
    """

    line_mass: float
    stretch: float
    mode_frequency: Array
    position: Array
    weight: Array
    shape: Array
    end_slope: Array
    tension: Array


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
    mass, stiffness = bending_matrices(lengths, bar.youngs_modulus * math.pi * bar.diameter**4 / 64.0, line_mass)
    points = interpolation(lengths)
    size = len(mass)
    for body, first in ((housing, 0), (yoke, size - 2)):
        own = slice(first, first + 2)
        static = body.mass * body.along
        mass[own, own] += [[body.mass, static], [static, body.inertia]]

    # degrees of freedom: deflection and slope node by node
    basis = np.zeros((size, 2 + n_modes + fitted))
    node = np.linspace(0.0, 1.0, elements + 1)
    basis[0::2, 0], basis[0::2, 1] = 1.0 - node, node
    basis[1::2, 0], basis[1::2, 1] = -1.0 / bar.length, 1.0 / bar.length
    frequency = np.zeros(0)
    if n_modes:
        # the same eigenpairs: those of two libraries differ by 1e-10, which is not what this twin is compared for

        inner = [i for i in range(1, size) if i != size - 2]
        at = np.ix_(inner, inner)
        last = len(inner) if fitted else n_modes
        squares, shapes = (part[..., :last] for part in matrices.eigh(stiffness[at], mass[at]))
        frequency = np.sqrt(squares)
        if fitted:
            driven = shapes.T @ (mass @ basis[:, 1])[inner]
            replaced, mix = fitted_modes(frequency[n_modes:], driven[n_modes:], fitted)
            frequency = np.concatenate([frequency[:n_modes], replaced])
            shapes = np.hstack([shapes[:, :n_modes], shapes[:, n_modes:] @ mix])
        basis[inner, 2:] = shapes * np.where(shapes[0] < 0.0, -1.0, 1.0)

    slope = points.slope @ basis
    share = points.position / bar.length
    return ConnectingRod(
        line_mass=line_mass,
        stretch=bar.youngs_modulus * area / bar.length,
        mode_frequency=frequency,
        position=points.position,
        weight=points.weight,
        shape=points.deflection @ basis,
        end_slope=basis[[1, size - 1], 2:],
        tension=np.stack([slope.T @ ((points.weight * share**k)[:, None] * slope) for k in range(3)]),
    )


def rods_of(machine: CrankParameters) -> tuple[ConnectingRod, ...]:
    """The rod in the plane in which the yoke swings along, and with the motor at an angle in that across it too."""
    bar = Bar(machine.rod_length, machine.rod_diameter, machine.youngs_modulus, machine.density)
    housing = EndBody(machine.housing_mass, machine.housing_inertia, machine.housing_offset_along)
    yokes = [EndBody(machine.yoke_mass, machine.yoke_inertia, machine.yoke_offset_along)]
    if machine.is_spatial:
        yokes.append(EndBody(machine.yoke_mass, 0.0, 0.0))
    modes = (0, ELEMENTS, 0)
    if machine.rod == "flexible":
        modes = (machine.n_modes, max(ELEMENTS, 2 * machine.n_modes), machine.fitted_modes)
    return tuple(connecting_rod(bar, housing, yoke, *modes) for yoke in yokes)


def elastic_constants(machine: CrankParameters, rod: ConnectingRod) -> tuple[Array, Array]:
    """Stiffness and structural damping of stretch and modes, (1 + m,) each, by the machine's damping family."""
    stiffness = np.concatenate([[rod.stretch], rod.mode_frequency**2])
    if machine.damping_family == "stiffness":
        return stiffness, np.asarray(stiffness * 2.0 * machine.damping_ratio / rod.mode_frequency[0])
    moving = machine.slider_mass + machine.yoke_mass + rod.line_mass * machine.rod_length / 3.0
    inertia = np.concatenate([[moving], np.ones(len(rod.mode_frequency))])
    ratio: float | Array = machine.damping_ratio
    if machine.damping_family == "power":
        ratio = ratio * (np.sqrt(stiffness / inertia) / rod.mode_frequency[0]) ** machine.damping_exponent
    return stiffness, np.asarray(2.0 * ratio * np.sqrt(stiffness * inertia))
