r"""The Matrix Update Test: is a response sensitive to small disturbances? (thesis 5.2.2)

A machine whose matrices depend on its configuration is run twice, with two slightly different intervals between
updates of these matrices. Each update disturbs the motion a little, so the two runs amount to two initial conditions.

    literal      both from rest; "if the outcomes agree at each observation, the response is periodic; if they are
                 different at each observation, chaotic". Calls periodic responses chaotic whose two runs end on
                 different coexisting motions, in a different phase of one motion, or settle slowly.
    attractors   both from one settled state; what they end in is compared, after the best shift by whole cycles. Two
                 runs that repeat are periodic even if they differ; two that do not repeat and part are chaotic.
"""

import math
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.diagnosis.verdict import MachineDiagnosis, of_machine
from chaosgym.errors import DiagnosisError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of, with_settings
from chaosgym.series.stroboscopic import as_samples, find_decay, find_recurrence, scales
from chaosgym.series.verdict import Diagnosis, Nature
from chaosgym.simulation import MotionState, simulate

Form = Literal["literal", "attractors"]

FIELD = "matrix_update_interval"
"""Field of a machine whose matrices depend on its configuration."""

TOLERANCE = 0.01
"""Difference of two outcomes, as a share of the largest, that a reader of a plot takes for agreement."""

REPEATS = 1e-4
"""Half range within which a run counts as repeating."""

MAX_SHIFT = 32
"""Cycles by which one run may lag behind the other."""


def depends_on_configuration(machine: Machine) -> bool:
    """True if the machine's matrices are updated during a cycle, so that the test applies."""
    return FIELD in parameters_of(machine)


def matrix_update_test(
    machine: Machine,
    *,
    intervals: tuple[float, float] = (5.0, 10.0),
    form: Form = "attractors",
    transient: int = 200,
    cycles: int = 100,
    initial_state: MotionState | None = None,
) -> MachineDiagnosis:
    """Judge a machine by two runs with different matrix-update intervals.

    Parameters
    ----------
    machine
        With a field ``matrix_update_interval`` [deg]; its own value does not matter.
    intervals
        Matrix-update intervals of the two runs [deg]; the thesis uses 5 and 10, and 5 and 6.
    form
        "literal" or "attractors"; see the module.
    transient, cycles
        Cycles before the comparison (literal: of both runs, from rest; attractors: of the first run, after which each
        takes ``cycles`` more to settle), and compared.
    initial_state
        Where both runs, or the transient, start; rest by default.

    Raises
    ------
    DiagnosisError
        If the machine's matrices are constant, or ``form`` is unknown.
    SimulationError
        If a run can't be finished.

    Examples
    --------
    >>> crank = chaosgym.SliderCrank(crank_speed=200.0)
    >>> chaosgym.diagnosis.matrix_update_test(crank).nature
    'chaotic'
    """
    if not depends_on_configuration(machine):
        raise DiagnosisError(
            f"{machine.name} has constant matrices, so there is nothing to update; use two_step_test (thesis 5.2.3)"
        )
    if form not in ("literal", "attractors"):
        raise DiagnosisError(f"form = {form!r} is not one of 'literal', 'attractors'")
    machine, other = (with_settings(machine, {FIELD: interval}) for interval in intervals)
    evidence: dict[str, Any] = {"form": form, "intervals_deg": list(intervals), "transient": transient}
    if form == "literal":
        runs = [simulate(one, cycles, initial_state, transient) for one in (machine, other)]
        compare = compare_outcomes
    else:
        start = simulate(machine, transient, initial_state).final_state if transient else initial_state
        runs = [simulate(one, cycles, start, transient=cycles) for one in (machine, other)]
        compare = compare_attractors
    verdict = compare(*(run.peak_force for run in runs))
    evidence |= verdict.evidence
    return of_machine(verdict, evidence=evidence, horizon=transient + cycles, record=runs[0])


def neighbouring_interval(interval: float) -> float:
    """The interval nearest to 6/5 of a given one that divides a revolution."""
    return 360.0 / max(1, round(360.0 / interval * 5.0 / 6.0))


