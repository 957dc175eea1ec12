r"""Determinism of an irregular record: is there a map that makes the irregularity without any noise?

A random process and deterministic chaos both never repeat. Chaos differs in four ways, and all are asked for:

1. A nonlinear model of the past forecasts the next reading better than every linear one: by more than in surrogates,
   random records of the same spectrum and distribution (iterated amplitude-adjusted Fourier transform).
2. The fitted map, iterated without noise, stays bounded and varies as much as the readings.
3. Its largest exponent is above zero for three in four refits to resampled readings.
4. No line of the spectrum drives it or explains as much: a torus, strange non-chaotic motion and hum of the mains are
   deterministic or look so, and are not chaotic.

The model is a line plus Gaussian bumps of the last one to four readings, smoothed by generalised cross-validation.

References
----------
T. Schreiber, A. Schmitz, Improved surrogate data for nonlinearity tests, Phys. Rev. Lett. 77 (1996), 635-638.
M. Barahona, C.-S. Poon, Detection of nonlinear dynamics in short, noisy time series, Nature 381 (1996), 215-217.
G. Golub, M. Heath, G. Wahba, Generalized cross-validation ..., Technometrics 21 (1979), 215-223.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DIMENSIONS = (1, 2, 3, 4)
"""Readings from which the next is forecast."""

LINEAR_LAGS = 8
"""Most readings of the linear forecasts."""

CENTRES, CENTRES_OF_SURROGATES = 160, 48
"""Most Gaussian bumps of the map, and of those that are compared with surrogates; a third of the readings at most."""

WIDTHS = (0.15, 0.35, 0.7, 1.4)
"""Widths of the bumps, in standard deviations of the readings times the root of the dimension."""

RIDGES = np.logspace(-7.0, 2.0, 19)
"""Weights of the penalty, as shares of the largest eigenvalue."""

LEAST_RIDGE = 1e-9
"""Weight of the penalty a reading, without which equations of bumps that lie together would be singular."""

REFITS, TRANSIENT, ITERATIONS = 24, 100, 400
"""Refits to resampled readings; cycles that each map runs before and while its exponent is taken."""

OUTSIDE, BEYOND = 0.3, 0.1
"""Share of its cycles in which a bounded map may leave the neighbourhood of the readings, and by what share of their
range that reaches beyond them."""

MOST_READINGS = 1000
"""Readings, the last ones, that are used."""

LEAST_EXPONENT = 0.02
"""Exponent per cycle that three in four refits must exceed: of a chaotic map some neighbours are periodic windows."""

MOST_LEFT, LEAST_GAIN = 0.6, 0.75
"""Variance that the forecast may leave, as shares of the readings' and of what the linear forecast leaves."""

SAME_SPREAD = (0.5, 1.5)
"""Standard deviations of the iterated map that account for the readings, in theirs."""

REST = -0.02
"""Exponent per cycle below which nine in ten refits must lie where the map comes to rest."""

SURROGATES = 39
"""Random records of the same spectrum and distribution; the record must beat all: one chance in forty."""


class Map(NamedTuple):
    """A forecast of the next reading, in standard deviations; ``error`` is its generalised cross-validation."""

    dimension: int
    width: float
    ridge: float
    centres: Array
    error: float


class Determinism(NamedTuple):
    """What the fitted map says of a record.

    Attributes
    ----------
    dimension, width
        Readings that the best forecast takes, and width of its bumps, one of ``WIDTHS``.
    linear, nonlinear
        Variance that the best linear and nonlinear forecast leave, as a share of that of the readings.
    exponents : (refits,)
        Largest exponent per cycle of each refit, iterated without noise; -inf where it leaves the readings' range.
    spread
        Standard deviation of the iterated maps that stay bounded, all together, as a share of that of the readings.
    """

    dimension: int
    width: float
    linear: float
    nonlinear: float
    exponents: Array
    spread: float

    @property
    def exponent(self) -> tuple[float, float]:
        """(exponent that three in four refits exceed, median) per cycle."""
        low, middle = np.quantile(self.exponents, (0.25, 0.5), method="lower")
        return float(low), float(middle)

    @property
    def map_is_chaotic(self) -> bool:
        """Whether the map without noise is irregular for certain, and accounts for the readings."""
        low, high = SAME_SPREAD
        accounts = self.nonlinear < MOST_LEFT and self.nonlinear < LEAST_GAIN * self.linear
        return bool(accounts and self.exponent[0] > LEAST_EXPONENT and low < self.spread < high)

    @property
    def map_rests(self) -> bool:
        """Whether the map without noise stays bounded and comes to repeat: noise alone keeps the readings apart."""
        return bool(np.isfinite(self.exponents).all() and np.quantile(self.exponents, 0.9) < REST)


