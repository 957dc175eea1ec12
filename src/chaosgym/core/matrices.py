"""Linear algebra of small matrices with equal bits on every processor.

numpy's and scipy's call a library that orders its sums by the processor, and some of numpy's elementary functions have
variants by processor; what differs grows with every impact. These add in a fixed order and take elementary functions
from the C library. They do what numpy's functions of the same names do, on finite real numbers.

    from chaosgym.core import matrices
    matrices.product(a, b)      # a @ b
"""

import math
from collections.abc import Callable
from functools import cache, partial, reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.linalg import LinAlgError
from numpy.typing import ArrayLike, NDArray

from chaosgym.arrays import Array

RANK = 1e-15
"""Singular value, as a share of the largest, that counts as none in ``pinv``."""

TAYLOR_TERMS = 18
"""Terms of the exponential of a matrix whose norm is at most a half: what follows them is below a rounding."""


@cache
def _kernel(name: str) -> Callable[..., Any]:
    """What calls a kernel; loaded when it is needed, since numba takes a quarter of a second."""
    from chaosgym.core import eigenpairs, linear_algebra, symmetric_eigenpairs
    from chaosgym.core.compilation import call

    home = next(one for one in (linear_algebra, symmetric_eigenpairs, eigenpairs) if hasattr(one, name))
    return partial(call, getattr(home, name))


def _call(name: str, *arguments: Any) -> Any:
    return _kernel(name)(*arguments)


def product(*factors: Any) -> Any:
    """Product of vectors, matrices and stacks of these, from the left, as by ``@``.

    >>> product([[1.0, 2.0], [0.0, 1.0]], [3.0, 4.0])
    array([11.,  4.])
    """
    return reduce(_product, factors)


def _product(a: Any, b: Any) -> Any:
    left, right = np.asarray(a), np.asarray(b)
    if left.dtype.kind == "c":
        return _product(left.real, right) + 1j * _product(left.imag, right)
    if right.dtype.kind == "c":
        return _product(left, right.real) + 1j * _product(left, right.imag)
    row, column = left.ndim == 1, right.ndim == 1
    left, right = left[None] if row else left, right[:, None] if column else right
    if left.shape[-1] != right.shape[-2]:
        raise ValueError(f"shapes {np.shape(a)} and {np.shape(b)} have no product")
    stack, other = left.shape[:-2], right.shape[:-2]
    if not stack:
        stack = other
    elif other and other != stack[-len(other) :]:
        stack = np.broadcast_shapes(stack, other)
    count = math.prod(stack)
    out = np.empty((count, left.shape[-2], right.shape[-1]))
    _call("multiply", _stacked(left, stack, count), _stacked(right, stack, count), out)
    answer = out.reshape(*stack, *out.shape[1:])
    answer = answer[..., 0] if column else answer
    return (answer[..., 0] if column else answer[..., 0, :])[()] if row else answer


def _stacked(a: Array, stack: tuple[int, ...], count: int) -> Array:
    """Matrices (s, m, n) as kernels take them, ``count`` in a stack; a single one for a whole stack.

    Kernels are compiled for one type: contiguous, and open to writing.
    """
    own = math.prod(a.shape[:-2])
    if own not in (1, count):  # of as many only ones among the lengths differ, which leaves the order
        own, a = count, np.broadcast_to(a, (*stack, *a.shape[-2:]))
    flags = a.flags
    if not (flags.c_contiguous and flags.writeable and a.dtype == np.float64):
        a = np.array(a, np.float64, order="C")
    return a.reshape(own, *a.shape[-2:])


def _one_after_another(stack: Array) -> Array:
    return stack.reshape(math.prod(stack.shape[:-2]), *stack.shape[-2:])


def norm(a: ArrayLike) -> float:
    """Root of the sum of all squares.

    >>> norm([3.0, 4.0])
    5.0
    """
    values = np.asarray(a)
    squares = np.square(values if values.dtype.kind == "f" else np.abs(values))
    return math.sqrt(float(np.add.reduce(squares, axis=None)))


