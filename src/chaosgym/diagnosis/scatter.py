r"""Scatter of the sensor or of the machine: what readings do about their repetition, and the verdict on it.

With a stated error, what exceeds it is the machine's. Without one the scatter itself is judged: a sensor's is random
from cycle to cycle and small, chaos can be forecast from what came before, a torus is a few lines of the spectrum.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.diagnosis.response import Diagnosis
from chaosgym.diagnosis.two_step import MAX_LINES, QUASIPERIODIC_CYCLES, two_step_test
from chaosgym.signals.noise import (
    REPEATS,
    SensorError,
    class_residual,
    correlation,
    dominant_period,
    local_scatter,
    nonlinear_part,
    predictability,
    without_drift,
)

Array = NDArray[np.float64]

PADDED = 16
"""Length of the transform, in lengths of the record."""

STEPS = 4
"""Gauss-Newton steps on the frequencies after each line."""


def without_lines(values: Array, most: int, enough: float) -> tuple[Array, int]:
    """Readings less a sum of sinusoids, and how many.

    Parameters
    ----------
    values : (cycles,)
        Readings.
    most
        Largest number of sinusoids.
    enough
        Standard deviation of the rest at which no further one is looked for.
    """
    size = len(values)
    time = np.arange(size) - 0.5 * (size - 1)
    window = np.hanning(size)
    rest: Array = values - values.mean()
    frequencies: Array = np.empty(0)
    while len(frequencies) < most and np.std(rest) > enough:
        power = np.abs(np.fft.rfft(rest * window, PADDED * size))
        power[: 2 * PADDED] = 0.0
        frequencies = np.asarray([*frequencies, float(np.argmax(power)) / (PADDED * size)])
        for _ in range(STEPS):
            frequencies, rest = _fitted(values, time, frequencies)
    return rest, len(frequencies)


def _fitted(values: Array, time: NDArray[Any], frequencies: Array) -> tuple[Array, Array]:
    """One Gauss-Newton step on the frequencies [1/cycle], and the rest before it."""
    angle = 2.0 * np.pi * np.outer(time, frequencies)
    cosine, sine = np.cos(angle), np.sin(angle)
    design = np.column_stack([np.ones(len(time)), cosine, sine])
    weights = np.linalg.lstsq(design, values, rcond=None)[0]
    count = len(frequencies)
    slope = 2.0 * np.pi * time[:, None] * (weights[1 + count :] * cosine - weights[1 : 1 + count] * sine)
    rest = values - design @ weights
    change = np.linalg.lstsq(np.column_stack([design, slope]), rest, rcond=None)[0][1 + 2 * count :]
    return frequencies + np.clip(change, -0.5 / len(time), 0.5 / len(time)), rest


RANDOM = 3.6
"""Predictability below which a scatter may be a sensor's."""

SMALL_SCATTER, LARGE_SCATTER = 0.015, 0.08
"""Standard deviations, as shares of the mean force: random scatter below the first is a sensor's without being stated;
a stated error above the second hides what would matter."""

FEW_REPEATS = 12
"""Periods below which a lost cycle can look like chaos."""

TORUS_REST = 0.3
"""Share of its standard deviation that the lines of a torus may leave."""

ENOUGH_CYCLES = 100
"""Cycles from which random scatter can be told from chaos without a stated error."""


@dataclass(frozen=True)
class MeasuredVerdict:
    """The verdict on a measured record.

    Attributes
    ----------
    diagnosis
        Nature, period and reason; the reason says within or beyond how many newton.
    error
        Error of the sensor, stated or estimated from the record; None where it can't be estimated.
    outliers
        Cycles, from 1, whose single readings were left out.
    gaps
        Cycles, from 1, before which some are missing.
    changes
        First cycles, from 1, of a later regime.
    notes
        Sentences for people on what was left out, and on drift.
    """

    diagnosis: Diagnosis
    error: SensorError | None
    outliers: tuple[int, ...] = ()
    gaps: tuple[int, ...] = ()
    changes: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON: those of the diagnosis, and what is known of the readings."""
        error = None if self.error is None else self.error._asdict()
        own = {name: list(getattr(self, name)) for name in ("outliers", "gaps", "changes", "notes")}
        return {**self.diagnosis.as_dict(), "sensor_error": error, **own}


def undetermined(reason: str, readings: Array, **evidence: Any) -> Diagnosis:
    """Diagnosis of a record that can't be judged, and why."""
    return Diagnosis(
        nature="undetermined",
        margin=0.0,
        reason=reason,
        horizon=len(readings),
        evidence={"cycles": len(readings), **evidence},
    )


