"""Matrices of a finite element model: what is wrong with them, their slowest modes, and a static deflection."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core.matrices import eigh, product
from chaosgym.errors import ParameterError
from chaosgym.files import first_line
from chaosgym.numbers import numbers

RIGID = 1e-12
"""Energy of a motion of the rigid body, against the sum of its terms without their signs: what rounding leaves."""

SHIFT = 100.0
"""Square of an angular frequency [1/s^2] by which large matrices are shifted, so that rigid bodies can be solved."""

SYMMETRIC = 1e-9
"""Largest difference of a matrix from its transpose, against its largest entry."""

LARGEST_ENTRY = 1e20
"""Largest entry of a matrix: of a stiffness far beyond any structure's, of which products stay finite."""

SMALL = 200
"""Degrees of freedom up to which modes have equal bits on every processor: beyond, a library is many times as fast."""

DENSE, MOST_DENSE = 600, 6000
"""Degrees of freedom up to which all modes are computed at once: always, and where a third of them is kept."""


def symmetric(name: str, matrix: Any) -> Any:
    """Matrix in a form that multiplies, refused unless it is square, finite, symmetric and not negative."""
    if np.ndim(matrix) != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.shape[0]:
        raise ParameterError(f"{name} has shape {np.shape(matrix)}; allowed: square")
    if hasattr(matrix, "tocsc"):
        from scipy.sparse import csc_array

        if matrix.nnz:
            numbers(name, matrix.data, -LARGEST_ENTRY, LARGEST_ENTRY)
        matrix = csc_array(matrix, dtype=np.float64)
    else:
        matrix = numbers(name, matrix, -LARGEST_ENTRY, LARGEST_ENTRY, shape=matrix.shape)
    largest, apart = float(abs(matrix).max()), abs(matrix - matrix.T)
    if float(apart.max()) > SYMMETRIC * largest:
        from scipy.sparse import coo_matrix

        sparse = coo_matrix(apart)
        worst = int(np.argmax(sparse.data))
        row, column = sparse.row[worst], sparse.col[worst]
        raise ParameterError(
            f"{name} is not symmetric: entries ({row}, {column}) and ({column}, {row}) differ by "
            f"{float(apart.max()):g}, of at most {largest:g}"
        )
    if matrix.shape[0] <= DENSE:
        lowest = float(np.linalg.eigvalsh(_full(matrix))[0])
        if lowest < -1e-9 * largest or (name == "mass" and lowest <= 0.0):
            raise ParameterError(
                f"{name} is not positive {'definite' if name == 'mass' else 'semidefinite'}: its lowest eigenvalue is "
                f"{lowest:.3g}"
            )
    return matrix


def _full(matrix: Any) -> Array:
    return np.asarray(matrix.toarray() if hasattr(matrix, "toarray") else matrix, dtype=float)


