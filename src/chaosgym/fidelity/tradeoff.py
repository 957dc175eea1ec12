"""The trade of speed for accuracy: every rung of a machine, and fixed steps on the default one, against the reference.

Cost is processor time per operating cycle. Accuracy is measured three ways, at a fixed sample of operating points over
the range that the machine usually runs in:

    trajectory    error of the joint's displacement over the first cycles from rest, before chaos parts any two runs
    peak force    error of mean, spread and maximum of its distribution, and the Wasserstein distance between the
                  distributions: what a statistical answer (life, damage, reward) depends on
    labels        share of the points whose nature, and whose type over the tolerance neighbourhood, are the reference's

A third of the points are chaotic. There two runs part, however fine both are, and their statistics scatter: chaotic
points have a column of their own, and ``noise`` tells how far two halves of the reference's own run lie apart.

Every setting sees the points in the same order. Fixed steps too slow for their budget stop early, and the setting is
compared with the reference at the points that it reached, and stays off the Pareto front.
"""

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.stats import wasserstein_distance

from chaosgym.arrays import Array
from chaosgym.design.trials import not_dominated
from chaosgym.diagnosis.response_type import SHARES, default_tolerances
from chaosgym.diagnosis.type_rule import Neighbour, judge_type
from chaosgym.errors import ChaosgymError
from chaosgym.fidelity.sample import balanced_points
from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.plain import Result
from chaosgym.series.two_step import two_step_test
from chaosgym.simulation import CycleRecord, ExactEvents, Integrator, RungeKutta4, simulate
from chaosgym.simulation.parallel import parallel_map

REFERENCE = "reference"
"""Rung that all others are measured against."""

FIRST_CYCLES = 2
"""Cycles from rest over which trajectories are compared."""

SAMPLES = 500
"""Samples of a cycle of those trajectories."""

EXACT_STEP = 0.5
"""Angle [rad] by which the fastest mode turns in the shortest exact interval; the errors of others are equal."""

FIXED_STEPS = (1.0, 0.3, 0.1)
"""Steps of Runge-Kutta's method, likewise."""


class Setting(NamedTuple):
    """A rung, an integrator and its step as an angle [rad] of the fastest mode."""

    rung: str
    method: str
    step: float

    def integrator(self, machine: Machine) -> Integrator:
        """Integrator of this setting for a machine."""
        if self.method == "exact":
            given = ExactEvents(step_phase=self.step)
            return replace(given, event_tolerance=1e-13) if self.rung == REFERENCE else given
        return RungeKutta4(math.ceil(machine.cycle_period * machine.fastest_rate / self.step))


@dataclass(frozen=True, kw_only=True)
class TradeoffRow(Result):
    """What a setting costs and how far it is from the reference. Errors are shares of the reference's value.

    Attributes
    ----------
    rung, method, step
        The setting.
    microseconds_per_cycle, cycles_per_second
        Processor time over all runs of the sample.
    trajectory_error
        Root mean square error of the displacement over the first cycles, over the root mean square displacement.
    mean_error, spread_error, maximum_error, wasserstein
        Of the peak force of settled cycles, averaged over the points that are not chaotic; spread and Wasserstein
        distance as shares of the reference's mean.
    chaotic_wasserstein
        The last one, averaged over the chaotic points.
    nature_agreement, type_agreement
        Share of the points with the reference's nature and type.
    points
        Number of points that were compared; without any, what they would tell is None.
    on_front
        True if no other setting that reached all points is both cheaper and nearer in the Wasserstein distance.
    """

    rung: str
    method: str
    step: float
    microseconds_per_cycle: float
    cycles_per_second: float
    trajectory_error: float
    mean_error: float | None
    spread_error: float | None
    maximum_error: float | None
    wasserstein: float | None
    chaotic_wasserstein: float | None
    nature_agreement: float | None
    type_agreement: float | None
    points: int
    on_front: bool = False


@dataclass(frozen=True)
class Tradeoff(Result):
    """The ladder of a machine measured.

    ``costs`` are microseconds per cycle of scenes at the machine's own rung; ``noise`` is the Wasserstein distance, as
    a share of the mean, between two halves of the reference's run at chaotic points, ``chaotic`` the number of these.
    """

    shows = (
        "machine rows microseconds_per_cycle_of_scenes=costs refused points chaotic_points=chaotic "
        "noise_at_chaotic_points=noise"
    )

    machine: str
    rows: tuple[TradeoffRow, ...]
    costs: Mapping[str, float]
    refused: Mapping[str, str]
    points: Array
    chaotic: int
    noise: float | None


