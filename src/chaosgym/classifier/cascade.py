"""The nature of one machine in stages of rising cost: a learned guess, a few cycles, a proof.

    parameters      boosted trees on dimensionless groups of the parameters
    8, 16, 32, 64   as many cycles from rest, and boosted trees on the parameters and the figures of these cycles
    certificate     after each of these, where the response may be periodic: Newton's method for the orbit that the
                    motion nears, and its Floquet multipliers

It stops at a proof, where it is sure, or where the next step exceeds the budget. Each stage is calibrated on its own.

Of a machine that was not trained on, its parameters say nothing. Proofs are then tried up to the last stage, whose
peak forces are judged as those of a record, brought to the level of the records in the training: what repeats and what
does not is free of units.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from time import thread_time
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.classifier.answer import NatureAnswer
from chaosgym.classifier.estimator import ResponseClassifier
from chaosgym.classifier.features import MAX_CYCLES, response_features
from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit, find_periodic_orbit, proven_orbit, returning_period
from chaosgym.errors import SimulationError
from chaosgym.machines import Machine
from chaosgym.simulation import CycleRecord, simulate

STAGES = (8, 16, 32, 64)
"""Cycles from rest after which the cascade judges."""

CONFIDENT = 0.99
"""Probability that is an answer before the last stage."""

CLEAR, CLEAR_ELSEWHERE = 0.6, 0.8
"""Probability that is an answer at all, and on a machine that was not trained on."""

PROOF_WORTH_TRYING = 0.3
"""Probability of a periodic response from which on a proof is tried."""

LONGEST_PERIOD, REPEATS = 16, 2
"""Longest period that a proof is tried for, and last cycles that must come back after it."""

RETURNED = 1e-6
"""Distance, relative to the size of the motion, at which a state has come back."""

LEVEL, FINEST = 50.0, 0.02
"""Mean peak, and smallest stated error [N], of the records that the classifier of records has learned from."""

MILLION = 1e6


class Costs(NamedTuple):
    """Processor time [µs] of one cycle, and of one proof of a period-1 orbit."""

    cycle: float
    proof: float


@lru_cache
def costs_of(kind: type[Machine]) -> Costs:
    """Measured once in a process, on the machine's default: what the next step of a budget is taken to cost."""
    machine = kind()
    record = simulate(machine, STAGES[-1])
    find_periodic_orbit(machine, record.final_state, 1)
    began = thread_time()
    record = simulate(machine, STAGES[-1])
    ran = thread_time()
    find_periodic_orbit(machine, record.final_state, 1)
    return Costs(MILLION * (ran - began) / STAGES[-1], MILLION * (thread_time() - ran))


@dataclass
class _Progress:
    """What is known so far."""

    probabilities: dict[str, float]
    plausible: tuple[str, ...]
    stage: str
    record: CycleRecord | None = None
    orbit: PeriodicOrbit | None = None
    clear: float = CLEAR

    @property
    def cycles(self) -> int:
        return 0 if self.record is None else len(self.record)


def judge_nature(
    stages: Mapping[int, ResponseClassifier],
    machine: Machine,
    values: Array | None,
    *,
    budget_us: float | None = None,
    prove: bool = True,
    least_cycles: int = 0,
    foreign: str = "",
) -> NatureAnswer:
    """Nature of a machine.

    Parameters
    ----------
    stages
        Classifiers by the number of cycles that they see, 0 for parameters alone.
    machine, values
        The machine, and its field values (1, n_fields) in the order of the classifiers; None where they don't know it.
    budget_us
        Processor time [µs] that may be spent; None spends what it takes to be sure. Learning alone (some 50 µs) is
        always spent, and so is the reduction of a machine to its modes.
    prove
        Look for a proof where the response may be periodic, although the stages are sure.
    least_cycles
        Cycles to simulate although the answer is sure without, for the largest peak.
    foreign
        Why the classifiers don't know the machine; then only a proof is an answer.
    """
    began = thread_time()
    now = _Progress({}, (), "nothing")
    if values is not None and 0 in stages:
        _judge(now, stages[0], values, None, "parameters")
    try:
        for cycles in sorted({*STAGES, *stages} - {0}):
            sure = _is_sure(now)
            if sure and now.cycles >= least_cycles and not (prove and now.cycles == 0 and _may_be_periodic(now)):
                break
            if not _affordable(machine, began, budget_us, cycles - now.cycles, 0):
                break
            record = _go_on(now, machine, cycles)
            model = stages.get(cycles)
            if model is not None and (values is not None or model.inputs == "records"):
                _judge(now, model, values, record, f"{cycles} cycles")
            if prove and _may_be_periodic(now):
                now.orbit = _proof(machine, record, began, budget_us)
                if now.orbit is not None:
                    break
    except SimulationError as error:
        return _answer(now, machine, f"the motion can't be followed: {error}", began)
    return _answer(now, machine, foreign, began)


