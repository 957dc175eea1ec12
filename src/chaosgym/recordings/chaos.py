"""The verdict that readings are chaotic, of one sensor or of several: what a fitted map must do, and what it says."""

from collections.abc import Sequence
from itertools import repeat

import numpy as np

from chaosgym.arrays import Array
from chaosgym.recordings.few_lines import FEW_LINES, LINES_REST
from chaosgym.recordings.fixed_motion import MOST_READINGS, THRICE, pattern_variances
from chaosgym.recordings.measured_verdict import MeasuredVerdict
from chaosgym.recordings.scatter import Scatter, left_by_hum, newton
from chaosgym.series.determinism import DRIVEN, LEAST_GAIN, Determinism, beats_surrogates, drive
from chaosgym.series.noise import SensorError
from chaosgym.series.spectrum import without_lines
from chaosgym.series.verdict import Diagnosis


def is_chaotic(several: Sequence[Scatter], fitted: Determinism) -> bool:
    """Whether maps of the sensors are chaotic, better than fixed patterns and random surrogates, and driven by no line.

    What is asked of one sensor is asked of each of ``several``.
    """
    ordered = [several[place] for place in fitted.order]
    if not (fitted.map_is_chaotic and all(map(forecast_gains, ordered, fitted.nonlinear, repeat(LEAST_GAIN)))):
        return False
    for found, nonlinear in zip(ordered, fitted.nonlinear, strict=True):
        least = min(float(np.std(without_lines(found.readings, FEW_LINES, 0.0)[0])), left_by_hum(found.readings))
        pattern = pattern_variances(found.readings[-MOST_READINGS:], min(len(found.readings), MOST_READINGS) // THRICE)
        fixed_explains = min(least**2, float(pattern.min())) < LINES_REST * nonlinear * float(np.var(found.readings))
        if fixed_explains or drive(found.readings)[0] <= DRIVEN:
            return False
    return beats_surrogates(np.column_stack([found.readings for found in several]), fitted)


def forecast_gains(found: Scatter, nonlinear: float, least: float) -> bool:
    """Whether the forecast leaves less than this share of the scatter around the fixed pattern."""
    return bool(nonlinear < least * found.sigma**2 / float(np.var(found.readings)))


def chaotic(
    several: Sequence[Scatter], fitted: Determinism, told: SensorError | None, names: Sequence[str] = ()
) -> MeasuredVerdict:
    """The verdict that readings are chaotic, in figures of the maps of one sensor, or of several with their names."""
    found = several[0]
    low, middle = fitted.exponent
    last = "the last" if fitted.dimension == 1 else f"the last {fitted.dimension}"
    made = f"a map of {last} forecasts"
    how = beyond(found, told)
    if len(several) > 1:
        made = f"maps of {last} readings of {' and '.join(names)} together forecast"
        how = "irregular"
    reason = (
        f"{how}: {made} all but {_percents(fitted.nonlinear)} % of the variance (linear: all but "
        f"{_percents(fitted.linear)} %), and without noise {'it is' if len(several) == 1 else 'they are'} chaotic, "
        f"exponent {middle:.2f} a cycle, above {low:.2f} in three of four refits"
    )
    figures = {
        "map_dimension": fitted.dimension,
        "linear_rest": float(fitted.linear.max()),
        "nonlinear_rest": float(fitted.nonlinear.max()),
        "map_exponent": middle,
        "map_exponent_low": low,
    }
    size = len(found.readings)
    margin = float(np.clip(low / middle, 0.0, 1.0))
    evidence = {"cycles": size, **found.evidence(), **figures}
    return MeasuredVerdict(
        Diagnosis(nature="chaotic", margin=margin, reason=reason, horizon=size, evidence=evidence), told
    )


def _percents(shares: Array) -> str:
    """Shares in percent, one after the other."""
    return " and ".join(f"{100.0 * share:.2g}" for share in shares)


def beyond(found: Scatter, told: SensorError | None) -> str:
    """How irregular readings are, for people."""
    if told is None:
        return f"irregular, with a scatter of {newton(found.sigma)} ({100.0 * found.relative:.2g} %)"
    return f"irregular beyond {newton(told.half_width)}, the sensor's error"
