r"""Exact propagation of a linear system under a sinusoidal force.

A regime is a set of equations of motion that hold between two contact events: y' = A y + b sin(w t), where y holds n
displacements and n velocities. In the regime's own modal coordinates u, A consists of n real 2 x 2 blocks B. A pair
of complex eigenvalues a +- i b turns and shrinks, a pair of real ones only shrinks:

    exp(B t) = e^{a t} [[cos b t, -sin b t], [sin b t, cos b t]]      or      diag(e^{l1 t}, e^{l2 t})

The force is one more block, (cos w t, sin w t), and the steady response to it is part of the maps between y and u.
What is left in u decays freely, so a step costs n + 1 small rotations whatever its length and has no truncation error.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from chaosgym.core.kernel import leaf


class Regimes(NamedTuple):
    """R linear regimes of one system with n degrees of freedom, each in its own m modal blocks.

    m = n for the system alone, m = n + 1 once ``with_force`` has added the block of the force.

    Attributes
    ----------
    rotates : (R, m) bool
        True where the block turns (complex pair), False where it holds two real eigenvalues.
    rate : (R, m, 2)
        a and b of a complex pair, or the two real eigenvalues [1/s]; none grows.
    to_modal : (R, 2n, 2n) or (R, 2n, 2n + 2)
        Free modal coordinates from y, or from y followed by (cos w t, sin w t).
    from_modal : (R, 2n, 2m)
        y from modal coordinates.
    output : (R, 3, 2m)
        Displacement [m], velocity and acceleration of the tip per unit modal coordinate.
    magnitude : (R, 2, 2m)
        Bounds of the second and third derivative of the tip displacement per unit modal coordinate.
    forcing : (R, 2n)
        Modal coordinates of b for a unit force amplitude.
    modulus : (R, 2m)
        Modulus of the eigenvalue of each modal coordinate [1/s].
    fastest : (R,)
        Largest of them.
    """

    rotates: np.ndarray
    rate: np.ndarray
    to_modal: np.ndarray
    from_modal: np.ndarray
    output: np.ndarray
    magnitude: np.ndarray
    forcing: np.ndarray
    modulus: np.ndarray
    fastest: np.ndarray


@njit(cache=True)
def with_force(regimes, amplitude, angular_frequency):
    """The regimes with the block of the force amplitude * sin(w t) added, and its steady response in the maps."""
    count, n = regimes.rotates.shape
    w = angular_frequency
    rotates = np.ones((count, n + 1), dtype=np.bool_)
    rotates[:, :n] = regimes.rotates
    rate = np.zeros((count, n + 1, 2))
    rate[:, :n] = regimes.rate
    rate[:, n, 1] = w
    to_modal = np.zeros((count, 2 * n, 2 * n + 2))
    from_modal = np.zeros((count, 2 * n, 2 * n + 2))
    output = np.zeros((count, 3, 2 * n + 2))
    magnitude = np.zeros((count, 2, 2 * n + 2))
    to_modal[:, :, : 2 * n] = regimes.to_modal
    from_modal[:, :, : 2 * n] = regimes.from_modal
    output[:, :, : 2 * n] = regimes.output
    magnitude[:, :, : 2 * n] = regimes.magnitude
    modulus = np.full((count, 2 * n + 2), w)
    modulus[:, : 2 * n] = regimes.modulus
    fastest = np.maximum(regimes.fastest, w)
    steady = np.empty((2 * n, 2))
    for r in range(count):
        for j in range(n):
            f1 = amplitude * regimes.forcing[r, 2 * j]
            f2 = amplitude * regimes.forcing[r, 2 * j + 1]
            if regimes.rotates[r, j]:
                eigenvalue = complex(regimes.rate[r, j, 0], regimes.rate[r, j, 1])
                cosine = -complex(f1, f2) * w / (w * w + eigenvalue * eigenvalue)
                sine = eigenvalue * cosine / w
                steady[2 * j, 0], steady[2 * j, 1] = cosine.real, sine.real
                steady[2 * j + 1, 0], steady[2 * j + 1, 1] = cosine.imag, sine.imag
            else:
                for i in range(2):
                    eigenvalue = regimes.rate[r, j, i]
                    force = f1 if i == 0 else f2
                    steady[2 * j + i, 0] = -force * w / (w * w + eigenvalue * eigenvalue)
                    steady[2 * j + i, 1] = steady[2 * j + i, 0] * eigenvalue / w
        for i in range(2 * n):
            for k in range(2):
                to_modal[r, i, 2 * n + k] = -steady[i, k]
                for j in range(2 * n):
                    from_modal[r, i, 2 * n + k] += regimes.from_modal[r, i, j] * steady[j, k]
        x_cosine, x_sine = 0.0, 0.0
        for j in range(2 * n):
            x_cosine += regimes.output[r, 0, j] * steady[j, 0]
            x_sine += regimes.output[r, 0, j] * steady[j, 1]
        output[r, 0, 2 * n], output[r, 0, 2 * n + 1] = x_cosine, x_sine
        output[r, 1, 2 * n], output[r, 1, 2 * n + 1] = w * x_sine, -w * x_cosine
        output[r, 2, 2 * n], output[r, 2, 2 * n + 1] = -w * w * x_cosine, -w * w * x_sine
        size = math.hypot(x_cosine, x_sine)
        magnitude[r, 0, 2 * n :] = w**2 * size
        magnitude[r, 1, 2 * n :] = w**3 * size
    return Regimes(rotates, rate, to_modal, from_modal, output, magnitude, regimes.forcing, modulus, fastest)


@njit(cache=True, inline="always")
def block(regimes, r, j, time):
    """Entries (11, 12, 21, 22) of exp(B time) for block j of regime r."""
    if regimes.rotates[r, j]:
        decay = math.exp(regimes.rate[r, j, 0] * time)
        angle = regimes.rate[r, j, 1] * time
        c = decay * math.cos(angle)
        s = decay * math.sin(angle)
        return c, -s, s, c
    return math.exp(regimes.rate[r, j, 0] * time), 0.0, 0.0, math.exp(regimes.rate[r, j, 1] * time)


@njit(cache=True)
def step_table(regimes, shortest, levels):
    """exp(B h) for the steps h = shortest[r] * 2**level: shape (R, levels, 4, m)."""
    count, m = regimes.rotates.shape
    table = np.empty((count, levels, 4, m))
    for r in range(count):
        for level in range(levels):
            for j in range(m):
                entries = block(regimes, r, j, math.ldexp(shortest[r], level))
                for i in range(4):
                    table[r, level, i, j] = entries[i]
    return table


@leaf
def move(regimes, r, u, time, moved):
    """moved = exp(B time) u, for any time."""
    for j in range(regimes.rotates.shape[1]):
        e11, e12, e21, e22 = block(regimes, r, j, time)
        moved[2 * j] = e11 * u[2 * j] + e12 * u[2 * j + 1]
        moved[2 * j + 1] = e21 * u[2 * j] + e22 * u[2 * j + 1]


@leaf
def nudge(regimes, r, u, time):
    """u = exp(B time) u in place by a Taylor series of order five: for times well below 1 / fastest."""
    for j in range(regimes.rotates.shape[1]):
        rate1 = regimes.rate[r, j, 0] * time
        rate2 = regimes.rate[r, j, 1] * time
        term1, term2 = u[2 * j], u[2 * j + 1]
        sum1, sum2 = term1, term2
        for order in range(1, 6):
            if regimes.rotates[r, j]:
                term1, term2 = (rate1 * term1 - rate2 * term2) / order, (rate2 * term1 + rate1 * term2) / order
            else:
                term1, term2 = rate1 * term1 / order, rate2 * term2 / order
            sum1 += term1
            sum2 += term2
        u[2 * j], u[2 * j + 1] = sum1, sum2


@njit(cache=True, inline="always")
def safe_time(distance, slope, curvature):
    """Time [s] for which a quantity that starts at ``distance`` surely stays positive.

    Its slope is ``slope`` and the modulus of its second derivative never exceeds ``curvature``, so the answer is the
    first positive root of distance + slope t - curvature t^2 / 2. A distance below zero counts as zero.
    """
    distance = max(distance, 0.0)
    if curvature <= 0.0:
        return math.inf if slope >= 0.0 else -distance / slope
    root = math.sqrt(slope * slope + 2.0 * curvature * distance)
    return (slope + root) / curvature if slope >= 0.0 else 2.0 * distance / (root - slope)
