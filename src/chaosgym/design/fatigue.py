r"""Fatigue life of a bearing surface under forces that vary from cycle to cycle (thesis 5.4.2).

    L = (C / F)^p                          (5.2)  life in millions of cycles, constant force
    C = F L^(1/p)                          (5.3)  load rating for a life
    1 / L = sum p_i / L_i                  (5.4)  Palmgren-Miner over the distribution of forces
    C = [L sum p_i F_i^p]^(1/p)            (5.5)

The law itself is in ``life_law``. (5.4) and (5.5) are (5.2) and (5.3) with the equivalent force
F_eq = (sum p_i F_i^p)^(1/p). The conservative life takes the largest force instead. p = 10/3 for line contact,
3 in figure 5.12 and for point contact.

A cycle counts once, by its peak. ``equivalent_force_of_history`` counts every impact of a time history instead, by
rainflow counting.

References
----------
ISO 281:2007, Rolling bearings - Dynamic load ratings and rating life.
ASTM E1049-85(2017), Standard practices for cycle counting in fatigue analysis, 5.4.4 and 5.4.5.
"""

import math
from typing import NamedTuple

import numpy as np
import rainflow
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.design.statistics import as_forces
from chaosgym.errors import DesignError
from chaosgym.numbers import number, whole
from chaosgym.rating_life import LIFE_EXPONENT, damage_in_a_million

CUBIC_EXPONENT = 3.0
"""Exponent of figure 5.12 and of the 25 % criterion (5.5.2), point contact."""


def _positive(name: str, value: float, unit: str) -> float:
    return number(name, value, 0.0, unit=unit.strip(), inside=True, error=DesignError)


def rating_life(force: float, load_rating: float, exponent: float = LIFE_EXPONENT) -> float:
    """Life [10^6 cycles] under a constant force [N], eq. 5.2; infinite without force.

    Examples
    --------
    >>> from chaosgym.design.fatigue import rating_life
    >>> rating_life(force=50.0, load_rating=500.0, exponent=3.0)
    999.9999999999998
    """
    _positive("load_rating", load_rating, " N")
    _positive("exponent", exponent, "")
    damage = float(damage_in_a_million(np.asarray(force), load_rating, exponent))
    return math.inf if damage == 0.0 else 1.0 / damage


def required_load_rating(force: float, life: float, exponent: float = LIFE_EXPONENT) -> float:
    """Load rating [N] for a life [10^6 cycles] under a force [N]: eq. 5.3, and eq. 5.5 with an equivalent force.

    Examples
    --------
    >>> from chaosgym.design.fatigue import required_load_rating
    >>> round(required_load_rating(force=50.0, life=1000.0, exponent=3.0), 6)
    500.0
    """
    return float(force * _positive("life", life, " million cycles") ** (1.0 / _positive("exponent", exponent, "")))


def equivalent_force(
    forces: ArrayLike, exponent: float = LIFE_EXPONENT, probabilities: ArrayLike | None = None
) -> float:
    """Constant force [N] that does the damage of a distribution of forces, (sum p_i F_i^p)^(1/p).

    Parameters
    ----------
    forces : (levels,)
        Peak forces of the cycles, or force levels [N].
    exponent
        p.
    probabilities : (levels,)
        Share of cycles at each level; equal if None.

    Raises
    ------
    DesignError
        If a force is negative or the probabilities do not add up to 1.

    Examples
    --------
    >>> from chaosgym.design.fatigue import equivalent_force
    >>> round(equivalent_force([10.0, 10.0, 20.0], exponent=3.0), 3)
    14.938
    """
    values = as_forces(forces)
    _positive("exponent", exponent, "")
    if probabilities is None:
        share = np.full(len(values), 1.0 / len(values))
    else:
        share = np.asarray(probabilities)
        if share.shape != values.shape or np.any(share < 0.0) or abs(share.sum() - 1.0) > 1e-9:
            raise DesignError(f"probabilities add up to {share.sum():g}; allowed: 0 or more, one a force, 1 in all")
    largest = float(np.max(values))
    if largest == 0.0:
        return 0.0
    return float(largest * np.sum(share * (values / largest) ** exponent) ** (1.0 / exponent))


def statistical_life(
    forces: ArrayLike, load_rating: float, exponent: float = LIFE_EXPONENT, probabilities: ArrayLike | None = None
) -> float:
    """Life [10^6 cycles] by Palmgren-Miner over a distribution of forces, eq. 5.4.

    Examples
    --------
    >>> from chaosgym.design.fatigue import statistical_life
    >>> round(statistical_life([10.0, 20.0], load_rating=100.0, exponent=3.0), 2)
    222.22
    """
    return rating_life(equivalent_force(forces, exponent, probabilities), load_rating, exponent)