def pasts(values: Array) -> tuple[Array, Array]:
    """(readings before each, (n, 8), the last first; the readings, (n,)), in standard deviations."""
    scaled = (values - values.mean()) / values.std()
    windows = np.lib.stride_tricks.sliding_window_view(scaled, LINEAR_LAGS + 1)
    return np.ascontiguousarray(windows[:, -2::-1]), np.ascontiguousarray(windows[:, -1])


def linear_error(past: Array, following: Array) -> float:
    """Least generalised cross-validation of the linear forecasts from 0 to 8 readings."""
    size, found = len(following), []
    for lags in range(LINEAR_LAGS + 1):
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


def _weights(model: Map, past: Array, following: Array, resampled: Array) -> Array:
    """Coefficients (refits, 1 + dimension + centres) for readings that count ``resampled`` (refits, n)."""
    points = past[:, : model.dimension]
    design = np.column_stack([np.ones(len(points)), points, _bumps(points, model.centres, model.width)])
    penalty = np.full(design.shape[1], max(model.ridge, LEAST_RIDGE * len(points)))
    penalty[: 1 + model.dimension] = LEAST_RIDGE * len(points)
    normal = np.stack([design.T @ (design * w[:, None]) for w in resampled]) + np.diag(penalty)
    right = np.stack([design.T @ (following * w) for w in resampled])
    return np.asarray(np.linalg.solve(normal, right[:, :, None])[:, :, 0])


def _iterate(model: Map, weights: Array, points: Array, rng: np.random.Generator) -> tuple[Array, float]:
    """(exponents, standard deviation) of maps (refits, coefficients) that start from readings (n, dimension).

    A map that leaves the neighbourhood of the readings starts anew from one of them; one that does so often is not
    bounded. The deviation that is followed keeps its direction.
    """
    dimension, centres, narrow = model.dimension, model.centres, model.width**-2
    count = len(weights)
    state = points[rng.integers(len(points), size=count)]
    shift = np.ones_like(state) / np.sqrt(dimension)
    constant, slopes, heights = weights[:, 0], weights[:, 1 : 1 + dimension], weights[:, 1 + dimension :]
    squares = np.sum(centres**2, axis=1)
    margin = BEYOND * float(np.ptp(points[:, 0]))
    low, high = float(points[:, 0].min()) - margin, float(points[:, 0].max()) + margin
    far = _reach(points, centres, model.width)
    left, growth = np.zeros(count), np.zeros(count)
    run = np.empty((ITERATIONS, count))
    for cycle in range(TRANSIENT + ITERATIONS):
        distance = np.sum(state**2, axis=1)[:, None] - 2.0 * state @ centres.T + squares
        away = (distance.min(axis=1) > far) | (state[:, 0] < low) | (state[:, 0] > high)
        if away.any():
            left += away
            state[away] = points[rng.integers(len(points), size=int(away.sum()))]
            distance = np.sum(state**2, axis=1)[:, None] - 2.0 * state @ centres.T + squares
        bumps = heights * np.exp(-0.5 * narrow * distance)
        following = constant + np.sum(slopes * state, axis=1) + bumps.sum(axis=1)
        gradient = slopes + narrow * (bumps @ centres - bumps.sum(axis=1)[:, None] * state)
        state = np.column_stack([following, state[:, :-1]])
        shift = np.column_stack([np.sum(gradient * shift, axis=1), shift[:, :-1]])
        size = np.maximum(np.sqrt(np.sum(shift**2, axis=1)), 1e-100)
        shift /= size[:, None]
        if cycle >= TRANSIENT:
            growth += np.log(size)
            run[cycle - TRANSIENT] = following
    bounded = left <= OUTSIDE * (TRANSIENT + ITERATIONS)
    spread = float(run[:, bounded].std()) if bounded.any() else 0.0
    return np.where(bounded, growth / ITERATIONS, -np.inf), spread


