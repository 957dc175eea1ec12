r"""The Two-Step Test (thesis 5.2.1) on one sample of the motion a cycle: periodic, quasiperiodic or chaotic?

Step I   Does the time history repeat? Then it is periodic, with the period of the recurrence. A history that
         approaches a repetition steadily is periodic too.
Step II  If not: the stroboscopic set and the spectrum. A closed curve gives a few lines and bounded 0-1 walks:
         quasiperiodic. A fractal or fuzzy set gives a broad band and diffusing walks: chaotic, unless the set itself is
         a closed curve.

The nature is that of the settled motion; chaos that died out before is counted in ``transient_chaos``. Where the
figures of step II disagree, or the record is too short for the verdict, the answer is "undetermined".
"""

import math
from dataclasses import replace
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError
from chaosgym.numbers import number, whole
from chaosgym.series.noise import RANDOM, predictability
from chaosgym.series.section_shape import Shape, section_shape
from chaosgym.series.spectrum import power_spectrum
from chaosgym.series.stroboscopic import (
    DECAY_FACTOR,
    MAX_PERIOD,
    NOISY_REPEATS,
    Decay,
    Recurrence,
    as_samples,
    find_decay,
    find_recurrence,
    scales,
    subtract_bands,
)
from chaosgym.series.transient_chaos import CHAOTIC_CYCLES, CHAOTIC_STATISTIC, INITIAL_TRANSIENT, irregular_cycles
from chaosgym.series.verdict import Diagnosis
from chaosgym.series.zero_one import zero_one_statistic

TOLERANCE = 1e-5
"""Half range, as a share of the largest modulus, within which a noise-free motion repeats."""

REGULAR_STATISTIC = 0.2
"""0-1 statistic below which a motion may be quasiperiodic."""

BROAD_FLOOR, BROAD_FLOOR_SHORT, SHORT_CYCLES = 1e-2, 0.1, 200
"""Spectral floor above which the band is broad; in records below 200 cycles lines overlap, and it must be higher."""

LINE_FLOOR, MAX_LINES = 1e-3, 16
"""Spectral floor below which there are only lines, and how many are still few."""

QUASIPERIODIC_CYCLES = 1000
"""Fewest cycles for a torus in step II."""

NOISE_ALLOWANCE = 2.0
"""How far the floor may exceed that of the stated sensor error before it counts as a band of its own."""


@runtime_checkable
class SimulatedRun(Protocol):
    """What the test reads of a simulated run, such as a ``CycleRecord``; each has a row a cycle."""

    @property
    def states(self) -> Array:
        """State at the start of each cycle, (cycles, states), less what no force depends on."""
        ...

    @property
    def displacement(self) -> Array:
        """One coordinate of it, (cycles,)."""

    @property
    def peak_force(self) -> Array:
        """Largest force of each cycle on every surface, (cycles, surfaces)."""


