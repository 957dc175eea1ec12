"""Verdicts on readings that a few lines of the spectrum account for: a hum, a modulation, a torus that lost cycles.

What is added from outside is a sinusoid; an oscillation of the machine's own has multiples, of which small ones are as
well those of the sensor. Which of the two a record seldom tells, so that the condition says what was taken.
"""

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.recordings.fixed_motion import Line, is_random
from chaosgym.recordings.measured_verdict import MeasuredVerdict
from chaosgym.recordings.scatter import HUMMED_PATTERN, Scatter, left_by_hum, newton
from chaosgym.series.noise import FEW_OUTLIERS, RANDOM, SensorError, correlation, predictability
from chaosgym.series.slips import slips
from chaosgym.series.spectrum import without_lines
from chaosgym.series.two_step import MAX_LINES, QUASIPERIODIC_CYCLES
from chaosgym.series.verdict import Diagnosis, undetermined

SMALL_SCATTER, LARGE_SCATTER = 0.015, 0.08
"""Standard deviations, as shares of the mean force. Scatter around one level above the first is told from chaos only by
the sensor's error; below it a periodic response is told if the scatter is random, since three in four surfaces of
chaotic cranks scatter by more. A stated error above the second hides what would matter."""

LINE_GAIN = 1.1
"""Factor by which the variance around a pattern must exceed what a line leaves, which has fewer parameters."""

FEW_LINES, LINES_REST = 2, 1.2
"""Sinusoids that may explain the readings as well as a map, and the factor by which they, and every pattern that is
seen thrice, must leave more than it."""

TORUS_REST = 0.3
"""Share of its standard deviation that the lines of a torus may leave."""

SLIPPED_REST, SLIPPED_RANDOM = 0.15, 1.25
"""The same where cycles are lost, and the factor by which what is left may be less random, as a few cycles are counted
wrongly."""

FAR_LESS = 0.25
"""Share of what a chaotic map leaves below which lines make it doubtful, though what they leave is not random."""

SLIPPED_PATTERN, BESIDE = 0.7, 5.0
"""Share of the standard deviation, and factor beyond what lines leave: every pattern over the cycles must leave more
than one of these, for one that lost cycles, and chaos near it, are no torus."""

COUNTED = ("a recorder that numbers its cycles",)
"""What tells more where cycles are lost."""

ENOUGH_CYCLES = 100
"""Cycles from which small random scatter is told from chaos without a stated error."""


def better(line: Line, found: Scatter) -> bool:
    """Whether a line leaves less than the pattern, which may be its own that nearly repeats."""
    return found.may_be_hum or LINE_GAIN * line.rest**2 < found.sigma**2


def on_line(found: Scatter, line: Line, told: SensorError | None, most: float | None) -> MeasuredVerdict:
    """Verdict on one line: hum, modulation of the load or beat, or the machine's own, which a record does not tell."""
    size, held = len(found.level), line.share * float(np.var(found.level))
    large = held > (LARGE_SCATTER * found.mean) ** 2
    pattern, own = f"periodic, period {line.period}", not line.pure or (large and not line.alone)
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
        tells_more=("a record at another speed",),
    )
    error = told or SensorError(3.0 * line.rest, line.rest, "estimated")
    share = line.rest / found.mean if found.mean else 0.0
    return MeasuredVerdict(diagnosis, error, scatter=line.rest, coefficient_of_variation=share, random=not own)


def torus_of(found: Scatter, told: SensorError | None, most: float | None, resolved: float) -> MeasuredVerdict | None:
    """Verdict on a torus; without a stated error up to a small scatter."""
    return _torus(found, max(SMALL_SCATTER * found.mean, resolved) if most is None else most, told)


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
    evidence = {"cycles": size, **found.evidence(), "spectral_lines": lines, "lines_rest": sigma}
    diagnosis = Diagnosis(
        nature="quasiperiodic", margin=1.0 - sigma / most, reason=reason, horizon=size, evidence=evidence
    )
    return MeasuredVerdict(diagnosis, told or SensorError(3.0 * sigma, sigma, "estimated"))


def _two_lines(found: Scatter, most: float, told: SensorError | None) -> MeasuredVerdict | None:
    """Quasiperiodic under a condition: in a short record two lines leave nothing but small random scatter."""
    size = len(found.readings)
    if size < ENOUGH_CYCLES or found.forecast < 2.0 * RANDOM or found.has_pattern:
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
        evidence={"cycles": size, **found.evidence(), "spectral_lines": FEW_LINES, "lines_rest": sigma},
        condition=f"if its two lines in {size} cycles are the machine's own",
        tells_more=("more cycles",),
    )
    return MeasuredVerdict(diagnosis, told or SensorError(3.0 * sigma, sigma, "estimated"), scatter=sigma)


def slipped_torus(found: Scatter, told: SensorError | None, forecast: float = 0.0) -> MeasuredVerdict | None:
    """Quasiperiodic under a condition: a few lines are all, if cycles are lost or written twice; None elsewhere.

    Where a pattern that lost cycles is not excluded, or what is left is not random, the record is open if the lines
    leave less than the share ``forecast`` of the variance, which a chaotic map leaves. Readings that were taken for
    wrong ones, where a cycle is lost, may lie beside the lines.
    """
    counted = slips(found.readings)
    if counted is None:
        return None
    readings = found.readings[-len(counted.cycle) :]
    swing, sigma, near = float(np.std(readings)), float(np.std(counted.rest)), len(counted.rest)
    if near < (1.0 - FEW_OUTLIERS) * len(readings) or sigma > SLIPPED_REST * swing:
        return None
    random = max(predictability(counted.rest, counted.rest), correlation(counted.rest)) <= SLIPPED_RANDOM * RANDOM
    slipped = f"{counted.slipped} cycles that are lost or written twice"
    left = [_left_by_pattern(readings, counted.cycle, period) for period in range(1, HUMMED_PATTERN + 1)]
    competes = min(left) < min(SLIPPED_PATTERN * swing, BESIDE * sigma)
    if competes or not random:
        pattern = f" or a pattern of {int(np.argmin(left)) + 1} cycles" if competes else ""
        why = f"a map forecasts it, and so do a few lines{pattern} but for {slipped}"
        figures = {**found.evidence(), "slipped_cycles": counted.slipped}
        open_ = MeasuredVerdict(undetermined(f"can't tell: {why}", found.readings, COUNTED, **figures), told)
        return open_ if sigma**2 < (1.0 if random else FAR_LESS) * forecast * swing**2 else None
    diagnosis = Diagnosis(
        nature="quasiperiodic",
        margin=1.0 - sigma / (SLIPPED_REST * swing),
        reason=f"a few lines of the spectrum leave {newton(sigma)} (standard deviation), at random, but for {slipped}",
        horizon=len(found.readings),
        evidence={"cycles": len(found.readings), **found.evidence(), "slipped_cycles": counted.slipped},
        condition=f"if {counted.slipped} cycles are lost or written twice, and its lines are the machine's own",
        tells_more=COUNTED,
    )
    return MeasuredVerdict(diagnosis, told or SensorError(3.0 * sigma, sigma, "estimated"), scatter=sigma)


def _left_by_pattern(readings: Array, cycle: NDArray[np.int64], period: int) -> float:
    """Standard deviation around a pattern over cycles of which some are lost."""
    held = np.full(-(-(cycle[-1] + 1) // period) * period, np.nan)
    held[cycle] = readings
    phases = held.reshape(-1, period)
    return float(np.nanstd(phases - np.nanmean(phases, axis=0)))
