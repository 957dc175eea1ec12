r"""Crises: sudden changes of a chaotic motion along a field, where its set meets an unstable orbit.

    interior   the set grows or shrinks at once: the length that its bands cover jumps
    boundary   the set ends: the motion goes on chaotically for a while, then leaves its range for another motion

Both are looked for by carrying the motion from value to value and halving the interval. A jump that stays while the
interval shrinks 64 times is sudden; bands that merge cover as much before as after.

References
----------
C. Grebogi, E. Ott, J. A. Yorke, Crises, sudden changes in chaotic attractors, and transient chaos, Physica D 7 (1983)
181-200.
"""

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.simulation import simulate

SETTLED, STEPS = 500, 4000
"""Cycles in which a motion settles, and those that are then judged."""

MOST_BANDS = 8
"""Bands that chaos may visit in turn."""

JUMP = 1.5
"""Ratio of sizes that counts as a jump."""

HALVINGS = 6
"""Of the interval in which the jump lies."""

SMALL, ALIVE = 0.02, 0.5
"""Sizes, as shares of that of the chaotic motion, of one that is not chaotic any more and of one that still is."""

LAST = 256
"""Cycles by which the motion after a crisis is classified."""

OUTSIDE = 0.05
"""Share of the chaotic range by which another motion must leave it."""

LINGERS = 20
"""Cycles that a motion stays chaotic beyond the end of its set, at the least."""

Carried = Callable[[float, Any, int], tuple[Array, Any]]
"""One number a cycle (steps,) of the motion at a value from a state, and the state after; None stands for rest."""


class Crisis(NamedTuple):
    """A crisis between two values; ``because`` says what was seen."""

    kind: Literal["interior", "boundary"]
    first: float
    second: float
    because: str


def carried(machine: Machine, field: str) -> Carried:
    """Peak forces [N] of a machine, largest of all surfaces, with one field at other values."""

    def run(value: float, state: Any, steps: int) -> tuple[Array, Any]:
        record = simulate(with_settings(machine, {field: value}), steps, state)
        return record.peak_force.max(axis=1), record.final_state

    return run


def covered(series: Array) -> float:
    """Length that the bands of a series cover: the least sum of ranges of its classes over up to 8 periods."""
    sums = [sum(float(np.ptp(series[start::bands])) for start in range(bands)) for bands in range(1, MOST_BANDS + 1)]
    return min(sums)


def interior_crisis(run: Carried, first: float, second: float) -> Crisis | None:
    """The crisis between two values at which a motion is chaotic, or None if its size does not jump.

    Raises
    ------
    SimulationError
        If the motion can't be followed.

    Examples
    --------
    >>> import numpy as np
    >>> def logistic(r, x, steps):
    ...     series = np.empty(steps)
    ...     x = 0.3 if x is None else x
    ...     for i in range(steps):
    ...         series[i] = x = r * x * (1.0 - x)
    ...     return series, x
    >>> found = interior_crisis(logistic, 3.8560, 3.8580)
    >>> bool(found.first < 3.8568007 < found.second)
    True
    """
    low, high = _Motion(run, first, None), _Motion(run, second, None)
    if high.size < low.size:
        low, high = high, low
    whole = high.size
    for _ in range(HALVINGS):
        if high.size < JUMP * low.size or low.size < SMALL * whole:
            return None
        middle = _Motion(run, 0.5 * (low.value + high.value), high.state)
        if middle.size < SMALL * whole:
            return None  # a window lies between: the change of size is not one of chaos
        if middle.size / low.size > high.size / middle.size:
            high = middle
        else:
            low = middle
    if high.size < JUMP * low.size:
        return None
    told = f"its bands cover {low.size:.4g} and {high.size:.4g} on either side"
    return Crisis("interior", min(low.value, high.value), max(low.value, high.value), told)


def boundary_crisis(run: Carried, chaotic: float, other: float) -> Crisis | None:
    """Where chaos ends on the way to a value at which the motion is another, or None if that lies within its range.

    Raises
    ------
    SimulationError
        If the chaotic motion can't be followed.
    """
    lives, ends = _Motion(run, chaotic, None), other
    for _ in range(HALVINGS + 2):
        middle = 0.5 * (lives.value + ends)
        motion = _Motion(run, middle, lives.state)
        if lives.size * ALIVE < covered(motion.series[-LAST:]) and not np.any(lives.leaves(motion.series)):
            lives = motion
        else:
            ends = middle
    series = run(ends, lives.state, SETTLED + STEPS)[0]
    outside = lives.leaves(series)
    stays = int(np.argmax(outside))
    if stays < LINGERS or not outside[-MOST_BANDS:].any() or covered(series[-LAST:]) > SMALL * lives.size:
        return None
    told = f"chaos lasts up to {lives.value:.8g}; at {ends:.8g} it lasts {stays} cycles, then leaves its range"
    return Crisis("boundary", min(lives.value, ends), max(lives.value, ends), told)


class _Motion:
    """A settled motion at a value: its series, the length that it covers and its last state."""

    def __init__(self, run: Carried, value: float, state: Any) -> None:
        series, self.state = run(value, state, SETTLED + STEPS)
        self.value, self.series = value, series[SETTLED:]
        self.size = covered(self.series)

    def leaves(self, series: Array) -> NDArray[np.bool_]:
        """Where a series lies outside the range of the motion."""
        low, high = float(self.series.min()), float(self.series.max())
        margin = OUTSIDE * (high - low)
        return (series < low - margin) | (series > high + margin)
