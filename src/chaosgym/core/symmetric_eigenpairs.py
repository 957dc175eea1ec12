"""Eigenvalues and vectors of a small symmetric matrix, in a fixed order of sums.

References
----------
Martin, Reinsch and Wilkinson (tridiagonal form), Bowdler and others (QL): Handbook for Automatic Computation II (1971),
as EISPACK has them.
"""

import math

import numpy as np

from chaosgym.core.kernel import njit
from chaosgym.core.linear_algebra import EPSILON, SWEEPS, to_order_one


@njit(cache=True, nogil=True)
def symmetric_eigenpairs(v, d):
    """Eigenvalues d (n,), ascending, of a symmetric matrix v (n, n), which becomes its vectors; False if it fails."""
    n = len(v)
    e, size = np.zeros(n), to_order_one(v)
    _tridiagonalise(v, d, e)
    # rows in place of columns: rotations go along memory
    rows = v.T.copy()
    fine = _ql(rows, d, e)
    for i in range(n):
        k = i
        for j in range(i + 1, n):
            if d[j] < d[k]:
                k = j
        d[i], d[k] = d[k], d[i]
        for j in range(n):
            v[j, i] = rows[k, j]
            rows[k, j] = rows[i, j]
        d[i] *= size
    return fine


@njit(cache=True, nogil=True)
def _tridiagonalise(v, d, e):
    """Householder's reduction: diagonal d, subdiagonal e[1:], and the transformation in place of the matrix."""
    n = len(v)
    for j in range(n):
        d[j] = v[n - 1, j]
    for i in range(n - 1, 0, -1):
        scale, h = 0.0, 0.0
        for k in range(i):
            scale += abs(d[k])
        if scale == 0.0:
            e[i] = d[i - 1]
            for j in range(i):
                d[j] = v[i - 1, j]
                v[i, j] = v[j, i] = 0.0
        else:
            for k in range(i):
                d[k] /= scale
                h += d[k] * d[k]
            f = d[i - 1]
            g = -math.sqrt(h) if f > 0.0 else math.sqrt(h)
            e[i] = scale * g
            h -= f * g
            d[i - 1] = f - g
            for j in range(i):
                e[j] = 0.0
            for j in range(i):
                f = d[j]
                v[j, i] = f
                g = e[j] + v[j, j] * f
                for k in range(j + 1, i):
                    g += v[k, j] * d[k]
                    e[k] += v[k, j] * f
                e[j] = g
            f = 0.0
            for j in range(i):
                e[j] /= h
                f += e[j] * d[j]
            for j in range(i):
                e[j] -= f / (h + h) * d[j]
            for j in range(i):
                f, g = d[j], e[j]
                for k in range(j, i):
                    v[k, j] -= f * e[k] + g * d[k]
                d[j] = v[i - 1, j]
                v[i, j] = 0.0
        d[i] = h
    for i in range(n - 1):
        v[n - 1, i] = v[i, i]
        v[i, i] = 1.0
        h = d[i + 1]
        if h != 0.0:
            for k in range(i + 1):
                d[k] = v[k, i + 1] / h
            for j in range(i + 1):
                g = 0.0
                for k in range(i + 1):
                    g += v[k, i + 1] * v[k, j]
                for k in range(i + 1):
                    v[k, j] -= g * d[k]
        for k in range(i + 1):
            v[k, i + 1] = 0.0
    for j in range(n):
        d[j] = v[n - 1, j]
        v[n - 1, j] = 0.0
    v[n - 1, n - 1] = 1.0


@njit(cache=True, nogil=True)
def _ql(rows, d, e):
    """Implicit QL of a tridiagonal matrix; turns the rows along. False if an eigenvalue takes too long."""
    n = len(d)
    for i in range(1, n):
        e[i - 1] = e[i]
    e[n - 1] = 0.0
    shift, largest = 0.0, 0.0
    for low in range(n):
        largest = max(largest, abs(d[low]) + abs(e[low]))
        m = low
        while m < n - 1 and abs(e[m]) > EPSILON * largest:
            m += 1
        steps = 0
        while m > low and abs(e[low]) > EPSILON * largest:
            steps += 1
            if steps > SWEEPS:
                return False
            g = d[low]
            p = (d[low + 1] - g) / (2.0 * e[low])
            r = math.sqrt(p * p + 1.0)
            if p < 0.0:
                r = -r
            d[low], d[low + 1] = e[low] / (p + r), e[low] * (p + r)
            after, h = d[low + 1], g - d[low]
            for i in range(low + 2, n):
                d[i] -= h
            shift += h
            p = d[m]
            c = before = older = 1.0
            beside, s, s_before = e[low + 1], 0.0, 0.0
            for i in range(m - 1, low - 1, -1):
                older, before, s_before = before, c, s
                g, h = c * e[i], c * p
                r = math.sqrt(p * p + e[i] * e[i])
                e[i + 1] = s * r
                s, c = e[i] / r, p / r
                p = c * d[i] - s * g
                d[i + 1] = h + s * (c * g + s * d[i])
                for k in range(n):
                    h = rows[i + 1, k]
                    rows[i + 1, k] = s * rows[i, k] + c * h
                    rows[i, k] = c * rows[i, k] - s * h
            p = -s * s_before * older * beside * e[low] / after
            e[low], d[low] = s * p, c * p
        d[low] += shift
        e[low] = 0.0
    return True
