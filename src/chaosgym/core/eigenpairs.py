"""Eigenvalues and vectors of small real matrices, in a fixed order of sums.

References
----------
Peters and Wilkinson (balancing, Hessenberg form, QR with vectors): Handbook for Automatic Computation II (1971), as
EISPACK has them.
"""

import math

import numpy as np

from chaosgym.core.kernel import njit
from chaosgym.core.linear_algebra import EPSILON, SWEEPS, to_order_one

NOTHING = 1e-290
"""Share of the largest entry below which one is zero in balancing, whose powers of two stay within the range."""

PATIENT = 30
"""Steps for one eigenvalue after which an entry is nothing beside the whole matrix, not beside its neighbours alone.

Slow modes of a machine that a stiff spring holds are nearly defective: what rounding leaves below their small diagonal
is of the size that the large entries beside it give. A usual eigenvalue takes two or three steps.
"""


@njit(cache=True, nogil=True)
def eigenpairs(stack, real, imaginary, vectors):
    """Eigenvalues (s, n) of matrices (s, n, n), which are overwritten; False if it fails.

    A pair of complex eigenvalues comes with that of the positive imaginary part first. ``vectors`` (s, n, n) become
    the eigenvectors: two columns are the real and the imaginary part of a pair's first. A stack (1, n, n) of another
    length than the matrices is working space, and no vectors are made.
    """
    for s in range(len(stack)):
        wanted = len(vectors) == len(stack)
        size = to_order_one(stack[s])
        if not _eigenpairs(stack[s], real[s], imaginary[s], vectors[s if wanted else 0], wanted):
            return False
        for i in range(stack.shape[1]):
            real[s, i] *= size
            imaginary[s, i] *= size
    return True


@njit(cache=True, nogil=True)
def _eigenpairs(a, real, imaginary, v, wanted):
    n = len(a)
    scale = np.ones(n)
    _balance(a, scale)
    _hessenberg(a, v)
    norm = 0.0
    for i in range(n):
        for j in range(max(i - 1, 0), n):
            norm += abs(a[i, j])
    if not _schur(a, v, real, imaginary, norm):
        return False
    if not wanted:
        return True
    if norm > 0.0:
        _put_vectors(a, real, imaginary, norm)
        for j in range(n - 1, -1, -1):
            for i in range(n):
                total = 0.0
                for k in range(j + 1):
                    total += v[i, k] * a[k, j]
                v[i, j] = total
    for j in range(n):
        if imaginary[j] < 0.0:
            continue
        size, parts = 0.0, 2 if imaginary[j] > 0.0 else 1
        for i in range(n):
            for k in range(j, j + parts):
                v[i, k] *= scale[i]
                size += v[i, k] * v[i, k]
        for i in range(n):
            for k in range(j, j + parts):
                v[i, k] /= math.sqrt(size)
    return True


@njit(cache=True, nogil=True)
def _balance(a, scale):
    """Make rows and columns of equal size, by powers of two, which round nothing."""
    n, done, largest = len(a), False, 0.0
    for i in range(n):
        for j in range(n):
            largest = max(largest, abs(a[i, j]))
    for i in range(n):
        for j in range(n):
            if abs(a[i, j]) < NOTHING * largest:
                a[i, j] = 0.0
    while not done:
        done = True
        for i in range(n):
            column = row = 0.0
            for j in range(n):
                if j != i:
                    column += abs(a[j, i])
                    row += abs(a[i, j])
            if column == 0.0 or row == 0.0:
                continue
            factor, total = 1.0, column + row
            while column < row / 2.0:
                factor *= 2.0
                column *= 4.0
            while column >= row * 2.0:
                factor /= 2.0
                column /= 4.0
            if (column + row) / factor < 0.95 * total:
                done = False
                scale[i] *= factor
                for j in range(n):
                    a[i, j] /= factor
                for j in range(n):
                    a[j, i] *= factor


@njit(cache=True, nogil=True)
def _hessenberg(h, v):
    """Householder's reduction of a matrix in place; v becomes the transformation."""
    n = len(h)
    reflected = np.zeros(n)
    for i in range(n):
        for j in range(n):
            v[i, j] = 1.0 if i == j else 0.0
    for m in range(1, n - 1):
        scale = 0.0
        for i in range(m, n):
            scale += abs(h[i, m - 1])
        if scale == 0.0:
            continue
        size = 0.0
        for i in range(m, n):
            reflected[i] = h[i, m - 1] / scale
            size += reflected[i] * reflected[i]
        g = -math.sqrt(size) if reflected[m] > 0.0 else math.sqrt(size)
        size -= reflected[m] * g
        reflected[m] -= g
        for j in range(m, n):
            f = 0.0
            for i in range(m, n):
                f += reflected[i] * h[i, j]
            for i in range(m, n):
                h[i, j] -= f / size * reflected[i]
        for matrix in (h, v):
            for i in range(n):
                f = 0.0
                for j in range(m, n):
                    f += reflected[j] * matrix[i, j]
                for j in range(m, n):
                    matrix[i, j] -= f / size * reflected[j]
        h[m, m - 1] = scale * g
        for i in range(m + 1, n):
            h[i, m - 1] = 0.0