class _Point(NamedTuple):
    """What one setting finds at one operating point."""

    peaks: Array
    nature: str
    type: str
    seconds: float
    cycles: int


class _Measured(NamedTuple):
    """What one setting finds: trajectory from rest, time of its cycles, and the points that its budget reached."""

    trajectory: Array
    seconds_per_cycle: float
    points: list[_Point]


def tradeoff(
    machine: Machine,
    *,
    points: int = 60,
    cycles: int = 200,
    transient: int = 100,
    budget: float = 10.0,
    workers: int | None = None,
    progress: bool = False,
) -> Tradeoff:
    """Measure the fidelity ladder of a machine.

    Parameters
    ----------
    machine
        Base machine; its speed and clearance are those of the sample.
    points
        Operating points of the sample.
    cycles, transient
        Cycles that count at each point, and cycles before them.
    budget
        Processor time [s] that a fixed step may take before it starts a further point; exact events have no limit.
    workers
        Number of threads; all processors by default.
    progress
        Show a progress bar on standard error.
    """
    sample = balanced_points(machine, points)
    chosen = settings_of(machine)

    def measure(setting: Setting) -> _Measured | ChaosgymError:
        limit = math.inf if setting.method == "exact" else budget
        try:
            return _measure(machine, setting, sample, cycles, transient, limit)
        except ChaosgymError as error:
            return error

    bar = "tradeoff" if progress else None
    found = dict(zip(chosen, parallel_map(measure, chosen, workers=workers, progress=bar), strict=True))
    reference = found[Setting(REFERENCE, "exact", EXACT_STEP)]
    if isinstance(reference, ChaosgymError):
        raise reference
    rows = [_row(setting, result, reference) for setting, result in found.items() if isinstance(result, _Measured)]
    refused = {
        f"{setting.rung}, {setting.method}, {setting.step:g} rad": str(error).split(";")[0]
        for setting, error in found.items()
        if isinstance(error, ChaosgymError)
    }
    wild = [point.peaks for point in reference.points if point.nature == "chaotic" and point.peaks.any()]
    halves = [wasserstein_distance(*np.array_split(peaks, 2)) / peaks.mean() for peaks in wild]
    return Tradeoff(
        machine=machine.name,
        rows=tuple(_with_front(rows, points)),
        costs=scene_costs(machine),
        refused=refused,
        points=sample,
        chaotic=len(wild),
        noise=float(np.mean(halves)) if halves else None,
    )


def settings_of(machine: Machine) -> list[Setting]:
    """Every rung by exact events, and the default rung by Runge-Kutta's method at every step."""
    rungs = list(machine.fidelity_ladder)
    default = type(machine)().rung or REFERENCE
    fixed = with_settings(machine, {"fidelity": default}).moving.fixed_steps
    return [Setting(rung, "exact", EXACT_STEP) for rung in rungs] + [
        Setting(default, "Runge-Kutta 4", step) for step in FIXED_STEPS if fixed
    ]


def _measure(
    machine: Machine, setting: Setting, sample: Array, cycles: int, transient: int, budget: float
) -> _Measured:
    model = with_settings(machine, {"fidelity": setting.rung})
    integrator = setting.integrator(model)
    simulate(model, 1, integrator=integrator)
    start = time.thread_time()
    run = simulate(model, FIRST_CYCLES, samples_per_cycle=SAMPLES, integrator=integrator)
    each = (time.thread_time() - start) / FIRST_CYCLES
    assert run.history is not None
    found: list[_Point] = []
    spent = 0.0
    for speed, clearance in sample:
        # a point takes one run, or nine with its neighbours
        if spent + each * (cycles + transient) > budget:
            break
        place = with_settings(model, {machine.speed_field: speed, machine.clearance_field: clearance})
        found.append(_at_point(place, setting, cycles, transient))
        spent += found[-1].seconds
    if found:
        each = sum(point.seconds for point in found) / sum(point.cycles for point in found)
    return _Measured(run.history[:, :, 0].ravel(), each, found)


