r"""The nature of a measured record: one answer from peaks and the sensor's error, or "undetermined".

1. Single wrong readings are replaced and missing cycles filled in; both are reported.
2. A record of two regimes is cut, and each part judged; chaos in one part counts, as in the Two-Step Test, if more
   cycles are accounted for than not. Nothing but a fixed motion is claimed of a whole across a change.
3. What repeats exactly is periodic. What scatters is compared with the stated error. Without one the scatter itself is
   judged: a sensor's is random from cycle to cycle and small, chaos can be forecast from what came before.
4. What is irregular beyond the error goes to step II of the Two-Step Test: chaotic, quasiperiodic or undetermined.
"""

import math
import re
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError
from chaosgym.numbers import number
from chaosgym.recordings.description import Sampled, describe, is_sampling_beat
from chaosgym.recordings.fixed_motion import Line, line_of
from chaosgym.recordings.measured_verdict import MeasuredVerdict
from chaosgym.recordings.scatter import newton, scatter_of
from chaosgym.recordings.scatter_verdict import judge_scatter
from chaosgym.series.noise import FEW_OUTLIERS, SensorError, equal_interval, find_change, quantum, repair, stated_error
from chaosgym.series.transient_chaos import INITIAL_TRANSIENT
from chaosgym.series.two_step import two_step_test
from chaosgym.series.verdict import Diagnosis, undetermined

FEWEST_CYCLES, SHORT_RECORD = 8, 16
"""Cycles below which a record is refused, and below which nothing is told of it."""

MORE = ("more cycles",)
"""What tells more of a record that is too short."""

LARGEST_FORCE, SMALLEST_FORCE = 1e9, 1e-100
"""Force [N] beyond which a unit must be wrong, and below which its square is no number."""

MOST_PARTS = 3
"""How often a record is cut in two."""

SEEN_AGAIN, FEWEST_AGAIN, FAR, FEWEST_SPANS = 3, 8, 3.0, 5
"""Periods, and readings, on a pattern after which it is left, not passed by; how many widths away that is; and spans of
cycles over which a response must come nearer to settle: irregular ones do so by chance once in 120."""

LITTLE = 0.3
"""Share of its standard deviation that a motion leaves which holds over a change."""


