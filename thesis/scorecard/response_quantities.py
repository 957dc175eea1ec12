"""Quantities from the peak forces of responses: single runs, curves over one axis, maps over two.

A nature agrees if it is the printed word; a run that failed agrees with nothing and decides no boundary. What the
diagnosis says of a single response stands in the note beside it.
"""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from scipy.stats import kendalltau

from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings
from thesis.scorecard.findings import Finding, Quantity, Results
from thesis.scorecard.jobs import Job, as_observation, observation
from thesis.scorecard.observation import READING_ERROR, Effort, Observation
from thesis.scorecard.verdicts import error_of
from thesis.statements import Comparison
from thesis.statements.comparisons import Axis

# --- single points ----------------------------------------------------------------------------------------------------


def _at_point(machine: Machine, comparison: Comparison, effort: Effort) -> list[Job]:
    return [Job(observation, machine, effort)]


Reading = Callable[[Observation, Comparison], Finding]


def _of_either_side(reading: Reading) -> Callable[[Machine, Comparison, Results], Finding]:
    """Of two sides that mirror each other, what is nearer to print: the thesis does not say which it plots."""

    def finding(machine: Machine, comparison: Comparison, results: Results) -> Finding:
        found = [reading(one, comparison) for one in as_observation(results[0]).sides]
        return min(found, key=lambda one: (error_of(comparison, one), one.deviation))

    return finding


def _nature(seen: Observation, comparison: Comparison) -> Finding:
    printed = str(comparison.printed)
    return Finding(seen.nature, seen.nature == printed, _shown(seen), _nature_deviation(seen, printed))


def _periodic_force(seen: Observation, comparison: Comparison) -> Finding:
    return Finding(seen.mean, seen.is_periodic, _shown(seen), _nature_deviation(seen, "periodic"))


def _chaotic_range(seen: Observation, comparison: Comparison) -> Finding:
    return Finding((seen.low, seen.high), seen.is_chaotic, _shown(seen), _nature_deviation(seen, "chaotic"))


def _chaotic_maximum(seen: Observation, comparison: Comparison) -> Finding:
    return Finding(seen.high, seen.is_chaotic, _shown(seen), _nature_deviation(seen, "chaotic"))


def _bounce_share(seen: Observation, comparison: Comparison) -> Finding:
    return Finding(seen.bounce_share, seen.is_periodic, _shown(seen))


def _nature_deviation(seen: Observation, printed: str) -> float:
    """How far a response is from the printed nature, 0 to 1: a half where the peaks spread over the width of a dot."""
    if seen.nature == "failed":
        return 1.0
    spread = float((seen.irregularity / READING_ERROR) ** 1.5)
    return spread / (1.0 + spread) if printed == "periodic" else 1.0 / (1.0 + spread)


def _shown(seen: Observation) -> str:
    if seen.nature == "failed":
        return "the run could not be finished"
    period = f" {seen.period}" if seen.period else ""
    certified = f" (diagnosis: {seen.certificate})" if seen.certificate not in ("", seen.nature) else ""
    return f"{seen.nature}{period}{certified}, {seen.low:.3g} to {seen.high:.3g} N"


# --- curves -----------------------------------------------------------------------------------------------------------


def _over_axes(machine: Machine, comparison: Comparison, effort: Effort) -> list[Job]:
    """Every combination of the axes; the one along varies fastest."""
    machines = [machine]
    for axis in (comparison.across, comparison.along):
        if axis is not None:
            machines = [with_settings(one, {axis.field: value}) for one in machines for value in axis.values]
    return [Job(observation, one, effort._replace(budget=0)) for one in machines]


def _calm_until(seen: Sequence[Sequence[Observation]], end: int, breaks: bool) -> float:
    """How far a boundary is from its printed place, 0 to 1; it leads a search.

    Responses before it, (values, ...), should be periodic, one close to it chaotic if it ``breaks``: the worst and the
    mean of the first count half each.
    """
    calm = [max(_nature_deviation(one, "periodic") for one in row) for row in seen[: max(end - 1, 1)]]
    before = 0.5 * (max(calm) + float(np.mean(calm)))
    near = seen[max(end - 1, 0) : end + 2]
    onset = min((_nature_deviation(one, "chaotic") for row in near for one in row), default=0.0) if breaks else 0.0
    return 1.0 - (1.0 - before) * (1.0 - onset)


def _place(axis: Axis, printed: object) -> int:
    """Number of values of an axis up to a printed one."""
    assert isinstance(printed, float)
    return sum(value <= printed * axis.unit * (1.0 + 1e-9) for value in axis.values)


def _smooth_deviation(comparison: Comparison, seen: Sequence[Observation]) -> float:
    """The same for the end of a smooth rise: no fall before it, and one, or chaos, within two steps of it."""
    assert comparison.along is not None
    end = _place(comparison.along, comparison.printed)
    falls = [max(0.0, one.mean - other.mean) / READING_ERROR for one, other in pairwise(seen)]
    early = max(falls[: max(end - 2, 1)])
    near = [min(1.0 / (1.0 + falls[k]), _nature_deviation(seen[k + 1], "chaotic")) for k in range(end - 2, end + 1)]
    calm = _calm_until([[one] for one in seen], end, False)
    return 1.0 - (1.0 - calm) * (1.0 - min(near)) / (1.0 + max(0.0, early - 0.5))


