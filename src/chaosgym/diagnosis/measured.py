r"""Which nature has a measured record? One answer from peaks and the sensor's error, or an honest "can't tell".

1. Single wrong readings are replaced and missing cycles filled in; both are reported.
2. A record of two regimes is cut, and each part judged; chaos in one part counts, as in the Two-Step Test.
3. What repeats exactly is periodic. What scatters is compared with the stated error. Without one the scatter itself is
   judged: a sensor's is random from cycle to cycle and small, chaos can be forecast from what came before.
4. What is irregular beyond the error goes to step II of the Two-Step Test: chaotic, quasiperiodic or undetermined.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.diagnosis.response import Diagnosis
from chaosgym.diagnosis.two_step import INITIAL_TRANSIENT, MAX_LINES, QUASIPERIODIC_CYCLES, two_step_test
from chaosgym.errors import DiagnosisError
from chaosgym.signals.changes import find_change
from chaosgym.signals.lines import without_lines
from chaosgym.signals.noise import (
    REPEATS,
    SensorError,
    class_residual,
    correlation,
    dominant_period,
    nonlinear_part,
    predictability,
    quantum,
    repair,
    stated_error,
    without_drift,
)

Array = NDArray[np.float64]

FEWEST_CYCLES, SHORT_RECORD = 8, 16
"""Cycles below which a record is refused, and below which nothing is told of it."""

LARGEST_FORCE = 1e9
"""Force [N] beyond which a unit must be wrong."""

RANDOM = 3.6
"""Predictability below which a scatter may be a sensor's."""

SMALL_SCATTER, LARGE_SCATTER = 0.015, 0.08
"""Standard deviations, as shares of the mean force: random scatter below the first is a sensor's without being stated;
a stated error above the second hides what would matter."""

TORUS_REST = 0.3
"""Share of its standard deviation that the lines of a torus may leave."""

ENOUGH_CYCLES = 100
"""Cycles from which random scatter can be told from chaos without a stated error."""

MOST_PARTS = 3
"""How often a record is cut in two."""


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


def judge_peaks(
    peaks: ArrayLike,
    *,
    sensor_error: float | None = None,
    sensor_sigma: float | None = None,
    resolution: float = 0.0,
) -> MeasuredVerdict:
    """Tell the nature of a measured response from one reading a cycle.

    Parameters
    ----------
    peaks : (cycles,)
        Peak force of each cycle, or any other reading once a cycle, in one unit [N].
    sensor_error
        Largest error of a reading (half width), if it is known.
    sensor_sigma
        Its standard deviation instead. Without either the error is estimated from the record.
    resolution
        Half width of what the evaluation itself adds, such as the sampling of a series.

    Raises
    ------
    DiagnosisError
        If there are fewer than 8 readings, one is not finite or beyond 1e9, or the error is none.
    """
    readings = _checked(peaks)
    told = stated_error(sensor_error, sensor_sigma)
    if not np.any(readings):
        return MeasuredVerdict(_undetermined("all peaks are zero: there is no contact to judge", readings), told)
    if len(readings) < SHORT_RECORD:
        few = f"{len(readings)} cycles are too few to judge; needed: {SHORT_RECORD} or more"
        return MeasuredVerdict(_undetermined(few, readings), told)
    whole, outliers, gaps = repair(readings)
    resolved = max(resolution, 0.5 * quantum(readings))
    parts = _parts(whole, resolved / math.sqrt(3.0) + 1e-5 * float(np.max(np.abs(whole))), MOST_PARTS)
    verdicts = [_judge_part(part, told, resolved) for part in parts]
    verdict = _joined(verdicts, [len(part) for part in parts])
    if len(parts) > 2 and verdict.diagnosis.nature == "undetermined":
        verdict = _judge_part(whole, told, resolved)
    changes = tuple(int(place) + 1 for place in np.cumsum([len(part) for part in parts])[:-1])
    notes = [*verdict.notes]
    if outliers:
        notes.insert(0, f"left out as wrong readings: cycle{'s' * (len(outliers) > 1)} {_listed(outliers)}")
    if gaps:
        notes.insert(0, f"cycles are missing before cycle {_listed(gaps)}")
    if len(changes) == 1:
        notes.insert(0, f"the response changes at cycle {changes[0]}")
    return replace(verdict, outliers=outliers, gaps=gaps, changes=changes, notes=tuple(notes))


def _checked(peaks: ArrayLike) -> Array:
    readings = np.asarray(peaks, dtype=float)
    if readings.ndim != 1:
        raise DiagnosisError(f"the record has shape {readings.shape}; allowed: (cycles,)")
    if len(readings) < FEWEST_CYCLES:
        raise DiagnosisError(f"the record has {len(readings)} cycles; allowed: {FEWEST_CYCLES} or more")
    bad = np.flatnonzero(~(np.abs(readings) <= LARGEST_FORCE))
    if len(bad):
        raise DiagnosisError(
            f"reading {readings[bad[0]]:g} in cycle {bad[0] + 1} is no force in newton; allowed: finite, up to "
            f"{LARGEST_FORCE:g} N"
        )
    return readings


