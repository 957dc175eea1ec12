"""Natural modes of the impact beam between its sensors, by finite elements."""

import math
from functools import cache

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.matrices import product
from chaosgym.errors import ParameterError
from chaosgym.machines.beam_element import bending_matrices, fitted_modes, graded_mesh
from chaosgym.machines.flexible_model import Modes
from chaosgym.machines.impact_beam.parameters import BeamParameters

MIN_ELEMENTS = 24
"""Elements of the finest default mesh; more modes take three elements a mode."""


def _assembled(beam: BeamParameters, elements: int) -> tuple[Array, Array, int, int]:
    """Mass and stiffness matrices with springs and shaker mass, and the numbers of the force and tip deflections."""
    lengths = _mesh(beam, elements)
    section = beam.width * beam.height
    bending_stiffness = beam.youngs_modulus * beam.width * beam.height**3 / 12.0
    mass, stiffness = bending_matrices(lengths, bending_stiffness, beam.density * section)
    tip = len(mass) - 2
    at_force = 2 * int(np.argmin(np.abs(np.concatenate([[0.0], np.cumsum(lengths)]) - beam.force_position)))
    stiffness[0, 0] += beam.pivot_translational_stiffness
    stiffness[1, 1] += beam.pivot_rotational_stiffness
    stiffness[at_force, at_force] += beam.shaker_stiffness
    mass[at_force, at_force] += beam.shaker_mass
    return mass, stiffness, at_force, tip


def modal_analysis(beam: BeamParameters, elements: int | None = None) -> Modes:
    """Natural modes of the beam between the sensors, then those fitted to all others.

    Parameters
    ----------
    beam
        The machine.
    elements
        Number of finite elements; at least 24 and three a mode by default.
    """
    return _analysed(beam, elements)[0]


def modal_curvatures(beam: BeamParameters, position: float, elements: int | None = None) -> Array:
    """Curvature (n,) [kg^-1/2 m^-1] of each mode of ``modal_analysis`` at a position [m] from the pivot on.

    Raises
    ------
    ParameterError
        If the position is outside the beam.
    """
    if not 0.0 <= position <= beam.length:
        raise ParameterError(
            f"section at {position:g} m is outside the structure; allowed: 0 to {beam.length:g} m, from the pivot on"
        )
    return _analysed(beam, elements, position)[1]


def _curvature_row(beam: BeamParameters, elements: int, position: float, size: int) -> Array:
    """Curvature (size,) [1/m] at a position for unit degrees of freedom, the mean of both sides at a node."""
    nodes = np.concatenate([[0.0], np.cumsum(_mesh(beam, elements))])
    touching = [e for e in range(len(nodes) - 1) if nodes[e] <= position <= nodes[e + 1]] or [len(nodes) - 2]
    row = np.zeros(size)
    for e in touching:
        h = nodes[e + 1] - nodes[e]
        s = (position - nodes[e]) / h
        bent = [(12.0 * s - 6.0) / h**2, (6.0 * s - 4.0) / h, (6.0 - 12.0 * s) / h**2, (6.0 * s - 2.0) / h]
        row[2 * e : 2 * e + 4] += np.array(bent) / len(touching)
    return row


def _mesh(beam: BeamParameters, elements: int) -> Array:
    """Lengths of the elements [m], from the pivot on."""
    stations = (0.0, beam.force_position, beam.length)
    at_tip = beam.length - beam.force_position < 1e-9 * beam.length
    return graded_mesh((0.0, beam.length) if at_tip else stations, elements)


def _analysed(beam: BeamParameters, elements: int | None = None, position: float | None = None) -> tuple[Modes, Array]:
    """Modes, and their curvatures (n,) at a position; none without one."""
    try:
        return _reduced(beam, elements or max(MIN_ELEMENTS, 3 * beam.n_modes), position)
    except np.linalg.LinAlgError as error:
        raise inseparable(beam) from error


def _reduced(beam: BeamParameters, elements: int, position: float | None) -> tuple[Modes, Array]:
    mass, stiffness, at_force, tip = _assembled(beam, elements)
    bent = np.zeros((0, len(mass))) if position is None else _curvature_row(beam, elements, position, len(mass))[None]
    basis = None
    if beam.reduction == "interfaces":
        basis = _interface_basis(mass, stiffness, tuple(dict.fromkeys((0, 1, at_force, tip))), beam.n_modes)
        mass, stiffness = product(basis.T, mass, basis), product(basis.T, stiffness, basis)
    angular, shapes = _natural_modes(beam, mass, stiffness)
    places = [tip, at_force, 0, 1]
    ends = shapes[places] if basis is None else product(basis[places], shapes)
    bent = product(bent if basis is None else product(bent, basis), shapes) * np.where(ends[0] < 0.0, -1.0, 1.0)
    ends = ends * np.where(ends[0] < 0.0, -1.0, 1.0)
    reference = angular[1]
    if beam.fitted_modes:
        fitted, mix = fitted_modes(angular[beam.n_modes :], ends[0, beam.n_modes :], beam.fitted_modes)
        at_ends = product(ends[:, beam.n_modes :], mix)
        of_fitted = product(bent[:, beam.n_modes :], mix) * np.where(at_ends[0] < 0.0, -1.0, 1.0)
        bent = np.hstack([bent[:, : beam.n_modes], of_fitted])
        angular = np.concatenate([angular[: beam.n_modes], fitted])
        ends = np.hstack([ends[:, : beam.n_modes], at_ends * np.where(at_ends[0] < 0.0, -1.0, 1.0)])
    else:
        angular, ends, bent = angular[: beam.n_modes], ends[:, : beam.n_modes], bent[:, : beam.n_modes]
    damping = _structural_damping(beam, angular, ends, reference)
    damping = damping + beam.shaker_damping * np.outer(ends[1], ends[1])
    return Modes(angular, damping, ends[0].copy(), ends[1].copy()), bent.ravel()


