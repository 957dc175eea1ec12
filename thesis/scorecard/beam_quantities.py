"""Quantities of the Impact Beam System alone: its scales, the motion of the force point, long transients."""

from collections.abc import Callable

import numpy as np

from chaosgym.machines import ImpactBeam, Machine
from chaosgym.machines.impact_beam.modes import pinned_pinned_frequency
from chaosgym.machines.parameters import with_settings
from thesis.scorecard import beam_runs
from thesis.scorecard.findings import Finding, Quantity, Results, no_jobs
from thesis.scorecard.jobs import Job
from thesis.scorecard.observation import Effort
from thesis.statements import Comparison

LONG = 4000
"""Cycles of the longest run of the thesis (5.2.3)."""


def _of_beam(number: Callable[[ImpactBeam], float]) -> Quantity:
    def finding(machine: Machine, comparison: Comparison, results: Results) -> Finding:
        assert isinstance(machine, ImpactBeam)
        return Finding(number(machine))

    return Quantity(no_jobs, finding)


def _long(cycles: int) -> Callable[[Machine, Comparison, Effort], list[Job]]:
    return lambda machine, comparison, effort: [Job(beam_runs.long_run, machine, (cycles,))]


def _irregular_cycles(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    period = results[0]["period"]
    ending = f"then period {period}" if period else "irregular to the end"
    return Finding(float(results[0]["irregular_cycles"]), True, ending)


def _chaotic_cycles(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """How many cycles of the run are chaotic; the run as a whole must be."""
    nature = results[0]["nature"]
    return _irregular_cycles(machine, comparison, results)._replace(agrees=nature == "chaotic", note=nature)


SHORT = 500
"""Cycles within which a response is followed until it is steady: more than three times the printed 150 (5.2.3)."""

STARTS = range(9)
"""Initial states, as ``Effort.start``: how long a chaotic transient lasts, a last digit decides, and so a processor."""


def _settling_jobs(machine: Machine, comparison: Comparison, effort: Effort) -> list[Job]:
    axes = [axis for axis in (comparison.across, comparison.along) if axis is not None]
    machines = [machine]
    for axis in axes:
        machines = [with_settings(one, {axis.field: value}) for one in machines for value in axis.values]
    return [Job(beam_runs.long_run, one, (SHORT, start)) for start in STARTS for one in machines]


def _irregular_settling(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    """Cycles before the last of those responses that become periodic repeats, however irregular it is till then.

    The median over several initial states.
    """
    count = len(results) // len(STARTS)
    longest = []
    for start in STARTS:
        found = results[start * count : (start + 1) * count]
        longest += [max(cycles)] if (cycles := [one["irregular_cycles"] for one in found if one["period"]]) else []
    if not longest:
        return Finding(None, False, "none becomes periodic")
    return Finding(
        float(np.median(longest)), True, f"from {len(STARTS)} states: {', '.join(map(str, sorted(longest)))}"
    )


def _bouncing_jobs(machine: Machine, comparison: Comparison, effort: Effort) -> list[Job]:
    return [Job(beam_runs.longest_bouncing, machine, (200,))]


def _longest_bouncing(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    return Finding(results[0]["share"])


def _final_period(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    period = results[0]["period"]
    cycles = results[0]["irregular_cycles"]
    return Finding(None if period is None else float(period), period is not None, f"irregular for {cycles} cycles")


def _moving(machine: Machine, comparison: Comparison, effort: Effort) -> list[Job]:
    return [Job(beam_runs.force_point_motion, machine, (60, 20, 1000) if effort.hasty else (200, 50))]


def _motion(which: str, unit: float) -> Callable[[Machine, Comparison, Results], Finding]:
    def finding(machine: Machine, comparison: Comparison, results: Results) -> Finding:
        low, high = results[0][which]
        return Finding((low / unit, high / unit))

    return finding


BEAM_QUANTITIES = {
    "irregular_cycles": Quantity(_long(LONG), _irregular_cycles),
    "chaotic_cycles": Quantity(_long(LONG), _chaotic_cycles),
    "irregular_settling": Quantity(_settling_jobs, _irregular_settling),
    "longest_bouncing": Quantity(_bouncing_jobs, _longest_bouncing),
    "final_period": Quantity(_long(LONG), _final_period),
    "force_point_displacement": Quantity(_moving, _motion("displacement", 1e-3)),
    "force_point_velocity": Quantity(_moving, _motion("velocity", 1.0)),
    "pinned_pinned_frequency": _of_beam(lambda beam: pinned_pinned_frequency(beam, beam.length)),
}
"""By name, as in ``reference/comparisons.toml``."""
