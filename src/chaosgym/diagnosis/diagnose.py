"""The diagnosis of a machine: it runs in stages, each twice as long, until the verdict is sure.

A motion that repeats after 16 or 32 cycles already is handed to Newton's method: if that proves the orbit, it is
periodic, certified. All others go on with a deviation that travels along. After 100, 200, 400 ... cycles:

    it repeats, or nearly    Newton's method proves the orbit: periodic, certified. Where it can't (near grazing), a
                             largest exponent below zero confirms the recurrence: periodic, agreed
    it does not              go on. At the end of the budget an exponent above three standard errors makes it chaotic,
                             one within them, with the figures of step II, quasiperiodic
    it never touches         the machine is linear there and the response can't be chaotic: it settles on the drive's
                             period, or is a sum of the drive's lines and those of undamped modes

Tests that cost much run where they can change the verdict or its status: step II of the Two-Step Test, with the 0-1
test, at the end of the last stage where the motion does not repeat, and the Matrix Update Test (flow chart of figure
5.5), on machines whose matrices depend on their configuration, where no orbit is proven. Chaos that dies out within the
horizon counts as chaotic (thesis 5.2.3), with the status "transient".
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.diagnosis.lyapunov import BLOCKS, Deviation, LyapunovExponent, average_growth
from chaosgym.diagnosis.matrix_update import FIELD, depends_on_configuration, matrix_update_test, neighbouring_interval
from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit, find_periodic_orbit
from chaosgym.diagnosis.response import Diagnosis, Nature, Status
from chaosgym.diagnosis.two_step import CHAOTIC_STATISTIC, QUASIPERIODIC_CYCLES, REGULAR_STATISTIC, two_step_test
from chaosgym.errors import DiagnosisError
from chaosgym.machines import Machine
from chaosgym.simulation import CycleRecord, ExactEvents, Integrator, MotionState, simulate

EARLY = (16, 32)
"""Cycles after which a motion that repeats is tried for a proof; a second trajectory only starts afterwards, anew."""

ORBIT_CYCLES = 8
"""Cycles at least that are recorded on a proven orbit."""

FIRST_STAGE = 100
"""Cycles of the first stage."""

DEFAULT_BUDGET = 3200
"""Cycles of the last stage."""

UPDATE_CYCLES = 50
"""Cycles of each run of the Matrix Update Test, on machines whose matrices depend on configuration (figure 5.5)."""

MAX_SEARCHED_PERIOD = 128
"""Longest period that Newton's method is tried on where the motion contracts but does not repeat."""

GROWS = 1.05
"""Ratio of the largest displacements of the last quarter and of the one before it, above which a motion grows."""

NEAR = 0.05
"""How far Newton's method may move, relative to the size of the motion, to find the orbit that the motion nears."""


_Begun = tuple[CycleRecord, Array]
"""A run from the initial state on, and the logarithm of what its deviation grew by in each cycle, (cycles,)."""