@njit(cache=True, nogil=True)
def _schur(h, v, real, imaginary, norm):
    """Francis' QR steps: real Schur form of a Hessenberg matrix, v turned along; False if it takes too long."""
    n = len(h)
    last, moved, steps = n - 1, 0.0, 0
    while last >= 0:
        low = last
        while low > 0:
            s = abs(h[low - 1, low - 1]) + abs(h[low, low])
            if s == 0.0 or steps > PATIENT:
                s = norm
            if abs(h[low, low - 1]) < EPSILON * s or h[low, low - 1] == 0.0:
                break
            low -= 1
        if low == last:
            h[last, last] += moved
            real[last], imaginary[last] = h[last, last], 0.0
            last, steps = last - 1, 0
            continue
        if low == last - 1:
            _split(h, v, real, imaginary, last, moved)
            last, steps = last - 2, 0
            continue
        x, y, w = h[last, last], h[last - 1, last - 1], h[last, last - 1] * h[last - 1, last]
        if steps > 0 and steps % 10 == 0:  # a shift of another kind ends a circle
            moved += x
            for i in range(last + 1):
                h[i, i] -= x
            s = abs(h[last, last - 1]) + abs(h[last - 1, last - 2])
            x = y = 0.75 * s
            w = -0.4375 * s * s
        steps += 1
        if steps > SWEEPS:
            return False
        m = last - 2
        p = q = r = 0.0
        while True:
            z = h[m, m]
            r, s = x - z, y - z
            p = (r * s - w) / h[m + 1, m] + h[m, m + 1]
            q = h[m + 1, m + 1] - z - r - s
            r = h[m + 2, m + 1]
            s = abs(p) + abs(q) + abs(r)
            p, q, r = p / s, q / s, r / s
            if m == low:
                break
            around = abs(h[m - 1, m - 1]) + abs(z) + abs(h[m + 1, m + 1])
            if abs(h[m, m - 1]) * (abs(q) + abs(r)) < EPSILON * (abs(p) * around):
                break
            m -= 1
        for i in range(m + 2, last + 1):
            h[i, i - 2] = 0.0
            if i > m + 2:
                h[i, i - 3] = 0.0
        for k in range(m, last):
            three = k != last - 1
            if k != m:
                p, q, r = h[k, k - 1], h[k + 1, k - 1], h[k + 2, k - 1] if three else 0.0
                x = abs(p) + abs(q) + abs(r)
                if x == 0.0:
                    continue
                p, q, r = p / x, q / x, r / x
            s = math.sqrt(p * p + q * q + r * r)
            if p < 0.0:
                s = -s
            if k != m:
                h[k, k - 1] = -s * x
            elif low != m:
                h[k, k - 1] = -h[k, k - 1]
            p += s
            x, y, z, q, r = p / s, q / s, r / s, q / p, r / p
            for j in range(k, n):
                p = h[k, j] + q * h[k + 1, j]
                if three:
                    p += r * h[k + 2, j]
                    h[k + 2, j] -= p * z
                h[k, j] -= p * x
                h[k + 1, j] -= p * y
            for matrix, rows in ((h, min(last, k + 3) + 1), (v, n)):
                for i in range(rows):
                    p = x * matrix[i, k] + y * matrix[i, k + 1]
                    if three:
                        p += z * matrix[i, k + 2]
                        matrix[i, k + 2] -= p * r
                    matrix[i, k] -= p
                    matrix[i, k + 1] -= p * q
    return True


