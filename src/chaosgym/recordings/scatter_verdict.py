r"""Scatter of the sensor, of the process or of chaos: what readings do about their repetition, and the verdict on it.

Scatter has three causes, and its size tells none of them: the sensor, a process that is random (load, supply, speed),
deterministic chaos. Chaos is claimed only where ``determinism`` finds a map that makes the irregularity without noise,
a torus where a few lines of the spectrum are all. A pattern that stands out of noise is periodic if its scatter is
random, which the verdict says: small chaos around a pattern may look the same. What is left is undetermined, and the
verdict says what would tell.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from chaosgym.arrays import Array
from chaosgym.recordings.chaos import beyond, chaotic, forecast_gains, is_chaotic
from chaosgym.recordings.few_lines import (
    ENOUGH_CYCLES,
    LARGE_SCATTER,
    SMALL_SCATTER,
    better,
    on_line,
    slipped_torus,
    torus_of,
)
from chaosgym.recordings.fixed_motion import line_of
from chaosgym.recordings.measured_verdict import MeasuredVerdict
from chaosgym.recordings.scatter import Scatter, newton
from chaosgym.series.determinism import LEAST_GAIN, Determinism, beats_surrogates, determinism
from chaosgym.series.noise import RANDOM, SensorError
from chaosgym.series.transient_chaos import CHAOTIC_CYCLES
from chaosgym.series.two_step import QUASIPERIODIC_CYCLES
from chaosgym.series.verdict import Diagnosis, undetermined

SLIPPED_CYCLES = 400
"""Cycles from which lost ones are looked for where no map is chaotic: in fewer a line whose phase jumps looks alike."""

WITHIN = 1.02
"""Factor by which a reading may exceed the stated largest error; more where a trend was taken out, for it is unsure."""

NOISE_SHARE = 0.5
"""Share of the scatter that a forecast must leave where noise alone keeps a resting map apart."""

FEW_CYCLES, MORE_CYCLES = 200, 1000
"""Cycles below which more of them would tell more of scatter that looks random, and of a map that is not sure."""

FINER = ("readings in finer steps or a faster sampling",)
"""What tells more where the step of the readings hides what they do."""

APART_FROM_NOISE = ("a second sensor", "the machine's model")
"""What tells noise of the process from chaos."""

SENSOR_LIKE = 0.03
"""Scatter, as a share of the mean reading, that may be all a sensor's."""


def judge_scatter(found: Scatter, told: SensorError | None, resolved: float) -> MeasuredVerdict:
    """Verdict on readings that do not repeat exactly; ``resolved`` is the half width of a reading's own step."""
    verdict = _judge(found, told, resolved)
    if verdict.scatter is None:
        verdict = replace(verdict, scatter=found.sigma, coefficient_of_variation=found.relative)
    return verdict


def _judge(found: Scatter, told: SensorError | None, resolved: float) -> MeasuredVerdict:
    if not np.any(found.residual):
        exact = told or SensorError(resolved, resolved / math.sqrt(3.0), "estimated")
        return _periodic(found, f"within {newton(resolved)}, half the step of the record", exact)
    most = None if told is None else _most(found, told, resolved)
    line = None if found.random and found.period == 1 else line_of(found.level)
    if line is not None and better(line, found):
        several = torus_of(found, told, most, resolved) if len(found.readings) >= QUASIPERIODIC_CYCLES else None
        return _resolved(several, found, told, resolved) or on_line(found, line, told, most)
    if told is not None and most is not None and found.sigma <= most:
        return _within_error(found, told, resolved)
    if np.max(np.abs(found.residual)) <= 2.0 * resolved:
        return _within_step(found, told, resolved)
    torus = _resolved(torus_of(found, told, most, resolved), found, told, resolved)
    if torus is not None:
        return torus
    if len(found.readings) < CHAOTIC_CYCLES:
        return _open(
            found,
            f"{beyond(found, told)}: {len(found.readings)} cycles are too few to tell why",
            told,
            ["more cycles"],
        )
    fitted = determinism(found.readings)
    if is_chaotic([found], fitted):
        return slipped_torus(found, told, float(fitted.nonlinear[0])) or chaotic([found], fitted, told)
    decided = _random(found, fitted, told) or _resting(found, fitted, told)
    slipped = slipped_torus(found, told) if decided is None and len(found.readings) >= SLIPPED_CYCLES else None
    return decided or slipped or _cannot_tell(found, fitted, told)


def _most(found: Scatter, told: SensorError, resolved: float) -> float:
    """Standard deviation up to which scatter may be all the sensor's."""
    freedom = 2.0 * (len(found.readings) - found.period)
    return math.hypot(told.sigma, resolved) * (1.05 + 3.0 / math.sqrt(freedom))


