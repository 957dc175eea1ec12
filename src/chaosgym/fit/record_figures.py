r"""Figures that describe a record of peaks for a comparison with others: level, scatter, distribution, order of cycles.

They are the summary statistics of ``model_fit``. Each has a ``discrepancy``: what a model may err by and still be the
machine's. All of them are assumed.
"""

import numpy as np

from chaosgym.arrays import Array
from chaosgym.series.noise import class_residual

LEAST_SCATTER = 1e-3
"""Standard deviation, as a share of the mean, below which scatter counts as none: few draws have so little noise."""

SHARES = (0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.98)
"""Shares of the readings below the quantiles that describe their distribution."""

LAGS, PATTERNS = (1, 2, 3, 4), (2, 3, 4)
"""Cycles between the readings whose correlation counts, and periods of patterns."""

NEIGHBOURS, PASTS = 4, (1, 2)
"""Readings of the nearest past whose next ones forecast, and how many readings a past has."""

OF_SENSOR = (
    ("mean", 0.02),
    ("scatter", 0.2),
    *((f"{100.0 * share:g} % quantile", 0.2) for share in SHARES),
    *((f"correlation over {lag}", 0.15) for lag in LAGS),
    *((f"pattern of {period}", 0.15) for period in PATTERNS),
    *((f"forecast from {past}", 0.15) for past in PASTS),
)
"""Name and discrepancy of the figures of one sensor; mean and scatter are logarithms, quantiles standard deviations."""

BETWEEN = (("correlation of sensors", 0.15), ("correlation of sensors over 1", 0.15))


def figures(record: Array) -> Array:
    """Figures (k,) of readings (cycles, sensors); nan where a sensor reads nothing."""
    told = [value for readings in record.T for value in _of_sensor(readings)]
    for first in range(record.shape[1]):
        for second in range(first + 1, record.shape[1]):
            one, other = (_scaled(record[:, place]) for place in (first, second))
            told += [float(np.mean(one * other)), float(np.mean(one[1:] * other[:-1]))]
    return np.array(told)


def names_of(sensors: int) -> tuple[list[str], Array]:
    """Names of the figures, and their discrepancies."""
    pairs = sensors * (sensors - 1) // 2
    listed = [*OF_SENSOR * sensors, *BETWEEN * pairs]
    return [name for name, _ in listed], np.array([size for _, size in listed])


def _scaled(readings: Array) -> Array:
    mean = float(readings.mean())
    return np.asarray((readings - mean) / max(float(readings.std()), LEAST_SCATTER * abs(mean), 1e-300))


def _of_sensor(readings: Array) -> list[float]:
    mean, sigma = float(readings.mean()), float(readings.std())
    if mean <= 0.0:
        return [np.nan] * len(OF_SENSOR)
    scaled = _scaled(readings)
    power = float(np.mean(scaled**2))
    told = [np.log(mean), np.log(max(sigma / mean, LEAST_SCATTER)), *np.quantile(scaled, SHARES)]
    # the power is 1, and less where there is hardly any scatter, whose order then says nothing
    told += [float(np.mean(scaled[lag:] * scaled[:-lag])) for lag in LAGS]
    told += [power - float(np.mean(class_residual(scaled, period) ** 2)) for period in PATTERNS]
    return told + [_forecast_rest(scaled, past) for past in PASTS]


def _forecast_rest(scaled: Array, past: int) -> float:
    """Variance that the mean of what followed the nearest pasts leaves of each reading."""
    windows = np.lib.stride_tricks.sliding_window_view(scaled, past + 1)
    before, after = windows[:, :-1], windows[:, -1]
    distance = np.sum(before**2, axis=1)[:, None] - 2.0 * before @ before.T + np.sum(before**2, axis=1)
    np.fill_diagonal(distance, np.inf)
    nearest = np.argpartition(distance, NEIGHBOURS, axis=1)[:, :NEIGHBOURS]
    return float(np.mean((after - after[nearest].mean(axis=1)) ** 2)) / (1.0 + 1.0 / NEIGHBOURS)
