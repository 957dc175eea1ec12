r"""Types I, II and III along a measured sweep: peaks at many speeds, as in figures 3.16 and 4.22 of the thesis.

1. At each speed: what repeats within the sensor's error is periodic, what varies by more is irregular (thesis 3.6 and
   4.6 call it chaotic; few cycles can't tell chaos from a random process).
2. From the first to the last irregular speed the response is "either periodic" or chaotic: Type III, windows too (3.6).
3. In each stretch of periodic speeds that is left the trend is well-behaved as long as the mean peak never falls by
   more than the error below an earlier one. Three speeds or more of that, from the lowest on, are Type I, the rest II.

Along one parameter this is section 5.5.1 for a whole sweep; ``type_rule`` judges one point within its tolerances.
"""

from collections.abc import Iterator, Sequence
from itertools import groupby, pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError
from chaosgym.recordings.judge import SHORT_RECORD, judge_peaks
from chaosgym.series.noise import stated_error
from chaosgym.series.stroboscopic import irregularity
from chaosgym.series.verdict import Type

FEWEST_SPEEDS = 3
"""Speeds that a trend needs."""

MOST_SPEEDS = 10_000

LONGEST_PERIOD = 4
"""Period up to which peaks of a short record may repeat."""


class SweptSpeed(NamedTuple):
    """One speed: "periodic" or "irregular", its cycles, its peak forces [N], and the type of the response there."""

    speed: float
    nature: str
    cycles: int
    mean_peak: float
    smallest_peak: float
    largest_peak: float
    type: Type


class Region(NamedTuple):
    """Neighbouring speeds of one type, and the mean peak forces between which they lie [N]."""

    type: Type
    first: float
    last: float
    speeds: int
    lowest_mean: float
    highest_mean: float


class Beginning(NamedTuple):
    """Irregular motion that begins between two neighbouring speeds: "period doubling" or "not told", and why."""

    periodic: float
    irregular: float
    route: Literal["period doubling", "not told"]
    because: str


class SweepTypes(NamedTuple):
    """What a measured sweep says: every speed, upwards, the regions of types, and where irregular motion begins."""

    speeds: tuple[SweptSpeed, ...]
    regions: tuple[Region, ...]
    beginnings: tuple[Beginning, ...]


def sweep_types(
    speeds: ArrayLike, peaks: ArrayLike, *, sensor_error: float | None = None, sensor_sigma: float | None = None
) -> SweepTypes:
    """Regions of Types I, II and III of a measured sweep.

    Parameters
    ----------
    speeds : (n,)
        Speed of each reading, above 0; equal ones follow each other, in the order of the cycles.
    peaks : (n,)
        Peak force of each cycle [N].
    sensor_error, sensor_sigma
        Largest error of a reading, or its standard deviation; one of them is needed.

    Raises
    ------
    DiagnosisError
        If the error is not stated, readings don't fit, a speed has fewer than 16 or comes twice, or there are fewer
        than three speeds.

    Examples
    --------
    >>> import numpy as np
    >>> speeds = np.repeat([4.0, 5.0, 6.0, 7.0, 8.0], 20)
    >>> peaks = np.repeat([20.0, 25.0, 30.0, 22.0, 28.0], 20)
    >>> [(region.type, region.first, region.last) for region in sweep_types(speeds, peaks, sensor_error=3.0).regions]
    [('I', 4.0, 6.0), ('II', 7.0, 8.0)]
    """
    error = stated_error(sensor_error, sensor_sigma)
    if error is None:
        raise DiagnosisError("a sweep needs the sensor's error: --sensor-error (3 N in the thesis)")
    at, force = np.asarray(speeds, dtype=float), np.asarray(peaks, dtype=float)
    runs = _runs(at, force)
    judged = [judged_speed(run, error.half_width, sensor_error, sensor_sigma) for _, run in runs]
    irregular = [wild for wild, _ in judged]
    means = [float(run.mean()) for _, run in runs]
    types = _types(irregular, means, error.half_width)
    found = tuple(
        SweptSpeed(speed, "irregular" if wild else "periodic", len(run), mean, float(run.min()), float(run.max()), kind)
        for (speed, run), wild, mean, kind in zip(runs, irregular, means, types, strict=True)
    )
    periods = [None if wild else period for wild, period in judged]
    return SweepTypes(found, _regions(found), tuple(_beginnings([speed for speed, _ in runs], irregular, periods)))