def _natural_modes(beam: BeamParameters, mass: Array, stiffness: Array) -> tuple[Array, Array]:
    """Angular frequencies [rad/s] and mass-normalised shapes, slowest first: all, or as many as are needed."""
    size = len(mass)
    wanted = size if beam.fitted_modes else max(beam.n_modes, 2)
    # the inverse problem, M s = K s / w^2, keeps the slow rocking mode exact on fine meshes
    scale = 1.0 / np.sqrt(np.diag(stiffness))
    inverse_squares, shapes = matrices.eigh(mass * np.outer(scale, scale), stiffness * np.outer(scale, scale))
    inverse_squares, shapes = inverse_squares[: -wanted - 1 : -1], shapes[:, : -wanted - 1 : -1]
    slowest, slow = float(inverse_squares[0]), max(beam.n_modes, 2)
    if inverse_squares[slow - 1] < 1e-14 * slowest:
        raise inseparable(beam)
    # what rounding leaves of the fastest modes of the mesh bends no tip
    kept = inverse_squares > 1e-14 * slowest
    return 1.0 / np.sqrt(inverse_squares[kept]), scale[:, None] * shapes[:, kept] / np.sqrt(inverse_squares[kept])


def _interface_basis(mass: Array, stiffness: Array, kept: tuple[int, ...], count: int) -> Array:
    """Basis (size, count) of component mode synthesis: unit deflections of kept ones, then fixed-interface modes.

    References
    ----------
    Craig and Bampton, Coupling of substructures for dynamic analyses, AIAA Journal 6 (1968); thesis 2.2.1.
    """
    inner = [i for i in range(len(mass)) if i not in kept]
    at = np.ix_(inner, inner)
    basis = np.zeros((len(mass), count))
    basis[kept, range(len(kept))] = 1.0
    basis[inner, : len(kept)] = -matrices.solve(stiffness[at], stiffness[np.ix_(inner, kept)])
    if count > len(kept):
        basis[inner, len(kept) :] = matrices.eigh(stiffness[at], mass[at])[1][:, : count - len(kept)]
    return basis


def _structural_damping(beam: BeamParameters, angular: Array, ends: Array, reference: float) -> Array:
    """Modal damping (n, n) [1/s] without the shaker's damper; ``ends`` are the shapes at tip, shaker and pivot."""
    if beam.damping_family == "uniform":
        return np.diag(2.0 * np.full(len(angular), beam.damping_ratio) * angular)
    if beam.damping_family == "stiffness":
        ratio = beam.damping_ratio * angular / reference
        return np.diag(2.0 * ratio * angular)
    springs = (beam.shaker_stiffness, beam.pivot_translational_stiffness, beam.pivot_rotational_stiffness)
    own = np.diag(angular**2) - sum(spring * np.outer(end, end) for spring, end in zip(springs, ends[1:], strict=True))
    return np.asarray(beam.damping_ratio / (math.pi * pinned_pinned_frequency(beam, beam.length)) * own)


def inseparable(beam: BeamParameters) -> ParameterError:
    """What is raised of a beam whose modes rounding hides."""
    return ParameterError(
        f"n_modes = {beam.n_modes} and fitted_modes = {beam.fitted_modes} of a beam with "
        f"length = {beam.length:g} m, height = {beam.height:g} m, "
        f"pivot_rotational_stiffness = {beam.pivot_rotational_stiffness:g} N m/rad, shaker_stiffness = "
        f"{beam.shaker_stiffness:g} N/m and shaker_mass = {beam.shaker_mass:g} kg differ so much in frequency that "
        "rounding hides some; "
        "allowed: fewer modes, stiffer springs, or a lighter shaker"
    )


def static_tip_deflection(beam: BeamParameters) -> float:
    """Tip deflection [m] without sensors when the force amplitude acts statically: the unit of clearance (3.5.1)."""
    _, stiffness, at_force, tip = _assembled(beam, MIN_ELEMENTS)
    load = np.zeros(len(stiffness))
    load[at_force] = beam.force_amplitude
    return float(matrices.solve(stiffness, load)[tip])


def pinned_pinned_frequency(beam: BeamParameters, length: float) -> float:
    """First natural frequency [Hz] of a beam of the same section, pinned at both ends (thesis table 3.1)."""
    bending_stiffness = beam.youngs_modulus * beam.width * beam.height**3 / 12.0
    mass = beam.density * beam.width * beam.height
    return _pinned_pinned_rate() / length**2 * math.sqrt(bending_stiffness / mass) / (2.0 * math.pi)


@cache
def _pinned_pinned_rate() -> float:
    """First natural frequency [rad/s] of a pinned beam of unit length, stiffness and mass, by finite elements."""
    mass, stiffness = bending_matrices(graded_mesh((0.0, 1.0), MIN_ELEMENTS), 1.0, 1.0)
    free = [i for i in range(len(mass)) if i not in (0, len(mass) - 2)]
    squares, _ = matrices.eigh(stiffness[np.ix_(free, free)], mass[np.ix_(free, free)])
    return math.sqrt(float(squares[0]))
