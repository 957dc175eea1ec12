r"""Exact propagation of a linear system under a periodic force.

A regime is a set of equations of motion that hold between two contact events: y' = A y + f(t), where y holds n
displacements and n velocities. In the regime's own modal coordinates u, A consists of n real 2 x 2 blocks B:

    a pair of complex eigenvalues a +- i b     [[a, -b], [b, a]]     turns and shrinks
    two real ones                              [[a, 0], [0, b]]      shrinks, or rests where one is zero
    an undamped motion of a rigid body         [[0, 1], [0, 0]]      drifts
    a nearly critical mode, as (w q, q')       [[0, w], [-w, -d]]    has one eigenvector, or two that nearly agree

The steady response to a harmonic of the force is taken off, and so is that to a constant force where there is one.
What is left in u moves freely, so a step costs n small blocks whatever its length and has no truncation error.
"""

import math

from chaosgym.core.kernel import leaf, njit


@njit(cache=True, inline="always")
def oscillates(generator, j):
    """True if block j holds a complex pair, or a nearly critical mode: in both the square of its norm never grows."""
    return generator[2, j] != 0.0


@njit(cache=True, inline="always")
def exponential(p, q, r, s, time):
    """Entries (11, 12, 21, 22) of exp(B time) for a block B = [[p, q], [r, s]]."""
    if r != 0.0:
        if p == 0.0 and s != 0.0:
            return _critical(q, -s, time)
        decay, angle = math.exp(p * time), r * time
        cosine, sine = decay * math.cos(angle), decay * math.sin(angle)
        return cosine, -sine, sine, cosine
    return math.exp(p * time), q * time, 0.0, math.exp(s * time)


@leaf
def _critical(w, d, time):
    """The same for B = [[0, w], [-w, -d]], whether it turns or not; both roots may be one."""
    h = 0.5 * d
    square = (h - w) * (h + w)
    z = square * time * time
    if abs(z) < 0.25:
        decay = math.exp(-h * time)
        even, odd = 1.0, 1.0
        for k in range(16, 0, -2):
            even, odd = 1.0 + z * even / (k * (k - 1)), 1.0 + z * odd / (k * (k + 1))
        even, odd = decay * even, decay * time * odd
    elif square < 0.0:
        decay, rate = math.exp(-h * time), math.sqrt(-square)
        even, odd = decay * math.cos(rate * time), decay * math.sin(rate * time) / rate
    else:
        rate = math.sqrt(square)
        slow, fast = math.exp(-w * w / (h + rate) * time), math.exp(-(h + rate) * time)
        even, odd = 0.5 * (slow + fast), 0.5 * (slow - fast) / rate
    return even + h * odd, w * odd, -w * odd, even - h * odd


@njit(cache=True, inline="always")
def block(generator, j, time):
    """Entries (11, 12, 21, 22) of exp(B time) for block j of a regime's generator (4, n)."""
    return exponential(generator[0, j], generator[1, j], generator[2, j], generator[3, j], time)


@leaf
def move(generator, u, time, moved):
    """moved = exp(B time) u for modal coordinates (2n,); ``moved`` may be u."""
    n = generator.shape[1]
    for j in range(n):
        e11, e12, e21, e22 = block(generator, j, time)
        first, second = u[j], u[n + j]
        moved[j] = e11 * first + e12 * second
        moved[n + j] = e21 * first + e22 * second


@njit(cache=True)
def derivative(generator, row, result):
    """Row of the time derivative of the quantity that ``row`` (2n,) reads off modal coordinates."""
    n = generator.shape[1]
    for j in range(n):
        first, second = row[j], row[n + j]
        result[j] = first * generator[0, j] + second * generator[2, j]
        result[n + j] = first * generator[1, j] + second * generator[3, j]


@njit(cache=True)
def bound(generator, row, result):
    """Coefficients m (2n,) with abs(row . exp(B t) u) <= sum m abs(u) for all t >= 0, for a row that does not drift."""
    n = generator.shape[1]
    for j in range(n):
        size = math.hypot(row[j], row[n + j])
        result[j] = size if oscillates(generator, j) else abs(row[j])
        result[n + j] = size if oscillates(generator, j) else abs(row[n + j])


@njit(cache=True)
def steady_response(generator, cosine, sine, w, steady):
    """Steady modal response (2n, 2) to a force with modal parts ``cosine`` and ``sine`` (2n,) at w [rad/s].

    The columns are what goes with cos(w t) and with sin(w t): (B^2 + w^2) C = -(B g_c + w g_s) and
    (B^2 + w^2) S = w g_c - B g_s.
    """
    n = generator.shape[1]
    for j in range(n):
        p, q, r, s = generator[0, j], generator[1, j], generator[2, j], generator[3, j]
        m11, m12 = p * p + q * r + w * w, q * (p + s)
        m21, m22 = r * (p + s), s * s + q * r + w * w
        determinant = m11 * m22 - m12 * m21
        for column in range(2):
            if column == 0:
                x = -(p * cosine[j] + q * cosine[n + j]) - w * sine[j]
                y = -(r * cosine[j] + s * cosine[n + j]) - w * sine[n + j]
            else:
                x = w * cosine[j] - (p * sine[j] + q * sine[n + j])
                y = w * cosine[n + j] - (r * sine[j] + s * sine[n + j])
            if determinant == 0.0:
                steady[j, column], steady[n + j, column] = math.inf, math.inf
            else:
                steady[j, column] = (m22 * x - m12 * y) / determinant
                steady[n + j, column] = (m11 * y - m21 * x) / determinant


@njit(cache=True, inline="always")
def safe_time(distance, slope, curvature):
    """Time [s] for which a quantity that starts at ``distance`` surely stays positive.

    Its slope is ``slope`` and the modulus of its second derivative never exceeds ``curvature``, so the answer is the
    first positive root of distance + slope t - curvature t^2 / 2. A distance below zero counts as zero.
    """
    if distance == math.inf:
        return math.inf
    distance = max(distance, 0.0)
    if curvature <= 0.0:
        return math.inf if slope >= 0.0 else -distance / slope
    root = math.sqrt(slope * slope + 2.0 * curvature * distance)
    return (slope + root) / curvature if slope >= 0.0 else 2.0 * distance / (root - slope)