def solve(a: ArrayLike, b: ArrayLike) -> Array:
    """Solution of a x = b, for stacks (..., n, n) and (..., n, k), or a vector b (n,).

    Raises
    ------
    LinAlgError
        If a matrix is singular.

    >>> solve([[2.0, 0.0], [1.0, 1.0]], [2.0, 3.0])
    array([1., 2.])
    """
    left, right = np.asarray(a, np.float64), np.asarray(b, np.float64)
    right = right[:, None] if (vector := right.ndim == 1) else right
    stack = np.broadcast_shapes(left.shape[:-2], right.shape[:-2])
    n, columns = right.shape[-2:]
    whole = np.array(np.broadcast_to(left, (*stack, n, n)), order="C").reshape(math.prod(stack), n, n)
    answer = np.array(np.broadcast_to(right, (*stack, n, columns)), order="C").reshape(math.prod(stack), n, columns)
    if not _call("eliminate", whole, answer).all():
        raise LinAlgError("Singular matrix")
    answer = answer.reshape(*stack, n, columns)
    return answer[..., 0] if vector else answer


def inv(a: ArrayLike) -> Array:
    """Inverse of matrices (..., n, n)."""
    return solve(a, np.eye(np.shape(a)[-1]))


def det(a: ArrayLike) -> float:
    """Determinant of a matrix (n, n)."""
    whole = np.array(a, np.float64, order="C")[None]
    return float(_call("eliminate", whole, np.empty((1, whole.shape[1], 0)))[0])


def eigh(a: ArrayLike, b: ArrayLike | None = None) -> tuple[Array, Array]:
    """Eigenvalues w (n,), ascending, and vectors x (n, n) of a x = w b x, symmetric and b positive definite; x'bx = 1.

    Raises
    ------
    LinAlgError
        If b is not positive definite.

    >>> eigh([[2.0, 0.0], [0.0, 8.0]], [[1.0, 0.0], [0.0, 2.0]])[0]
    array([2., 4.])
    """
    vectors = np.array(a, np.float64, order="C")
    values = np.empty(len(vectors))
    if b is not None:
        lower = np.array(b, np.float64, order="C")
        if not _call("cholesky", lower):
            raise LinAlgError("the second matrix is not positive definite")
        for _ in range(2):
            _call("forward", lower, vectors)
            vectors = np.array(vectors.T, order="C")
    if not _call("symmetric_eigenpairs", vectors, values):
        raise LinAlgError("eigenvalues did not converge")
    if b is not None:
        _call("backward", lower, vectors)
    return values, vectors


def eigvalsh(a: ArrayLike) -> Array:
    """Eigenvalues of symmetric matrices (..., n, n), ascending, (..., n)."""
    whole = np.asarray(a, np.float64)
    every = [eigh(one)[0] for one in _one_after_another(whole)]
    return np.array(every).reshape(whole.shape[:-1])