def compare_outcomes(first: ArrayLike, second: ArrayLike) -> Diagnosis:
    """Literal form: do two series agree in every cycle, or in none?

    Parameters
    ----------
    first, second : (cycles,) or (cycles, sides)
        Outcome of each cycle of two runs.

    Returns
    -------
    Diagnosis
        Periodic if at least 95 % of the cycles agree within the tolerance, chaotic if at most half do, otherwise
        undetermined.
    """
    one, two, scale = _pair(first, second)
    agreeing = float(np.mean(np.max(np.abs(one - two), axis=1) <= TOLERANCE * scale))
    judged = partial(Diagnosis, evidence={"agreeing_cycles": agreeing})
    if agreeing >= 0.95:
        return judged(nature="periodic", margin=agreeing, reason=f"runs agree in {agreeing:.0%} of the cycles")
    reason = f"runs agree in only {agreeing:.0%} of the cycles"
    nature: Nature = "chaotic" if agreeing <= 0.5 else "undetermined"
    return judged(nature=nature, margin=max(0.0, 1.0 - 2.0 * agreeing), reason=reason)


def compare_attractors(first: ArrayLike, second: ArrayLike) -> Diagnosis:
    """Attractor form: do two settled runs end in the same motion, or at least each in one that repeats?

    Parameters
    ----------
    first, second : (cycles,) or (cycles, sides)
        Outcome of each cycle of two runs that start from one settled state.
    """
    one, two, scale = _pair(first, second)
    shift, distance = _best_shift(one, two)
    periods = [_period(one), _period(two)]
    evidence: dict[str, Any] = {"shift": shift, "distance": distance / scale, "periods": periods}
    judged = partial(Diagnosis, evidence=evidence)
    apart, same = distance / (TOLERANCE * scale), distance <= TOLERANCE * scale
    if all(period is not None for period in periods):
        reason = f"both runs repeat, {'the same motion' if same else 'but not the same motion'}"
        period = periods[0] if same else None
        return judged(nature="periodic", period=period, margin=1.0 if same else 0.5, reason=reason)
    if same:
        reason = f"runs agree within {distance / scale:.1e} of the largest peak"
        return judged(nature="periodic", margin=1.0 - apart, reason=reason)
    if any(period is not None for period in periods):
        return judged(nature="undetermined", margin=0.0, reason="one run repeats, the other does not")
    reason = f"neither run repeats, and they part by {distance / scale:.0%} of the largest peak"
    return judged(nature="chaotic", margin=float(np.clip(math.log10(apart), 0.0, 1.0)), reason=reason)


def _pair(first: ArrayLike, second: ArrayLike) -> tuple[Array, Array, float]:
    one, two = as_samples(first), as_samples(second)
    if one.shape != two.shape:
        raise DiagnosisError(f"the two runs have shapes {one.shape} and {two.shape}; allowed: the same shape")
    scale = float(max(np.max(np.abs(one)), np.max(np.abs(two))))
    return one, two, scale if scale > 0.0 else 1.0


def _best_shift(one: Array, two: Array) -> tuple[int, float]:
    """Whole cycles by which the runs are best shifted, and their largest distance then, over the last half."""
    half, longest = len(one) // 2, min(MAX_SHIFT, len(one) // 6)
    tail = one[half : len(one) - longest]
    best = (0, np.inf)
    for shift in range(-longest, longest + 1):
        moved = two[half + shift : len(two) - longest + shift]
        distance = float(np.max(np.abs(tail - moved)))
        if distance < best[1] or (distance == best[1] and abs(shift) < abs(best[0])):
            best = (shift, distance)
    return best


def _period(samples: Array) -> int | None:
    """Period of a run that repeats or steadily approaches a repetition."""
    scaled = samples / scales(samples)
    recurrence = find_recurrence(scaled, REPEATS)
    if recurrence.period is not None:
        return recurrence.period
    decay = find_decay(scaled)
    return decay.period if decay is not None and decay.factor >= 4.0 else None
