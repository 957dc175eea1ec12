r"""Scatter of the sensor, of the process or of chaos: what readings do about their repetition, and the verdict on it.

Scatter has three causes, and its size tells none of them: the sensor, a process that is random (load, supply, speed),
deterministic chaos. Chaos is claimed only where ``determinism`` finds a map that makes the irregularity without noise,
a torus where a few lines of the spectrum are all. A pattern that stands out of noise is periodic if its scatter is
random, which the verdict says: small chaos around a pattern may look the same. What is left is undetermined, and the
verdict says what would tell.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import repeat

import numpy as np

from chaosgym.arrays import Array
from chaosgym.recordings.fixed_motion import (
    MOST_READINGS,
    REPEATED,
    THRICE,
    Line,
    is_random,
    line_of,
    long_pattern,
    pattern_variances,
    without_trend,
)
from chaosgym.recordings.measured_verdict import MeasuredVerdict
from chaosgym.series.determinism import DRIVEN, LEAST_GAIN, Determinism, beats_surrogates, determinism, drive
from chaosgym.series.noise import (
    RANDOM,
    REPEATS,
    SensorError,
    class_residual,
    correlation,
    dominant_period,
    predictability,
    without_drift,
)
from chaosgym.series.spectrum import without_lines
from chaosgym.series.two_step import CHAOTIC_CYCLES, MAX_LINES, QUASIPERIODIC_CYCLES
from chaosgym.series.verdict import Diagnosis, undetermined

SMALL_SCATTER, LARGE_SCATTER = 0.015, 0.08
"""Standard deviations, as shares of the mean force. Scatter around one level above the first is told from chaos only by
the sensor's error; below it a periodic response is told if the scatter is random, since three in four surfaces of
chaotic cranks scatter by more. A stated error above the second hides what would matter."""

PATTERN, LONGEST_PATTERN, SEEN = 2.0, 32, 12
"""Standard deviation of a pattern in those of the scatter around it, its longest period, and how often it is seen."""

WITHIN = 1.02
"""Factor by which a reading may exceed the stated largest error; more where a trend was taken out, for it is unsure."""

LONG_PATTERN = 3.0
"""Standard deviation of readings in those of what a pattern leaves that is seen three to eleven times."""

NOISE_SHARE = 0.5
"""Share of the scatter that a forecast must leave where noise alone keeps a resting map apart."""

ONE_LINE, LONE_LINE_PERIOD = 0.9, 5
"""Share of the variance in one line of the spectrum from which it may be a hum of the mains, and by what factor a
pattern must be longer than another for it."""

LINE_GAIN = 1.1
"""Factor by which the variance around a pattern must exceed what a line leaves, which has fewer parameters."""

FEW_LINES, LINES_REST = 2, 1.2
"""Sinusoids that may explain the readings as well as a map, and the factor by which they, and every pattern that is
seen thrice, must leave more than it."""

TORUS_REST, HUMMED_PATTERN = 0.3, 16
"""Share of its standard deviation that the lines of a torus may leave, and the longest pattern under a hum: longer ones
come near to any torus."""

ENOUGH_CYCLES = 100
"""Cycles from which small random scatter is told from chaos without a stated error."""

FEW_CYCLES, MORE_CYCLES = 200, 1000
"""Cycles below which more of them would tell more of scatter that looks random, and of a map that is not sure."""

SENSOR_LIKE = 0.03
"""Scatter, as a share of the mean reading, that may be all a sensor's."""