def _at_point(machine: Machine, setting: Setting, cycles: int, transient: int) -> _Point:
    """Peak forces, nature and type at an operating point; neighbours are run only if they decide the type."""
    seconds = 0.0
    count = 0

    def settled(place: Machine) -> CycleRecord:
        nonlocal seconds, count
        integrator = setting.integrator(place)
        start = time.thread_time()
        record = simulate(place, cycles, transient=transient, integrator=integrator)
        seconds += time.thread_time() - start
        count += cycles + transient
        return record

    centre = settled(machine)
    nature = two_step_test(centre).labelled("thesis").nature
    neighbours = []
    if nature == "periodic":
        fields = (machine.speed_field, machine.clearance_field)
        for name, tolerance in default_tolerances(machine).items():
            for share in SHARES if name in fields else ():
                record = settled(with_settings(machine, {name: tolerance.at(getattr(machine, name), share)}))
                peak = float(record.peak_force.max())
                nature_there = two_step_test(record).labelled("thesis").nature
                neighbours.append(Neighbour({name: share}, nature_there, peak))
    kind = judge_type(nature, float(centre.peak_force.max()), neighbours)[0]
    return _Point(centre.peak_force.ravel(), nature, kind, seconds, count)


def _row(setting: Setting, measured: _Measured, reference: _Measured) -> TradeoffRow:
    pairs = list(zip(measured.points, reference.points, strict=False))
    errors: dict[bool, list[tuple[float, ...]]] = {True: [], False: []}
    for point, true in pairs:
        if true.peaks.any():
            errors[true.nature == "chaotic"].append(_peak_errors(point.peaks, true.peaks))
    mean, spread, maximum, distance = np.mean(errors[False], axis=0).tolist() if errors[False] else (None,) * 4
    return TradeoffRow(
        **setting._asdict(),
        microseconds_per_cycle=1e6 * measured.seconds_per_cycle,
        cycles_per_second=1.0 / measured.seconds_per_cycle,
        trajectory_error=_relative(measured.trajectory, reference.trajectory),
        mean_error=mean,
        spread_error=spread,
        maximum_error=maximum,
        wasserstein=distance,
        chaotic_wasserstein=float(np.mean(errors[True], axis=0)[3]) if errors[True] else None,
        nature_agreement=_share([point.nature == true.nature for point, true in pairs]),
        type_agreement=_share([point.type == true.type for point, true in pairs]),
        points=len(pairs),
    )


def _share(agrees: list[bool]) -> float | None:
    return sum(agrees) / len(agrees) if agrees else None


def _relative(values: Array, truth: Array) -> float:
    return float(np.sqrt(np.mean((values - truth) ** 2) / np.mean(truth**2)))


def _peak_errors(peaks: Array, truth: Array) -> tuple[float, float, float, float]:
    mean = truth.mean()
    return (
        abs(peaks.mean() - mean) / mean,
        abs(peaks.std() - truth.std()) / mean,
        abs(peaks.max() - truth.max()) / truth.max(),
        float(wasserstein_distance(peaks, truth)) / mean,
    )


def _with_front(rows: Sequence[TradeoffRow], points: int) -> list[TradeoffRow]:
    """The rows, those that no other row beats in both cost and Wasserstein distance marked."""
    full = [(row, row.wasserstein) for row in rows if row.points == points and row.wasserstein is not None]
    kept = not_dominated([(-row.microseconds_per_cycle, -distance) for row, distance in full])
    front = {id(row) for (row, _), keep in zip(full, kept, strict=True) if keep}
    return [replace(row, on_front=id(row) in front) for row in rows]


SCENE_CYCLES = 40
"""Cycles by which a scene is timed."""


def scene_costs(machine: Machine) -> dict[str, float]:
    """Microseconds of processor time per cycle of each scene, at the machine's own rung."""
    costs = {}
    for scene, fields in machine.scenes.items():
        place = with_settings(machine, fields)
        state = simulate(place, 2).final_state
        start = time.thread_time()
        simulate(place, SCENE_CYCLES, state)
        costs[scene] = 1e6 * (time.thread_time() - start) / SCENE_CYCLES
    return costs
