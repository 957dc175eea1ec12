r"""How does chaos announce itself? Precursors (thesis 5.3.2) and routes to chaos (2.3.2).

Precursors, seen on a periodic response:

    period doubling     the period is 2, 4, 8 ...
    period three        the period is a multiple of three that is no doubling: 3, 6, 12 ...
    long bouncing       bouncing on a surface lasts until the end of the half cycle

Routes: intermittency, regular stretches between bursts; crises, sudden changes of a chaotic attractor along a
parameter.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.diagnosis.response import Nature
from chaosgym.diagnosis.stroboscopic import as_samples, scales
from chaosgym.errors import DiagnosisError
from chaosgym.simulation import CycleRecord

Array = NDArray[np.float64]

LONG_BOUNCING = 0.5
"""Bouncing that lasts this share of a half cycle reaches its end: the rest is the flight to the other surface."""

LAMINAR_DISTANCE, LAMINAR_CYCLES = 0.02, 12
"""A stretch is regular if it repeats this well, as a share of the largest modulus, for so many cycles."""

CRISIS_FACTOR = 1.5
"""Change of the spread of a chaotic response between neighbours that is a crisis."""


@dataclass(frozen=True)
class Precursors:
    """Early warnings on one response; ``bounce_fraction`` is the longest bouncing in half cycles."""

    period_doubling: bool
    period_three: bool
    long_bouncing: bool
    bounce_fraction: float

    @property
    def any(self) -> bool:
        """True if there is any warning."""
        return self.period_doubling or self.period_three or self.long_bouncing


def precursors(period: int | None, bounce_fraction: float = 0.0) -> Precursors:
    """Early warnings of chaos from the period of a response and from how long it bounces.

    Parameters
    ----------
    period
        Period of a periodic response in cycles, or None.
    bounce_fraction
        Longest bouncing before sustained contact, in half cycles; ``bounce_fraction(record)`` gives it.
    """
    odd = period or 1
    doublings = 0
    while odd % 2 == 0:
        odd //= 2
        doublings += 1
    return Precursors(
        period_doubling=odd == 1 and doublings > 0,
        period_three=odd == 3,
        long_bouncing=bounce_fraction >= LONG_BOUNCING,
        bounce_fraction=float(bounce_fraction),
    )


def bounce_fraction(record: CycleRecord) -> float:
    """Longest bouncing of a record, from the first touch of a surface to its last, in half cycles."""
    return float(record.bounce_duration.max()) / (0.5 * record.machine.cycle_period)


@dataclass(frozen=True)
class WarningRate:
    """How good a warning is over a sweep.

    Attributes
    ----------
    warned
        Periodic points with the warning.
    hits
        Share of them with chaos within reach.
    base_rate
        Share of all periodic points with chaos within reach: a warning is worth something if ``hits`` exceeds it.
    caught
        Share of the periodic points with chaos within reach that carry the warning.
    """

    warned: int
    hits: float
    base_rate: float
    caught: float


def warning_rates(
    natures: Sequence[Nature], periods: Sequence[int | None], bounce_fractions: ArrayLike, *, reach: int = 2
) -> Mapping[str, WarningRate]:
    """Hit rate of each precursor over a sweep along one parameter.

    Parameters
    ----------
    natures, periods : (n_points,)
        Along the parameter, in order.
    bounce_fractions : (n_points,)
        Longest bouncing in half cycles.
    reach
        Points on either side within which chaos counts as announced: the thesis saw it follow and precede period 3.
    """
    fractions = np.asarray(bounce_fractions, dtype=float)
    if not len(natures) == len(periods) == len(fractions):
        raise DiagnosisError(
            f"{len(natures)} natures, {len(periods)} periods and {len(fractions)} bounce fractions; allowed: equal"
        )
    chaotic = np.array([nature not in ("periodic", "undetermined") for nature in natures])
    near = np.array([chaotic[max(0, i - reach) : i + reach + 1].any() for i in range(len(chaotic))])
    periodic = np.array([nature == "periodic" for nature in natures])
    signs = [precursors(period, fraction) for period, fraction in zip(periods, fractions, strict=True)]
    warnings = {
        "period_doubling": np.array([sign.period_doubling for sign in signs], dtype=bool),
        "period_three": np.array([sign.period_three for sign in signs], dtype=bool),
        "long_bouncing": np.array([sign.long_bouncing for sign in signs], dtype=bool),
        "any": np.array([sign.any for sign in signs], dtype=bool),
    }
    return {name: _rate(warned & periodic, near & periodic, periodic) for name, warned in warnings.items()}


def _rate(warned: NDArray[np.bool_], near: NDArray[np.bool_], periodic: NDArray[np.bool_]) -> WarningRate:
    def share(part: NDArray[np.bool_], whole: NDArray[np.bool_]) -> float:
        return float(part.sum() / whole.sum()) if whole.any() else 0.0

    return WarningRate(
        int(warned.sum()), share(warned & near, warned), share(near, periodic), share(warned & near, near)
    )


@dataclass(frozen=True)
class Intermittency:
    """Regular stretches between bursts: the share of cycles in stretches, their number, mean length and period."""

    laminar_share: float
    stretches: int
    mean_length: float
    period: int

    @property
    def intermittent(self) -> bool:
        """True if there are several stretches and bursts, and stretches take a fifth to all but a twentieth."""
        return self.stretches >= 3 and 0.2 <= self.laminar_share <= 0.95


def find_intermittency(x: CycleRecord | ArrayLike, *, max_period: int = 8) -> Intermittency:
    """Look for regular stretches in a response that does not repeat.

    Parameters
    ----------
    x
        A record (its peak forces and displacement) or one sample a cycle, (cycles,) or (cycles, coordinates).
    max_period
        Longest period of the regular stretches.
    """
    given = np.column_stack([x.displacement, x.peak_force]) if isinstance(x, CycleRecord) else x
    samples = as_samples(given)
    scaled = samples / scales(samples)
    best = Intermittency(0.0, 0, 0.0, 1)
    for k in range(1, min(max_period, len(scaled) // 4) + 1):
        near = np.max(np.abs(scaled[k:] - scaled[:-k]), axis=1) <= LAMINAR_DISTANCE
        edges = np.flatnonzero(np.diff(np.concatenate([[0], near.astype(int), [0]])))
        lengths = edges[1::2] - edges[::2] + k
        long = lengths[lengths >= max(LAMINAR_CYCLES, 3 * k)]
        share = float(long.sum()) / len(scaled)
        if share > best.laminar_share:
            best = Intermittency(min(1.0, share), len(long), float(long.mean()), k)
    return best


def find_crises(
    natures: Sequence[Nature], spreads: ArrayLike, transients: Sequence[bool] = ()
) -> list[tuple[int, str]]:
    """Crises along a parameter, as (index of the first of the two neighbours, kind).

    "interior": both are chaotic and the spread of the response changes by half; "boundary": a chaotic response gives
    way to a periodic one that was a chaotic transient for long.

    Parameters
    ----------
    natures, spreads : (n_points,)
        Along the parameter; the spread is largest minus smallest peak force.
    transients
        True where a response was transient chaos.
    """
    spread = np.asarray(spreads, dtype=float)
    flags = list(transients) or [False] * len(natures)
    if not len(natures) == len(spread) == len(flags):
        raise DiagnosisError(f"{len(natures)} natures and {len(spread)} spreads; allowed: equal numbers")
    found = []
    for i in range(len(natures) - 1):
        steady = [natures[j] == "chaotic" and not flags[j] for j in (i, i + 1)]
        if all(steady):
            small, large = sorted((spread[i], spread[i + 1]))
            if large > CRISIS_FACTOR * small:
                found.append((i, "interior"))
        elif (steady[0] and flags[i + 1]) or (steady[1] and flags[i]):
            found.append((i, "boundary"))
    return found
