"""The diagnosis of a machine: it runs in stages, each twice as long, until the verdict is sure.

A motion that repeats after 16 or 32 cycles already is handed to Newton's method: if that proves the orbit, it is
periodic, certified. All others go on with a small deviation, whose growth gives the exponent. After 100, 200, 400 ...
cycles:

    it repeats, or nearly    Newton's method proves the orbit: periodic, certified. Where it can't (near grazing), a
                             largest exponent below zero confirms the recurrence: periodic, agreed. An orbit with a
                             multiplier of 1 is neutral: it closes, and neither attracts nor repels
    it does not              go on. At the end of the budget an exponent above three standard errors makes it chaotic,
                             one within them, with the figures of step II, quasiperiodic
    it never touches         the machine is linear there and the response can't be chaotic: it settles on the drive's
                             period, or is a sum of the drive's lines and those of undamped modes

Tests that cost much run where they can change the verdict or its status: step II of the Two-Step Test, with the 0-1
test, at the end of the last stage where the motion does not repeat, and the Matrix Update Test (flow chart of figure
5.5), on machines whose matrices depend on their configuration, where no orbit is proven. The nature is that of the
settled motion; ``transient_chaos`` says how long the way there was chaotic.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.diagnosis.lyapunov import Deviation
from chaosgym.diagnosis.matrix_update import FIELD, depends_on_configuration, matrix_update_test, neighbouring_interval
from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit, proven_orbit, returning_period
from chaosgym.diagnosis.stage import Stage, not_periodic, periodic, periodic_within, votes, without_contact
from chaosgym.diagnosis.verdict import MachineDiagnosis, of_machine
from chaosgym.errors import DiagnosisError
from chaosgym.machines import Machine
from chaosgym.numbers import number, whole
from chaosgym.series.exponent import BLOCKS, average_growth
from chaosgym.series.two_step import two_step_test
from chaosgym.series.verdict import AT_REST, Diagnosis, Status
from chaosgym.simulation import CycleRecord, ExactEvents, Integrator, MotionState, simulate
from chaosgym.simulation.run import MOST_RECORDED

EARLY = (16, 32)
"""Cycles after which a motion that repeats is handed to Newton's method, before the first stage.

Where the exponent needs a second trajectory, the first stage starts anew with both."""

ORBIT_CYCLES = 8
"""Cycles at least that are recorded on a proven orbit."""

FIRST_STAGE = 100
"""Cycles of the first stage."""

DEFAULT_BUDGET = 3200
"""Cycles of the last stage."""

UPDATE_CYCLES = 50
"""Cycles of each run of the Matrix Update Test, on machines whose matrices depend on configuration (figure 5.5)."""

REST, REST_SAMPLES = 1e-9, 16
"""Way that a joint moves in a cycle, relative to its displacement, up to which it is at rest; instants looked at."""

MAX_SEARCHED_PERIOD = 128
"""Longest period that Newton's method is tried on where the motion contracts but does not repeat."""

_Begun = tuple[CycleRecord, Array]
"""A run from the initial state on, and the logarithm of what its deviation grew by in each cycle, (cycles,)."""


def diagnose(
    machine: Machine,
    *,
    initial_state: MotionState | ArrayLike | None = None,
    budget: int = DEFAULT_BUDGET,
    sensor_error: float = 0.0,
    integrator: Integrator | None = None,
) -> MachineDiagnosis:
    """Tell the nature of a machine's response, and how sure that is.

    Parameters
    ----------
    machine
        What to judge.
    initial_state
        The machine's own by default, which is rest unless it states another; part of the label.
    budget
        Cycles that the last stage may reach, at least 100. Chaos takes them all, a periodic response mostly 16 to 100.
    sensor_error
        Peak forces [N] that differ by less count as equal (thesis 3.6: 3 N); 0 judges exactly. Small clearances give
        chaos whose peak forces differ by a fraction of a newton, which no sensor would tell from a period.
    integrator
        ``machine.default_integrator`` by default.

    Returns
    -------
    MachineDiagnosis
        With status, horizon, settle cycle, the votes of all tests and the run itself. ``evidence`` holds the figures
        of the Two-Step Test, whether the machine was ``linear`` (nothing touched in the last half of the run),
        ``largest_lyapunov_exponent_per_cycle``, the ``orbit`` if one was found, ``largest_peak`` [N] of the settled
        cycles, ``cycles_used`` (Newton's method included) and ``final_state``.

    Raises
    ------
    DiagnosisError
        If the budget is below the first stage, or the sensor's error is negative or not finite.
    SimulationError
        If the motion can't be followed.

    Examples
    --------
    >>> verdict = chaosgym.diagnose(chaosgym.ImpactBeam(excitation_frequency=12.0))
    >>> verdict.words, verdict.status
    ('periodic, period 1', 'certified')
    >>> chaosgym.diagnose(chaosgym.ImpactBeam(excitation_frequency=30.0)).words
    'chaotic for at least 3200 cycles'
    """
    verdict = diagnose_alone(
        machine, initial_state=initial_state, budget=budget, sensor_error=sensor_error, integrator=integrator
    )
    decides = verdict.status == "agreed" and sensor_error == 0.0
    return _with_update_test(machine, verdict) if decides and depends_on_configuration(machine) else verdict