def _reach(points: Array, centres: Array, width: float) -> float:
    """Square of the distance from all centres beyond which the map knows nothing."""
    nearest = np.sum(points**2, axis=1)[:, None] - 2.0 * points @ centres.T + np.sum(centres**2, axis=1)
    return max(4.0 * float(np.max(nearest.min(axis=1))), (0.5 * width) ** 2, 0.01)


def determinism(values: Array) -> Determinism:
    """Fit a map to readings (cycles,) that are not constant, and iterate it without noise."""
    past, following = pasts(values[-MOST_READINGS:])
    model = fit_map(past, following)
    rng = np.random.default_rng(0)
    resampled = rng.exponential(size=(REFITS, len(past)))
    resampled[0] = 1.0
    weights = _weights(model, past, following, resampled)
    exponents, spread = _iterate(model, weights, past[:, : model.dimension], rng)
    width = model.width / float(np.sqrt(model.dimension))
    return Determinism(model.dimension, width, linear_error(past, following), model.error, exponents, spread)


def surrogate(values: Array, rng: np.random.Generator, rounds: int = 30) -> Array:
    """A random record with the spectrum and the distribution of ``values`` (Schreiber and Schmitz 1996)."""
    ordered, amplitude = np.sort(values), np.abs(np.fft.rfft(values))
    made = rng.permutation(values)
    for _ in range(rounds):
        turned = np.fft.rfft(made)
        turned *= amplitude / np.maximum(np.abs(turned), 1e-300)
        made = np.empty_like(ordered)
        made[np.argsort(np.fft.irfft(turned, len(values)))] = ordered
    return made


def beats_surrogates(
    values: Array, dimensions: tuple[int, ...] = (1, 2, 3), widths: tuple[float, ...] = (0.35, 1.4)
) -> bool:
    """Whether a nonlinear forecast of readings gains more on the linear one than in each of the surrogates."""
    values = values[-MOST_READINGS:]
    past, following = pasts(values)
    allowed = (dimensions, widths, CENTRES_OF_SURROGATES)
    gain = fit_map(past, following, *allowed).error / linear_error(past, following)
    if gain >= 1.0:
        return False
    rng = np.random.default_rng(1)
    for _ in range(SURROGATES):
        past, following = pasts(surrogate(values, rng))
        if fit_map(past, following, *allowed).error <= gain * linear_error(past, following):
            return False
    return True


DRIVEN = 0.4
"""Share of what a cubic forecast leaves below which a line of the spectrum drives the readings."""


def drive(values: Array) -> tuple[float, float]:
    """(share, frequency a cycle): what a forecast leaves once a line modulates it, of what it leaves without.

    Strange non-chaotic motion is driven at a frequency that no pattern has, and its fitted map looks chaotic; with the
    phase of the drive among its arguments the forecast is nearly exact. Frequencies of patterns of up to four cycles
    are left out.
    """
    past, following = pasts(values[-MOST_READINGS:])
    size, last = len(following), past[:, 0]
    powers = np.column_stack([np.ones(size), last, last**2, last**3])
    alone = np.linalg.qr(np.column_stack([powers, past[:, 1], past[:, 1] ** 2, last * past[:, 1]]))[0]
    rest = following - alone @ (alone.T @ following)
    power = max(float(rest @ rest), 1e-300)
    best = (1.0, 0.0)
    for frequency in np.arange(2.0, 2 * size - 2) / (4 * size):
        if min(abs(frequency * k - round(frequency * k)) / k for k in (1, 2, 3, 4)) < 1.0 / size:
            continue
        turn = np.exp(2j * np.pi * frequency * np.arange(size))
        driven = np.concatenate([powers * turn.real[:, None], powers * turn.imag[:, None]], axis=1)
        driven -= alone @ (alone.T @ driven)
        normal = driven.T @ driven + 1e-9 * size * np.eye(driven.shape[1])
        along = driven.T @ rest
        best = min(best, (1.0 - float(along @ np.linalg.solve(normal, along)) / power, float(frequency)))
    return best
