r"""The sensor's part in a record: its stated or estimated error, single wrong readings, missing cycles.

Peaks are compared with those one period earlier. What all cycles scatter by is noise or chaos; what single cycles
leave by far, and return from at once, is a wrong reading: a machine would need some cycles to come back.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError
from chaosgym.numbers import number
from chaosgym.series.missing_cycles import with_stand_ins

LONGEST_PERIOD = 64
"""Longest period that is looked for."""

REPEATS = 7
"""How often a period must be seen before cycles are compared with it."""

FAR = 8.0
"""Robust standard deviations beyond which a reading may be wrong."""

REACH = 4
"""Periods before and after a reading over whose median it is judged."""

OUTLIER_SHARE = 0.05
"""Share of the cycles that may be spikes or wrong readings; more of them belong to the motion."""

FEW_OUTLIERS = 0.02
"""Share up to which they may lie among the other readings; more of them must lie beyond these all."""

REPEATING, REPEATING_SPREAD = 0.95, 0.5
"""Share of the readings that come back within the scatter where cycles are missing only, and that scatter's limit as a
share of the range: in chaos stand-ins for cycles would spoil the record."""

NORMAL = 1.4826
"""Standard deviation of a normal variable over its median absolute deviation."""


class SensorError(NamedTuple):
    """Error of one reading, in the unit of the record.

    ``half_width`` is its largest value, ``sigma`` its standard deviation; ``source`` is "stated" for the former,
    "stated sigma" for the latter, "estimated" where both are from the record.
    """

    half_width: float
    sigma: float
    source: str


def stated_error(half_width: float | None, sigma: float | None) -> SensorError | None:
    """Error that was stated as a half width or as a standard deviation; None if neither was.

    Raises
    ------
    DiagnosisError
        If both are given, or one is negative or not finite.
    """
    if half_width is not None and sigma is not None:
        raise DiagnosisError("the sensor's error is given twice; allowed: sensor_error or sensor_sigma")
    for name, value in (("error", half_width), ("sigma", sigma)):
        if value is not None:
            number(f"sensor {name}", value, 0.0, unit="N", error=DiagnosisError)
    if half_width is not None:
        return SensorError(half_width, half_width / math.sqrt(3.0), "stated")
    return None if sigma is None else SensorError(3.0 * sigma, sigma, "stated sigma")


def quantum(values: Array) -> float:
    """Step of a converter whose multiples all values are; 0 if there is none."""
    levels, counts = np.unique(values, return_counts=True)
    often = counts > 1
    levels = levels[often] if counts[often].sum() > 0.5 * len(values) else levels
    if len(levels) < 2 or 3 * len(levels) > len(values) or (len(levels) == 2 and _alternates(values)):
        return 0.0
    step = float(np.min(np.diff(levels)))
    steps = (levels - levels[0]) / step
    whole = np.max(np.abs(steps - np.round(steps))) < 1e-3
    return step if whole and step > 1e-6 * float(np.max(np.abs(values))) else 0.0


def _alternates(values: Array) -> bool:
    """Whether two levels follow a pattern, as a response of period two does, and a converter's flicker does not."""
    longest = max(1, min(LONGEST_PERIOD, len(values) // REPEATS))
    return max(float(np.mean(values[k:] == values[:-k])) for k in range(1, longest + 1)) > 0.95


def local_scatter(values: Array, period: int) -> float:
    """Robust standard deviation of a reading, from the differences of cycles one period apart."""
    differences = values[period:] - values[:-period]
    return float(NORMAL * np.median(np.abs(differences - np.median(differences))) / math.sqrt(2.0))


def dominant_period(values: Array, floor: float = 0.0) -> int:
    """Smallest period after which readings come back nearly as well as after any other.

    Parameters
    ----------
    values : (cycles,)
        Readings.
    floor
        Differences that do not count.
    """
    longest = max(1, min(LONGEST_PERIOD, len(values) // REPEATS))
    back = np.array([np.median(np.abs(values[k:] - values[:-k])) for k in range(1, longest + 1)])
    return int(np.flatnonzero(back <= 1.3 * back.min() + floor)[0]) + 1


class Repaired(NamedTuple):
    """A record without wrong readings, and with a stand-in for every missing cycle.

    ``outliers`` are the cycles whose readings are wrong, ``gaps`` those before which cycles are missing, both counted
    from 1 in the record as it was read.
    """

    values: Array
    outliers: tuple[int, ...]
    gaps: tuple[int, ...]


def repair(values: Array) -> Repaired:
    """Replace single wrong readings, and fill in missing cycles of a response that otherwise repeats."""
    floor = max(quantum(values), 1e-6 * float(np.max(np.abs(values))))
    period = dominant_period(values, 0.5 * floor)
    whole, origin = with_stand_ins(values, period, max(local_scatter(values, period), floor / 2.4))
    if not _repeats(whole, period, floor):
        whole, origin = values, np.arange(len(values))
    gaps = tuple(int(origin[place + 1]) + 1 for place in np.flatnonzero(origin < 0) if origin[place + 1] >= 0)
    expected = _running_medians(whole, np.arange(len(whole)) % period, period)
    climb = abs(float(np.median(whole[period:] - whole[:-period])))
    limit = max(FAR * local_scatter(whole, period), 2.5 * floor) + (REACH + 1) * climb
    wrong = np.flatnonzero(np.abs(whole - expected) > limit)
    if len(wrong) == 0 or len(wrong) > max(1.0, OUTLIER_SHARE * len(whole)) or _longest_run(wrong) > 2:
        return Repaired(whole, (), gaps)
    rest = np.delete(whole, wrong)
    if len(wrong) > FEW_OUTLIERS * len(whole) and np.any((whole[wrong] > rest.min()) & (whole[wrong] < rest.max())):
        return Repaired(whole, (), gaps)
    mended = whole.copy()
    mended[wrong] = expected[wrong]
    return Repaired(mended, tuple(int(origin[place]) + 1 for place in wrong if origin[place] >= 0), gaps)


def equal_interval(cycles: tuple[int, ...]) -> float | None:
    """Mean interval of cycles that are equally far apart but for rounding, three at least; None if they are not.

    Of three both intervals must be the same, as those of one in a hundred random triples are.
    """
    apart = np.diff(cycles)
    if len(apart) < 2 or apart.min() < 3:
        return None
    mean = (cycles[-1] - cycles[0]) / len(apart)
    line = cycles[0] + mean * np.arange(len(cycles))
    off = np.abs(np.array(cycles) - line).max()
    return float(mean) if off <= (0.0 if len(cycles) == 3 else 1.0) else None


def _repeats(values: Array, period: int, floor: float) -> bool:
    """Whether nearly all readings come back after the period, as they do once the missing cycles are filled in."""
    limit = max(6.0 * local_scatter(values, period), 2.5 * floor)
    back = np.abs(values[period:] - values[:-period]) <= limit
    return bool(back.mean() >= REPEATING and limit < REPEATING_SPREAD * float(np.ptp(values)))


def _running_medians(values: Array, phase: NDArray[np.int64], period: int) -> Array:
    """Median of the readings of the same phase up to ``REACH`` periods away, for each reading."""
    expected = np.empty_like(values)
    for first in range(period):
        column = values[phase == first]
        width = min(2 * REACH + 1, len(column))
        starts = np.clip(np.arange(len(column)) - REACH, 0, len(column) - width)
        windows = np.lib.stride_tricks.sliding_window_view(column, width)[starts]
        expected[phase == first] = np.median(windows, axis=1)
    return expected


def _longest_run(places: NDArray[np.intp]) -> int:
    """Most places in succession."""
    breaks = np.flatnonzero(np.diff(places) > 1)
    return int(np.max(np.diff(np.concatenate([[-1], breaks, [len(places) - 1]]))))


RANDOM = 3.6
"""Predictability below which a scatter is independent from cycle to cycle."""


def predictability(values: Array, residual: Array) -> float:
    r"""How well do earlier readings predict what is left of a reading? About normal(0, 1) for a random sensor error.

    The nearest neighbours of each delay vector (one to four readings) predict the residual of the next reading; the
    correlation with what came, times the root of the number of cycles, is the figure. Autocorrelation counts as well.

    References
    ----------
    G. Sugihara, R. M. May, Nonlinear forecasting as a way of distinguishing chaos from measurement error in time
    series, Nature 344 (1990), 734-741.
    """
    if np.ptp(residual) == 0.0:
        return 0.0
    values, residual = values[-MOST_READINGS:], residual[-MOST_READINGS:]
    apart = np.abs(values[:-1, None] - values[:-1])
    distance, told = apart, [_forecast(apart, residual[1:])]
    for delays in (2, 3, 4):  # the largest of the differences of their readings
        distance = np.maximum(distance[:-1, :-1], apart[delays - 1 :, delays - 1 :])
        told.append(_forecast(distance, residual[delays:]))
    return max(told)


MOST_READINGS = 600
"""Readings, the last ones, that the forecast uses."""


def _forecast(distance: Array, following: Array, neighbours: int = 3) -> float:
    """Of what follows each delay vector, by those that follow its nearest neighbours; see ``predictability``."""
    distance = distance.copy()
    np.fill_diagonal(distance, np.inf)
    nearest = np.argpartition(distance, neighbours, axis=1)[:, :neighbours]
    told = following[nearest].mean(axis=1)
    if np.ptp(told) == 0.0 or np.ptp(following) == 0.0:
        return 0.0
    return float(np.corrcoef(told, following)[0, 1] * math.sqrt(len(following)))


def class_residual(values: Array, period: int) -> Array:
    """Readings less the mean of all readings of the same phase, (cycles,)."""
    phase = np.arange(len(values)) % period
    means = np.bincount(phase, weights=values) / np.bincount(phase)
    return np.asarray(values - means[phase])


def without_drift(values: Array, period: int) -> tuple[Array, float]:
    """(readings without a linear drift, change over the record); 0 if there is none to be sure of."""
    size = len(values)
    time = (np.arange(size) - 0.5 * (size - 1)) / size
    residual, elapsed = class_residual(values, period), class_residual(time, period)
    slope = float(np.sum(elapsed * residual) / np.sum(elapsed**2))
    error = float(np.std(residual - slope * elapsed)) / np.sqrt(np.sum(elapsed**2))
    if abs(slope) <= max(6.0 * error, 1e-9 * float(np.max(np.abs(values)))):
        return values, 0.0
    return values - slope * time, slope


def correlation(residual: Array, period: int = 1, lags: int = 10) -> float:
    """Largest autocorrelation over the first lags and those of one and two periods, times the root of the cycles."""
    centred = residual - residual.mean()
    power = float(np.sum(centred**2))
    if power == 0.0:
        return 0.0
    tried = {k for k in (*range(1, lags + 1), period, 2 * period) if k <= len(residual) // 4}
    found = [abs(float(np.sum(centred[k:] * centred[:-k]))) for k in tried]
    return max(found, default=0.0) / power * math.sqrt(len(residual))


SHORTEST = 24
"""Fewest cycles of a regime."""

PLACES = 60
"""Places at which a cut is tried first."""

DIFFERENT = 16.0
"""Ratio of variances by which regimes differ."""

GAIN = 30.0
"""Least gain of log-likelihood, times two, of a cut."""


def find_change(values: Array, floor: float) -> int | None:
    """First cycle of the later regime, counted from 0; None if the record is of one kind throughout.

    Parameters
    ----------
    values : (cycles,)
        Readings without single wrong ones.
    floor
        Standard deviation that does not count.
    """
    size = len(values)
    if size < 2 * SHORTEST:
        return None
    third = max(SHORTEST, size // 3)
    periods = {dominant_period(part, floor) for part in (values, values[:third], values[-third:])}
    whole = _variance(values, periods, floor)

    def gain(place: int) -> float:
        parts = (values[:place], values[place:])
        return size * float(np.log(whole)) - sum(len(p) * float(np.log(_variance(p, periods, floor))) for p in parts)

    places = np.unique(np.linspace(SHORTEST, size - SHORTEST, PLACES).astype(int))
    best = max(places.tolist(), key=gain)
    reach = max(1, size // PLACES)
    best = max(range(max(SHORTEST, best - reach), min(size - SHORTEST, best + reach) + 1), key=gain)
    before, after = (_variance(part, periods, floor) for part in (values[:best], values[best:]))
    larger, smaller = max(before, after), min(before, after)
    if gain(best) < GAIN or max(larger / smaller, whole / larger) < DIFFERENT:
        return None
    return int(best)


def _variance(values: Array, periods: set[int], floor: float) -> float:
    """Least variance that the readings have within the classes of one of the periods."""
    fitting = [k for k in periods if 3 * k <= len(values)] or [1]
    found = [float(np.sum(class_residual(values, k) ** 2)) / max(1, len(values) - k) for k in fitting]
    return min(found) + floor**2