def judge_peaks(
    peaks: ArrayLike,
    *,
    sensor_error: float | None = None,
    sensor_sigma: float | None = None,
    resolution: float = 0.0,
    unit: str = "N",
    sampled: Sampled | None = None,
) -> MeasuredVerdict:
    """Tell the nature of a measured response from one reading a cycle of one sensor, or of several.

    Parameters
    ----------
    peaks : (cycles,) or (cycles, sensors)
        Peak force [N] of each cycle, or any other reading once a cycle, in ``unit``.
    sensor_error
        Largest error of a reading (half width), if it is known.
    sensor_sigma
        Its standard deviation instead. Without either the error is estimated from the record.
    resolution
        Half width of what the evaluation itself adds, such as the sampling of a series.
    unit
        Unit of the readings, in which the verdict tells sizes.
    sampled
        How a series was sampled from which the peaks are, if they are: tells sampling beats and hum from other lines.

    Raises
    ------
    DiagnosisError
        If there are fewer than 8 readings, one is not finite or beyond 1e9, all are below 1e-100, or the error is none.

    Examples
    --------
    >>> import numpy as np
    >>> noise = np.random.default_rng(0).normal(size=300)
    >>> judge_peaks(np.tile([40.0, 60.0], 150) + 0.1 * noise, sensor_sigma=0.1).diagnosis.words
    'periodic, period 2'
    """
    number("resolution", resolution, 0.0, error=DiagnosisError)
    if np.ndim(peaks) == 2:
        from chaosgym.recordings.sensors import judge_together

        table = np.asarray(peaks, dtype=float)
        if not table.shape[1]:
            raise DiagnosisError(f"the record has shape {table.shape}; allowed: (cycles,) or (cycles, sensors)")
        alone = [
            judge_peaks(
                column,
                sensor_error=sensor_error,
                sensor_sigma=sensor_sigma,
                resolution=resolution,
                unit=unit,
                sampled=sampled,
            )
            for column in table.T
        ]
        return judge_together(alone, table, [f"sensor {place}" for place in range(1, len(alone) + 1)])
    if unit != "N":
        try:
            verdict = judge_peaks(
                peaks, sensor_error=sensor_error, sensor_sigma=sensor_sigma, resolution=resolution, sampled=sampled
            )
        except DiagnosisError as error:
            raise DiagnosisError(
                _shown(str(error).replace("no force in newton", f"no reading in {unit}"), unit)
            ) from None
        return _in_unit(verdict, unit)
    readings = _checked(peaks)
    told = stated_error(sensor_error, sensor_sigma)
    if not np.any(readings):
        return MeasuredVerdict(undetermined("all peaks are zero: there is no contact to judge", readings), told)
    if len(readings) < SHORT_RECORD:
        few = f"{len(readings)} cycles are too few to judge; needed: {SHORT_RECORD} or more"
        return MeasuredVerdict(undetermined(few, readings, MORE), told)
    on_line = line_of(readings)
    fixed = on_line is not None and on_line.rest < LITTLE * float(np.std(readings))
    whole, outliers, gaps = (readings, (), ()) if fixed else repair(readings)
    if gaps and _judge_part(whole, told, max(resolution, 0.5 * quantum(readings))).diagnosis.nature == "chaotic":
        whole, outliers, gaps = readings, (), ()  # what was filled in does not repeat
    why = unsteady(whole)
    if why:
        return MeasuredVerdict(undetermined(f"not a steady response: {why}", readings), told, outliers=outliers)
    resolved = max(resolution, 0.5 * quantum(readings))
    cuts = 0 if fixed else MOST_PARTS
    parts = _parts(whole, resolved / math.sqrt(3.0) + 1e-5 * float(np.max(np.abs(whole))), cuts)
    verdict = _judge_part(whole, told, resolved)
    if len(parts) > 1 and not _accounts_for(verdict, whole):
        verdict = _joined([_judge_part(part, told, resolved) for part in parts], [len(part) for part in parts])
    elif len(parts) > 1:
        parts = [whole]
    changes = tuple(int(place) + 1 for place in np.cumsum([len(part) for part in parts])[:-1])
    notes = [*verdict.notes]
    if outliers:
        every = equal_interval(outliers)
        spikes = f"cycle{'s' * (len(outliers) > 1)} {_listed(outliers)}"
        if every is None:
            notes.insert(0, f"left out as wrong readings: {spikes}")
        else:
            verdict = _apart_from(verdict, f"apart from a spike every {every:.4g} cycles")
            notes.insert(0, f"a spike every {every:.4g} cycles, which no wrong readings make: {spikes}")
        if every is None and len(outliers) > FEW_OUTLIERS * len(readings):
            verdict = _apart_from(verdict, f"if its {len(outliers)} spikes are wrong readings")
    if gaps:
        notes.insert(0, f"cycles are missing before cycle {_listed(gaps)}")
    if len(changes) == 1:
        notes.insert(0, f"the response changes at cycle {changes[0]}")
    found = scatter_of(whole, resolved / math.sqrt(3.0)) if np.ptp(whole) > 0.0 else None
    line = on_line if fixed or found is None or found.random else line_of(found.level)
    if verdict.diagnosis.nature != "undetermined" and "line_cycles" not in verdict.diagnosis.evidence:
        line = None
    if line is not None and is_sampling_beat(line, len(whole), sampled):
        verdict = _of_sampling(verdict, line)
    near = 2.0 * (resolved if told is None else max(told.half_width, resolved))
    if near and _may_leave_its_pattern(whole, verdict.diagnosis, near):
        left = (verdict.diagnosis.settle_cycle or 0) + 1
        verdict = _under(verdict, f"if it does not leave its pattern again, as before cycle {left}")
    heights = readings[np.array(outliers, int) - 1] - np.median(readings)
    seen = () if found is None else describe(whole, found, line, outliers, heights, changes, sampled)
    if verdict.diagnosis.nature == "undetermined" and any(feature.kind == "levels" for feature in seen):
        asked = ("what switches between its two levels", *verdict.diagnosis.tells_more)
        verdict = replace(verdict, diagnosis=replace(verdict.diagnosis, tells_more=asked))
    return replace(verdict, outliers=outliers, gaps=gaps, changes=changes, description=seen, notes=tuple(notes))


def _of_sampling(verdict: MeasuredVerdict, line: Line) -> MeasuredVerdict:
    """The verdict without a line that the sampling of the series makes."""
    found = verdict.diagnosis
    if found.nature == "undetermined" or "line_cycles" not in found.evidence:
        return verdict
    condition = found.condition.partition("and if ")[2]
    reason = f"repeats but for a sampling beat of {line.cycles:.4g} cycles; {found.reason}"
    periodic = replace(found, nature="periodic", period=line.period, reason=reason)
    return replace(verdict, diagnosis=replace(periodic, condition=f"if {condition}" if condition else ""))


