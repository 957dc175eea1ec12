"""How does a slender beam bend? Cubic finite elements of Euler-Bernoulli theory.

Degrees of freedom run node by node: deflection [m], slope [rad].

References
----------
Przemieniecki, Theory of Matrix Structural Analysis (1968), sections 5.6 and 11.3.
"""

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
