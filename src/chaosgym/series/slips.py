"""Cycles that a recorder lost or wrote twice amid a torus: which cycle each reading is of, by a few lines.

A torus with such slips looks chaotic: a map forecasts it but where a cycle is missing. So lines are fitted to the
stretch that they fit best, and continued from there on both sides, over twice the readings each time. The cycles are
those of least cost: the square of each reading's distance from the lines, and a price for every slip (the algorithm of
A. Viterbi, IEEE Trans. Inf. Theory 13, 1967).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.series.missing_cycles import FAR, PRICE
from chaosgym.series.noise import NORMAL
from chaosgym.series.spectrum import PADDED, STEPS, fitted, without_lines

STRETCH, STEP = 32, 8
"""Readings of the first stretch, and how far apart the stretches are that are tried."""

PARTS, FITS = 3, 0.3
"""Parts of the record in each of which a stretch is tried, and share of the standard deviation that lines may leave."""

FIRST_LINES, MOST_LINES = 2, 6
"""Lines of the first stretch, and in all."""

LINE_GAIN = 0.75
"""Share of the variance that a further line may leave."""

LEAST = 0.01
"""Standard deviation of a reading at least, in that of all, as lines that are continued err too."""

MOST_SLIPS = 0.15
"""Share of the readings before which cycles may be lost, or that are written twice."""

MOST_READINGS = 1200
"""Readings, the last ones, that are counted."""

JUMPS = (0, 1, 2, -1)
"""Cycles between two readings beyond one: none, one or two lost, one written twice."""


class Slips(NamedTuple):
    """Cycle of each reading (n,), counted from 0, and what lines leave of the readings that lie near them."""

    cycle: NDArray[np.int64]
    rest: Array

    @property
    def slipped(self) -> int:
        """How many cycles are lost or written twice."""
        return int(np.sum(np.abs(np.diff(self.cycle) - 1)))


def slips(values: Array) -> Slips | None:
    """Cycles of the last readings (n,) that lie on a few lines but for slips; None without slips, or with too many.

    Examples
    --------
    >>> import numpy as np
    >>> from chaosgym.series.slips import slips
    >>> readings = np.delete(np.cos(2.4 * np.arange(300)), [70, 150, 220])
    >>> slips(readings).slipped
    3
    """
    values = values[-MOST_READINGS:]
    size = len(values)
    if size < 2 * STRETCH:
        return None
    found = None
    for start, lines in _stretches(values):
        cycle, frequencies = _grown(values, start, lines)
        rest = _without_far(values, cycle, frequencies)
        if found is None or rest.var() < found.rest.var():
            found = Slips(cycle - cycle[0], rest)
    slipped = 0 if found is None else np.count_nonzero(np.diff(found.cycle) != 1)
    return found if 0 < slipped <= MOST_SLIPS * size else None


def _stretches(values: Array) -> list[tuple[int, int]]:
    """(start, lines) of the stretches that lines fit best, one in each part of the record and for each number of lines.

    Those that the lines do not fit are left out.
    """
    found = []
    starts = np.arange(0, len(values) - STRETCH + 1, STEP)
    for lines in range(1, FIRST_LINES + 1):
        left = np.array([np.std(without_lines(values[at : at + STRETCH], lines, 0.0)[0]) for at in starts])
        for part in np.array_split(np.arange(len(starts)), PARTS):
            best = part[np.argmin(left[part])]
            found.append((float(left[best]), int(starts[best]), lines))
    return [(start, lines) for rest, start, lines in sorted(found) if rest < FITS * values.std()]


def _grown(values: Array, start: int, lines: int) -> tuple[NDArray[np.int64], Array]:
    """(cycle of each reading, frequencies) of lines that are continued from a stretch."""
    stop = start + STRETCH
    cycle: NDArray[np.int64] = np.arange(start, stop)
    frequencies = _more(values[start:stop], cycle, np.empty(0), lines, 1.0)
    while True:
        frequencies, rest = _fit(values[start:stop], cycle, frequencies)
        if stop - start == len(values):
            return cycle, frequencies
        reach = (stop - start) // 2
        before, after = max(0, start - reach), min(len(values), stop + reach)
        known = (values[start:stop], cycle, frequencies)
        cycle = _cycles(values[before:after], known, before, float(np.std(rest)))
        start, stop = before, after
        frequencies = _more(values[start:stop], cycle, frequencies, MOST_LINES, LINE_GAIN)


def _without_far(values: Array, cycle: NDArray[np.int64], frequencies: Array) -> Array:
    """What lines leave of the readings that do not lie far from them, as those do that were mended wrongly."""
    rest = _fit(values, cycle, frequencies)[1]
    near = np.abs(rest) <= FAR * NORMAL * np.median(np.abs(rest))
    values, cycle = values[near], cycle[near]
    return _fit(values, cycle, _more(values, cycle, frequencies[:1], MOST_LINES, LINE_GAIN))[1]


def _more(values: Array, cycle: NDArray[np.int64], frequencies: Array, most: int, gain: float) -> Array:
    """Frequencies, and those of further lines while each leaves less than a share of the variance."""
    frequencies, rest = _fit(values, cycle, frequencies)
    place, span = cycle - cycle[0], int(cycle[-1] - cycle[0]) + 1
    while len(frequencies) < most:
        even = np.zeros(span)
        even[place] = rest
        power = np.abs(np.fft.rfft(even * np.hanning(span), PADDED * span))
        power[: 2 * PADDED] = 0.0
        further = np.append(frequencies, float(np.argmax(power)) / (PADDED * span))
        further, left = _fit(values, cycle, further)
        if float(np.var(left)) > gain * float(np.var(rest)):
            break
        frequencies, rest = further, left
    return frequencies


def _fit(values: Array, cycle: NDArray[np.int64], frequencies: Array) -> tuple[Array, Array]:
    """(frequencies, rest) of lines over the cycles."""
    time = cycle - 0.5 * (cycle[0] + cycle[-1])
    rest: Array = values - values.mean()
    for _ in range(STEPS if len(frequencies) else 0):
        frequencies, rest = fitted(values, time, frequencies)
    return frequencies, rest


def _model(values: Array, cycle: NDArray[np.int64], frequencies: Array, at: NDArray[np.int64]) -> Array:
    """What lines through readings say of the cycles ``at``."""
    middle = 0.5 * (cycle[0] + cycle[-1])

    def design(cycles: NDArray[np.int64]) -> Array:
        angle = 2.0 * np.pi * np.outer(cycles - middle, frequencies)
        return np.column_stack([np.ones(len(cycles)), np.cos(angle), np.sin(angle)])

    return np.asarray(design(at) @ np.linalg.lstsq(design(cycle), values, rcond=None)[0])


def _cycles(
    values: Array, known: tuple[Array, NDArray[np.int64], Array], start: int, sigma: float
) -> NDArray[np.int64]:
    """Cycle of each reading from ``start`` on, by the lines of the ones that are known."""
    size, most = len(values), int(MOST_SLIPS * len(values)) + 4
    middle = int(known[1][len(known[1]) // 2])
    first = start + (middle - (start + size // 2)) - most  # shifts of all readings lie within ``most`` of the middle's
    states = 2 * most + 1
    told = _model(*known, np.arange(first, first + size + states))
    sigma = max(sigma, LEAST * float(np.std(values)), 1e-300)
    costs = np.lib.stride_tricks.sliding_window_view(told, states)[:size]
    costs = np.minimum(((costs - values[:, None]) / sigma) ** 2, FAR**2)
    return first + np.arange(size) + _cheapest(costs)


def _cheapest(costs: Array) -> NDArray[np.int64]:
    """State at each reading of the way of least cost through (readings, states), (readings,)."""
    size, states = costs.shape
    total, came = costs[0], np.zeros(costs.shape, np.int8)
    tried = np.empty((len(JUMPS), states))
    for place in range(1, size):
        for row, jump in enumerate(JUMPS):
            tried[row] = np.inf
            into, out = slice(max(jump, 0), states + min(jump, 0)), slice(max(-jump, 0), states - max(jump, 0))
            tried[row, into] = total[out] + PRICE * abs(jump)
        came[place] = np.argmin(tried, axis=0)
        total = tried.min(axis=0) + costs[place]
    state = np.empty(size, np.int64)
    state[-1] = int(np.argmin(total))
    for place in range(size - 1, 0, -1):
        state[place - 1] = state[place] - JUMPS[came[place, state[place]]]
    return state