@dataclass(frozen=True)
class _Stage:
    """What is known after a stage."""

    record: CycleRecord
    growth: Array
    verdict: Diagnosis
    exponent: LyapunovExponent
    orbit: PeriodicOrbit | None
    cycles_used: int

    @property
    def linear(self) -> bool:
        """True if nothing touches in the last half of the run, so that the machine was linear there."""
        return not self.record.peak_force[len(self.record) // 2 :].any()


def diagnose(
    machine: Machine,
    *,
    initial_state: MotionState | ArrayLike | None = None,
    budget: int = DEFAULT_BUDGET,
    sensor_error: float = 0.0,
    integrator: Integrator | None = None,
) -> Diagnosis:
    """Tell the nature of a machine's response, and how sure that is.

    Parameters
    ----------
    machine
        What to judge.
    initial_state
        Rest by default; part of the label.
    budget
        Cycles that the last stage may reach, at least 100. Chaos takes them all, a periodic response mostly 16 to 100.
    sensor_error
        Peak forces [N] that differ by less count as equal (thesis 3.6: 3 N); 0 judges exactly. Small clearances give
        chaos whose peak forces differ by a fraction of a newton, which no sensor would tell from a period.
    integrator
        ``machine.default_integrator`` by default.

    Returns
    -------
    Diagnosis
        With status, horizon, settle cycle, the votes of all tests and the run itself. ``evidence`` holds the figures
        of the Two-Step Test, whether the machine was ``linear`` (nothing touched in the last half of the run),
        ``largest_lyapunov_exponent_per_cycle``, the ``orbit`` if one was found, ``largest_peak`` [N] of the settled
        cycles, ``cycles_used`` (Newton's method included) and ``final_state``.

    Raises
    ------
    DiagnosisError
        If the budget is below the first stage.
    SimulationError
        If the motion can't be followed.

    Examples
    --------
    >>> verdict = chaosgym.diagnose(chaosgym.ImpactBeam(excitation_frequency=12.0))
    >>> verdict.words, verdict.status
    ('periodic, period 1', 'certified')
    >>> chaosgym.diagnose(chaosgym.ImpactBeam(excitation_frequency=30.0)).words
    'chaotic'
    """
    verdict = diagnose_alone(
        machine, initial_state=initial_state, budget=budget, sensor_error=sensor_error, integrator=integrator
    )
    decides = verdict.status == "agreed" and sensor_error == 0.0
    return _with_update_test(machine, verdict) if decides and depends_on_configuration(machine) else verdict


def diagnose_alone(
    machine: Machine,
    *,
    initial_state: MotionState | ArrayLike | None = None,
    budget: int = DEFAULT_BUDGET,
    sensor_error: float = 0.0,
    integrator: Integrator | None = None,
) -> Diagnosis:
    """``diagnose`` without the vote of the Matrix Update Test, which judges a machine by other machines."""
    if budget < FIRST_STAGE:
        raise DiagnosisError(f"budget = {budget} cycles is out of range; allowed: {FIRST_STAGE} or more")
    exact = integrator is None or isinstance(integrator, ExactEvents)
    deviation = Deviation(machine, initial_state, integrator)
    stage, begun = _proven_early(machine, deviation, initial_state, integrator) if exact else (None, None)
    if stage is None:
        stage = _last_stage(machine, deviation, begun, budget, sensor_error)
    record = stage.record
    verdict = _periodic(stage) or _periodic_within(stage, sensor_error)
    verdict = verdict or (_without_contact(stage) if stage.linear else _not_periodic(stage))
    evidence = _evidence(stage, verdict, initial_state)
    settled = None
    if stage.orbit is not None and verdict.status == "certified":
        settled = _on_orbit(machine, stage.orbit)
        evidence["largest_peak"] = float(np.max(settled.peak_force))
    return replace(
        verdict, votes=_votes(stage), horizon=len(record), evidence=evidence, record=record, orbit_record=settled
    )


def _on_orbit(machine: Machine, orbit: PeriodicOrbit) -> CycleRecord:
    """Whole periods of a proven orbit, after one that tells which surface was touched last."""
    cycles = orbit.period * -(-ORBIT_CYCLES // orbit.period)
    return simulate(machine, cycles, orbit.state, transient=orbit.period)


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
) -> tuple[_Stage | None, _Begun | None]:
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
            per_cycle = np.full(2 * BLOCKS, np.log(max(orbit.largest_multiplier, 1e-300)) / orbit.period)
            exponent = average_growth(per_cycle, machine.cycle_period)
            return _Stage(record, per_cycle, verdict, exponent, orbit, len(record) + searched), begun
    return None, begun


def _last_stage(
    machine: Machine, deviation: Deviation, begun: _Begun | None, budget: int, sensor_error: float
) -> _Stage:
    """The stage after which the motion is known to be periodic in the end, or the budget ends."""
    record, growth = _run_on(deviation, begun, FIRST_STAGE)
    searched = 0
    while True:
        stage = _stage(machine, record, growth, searched, deviation.round_off)
        if 2 * len(record) > budget or _periodic(stage) or _periodic_within(stage, sensor_error):
            break
        searched = stage.cycles_used - len(record)
        record, growth = _run_on(deviation, (record, growth), 2 * len(record))
    if stage.verdict.nature == "undetermined" and not stage.linear:
        return replace(stage, verdict=two_step_test(record))
    return stage


def _with_update_test(machine: Machine, verdict: Diagnosis) -> Diagnosis:
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


def _stage(machine: Machine, record: CycleRecord, growth: Array, searched: int, round_off: float) -> _Stage:
    verdict = two_step_test(record, repeats_only=True)
    exponent = average_growth(growth[len(growth) // 2 :], machine.cycle_period, round_off)
    orbit, spent = None, 0
    if verdict.period is not None or exponent.sign < 0:
        period = verdict.period or returning_period(record.section, MAX_SEARCHED_PERIOD)
        orbit, spent = proven_orbit(machine, record, period)
    return _Stage(record, growth, verdict, exponent, orbit, len(record) + searched + spent)


def proven_orbit(machine: Machine, record: CycleRecord, period: int) -> tuple[PeriodicOrbit | None, int]:
    """The orbit that a motion approaches, if Newton's method proves one of this period, and the cycles that took."""
    found = find_periodic_orbit(machine, record.final_state, period)
    if found is None or not found.certified or not _approaches(machine, record, found):
        return None, 8 * period
    return _primitive(machine, found), 14 * period


def returning_period(section: Array, longest: int, seen: int = 4, back: float = 0.0) -> int:
    """Period, at most ``longest``, after which the last ``seen`` states of a section (cycles, n_states) come back best.

    A state that is nearer than ``back``, relative to the size of the motion, has come back.
    """
    states = section / np.ptp(section, axis=0).clip(1e-300)
    last = states[-seen:]
    periods = range(1, min(longest, len(states) // 2) + 1)
    gaps = np.array([np.linalg.norm(last - states[-seen - k : -k]) for k in periods])
    return int(np.argmax(gaps <= max(1.5 * float(gaps.min()), back))) + 1


def _primitive(machine: Machine, orbit: PeriodicOrbit) -> PeriodicOrbit:
    """The orbit with its smallest period: a multiple of it closes too."""
    if orbit.period == 1:
        return orbit
    states = simulate(machine, orbit.period, orbit.state).section
    size = np.maximum(np.abs(orbit.state), 1e-9 * np.max(np.abs(orbit.state)))
    for divisor in (d for d in range(1, orbit.period) if orbit.period % d == 0):
        if np.max(np.abs(states[divisor] - orbit.state) / size) < 1e-4:
            shorter = find_periodic_orbit(machine, orbit.state, divisor)
            if shorter is not None and shorter.certified:
                return replace(shorter, distance=orbit.distance)
    return orbit


def _approaches(machine: Machine, record: CycleRecord, orbit: PeriodicOrbit) -> bool:
    """True if the motion is near the orbit, and nearer four periods later unless it is there already."""
    if orbit.distance > NEAR:
        return False
    if orbit.distance < 1e-6:
        return True
    later = simulate(machine, 4 * orbit.period, record.final_state).final_state.coordinates
    now = record.final_state.coordinates - orbit.state
    size = np.maximum(np.abs(orbit.state), 1e-9 * np.max(np.abs(orbit.state)))
    return bool(np.linalg.norm((later - orbit.state) / size) < np.linalg.norm(now / size))


def _periodic(stage: _Stage) -> Diagnosis | None:
    """The verdict if the motion is known to be periodic in the end, else None."""
    verdict, orbit = stage.verdict, stage.orbit
    if orbit is not None:
        reason = f"period {orbit.period} proven: miss {orbit.residual:.0e}, multiplier {orbit.largest_multiplier:.3g}"
        margin = 1.0 - orbit.largest_multiplier
        status: Status = "certified"
    elif verdict.settle_cycle is not None and stage.exponent.sign < 0:
        reason = f"{verdict.reason}; exponent {stage.exponent.per_cycle:.3g} a cycle"
        margin, status = verdict.margin, "agreed"
    else:
        return None
    if stage.linear:
        reason = f"no contact: the machine is linear, and its response periodic; {reason}"
    transient = _was_chaotic(stage)
    if transient:
        reason = f"transient chaos for {verdict.evidence['irregular_cycles']} cycles; then {reason}"
    return Diagnosis(
        nature="chaotic" if transient else "periodic",
        period=orbit.period if orbit else verdict.period,
        margin=margin,
        transient=transient,
        status="transient" if transient else status,
        settle_cycle=verdict.settle_cycle if verdict.settle_cycle is not None else len(stage.record),
        reason=reason,
    )


def _periodic_within(stage: _Stage, sensor_error: float) -> Diagnosis | None:
    """The verdict if the peak forces of the last half repeat within a sensor error, else None."""
    settled = stage.record.after(len(stage.record) // 2)
    if sensor_error == 0.0 or not np.any(settled.peak_force):
        return None
    coarse = two_step_test(settled, sensor_error=sensor_error)
    if coarse.nature != "periodic":
        return None
    return replace(
        coarse, status="agreed", reason=f"{coarse.reason} and {sensor_error:g} N; exactly, {stage.verdict.reason}"
    )


def _was_chaotic(stage: _Stage) -> bool:
    """True if the irregular cycles before a recurrence were chaotic by the exponent too."""
    irregular = stage.verdict.evidence.get("irregular_cycles", 0)
    return stage.verdict.transient and float(np.mean(stage.growth[:irregular])) > 0.0


def _without_contact(stage: _Stage) -> Diagnosis:
    """Verdict on a run that does not repeat and whose last half has no contact: never chaotic, as it is linear."""
    exponent, record = stage.exponent, stage.record
    lead = "no contact: the machine is linear"
    last, before = (
        float(np.max(np.abs(part))) for part in np.split(record.displacement[-4 * (len(record) // 4) :], 4)[:1:-1]
    )
    if last > GROWS * before or exponent.sign > 0:
        reason = f"{lead}, but its motion still grows after {len(record)} cycles, so that contact may come later"
        return Diagnosis(nature="undetermined", margin=0.0, status="unresolved", reason=reason)
    if exponent.sign < 0:
        reason = f"{lead}, and its response nears the period of the drive; exponent {exponent.per_cycle:.3g} a cycle"
        return Diagnosis(nature="periodic", period=1, margin=0.0, status="agreed", reason=reason)
    reason = f"{lead}, and its response a sum of lines: those of the drive and of undamped modes"
    return Diagnosis(nature="quasiperiodic", margin=1.0, status="agreed", reason=reason)


def _not_periodic(stage: _Stage) -> Diagnosis:
    verdict, exponent = stage.verdict, stage.exponent
    reason = f"exponent {exponent.per_cycle:.3g} +- {exponent.standard_error:.2g} a cycle; {verdict.reason}"
    if exponent.sign > 0 and verdict.settle_cycle is None:
        margin = float(np.clip(exponent.per_cycle / (3.0 * exponent.standard_error) - 1.0, 0.0, 1.0))
        status: Status = "agreed" if verdict.nature in ("chaotic", "undetermined") else "disputed"
        return Diagnosis(nature="chaotic", margin=margin, status=status, reason=reason)
    settled = len(stage.record) - len(stage.record) // 2
    if exponent.sign == 0 and verdict.nature == "quasiperiodic" and settled >= QUASIPERIODIC_CYCLES:
        return Diagnosis(nature="quasiperiodic", margin=verdict.margin, status="agreed", reason=reason)
    if exponent.sign < 0 and verdict.nature == "periodic":
        return Diagnosis(nature="periodic", period=verdict.period, margin=0.0, status="agreed", reason=reason)
    reason = f"not settled after {len(stage.record)} cycles: {reason}"
    return Diagnosis(nature="undetermined", margin=0.0, status="unresolved", reason=reason)


def _votes(stage: _Stage) -> dict[str, Nature]:
    """What each test says by itself of what the motion does in the end."""
    by_sign: dict[int, Nature] = {1: "chaotic", -1: "periodic", 0: "undetermined"}
    repeats = stage.verdict.settle_cycle is not None
    votes: dict[str, Nature] = {
        "two_step": "periodic" if repeats else stage.verdict.nature,
        "lyapunov": by_sign[stage.exponent.sign],
    }
    statistic = stage.verdict.evidence.get("zero_one")
    if statistic is not None:
        otherwise: Nature = "quasiperiodic" if statistic < REGULAR_STATISTIC else "undetermined"
        votes["zero_one"] = "chaotic" if statistic > CHAOTIC_STATISTIC else otherwise
    votes["newton"] = "periodic" if stage.orbit is not None else "undetermined"
    return votes


def _evidence(stage: _Stage, verdict: Diagnosis, initial_state: MotionState | ArrayLike | None) -> dict[str, Any]:
    record = stage.record
    settled = max(len(record) // 2, verdict.settle_cycle if verdict.settle_cycle is not None else 0)
    settled = min(settled, len(record) - 1)
    exponent = stage.exponent.as_dict()
    if stage.orbit is not None:
        # exact for the orbit itself
        exponent |= {
            "value": float(np.log(max(stage.orbit.largest_multiplier, 1e-300))) / stage.orbit.period,
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
