"""Which quantities follow from the peak forces of responses? Single runs, curves over one axis, maps over two."""

import numpy as np
from scipy.stats import kendalltau

from chaosgym.atlas.findings import Finding, Quantity, Results
from chaosgym.atlas.jobs import Job, as_observation, observation
from chaosgym.atlas.observation import READING_ERROR, Effort, Observation
from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.reference import Comparison

# --- single points ----------------------------------------------------------------------------------------------------


def _at_point(machine: Machine, comparison: Comparison, effort: Effort) -> list[Job]:
    return [Job(observation, machine, effort)]


def _nature(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    seen = as_observation(results[0])
    agrees = seen.is_periodic == (comparison.printed == "periodic")
    return Finding(seen.nature, agrees, _shown(seen), _nature_deviation(seen, comparison.printed == "periodic"))


def _periodic_force(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    seen = as_observation(results[0])
    return Finding(seen.mean, seen.is_periodic, _shown(seen), _nature_deviation(seen, True))


def _chaotic_range(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    seen = as_observation(results[0])
    return Finding((seen.low, seen.high), not seen.is_periodic, _shown(seen), _nature_deviation(seen, False))


def _chaotic_maximum(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    seen = as_observation(results[0])
    return Finding(seen.high, not seen.is_periodic, _shown(seen), _nature_deviation(seen, False))


def _bounce_share(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    seen = as_observation(results[0])
    return Finding(seen.bounce_share, True, _shown(seen))


def _longest_bounce_share(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    seen = as_observation(results[0])
    return Finding(seen.longest_bounce_share, True, _shown(seen))


def _nature_deviation(seen: Observation, periodic: bool) -> float:
    """0 if the nature is the printed one; otherwise how far from it, growing with the spread of the peaks."""
    if seen.is_periodic == periodic:
        return 0.0
    if not periodic or seen.mean <= 0.0:
        return 1.0
    return 0.5 + 0.5 * min(1.0, (seen.high - seen.low) / (0.5 * seen.mean))


def _shown(seen: Observation) -> str:
    if seen.nature == "failed":
        return "the run could not be finished"
    period = f" {seen.period}" if seen.period else ""
    return f"{seen.nature}{period}, {seen.low:.3g} to {seen.high:.3g} N"


# --- curves -----------------------------------------------------------------------------------------------------------


def _over_axes(machine: Machine, comparison: Comparison, effort: Effort) -> list[Job]:
    """Every combination of the axes; the one along varies fastest."""
    machines = [machine]
    for axis in (comparison.across, comparison.along):
        if axis is not None:
            machines = [with_settings(one, {axis.field: value}) for one in machines for value in axis.values]
    return [Job(observation, one, effort) for one in machines]


def _smooth_end(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Last value of the axis up to which the peak force is periodic and never falls: the end of Type I (3.5.1)."""
    values, seen = _curve(comparison, results)
    end, reason = values[0], ""
    for value, before, now in zip(values[1:], seen, seen[1:], strict=False):
        if not now.is_periodic:
            reason = f"{now.nature} at {value:g}"
            break
        if now.mean < before.mean - READING_ERROR:
            reason = f"falls from {before.mean:.3g} to {now.mean:.3g} N at {value:g}"
            break
        end = value
    return Finding(end, True, reason)


def _chaos_begin(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """First value of the axis at which the response is not periodic; one step beyond the axis if it always is."""
    values, seen = _curve(comparison, results)
    restless = [value for value, one in zip(values, seen, strict=True) if not one.is_periodic]
    assert comparison.along is not None
    share = f"{len(restless)} of {len(values)} not periodic"
    return Finding(restless[0] if restless else values[-1] + comparison.along.step, True, share)


def _periodic_end(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Last value of the axis up to which every response is periodic."""
    begin = _chaos_begin(machine, comparison, results)
    restless = float(np.mean([not one.is_periodic for one in _curve(comparison, results)[1]]))
    assert comparison.along is not None
    assert isinstance(begin.value, float)
    return begin._replace(value=begin.value - comparison.along.step, deviation=restless)


def _chaos_run(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Both ends of the longest stretch of the axis without a periodic response."""
    values, seen = _curve(comparison, results)
    longest: list[float] = []
    stretch: list[float] = []
    for value, one in zip(values, seen, strict=True):
        stretch = [] if one.is_periodic else [*stretch, value]
        longest = max(longest, stretch, key=len)
    periodic = float(np.mean([one.is_periodic for one in seen]))
    share = f"{len(values) - round(periodic * len(values))} of {len(values)} not periodic"
    if not longest:
        return Finding(None, False, share, periodic)
    return Finding((longest[0], longest[-1]), True, share)


def _chaos_present(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Whether any response along the axis is not periodic."""
    restless = float(np.mean([not one.is_periodic for one in _curve(comparison, results)[1]]))
    word = "chaos" if restless > 0.0 else "none"
    deviation = max(0.5, restless) if word != comparison.printed else 0.0
    return Finding(word, word == comparison.printed, f"{restless:.0%} of the curve is not periodic", deviation)


def _change_of_nature(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Nature at the first and at the last value of the axis."""
    _, seen = _curve(comparison, results)
    words = ["periodic" if one.is_periodic else "chaotic" for one in (seen[0], seen[-1])]
    word = " to ".join(words)
    return Finding(word, word == comparison.printed, "; ".join(_shown(one) for one in seen))


def _resonance_speed(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Where the largest peak force has a maximum inside the axis; none if it lies at an end."""
    values, seen = _curve(comparison, results)
    assert comparison.along is not None
    force = [one.high for one in seen]
    top = int(np.argmax(force))
    shown = f"{force[0]:.3g}, at most {force[top]:.3g}, {force[-1]:.3g} N"
    if top in (0, len(force) - 1):
        return Finding(None, False, f"no maximum: {shown}")
    return Finding(values[top] / comparison.along.unit, True, shown)


def _largest_force(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Largest peak force along the axis."""
    return Finding(max(one.high for one in _curve(comparison, results)[1]))


def _curve(comparison: Comparison, results: Results) -> tuple[tuple[float, ...], list[Observation]]:
    assert comparison.along is not None
    return comparison.along.values, [as_observation(result) for result in results]


def _spread_trend(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Rank correlation (Kendall) of the spread of the peak forces with the axis."""
    values, seen = _curve(comparison, results)
    spread = [one.high - one.low if not one.is_periodic else 0.0 for one in seen]
    tau = float(kendalltau(values, spread).statistic) if np.ptp(spread) > 0.0 else 0.0
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


def _restless(comparison: Comparison, results: Results) -> np.ndarray:
    assert comparison.along is not None
    assert comparison.across is not None
    shape = len(comparison.across.values), len(comparison.along.values)
    return np.array([not as_observation(result).is_periodic for result in results]).reshape(shape)


def _map_clearance(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Largest value across, in the printed unit, up to which nothing along the other axis is chaotic."""
    restless = _restless(comparison, results)
    across = comparison.across
    assert across is not None
    rows = np.flatnonzero(restless.any(axis=1))
    first = across.values[rows[0]] if len(rows) else across.high + across.step
    return Finding((first - across.step) / across.unit, True, f"{restless.mean():.0%} of the map is not periodic")


def _map_speed(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Largest value along up to which nothing on the map is chaotic."""
    restless = _restless(comparison, results)
    along = comparison.along
    assert along is not None
    columns = np.flatnonzero(restless.any(axis=0))
    first = along.values[columns[0]] if len(columns) else along.high + along.step
    return Finding(first - along.step, True, f"{restless.mean():.0%} of the map is not periodic")


RESPONSE_QUANTITIES = {
    "nature": Quantity(_at_point, _nature),
    "periodic_force": Quantity(_at_point, _periodic_force),
    "chaotic_range": Quantity(_at_point, _chaotic_range),
    "chaotic_maximum": Quantity(_at_point, _chaotic_maximum),
    "bounce_share": Quantity(_at_point, _bounce_share),
    "longest_bounce_share": Quantity(_at_point, _longest_bounce_share),
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
