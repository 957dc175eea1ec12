r"""Lyapunov exponents of a series: from the growth of a deviation cycle by cycle, or from neighbours that part.

On a measured series the mean divergence of nearest neighbours serves (Rosenstein). It needs a few thousand cycles and
sees neither weak chaos nor decay. ``diagnosis.lyapunov`` carries deviations along a machine's own motion.

References
----------
M. T. Rosenstein, J. J. Collins, C. J. De Luca, Physica D 65 (1993) 117-134.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError
from chaosgym.plain import Result
from chaosgym.series.stroboscopic import as_samples

ROUND_OFF = 1e-12
"""Exponent per cycle that rounding alone may give to a deviation that is carried exactly."""

POLYNOMIAL = float(np.log(4.0))
"""Logarithm of the growth of a deviation that goes with the square of time, while the time doubles."""

BLOCKS = 20
"""Blocks whose scatter gives the standard error."""

FOLLOWED = 8
"""Cycles over which neighbours are followed."""


@dataclass(frozen=True, kw_only=True)
class LyapunovExponent(Result):
    """A largest Lyapunov exponent with its uncertainty.

    Attributes
    ----------
    per_cycle
        Mean logarithm of the growth of a deviation in one cycle.
    standard_error
        Of ``per_cycle``, from the scatter of block means; the larger of the values for 20 and for 10 blocks.
    cycle_period
        Duration of a cycle [s]; 1 where time counts in cycles.
    history : (blocks,)
        Means of successive blocks: they show a drift that the standard error hides.
    cycles
        Number of cycles averaged.
    round_off
        Value that rounding alone may give.
    """

    shows = "value=per_cycle standard_error per_second cycles history"

    per_cycle: float
    standard_error: float
    cycle_period: float
    history: tuple[float, ...] = field(repr=False)
    cycles: int
    round_off: float = ROUND_OFF

    @property
    def per_second(self) -> float:
        """Exponent per second [1/s]."""
        return self.per_cycle / self.cycle_period

    @property
    def sign(self) -> int:
        """+1 or -1 where the exponent differs from zero by more than three standard errors and rounding, else 0.

        A positive one must also make more of a deviation than the square of time does, as in conserved motions.
        """
        certain = abs(self.per_cycle) > max(3.0 * self.standard_error, self.round_off)
        grows = self.per_cycle * self.cycles > POLYNOMIAL
        return int(np.sign(self.per_cycle)) if certain and (grows or self.per_cycle < 0.0) else 0


def chaos_margin(per_cycle: float, standard_error: float) -> float:
    """Distance of an exponent from three standard errors above zero: 0 there, 1 from six on."""
    return float(np.clip(per_cycle / (3.0 * standard_error) - 1.0, 0.0, 1.0))


def average_growth(log_growth: ArrayLike, cycle_period: float = 1.0, round_off: float = ROUND_OFF) -> LyapunovExponent:
    """Exponent from the logarithms of the growth in successive cycles, (cycles,); ``round_off`` as in the result."""
    growth = as_samples(log_growth, minimum=2 * BLOCKS)[:, 0]

    def means(blocks: int) -> Array:
        length = len(growth) // blocks
        return np.asarray(growth[len(growth) - blocks * length :].reshape(blocks, length).mean(axis=1))

    error = max(float(np.std(means(count), ddof=1) / np.sqrt(count)) for count in (BLOCKS, BLOCKS // 2))
    return LyapunovExponent(
        per_cycle=float(growth.mean()),
        standard_error=error,
        cycle_period=cycle_period,
        history=tuple(float(value) for value in means(BLOCKS)),
        cycles=len(growth),
        round_off=round_off,
    )


def exponent_from_series(series: ArrayLike, *, dimension: int = 3) -> LyapunovExponent:
    """Largest exponent of a measured series of one sample a cycle, by the divergence of nearest neighbours.

    Parameters
    ----------
    series : (cycles,)
        Settled and nearly free of noise; 1000 cycles or more.
    dimension
        Number of successive samples that make a point.

    Raises
    ------
    DiagnosisError
        If there are fewer than 500 cycles, the series is constant, or neighbours are as far apart at the start as they
        ever get, as in noise.

    Notes
    -----
    Good to about a fifth for strong chaos. It can't see a negative exponent: for a periodic series there is no
    divergence to follow. It underestimates where a step of one cycle already fills the attractor (exponents near or
    above 1), and takes sensor noise for divergence.

    Examples
    --------
    >>> x = [0.3]
    >>> for _ in range(1999):
    ...     x.append(4.0 * x[-1] * (1.0 - x[-1]))  # the logistic map, whose exponent is ln 2 = 0.693
    >>> round(chaosgym.series.exponent_from_series(x).per_cycle, 2)
    0.69
    """
    x = as_samples(series, minimum=500)[:, 0]
    spread = float(np.std(x))
    if spread <= 1e-9 * float(np.max(np.abs(x))):
        raise DiagnosisError("the series is constant; allowed: a series that varies")
    points = np.lib.stride_tricks.sliding_window_view(x / spread, dimension)
    usable = len(points) - FOLLOWED
    from scipy.spatial import cKDTree

    distances, partners = cKDTree(points[:usable]).query(points[:usable], k=12)
    apart = np.abs(partners - np.arange(usable)[:, None]) > dimension
    apart &= distances > 1e-12
    first = np.argmax(apart, axis=1)
    kept = np.flatnonzero(apart.any(axis=1))
    if len(kept) < usable // 2:
        raise DiagnosisError("the series repeats: neighbours do not part, and there is no exponent to measure")
    partner = partners[kept, first[kept]]
    # distances of the newest sample of each point: no delay between divergence and cycle
    newest = dimension - 1 + np.arange(FOLLOWED)
    gaps = np.abs(x[kept[:, None] + newest] - x[partner[:, None] + newest])
    logs = np.log(np.maximum(gaps / spread, 1e-12))
    curve = logs.mean(axis=0)
    ceiling = float(np.mean(np.log(np.abs(np.subtract.outer(x[::7], x[3::7])) / spread + 1e-12)))
    rising = np.flatnonzero(curve > ceiling - 1.0)
    last = max(2, int(rising[0]) if len(rising) else FOLLOWED - 1)
    if curve[0] > ceiling - 1.0:
        raise DiagnosisError("nearest neighbours are as far apart as any two points: noise, or far too few cycles")
    growth = (logs[:, last] - logs[:, 0]) / last
    return average_growth(growth)
