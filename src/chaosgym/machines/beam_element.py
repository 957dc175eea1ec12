"""Cubic finite elements of a slender beam after Euler and Bernoulli, and few modes that answer like its many.

Degrees of freedom run node by node: deflection [m], slope [rad]. What the closed-form matrices leave out (geometric
stiffness, gyroscopic coupling, distributed loads) is integrated with the shape functions of ``interpolation``.

References
----------
Przemieniecki, Theory of Matrix Structural Analysis (1968), sections 5.6 and 11.3.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]


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
    size = 2 * len(lengths) + 2
    mass = np.zeros((size, size))
    stiffness = np.zeros((size, size))
    for element, h in enumerate(lengths):
        dofs = slice(2 * element, 2 * element + 4)
        mass[dofs, dofs] += (mass_per_length * h / 420.0) * np.array(
            [
                [156.0, 22.0 * h, 54.0, -13.0 * h],
                [22.0 * h, 4.0 * h * h, 13.0 * h, -3.0 * h * h],
                [54.0, 13.0 * h, 156.0, -22.0 * h],
                [-13.0 * h, -3.0 * h * h, -22.0 * h, 4.0 * h * h],
            ]
        )
        stiffness[dofs, dofs] += (bending_stiffness / h**3) * np.array(
            [
                [12.0, 6.0 * h, -12.0, 6.0 * h],
                [6.0 * h, 4.0 * h * h, -6.0 * h, 2.0 * h * h],
                [-12.0, -6.0 * h, 12.0, -6.0 * h],
                [6.0 * h, 2.0 * h * h, -6.0 * h, 4.0 * h * h],
            ]
        )
    return mass, stiffness


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
    abscissa, gauss_weight = np.polynomial.legendre.leggauss(4)
    x = 0.5 * (1.0 + abscissa)
    count, points = len(lengths), len(x)
    shape = np.zeros((count * points, 2 * count + 2))
    slope = np.zeros_like(shape)
    for element, h in enumerate(lengths):
        at = slice(element * points, (element + 1) * points)
        dofs = slice(2 * element, 2 * element + 4)
        shape[at, dofs] = np.column_stack(
            [1 - 3 * x**2 + 2 * x**3, h * (x - 2 * x**2 + x**3), 3 * x**2 - 2 * x**3, h * (x**3 - x**2)]
        )
        slope[at, dofs] = np.column_stack(
            [6 * (x**2 - x) / h, 1 - 4 * x + 3 * x**2, 6 * (x - x**2) / h, 3 * x**2 - 2 * x]
        )
    start = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
    position = (start[:, None] + np.outer(lengths, x)).ravel()
    return Interpolation(position, np.outer(lengths, 0.5 * gauss_weight).ravel(), shape, slope)


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


Array = NDArray[np.float64]


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
    least = 1e-14 * float(np.linalg.norm(column))
    for k in range(count):
        for _ in range(2):
            column = column - basis[:, :k] @ (basis[:, :k].T @ column)
        size = np.linalg.norm(column)
        if size <= least:
            raise np.linalg.LinAlgError(f"only {k} of {count} fitted modes are independent")
        basis[:, k], least = column / size, 1e-14
        column = basis[:, k] * flexibility
    inverse_squares, turn = np.linalg.eigh(basis.T @ (basis * flexibility[:, None]))
    if inverse_squares[0] <= 1e-14 * inverse_squares[-1]:
        raise np.linalg.LinAlgError("rounding hides the fastest of the fitted modes")
    fitted = slowest / np.sqrt(inverse_squares[::-1])
    return fitted, (basis @ turn[:, ::-1]) * fitted / angular[:, None]
