"""Maps and signals whose nature is known; one sample a cycle."""

import numpy as np

GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def logistic(r, cycles, *, skip=1000, start=0.3):
    """x' = r x (1 - x)."""
    x, series = start, np.empty(cycles)
    for i in range(skip + cycles):
        x = r * x * (1.0 - x)
        if i >= skip:
            series[i - skip] = x
    return series


def henon(cycles, *, a=1.4, b=0.3, skip=500):
    """(x, y)' = (1 - a x^2 + y, b x), Henon (1976)."""
    x, y, series = 0.1, 0.1, np.empty((cycles, 2))
    for i in range(skip + cycles):
        x, y = 1.0 - a * x * x + y, b * x
        if i >= skip:
            series[i - skip] = x, y
    return series


def circle(coupling, frequency, cycles, *, skip=500):
    """Sine circle map, seen through 2 + cos of its angle."""
    turn, series = 0.1, np.empty(cycles)
    for i in range(skip + cycles):
        turn = turn + frequency - coupling / (2.0 * np.pi) * np.sin(2.0 * np.pi * turn)
        if i >= skip:
            series[i - skip] = 2.0 + np.cos(2.0 * np.pi * turn)
    return series


def three_frequencies(cycles):
    """A torus of three incommensurate frequencies, sampled once a cycle."""
    n = np.arange(cycles)
    return sum(
        a * np.cos(2.0 * np.pi * f * n + f) for a, f in ((1.0, GOLDEN), (0.7, np.sqrt(2.0)), (0.5, np.sqrt(3.0)))
    )