def _smooth_end(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Last value of the axis up to which the peak force is periodic and never falls: the end of Type I (3.5.1)."""
    values, seen = _curve(comparison, results)
    end, reason = values[0], ""
    away = _smooth_deviation(comparison, seen)
    for value, before, now in zip(values[1:], seen, seen[1:], strict=False):
        if _is_open(now):
            return Finding(None, False, f"{now.nature} at {value:g}", 1.0)
        if now.is_chaotic:
            reason = f"{now.nature} at {value:g}"
            break
        if now.mean < before.mean - READING_ERROR:
            reason = f"falls from {before.mean:.3g} to {now.mean:.3g} N at {value:g}"
            break
        end = value
    return Finding(end, True, reason, away)


def _first_chaotic(axis: Axis, rows: Sequence[Sequence[Observation]]) -> float | None:
    """First value of an axis with a chaotic response, one step beyond the axis if all are periodic.

    None if it is not known: a response before it is neither periodic nor chaotic.
    """
    for value, row in zip(axis.values, rows, strict=True):
        if any(one.is_chaotic for one in row):
            return value
        if not all(one.is_periodic for one in row):
            return None
    return axis.values[-1] + axis.step


def _shares(seen: Sequence[Observation]) -> str:
    """How many responses are chaotic, and how many neither that nor periodic."""
    chaotic, other = sum(one.is_chaotic for one in seen), sum(_is_open(one) for one in seen)
    return f"{chaotic} of {len(seen)} chaotic" + (f", {other} neither chaotic nor periodic" if other else "")


def _is_open(one: Observation) -> bool:
    return not (one.is_periodic or one.is_chaotic)


def _chaos_begin(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """First value of the axis at which the response is chaotic; one step beyond the axis if it is always periodic."""
    _, seen = _curve(comparison, results)
    assert comparison.along is not None
    begin = _first_chaotic(comparison.along, [[one] for one in seen])
    place = _place(comparison.along, comparison.printed)
    away = _calm_until([[one] for one in seen], place - 1, place < len(seen))
    return Finding(begin, begin is not None, _shares(seen), away)


def _periodic_end(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Last value of the axis up to which every response is periodic."""
    begin = _chaos_begin(machine, comparison, results)
    assert comparison.along is not None
    place, seen = _place(comparison.along, comparison.printed), _curve(comparison, results)[1]
    away = _calm_until([[one] for one in seen], place, place < len(seen))
    end = begin.value - comparison.along.step if isinstance(begin.value, float) else None
    return begin._replace(value=end, deviation=away)


def _chaos_run(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Both ends of the longest stretch of the axis with chaotic responses alone."""
    values, seen = _curve(comparison, results)
    assert isinstance(comparison.printed, tuple)
    low, high = comparison.printed
    away = float(
        np.mean(
            [
                _nature_deviation(one, "chaotic" if low <= value <= high else "periodic")
                for value, one in zip(values, seen, strict=True)
            ]
        )
    )
    longest: list[float] = []
    stretch: list[float] = []
    for value, one in zip(values, seen, strict=True):
        stretch = [*stretch, value] if one.is_chaotic else []
        longest = max(longest, stretch, key=len)
    if not longest:
        return Finding(None, False, _shares(seen), away)
    return Finding((longest[0], longest[-1]), True, _shares(seen), away)


def _chaos_present(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Whether any response along the axis is chaotic; undetermined if none is and not all are periodic."""
    _, seen = _curve(comparison, results)
    any_chaotic, all_periodic = any(one.is_chaotic for one in seen), all(one.is_periodic for one in seen)
    word = "chaos" if any_chaotic else "none" if all_periodic else "undetermined"
    calm = [_nature_deviation(one, "periodic") for one in seen]
    away = 0.5 * (max(calm) + float(np.mean(calm)))
    if comparison.printed == "chaos":
        away = min(_nature_deviation(one, "chaotic") for one in seen)
    return Finding(word, word == comparison.printed, _shares(seen), away)


def _change_of_nature(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Nature at the first and at the last value of the axis."""
    _, seen = _curve(comparison, results)
    word = f"{seen[0].nature} to {seen[-1].nature}"
    wanted = str(comparison.printed).split(" to ")
    far = [_nature_deviation(one, nature) for one, nature in zip((seen[0], seen[-1]), wanted, strict=True)]
    away = 1.0 - (1.0 - far[0]) * (1.0 - far[1])
    return Finding(word, word == comparison.printed, "; ".join(_shown(one) for one in seen), away)


def _resonance_speed(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Where the largest peak force has a maximum inside the axis; none if it lies at an end."""
    values, seen = _curve(comparison, results)
    assert comparison.along is not None
    force = [one.high for one in seen]
    top = int(np.argmax(force))
    shown = f"{force[0]:.3g}, at most {force[top]:.3g}, {force[-1]:.3g} N"
    middle, ends = max(force[1:-1]), max(force[0], force[-1])
    away = 1.0 / (1.0 + math.exp(min(12.0 * (middle / ends - 1.0), 50.0))) if ends > 0.0 else 1.0
    if top in (0, len(force) - 1):
        return Finding(None, False, f"no maximum: {shown}", away)
    return Finding(values[top] / comparison.along.unit, True, shown)


def _largest_force(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Largest peak force along the axis."""
    return Finding(max(one.high for one in _curve(comparison, results)[1]))


def _curve(comparison: Comparison, results: Results) -> tuple[tuple[float, ...], list[Observation]]:
    assert comparison.along is not None
    return comparison.along.values, [as_observation(result) for result in results]


def _spread_trend(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Rank correlation (Kendall) of the spread of the peak forces with the axis, over the chaotic responses alone."""
    values, seen = _curve(comparison, results)
    if any(one.nature == "failed" for one in seen):
        return Finding(None, False, "a run could not be finished")
    chaotic = [(value, one.high - one.low) for value, one in zip(values, seen, strict=True) if one.is_chaotic]
    if len(chaotic) < 3:
        return Finding(None, False, f"{len(chaotic)} of {len(seen)} chaotic", 0.5)
    at, spread = zip(*chaotic, strict=True)
    tau = float(kendalltau(at, spread).statistic)
    return Finding(tau, True, "spreads " + ", ".join(f"{one:.2g}" for one in spread) + " N")


def _rise_of_maximum(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """By how many per cent the largest peak force grows from the first to the last value of the axis."""
    _, seen = _curve(comparison, results)
    return Finding(100.0 * (seen[-1].high / seen[0].high - 1.0), True, f"{_shown(seen[0])}; {_shown(seen[-1])}")


def _settling(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Cycles after which all responses that become periodic repeat within the reading error."""
    seen = [as_observation(result) for result in results]
    cycles = [one.settle_cycle for one in seen if one.settle_cycle is not None]
    if not cycles:
        return Finding(None, False, "none becomes periodic")
    return Finding(float(max(cycles)), True, f"{len(cycles)} periodic responses")


# --- maps -------------------------------------------------------------------------------------------------------------


def _rows(comparison: Comparison, results: Results) -> list[list[Observation]]:
    """Responses of a map, one row for each value across."""
    assert comparison.along is not None
    seen = [as_observation(result) for result in results]
    width = len(comparison.along.values)
    return [seen[begin : begin + width] for begin in range(0, len(seen), width)]


def _map_clearance(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Largest value across, in the printed unit, up to which nothing along the other axis is chaotic."""
    assert comparison.across is not None
    return _boundary(comparison, comparison.across, _rows(comparison, results))


def _map_speed(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Largest value along up to which nothing on the map is chaotic."""
    columns = [list(column) for column in zip(*_rows(comparison, results), strict=True)]
    assert comparison.along is not None
    return _boundary(comparison, comparison.along, columns)


def _boundary(comparison: Comparison, axis: Axis, rows: Sequence[Sequence[Observation]]) -> Finding:
    first = _first_chaotic(axis, rows)
    shares = _shares([one for row in rows for one in row])
    away = _calm_until(rows, _place(axis, comparison.printed), True)
    return Finding(None if first is None else (first - axis.step) / axis.unit, first is not None, shares, away)


RESPONSE_QUANTITIES = {
    "nature": Quantity(_at_point, _of_either_side(_nature)),
    "periodic_force": Quantity(_at_point, _of_either_side(_periodic_force)),
    "chaotic_range": Quantity(_at_point, _of_either_side(_chaotic_range)),
    "chaotic_maximum": Quantity(_at_point, _of_either_side(_chaotic_maximum)),
    "bounce_share": Quantity(_at_point, _of_either_side(_bounce_share)),
    "smooth_end": Quantity(_over_axes, _smooth_end),
    "chaos_begin": Quantity(_over_axes, _chaos_begin),
    "periodic_end": Quantity(_over_axes, _periodic_end),
    "chaos_run": Quantity(_over_axes, _chaos_run),
    "chaos_present": Quantity(_over_axes, _chaos_present),
    "change_of_nature": Quantity(_over_axes, _change_of_nature),
    "resonance_speed": Quantity(_over_axes, _resonance_speed),
    "largest_force": Quantity(_over_axes, _largest_force),
    "spread_trend": Quantity(_over_axes, _spread_trend),
    "rise_of_maximum": Quantity(_over_axes, _rise_of_maximum),
    "settling": Quantity(_over_axes, _settling),
    "map_clearance": Quantity(_over_axes, _map_clearance),
    "map_speed": Quantity(_over_axes, _map_speed),
}
"""By name, as in ``reference/comparisons.toml``."""