def checked_run(budget: int, sensor_error: float) -> tuple[int, float]:
    """Budget and sensor's error of a diagnosis.

    Raises
    ------
    DiagnosisError
        If the budget is below the first stage, or the error is negative or not finite.
    """
    return (
        whole("budget", budget, FIRST_STAGE, MOST_RECORDED, error=DiagnosisError),
        number("sensor_error", sensor_error, 0.0, unit="N", error=DiagnosisError),
    )


def diagnose_alone(
    machine: Machine,
    *,
    initial_state: MotionState | ArrayLike | None = None,
    budget: int = DEFAULT_BUDGET,
    sensor_error: float = 0.0,
    integrator: Integrator | None = None,
) -> MachineDiagnosis:
    """``diagnose`` without the vote of the Matrix Update Test, which judges a machine by other machines."""
    if initial_state is None and machine.initial_state:
        initial_state = machine.initial_state
    budget, sensor_error = checked_run(budget, sensor_error)
    exact = integrator is None or isinstance(integrator, ExactEvents)
    deviation = Deviation(machine, initial_state, integrator)
    stage, begun = _proven_early(machine, deviation, initial_state, integrator) if exact else (None, None)
    if stage is None:
        stage = _last_stage(machine, deviation, begun, budget, sensor_error)
    record = stage.record
    verdict = periodic(stage) or periodic_within(stage, sensor_error)
    verdict = verdict or (without_contact(stage) if stage.linear else not_periodic(stage))
    evidence = _evidence(stage, verdict, initial_state)
    settled = None
    if stage.orbit is not None:
        settled = _on_orbit(machine, stage.orbit)
        evidence["largest_peak"] = float(np.max(settled.peak_force))
        if stage.orbit.neutral and _at_rest(machine, stage.orbit):
            verdict = replace(verdict, manner=AT_REST)
    return of_machine(
        verdict,
        votes=votes(stage),
        horizon=len(record),
        evidence=evidence,
        record=record,
        orbit=stage.orbit,
        orbit_record=settled,
    )