def _judge(
    now: _Progress, model: ResponseClassifier, values: Array | None, record: CycleRecord | None, stage: str
) -> None:
    """Replace the probabilities by those of one stage."""
    if record is not None and model.inputs == "records":
        now.clear = CLEAR_ELSEWHERE
        features = response_features(None, None, _as_measured(record), None, np.array([FINEST]))
    elif record is None:
        features = response_features(model.scaling_, values)
    else:
        section = np.column_stack([record.displacement, record.velocity])[None]
        features = response_features(model.scaling_, values, record.peaks[None], section)
    chances = model.chances(features)[0].tolist()
    names = model.classes_.tolist()
    now.probabilities, now.stage = dict(zip(names, chances, strict=True)), stage
    limits = model.plausible_.tolist()
    now.plausible = tuple(name for name, chance, least in zip(names, chances, limits, strict=True) if chance >= least)


def _as_measured(record: CycleRecord) -> Array:
    """Peak forces (1, cycles) of the side that is hit harder, at the level of the records in the training."""
    late = record.peak_force[-MAX_CYCLES:]
    peaks = late[:, int(np.argmax(late.max(axis=0)))]
    return np.asarray(peaks[None] * (LEVEL / max(float(peaks.mean()), 1e-300)))


def _is_sure(now: _Progress) -> bool:
    return max(now.probabilities.values(), default=0.0) >= CONFIDENT


def _may_be_periodic(now: _Progress) -> bool:
    return now.probabilities.get("periodic", 1.0) >= PROOF_WORTH_TRYING


def _affordable(machine: Machine, began: float, budget_us: float | None, cycles: int, proofs: int) -> bool:
    if budget_us is None:
        return True
    left = budget_us - MILLION * (thread_time() - began)
    if left <= 0.0:
        return False
    costs = costs_of(type(machine))
    return cycles * costs.cycle + proofs * costs.proof <= left


def _go_on(now: _Progress, machine: Machine, cycles: int) -> CycleRecord:
    """Run from rest up to a number of cycles; all of them."""
    if now.record is None:
        now.record = simulate(machine, cycles)
    else:
        now.record = now.record.followed_by(simulate(machine, cycles - now.cycles, now.record.final_state))
    return now.record


def _proof(machine: Machine, record: CycleRecord, began: float, budget_us: float | None) -> PeriodicOrbit | None:
    """The periodic orbit that the run nears, if the budget holds Newton's method and it proves one."""
    period = returning_period(record.states, LONGEST_PERIOD, REPEATS, RETURNED)
    if not _affordable(machine, began, budget_us, 0, period):
        return None
    return proven_orbit(machine, record, period)[0]


def _answer(now: _Progress, machine: Machine, foreign: str, began: float) -> NatureAnswer:
    """The nature, or why there is none."""
    orbit, record = now.orbit, now.record
    peak = None if record is None else float(record.peak_force[len(record) // 2 :].max())
    probabilities, plausible, stage, reason = now.probabilities, now.plausible, now.stage, foreign
    nature: str | None = None
    if orbit is not None:
        probabilities = {**dict.fromkeys(probabilities, 0.0), "periodic": 1.0}
        nature, plausible, stage = "periodic", ("periodic",), "certificate"
        peak = float(simulate(machine, orbit.period, orbit.state).peak_force.max())
        reason = f"period {orbit.period} proven: miss {orbit.residual:.0e}, multiplier {orbit.largest_multiplier:.3g}"
    elif not reason and not probabilities:
        reason = "no classifier knows this machine, and no periodic orbit was proven"
    elif not reason:
        likely = max(probabilities, key=probabilities.__getitem__)
        if probabilities[likely] >= now.clear:
            nature, reason = likely, f"learned, from {'the ' * (stage == 'parameters')}{stage}"
        else:
            reason = f"too close to call: {likely} has a probability of {probabilities[likely]:.2f} after {stage}"
    return NatureAnswer(
        nature=nature,
        probabilities=probabilities,
        proven=orbit is not None,
        stage=stage,
        cycles=now.cycles,
        period=orbit.period if orbit is not None else None,
        largest_peak=peak,
        plausible=plausible,
        reason=reason,
        microseconds=MILLION * (thread_time() - began),
    )
