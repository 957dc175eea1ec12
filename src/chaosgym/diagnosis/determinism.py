r"""Determinism of an irregular record: whether a map without noise reproduces the irregularity.

A random process and deterministic chaos both never repeat. Chaos differs in four ways, and all are asked for:

1. A nonlinear model of the past forecasts the next reading better than every linear one: by more than in surrogates,
   random records of the same spectrum and distribution (iterated amplitude-adjusted Fourier transform).
2. The fitted map, iterated without noise, stays bounded and varies as much as the readings.
3. Its largest exponent is above zero for three in four refits to resampled readings.
4. No line of the spectrum drives it or explains as much: a torus, strange non-chaotic motion and hum of the mains are
   deterministic or look so, and are not chaotic.

The model is a line plus Gaussian bumps of the last one to four readings, smoothed by generalised cross-validation.
Several sensors make one series, in the order in which their readings follow each other within a cycle. Each sensor has
its own map of the last readings of all, so a forecast spans the part of a cycle between two sensors.

References
----------
T. Schreiber, A. Schmitz, Improved surrogate data for nonlinearity tests, Phys. Rev. Lett. 77 (1996), 635-638.
T. Schreiber, A. Schmitz, Surrogate time series, Physica D 142 (2000), 346-382.
D. Prichard, J. Theiler, Generating surrogate data for time series with several simultaneously measured variables,
Phys. Rev. Lett. 73 (1994), 951-954.
M. Barahona, C.-S. Poon, Detection of nonlinear dynamics in short, noisy time series, Nature 381 (1996), 215-217.
G. Golub, M. Heath, G. Wahba, Generalized cross-validation ..., Technometrics 21 (1979), 215-223.
"""

from itertools import permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DIMENSIONS, DIMENSIONS_TOGETHER = (1, 2, 3, 4), (1, 2, 3, 4, 6)
"""Readings from which the next is forecast, of one sensor and of several."""

MOST_ORDERED = 3
"""Sensors at the most whose order within a cycle is found; of more the order is the one that is given."""

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

    @property
    def share(self) -> float:
        """Width of its bumps, one of ``WIDTHS``."""
        return self.width / float(np.sqrt(self.dimension))


class Determinism(NamedTuple):
    """What the fitted maps say of a record.

    Attributes
    ----------
    order
        Places of the sensors in the order in which their readings follow each other within a cycle.
    maps
        The best forecast of each sensor, in that order.
    linear : (sensors,)
        Variance that the best linear forecast of each leaves, as a share of that of its readings.
    exponents : (refits,)
        Largest exponent per cycle of each refit, iterated without noise; -inf where it leaves the readings' range.
    spread : (sensors,)
        Standard deviation of the iterated maps that stay bounded, all together, as a share of that of the readings.
    """

    order: tuple[int, ...]
    maps: tuple[Map, ...]
    linear: Array
    exponents: Array
    spread: Array

    @property
    def nonlinear(self) -> Array:
        """Variance that the best forecast of each sensor leaves, as a share of that of its readings, (sensors,)."""
        return np.array([one.error for one in self.maps])

    @property
    def dimension(self) -> int:
        """Most readings that a forecast takes."""
        return max(one.dimension for one in self.maps)

    @property
    def exponent(self) -> tuple[float, float]:
        """(exponent that three in four refits exceed, median) per cycle."""
        low, middle = np.quantile(self.exponents, (0.25, 0.5), method="lower")
        return float(low), float(middle)

    @property
    def map_is_chaotic(self) -> bool:
        """Whether the map without noise is irregular for certain, and accounts for the readings."""
        low, high = SAME_SPREAD
        accounts = (self.nonlinear < MOST_LEFT) & (self.nonlinear < LEAST_GAIN * self.linear)
        same = (low < self.spread) & (self.spread < high)
        return bool(accounts.all() and self.exponent[0] > LEAST_EXPONENT and same.all())

    @property
    def map_rests(self) -> bool:
        """Whether the map without noise stays bounded and comes to repeat: noise alone keeps the readings apart."""
        return bool(np.isfinite(self.exponents).all() and np.quantile(self.exponents, 0.9) < REST)


def pasts(values: Array) -> list[tuple[Array, Array]]:
    """For each sensor of readings (cycles, sensors): what came before, and what came.

    The readings of all sensors are one series, in standard deviations of each; those before, the last first, are
    (n, 8 sensors), those that came (n,).
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


def _weights(model: Map, past: Array, following: Array, resampled: Array) -> Array:
    """Coefficients (refits, 1 + dimension + centres) for readings that count ``resampled`` (refits, n)."""
    points = past[:, : model.dimension]
    design = np.column_stack([np.ones(len(points)), points, _bumps(points, model.centres, model.width)])
    penalty = np.full(design.shape[1], max(model.ridge, LEAST_RIDGE * len(points)))
    penalty[: 1 + model.dimension] = LEAST_RIDGE * len(points)
    normal = np.stack([design.T @ (design * w[:, None]) for w in resampled]) + np.diag(penalty)
    right = np.stack([design.T @ (following * w) for w in resampled])
    return np.asarray(np.linalg.solve(normal, right[:, :, None])[:, :, 0])


def _iterate(
    maps: tuple[Map, ...], weights: list[Array], before: list[Array], rng: np.random.Generator
) -> tuple[Array, Array]:
    """(exponents, standard deviations (sensors,)) of maps that start from readings.

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
    return np.where(bounded, growth / ITERATIONS, -np.inf), spread


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


