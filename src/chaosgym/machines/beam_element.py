"""Cubic finite elements of a slender beam after Euler and Bernoulli, and few modes fitted to the response of all.

Degrees of freedom run node by node: deflection [m], slope [rad]. What the closed-form matrices leave out (geometric
stiffness, gyroscopic coupling, distributed loads) is integrated with the shape functions of ``interpolation``.

References
----------
Przemieniecki, Theory of Matrix Structural Analysis (1968), sections 5.6 and 11.3.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.matrices import product

Matrix = NDArray[np.float64]

_abscissae, _weights = np.polynomial.legendre.leggauss(4)
POINTS, WEIGHTS = 0.5 * (1.0 + _abscissae), 0.5 * _weights
"""Integration points of an element, as shares of its length, and theirs of the whole."""


def bending_matrices(lengths: Matrix, bending_stiffness: float, mass_per_length: float) -> tuple[Matrix, Matrix]:
    """Consistent mass and stiffness matrices of a uniform free beam.

    Parameters
    ----------
    lengths : (n_elements,)
        Element lengths from the first node on [m].
    bending_stiffness
        E I [N m^2].
    mass_per_length
        Density times cross section [kg/m].

    Returns
    -------
    mass, stiffness : (2 n_elements + 2, 2 n_elements + 2)
    """
    h, one = lengths, np.ones_like(lengths)
    inertia = [
        [156.0 * one, 22.0 * h, 54.0 * one, -13.0 * h],
        [22.0 * h, 4.0 * h * h, 13.0 * h, -3.0 * h * h],
        [54.0 * one, 13.0 * h, 156.0 * one, -22.0 * h],
        [-13.0 * h, -3.0 * h * h, -22.0 * h, 4.0 * h * h],
    ]
    springs = [
        [12.0 * one, 6.0 * h, -12.0 * one, 6.0 * h],
        [6.0 * h, 4.0 * h * h, -6.0 * h, 2.0 * h * h],
        [-12.0 * one, -6.0 * h, 12.0 * one, -6.0 * h],
        [6.0 * h, 2.0 * h * h, -6.0 * h, 4.0 * h * h],
    ]
    mass = _assembled(mass_per_length * h / 420.0 * np.array(inertia))
    # a power of an array is rounded otherwise on some processors than that of a number
    cubes = np.array([each**3 for each in lengths.tolist()])
    return mass, _assembled(bending_stiffness / cubes * np.array(springs))


def _assembled(parts: Matrix) -> Matrix:
    """Sum of the matrices (4, 4, n_elements) of elements that share their nodes."""
    count = parts.shape[-1]
    whole = np.zeros((2 * count + 2, 2 * count + 2))
    for element in range(count):
        dofs = slice(2 * element, 2 * element + 4)
        whole[dofs, dofs] += parts[:, :, element]
    return whole


class Interpolation(NamedTuple):
    """Shape functions of a mesh at its integration points.

    ``position`` (p,) [m] from the first node on and ``weight`` (p,) [m] of the points, ``deflection`` (p, dofs) and
    ``slope`` (p, dofs) of the beam there for unit degrees of freedom.
    """

    position: Matrix
    weight: Matrix
    deflection: Matrix
    slope: Matrix


def interpolation(lengths: Matrix) -> Interpolation:
    """Shape functions of all elements at four Gauss points each: exact for products of two deflections.

    Parameters
    ----------
    lengths : (n_elements,)
        Element lengths from the first node on [m].
    """
    x, count = POINTS, len(lengths)
    h = lengths[:, None]
    flat = np.ones_like(h)
    deflection = [
        flat * (1 - 3 * x**2 + 2 * x * x * x),
        h * (x - 2 * x**2 + x * x * x),
        flat * (3 * x**2 - 2 * x * x * x),
        h * (x * x * x - x**2),
    ]
    turn = [6 * (x**2 - x) / h, flat * (1 - 4 * x + 3 * x**2), 6 * (x - x**2) / h, flat * (3 * x**2 - 2 * x)]
    shape = np.zeros((count, len(x), 2 * count + 2))
    slope = np.zeros_like(shape)
    elements, dofs = np.arange(count)[:, None], 2 * np.arange(count)[:, None] + np.arange(4)
    shape[elements, :, dofs] = np.stack(deflection, axis=1)
    slope[elements, :, dofs] = np.stack(turn, axis=1)
    start = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
    position = (start[:, None] + np.outer(lengths, x)).ravel()
    points = count * len(x)
    weight = np.outer(lengths, WEIGHTS).ravel()
    return Interpolation(position, weight, shape.reshape(points, -1), slope.reshape(points, -1))


def graded_mesh(stations: tuple[float, ...], elements: int) -> Matrix:
    """Element lengths of a mesh with a node at every station.

    Parameters
    ----------
    stations
        Increasing positions [m], both ends of the beam included.
    elements
        Wanted number of elements; each span between stations gets its share, at least one.
    """
    spans = np.diff(np.asarray(stations, dtype=float))
    counts = np.maximum(1, np.rint(elements * spans / spans.sum()).astype(int))
    return np.concatenate([np.full(count, span / count) for span, count in zip(spans, counts, strict=True)])


def fitted_modes(angular: Array, coupling: Array, count: int) -> tuple[Array, Array]:
    """Modes that answer as many do where these are coupled to the rest.

    They are the Ritz vectors of the Krylov space of the static answer, by Lanczos: the nodes 1 / w^2 and weights
    c^2 / w^2 of the Gauss quadrature of sum c_i^2 / w_i^2 over 1 / w_i^2, which match the first 2 count moments of the
    answer to a slow force, the compliance first.

    Parameters
    ----------
    angular : (m,)
        Angular frequencies [rad/s] of the modes that are replaced.
    coupling : (m,)
        Their mass-normalised shapes where a force acts, or the inertia that they share with a driven end.
    count
        Number of modes that replace them.

    Returns
    -------
    angular : (count,)
        Angular frequencies [rad/s], rising.
    mix : (m, count)
        Mass-normalised fitted modes as sums of the replaced ones, so that shapes (..., m) become ``shapes @ mix``.

    Raises
    ------
    numpy.linalg.LinAlgError
        When fewer than ``count`` independent deflections are left above rounding.

    References
    ----------
    G. H. Golub, G. Meurant, Matrices, Moments and Quadrature with Applications, Princeton 2010, chapter 6.
    """
    if len(angular) < count:
        raise np.linalg.LinAlgError(f"{len(angular)} modes can't be replaced by {count}")
    slowest = angular[0]
    flexibility = (slowest / angular) ** 2
    basis = np.empty((len(angular), count))
    column = coupling * slowest / angular
    least = 1e-14 * float(matrices.norm(column))
    for k in range(count):
        for _ in range(2):
            column = column - product(basis[:, :k], product(basis[:, :k].T, column))
        size = matrices.norm(column)
        if size <= least:
            raise np.linalg.LinAlgError(f"only {k} of {count} fitted modes are independent")
        basis[:, k], least = column / size, 1e-14
        column = basis[:, k] * flexibility
    inverse_squares, turn = matrices.eigh(product(basis.T, basis * flexibility[:, None]))
    if inverse_squares[0] <= 1e-14 * inverse_squares[-1]:
        raise np.linalg.LinAlgError("rounding hides the fastest of the fitted modes")
    fitted = slowest / np.sqrt(inverse_squares[::-1])
    return fitted, product(basis, turn[:, ::-1]) * fitted / angular[:, None]