def _stated(told: SensorError, resolved: float) -> str:
    """The sensor's error, and beside it what a reading is resolved to where that counts."""
    own = newton(told.half_width)
    if resolved <= 0.01 * told.half_width:
        return own
    return f"{own}, and the {newton(resolved)} to which readings are resolved"


def _resolved(
    verdict: MeasuredVerdict | None, found: Scatter, told: SensorError | None, resolved: float
) -> MeasuredVerdict | None:
    """The verdict on a torus; under a condition where its lines leave more than the stated error alone."""
    if verdict is None or told is None or verdict.diagnosis.evidence["lines_rest"] <= _most(found, told, 0.0):
        return verdict
    condition = " and ".join(filter(None, (verdict.diagnosis.condition, _if_resolved(told, resolved))))
    return replace(verdict, diagnosis=replace(verdict.diagnosis, condition=condition))


def _if_resolved(told: SensorError, resolved: float) -> str:
    """The condition that what exceeds the stated error comes of the step of the readings."""
    return f"if the step of the readings adds {newton(resolved)} to the stated {newton(told.half_width)}"


def _within_error(found: Scatter, told: SensorError, resolved: float) -> MeasuredVerdict:
    """Verdict on scatter that may be all the sensor's, or the step's by which its readings are resolved."""
    sigma, half_width = math.hypot(told.sigma, resolved), told.half_width + resolved
    if not found.random:
        reason = f"can't tell: varies within the sensor's error of {_stated(told, resolved)}, but not at random"
        return _correlated(found, told, reason)
    if found.relative > LARGE_SCATTER or (found.sigma < 0.4 * sigma and found.relative > SMALL_SCATTER):
        spread = 0.5 * float(np.ptp(found.readings))
        reason = f"can't tell: the sensor's error of {_stated(told, resolved)} hides a spread of +-{newton(spread)}"
        return _open(found, reason, told)
    if found.may_be_hum:
        reason = f"can't tell: repeats every {found.period} cycles, or a line of the spectrum (a hum) lies on less"
        return _open(found, reason, told)
    furthest = float(np.abs(around_middle(found.readings, found.period)).max())
    slack = WITHIN + (2.0 * math.sqrt(found.period / len(found.readings)) if found.growth or found.drift else 0.0)
    normal = told.source == "stated sigma"
    own = found.sigma <= _most(found, told, 0.0) and (normal or furthest <= slack * told.half_width)
    condition = "" if own else _if_resolved(told, resolved)
    if normal:
        shown = f"with a standard deviation of {newton(found.sigma)}; stated: {newton(told.sigma)}"
    elif furthest > slack * half_width:
        outside = float(np.mean(np.abs(found.residual) > half_width))
        shown = (
            f"with a standard deviation of {newton(found.sigma)}; {100.0 * outside:.2g} % of the readings lie outside "
            f"the stated +-{_stated(told, resolved)}, the farthest by {newton(furthest)}"
        )
        condition = f"if the sensor errs by more than the stated {newton(told.half_width)}" if outside else condition
    else:
        shown = f"within {newton(float(np.max(np.abs(found.residual))))}; stated: {_stated(told, resolved)}"
    verdict = _periodic(found, shown, told)
    return replace(verdict, diagnosis=replace(verdict.diagnosis, condition=condition))


def _within_step(found: Scatter, told: SensorError | None, resolved: float) -> MeasuredVerdict:
    """Verdict on scatter within the step by which readings are resolved: it is no chaos only if it is random."""
    within = f"within {newton(2.0 * resolved)}, the step of the record"
    if not found.random:
        return _correlated(found, told, f"can't tell: varies {within}, but not at random", FINER)
    step = told or SensorError(resolved, resolved / math.sqrt(3.0), "estimated")
    return _if_random(_periodic(found, within, step, random=True), found, FINER)


def _correlated(
    found: Scatter, told: SensorError | None, reason: str, tells_more: Sequence[str] = ()
) -> MeasuredVerdict:
    """Periodic if its correlated scatter is random, else undetermined: what may be the sensor's is not called chaos."""
    fitted = determinism(found.readings) if len(found.readings) >= CHAOTIC_CYCLES else None
    return (_random(found, fitted, told) if fitted else None) or _open(found, reason, told, tells_more)


def around_middle(values: Array, period: int) -> Array:
    """Readings less the middle between the least and the largest of the same phase, (cycles,).

    All lie within the largest error of a sensor if any level of the phase has them within it.
    """
    phase = np.arange(len(values)) % period
    middle = [
        0.5 * (float(np.min(values[first::period])) + float(np.max(values[first::period]))) for first in range(period)
    ]
    return np.asarray(values - np.array(middle)[phase])