def determinism(values: Array) -> Determinism:
    """Fit maps to readings (cycles,) or (cycles, sensors), none constant, and iterate them without noise."""
    values = _of_sensors(values)
    order, maps = _best_order(values)
    found = pasts(values[:, order])
    rng = np.random.default_rng(0)
    resampled = rng.exponential(size=(REFITS, len(found[0][1])))
    resampled[0] = 1.0
    weights = [_weights(model, *each, resampled) for model, each in zip(maps, found, strict=True)]
    longest = max(model.dimension for model in maps)
    exponents, spread = _iterate(maps, weights, [past[:, :longest] for past, _ in found], rng)
    linear = np.array([linear_error(*each) for each in found])
    return Determinism(order, maps, linear, exponents, spread)


def _best_order(values: Array) -> tuple[tuple[int, ...], tuple[Map, ...]]:
    """(order of the sensors within a cycle, map of each) that forecast readings (cycles, sensors) best."""
    sensors = values.shape[1]
    allowed = DIMENSIONS if sensors == 1 else DIMENSIONS_TOGETHER
    orders = list(permutations(range(sensors))) if sensors <= MOST_ORDERED else [tuple(range(sensors))]
    tried = [(order, tuple(fit_map(*each, allowed) for each in pasts(values[:, order]))) for order in orders]
    return min(tried, key=lambda one: sum(model.error for model in one[1]))


def _of_sensors(values: Array) -> Array:
    """The last readings, (cycles, sensors)."""
    return values[-MOST_READINGS:].reshape(min(len(values), MOST_READINGS), -1)


ROUNDS = 30
"""Rounds in which spectra and distribution of a surrogate are matched in turn."""


def surrogate(values: Array, rng: np.random.Generator) -> Array:
    """A random record with the spectra, cross-spectra and distributions of ``values``, (cycles, sensors).

    Phases of all sensors at a frequency turn by one angle (Schreiber and Schmitz 2000; Prichard and Theiler 1994). Of
    one sensor this is the surrogate of Schreiber and Schmitz (1996).
    """
    ordered, spectrum = np.sort(values, axis=0), np.fft.rfft(values, axis=0)
    phase = spectrum / np.maximum(np.abs(spectrum), 1e-300)
    made = values[rng.permutation(len(values))]
    for _ in range(ROUNDS):
        turned = np.fft.rfft(made, axis=0)
        turned *= phase.conj() / np.maximum(np.abs(turned), 1e-300)
        together = np.sum(turned, axis=1, keepdims=True)
        drawn = np.fft.irfft(spectrum * together / np.maximum(np.abs(together), 1e-300), len(values), axis=0)
        np.put_along_axis(made, np.argsort(drawn, axis=0), ordered, axis=0)
    return made


def beats_surrogates(values: Array, fitted: Determinism | None = None) -> bool:
    """Whether nonlinear forecasts of readings gain more on linear ones than in each of the surrogates.

    Of several sensors the one that gains least counts: a sensor may be a curved function of another, which no map of
    the past is. The forecasts are those of ``fitted``, or of one to three readings where no map is known.
    """
    values = _of_sensors(values)
    allowed: list[tuple[tuple[int, ...], tuple[float, ...]]] = [((1, 2, 3), (0.35, 1.4))] * values.shape[1]
    if fitted is not None:
        values = values[:, fitted.order]
        allowed = [((model.dimension,), (model.share,)) for model in fitted.maps]

    def gain(record: Array) -> float:
        return max(
            fit_map(*each, *of, CENTRES_OF_SURROGATES).error / linear_error(*each)
            for each, of in zip(pasts(record), allowed, strict=True)
        )

    least = gain(values)
    rng = np.random.default_rng(1)
    return least < 1.0 and all(gain(surrogate(values, rng)) > least for _ in range(SURROGATES))


DRIVEN = 0.4
"""Share of what a cubic forecast leaves below which a line of the spectrum drives the readings."""


def drive(values: Array) -> tuple[float, float]:
    """(share, frequency a cycle): what a forecast leaves once a line modulates it, of what it leaves without.

    Strange non-chaotic motion is driven at a frequency that no pattern has, and its fitted map looks chaotic; with the
    phase of the drive among its arguments the forecast is nearly exact. Frequencies of patterns of up to four cycles
    are left out.
    """
    ((past, following),) = pasts(_of_sensors(values))
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
