"""Kernels of linear algebra on small dense matrices, which add in a fixed order: equal bits on every processor.

Libraries of linear algebra choose the order of their sums by the processor, and impacts magnify the last digit.
``chaosgym.core.matrices`` calls these.

References
----------
Hestenes, J. SIAM 6 (1958): one-sided rotations.
"""

import math

import numpy as np

from chaosgym.core.kernel import njit

EPSILON = 2.0**-52

TINIEST = 2.0**-1022
"""Smallest number with all its digits."""

WIDE = 6
"""Columns from which on a product goes along rows: vectors pay then. The order of sums is the same."""

SWEEPS = 60
"""Steps for one eigenvalue, or sweeps of rotations, after which a kernel gives up."""


@njit(cache=True, nogil=True)
def multiply(a, b, out):
    """Write products of stacks (s, m, k) and (s, k, n) into ``out``; a stack of one serves for all."""
    rows, inner, columns = out.shape[1], a.shape[2], out.shape[2]
    for s in range(len(out)):
        left, right = a[s if len(a) > 1 else 0], b[s if len(b) > 1 else 0]
        for i in range(rows):
            if columns >= WIDE:
                for j in range(columns):
                    out[s, i, j] = 0.0
                for k in range(inner):
                    factor = left[i, k]
                    for j in range(columns):
                        out[s, i, j] += factor * right[k, j]
                continue
            for j in range(0, columns - 3, 4):
                first = second = third = fourth = 0.0
                for k in range(inner):
                    factor = left[i, k]
                    first += factor * right[k, j]
                    second += factor * right[k, j + 1]
                    third += factor * right[k, j + 2]
                    fourth += factor * right[k, j + 3]
                out[s, i, j], out[s, i, j + 1], out[s, i, j + 2], out[s, i, j + 3] = first, second, third, fourth
            for j in range(columns - columns % 4, columns):
                total = 0.0
                for k in range(inner):
                    total += left[i, k] * right[k, j]
                out[s, i, j] = total


@njit(cache=True, nogil=True)
def times(a, b):
    """Product (m, n) of a matrix (m, k) and the first k rows of another one."""
    product = np.zeros((a.shape[0], b.shape[1]))
    for i in range(a.shape[0]):
        for k in range(a.shape[1]):
            for j in range(b.shape[1]):
                product[i, j] += a[i, k] * b[k, j]
    return product


@njit(cache=True, nogil=True)
def eliminate(a, b):
    """Solve a x = b for stacks (s, n, n) and (s, n, k), overwriting both; returns (s,) determinants, 0 if singular.

    A determinant below the range of numbers, as of a hundred soft springs, stays at its end: nothing is singular by it.
    """
    found = np.ones(len(a))
    for s in range(len(a)):
        m, right = a[s], b[s]
        n, columns = right.shape
        for p in range(n):
            top = p
            for i in range(p + 1, n):
                if abs(m[i, p]) > abs(m[top, p]):
                    top = i
            if m[top, p] == 0.0:
                found[s] = 0.0
                break
            if top != p:
                found[s] = -found[s]
                for j in range(n):
                    m[p, j], m[top, j] = m[top, j], m[p, j]
                for j in range(columns):
                    right[p, j], right[top, j] = right[top, j], right[p, j]
            found[s] *= m[p, p]
            if found[s] == 0.0:
                found[s] = math.copysign(TINIEST, found[s])
            for i in range(p + 1, n):
                factor = m[i, p] / m[p, p]
                for j in range(p + 1, n):
                    m[i, j] -= factor * m[p, j]
                for j in range(columns):
                    right[i, j] -= factor * right[p, j]
        if found[s] != 0.0 or columns == 0:
            for i in range(n - 1, -1, -1):
                for k in range(i + 1, n):
                    factor = m[i, k]
                    for j in range(columns):
                        right[i, j] -= factor * right[k, j]
                for j in range(columns):
                    right[i, j] /= m[i, i]
    return found


@njit(cache=True, nogil=True)
def cholesky(a):
    """Overwrite the lower triangle of a symmetric matrix (n, n) by its Cholesky factor; False if it is not definite."""
    n = len(a)
    for j in range(n):
        for k in range(j):
            factor = a[j, k]
            for i in range(j, n):
                a[i, j] -= factor * a[i, k]
        if not a[j, j] > 0.0:
            return False
        root = math.sqrt(a[j, j])
        for i in range(j, n):
            a[i, j] /= root
    return True


@njit(cache=True, nogil=True)
def forward(lower, b):
    """Solve L x = b by the lower triangle of a matrix (n, n), overwriting b (n, k)."""
    for i in range(len(b)):
        for k in range(i):
            factor = lower[i, k]
            for j in range(b.shape[1]):
                b[i, j] -= factor * b[k, j]
        for j in range(b.shape[1]):
            b[i, j] /= lower[i, i]


@njit(cache=True, nogil=True)
def backward(lower, b):
    """Solve L' x = b by the lower triangle of a matrix (n, n), overwriting b (n, k)."""
    for i in range(len(b) - 1, -1, -1):
        for k in range(i + 1, len(b)):
            factor = lower[k, i]
            for j in range(b.shape[1]):
                b[i, j] -= factor * b[k, j]
        for j in range(b.shape[1]):
            b[i, j] /= lower[i, i]


@njit(cache=True, nogil=True)
def make_orthogonal(rows, turned):
    """Turn pairs of rows (m, n) until all are orthogonal, ``turned`` (m, m) along; False if that takes too long.

    What a row has left below the rounding of all is no direction.
    """
    m, total = len(rows), 0.0
    for i in range(m):
        for k in range(rows.shape[1]):
            total += rows[i, k] * rows[i, k]
    nothing = m * EPSILON * math.sqrt(total)
    for _ in range(SWEEPS):
        largest = 0.0
        for i in range(m - 1):
            for j in range(i + 1, m):
                a = b = c = 0.0
                for k in range(rows.shape[1]):
                    a += rows[i, k] * rows[i, k]
                    b += rows[j, k] * rows[j, k]
                    c += rows[i, k] * rows[j, k]
                a, b = math.sqrt(a), math.sqrt(b)
                if not min(a, b) > nothing or not abs(c) > EPSILON * a * b:
                    continue
                largest = max(largest, abs(c) / (a * b))
                half = (b - a) * (b + a) / (2.0 * c)
                t = 1.0 / (abs(half) + math.sqrt(1.0 + half * half))
                if half < 0.0:
                    t = -t
                cosine = 1.0 / math.sqrt(1.0 + t * t)
                for matrix in (rows, turned):
                    for k in range(matrix.shape[1]):
                        one, other = matrix[i, k], matrix[j, k]
                        matrix[i, k] = cosine * (one - t * other)
                        matrix[j, k] = cosine * (other + t * one)
        if largest < 8.0 * EPSILON:
            return True
    return False


@njit(cache=True, nogil=True)
def to_order_one(a):
    """Divide a matrix whose squares leave the range of numbers by a power of two, which is returned.

    One whose entries are all below ``TINIEST`` has no digits, and becomes zero.
    """
    largest = 0.0
    for i in range(len(a)):
        for j in range(len(a)):
            largest = max(largest, abs(a[i, j]))
    if largest < TINIEST:
        a[:] = 0.0
        return 1.0
    if 1e-100 < largest < 1e100:
        return 1.0
    size = 2.0 ** math.floor(math.log2(largest))
    for i in range(len(a)):
        for j in range(len(a)):
            a[i, j] /= size
    return size