def _listed(cycles: tuple[int, ...]) -> str:
    shown = ", ".join(str(cycle) for cycle in cycles[:5])
    return shown if len(cycles) <= 5 else f"{shown} and {len(cycles) - 5} more"


def _undetermined(reason: str, readings: Array, **evidence: Any) -> Diagnosis:
    return Diagnosis(
        nature="undetermined",
        period=None,
        margin=0.0,
        reason=reason,
        horizon=len(readings),
        evidence={"cycles": len(readings), **evidence},
    )


def _parts(readings: Array, floor: float, cuts: int) -> list[Array]:
    """Stretches of one regime each."""
    place = find_change(readings, floor) if cuts else None
    if place is None:
        return [readings]
    return [*_parts(readings[:place], floor, cuts - 1), *_parts(readings[place:], floor, cuts - 1)]


def _joined(verdicts: list[MeasuredVerdict], cycles: list[int]) -> MeasuredVerdict:
    """Verdict on the whole: the last regime, unless an earlier one was irregular for more than a transient."""
    last = verdicts[-1]
    if len(verdicts) == 1:
        return last
    natures = [verdict.diagnosis.nature for verdict in verdicts]
    irregular = [verdict for verdict in verdicts if verdict.diagnosis.nature in ("chaotic", "quasiperiodic")]
    horizon = sum(cycles)
    if len(verdicts) > 2 and irregular:
        reason = f"intermittent: {len(verdicts) - 1} changes between {' and '.join(dict.fromkeys(natures))} stretches"
        return replace(irregular[0], diagnosis=replace(irregular[0].diagnosis, reason=reason, horizon=horizon))
    before = [v for v, n in zip(verdicts[:-1], cycles[:-1], strict=True) if n > INITIAL_TRANSIENT]
    if last.diagnosis.nature == "periodic" and not before:
        settled = replace(last.diagnosis, settle_cycle=horizon - cycles[-1], horizon=horizon)
        return replace(last, diagnosis=settled)
    told = "; ".join(
        f"cycles {end - n + 1} to {end}: {v.diagnosis.nature}, {v.diagnosis.reason}"
        for v, n, end in zip(verdicts, cycles, np.cumsum(cycles), strict=True)
    )
    decisive = next((v for v in irregular if v in [*before, last]), last)
    if not irregular and "undetermined" in natures:
        decisive = verdicts[natures.index("undetermined")]
    return replace(decisive, diagnosis=replace(decisive.diagnosis, reason=told, horizon=horizon))


@dataclass(frozen=True)
class _Scatter:
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
        return self.sigma / self.mean if self.mean else 0.0

    @property
    def random(self) -> bool:
        return self.forecast < RANDOM

    def evidence(self) -> dict[str, float]:
        return {
            "scatter_sigma": self.sigma,
            "scatter_share": self.relative,
            "predictability": self.forecast,
            "nonlinear_predictability": self.nonlinear,
        }


def _scatter(readings: Array, floor: float) -> _Scatter:
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
    return _Scatter(level, period, drift, sigma, mean, forecast, nonlinear)


def _judge_part(readings: Array, told: SensorError | None, resolved: float) -> MeasuredVerdict:
    """Verdict on a stretch of one regime."""
    size = len(readings)
    if size < SHORT_RECORD:
        return MeasuredVerdict(_undetermined(f"{size} cycles are too few to judge", readings), told)
    found, exact = None, two_step_test(readings)
    if (exact.nature == "chaotic" and not exact.transient) or exact.nature == "undetermined":
        found = _scatter(readings, resolved / math.sqrt(3.0))
        exact = two_step_test(found.readings) if found.drift else exact
    notes = (f"drifts by {found.drift:.3g} N over the record",) if found is not None and found.drift else ()
    if found is None or exact.nature in ("periodic", "quasiperiodic"):
        told = told or SensorError(resolved, resolved / math.sqrt(3.0), "estimated")
        return MeasuredVerdict(_in_newton(exact, readings, resolved), told, notes=notes)
    judge = _with_stated if told is not None else _with_estimated
    return replace(judge(found, told, resolved), notes=notes)


def _in_newton(exact: Diagnosis, readings: Array, resolved: float) -> Diagnosis:
    """The verdict of the Two-Step Test with its residual as a force."""
    residual = exact.evidence.get("residual")
    if exact.nature != "periodic" or not isinstance(residual, float) or exact.reason.startswith("approaches"):
        return exact
    within = max(residual * float(np.max(np.abs(readings))), resolved)
    cycle = "cycle" if exact.period == 1 else f"{exact.period} cycles"
    return replace(exact, reason=f"repeats every {cycle} within {_newton(within)}")


def _periodic(found: _Scatter, within: float, why: str, error: SensorError) -> MeasuredVerdict:
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


def _open(found: _Scatter, reason: str, error: SensorError | None) -> MeasuredVerdict:
    return MeasuredVerdict(_undetermined(reason, found.readings, **found.evidence()), error)


