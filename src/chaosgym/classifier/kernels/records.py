"""Kernels that compute the features of one record, for ``classifier.features``."""

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core.kernel import njit

LAGS = 8
"""Differences of cycles up to so many apart."""

CLASSES = 16
"""Longest period looked for."""

_FLOOR = 1e-9


@njit(cache=True, nogil=True)
def true_length(row: Array) -> int:
    """Cycles of a record before the NaN at its end."""
    length = len(row)
    while length > 0 and np.isnan(row[length - 1]):
        length -= 1
    return length


@njit(cache=True, nogil=True)
def _log(value: float) -> float:
    return float(np.log10(max(value, _FLOOR)))


@njit(cache=True, nogil=True)
def repeat(x: Array, max_period: int) -> tuple[float, int]:
    """Smallest over k of the largest |x(i + k) - x(i)| / max x on the second half of a record, and its k."""
    start = len(x) // 2
    largest = 0.0
    for i in range(start, len(x)):
        largest = max(largest, abs(x[i]))
    best, period = np.inf, 1
    if largest == 0.0:
        return 0.0, 1
    for k in range(1, min(max_period, (len(x) - start) // 2) + 1):
        worst = 0.0
        for i in range(start, len(x) - k):
            worst = max(worst, abs(x[i + k] - x[i]))
        if worst < best:
            best, period = worst, k
    return best / largest, period


@njit(cache=True, nogil=True)
def _difference(x: Array, lag: int) -> float:
    """Root mean square of x(i + lag) - x(i); NaN with fewer than three pairs."""
    pairs = len(x) - lag
    if pairs < 3:
        return np.nan
    total = 0.0
    for i in range(pairs):
        total += (x[i + lag] - x[i]) ** 2
    return float(np.sqrt(total / pairs))


@njit(cache=True, nogil=True)
def class_scatter(x: Array, period: int) -> float:
    """Standard deviation within the interleaved classes of a period, degrees of freedom counted."""
    total = 0.0
    for first in range(period):
        count, mean = 0, 0.0
        for i in range(first, len(x), period):
            count += 1
            mean += x[i]
        mean /= count
        for i in range(first, len(x), period):
            total += (x[i] - mean) ** 2
    return float(np.sqrt(total / max(1, len(x) - period)))


@njit(cache=True, nogil=True)
def _least_scatter(x: Array, max_period: int) -> tuple[float, int]:
    best, period = np.inf, 1
    for k in range(1, max(1, min(max_period, len(x) // 4)) + 1):
        scatter = class_scatter(x, k)
        if scatter < 0.9 * best:
            best, period = scatter, k
    return best, period


@njit(cache=True, nogil=True)
def least_scatter(x: Array, max_period: int) -> float:
    """Least half range of an even scatter that explains a record, whatever its period, its sampling allowed for.

    Of the period that fits best: sqrt(3) standard deviations within its classes less two standard errors, or two thirds
    of the widest class's half range if that is more; as ``diagnosis.stroboscopic.noisy_class_residuals``.
    """
    least = np.inf
    for period in range(1, max_period + 1):
        repeats = len(x) // period
        first = len(x) - repeats * period
        total, widest = 0.0, 0.0
        for kind in range(first, first + period):
            mean, low, high = 0.0, np.inf, -np.inf
            for i in range(kind, len(x), period):
                mean += x[i]
                low, high = min(low, x[i]), max(high, x[i])
            mean /= repeats
            for i in range(kind, len(x), period):
                total += (x[i] - mean) ** 2
            widest = max(widest, 0.5 * (high - low))
        freedom = (repeats - 1) * period
        scatter = np.sqrt(3.0 * total / freedom) / (1.0 + np.sqrt(2.0 / freedom))
        least = min(least, max(scatter, widest / 1.5))
    return float(least)


@njit(cache=True, nogil=True)
def _approach(x: Array, period: int) -> tuple[float, float]:
    """Slope per cycle and squared correlation of log |x(i + k) - x(i)| against i."""
    count = len(x) - period
    if count < 4:
        return np.nan, np.nan
    middle = 0.5 * (count - 1)
    mean = 0.0
    for i in range(count):
        mean += np.log(abs(x[i + period] - x[i]) + _FLOOR)
    mean /= count
    across, time, spread = 0.0, 0.0, 0.0
    for i in range(count):
        value = np.log(abs(x[i + period] - x[i]) + _FLOOR) - mean
        across += (i - middle) * value
        time += (i - middle) ** 2
        spread += value * value
    return across / time, across * across / (time * spread) if spread > 0.0 else 1.0


@njit(cache=True, nogil=True)
def _forecast(x: Array, y: Array, later: int) -> tuple[float, float]:
    """Error of predicting x by its nearest neighbour in the plane (x, y), and that neighbour's distance.

    Row i of the plane is (x[i], y[i]); what is predicted is x[i + later]. Root mean squares.
    """
    count = len(x) - later
    if count < 4:
        return np.nan, np.nan
    error, distance = 0.0, 0.0
    for i in range(count):
        best, which = np.inf, 0
        for j in range(count):
            if j != i:
                gap = (x[j] - x[i]) ** 2 + (y[j] - y[i]) ** 2
                if gap < best:
                    best, which = gap, j
        distance += best
        error += (x[which + later] - x[i + later]) ** 2
    return np.sqrt(error / count), np.sqrt(distance / count)


@njit(cache=True, nogil=True)
def _flatness(x: Array) -> float:
    """Geometric over arithmetic mean of the periodogram without its mean."""
    n = len(x)
    lines = (n - 1) // 2
    logarithm, total = 0.0, 0.0
    for line in range(1, lines + 1):
        turn_real, turn_imaginary = np.cos(2.0 * np.pi * line / n), np.sin(2.0 * np.pi * line / n)
        unit_real, unit_imaginary, real, imaginary = 1.0, 0.0, 0.0, 0.0
        for value in x:
            real += value * unit_real
            imaginary += value * unit_imaginary
            unit_real, unit_imaginary = (
                unit_real * turn_real - unit_imaginary * turn_imaginary,
                unit_real * turn_imaginary + unit_imaginary * turn_real,
            )
        power = real * real + imaginary * imaginary + 1e-24
        logarithm += np.log(power)
        total += power
    return float(np.exp(logarithm / lines) * lines / total)


@njit(cache=True, nogil=True)
def _pattern_entropy(x: Array) -> float:
    """Entropy of the order of three successive values, 0 to 1."""
    counts = np.zeros(8)
    for i in range(len(x) - 2):
        counts[(x[i] < x[i + 1]) + 2 * (x[i + 1] < x[i + 2]) + 4 * (x[i] < x[i + 2])] += 1.0
    entropy = 0.0
    for count in counts:
        if count > 0.0:
            share = count / (len(x) - 2)
            entropy -= share * np.log(share)
    return float(entropy / np.log(6.0))


@njit(cache=True, nogil=True)
def _distinct(ordered: Array, gap: float) -> float:
    count = 1
    last = ordered[0]
    for value in ordered:
        if value - last > gap:
            count += 1
            last = value
    return count / len(ordered)


@njit(cache=True, nogil=True)
def _moments(x: Array) -> tuple[float, float, float, float]:
    """Mean, standard deviation, skewness, kurtosis."""
    mean = float(np.mean(x))
    second, third, fourth = 0.0, 0.0, 0.0
    for value in x:
        gap = value - mean
        second += gap * gap
        third += gap * gap * gap
        fourth += gap * gap * gap * gap
    second /= len(x)
    if second < 1e-24:
        return mean, 0.0, 0.0, 0.0
    return mean, float(np.sqrt(second)), third / len(x) / second**1.5, fourth / len(x) / second**2


@njit(cache=True, nogil=True)
def _autocorrelation(x: Array, mean: float, deviation: float, lag: int) -> float:
    if deviation == 0.0:
        return 1.0
    total = 0.0
    for i in range(len(x) - lag):
        total += (x[i] - mean) * (x[i + lag] - mean)
    return total / ((len(x) - lag) * deviation * deviation)


@njit(cache=True, nogil=True)
def _section_features(states: Array, out: Array) -> None:
    late = states[len(states) // 2 :]
    scales = np.empty(2)
    scatter, approach, period = 0.0, 0.0, 1
    for column in range(2):
        scales[column] = np.sqrt(np.mean(states[:, column] ** 2)) + 1e-300
        values = late[:, column] / scales[column]
        least, best = _least_scatter(values, CLASSES)
        if least >= scatter:
            scatter, period = least, best
    for column in range(2):
        slope, _ = _approach(states[:, column] / scales[column], period)
        approach = max(approach, slope) if column else slope
    first, second = states[:, 0] / scales[0], states[:, 1] / scales[1]
    error, _ = _forecast(first, second, 1)
    out[0] = _log(scatter)
    out[1] = approach
    out[2] = _log(error)
    out[3] = _log(max(np.std(late[:, 0]) / scales[0], np.std(late[:, 1]) / scales[1]))


@njit(cache=True, nogil=True)
def _features(x: Array, sensor_error: float, out: Array) -> None:
    n = len(x)
    level = np.mean(x)
    scale = level if level > 0.0 else 1.0
    z = x / scale
    half = z[n // 2 :]
    error = sensor_error / scale
    mean, deviation, skewness, kurtosis = _moments(z)
    late_mean, late_deviation, _, _ = _moments(half)
    spread = np.max(half) - np.min(half)
    head = (np.log(float(n)), _log(level), _log(error), _log(deviation), _log(late_deviation), _log(spread))
    for i in range(6):
        out[i] = head[i]
    if np.isnan(error):
        out[2] = np.nan
    at = 6
    out[at] = _log(spread / (2.0 * error)) if error > 0.0 else np.nan
    at += 1
    for series in (z, half):
        for lag in range(1, LAGS + 1):
            out[at] = np.log10(_difference(series, lag) + _FLOOR)
            at += 1
    residual, repeat_period = repeat(z, CLASSES)
    scatter, scatter_period = _least_scatter(z, CLASSES)
    late_scatter, _ = _least_scatter(half, CLASSES)
    slope, straightness = _approach(z, scatter_period)
    early_deviation = np.std(z[: n // 2])
    forecast, distance = _forecast(z[:-1], z[1:], 2)
    ordered = np.sort(half)
    least = least_scatter(z, max(1, min(CLASSES, n // 4)))
    turning = 0
    for i in range(n - 2):
        turning += (z[i + 1] - z[i]) * (z[i + 2] - z[i + 1]) < 0.0
    rest = (
        _log(residual),
        float(repeat_period),
        _log(scatter),
        _log(late_scatter),
        float(scatter_period),
        _log(scatter / (deviation + _FLOOR)),
        _log(late_scatter / error) if error > 0.0 else np.nan,
        slope,
        straightness,
        late_mean - mean,
        _log(late_deviation) - _log(early_deviation),
        _log(forecast),
        _log(distance),
        _flatness(z - mean),
        _autocorrelation(z, mean, deviation, 1),
        _autocorrelation(z, mean, deviation, 2),
        _autocorrelation(z, mean, deviation, 3),
        _pattern_entropy(z),
        turning / (n - 2),
        skewness,
        kurtosis,
        _distinct(ordered, 0.01),
        _distinct(ordered, 0.05),
        _log(np.min(z)),
        _log(np.max(z)),
        _log(least),
        _log(least / error) if error > 0.0 else np.nan,
    )
    for i in range(len(rest)):
        out[at + i] = rest[i]


@njit(cache=True, nogil=True)
def fill_features(peaks: Array, section: Array, sensor_error: Array, out: Array) -> None:
    """Figures ``out`` (n, n_features) of records; peaks, section and sensor_error as ``as_records`` returns them."""
    for row in range(len(peaks)):
        length = true_length(peaks[row])
        _features(peaks[row, :length], sensor_error[row], out[row])
        if section.shape[1] >= length and not np.isnan(section[row, 0, 0]):
            _section_features(section[row, :length], out[row, -4:])