@dataclass(frozen=True)
class Scatter:
    """What the readings of a stretch do about their repetition.

    ``readings`` are less their drift and the trend of their pattern, ``level`` less their drift only.
    """

    readings: Array
    level: Array
    period: int
    drift: float
    growth: float
    sigma: float
    mean: float
    forecast: float

    @property
    def relative(self) -> float:
        """Standard deviation as a share of the mean reading."""
        return self.sigma / self.mean if self.mean else 0.0

    @property
    def residual(self) -> Array:
        """Readings less their pattern, (cycles,)."""
        return class_residual(self.readings, self.period)

    @property
    def random(self) -> bool:
        """Whether a reading can't be told from those before it."""
        return self.forecast < RANDOM

    @property
    def has_pattern(self) -> bool:
        """Whether a period above one stands out of the scatter, and is the same in both halves."""
        size, k = len(self.readings), self.period
        often = k <= LONGEST_PATTERN and size >= SEEN * k
        if k == 1 or not (often or self._has_long_pattern):
            return False
        half = size // (2 * k) * k
        halves = [part.reshape(-1, k).mean(axis=0) for part in (self.readings[:half], self.readings[half : 2 * half])]
        patterns = [pattern - pattern.mean() for pattern in halves]
        if may_be_hum(patterns[0] + patterns[1]):
            return False
        stands_out = min(float(np.std(pattern)) for pattern in patterns) >= PATTERN * self.sigma
        apart = max(0.5, 4.0 * math.sqrt(2.0 * k / half)) * self.sigma
        return stands_out and float(np.max(np.abs(patterns[0] - patterns[1]))) < apart

    @property
    def _has_long_pattern(self) -> bool:
        """Whether a pattern that is seen a few times forecasts many cycles, to a third of its standard deviation."""
        size, k = len(self.readings), self.period
        return (
            self.random
            and size >= max(THRICE * k, k + REPEATED)
            and float(np.std(self.readings)) > LONG_PATTERN * self.sigma
        )

    def evidence(self) -> dict[str, float]:
        """Figures for JSON."""
        return {"scatter_sigma": self.sigma, "scatter_share": self.relative, "predictability": self.forecast}