def _shown(text: str, unit: str) -> str:
    """A text with sizes in another unit than newton."""
    return re.sub(r"(?<=\d) N\b", f" {unit}", text.replace("the force", "the reading"))


def _in_unit(verdict: MeasuredVerdict, unit: str) -> MeasuredVerdict:
    """The verdict with its sizes in another unit than newton."""
    shown = partial(_shown, unit=unit)
    found = verdict.diagnosis
    diagnosis = replace(found, reason=shown(found.reason), condition=shown(found.condition))
    seen = tuple(feature._replace(text=shown(feature.text)) for feature in verdict.description)
    return replace(verdict, diagnosis=diagnosis, description=seen, notes=tuple(map(shown, verdict.notes)), unit=unit)


def _checked(peaks: ArrayLike) -> Array:
    readings = np.asarray(peaks, dtype=float)
    if readings.ndim != 1:
        raise DiagnosisError(f"the record has shape {readings.shape}; allowed: (cycles,) or (cycles, sensors)")
    if len(readings) < FEWEST_CYCLES:
        raise DiagnosisError(f"the record has {len(readings)} cycles; allowed: {FEWEST_CYCLES} or more")
    bad = np.flatnonzero(~(np.abs(readings) <= LARGEST_FORCE))
    if len(bad):
        raise DiagnosisError(
            f"reading {readings[bad[0]]:g} in cycle {bad[0] + 1} is no force in newton; allowed: finite, up to "
            f"{LARGEST_FORCE:g} N"
        )
    largest = float(np.max(np.abs(readings)))
    if 0.0 < largest < SMALLEST_FORCE:
        raise DiagnosisError(f"the largest reading is {largest:g} N; allowed: 0, or {SMALLEST_FORCE:g} N and more")
    return readings


def _listed(cycles: tuple[int, ...]) -> str:
    shown = ", ".join(str(cycle) for cycle in cycles[:5])
    return shown if len(cycles) <= 5 else f"{shown} and {len(cycles) - 5} more"


def _parts(readings: Array, floor: float, cuts: int) -> list[Array]:
    """Stretches of one regime each."""
    place = find_change(readings, floor) if cuts else None
    if place is None:
        return [readings]
    return [*_parts(readings[:place], floor, cuts - 1), *_parts(readings[place:], floor, cuts - 1)]


def _under(verdict: MeasuredVerdict, condition: str) -> MeasuredVerdict:
    """The verdict under one more condition, if it is one."""
    if verdict.diagnosis.nature == "undetermined":
        return verdict
    conditions = " and ".join(filter(None, (condition, verdict.diagnosis.condition)))
    return replace(verdict, diagnosis=replace(verdict.diagnosis, condition=conditions))


def _apart_from(verdict: MeasuredVerdict, condition: str) -> MeasuredVerdict:
    """The verdict without single readings: what is left of a pattern counts as random scatter."""
    random = verdict.random or verdict.diagnosis.nature == "periodic"
    return replace(_under(verdict, condition), random=random)


def _may_leave_its_pattern(readings: Array, found: Diagnosis, near: float) -> bool:
    """Whether a response that repeats at the end was irregular before, or on the same pattern: so are laminar phases.

    A response that settles comes near its pattern once, and ever nearer. ``near`` [N] is how close readings of one
    pattern are.
    """
    period, settled = found.period, found.settle_cycle
    if found.nature != "periodic" or period is None or not settled:
        return False
    pattern = np.array([np.median(readings[settled + phase :: period]) for phase in range(period)])
    least = max(SEEN_AGAIN * period, FEWEST_AGAIN)
    for shift in range(period):
        off = np.abs(readings[:settled] - pattern[(np.arange(settled) + shift) % period])
        quiet = np.flatnonzero(np.convolve(off <= near, np.ones(least), "valid") == least)
        if len(quiet) and np.max(off[quiet[0] + least :], initial=0.0) > FAR * near:
            return True
    away = np.abs(readings[:settled] - pattern[(np.arange(settled) - settled) % period])
    far = np.flatnonzero(away > near)
    return len(far) > 0 and not any(_nears(away[: far[-1] + 1], near, period * k) for k in (1, 2, 4))


def _nears(away: Array, near: float, span: int) -> bool:
    """Whether distances from a pattern (cycles,) sink from each span of cycles to the next, five at least, by half."""
    largest = [float(np.max(away[max(0, end - span) : end])) for end in range(len(away), 0, -span)]
    sinks = bool(np.all(np.diff(largest) > -near)) and largest[0] < 0.5 * largest[-1]
    return sinks and len(largest) >= FEWEST_SPANS