def two_step_test(
    x: SimulatedRun | ArrayLike,
    *,
    sensor_error: float = 0.0,
    tolerance: float = TOLERANCE,
    max_period: int = MAX_PERIOD,
    initial_transient: int = INITIAL_TRANSIENT,
    repeats_only: bool = False,
) -> Diagnosis:
    """Tell the nature of an exact series, as simulations give.

    Measured readings scatter at random too, which this test takes for chaos; ``chaosgym.judge_peaks`` tells the two
    apart. A plain series that is called chaotic and whose scatter looks random is warned of in the reason.

    Parameters
    ----------
    x
        A ``CycleRecord``, or one sample a cycle: (cycles,) or (cycles, coordinates), measured from a physical zero. A
        record is judged by its whole state and its peak forces; with a sensor error by its peak forces alone.
    sensor_error
        Largest error of a sample, in the unit of x (thesis 3.6: 3 N). Differences within it are no differences.
    tolerance
        Half range, as a share of the largest modulus, that counts as repetition on top of the sensor error.
    max_period
        Longest period looked for; it must be seen three times in the second half.
    initial_transient
        Cycles that the motion may take to come near a periodic motion; if it is chaotic for longer, that is transient
        chaos.
    repeats_only
        Leave out step II, which costs most: "undetermined" where the motion does not repeat.

    Raises
    ------
    DiagnosisError
        If the series is too short (16 cycles), holds values that are not finite, or has a wrong shape; if
        ``sensor_error`` is negative or ``tolerance`` is not positive.

    Notes
    -----
    Fails, and says so by "undetermined", on weak chaos in short records (below about 200 cycles in bands), on tori
    that nearly repeat in fewer than 1000 cycles, and where noise is larger than stated.

    Examples
    --------
    >>> n = np.arange(200)
    >>> chaosgym.two_step_test(10.0 + (n % 3)).words
    'periodic, period 3'
    >>> x = [0.3]
    >>> for _ in range(999):
    ...     x.append(4.0 * x[-1] * (1.0 - x[-1]))
    >>> chaosgym.two_step_test(x).nature
    'chaotic'
    """
    sensor_error = number("sensor_error", sensor_error, 0.0, error=DiagnosisError)
    tolerance = number("tolerance", tolerance, 0.0, 1.0, inside=True, error=DiagnosisError)
    max_period = whole("max_period", max_period, 1, error=DiagnosisError)
    initial_transient = whole("initial_transient", initial_transient, 0, error=DiagnosisError)
    samples, series = _observables(x, sensor_error)
    evidence: dict[str, Any] = {"cycles": len(samples)}
    if isinstance(x, SimulatedRun):
        evidence["contact"] = bool(np.any(x.peak_force > 0.0))
    elif not np.any(samples):
        return _undetermined(evidence, "the series is zero throughout: there is no contact to judge")
    scale = scales(samples)
    scaled = samples / scale
    allowed = tolerance + sensor_error / scale
    recurrence = _recurrence(scaled, allowed, max_period, sensor_error)
    evidence |= {"residual": recurrence.residual, "residual_allowed": float(np.max(allowed))}
    decay = find_decay(scaled, max_period) if recurrence.period is None and sensor_error == 0.0 else None
    verdict = None
    if recurrence.period is not None:
        exact = [] if sensor_error > 0.0 else series
        verdict = _repeating(scaled, exact, recurrence, evidence)
    elif decay is not None:
        verdict = _approaching(scaled, series, decay, evidence)
    if verdict is not None:
        irregular = evidence.get("irregular_cycles", 0)
        return replace(verdict, transient_chaos=irregular if irregular > initial_transient else 0)
    if repeats_only:
        return _undetermined(evidence, "does not repeat")
    section = x.states if isinstance(x, SimulatedRun) else samples
    verdict = _step_two(series, section, evidence, sensor_error)
    if verdict.nature == "chaotic" and not isinstance(x, SimulatedRun) and all(map(looks_random, series)):
        warning = "; but no reading can be forecast from those before: for measured readings use judge_peaks"
        verdict = replace(verdict, reason=verdict.reason + warning)
    longest = (len(samples) - len(samples) // 2) // NOISY_REPEATS
    if verdict.nature == "undetermined" and sensor_error > 0.0 and longest < max_period:
        hint = f"; with a sensor error {len(samples)} cycles show periods up to {max(1, longest)} only"
        return replace(verdict, reason=verdict.reason + hint)
    return verdict


def irregular_start(run: SimulatedRun, period: int) -> int:
    """Cycles of a run that nears a motion of some period for which it was irregular; see ``irregular_cycles``."""
    samples, series = _observables(run, 0.0)
    return irregular_cycles(samples / scales(samples), series, period, len(samples))


def looks_random(series: Array) -> bool:
    """Whether no reading of (cycles,) can be forecast from those before, as for the error of a sensor."""
    return predictability(series, series) < RANDOM


def _observables(x: SimulatedRun | ArrayLike, sensor_error: float) -> tuple[Array, list[Array]]:
    """Samples that must repeat (cycles, coordinates), and the series (cycles,) that step II looks at."""
    if not isinstance(x, SimulatedRun):
        samples = as_samples(x)
        return samples, [column for column in samples.T if np.ptp(column) > 0.0][:4]
    peaks = x.peak_force[:, np.max(x.peak_force, axis=0) > 0.0]
    if sensor_error > 0.0:
        if peaks.shape[1] == 0:
            raise DiagnosisError("the record has no contact, and a sensor error in newton applies to peak forces only")
        return as_samples(peaks), list(as_samples(peaks).T)
    return as_samples(np.column_stack([x.states, peaks])), [x.displacement, *peaks.T]


def _recurrence(scaled: Array, allowed: Array, max_period: int, sensor_error: float) -> Recurrence:
    """Recurrence in the last half, or in the last quarter if values are exact and it holds 32 cycles or more."""
    found = find_recurrence(scaled, allowed, max_period, noisy=sensor_error > 0.0)
    half = len(scaled) // 2
    if found.period is None and sensor_error == 0.0 and half >= 64:
        later = find_recurrence(scaled[half:], allowed, max_period)
        if later.settle_cycle is not None:
            return replace(later, settle_cycle=half + later.settle_cycle)
    return found


def _repeating(scaled: Array, series: list[Array], recurrence: Recurrence, evidence: dict[str, Any]) -> Diagnosis:
    period, settle = recurrence.period, recurrence.settle_cycle
    assert period is not None
    assert settle is not None
    evidence["contraction_per_cycle"] = recurrence.contraction
    evidence["irregular_cycles"] = irregular_cycles(scaled, series, period, settle)
    margin = _decades(evidence["residual_allowed"], recurrence.residual)
    reason = f"repeats every {'cycle' if period == 1 else f'{period} cycles'} within {recurrence.residual:.1e}"
    if evidence.get("contact") is False:
        reason += "; there is no contact"
    return Diagnosis(
        nature="periodic",
        period=period,
        margin=margin,
        reason=reason,
        horizon=len(scaled),
        settle_cycle=settle,
        evidence=evidence,
    )


def _approaching(scaled: Array, series: list[Array], decay: Decay, evidence: dict[str, Any]) -> Diagnosis:
    evidence["contraction_per_cycle"] = decay.contraction
    if decay.factor < DECAY_FACTOR:
        return _undetermined(
            evidence,
            f"shrinks steadily, but only {decay.factor:.3g} times over the record: too slowly to tell what it ends in",
        )
    evidence["irregular_cycles"] = irregular_cycles(scaled, series, decay.period, len(scaled))
    reason = f"approaches period {decay.period} by a factor {decay.contraction:.4g} a cycle"
    return Diagnosis(
        nature="periodic",
        period=decay.period,
        margin=0.0,
        reason=reason,
        horizon=evidence["cycles"],
        evidence=evidence,
    )


def _undetermined(evidence: dict[str, Any], reason: str) -> Diagnosis:
    return Diagnosis(
        nature="undetermined",
        period=None,
        margin=0.0,
        reason=reason,
        horizon=evidence["cycles"],
        evidence=evidence,
    )


def _step_two(series: list[Array], section: Array, evidence: dict[str, Any], sensor_error: float) -> Diagnosis:
    cycles = evidence["cycles"]
    figures = [_step_two_figures(s, sensor_error) for s in series]
    bands, lines = figures[0][2], figures[0][3]
    floor = float(np.median([f[1] for f in figures]))
    walks = [f[0] for f in figures if f[0] is not None]
    statistic = float(np.median(walks)) if walks else None
    evidence |= {"zero_one": statistic, "spectral_floor": floor, "spectral_lines": lines, "bands": bands}
    evidence["section"] = _shape(section, bands) if sensor_error == 0.0 else None
    common: dict[str, Any] = {"period": None, "evidence": evidence, "horizon": cycles}
    threshold = BROAD_FLOOR if cycles >= SHORT_CYCLES else BROAD_FLOOR_SHORT
    broad = _decades(floor, threshold, over=1.0)
    diffuses = 1.0 if statistic is None else (statistic - CHAOTIC_STATISTIC) / (1.0 - CHAOTIC_STATISTIC)
    shown = "0-1 test drowned by noise" if statistic is None else f"0-1 statistic {statistic:.2f}"
    figures_shown = f"spectral floor {floor:.1e}, {shown}"
    if floor > threshold and diffuses > 0.0:
        if evidence["section"] == "closed curve":
            return _undetermined(evidence, f"does not repeat, and a closed curve contradicts {figures_shown}")
        if cycles < CHAOTIC_CYCLES:
            reason = f"does not repeat, but {cycles} cycles are too few to tell chaos from a torus"
            return _undetermined(evidence, reason)
        margin = min(broad, diffuses, _decades(evidence["residual"], evidence["residual_allowed"]))
        kind = f"in {bands} bands, " if bands > 1 else ""
        reason = f"does not repeat, {kind}broad spectrum: {figures_shown}"
        return Diagnosis(nature="chaotic", margin=float(margin), reason=reason, **common)
    if statistic is not None and statistic < REGULAR_STATISTIC and floor < LINE_FLOOR and lines <= MAX_LINES:
        if cycles < QUASIPERIODIC_CYCLES:
            return _undetermined(
                evidence,
                f"does not repeat and has {lines} spectral lines, but {cycles} cycles are fewer than the "
                f"{QUASIPERIODIC_CYCLES} that quasiperiodic asks for",
            )
        slack = (REGULAR_STATISTIC - statistic) / REGULAR_STATISTIC
        margin = min(_decades(LINE_FLOOR, floor, over=1.0), slack)
        reason = f"does not repeat, {lines} spectral lines and no band: {figures_shown}"
        return Diagnosis(nature="quasiperiodic", margin=float(margin), reason=reason, **common)
    return _undetermined(evidence, f"does not repeat, and step II does not decide: {figures_shown}")


def _shape(section: Array, bands: int) -> Shape:
    """Shape of the whole section, or of one of the bands that the motion visits in turn if that is a closed curve."""
    whole = section_shape(section)
    if whole == "set with structure" and bands > 1 and section_shape(section, bands) == "closed curve":
        return "closed curve"
    return whole


def _step_two_figures(series: Array, sensor_error: float) -> tuple[float | None, float, int, int]:
    """(0-1 statistic or None if noise drowns it, spectral floor beyond the sensor error, bands, lines)."""
    rest, bands = subtract_bands(series)
    noise = sensor_error**2 / 3.0
    spectrum = power_spectrum(rest, noise)
    variance = float(spectrum.power.sum())
    floor = spectrum.floor if spectrum.floor * variance > NOISE_ALLOWANCE * np.log(2.0) * noise else 0.0
    drowned = noise * len(series) > 0.5 * variance
    return None if drowned else zero_one_statistic(series), floor, bands, spectrum.lines


def _decades(larger: float, smaller: float, over: float = 2.0) -> float:
    """Log10 of the ratio divided by ``over``, between 0 and 1."""
    if smaller <= 0.0:
        return 1.0
    return float(np.clip(math.log10(max(larger, 1e-300) / smaller) / over, 0.0, 1.0))
