"""The largest Lyapunov exponent of any map by two trajectories (Benettin): the twin of what the library carries."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.diagnosis.lyapunov import DISTANCE, _any_direction
from chaosgym.series.exponent import LyapunovExponent, average_growth


def two_trajectory_exponent(
    step: Callable[[Array], Array],
    state: ArrayLike,
    cycles: int = 1000,
    *,
    transient: int = 200,
    distance: float = DISTANCE,
    cycle_period: float = 1.0,
) -> LyapunovExponent:
    """Largest exponent of any map by two trajectories that are brought back to ``distance`` each cycle.

    Parameters
    ----------
    step
        Advances a state (d,) by one cycle.
    state : (d,)
        Initial state.
    """
    reference = np.array(state, dtype=float, ndmin=1)
    for _ in range(transient):
        reference = np.asarray(step(reference), dtype=float)
    direction = _any_direction(len(reference))
    settle = 20
    log_growth = np.empty(settle + cycles)
    for cycle in range(settle + cycles):
        other = np.asarray(step(reference + distance / np.linalg.norm(direction) * direction), dtype=float)
        reference = np.asarray(step(reference), dtype=float)
        direction = other - reference
        length = float(np.linalg.norm(direction))
        log_growth[cycle] = np.log(max(length, 1e-300) / distance)
        if length == 0.0:
            direction = _any_direction(len(reference))
    return average_growth(log_growth[settle:], cycle_period)
