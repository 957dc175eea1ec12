"""Quantities of the Spatial Slider Crank alone: crank angles, impacts, frequencies, matrix updates."""

from collections.abc import Callable

import numpy as np

from chaosgym.machines import Machine, SliderCrank
from chaosgym.machines.parameters import with_settings
from chaosgym.machines.slider_crank.machine import frequencies_at
from thesis.scorecard import crank_runs
from thesis.scorecard.findings import Finding, Quantity, Results, Value, no_jobs
from thesis.scorecard.jobs import Job
from thesis.scorecard.observation import DOT, Effort
from thesis.statements import Comparison

LOST = 1e-3
"""Share of a revolution without contact from which on contact counts as lost."""

UPDATED_CYCLES = 35
"""Revolutions of figure 5.1."""

AGREEMENT = 3.0
"""Difference of two settled runs [N] that a reader of figure 5.1 takes for agreement: a sensor's error (3.6)."""


# --- crank angles -----------------------------------------------------------------------------------------------------


def _angle_jobs(machine: Machine, comparison: Comparison, effort: Effort) -> list[Job]:
    return [Job(crank_runs.crank_angles, machine, (effort.transient,))]


def _angles(*names: str) -> Quantity:
    def finding(machine: Machine, comparison: Comparison, results: Results) -> Finding:
        found = [results[0][name] for name in names]
        if any(value is None for value in found):
            return Finding(None, False, "contact is not lost")
        value: Value = (found[0], found[1]) if len(found) == 2 else found[0]
        return Finding(value)

    return Quantity(_angle_jobs, finding)


# --- impacts ----------------------------------------------------------------------------------------------------------


def _impact_jobs(machine: Machine, comparison: Comparison, effort: Effort) -> list[Job]:
    axes = [axis for axis in (comparison.across, comparison.along) if axis is not None]
    machines = [machine]
    for axis in axes:
        machines = [with_settings(one, {axis.field: value}) for one in machines for value in axis.values]
    return [Job(crank_runs.contact_loss, one) for one in machines]


def _impacts(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Whether contact is lost, and so resumed with an impact, anywhere."""
    lost = sum(result["lost"] > LOST for result in results)
    word = "impacts" if lost else "none"
    return Finding(word, word == comparison.printed, f"contact lost in {lost} of {len(results)} runs")


def _impact_bound(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Speeds at which contact is lost at some clearance, as far as the printed range lets them lie: a bound."""
    assert isinstance(comparison.printed, tuple)
    speeds = _speeds_with_impacts(comparison, results)
    if not speeds:
        return Finding(None, False, "contact is never lost")
    low, high = comparison.printed
    beyond = min(low, speeds[0]), max(high, speeds[-1])
    return Finding(beyond, True, f"contact lost at {', '.join(f'{speed:g}' for speed in speeds)} rpm")


def _speeds_with_impacts(comparison: Comparison, results: Results) -> list[float]:
    assert comparison.along is not None
    lost = np.array([result["lost"] > LOST for result in results]).reshape(-1, len(comparison.along.values))
    return [comparison.along.values[place] for place in np.flatnonzero(lost.any(axis=0))]


def _impact_range(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """First stretch of speeds at which contact is lost at some clearance."""
    assert comparison.along is not None
    speeds = _speeds_with_impacts(comparison, results)
    if not speeds:
        return Finding(None, False, "contact is never lost")
    last = speeds[0]
    for speed in speeds[1:]:
        if speed - last > 1.5 * comparison.along.step:
            break
        last = speed
    return Finding((speeds[0], last), True, f"contact lost at {', '.join(f'{speed:g}' for speed in speeds)} rpm")


# --- matrix updates, statistics, places -------------------------------------------------------------------------------


def _updated(machine: Machine, comparison: Comparison, effort: Effort) -> list[Job]:
    return [Job(crank_runs.update_pair, machine, (5.0, 10.0, UPDATED_CYCLES))]


def _update_transient(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Cycles until both runs stay within the reading error of where they end; they must end together."""
    runs = [np.array(results[0][name]) for name in ("first", "second")]
    apart = abs(runs[0][-1] - runs[1][-1])
    unsettled = [np.flatnonzero(np.abs(run - run[-1]) > DOT) for run in runs]
    cycles = max(int(one[-1]) + 1 if len(one) else 0 for one in unsettled)
    return Finding(float(max(cycles, 1)), bool(apart <= AGREEMENT), f"end {apart:.2g} N apart")


def _tested(machine: Machine, comparison: Comparison, effort: Effort) -> list[Job]:
    return [Job(crank_runs.update_test, machine, (5.0, 6.0))]


def _update_test(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    nature = results[0]["nature"]
    return Finding(nature, nature == comparison.printed, results[0]["reason"])


def _statistics(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    return Finding(float(results[0]["cycles"]))


def _spread(unit: float) -> Quantity:
    return Quantity(
        lambda machine, *_: [Job(crank_runs.bearing_spread, machine)],
        lambda machine, comparison, results: Finding(results[0]["spread"] / unit),
    )


# --- numbers of the machine itself ------------------------------------------------------------------------------------


def _of_crank(number: Callable[[SliderCrank], Value]) -> Quantity:
    def finding(machine: Machine, comparison: Comparison, results: Results) -> Finding:
        assert isinstance(machine, SliderCrank)
        return Finding(number(machine))

    return Quantity(no_jobs, finding)


def _range_of_first_frequency(crank: SliderCrank) -> Value:
    found = [float(frequencies_at(crank, angle)[0]) for angle in range(0, 360, 10)]
    return min(found), max(found)


CRANK_QUANTITIES = {
    "gap_angles": _angles("loss", "resumption"),
    "bounce_angles": _angles("resumption", "settled"),
    "loss_angle": _angles("loss"),
    "impact_angle": _angles("impact"),
    "impulse_angles": _angles("impulse_down", "impulse_up"),
    "impacts": Quantity(_impact_jobs, _impacts),
    "impact_range": Quantity(_impact_jobs, _impact_range),
    "impact_bound": Quantity(_impact_jobs, _impact_bound),
    "update_transient": Quantity(_updated, _update_transient),
    "update_test": Quantity(_tested, _update_test),
    "statistics_cycles": Quantity(lambda machine, *_: [Job(crank_runs.statistics, machine)], _statistics),
    "guide_spread": _spread(1e-3),
    "ball_spread": _spread(180.0),
    "first_frequency": _of_crank(lambda crank: float(frequencies_at(crank, 0.0)[0])),
    "range_of_first_frequency": _of_crank(_range_of_first_frequency),
}
"""By name, as in ``reference/comparisons.toml``."""
