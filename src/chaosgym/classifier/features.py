r"""Figures of a response: of a machine's parameters, of its first cycles, of measured peak forces.

``response_features`` joins those of the parameters (``parameter_features``) and those of the cycles. Of the latter,
all but the level of the force are free of units: forces are divided by their mean.

    repetition   root mean square and largest difference of cycles k apart; scatter within the k interleaved classes
    settling     straight line through the logarithm of the distances to the class means; drift of level and spread
    prediction   error of forecasting a cycle by the nearest neighbour in a plane of delayed coordinates
    form         spectral flatness, autocorrelation, order patterns, distinct values, extremes, skewness, kurtosis
    sensor       spread and scatter in units of the sensor's error, where that is stated
    section      the same repetition and forecast figures for the stroboscopic displacement and velocity, where given

Cycles are rounded to single precision, in which signals are kept, so that its rounding error is no figure.
Figures that a record does not allow (too short, no sensor error, no section) are NaN, which trees handle as such.
"""

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.classifier.kernels import records as kernels
from chaosgym.classifier.kernels.records import CLASSES, LAGS, class_scatter, fill_features, true_length
from chaosgym.classifier.parameter_features import ParameterScaling, parameter_features
from chaosgym.core.compilation import call_or_interpret
from chaosgym.errors import DiagnosisError

MIN_CYCLES, MAX_CYCLES = 8, 64
"""Cycles that a record may have; of a longer one the last count."""

IMPROVEMENT = 0.5
"""A longer period counts if its classes scatter less than this share of any shorter one's: noise gains little."""

REPEATS = 4
"""How often a period must be seen."""

MAX_PLAUSIBLE = 1e5
"""Peak force [N] beyond which wrong units are suspected: the machines of the thesis stay below 3000 N."""

RECORD_FEATURES: tuple[str, ...] = (
    "cycles",
    "level",
    "sensor error",
    "variation",
    "late variation",
    "late range",
    "late range over sensor error",
    *(f"difference at lag {lag}" for lag in range(1, LAGS + 1)),
    *(f"late difference at lag {lag}" for lag in range(1, LAGS + 1)),
    "repeat residual",
    "repeat period",
    "scatter",
    "late scatter",
    "scatter period",
    "scatter over variation",
    "scatter over sensor error",
    "approach rate",
    "approach straightness",
    "drift",
    "late over early variation",
    "forecast error",
    "neighbour distance",
    "spectral flatness",
    "autocorrelation 1",
    "autocorrelation 2",
    "autocorrelation 3",
    "pattern entropy",
    "turning points",
    "skewness",
    "kurtosis",
    "distinct at 1 %",
    "distinct at 5 %",
    "lowest",
    "highest",
    "least scatter",
    "least scatter over sensor error",
    "section scatter",
    "section approach",
    "section forecast error",
    "section variation",
)
"""Names of the figures, in order."""

_COUNT = len(RECORD_FEATURES)