def _accounts_for(verdict: MeasuredVerdict, readings: Array) -> bool:
    """Whether one pattern, line or torus holds over a change that was found, so that the change belongs to it."""
    if verdict.diagnosis.nature not in ("periodic", "quasiperiodic"):
        return False
    return verdict.scatter is None or verdict.scatter < LITTLE * float(np.std(readings))


def _joined(verdicts: list[MeasuredVerdict], cycles: list[int]) -> MeasuredVerdict:
    """Verdict on the whole: the last regime, unless an earlier one was irregular for more than a transient."""
    last = verdicts[-1]
    if len(verdicts) == 1:
        return last
    natures = [verdict.diagnosis.nature for verdict in verdicts]
    irregular = [verdict for verdict in verdicts if verdict.diagnosis.nature in ("chaotic", "quasiperiodic")]
    horizon = sum(cycles)
    seen, open_ = (
        sum(n for v, n in zip(verdicts, cycles, strict=True) if (v.diagnosis.nature == "undetermined") is unknown)
        for unknown in (False, True)
    )
    if seen <= open_:
        irregular = []
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
    if decisive.diagnosis.nature != "chaotic":  # what each part rests on, all rest on
        for verdict in before[::-1]:
            if verdict.diagnosis.condition not in decisive.diagnosis.condition:
                decisive = _under(decisive, verdict.diagnosis.condition)
    return replace(decisive, diagnosis=replace(decisive.diagnosis, reason=told, horizon=horizon))


def _judge_part(readings: Array, told: SensorError | None, resolved: float) -> MeasuredVerdict:
    """Verdict on a stretch of one regime."""
    size = len(readings)
    if size < SHORT_RECORD:
        return MeasuredVerdict(undetermined(f"{size} cycles are too few to judge", readings, MORE), told)
    found, exact = None, two_step_test(readings)
    if exact.nature in ("chaotic", "undetermined"):
        found = scatter_of(readings, resolved / math.sqrt(3.0))
        exact = two_step_test(found.readings) if found.drift else exact
    notes = (f"drifts by {found.drift:.3g} N over the record",) if found is not None and found.drift else ()
    if found is None or exact.nature in ("periodic", "quasiperiodic"):
        told = told or SensorError(resolved, resolved / math.sqrt(3.0), "estimated")
        return MeasuredVerdict(_in_newton(exact, readings, resolved), told, notes=notes)
    return replace(judge_scatter(found, told, resolved), notes=notes)


BLOCKS, STEP, STEADY = 8, 0.03, 2.0
"""Blocks of a record whose levels and swings are compared, the share by which each must rise or fall where the response
grows or decays, and the factor that makes in all."""

EVENT_SHARE, EVENT_VARIANCE = 0.1, 0.9
"""Share of the cycles in which a single event lasts, and of the variance that it holds."""


def unsteady(readings: Array) -> str:
    """In what way a response is not steady: it decays, grows, or is a single event; empty if it is none of these."""
    size = len(readings)
    if size < 4 * BLOCKS or np.ptp(readings) == 0.0:
        return ""
    blocks = readings[: size // BLOCKS * BLOCKS].reshape(BLOCKS, -1)
    levels, swings = np.mean(np.abs(blocks), axis=1), np.std(np.diff(blocks, axis=1), axis=1)
    for name, values, ways in (("the force", levels, (1.0, -1.0)), ("its variation", swings, (1.0,))):
        for way in ways:
            ordered = values[:: int(way)]
            factor = float(ordered[-1] / max(ordered[0], 1e-300))
            if np.all(ordered[1:] > (1.0 + STEP) * ordered[:-1]) and factor > STEADY:
                return f"{name} {'grows' if way > 0.0 else 'decays'} {min(factor, 1e6):.2g} times over the record"
    away = (readings - np.median(readings)) ** 2
    span = max(1, round(EVENT_SHARE * size))
    held = float(np.convolve(away, np.ones(span), "valid").max()) / float(away.sum())
    event = f"{100.0 * held:.0f} % of its variation lies within {span} cycles, a single event"
    return event if held > EVENT_VARIANCE else ""


def _in_newton(exact: Diagnosis, readings: Array, resolved: float) -> Diagnosis:
    """The verdict of the Two-Step Test with its residual as a force."""
    residual = exact.evidence.get("residual")
    if exact.nature != "periodic" or not isinstance(residual, float) or exact.reason.startswith("approaches"):
        return exact
    within = max(residual * float(np.max(np.abs(readings))), resolved)
    cycle = "cycle" if exact.period == 1 else f"{exact.period} cycles"
    return replace(exact, reason=f"repeats every {cycle} within {newton(within)}")