def conservative_life(forces: ArrayLike, load_rating: float, exponent: float = LIFE_EXPONENT) -> float:
    """Life [10^6 cycles] under the largest of the forces, the first approach of 5.4.2.

    Examples
    --------
    >>> from chaosgym.design.fatigue import conservative_life
    >>> conservative_life([10.0, 20.0], load_rating=100.0, exponent=3.0)
    124.99999999999997
    """
    return rating_life(float(np.max(as_forces(forces))), load_rating, exponent)


class RelativeLife(NamedTuple):
    """Life relative to a reference: what the largest and the smallest peak suggest, and the statistical mean life."""

    lowest: float
    highest: float
    statistical: float


def relative_life(forces: ArrayLike, reference: float, exponent: float = CUBIC_EXPONENT) -> RelativeLife:
    """Life relative to that under a reference force [N], as figure 5.12 shows it.

    Examples
    --------
    >>> from chaosgym.design.fatigue import relative_life
    >>> relative_life([10.0, 20.0], reference=20.0)
    RelativeLife(lowest=1.0, highest=8.0, statistical=1.777777777777777)
    """
    values = as_forces(forces)
    return RelativeLife(
        conservative_life(values, reference, exponent),
        rating_life(float(np.min(values)), reference, exponent),
        statistical_life(values, reference, exponent),
    )


def rainflow_cycles(history: ArrayLike) -> tuple[Array, Array]:
    """Ranges and counts (cycles,) of a force history that repeats.

    The history is turned round so that it begins and ends at its largest value; then every cycle closes and none is
    counted half (ASTM E1049, 5.4.5).

    Examples
    --------
    >>> from chaosgym.design.fatigue import rainflow_cycles
    >>> rainflow_cycles([0.0, 4.0, 1.0, 3.0, 0.0])
    (array([2., 4.]), array([1., 1.]))
    """
    ranges, counts = np.transpose(rainflow.count_cycles(_closed(history).tolist()))
    return ranges, counts


def rainflow_means(history: ArrayLike) -> tuple[Array, Array, Array]:
    """Ranges, means and counts (cycles,) of a history that repeats, counted as by ``rainflow_cycles``.

    Examples
    --------
    >>> ranges, means, counts = rainflow_means([80.0, 40.0, 60.0, -40.0, -20.0, -60.0])
    >>> list(zip(ranges.tolist(), means.tolist(), counts.tolist(), strict=True))
    [(20.0, 50.0, 1.0), (20.0, -30.0, 1.0), (140.0, 10.0, 0.5), (140.0, 10.0, 0.5)]
    """
    values = _closed(history)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(values)))) + 1
    kept = values[np.concatenate([[0], turns, [len(values) - 1]])]
    found = [(span, mean, count) for span, mean, count, *_ in rainflow.extract_cycles(kept.tolist()) if span > 0.0]
    ranges, means, counts = np.reshape(found, (-1, 3)).T
    return ranges, means, counts


def _closed(history: ArrayLike) -> Array:
    """A history that begins and ends at its largest value."""
    values = np.asarray(history, dtype=float)
    if values.ndim != 1 or len(values) < 3 or not np.all(np.isfinite(values)):
        raise DesignError(f"the history has shape {values.shape}; allowed: (samples,) with 3 finite values or more")
    start = int(np.argmax(values))
    return np.concatenate([values[start:], values[: start + 1]])


def equivalent_force_of_history(history: ArrayLike, cycles: int, exponent: float = LIFE_EXPONENT) -> float:
    """Constant peak force [N] a cycle that does the damage of every impact of a history.

    Parameters
    ----------
    history : (samples,)
        Force on one surface [N], 0 without contact, fine enough to show each impact.
    cycles
        Operating cycles that it covers.
    exponent
        p.

    Examples
    --------
    >>> from chaosgym.design.fatigue import equivalent_force_of_history
    >>> round(equivalent_force_of_history([0.0, 20.0, 0.0, 10.0], cycles=1, exponent=3.0), 3)
    20.801
    """
    whole("cycles", cycles, 1, error=DesignError)
    ranges, counts = rainflow_cycles(history)
    return float((np.sum(counts * ranges**exponent) / cycles) ** (1.0 / exponent))