def _periodic(found: Scatter, how: str, error: SensorError | None, *, random: bool = False) -> MeasuredVerdict:
    cycle = "cycle" if found.period == 1 else f"{found.period} cycles"
    return MeasuredVerdict(
        Diagnosis(
            nature="periodic",
            period=found.period,
            margin=float(np.clip(1.0 - found.forecast / RANDOM, 0.0, 1.0)),
            reason=f"repeats every {cycle} {how}",
            horizon=len(found.readings),
            evidence={"cycles": len(found.readings), **found.evidence()},
        ),
        error,
        random=random,
    )


def _random(found: Scatter, fitted: Determinism, told: SensorError | None) -> MeasuredVerdict | None:
    """Periodic with random scatter: a pattern that stands out, or scatter as small as a sensor's; else None.

    The rest must be noise: the map comes to rest without it, or no nonlinear forecast of the rest beats the linear one.
    """
    size = len(found.readings)
    small = found.relative <= (SMALL_SCATTER if size >= ENOUGH_CYCLES else 0.1 * SMALL_SCATTER)
    if not (found.has_pattern or (small and (found.period == 1 or found.has_faint_pattern))):
        return None
    rests = fitted.map_rests and not forecast_gains(found, float(fitted.nonlinear[0]), NOISE_SHARE)
    if not rests and beats_surrogates(found.residual):
        return None
    kind = "random" if found.random else "random, correlated"
    how = f"with {kind} scatter of {newton(found.sigma)} (standard deviation, {100.0 * found.relative:.2g} %)"
    if told is None:
        estimate = SensorError(3.0 * found.sigma, found.sigma, "estimated")
        return _if_random(_periodic(found, f"{how}, of the sensor or the process", estimate, random=True), found)
    if found.sigma <= told.sigma:
        return _periodic(found, f"{how}, within the stated error", told, random=True)
    return _if_random(_periodic(found, f"{how}, more than the stated error", told, random=True), found)


def _resting(found: Scatter, fitted: Determinism, told: SensorError | None) -> MeasuredVerdict | None:
    """Periodic if noise in the process is all that keeps readings from it: the fitted map comes to rest on a period."""
    period = fitted.resting_period
    if period is None or not beats_surrogates(found.readings, fitted):
        return None
    left = math.sqrt(float(fitted.nonlinear[0])) * float(np.std(found.readings))
    verdict = MeasuredVerdict(
        Diagnosis(
            nature="periodic",
            period=period,
            margin=float(np.clip(1.0 - np.exp(np.quantile(fitted.exponents, 0.9)), 0.0, 1.0)),
            reason=f"a map of the last {fitted.dimension} readings comes to rest on period {period} without noise; "
            f"its forecasts leave {newton(left)} (standard deviation)",
            horizon=len(found.readings),
            evidence={"cycles": len(found.readings), **found.evidence(), "map_period": period},
            condition=f"if the {100.0 * left / found.mean:.2g} % that a map leaves is random",
            tells_more=APART_FROM_NOISE,
        ),
        told,
        random=True,
    )
    return verdict


def _if_random(verdict: MeasuredVerdict, found: Scatter, asked: tuple[str, ...] = ()) -> MeasuredVerdict:
    """A periodic verdict under the condition that its scatter is no chaos, which a single record can't prove."""
    condition = f"if its scatter of {100.0 * found.relative:.2g} % is random"
    asked = asked or (
        APART_FROM_NOISE
        if verdict.error is not None and verdict.error.source != "estimated"
        else ("the sensor's error",)
    )
    return replace(verdict, diagnosis=replace(verdict.diagnosis, condition=condition, tells_more=asked))


def _cannot_tell(found: Scatter, fitted: Determinism, told: SensorError | None) -> MeasuredVerdict:
    """Undetermined: why, and what would help with this record."""
    small, short = told is None and found.relative < SENSOR_LIKE, len(found.readings)
    ask = ["the sensor's error"] if small else []
    curved = bool(fitted.nonlinear[0] < LEAST_GAIN * fitted.linear[0])
    if curved:
        why = "a map forecasts it in part, and neither chaos nor rest of the map is sure"
        ask += ["more cycles"] if short < MORE_CYCLES else []
    elif found.random:
        why = "no reading can be forecast from those before, by which noise and fast chaos look alike"
        ask += ["more cycles"] if short < FEW_CYCLES else []
    else:
        why = "its readings are correlated, as those of noise are, and no map forecasts them better than a line"
        ask += ["a record of load, supply or speed beside it"]
    return _open(found, f"{beyond(found, told)}: {why}", told, [*ask, *APART_FROM_NOISE])


def _open(found: Scatter, reason: str, error: SensorError | None, tells_more: Sequence[str] = ()) -> MeasuredVerdict:
    return MeasuredVerdict(undetermined(reason, found.readings, tuple(tells_more), **found.evidence()), error)
