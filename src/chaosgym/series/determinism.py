r"""Determinism of an irregular record: whether a map without noise reproduces the irregularity.

A random process and deterministic chaos both never repeat. Chaos differs in four ways, and all are asked for:

1. A nonlinear model of the past forecasts the next reading better than every linear one: by more than in surrogates,
   random records of the same spectrum and distribution (iterated amplitude-adjusted Fourier transform).
2. The fitted map, iterated without noise, stays bounded and varies as much as the readings.
3. Its largest exponent is above zero for three in four refits to resampled readings.
4. No line of the spectrum drives it or explains as much: a torus, strange non-chaotic motion and hum of the mains are
   deterministic or look so, and are not chaotic.

References
----------
T. Schreiber, A. Schmitz, Improved surrogate data for nonlinearity tests, Phys. Rev. Lett. 77 (1996), 635-638.
T. Schreiber, A. Schmitz, Surrogate time series, Physica D 142 (2000), 346-382.
D. Prichard, J. Theiler, Generating surrogate data for time series with several simultaneously measured variables,
Phys. Rev. Lett. 73 (1994), 951-954.
M. Barahona, C.-S. Poon, Detection of nonlinear dynamics in short, noisy time series, Nature 381 (1996), 215-217.
"""

from itertools import permutations
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.series.forecast_map import (
    DIMENSIONS,
    Map,
    fit_map,
    iterated,
    linear_error,
    pasts,
    weights_of,
)

MOST_ORDERED = 3
"""Sensors at the most whose order within a cycle is found; of more the order is the one that is given."""

DIMENSIONS_TOGETHER = (*DIMENSIONS, 6)
"""Readings of several sensors from which the next is forecast."""

CENTRES_OF_SURROGATES = 48
"""Most bumps of the maps that are compared with surrogates."""

REFITS = 24
"""Refits to resampled readings."""

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

REST_SURELY = -0.1
"""The same where the period on which the map rests is told: nearer to zero it may be twice as long."""

SURROGATES = 39
"""Random records of the same spectrum and distribution; the record must beat all: one chance in forty."""


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
    period
        Period on which all refits come to rest; None if they do not.
    """

    order: tuple[int, ...]
    maps: tuple[Map, ...]
    linear: Array
    exponents: Array
    spread: Array
    period: int | None

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
        return self._accounts and self.exponent[0] > LEAST_EXPONENT

    @property
    def resting_period(self) -> int | None:
        """Period of the map without noise, two at least, where it accounts for the readings; else None."""
        rests = self.map_rests and np.quantile(self.exponents, 0.9) < REST_SURELY
        return self.period if self._accounts and rests and (self.period or 1) > 1 else None

    @property
    def _accounts(self) -> bool:
        low, high = SAME_SPREAD
        accounts = (self.nonlinear < MOST_LEFT) & (self.nonlinear < LEAST_GAIN * self.linear)
        return bool(accounts.all() and ((low < self.spread) & (self.spread < high)).all())

    @property
    def map_rests(self) -> bool:
        """Whether the map without noise stays bounded and comes to repeat: noise alone keeps the readings apart."""
        return bool(np.isfinite(self.exponents).all() and np.quantile(self.exponents, 0.9) < REST)


def determinism(values: Array) -> Determinism:
    """Fit maps to readings (cycles,) or (cycles, sensors), none constant, and iterate them without noise."""
    values = _of_sensors(values)
    order, maps = _best_order(values)
    found = pasts(values[:, order])
    rng = np.random.default_rng(0)
    resampled = rng.exponential(size=(REFITS, len(found[0][1])))
    resampled[0] = 1.0
    weights = [weights_of(model, *each, resampled) for model, each in zip(maps, found, strict=True)]
    longest = max(model.dimension for model in maps)
    exponents, spread, period = iterated(maps, weights, [past[:, :longest] for past, _ in found], rng)
    linear = np.array([linear_error(*each) for each in found])
    return Determinism(order, maps, linear, exponents, spread, period)


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