def _on_orbit(machine: Machine, orbit: PeriodicOrbit) -> CycleRecord:
    """Whole periods of a proven orbit, after one that tells which surface was touched last."""
    cycles = orbit.period * -(-ORBIT_CYCLES // orbit.period)
    return simulate(machine, cycles, orbit.state, transient=orbit.period)


def _at_rest(machine: Machine, orbit: PeriodicOrbit) -> bool:
    """True if a machine does not move on an orbit, beyond what rounding makes of its events."""
    record = simulate(machine, 1, orbit.state, samples_per_cycle=REST_SAMPLES)
    assert record.history is not None
    gap, speed, _ = np.abs(record.history).max(axis=(0, 1))
    return bool(speed * machine.cycle_period <= REST * gap)


def _run_on(deviation: Deviation, begun: _Begun | None, cycles: int) -> _Begun:
    """Go on with a run to a number of cycles."""
    if begun is None:
        return deviation.run(cycles)
    record, growth = begun
    more, more_growth = deviation.run(cycles - len(record))
    return record.followed_by(more), np.concatenate([growth, more_growth])


def _proven_early(
    machine: Machine,
    deviation: Deviation,
    initial_state: MotionState | ArrayLike | None,
    integrator: Integrator | None,
) -> tuple[Stage | None, _Begun | None]:
    """The stage in which a motion that soon repeats is proven to do so, or None, and the run of the deviation."""
    record, begun, searched = None, None, 0
    for cycles in EARLY:
        if deviation.exact:
            begun = _run_on(deviation, begun, cycles)
            record = begun[0]
        elif record is None:
            record = simulate(machine, cycles, initial_state, integrator=integrator)
        else:
            more = simulate(machine, cycles - len(record), record.final_state, integrator=integrator)
            record = record.followed_by(more)
        verdict = two_step_test(record, repeats_only=True)
        if verdict.settle_cycle is None or verdict.period is None:
            continue
        orbit, spent = proven_orbit(machine, record, verdict.period)
        searched += spent
        if orbit is not None:
            per_cycle = np.full(2 * BLOCKS, math.log(max(orbit.largest_multiplier, 1e-300)) / orbit.period)
            exponent = average_growth(per_cycle, machine.cycle_period)
            return Stage(record, per_cycle, verdict, exponent, orbit, len(record) + searched), begun
    return None, begun


def _last_stage(
    machine: Machine, deviation: Deviation, begun: _Begun | None, budget: int, sensor_error: float
) -> Stage:
    """The stage after which the motion is known to be periodic in the end, or the budget ends."""
    record, growth = _run_on(deviation, begun, FIRST_STAGE)
    searched = 0
    while True:
        stage = _stage(machine, record, growth, searched, deviation.round_off)
        if 2 * len(record) > budget or periodic(stage) or periodic_within(stage, sensor_error):
            break
        searched = stage.cycles_used - len(record)
        record, growth = _run_on(deviation, (record, growth), 2 * len(record))
    if stage.verdict.nature == "undetermined" and not stage.linear:
        return replace(stage, verdict=two_step_test(record))
    return stage


def _with_update_test(machine: Machine, verdict: MachineDiagnosis) -> MachineDiagnosis:
    """Let the Matrix Update Test vote on a verdict, from the state in which the run ended."""
    interval = getattr(machine, FIELD)
    update = matrix_update_test(
        machine,
        intervals=(interval, neighbouring_interval(interval)),
        transient=0,
        cycles=UPDATE_CYCLES,
        initial_state=verdict.run.final_state,
    )
    evidence = {**verdict.evidence, "matrix_update": update.reason}
    evidence["cycles_used"] += 4 * UPDATE_CYCLES
    status: Status = "agreed" if update.nature in (verdict.nature, "undetermined") else "disputed"
    return replace(verdict, status=status, votes={**verdict.votes, "matrix_update": update.nature}, evidence=evidence)


def _stage(machine: Machine, record: CycleRecord, growth: Array, searched: int, round_off: float) -> Stage:
    verdict = two_step_test(record, repeats_only=True)
    exponent = average_growth(growth[len(growth) // 2 :], machine.cycle_period, round_off)
    orbit, spent = None, 0
    if verdict.period is not None or exponent.sign < 0:
        period = verdict.period or returning_period(record.states, MAX_SEARCHED_PERIOD)
        orbit, spent = proven_orbit(machine, record, period)
    return Stage(record, growth, verdict, exponent, orbit, len(record) + searched + spent)


def _evidence(stage: Stage, verdict: Diagnosis, initial_state: MotionState | ArrayLike | None) -> dict[str, Any]:
    record = stage.record
    settled = max(len(record) // 2, verdict.settle_cycle if verdict.settle_cycle is not None else 0)
    settled = min(settled, len(record) - 1)
    exponent = stage.exponent.as_dict()
    if stage.orbit is not None:
        # exact for the orbit itself
        exponent |= {
            "value": float(math.log(max(stage.orbit.largest_multiplier, 1e-300))) / stage.orbit.period,
            "standard_error": 0.0,
        }
        exponent["per_second"] = exponent["value"] / stage.exponent.cycle_period
    given = initial_state.coordinates if isinstance(initial_state, MotionState) else initial_state
    return {
        **stage.verdict.evidence,
        "linear": stage.linear,
        "largest_lyapunov_exponent_per_cycle": exponent,
        "orbit": stage.orbit.as_dict() if stage.orbit is not None else None,
        "largest_peak": float(np.max(record.peak_force[settled:])),
        "cycles_used": stage.cycles_used,
        "initial_state": "rest" if given is None else [float(value) for value in np.asarray(given)],
        "final_state": [float(value) for value in record.final_state.coordinates],
    }
