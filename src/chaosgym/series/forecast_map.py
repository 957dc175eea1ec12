"""Maps that forecast the next reading from the last ones: fitted, and iterated without noise.

A map is a line plus Gaussian bumps of the last one to four readings, smoothed by generalised cross-validation.
Several sensors make one series, in the order in which their readings follow each other within a cycle. Each sensor has
its own map of the last readings of all, so a forecast spans the part of a cycle between two sensors.

References
----------
G. Golub, M. Heath, G. Wahba, Generalized cross-validation ..., Technometrics 21 (1979), 215-223.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array

DIMENSIONS = (1, 2, 3, 4)
"""Readings from which the next is forecast."""

LINEAR_LAGS = 8
"""Most readings of the linear forecasts."""

CENTRES = 160
"""Most Gaussian bumps of a map; a third of the readings at most."""

WIDTHS = (0.15, 0.35, 0.7, 1.4)
"""Widths of the bumps, in standard deviations of the readings times the root of the dimension."""

RIDGES = np.logspace(-7.0, 2.0, 19)
"""Weights of the penalty, as shares of the largest eigenvalue."""

LEAST_RIDGE = 1e-9
"""Weight of the penalty a reading, without which equations of bumps that lie together would be singular."""

TRANSIENT, ITERATIONS = 100, 400
"""Cycles that each map runs before and while its exponent is taken."""

LONGEST_REST, AT_REST = 8, 0.01
"""Longest period on which a map comes to rest, and within how many standard deviations of the readings it does."""

OUTSIDE, BEYOND = 0.3, 0.1
"""Share of its cycles in which a bounded map may leave the neighbourhood of the readings, and by what share of their
range that reaches beyond them."""


class Map(NamedTuple):
    """A forecast of the next reading, in standard deviations; ``error`` is its generalised cross-validation."""

    dimension: int
    width: float
    ridge: float
    centres: Array
    error: float

    @property
    def share(self) -> float:
        """Width of its bumps, one of ``WIDTHS``."""
        return self.width / float(np.sqrt(self.dimension))


def pasts(values: Array) -> list[tuple[Array, Array]]:
    """For each sensor of readings (cycles, sensors): earlier readings (n, 8 sensors), and the next one (n,).

    The readings of all sensors are one series, in standard deviations of each; the last comes first.
    """
    sensors = values.shape[1]
    scaled = ((values - values.mean(axis=0)) / values.std(axis=0)).ravel()
    windows = np.lib.stride_tricks.sliding_window_view(scaled, LINEAR_LAGS * sensors + 1)
    rows = [windows[place::sensors] for place in range(sensors)]
    return [(np.ascontiguousarray(one[:, -2::-1]), np.ascontiguousarray(one[:, -1])) for one in rows]


def linear_error(past: Array, following: Array) -> float:
    """Least generalised cross-validation of the linear forecasts from 0 to 8 readings a sensor."""
    size, found = len(following), []
    for lags in range(past.shape[1] + 1):
        design = np.column_stack([np.ones(size), past[:, :lags]])
        rest = following - design @ np.linalg.lstsq(design, following, rcond=None)[0]
        found.append(size * float(rest @ rest) / (size - lags - 1) ** 2)
    return min(found)


def _centres(points: Array, most: int) -> Array:
    """Readings that cover the others, the farthest of the rest one after the other, (centres, dimension)."""
    nearest, chosen = np.full(len(points), np.inf), [int(np.argmin(np.sum(points**2, axis=1)))]
    for _ in range(min(most, len(points) // 3) - 1):
        nearest = np.minimum(nearest, np.sum((points - points[chosen[-1]]) ** 2, axis=1))
        chosen.append(int(np.argmax(nearest)))
    return points[chosen]


def _bumps(points: Array, centres: Array, width: float) -> Array:
    distance = np.sum(points**2, axis=1)[:, None] - 2.0 * points @ centres.T + np.sum(centres**2, axis=1)
    return np.asarray(np.exp(-0.5 * distance / width**2))


def fit_map(
    past: Array,
    following: Array,
    dimensions: tuple[int, ...] = DIMENSIONS,
    widths: tuple[float, ...] = WIDTHS,
    centres_at_most: int = CENTRES,
) -> Map:
    """The nonlinear forecast of least generalised cross-validation."""
    size, found = len(following), list[Map]()
    for dimension in dimensions:
        best: Map | None = None
        points = past[:, :dimension]
        centres = _centres(points, centres_at_most)
        line = np.linalg.qr(np.column_stack([np.ones(size), points]))[0]
        rest = following - line @ (line.T @ following)
        power = float(rest @ rest)
        for share in widths:
            width = share * np.sqrt(dimension)
            bumps = _bumps(points, centres, width)
            bumps -= line @ (line.T @ bumps)
            values, vectors = np.linalg.eigh(bumps.T @ bumps)
            values = np.maximum(values, 1e-12 * values[-1])
            along = (vectors.T @ (bumps.T @ rest)) ** 2 / values
            kept = values / (values + RIDGES[:, None] * values[-1])
            left = power - along.sum() + ((1.0 - kept) ** 2) @ along
            freedom = np.maximum(size - 1 - dimension - 1.4 * kept.sum(axis=1), 1.0)
            errors = size * np.maximum(left, 0.0) / freedom**2
            least = int(np.argmin(errors))
            if best is None or errors[least] < best.error:
                best = Map(dimension, width, float(RIDGES[least] * values[-1]), centres, float(errors[least]))
        assert best is not None
        found.append(best)
    return min(found, key=lambda model: model.error)


def weights_of(model: Map, past: Array, following: Array, resampled: Array) -> Array:
    """Coefficients (refits, 1 + dimension + centres) for readings that count ``resampled`` (refits, n)."""
    points = past[:, : model.dimension]
    design = np.column_stack([np.ones(len(points)), points, _bumps(points, model.centres, model.width)])
    penalty = np.full(design.shape[1], max(model.ridge, LEAST_RIDGE * len(points)))
    penalty[: 1 + model.dimension] = LEAST_RIDGE * len(points)
    normal = np.stack([design.T @ (design * w[:, None]) for w in resampled]) + np.diag(penalty)
    right = np.stack([design.T @ (following * w) for w in resampled])
    return np.asarray(np.linalg.solve(normal, right[:, :, None])[:, :, 0])


def iterated(
    maps: tuple[Map, ...], weights: list[Array], before: list[Array], rng: np.random.Generator
) -> tuple[Array, Array, int | None]:
    """(exponents, standard deviations (sensors,), period) of maps that start from readings.

    The period is that on which all refits come to rest, up to ``LONGEST_REST``; None if they do not, or on several.

    ``weights`` (refits, coefficients) and readings ``before`` (n, readings) are those of each sensor. A map that leaves
    the neighbourhood of the readings starts anew from one of them; one that does so often is not bounded. The deviation
    that is followed keeps its direction.
    """
    count, sensors = len(weights[0]), len(maps)
    steps = [_Step.of(*each) for each in zip(maps, weights, before, strict=True)]
    state = before[0][rng.integers(len(before[0]), size=count)]
    shift = np.ones_like(state) / np.sqrt(state.shape[1])
    left, growth = np.zeros(count), np.zeros(count)
    run = np.empty((ITERATIONS, count, sensors))
    for cycle in range(TRANSIENT + ITERATIONS):
        for place, step in enumerate(steps):
            distance = step.distance(state)
            away = step.away(state, distance)
            if away.any():
                left += away
                state[away] = before[place][rng.integers(len(before[place]), size=int(away.sum()))]
                distance = step.distance(state)
            following, gradient = step.forecast(state, distance)
            came = np.sum(gradient * shift[:, : gradient.shape[1]], axis=1)
            state = np.column_stack([following, state[:, :-1]])
            shift = np.column_stack([came, shift[:, :-1]])
            size = np.maximum(np.sqrt(np.sum(shift**2, axis=1)), 1e-100)
            shift /= size[:, None]
            if cycle >= TRANSIENT:
                growth += np.log(size)
                run[cycle - TRANSIENT, :, place] = following
    bounded = left <= OUTSIDE * (TRANSIENT + ITERATIONS)
    spread = run[:, bounded].std(axis=(0, 1)) if bounded.any() else np.zeros(sensors)
    return np.where(bounded, growth / ITERATIONS, -np.inf), spread, _period_of(run)


def _period_of(run: Array) -> int | None:
    """Smallest period after which all maps of a run (iterations, refits, sensors) are where they were; None without."""
    for period in range(1, LONGEST_REST + 1):
        if np.max(np.abs(run[-period:] - run[-2 * period : -period])) < AT_REST:
            return period
    return None


class _Step(NamedTuple):
    """The refitted map of one sensor, as it is iterated."""

    model: Map
    constant: Array
    slopes: Array
    heights: Array
    squares: Array
    range: tuple[float, float]
    far: float

    @classmethod
    def of(cls, model: Map, weights: Array, before: Array) -> "_Step":
        """The step of coefficients (refits, coefficients), and where its readings (n, readings) end."""
        dimension = model.dimension
        margin = BEYOND * float(np.ptp(before[:, 0]))
        return cls(
            model,
            weights[:, 0],
            weights[:, 1 : 1 + dimension],
            weights[:, 1 + dimension :],
            np.sum(model.centres**2, axis=1),
            (float(before[:, 0].min()) - margin, float(before[:, 0].max()) + margin),
            _reach(before[:, :dimension], model.centres, model.width),
        )

    def distance(self, state: Array) -> Array:
        """Squares of the distances of states (refits, readings) from the centres, (refits, centres)."""
        last = state[:, : self.model.dimension]
        return np.asarray(np.sum(last**2, axis=1)[:, None] - 2.0 * last @ self.model.centres.T + self.squares)

    def away(self, state: Array, distance: Array) -> NDArray[np.bool_]:
        """Which states have left the neighbourhood of the readings, (refits,)."""
        low, high = self.range
        return np.asarray((distance.min(axis=1) > self.far) | (state[:, 0] < low) | (state[:, 0] > high))

    def forecast(self, state: Array, distance: Array) -> tuple[Array, Array]:
        """(next reading (refits,), its gradient in the last ones (refits, dimension))."""
        narrow, last = self.model.width**-2, state[:, : self.model.dimension]
        bumps = self.heights * np.exp(-0.5 * narrow * distance)
        following = self.constant + np.sum(self.slopes * last, axis=1) + bumps.sum(axis=1)
        return following, self.slopes + narrow * (bumps @ self.model.centres - bumps.sum(axis=1)[:, None] * last)


def _reach(points: Array, centres: Array, width: float) -> float:
    """Square of the distance from all centres beyond which the fitted map is not used."""
    nearest = np.sum(points**2, axis=1)[:, None] - 2.0 * points @ centres.T + np.sum(centres**2, axis=1)
    return max(4.0 * float(np.max(nearest.min(axis=1))), (0.5 * width) ** 2, 0.01)