def _with_stated(found: _Scatter, told: SensorError | None, resolved: float) -> MeasuredVerdict:
    assert told is not None
    size = len(found.readings)
    sigma = math.hypot(told.sigma, resolved)
    most = sigma * (1.05 + 3.0 / math.sqrt(2.0 * (size - found.period)))
    half_width = told.half_width + resolved
    if found.sigma > most:
        if found.random and found.sigma < 2.0 * most and found.relative < LARGE_SCATTER:
            reason = (
                f"the scatter of {_newton(found.sigma)} (standard deviation) exceeds the stated error a little and is "
                "random: a worse sensor, or the machine"
            )
            return _open(found, reason, told)
        lead = f"irregular beyond the sensor's error of {_newton(half_width)}"
        return _torus(found, most, told) or _irregular(found, half_width, lead, told)
    if not found.random:
        reason = f"can't tell: varies within the sensor's error of {_newton(half_width)}, but not at random"
        return _open(found, reason, told)
    if found.relative > LARGE_SCATTER or (found.sigma < 0.4 * sigma and found.relative > SMALL_SCATTER):
        spread = 0.5 * float(np.ptp(found.readings))
        reason = f"can't tell: the sensor's error of {_newton(half_width)} hides a spread of +-{_newton(spread)}"
        return _open(found, reason, told)
    if found.sigma < 0.4 * sigma:
        return _periodic(found, 3.0 * found.sigma, "less than the stated error", told)
    return _periodic(found, half_width, "the stated error", told)


def _with_estimated(found: _Scatter, told: SensorError | None, resolved: float) -> MeasuredVerdict:
    size = len(found.readings)
    error = SensorError(3.0 * found.sigma, found.sigma, "estimated")
    residual = class_residual(found.readings, found.period)
    if np.max(np.abs(residual)) <= 2.0 * resolved:
        return _periodic(
            found,
            2.0 * resolved,
            "the step of the record",
            SensorError(resolved, resolved / math.sqrt(3.0), "estimated"),
        )
    share = f"the scatter of {100.0 * found.relative:.2g} %"
    ask = "could be sensor or machine; state the sensor's error"
    if not found.random:
        torus = _torus(found, max(SMALL_SCATTER * found.mean, resolved), None)
        if torus is not None or found.nonlinear < RANDOM:
            return torus or _open(found, f"{share} wanders slowly, and {ask}", None)
        if _few_lines(found):
            return _open(
                found,
                f"a few lines of the spectrum and a random rest: quasiperiodic or chaotic, as {share} {ask}",
                None,
            )
        return _irregular(found, resolved, f"irregular beyond any random error: {share} can be forecast", None)
    if found.relative <= SMALL_SCATTER and (size >= ENOUGH_CYCLES or found.relative <= 0.1 * SMALL_SCATTER):
        return _periodic(
            found, 3.0 * found.sigma, "a sensor's error by its size; state the sensor's if you know it", error
        )
    return _open(found, f"{share} {ask}", None)


def _torus(found: _Scatter, most: float, told: SensorError | None) -> MeasuredVerdict | None:
    """Quasiperiodic, if a few lines leave no more than the sensor's error; None if they leave more."""
    size = len(found.readings)
    if size < QUASIPERIODIC_CYCLES or found.forecast < 2.0 * RANDOM:
        return None
    rest, lines = without_lines(found.readings, MAX_LINES, 0.5 * most if told is None else most)
    sigma = float(np.std(rest))
    if sigma > min(most, TORUS_REST * float(np.std(found.readings))) or correlation(rest) > 2.0 * RANDOM:
        return None
    reason = f"does not repeat; {lines} lines of the spectrum leave {_newton(sigma)}, no more than the sensor's error"
    evidence = {"cycles": size, **found.evidence(), "spectral_lines": lines}
    diagnosis = Diagnosis(
        nature="quasiperiodic", period=None, margin=1.0 - sigma / most, reason=reason, horizon=size, evidence=evidence
    )
    return MeasuredVerdict(diagnosis, told or SensorError(3.0 * sigma, sigma, "estimated"))


def _few_lines(found: _Scatter) -> bool:
    """Whether a few lines leave a rest that is half as large and can't be forecast, as a torus and noise do."""
    rest, _ = without_lines(found.readings, MAX_LINES // 2, 0.1 * float(np.std(found.readings)))
    smaller = float(np.std(rest)) < 0.5 * float(np.std(found.readings))
    return smaller and predictability(found.readings, rest) < RANDOM


def _irregular(found: _Scatter, beyond: float, lead: str, told: SensorError | None) -> MeasuredVerdict:
    """Chaotic, quasiperiodic or undetermined: step II for what does not repeat within the error."""
    second = two_step_test(found.readings, sensor_error=beyond)
    diagnosis = Diagnosis(
        nature=second.nature if second.nature != "periodic" else "undetermined",
        period=None,
        margin=second.margin,
        reason=f"{lead}: {second.reason}",
        horizon=len(found.readings),
        evidence={**second.evidence, **found.evidence()},
    )
    return MeasuredVerdict(diagnosis, told)


def _newton(force: float) -> str:
    return f"{force:.3g} N"
