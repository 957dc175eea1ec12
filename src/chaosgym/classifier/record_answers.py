"""Answers of trained classifiers on records, as columns: irregular or not, nature, period, contradictions."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.arrays import Array
from chaosgym.classifier.cascade import CLEAR
from chaosgym.classifier.estimator import ResponseClassifier
from chaosgym.classifier.features import (
    MAX_PLAUSIBLE,
    as_records,
    least_scatter,
    record_amplitude,
    repeat_period,
    response_features,
)


def judge_records(
    exact: ResponseClassifier, doubtful: ResponseClassifier, peaks: ArrayLike, sensor_error: ArrayLike | None
) -> dict[str, Any]:
    """Columns of the answer by name, for records (n, cycles), shorter ones ending in NaN.

    Parameters
    ----------
    exact, doubtful
        Classifiers of the nature, and of whether a sensor sees the record as irregular.
    peaks, sensor_error
        Peak forces [N] and the largest error of each record's [N], if it is known.
    """
    forces, _, errors = as_records(peaks, None, sensor_error)
    features = response_features(None, None, forces, None, errors)
    chances, doubt = exact.chances(features), doubtful.chances(features)[:, 1]
    reason = _strange(forces)
    fit, told = reason == "", ~np.isnan(errors)
    likely = exact.classes_[chances.argmax(axis=1)]
    nature = _where(fit & (chances.max(axis=1) >= CLEAR), likely)
    irregular = _where(fit & told & (np.maximum(doubt, 1.0 - doubt) >= CLEAR), doubt > 0.5)
    amplitude = record_amplitude(forces)
    silent = np.array([one is None and other is None for one, other in zip(nature, irregular, strict=True)], bool)
    return {
        "irregular": irregular,
        "irregular_probability": _where(fit & told, doubt),
        "amplitude": _where(fit, amplitude),
        "nature": nature,
        **{f"probability_{name}": chances[:, place] for place, name in enumerate(exact.classes_)},
        "period": _periods(forces, nature, irregular),
        "plausible": _plausible(exact, chances),
        "abstained": silent,
        "reason": np.where(silent & fit, "too close to call", reason),
        "warning": _warnings(forces, (likely == "periodic") & fit & (amplitude > errors), errors),
    }


def _strange(forces: Array) -> NDArray[Any]:
    """Why each record (n,) can't be judged; empty if it can."""
    largest = np.nanmax(forces, axis=1)
    units = [f"peaks of {peak:.3g} N: wrong units suspected; forces are expected in newton" for peak in largest]
    reasons = np.where(largest > MAX_PLAUSIBLE, units, "")
    return np.where(largest == 0.0, "all peaks are zero: there is no contact to judge", reasons).astype(object)


def _where(keep: NDArray[np.bool_], values: NDArray[Any]) -> NDArray[Any]:
    """Values (n,) where they are kept, None elsewhere."""
    out = values.astype(object)
    out[~keep] = None
    return out


def _periods(forces: Array, nature: NDArray[Any], irregular: NDArray[Any]) -> NDArray[Any]:
    """Period of each record (n,) that repeats, to the sensor or exactly; None of the others."""
    found = np.full(len(forces), None, dtype=object)
    for row, (exact, seen) in enumerate(zip(nature, irregular, strict=True)):
        if seen is False or (seen is None and exact == "periodic"):
            found[row] = repeat_period(forces[row])
    return found


def _plausible(model: ResponseClassifier, chances: Array) -> NDArray[Any]:
    sets = np.empty(len(chances), dtype=object)
    for row, shares in enumerate(chances):
        sets[row] = tuple(str(name) for name in model.classes_[shares >= model.plausible_])
    return sets


def _warnings(forces: Array, suspects: NDArray[np.bool_], errors: Array) -> NDArray[Any]:
    """What each record (n,) contradicts, among the suspects: it repeats, but scatters more than its sensor may."""
    texts = np.full(len(forces), "", dtype=object)
    for row in np.flatnonzero(suspects):
        size = least_scatter(forces[row])
        if size > errors[row]:
            texts[row] = (
                f"the record repeats, but scatters by {size:.3g} N or more: beyond the stated sensor error of "
                f"{errors[row]:.3g} N"
            )
    return texts
