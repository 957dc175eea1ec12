"""Taylor series of the motion of a mechanism with held matrices, whose equations are those of ``tables``."""

import math

import numpy as np

from chaosgym.core.binned.lanes import copy, next_term, next_terms
from chaosgym.core.binned.model import FORCING_TERMS
from chaosgym.core.kernel import leaf, part
from chaosgym.core.lanes import LANES, add_columns

SERIES_PHASE = np.array(
    [0.0] * 3 + [math.exp((math.lgamma(order) + math.log(1e-17)) / (order - 1)) for order in range(3, 65)]
)
"""Largest w t, by order, at which the Taylor series of a motion with angular frequency w over a time t is summed to
round-off, and so are those of its velocity and acceleration: (w t)^k / k! < 1e-17 for k = order - 1."""

SHARES = np.array([1.0 / ((k + 1) * (k + 2)) for k in range(len(SERIES_PHASE))])
"""Factorial of k over that of k + 2."""


def series_order(phase: float) -> int:
    """Order that sums the Taylor series of a motion over an angle ``phase`` [rad] to round-off."""
    return max(FORCING_TERMS + 1, min(int(np.searchsorted(SERIES_PHASE, phase)), len(SERIES_PHASE) - 1))


FINENESS = 16
"""Parts of a radian for each of which ``ORDERS`` has an entry."""

ORDERS = np.array([series_order((k + 1) / FINENESS) for k in range(2 * FINENESS)])
"""``series_order`` at the ends of parts of a radian, up to the longest interval."""


@part
def order_for(phase, most):
    """``series_order`` of a phase up to 2, at least, looked up; at most ``most``."""
    return min(ORDERS[min(int(phase * FINENESS), 2 * FINENESS - 1)], most)


@part
def shift_forcing(powers, at, k, scale, factors, out_at):
    """Write the factors of F_j in coefficient k of sum_j F_j (x + t / duration)^j; those of x^j begin at ``at``.

    ``scale`` is duration^-k.
    """
    binomial = scale
    for j in range(k, FORCING_TERMS):
        factors[out_at + j] = binomial * powers[at + j - k]
        binomial *= (j + 1.0) / (j + 1 - k)


@leaf
def expand(table, at, own, z, n, m, lanes, duration, last, factors, loads, series):
    """Taylor coefficients about the instant of z, in seconds, up to the order ``last``.

    The acceleration (columns, lanes) of the bin and contact set begins at ``at`` in the table, all else in ``own``:
    from ``series`` on, ``lanes`` numbers an order, p^(k) / k! of the n coordinates and then that of the displacements
    of the m channels, whose first two orders the caller writes. Work space is ``factors`` (4 + m,) and ``loads``
    (5, lanes), whose last row is zero.
    """
    time, forcing = z + 2 * n, at + 2 * n * lanes
    copy(own, z, series, n)
    copy(own, z + n, series + lanes, n)
    copy(own, time + FORCING_TERMS, factors + FORCING_TERMS, m)
    scale = 1.0
    for k in range(FORCING_TERMS):
        shift_forcing(own, time, k, scale, own, factors)
        count = FORCING_TERMS - k + (m if k == 0 else 0)
        add_columns(table, forcing + k * lanes, lanes, count, own, factors + k, own, loads + k * lanes, LANES)
        scale /= duration
    old = at + n * lanes
    if lanes == LANES:
        next_terms(table, at, old, n, own, series, loads, FORCING_TERMS, SHARES, last - 1)
        return
    for k in range(last - 1):
        older, more = series + k * lanes, loads + min(k, FORCING_TERMS) * lanes
        new = older + 2 * lanes
        next_term(table, at, old, lanes, n, own, older, older + lanes, more, k + 1.0, SHARES[k], new)


@leaf
def put_time(own, at, x):
    """Write the forcing columns of z, which begin at ``at``, for time x as a share of the bin."""
    own[at] = 1.0
    for k in range(1, FORCING_TERMS):
        own[at + k] = own[at + k - 1] * x
