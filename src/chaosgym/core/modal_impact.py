r"""Exact motion of a few modes whose tip rattles between two stops, eight instants at a time.

Between contact events the machine is linear (``modal_model``), and the tip is in one of three states, each with its
own quantities e(t) > 0 that end it:

    GAP        between the stops, no force         e = upper - x     and   e = x - lower
    CONTACT    a stop pushes with N > 0            e = N
    DETACHED   beyond a stop that would pull       e = penetration   and   e = -N

GAP and DETACHED share the free regime. In CONTACT the stop's spring and damper act at the tip. Motion is propagated
exactly within a regime, so the only error is in the instant at which e vanishes, and that is polished to
``event_tolerance``.

A stay in a state is ``modal_stay``; a change of state is one product of a matrix and the coordinates.
"""

import math

import numpy as np
from numba import njit

from chaosgym.core import status
from chaosgym.core.contact import pressing_force
from chaosgym.core.cycle import LOWER, UPPER, note_touch
from chaosgym.core.event_tables import BOUND2
from chaosgym.core.kernel import leaf
from chaosgym.core.modal_model import FREE, LOWER_STOP, UPPER_STOP
from chaosgym.core.modal_run import SPARE, WEIGHTS, Run, change, enter, leave, make_run, regime_of, size_of
from chaosgym.core.modal_stay import END, EXHAUSTED, FIRST, fly, hang, press
from chaosgym.core.tangent import carry, orthonormalise, touch

GAP, CONTACT, DETACHED = 0, 1, 2

STEPS_PER_EVENT = 1000
"""Looks ahead that one cycle may take for each event that it may have."""


@njit(cache=True, inline="always")
def tip_of_state(model, state):
    """Tip displacement and velocity of a modal state (2n,)."""
    n = model.tip_shape.shape[0]
    x, v = 0.0, 0.0
    for i in range(n):
        x += model.tip_shape[i] * state[i]
        v += model.tip_shape[i] * state[n + i]
    return x, v


@njit(cache=True, inline="always")
def tip_state_of(model, x, v):
    """Which of the three states holds, and the stop it concerns, for tip displacement x and velocity v."""
    if model.stops[1] <= x <= model.stops[0]:
        return GAP, UPPER_STOP
    stop = UPPER_STOP if x > model.stops[0] else LOWER_STOP
    side = 1.0 if stop == UPPER_STOP else -1.0
    k, d = model.contact_stiffness[stop - 1], model.contact_damping[stop - 1]
    force = pressing_force(side * (x - model.stops[stop - 1]), side * v, k, d)
    return (CONTACT, stop) if force > 0.0 else (DETACHED, stop)


@leaf
def advance(run, model, state, episode, arrays, event_budget, tangents):
    """Advance ``state`` (2n,) and ``episode`` in place by whole cycles, one for each row of ``arrays``.

    Every cycle starts at phase zero of the drive. ``run`` is what ``make_run`` makes of the model; ``tangents`` travel
    with the motion, and there may be none.

    Returns
    -------
    (status, cycle) : the cycle is the first one not finished.
    """
    free = regime_of(run, FREE)
    carries, spare = tangents.vectors.shape[0] > 0, run.own[run.at[SPARE] :]
    weights = run.own[run.at[WEIGHTS] : run.at[WEIGHTS] + state.shape[0] // 2]
    for cycle in range(arrays.section.shape[0]):
        x, v = tip_of_state(model, state)
        for i in range(state.shape[0]):
            arrays.section[cycle, i] = state[i]
        arrays.tip[cycle, 0], arrays.tip[cycle, 1] = x, v
        for column in range(2):
            arrays.peak_force[cycle, column] = 0.0
            arrays.impacts[cycle, column] = 0
            arrays.contact_time[cycle, column] = 0.0
            arrays.bounce_time[cycle, column] = 0.0
        for m in range(tangents.log_growth.shape[1]):
            tangents.log_growth[cycle, m] = 0.0
        tip_state, g = tip_state_of(model, x, v)
        pressing = g if tip_state == CONTACT else FREE
        enter(run, model.regimes.to_modal, pressing, model.pressed[pressing], state)
        if not math.isfinite(size_of(free, BOUND2)):
            return status.DIVERGED, cycle
        events, sample, steps = 0, np.int64(0), STEPS_PER_EVENT * event_budget
        time, carried = 0.0, 0.0
        while True:
            r = model.pressed[g] if tip_state == CONTACT else FREE
            column = UPPER if g == UPPER_STOP else LOWER
            begun = time
            if tip_state == GAP:
                ends, time, steps, sample = fly(run, free, time, steps, sample, arrays.history[cycle])
            elif tip_state == CONTACT:
                ends, time, steps, sample, arrays.peak_force[cycle, column] = press(
                    run,
                    regime_of(run, g),
                    g,
                    time,
                    steps,
                    sample,
                    arrays.peak_force[cycle, column],
                    arrays.history[cycle],
                )
                arrays.contact_time[cycle, column] += time - begun
            else:
                ends, time, steps, sample = hang(run, g, time, steps, sample, arrays.history[cycle])
            if ends == EXHAUSTED:
                return status.STEP_BUDGET, cycle
            if ends == END:
                break
            events += 1
            if events > event_budget:
                return status.EVENT_BUDGET, cycle
            if carries and not (tip_state == DETACHED and ends == FIRST):
                carry(weights, model.regimes, r, time - carried, tangents, cycle, spare)
                carried = time
                if tip_state == GAP:
                    touch(model.tip_shape, model.contact_damping[ends - 1], tangents.vectors)
            if tip_state == CONTACT:
                change(run, g, 1)
                tip_state = DETACHED
            elif tip_state == DETACHED and ends == FIRST:
                tip_state = GAP
            else:
                if tip_state == GAP:
                    g = UPPER_STOP if ends == FIRST else LOWER_STOP
                change(run, g, 0)
                tip_state = CONTACT
                arrays.impacts[cycle, UPPER if g == UPPER_STOP else LOWER] += 1
                note_touch(episode, 1.0 if g == UPPER_STOP else -1.0, time, arrays.bounce_time[cycle])
        arrays.events[cycle] = events
        leave(run, model.regimes.from_modal, g if tip_state == CONTACT else FREE, r, state)
        if carries:
            carry(weights, model.regimes, r, time - carried, tangents, cycle, spare)
            orthonormalise(weights, tangents, cycle)
        for i in range(state.shape[0]):
            if not math.isfinite(state[i]):
                return status.DIVERGED, cycle
        episode.touch[0] -= run.period
        episode.touch[1] -= run.period
    return status.OK, arrays.section.shape[0]


@njit(cache=True, nogil=True)
def advance_model(model, step_phase, event_tolerance, state, episode, arrays, event_budget, tangents):
    """As ``advance``, by what ``make_run`` makes of the model.

    A kernel that Python calls must return plain numbers or arrays: numba has no guard against Ctrl-C while it makes a
    named tuple.
    """
    run = make_run(model, step_phase, event_tolerance)
    return advance(run, model, state, episode, arrays, event_budget, tangents)


@njit(cache=True, nogil=True)
def advance_share(model, share, step_phase, event_tolerance, state, episode, arrays, event_budget, tangents):
    """As ``advance_model``, where each row of ``arrays`` lasts a share of a cycle from phase zero of the drive."""
    run = make_run(model, step_phase, event_tolerance)
    part = Run(run.tables, run.own, run.at, share * run.period, run.omega, run.resolution, run.drifts)
    return advance(part, model, state, episode, arrays, event_budget, tangents)