def may_be_hum(pattern: Array) -> bool:
    """Whether a pattern is as well a shorter one, at most a fifth as long, with one line of the spectrum on it."""
    power = np.abs(np.fft.rfft(pattern)) ** 2
    size, line = len(pattern), np.arange(len(power))
    for short in range(1, size // LONE_LINE_PERIOD + 1):
        rest = power[line % (size // short) != 0] if size % short == 0 else np.zeros(1)
        if float(rest.max()) > ONE_LINE * float(rest.sum()):
            return True
    return False


def scatter_of(readings: Array, floor: float) -> Scatter:
    """Scatter of readings around their own repetition; differences below ``floor`` do not count."""
    size = len(readings)
    level, drift = without_drift(readings, dominant_period(readings, floor))
    longest = max(1, size // REPEATS)
    variances = pattern_variances(level, min(64, longest))
    allowed = variances.min() * (1.0 + 3.0 * math.sqrt(2.0 / size)) + floor**2
    period = int(np.flatnonzero(variances <= allowed)[0]) + 1
    period = long_pattern(level, float(variances[period - 1]), floor) or period
    steady, growth = without_trend(level, period)
    residual = class_residual(steady, period)
    sigma = math.sqrt(float(np.sum(residual**2)) / (size - period))
    again = period if size >= SEEN * period else 1  # readings of a phase seen a few times are less their own mean
    forecast = max(predictability(steady, residual), correlation(residual, again))
    return Scatter(steady, level, period, drift, growth, sigma, float(np.mean(np.abs(readings))), forecast)


def left_by_hum(readings: Array) -> float:
    """Standard deviation that a pattern of 1 to 16 cycles and one sinusoid leave at least."""
    patterns = range(1, min(HUMMED_PATTERN, len(readings) // SEEN) + 1)
    residuals = (class_residual(readings, period) for period in patterns)
    return min(float(np.std(without_lines(residual, 1, 0.0)[0])) for residual in residuals)


def judge_scatter(found: Scatter, told: SensorError | None, resolved: float) -> MeasuredVerdict:
    """Verdict on readings that do not repeat exactly; ``resolved`` is the half width of a reading's own step."""
    verdict = _judge(found, told, resolved)
    if verdict.scatter is None:
        verdict = replace(verdict, scatter=found.sigma, coefficient_of_variation=found.relative)
    return verdict


def _judge(found: Scatter, told: SensorError | None, resolved: float) -> MeasuredVerdict:
    if np.max(np.abs(found.residual)) <= 2.0 * resolved:
        step = told or SensorError(resolved, resolved / math.sqrt(3.0), "estimated")
        return _periodic(found, f"within {newton(2.0 * resolved)}, the step of the record", step)
    most = None if told is None else _most(found, told, resolved)
    line = None if found.random and found.period == 1 else line_of(found.level)
    if line is not None and _better(line, found):
        several = _torus_of(found, told, most, resolved) if len(found.readings) >= QUASIPERIODIC_CYCLES else None
        return several or _on_line(found, line, told, most)
    if most is not None and found.sigma <= most:
        assert told is not None
        return _within_error(found, told, resolved)
    torus = _torus_of(found, told, most, resolved)
    if torus is not None:
        return torus
    if len(found.readings) < CHAOTIC_CYCLES:
        return _open(
            found,
            f"{_beyond(found, told)}: {len(found.readings)} cycles are too few to tell why",
            told,
            ["more cycles"],
        )
    fitted = determinism(found.readings)
    if is_chaotic([found], fitted):
        return chaotic([found], fitted, told)
    return _random(found, fitted, told) or _resting(found, fitted, told) or _cannot_tell(found, fitted, told)


def _better(line: Line, found: Scatter) -> bool:
    """Whether a line leaves less than the pattern, which may be its own that nearly repeats."""
    own = may_be_hum(found.readings[: found.period] - found.residual[: found.period])
    return own or LINE_GAIN * line.rest**2 < found.sigma**2


def _on_line(found: Scatter, line: Line, told: SensorError | None, most: float | None) -> MeasuredVerdict:
    """Verdict on one line: hum, modulation of the load or beat, or the machine's own, which a record does not tell.

    A small sinusoid is taken for the former, a large one or one with multiples for the latter; the condition says so.
    """
    size, held = len(found.level), line.share * float(np.var(found.level))
    pattern, own = f"periodic, period {line.period}", not line.pure or held > (LARGE_SCATTER * found.mean) ** 2
    turns = f"its line of period {line.cycles:.4g} cycles"
    condition = (
        f"if {turns} is the machine's own, else {pattern}" if own else f"if {turns} is from outside, else quasiperiodic"
    )
    if most is None or line.rest > most:
        condition += f", and if its scatter of {100.0 * line.rest / found.mean:.2g} % is random"
    beneath = "one level" if line.period == 1 else f"a pattern of {line.period} cycles"
    diagnosis = Diagnosis(
        nature="quasiperiodic" if own else "periodic",
        period=None if own else line.period,
        margin=float(np.clip(1.0 - line.rest**2 / max(found.sigma**2, 1e-300), 0.0, 1.0)),
        reason=f"one line of the spectrum on {beneath} leaves {newton(line.rest)} (standard deviation)",
        horizon=size,
        evidence={"cycles": size, **found.evidence(), "line_cycles": line.cycles, "line_share": line.share},
        condition=condition,
    )
    error = told or SensorError(3.0 * line.rest, line.rest, "estimated")
    share = line.rest / found.mean if found.mean else 0.0
    return MeasuredVerdict(diagnosis, error, scatter=line.rest, coefficient_of_variation=share, random=not own)


def _torus_of(found: Scatter, told: SensorError | None, most: float | None, resolved: float) -> MeasuredVerdict | None:
    return _torus(found, max(SMALL_SCATTER * found.mean, resolved) if most is None else most, told)


def _most(found: Scatter, told: SensorError, resolved: float) -> float:
    """Standard deviation up to which scatter may be all the sensor's."""
    freedom = 2.0 * (len(found.readings) - found.period)
    return math.hypot(told.sigma, resolved) * (1.05 + 3.0 / math.sqrt(freedom))


def _within_error(found: Scatter, told: SensorError, resolved: float) -> MeasuredVerdict:
    """Verdict on scatter that may be all the sensor's."""
    sigma, half_width = math.hypot(told.sigma, resolved), told.half_width + resolved
    if not found.random:
        fitted = determinism(found.readings) if len(found.readings) >= CHAOTIC_CYCLES else None
        reason = f"can't tell: varies within the sensor's error of {newton(half_width)}, but not at random"
        return (_random(found, fitted, told) if fitted else None) or _open(found, reason, told)
    if found.relative > LARGE_SCATTER or (found.sigma < 0.4 * sigma and found.relative > SMALL_SCATTER):
        spread = 0.5 * float(np.ptp(found.readings))
        reason = f"can't tell: the sensor's error of {newton(half_width)} hides a spread of +-{newton(spread)}"
        return _open(found, reason, told)
    if may_be_hum(found.readings[: found.period] - found.residual[: found.period]):
        reason = f"can't tell: repeats every {found.period} cycles, or a line of the spectrum (a hum) lies on less"
        return _open(found, reason, told)
    furthest = np.abs(around_middle(found.readings, found.period))
    slack = 2.0 * math.sqrt(found.period / len(found.readings)) if found.growth or found.drift else 0.0
    outside = (
        float(np.mean(np.abs(found.residual) > half_width)) if furthest.max() > (WITHIN + slack) * half_width else 0.0
    )
    condition = ""
    if told.source == "stated sigma":
        shown = f"with a standard deviation of {newton(found.sigma)}; stated: {newton(told.sigma)}"
    elif outside:
        shown = (
            f"with a standard deviation of {newton(found.sigma)}; {100.0 * outside:.2g} % of the readings lie outside "
            f"the stated +-{newton(half_width)}, the farthest by {newton(float(furthest.max()))}"
        )
        condition = f"if the sensor errs by more than the stated {newton(half_width)}"
    else:
        shown = f"within {newton(float(np.max(np.abs(found.residual))))}; stated: {newton(half_width)}"
    verdict = _periodic(found, shown, told)
    return replace(verdict, diagnosis=replace(verdict.diagnosis, condition=condition))


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
    if not (found.has_pattern or (small and found.period == 1)):
        return None
    rests = fitted.map_rests and not _forecast_gains(found, float(fitted.nonlinear[0]), NOISE_SHARE)
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
        ),
        told,
        random=True,
    )
    return verdict


def _if_random(verdict: MeasuredVerdict, found: Scatter) -> MeasuredVerdict:
    """A periodic verdict under the condition that its scatter is no chaos, which a single record can't prove."""
    condition = f"if its scatter of {100.0 * found.relative:.2g} % is random"
    return replace(verdict, diagnosis=replace(verdict.diagnosis, condition=condition))


def _beyond(found: Scatter, told: SensorError | None) -> str:
    if told is None:
        return f"irregular, with a scatter of {newton(found.sigma)} ({100.0 * found.relative:.2g} %)"
    return f"irregular beyond {newton(told.half_width)}, the sensor's error"


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
    return _open(found, f"{_beyond(found, told)}: {why}", told, [*ask, "a second sensor", "the machine's model"])


def _open(found: Scatter, reason: str, error: SensorError | None, tells_more: Sequence[str] = ()) -> MeasuredVerdict:
    return MeasuredVerdict(undetermined(reason, found.readings, tuple(tells_more), **found.evidence()), error)


def is_chaotic(several: Sequence[Scatter], fitted: Determinism) -> bool:
    """Whether maps of the sensors are chaotic, better than fixed patterns and random surrogates, and driven by no line.

    What is asked of one sensor is asked of each of ``several``.
    """
    ordered = [several[place] for place in fitted.order]
    if not (fitted.map_is_chaotic and all(map(_forecast_gains, ordered, fitted.nonlinear, repeat(LEAST_GAIN)))):
        return False
    for found, nonlinear in zip(ordered, fitted.nonlinear, strict=True):
        least = min(float(np.std(without_lines(found.readings, FEW_LINES, 0.0)[0])), left_by_hum(found.readings))
        pattern = pattern_variances(found.readings[-MOST_READINGS:], min(len(found.readings), MOST_READINGS) // THRICE)
        fixed_explains = min(least**2, float(pattern.min())) < LINES_REST * nonlinear * float(np.var(found.readings))
        if fixed_explains or drive(found.readings)[0] <= DRIVEN:
            return False
    return beats_surrogates(np.column_stack([found.readings for found in several]), fitted)


def _forecast_gains(found: Scatter, nonlinear: float, least: float) -> bool:
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
    beyond = _beyond(found, told)
    if len(several) > 1:
        made = f"maps of {last} readings of {' and '.join(names)} together forecast"
        beyond = "irregular"
    reason = (
        f"{beyond}: {made} all but {_percents(fitted.nonlinear)} % of the variance (linear: all but "
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


def _torus(found: Scatter, most: float, told: SensorError | None) -> MeasuredVerdict | None:
    """Quasiperiodic, if a few lines leave no more than the sensor's error; None if they leave more, or for one line.

    One line alone, or on a pattern, is as well a hum of the mains or a modulation of the load.
    """
    size = len(found.readings)
    if size < QUASIPERIODIC_CYCLES:
        return _two_lines(found, most, told)
    if found.forecast < 2.0 * RANDOM or found.relative < SMALL_SCATTER:
        return None
    rest, lines = without_lines(found.readings, MAX_LINES, 0.5 * most if told is None else most)
    sigma = float(np.std(rest))
    if sigma > min(most, TORUS_REST * float(np.std(found.readings))) or correlation(rest) > 2.0 * RANDOM or lines < 2:
        return None
    if left_by_hum(found.readings) < LINES_REST * sigma:
        return None
    reason = f"does not repeat; {lines} lines of the spectrum leave {newton(sigma)}, no more than the sensor's error"
    evidence = {"cycles": size, **found.evidence(), "spectral_lines": lines}
    diagnosis = Diagnosis(
        nature="quasiperiodic", margin=1.0 - sigma / most, reason=reason, horizon=size, evidence=evidence
    )
    return MeasuredVerdict(diagnosis, told or SensorError(3.0 * sigma, sigma, "estimated"))


def _two_lines(found: Scatter, most: float, told: SensorError | None) -> MeasuredVerdict | None:
    """Quasiperiodic under a condition: in a short record two lines leave nothing but small random scatter."""
    size = len(found.readings)
    if size < ENOUGH_CYCLES or found.forecast < 2.0 * RANDOM:
        return None
    if is_random(without_lines(found.level, 1, 0.0)[0]):
        return None
    rest, _ = without_lines(found.level, FEW_LINES, 0.0)
    sigma = float(np.std(rest))
    if sigma > min(most, TORUS_REST * float(np.std(found.level))) or not is_random(rest):
        return None
    diagnosis = Diagnosis(
        nature="quasiperiodic",
        margin=1.0 - sigma / most,
        reason=f"two lines of the spectrum leave {newton(sigma)} (standard deviation), at random",
        horizon=size,
        evidence={"cycles": size, **found.evidence(), "spectral_lines": FEW_LINES},
        condition=f"if its two lines in {size} cycles are the machine's own",
    )
    return MeasuredVerdict(diagnosis, told or SensorError(3.0 * sigma, sigma, "estimated"), scatter=sigma)


def newton(force: float) -> str:
    """Force for people."""
    return f"{force:.3g} N"
