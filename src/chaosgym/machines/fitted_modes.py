"""A few modes that answer like many: what a reduced model adds for the modes that it leaves out."""

import numpy as np
from numpy.typing import NDArray

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