def _runs(speeds: Array, peaks: Array) -> list[tuple[float, Array]]:
    """Peaks of each speed, upwards."""
    if speeds.ndim != 1 or speeds.shape != peaks.shape:
        raise DiagnosisError(f"speeds have shape {speeds.shape} and peaks {peaks.shape}; allowed: (n,) both")
    bad = np.flatnonzero(~((speeds > 0.0) & np.isfinite(speeds)))
    if len(bad):
        raise DiagnosisError(f"speed {speeds[bad[0]]:g} of reading {bad[0] + 1} is out of range; allowed: above 0")
    places = np.flatnonzero(np.diff(speeds) != 0.0) + 1
    parts = zip(np.split(speeds, places), np.split(peaks, places), strict=True) if len(speeds) else ()
    found = sorted(((float(part[0]), run) for part, run in parts), key=lambda one: one[0])
    if not FEWEST_SPEEDS <= len(found) <= MOST_SPEEDS:
        raise DiagnosisError(f"{len(found)} speeds; a sweep needs {FEWEST_SPEEDS} to {MOST_SPEEDS}")
    for (speed, _), (following, _) in pairwise(found):
        if speed == following:
            raise DiagnosisError(f"speed {speed:g} comes twice with others between; give one run at each speed")
    for speed, run in found:
        if len(run) < SHORT_RECORD:
            raise DiagnosisError(
                f"speed {speed:g} has {len(run)} peaks; needed: {SHORT_RECORD} or more at each speed, whose value "
                "stays the same"
            )
    return found


def judged_speed(
    run: Array, half_width: float, sensor_error: float | None, sensor_sigma: float | None
) -> tuple[bool, int | None]:
    """Whether peaks vary by more than the sensor errs, at every short period; and after how many cycles they repeat.

    Parameters
    ----------
    run : (cycles,)
        Peak forces at one speed [N].
    half_width
        What the sensor errs by [N], from whichever of the other two is stated.
    sensor_error, sensor_sigma
        Largest error of a reading, or its standard deviation.

    Raises
    ------
    DiagnosisError
        If the peaks can't be judged.

    Examples
    --------
    >>> judged_speed(np.tile([20.0, 30.0], 12), 1.0, 1.0, None)
    (False, 2)
    """
    verdict = judge_peaks(run, sensor_error=sensor_error, sensor_sigma=sensor_sigma).diagnosis
    return verdict.nature != "periodic" and irregularity(run, LONGEST_PERIOD) > half_width, verdict.period


def _beginnings(
    speeds: Sequence[float], irregular: Sequence[bool], periods: Sequence[int | None]
) -> Iterator[Beginning]:
    """Where a periodic speed has an irregular neighbour, and whether the period doubled twice on the way there."""
    for step in (1, -1):
        order = range(len(speeds)) if step > 0 else range(len(speeds) - 1, -1, -1)
        passed: list[tuple[int, float]] = []
        for place in order:
            period = periods[place]
            if not irregular[place]:
                # a sequence of periods, each with the speed at which it was seen first; it begins anew where it breaks
                if period is None or (passed and period not in (passed[-1][0], 2 * passed[-1][0])):
                    passed = []
                if period is not None and (not passed or period != passed[-1][0]):
                    passed.append((period, speeds[place]))
                continue
            before = place - step
            if 0 <= before < len(speeds) and not irregular[before]:
                seen = ", ".join(f"{p} at {speed:g}" for p, speed in passed) or "unknown"
                route: Any = "period doubling" if len(passed) > 2 else "not told"
                yield Beginning(speeds[before], speeds[place], route, f"periods: {seen}")
            passed = []


def _types(irregular: Sequence[bool], means: Sequence[float], error: float) -> list[Type]:
    wild = np.flatnonzero(irregular)
    types: list[Type] = ["II"] * len(means)
    stretches = [(0, len(means))]
    if len(wild):
        first, last = int(wild[0]), int(wild[-1])
        types[first : last + 1] = ["III"] * (last + 1 - first)
        stretches = [(0, first), (last + 1, len(means))]
    for start, end in stretches:
        highest, place = -np.inf, start
        while place < end and means[place] >= highest - error:
            highest = max(highest, means[place])
            place += 1
        if place - start >= FEWEST_SPEEDS:
            types[start:place] = ["I"] * (place - start)
    return types


def _regions(speeds: Sequence[SweptSpeed]) -> tuple[Region, ...]:
    regions = []
    for kind, members in groupby(speeds, key=lambda one: one.type):
        inside = list(members)
        means = [one.mean_peak for one in inside]
        regions.append(Region(kind, inside[0].speed, inside[-1].speed, len(inside), min(means), max(means)))
    return tuple(regions)