def slowest_modes(mass: Any, stiffness: Any, count: int) -> tuple[Array, Array]:
    """Angular frequencies (count,) and mass-normalised shapes (N, count) of the slowest modes."""
    size = mass.shape[0]
    try:
        if size <= DENSE or (count > size // 3 and size <= MOST_DENSE):
            squares, vectors = _slowest_dense(_full(mass), _full(stiffness), count)
        else:
            from scipy.sparse import csc_matrix
            from scipy.sparse.linalg import eigsh

            start = np.cos(1.0 + np.arange(size))
            found = eigsh(csc_matrix(stiffness), count, csc_matrix(mass), sigma=-SHIFT, v0=start)
            order = np.argsort(found[0])
            squares, vectors = found[0][order], found[1][:, order]
    except (np.linalg.LinAlgError, RuntimeError, MemoryError, TypeError) as error:
        raise ParameterError(f"the modes of mass and stiffness can't be computed: {first_line(error)}") from None
    energy = np.einsum("ij,ij->j", vectors, times(stiffness, vectors))
    cancelled = np.einsum("ij,ij->j", np.abs(vectors), times(abs(stiffness), np.abs(vectors)))
    if np.any(energy < -1e-9 * cancelled):
        raise ParameterError(f"stiffness is not positive semidefinite: w^2 = {energy.min():.3g} 1/s^2 of a mode")
    squares = np.where(energy <= RIGID * cancelled, 0.0, np.maximum(squares, 0.0))
    flip = vectors[np.argmax(np.abs(vectors), axis=0), np.arange(count)] < 0.0
    return np.sqrt(squares), vectors * np.where(flip, -1.0, 1.0)


def _slowest_dense(mass: Array, stiffness: Array, count: int) -> tuple[Array, Array]:
    """Squares (count,) and shapes, by the inverse problem M s = K s / w^2 where nothing moves freely: it keeps slow
    modes exact on fine meshes."""
    size = len(mass)
    if np.all(np.diag(stiffness) > 0.0):
        scale = 1.0 / np.sqrt(np.diag(stiffness))
        both = np.outer(scale, scale)
        try:
            inverse, shapes = _eigenpairs(mass * both, stiffness * both, size - count, size)
        except np.linalg.LinAlgError:
            pass
        else:
            inverse, shapes = inverse[::-1], shapes[:, ::-1]
            if inverse[-1] > 1e-12 * inverse[0]:
                return 1.0 / inverse, scale[:, None] * shapes / np.sqrt(inverse)
    return _eigenpairs(stiffness, mass, 0, count)


def _eigenpairs(a: Array, b: Array, first: int, end: int) -> tuple[Array, Array]:
    """Some eigenvalues, ascending, and vectors of a x = w b x: with equal bits everywhere where matrices are small."""
    if len(a) <= SMALL:
        values, vectors = eigh(a, b)
        return values[first:end], vectors[:, first:end]
    from scipy import linalg

    values, vectors = linalg.eigh(a, b, subset_by_index=[first, end - 1])
    return values, vectors


def times(matrix: Any, vectors: Array) -> Array:
    """Product of a sparse or a dense matrix, which adds in a fixed order where that is sparse or small."""
    large = hasattr(matrix, "tocsc") or len(vectors) > SMALL
    return np.asarray(matrix @ vectors if large else product(matrix, vectors))


NOTHING_LEFT = 1e-10
"""Share of a deflection that is rounding once the modes are taken off."""


def with_deflections(
    mass: Any, stiffness: Any, rates: Array, vectors: Array, rows: Sequence[int]
) -> tuple[Array, Array]:
    """Modes with more: the static deflection by a force at each of some degrees of freedom, less what modes deflect."""
    from scipy.sparse import csc_matrix
    from scipy.sparse.linalg import splu

    held = csc_matrix(stiffness)
    if rates[0] == 0.0:
        held = held + SHIFT * csc_matrix(mass)
    try:
        factors = splu(held)
    except (RuntimeError, MemoryError) as error:
        raise ParameterError(f"the deflection of the joint can't be computed: {first_line(error)}") from None
    kept, added = vectors, []
    for row in rows:
        load = np.zeros(len(vectors))
        load[row] = 1.0
        deflection = factors.solve(load)
        whole = math.sqrt(product(deflection, times(mass, deflection)))
        for _ in range(2):
            deflection = deflection - product(kept, product(kept.T, times(mass, deflection)))
        size = math.sqrt(product(deflection, times(mass, deflection)))
        if not size > NOTHING_LEFT * whole:
            continue
        added.append(deflection / size)
        kept = np.column_stack([kept, added[-1]])
    if not added:
        return rates, vectors
    shapes = np.column_stack(added)
    if len(added) > 1:
        _, turned = eigh(product(shapes.T, times(stiffness, shapes)))
        shapes = product(shapes, turned)
    more = [math.sqrt(max(0.0, product(shape, times(stiffness, shape)))) for shape in shapes.T]
    return np.append(rates, more), np.column_stack([vectors, shapes])