def eig(a: ArrayLike) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Complex eigenvalues (n,) and vectors (n, n) of length 1 of a real matrix; pairs are conjugate to the last bit.

    >>> eig([[0.0, 1.0], [-4.0, 0.0]])[0]
    array([0.+2.j, 0.-2.j])
    """
    whole = np.array(a, np.float64, order="C")
    values, parts = _eigenvalues(whole[None], 1)
    vectors = parts[0].astype(np.complex128)
    for j in np.flatnonzero(values[0].imag > 0.0):
        vector = parts[0, :, j] + 1j * parts[0, :, j + 1]
        size = modulus(vector)
        largest = int(np.argmax(size))
        vectors[:, j] = vector * (vector[largest].conjugate() / size[largest])
        vectors[:, j + 1] = vectors[:, j].conjugate()
    return values[0], vectors


def _eigenvalues(stack: Array, vectors: int) -> tuple[NDArray[np.complex128], Array]:
    """Eigenvalues (s, n) of matrices that are overwritten, and as many parts of vectors as there are matrices, or 1."""
    n = stack.shape[-1]
    real, imaginary, parts = np.empty((len(stack), n)), np.empty((len(stack), n)), np.empty((vectors, n, n))
    if not _call("eigenpairs", stack, real, imaginary, parts):
        raise LinAlgError("eigenvalues did not converge")
    return real + 1j * imaginary, parts


def eigvals(a: ArrayLike) -> NDArray[np.complex128]:
    """Complex eigenvalues (..., n) of real matrices (..., n, n)."""
    whole = np.array(a, np.float64, order="C")
    values, _ = _eigenvalues(_one_after_another(whole), 1)
    return values.reshape(whole.shape[:-1])


def modulus(a: ArrayLike) -> Any:
    """Modulus of complex numbers."""
    return np.hypot(np.real(a), np.imag(a))


class Singular(NamedTuple):
    """Singular values of a matrix (m, n), descending, (n,), and vectors (m, n) and (n, n): a = left values right."""

    left: Array
    values: Array
    right: Array


def svd(a: ArrayLike) -> Singular:
    """Singular values and vectors of a matrix (m, n); vectors to the left are zero where a value is.

    >>> svd([[3.0, 0.0], [0.0, -4.0]]).values
    array([4., 3.])
    """
    rows = np.array(np.transpose(a), np.float64, order="C")
    turned = np.eye(len(rows))
    if not _call("make_orthogonal", rows, turned):
        raise LinAlgError("singular values did not converge")
    values = np.array([norm(row) for row in rows])
    order = np.argsort(-values, kind="stable")
    values, rows = values[order], rows[order]
    return Singular((rows / np.where(values > 0.0, values, 1.0)[:, None]).T, values, turned[order])


def pinv(a: ArrayLike) -> Array:
    """Moore and Penrose's inverse (..., n, m) of matrices (..., m, n)."""
    whole = np.asarray(a, np.float64)
    if whole.shape[-2] < whole.shape[-1]:
        return np.swapaxes(pinv(np.swapaxes(whole, -1, -2)), -1, -2)
    every = [_pinv(one) for one in _one_after_another(whole)]
    return np.array(every).reshape(*whole.shape[:-2], whole.shape[-1], whole.shape[-2])


def _pinv(a: Array) -> Array:
    left, values, right = svd(a)
    counts = values > RANK * values.max(initial=0.0)
    inverse = np.where(counts, 1.0 / np.where(counts, values, 1.0), 0.0)
    return np.asarray(_product(right.T * inverse, left.T))


def expm(a: ArrayLike) -> Array:
    """Exponential of a matrix (n, n), by its Taylor series for a share of it and squares of that.

    >>> float(expm([[0.0, 1.0], [0.0, 0.0]])[0, 1])
    1.0
    """
    whole = np.asarray(a, np.float64)
    halvings = max(0, math.frexp(2.0 * norm(whole))[1])
    part = np.ldexp(whole, -halvings)
    total = np.eye(len(whole))
    for term in range(TAYLOR_TERMS, 0, -1):
        total = np.eye(len(whole)) + _product(part, total) / term
    for _ in range(halvings):
        total = _product(total, total)
    return total


def tensordot(a: ArrayLike, b: ArrayLike, axes: int) -> Array:
    """Sum over the last ``axes`` axes of one array and the first of another, as numpy's."""
    left, right = np.asarray(a, np.float64), np.asarray(b, np.float64)
    count, kept = math.prod(right.shape[:axes]), right.shape[axes:]
    answer = _product(left.reshape(-1, count), right.reshape(count, -1))
    return np.asarray(answer.reshape(*left.shape[: left.ndim - axes], *kept))


def _of_each(function: Callable[..., float], arguments: int = 1) -> Callable[..., Any]:
    """A function of the C library over arrays: numpy's own of some processors rounds otherwise."""
    of_each = np.frompyfunc(function, arguments, 1)
    return lambda *numbers: np.asarray(of_each(*numbers), dtype=np.float64)[()]


sin, cos, exp, log = map(_of_each, (math.sin, math.cos, math.exp, math.log))
arctan2, power = _of_each(math.atan2, 2), _of_each(math.pow, 2)