@dataclass(frozen=True)
class Scatter:
    """What the readings of a stretch do about their repetition."""

    readings: Array
    period: int
    drift: float
    sigma: float
    mean: float
    forecast: float
    nonlinear: float

    @property
    def relative(self) -> float:
        """Standard deviation as a share of the mean reading."""
        return self.sigma / self.mean if self.mean else 0.0

    @property
    def random(self) -> bool:
        """Whether a reading can't be told from those before it."""
        return self.forecast < RANDOM

    def evidence(self) -> dict[str, float]:
        """Figures for JSON."""
        return {
            "scatter_sigma": self.sigma,
            "scatter_share": self.relative,
            "predictability": self.forecast,
            "nonlinear_predictability": self.nonlinear,
        }


def scatter_of(readings: Array, floor: float) -> Scatter:
    """Scatter of readings around their own repetition; differences below ``floor`` do not count."""
    size = len(readings)
    level, drift = without_drift(readings, dominant_period(readings, floor))
    longest = max(1, size // REPEATS)
    variances = np.array([np.sum(class_residual(level, k) ** 2) / (size - k) for k in range(1, min(64, longest) + 1)])
    allowed = variances.min() * (1.0 + 3.0 * math.sqrt(2.0 / size)) + floor**2
    period = int(np.flatnonzero(variances <= allowed)[0]) + 1
    residual = class_residual(level, period)
    sigma = math.sqrt(float(variances[period - 1]))
    linear = correlation(residual, period)
    forecast = max(predictability(level, residual), linear)
    rest = nonlinear_part(residual)
    nonlinear = predictability(level[-len(rest) :], rest) if forecast >= RANDOM else 0.0
    mean = float(np.mean(np.abs(readings)))
    return Scatter(level, period, drift, sigma, mean, forecast, nonlinear)


def _periodic(found: Scatter, within: float, why: str, error: SensorError) -> MeasuredVerdict:
    cycle = "cycle" if found.period == 1 else f"{found.period} cycles"
    return MeasuredVerdict(
        Diagnosis(
            nature="periodic",
            period=found.period,
            margin=float(np.clip(1.0 - found.forecast / RANDOM, 0.0, 1.0)),
            reason=f"repeats every {cycle} within {within:.3g} N, {why}",
            horizon=len(found.readings),
            evidence={"cycles": len(found.readings), **found.evidence()},
        ),
        error,
    )


def _open(found: Scatter, reason: str, error: SensorError | None) -> MeasuredVerdict:
    return MeasuredVerdict(undetermined(reason, found.readings, **found.evidence()), error)


def judge_scatter(found: Scatter, told: SensorError | None, resolved: float) -> MeasuredVerdict:
    """Verdict on readings that do not repeat exactly; ``resolved`` is the half width of a reading's own step."""
    return _with_estimated(found, resolved) if told is None else _with_stated(found, told, resolved)


def _with_stated(found: Scatter, told: SensorError, resolved: float) -> MeasuredVerdict:
    size = len(found.readings)
    sigma = math.hypot(told.sigma, resolved)
    most = sigma * (1.05 + 3.0 / math.sqrt(2.0 * (size - found.period)))
    half_width = told.half_width + resolved
    if found.sigma > most:
        if found.random and found.sigma < 2.0 * most and found.relative < LARGE_SCATTER:
            reason = (
                f"the scatter of {newton(found.sigma)} (standard deviation) exceeds the stated error a little and is "
                "random: a worse sensor, or the machine"
            )
            return _open(found, reason, told)
        near = dominant_period(found.readings, resolved)
        if size < FEW_REPEATS * near and local_scatter(found.readings, near) <= most:
            few = f"most cycles come back after {near} others, but not all, and {size} cycles are too few to tell why"
            return _open(found, few, told)
        lead = f"irregular beyond the sensor's error of {newton(half_width)}"
        return _torus(found, most, told) or _irregular(found, half_width, lead, told)
    if not found.random:
        reason = f"can't tell: varies within the sensor's error of {newton(half_width)}, but not at random"
        return _open(found, reason, told)
    if found.relative > LARGE_SCATTER or (found.sigma < 0.4 * sigma and found.relative > SMALL_SCATTER):
        spread = 0.5 * float(np.ptp(found.readings))
        reason = f"can't tell: the sensor's error of {newton(half_width)} hides a spread of +-{newton(spread)}"
        return _open(found, reason, told)
    if found.sigma < 0.4 * sigma:
        return _periodic(found, 3.0 * found.sigma, "less than the stated error", told)
    return _periodic(found, half_width, "the stated error", told)


def _with_estimated(found: Scatter, resolved: float) -> MeasuredVerdict:
    size = len(found.readings)
    error = SensorError(3.0 * found.sigma, found.sigma, "estimated")
    residual = class_residual(found.readings, found.period)
    if np.max(np.abs(residual)) <= 2.0 * resolved:
        step = SensorError(resolved, resolved / math.sqrt(3.0), "estimated")
        return _periodic(found, 2.0 * resolved, "the step of the record", step)
    share = f"the scatter of {100.0 * found.relative:.2g} %"
    ask = "could be sensor or machine; state the sensor's error"
    if not found.random:
        torus = _torus(found, max(SMALL_SCATTER * found.mean, resolved), None)
        if torus is not None or (found.nonlinear < RANDOM and found.relative < LARGE_SCATTER):
            return torus or _open(found, f"{share} is not independent from cycle to cycle, but {ask}", None)
        if _few_lines(found):
            return _open(found, f"a few lines of the spectrum and a random rest: {share} {ask}", None)
        return _irregular(found, resolved, f"irregular beyond any random error: {share} can be forecast", None)
    if found.relative <= SMALL_SCATTER and (size >= ENOUGH_CYCLES or found.relative <= 0.1 * SMALL_SCATTER):
        return _periodic(
            found, 3.0 * found.sigma, "a sensor's error by its size; state the sensor's if you know it", error
        )
    return _open(found, f"{share} {ask}", None)


def _torus(found: Scatter, most: float, told: SensorError | None) -> MeasuredVerdict | None:
    """Quasiperiodic, if a few lines leave no more than the sensor's error; None if they leave more."""
    size = len(found.readings)
    if size < QUASIPERIODIC_CYCLES or found.forecast < 2.0 * RANDOM:
        return None
    rest, lines = without_lines(found.readings, MAX_LINES, 0.5 * most if told is None else most)
    sigma = float(np.std(rest))
    if sigma > min(most, TORUS_REST * float(np.std(found.readings))) or correlation(rest) > 2.0 * RANDOM:
        return None
    reason = f"does not repeat; {lines} lines of the spectrum leave {newton(sigma)}, no more than the sensor's error"
    evidence = {"cycles": size, **found.evidence(), "spectral_lines": lines}
    diagnosis = Diagnosis(
        nature="quasiperiodic", margin=1.0 - sigma / most, reason=reason, horizon=size, evidence=evidence
    )
    return MeasuredVerdict(diagnosis, told or SensorError(3.0 * sigma, sigma, "estimated"))


def _few_lines(found: Scatter) -> bool:
    """Whether a few lines leave a rest that is half as large and can't be forecast, as a torus and noise do."""
    rest, _ = without_lines(found.readings, MAX_LINES // 2, 0.1 * float(np.std(found.readings)))
    smaller = float(np.std(rest)) < 0.5 * float(np.std(found.readings))
    return smaller and predictability(found.readings, rest) < RANDOM


def _irregular(found: Scatter, beyond: float, lead: str, told: SensorError | None) -> MeasuredVerdict:
    """Chaotic, quasiperiodic or undetermined: step II for what does not repeat within the error."""
    second = two_step_test(found.readings, sensor_error=beyond)
    diagnosis = Diagnosis(
        nature=second.nature if second.nature != "periodic" else "undetermined",
        margin=second.margin,
        reason=f"{lead}: {second.reason}",
        horizon=len(found.readings),
        evidence={**second.evidence, **found.evidence()},
    )
    return MeasuredVerdict(diagnosis, told)


def newton(force: float) -> str:
    """Force for people."""
    return f"{force:.3g} N"