def as_records(
    peaks: ArrayLike, section: ArrayLike | None = None, sensor_error: ArrayLike | None = None
) -> tuple[Array, Array, Array]:
    """Check records and bring them into the form that the kernels read.

    Parameters
    ----------
    peaks : (n_records, cycles)
        Peak force of each cycle [N]; shorter records end in NaN. Of more than 64 cycles the last count.
    section : (n_records, cycles, 2), optional
        Stroboscopic displacement and velocity, in any units.
    sensor_error : float or (n_records,), optional
        Largest error of a peak [N], 0 for exact peaks; NaN or None where unknown.

    Returns
    -------
    peaks (n_records, cycles), section (n_records, cycles or 0, 2), sensor_error (n_records,)

    Raises
    ------
    DiagnosisError
        If a record is shorter than 8 cycles, or holds infinite or negative values or NaN before its end.
    """
    forces = np.atleast_2d(np.asarray(peaks, dtype=float))
    if forces.ndim != 2:
        raise DiagnosisError(f"the records have shape {forces.shape}; allowed: (records, cycles)")
    missing = np.isnan(forces)
    lengths = forces.shape[1] - missing.sum(axis=1)
    inside = missing[:, :-1] & ~missing[:, 1:]
    for bad, what in (
        (inside.any(axis=1), "NaN between its cycles"),
        (np.isinf(forces).any(axis=1), "a value that is not finite"),
        ((forces < 0.0).any(axis=1), "a negative force"),
    ):
        if bad.any():
            raise DiagnosisError(f"record {int(np.argmax(bad))} holds {what}; allowed: peak forces of 0 N and more")
    if (lengths < MIN_CYCLES).any():
        short = int(np.argmax(lengths < MIN_CYCLES))
        raise DiagnosisError(f"record {short} has {lengths[short]} cycles; allowed: {MIN_CYCLES} or more")
    states = np.empty((len(forces), 0, 2)) if section is None else np.asarray(section, dtype=float)
    if section is not None and states.shape != (*forces.shape, 2):
        raise DiagnosisError(f"the section has shape {states.shape}; allowed: {(*forces.shape, 2)}, as the peaks")
    if forces.shape[1] > MAX_CYCLES:
        starts = np.maximum(lengths - MAX_CYCLES, 0)
        columns = starts[:, None] + np.arange(MAX_CYCLES)
        forces = np.take_along_axis(forces, columns, axis=1)
        states = states if section is None else np.take_along_axis(states, columns[:, :, None], axis=1)
    given = np.nan if sensor_error is None else sensor_error
    errors = np.array(np.broadcast_to(np.asarray(given, dtype=float), len(forces)))
    if (errors < 0.0).any() or np.isinf(errors).any():
        raise DiagnosisError(f"sensor_error = {errors.min():g} is out of range; allowed: 0 N and more")
    return np.ascontiguousarray(forces), np.ascontiguousarray(states), errors


def response_features(
    scaling: ParameterScaling | None,
    values: Array | None,
    peaks: Array | None = None,
    section: Array | None = None,
    sensor_error: Array | None = None,
) -> Array:
    """Features (n, n_features) of parameter values (n, n_fields), of cycles as of ``as_records``, or of both."""
    parts = [] if scaling is None or values is None else [parameter_features(scaling, values)]
    if peaks is not None:
        states = np.empty((len(peaks), 0, 2)) if section is None else section
        errors = np.full(len(peaks), np.nan) if sensor_error is None else sensor_error
        features = np.full((len(peaks), _COUNT), np.nan)
        single = (np.ascontiguousarray(part.astype(np.float32).astype(float)) for part in (peaks, states))
        call_or_interpret(fill_features, *single, errors, features)
        parts.append(features)
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)


def record_amplitude(peaks: Array) -> Array:
    """By how much records, as ``as_records`` returns them, do not repeat [N], (n_records,).

    Scatter within the classes of the best period, given as the half range of an even spread.
    """
    out = np.empty(len(peaks))
    for index, row in enumerate(peaks):
        record = row[: call_or_interpret(true_length, row)]
        periods = range(1, min(CLASSES, len(record) // REPEATS) + 1)
        out[index] = np.sqrt(3.0) * min(call_or_interpret(class_scatter, record, period) for period in periods)
    return out


def least_scatter(peaks: Array) -> float:
    """Amplitude [N] that the scatter of one record (cycles,) has at least, its sampling allowed for.

    The plain rule: a response is irregular to a sensor whose largest error is smaller.
    """
    record = peaks[: call_or_interpret(true_length, peaks)]
    return float(call_or_interpret(kernels.least_scatter, record, min(CLASSES, len(record) // REPEATS)))


def repeat_period(peaks: ArrayLike) -> int:
    """Smallest period of one record (cycles,) whose classes scatter clearly less than those of every shorter period."""
    record = as_records(peaks)[0][0]
    record = record[~np.isnan(record)]
    best, period = np.inf, 1
    for candidate in range(1, min(CLASSES, len(record) // REPEATS) + 1):
        scatter = call_or_interpret(class_scatter, record, candidate)
        if scatter < IMPROVEMENT * best - 1e-9 * abs(record).max():
            best, period = scatter, candidate
        best = min(best, scatter)
    return period