@njit(cache=True, nogil=True)
def _split(h, v, real, imaginary, last, moved):
    """Eigenvalues of a block of two; one with real eigenvalues becomes triangular."""
    n, first = len(h), last - 1
    w = h[last, first] * h[first, last]
    p = 0.5 * (h[first, first] - h[last, last])
    q = p * p + w
    z = math.sqrt(abs(q))
    h[last, last] += moved
    h[first, first] += moved
    x = h[last, last]
    if q < 0.0:
        real[first] = real[last] = x + p
        imaginary[first], imaginary[last] = z, -z
        return
    z = p + z if p >= 0.0 else p - z
    real[first] = x + z
    real[last] = x - w / z if z != 0.0 else x + z
    imaginary[first] = imaginary[last] = 0.0
    x = h[last, first]
    s = abs(x) + abs(z)
    p, q = x / s, z / s
    r = math.sqrt(p * p + q * q)
    p, q = p / r, q / r
    for j in range(first, n):
        z = h[first, j]
        h[first, j] = q * z + p * h[last, j]
        h[last, j] = q * h[last, j] - p * z
    for matrix, rows in ((h, last + 1), (v, n)):
        for i in range(rows):
            z = matrix[i, first]
            matrix[i, first] = q * z + p * matrix[i, last]
            matrix[i, last] = q * matrix[i, last] - p * z


@njit(cache=True, nogil=True)
def _put_vectors(h, real, imaginary, norm):
    """Eigenvectors of a real Schur form, in its place, by substitution from below."""
    n = len(h)
    z = r = s = 0.0
    for k in range(n - 1, -1, -1):
        p, q = real[k], imaginary[k]
        if q == 0.0:
            low = k
            h[k, k] = 1.0
            for i in range(k - 1, -1, -1):
                w, total = h[i, i] - p, 0.0
                for j in range(low, k + 1):
                    total += h[i, j] * h[j, k]
                if imaginary[i] < 0.0:
                    z, s = w, total
                    continue
                low = i
                if imaginary[i] == 0.0:
                    h[i, k] = -total / (w if w != 0.0 else EPSILON * norm)
                else:
                    x, y = h[i, i + 1], h[i + 1, i]
                    t = (x * s - z * total) / ((real[i] - p) ** 2 + imaginary[i] ** 2)
                    h[i, k] = t
                    h[i + 1, k] = (-total - w * t) / x if abs(x) > abs(z) else (-s - y * t) / z
                t = abs(h[i, k])
                if EPSILON * t * t > 1.0:
                    for j in range(i, k + 1):
                        h[j, k] /= t
        elif q < 0.0:
            low = k - 1
            if abs(h[k, k - 1]) > abs(h[k - 1, k]):
                h[k - 1, k - 1] = q / h[k, k - 1]
                h[k - 1, k] = -(h[k, k] - p) / h[k, k - 1]
            else:
                ratio = complex(0.0, -h[k - 1, k]) / complex(h[k - 1, k - 1] - p, q)
                h[k - 1, k - 1], h[k - 1, k] = ratio.real, ratio.imag
            h[k, k - 1], h[k, k] = 0.0, 1.0
            for i in range(k - 2, -1, -1):
                ra = sa = 0.0
                for j in range(low, k + 1):
                    ra += h[i, j] * h[j, k - 1]
                    sa += h[i, j] * h[j, k]
                w = h[i, i] - p
                if imaginary[i] < 0.0:
                    z, r, s = w, ra, sa
                    continue
                low = i
                if imaginary[i] == 0.0:
                    ratio = complex(-ra, -sa) / _not_zero(complex(w, q), norm)
                    h[i, k - 1], h[i, k] = ratio.real, ratio.imag
                else:
                    x, y = h[i, i + 1], h[i + 1, i]
                    apart = complex((real[i] - p) ** 2 + imaginary[i] ** 2 - q * q, (real[i] - p) * 2.0 * q)
                    size = norm * (abs(w) + abs(q) + abs(x) + abs(y) + abs(z))
                    ratio = complex(x * r - z * ra + q * sa, x * s - z * sa - q * ra) / _not_zero(apart, size)
                    h[i, k - 1], h[i, k] = ratio.real, ratio.imag
                    if abs(x) > abs(z) + abs(q):
                        h[i + 1, k - 1] = (-ra - w * h[i, k - 1] + q * h[i, k]) / x
                        h[i + 1, k] = (-sa - w * h[i, k] - q * h[i, k - 1]) / x
                    else:
                        ratio = complex(-r - y * h[i, k - 1], -s - y * h[i, k]) / complex(z, q)
                        h[i + 1, k - 1], h[i + 1, k] = ratio.real, ratio.imag
                t = max(abs(h[i, k - 1]), abs(h[i, k]))
                if EPSILON * t * t > 1.0:
                    for j in range(i, k + 1):
                        h[j, k - 1] /= t
                        h[j, k] /= t


@njit(cache=True, nogil=True)
def _not_zero(value, size):
    return value if value.real != 0.0 or value.imag != 0.0 else complex(EPSILON * size, 0.0)
