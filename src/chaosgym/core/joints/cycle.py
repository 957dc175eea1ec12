r"""Exact motion of a few modes whose joints, any number, rattle between two surfaces each.

Between contact events the machine is linear (``joints.tables``). A surface presses with N = k p + d p', p the
penetration, while p and N are positive; beyond a surface that would pull, a joint is open like one in its gap. Friction
sticks or slides (``joints.friction``). Sets of pressed surfaces, and of what friction does there, have tables of their
own. They are made outside, when a set is first visited: ``advance`` then stops
before the cycle with NEEDS_SET and tells which.

From one event to the next the motion goes on by eight intervals, as long as proofs allow (``joints.events``). Where
they fail intervals become shorter, and in the shortest one the first change of contact is found on Taylor series.
Recording only reads: a time history does not change the motion by a bit.
"""

import math

import numpy as np
from numba.extending import register_jitable

from chaosgym.core import status
from chaosgym.core.cycle import LOWER, UPPER
from chaosgym.core.events import let_pass, note_touch
from chaosgym.core.joints.events import (
    choose_level,
    first_change,
    note_crests,
    note_now,
    note_peaks,
    note_rounding,
    place_of,
    quiet_intervals,
    read_series,
)
from chaosgym.core.joints.friction import (
    begin_friction,
    change_friction,
    note_deflections,
    read_anchors,
    touch_friction,
    write_anchors,
    write_deflections,
)
from chaosgym.core.joints.run import (
    bound_fourth,
    enter,
    entries_of,
    expand,
    instant_beside,
    jump,
    leave,
    look,
    place,
    read_after,
    read_next,
    read_now,
    travel,
    write_samples,
)
from chaosgym.core.joints.space import (
    JOINT,
    LOWER_DAMPER,
    NUMBERS,
    PEAKS,
    RATES,
    SHAPES,
    SIDE,
    SPARE,
    STATE,
    UPPER_DAMPER,
    U,
    find_sides,
    joint_motion,
    known,
    pressed_set,
)
from chaosgym.core.joints.tables import (
    BLOCKS,
    FROM,
    GENERATOR,
    HARMONICS,
    JOINTS,
    MODES,
    SHORTEST,
    SLIDERS,
    STATES,
    TO,
    WIDTH,
)
from chaosgym.core.kernel import leaf, part
from chaosgym.core.lanes import LANES, add_columns, item, propagate, propagate_and_expand, put
from chaosgym.core.tangent import MAX_CONTRACTION, orthonormalise

STEPS_PER_EVENT = 1000
"""Looks ahead that one cycle may take for each event that it may have."""

MOST_LEVEL, ZOOM = 63, 3  # no limit of the level; levels from an interval to the eight into which it is cut


@leaf
def begin_cycle(run, state, arrays, cycle):
    """Write the section of a cycle and clear its row."""
    for i in range(state.shape[0]):
        arrays.section[cycle, i] = state[i]
    for j in range(run.at[JOINTS]):
        arrays.tip[cycle, 2 * j], arrays.tip[cycle, 2 * j + 1] = joint_motion(run, state, j)
    for column in range(2 * run.at[JOINTS]):
        arrays.peak_force[cycle, column] = 0.0
        arrays.impacts[cycle, column] = 0
        arrays.contact_time[cycle, column] = 0.0
        arrays.bounce_time[cycle, column] = 0.0


@leaf
def begin_state(run, state, rubs):
    """Write a state at phase zero of the drive, which surfaces press in it, and what friction does there."""
    own, first, states = run.own, run.at[STATE], 2 * run.at[MODES]
    for i in range(states):
        own[first + i] = state[i]
    for h in range(run.at[HARMONICS]):
        own[first + states + h], own[first + states + run.at[HARMONICS] + h] = 1.0, 0.0
    for column in range(2 * run.at[JOINTS]):
        own[run.at[PEAKS] + column] = 0.0
    find_sides(run, state)
    if rubs is not None:
        begin_friction(run, state)


@part
def add_contact_time(run, span, contact_time):
    """Add a span to the time in contact (2m,) of the surfaces that press."""
    for j in range(run.at[JOINTS]):
        side = known(run, j, SIDE)
        if side != 0.0:
            contact_time[2 * j + (UPPER if side > 0.0 else LOWER)] += span


@leaf
def carry(run, weights, row, elapsed, tangents, cycle, rubs):
    """Advance deviations (k, 2n + f) by ``elapsed`` seconds in a set; see ``tangent.carry``."""
    own, at, vectors = run.own, run.at, tangents.vectors
    n, width, states, spare = at[MODES], at[WIDTH], 2 * at[MODES], at[SPARE]
    columns = states if rubs is None else 2 * at[BLOCKS]
    several = tangents.log_growth.shape[1] > 1
    pieces, steepest = 1, 0.0
    if several:
        for j in range(n):
            first = row + at[GENERATOR] + j
            steepest = min(steepest, run.tables[first], run.tables[first + 3 * width])
        pieces += int(-steepest * elapsed / MAX_CONTRACTION)
    for _ in range(pieces):
        for k in range(vectors.shape[0]):
            for i in range(states):
                own[at[STATE] + i] = vectors[k, i]
            if rubs is not None:
                write_anchors(run, vectors, k)
            add_columns(run.tables, row + at[TO], 2 * width, columns, own, at[STATE], own, spare, LANES)
            travel(run, row, elapsed / pieces, spare, spare)
            add_columns(run.tables, row + at[FROM], at[STATES], 2 * width, own, spare, own, at[STATE], LANES)
            for i in range(states):
                vectors[k, i] = own[at[STATE] + i]
            if rubs is not None:
                read_anchors(run, spare + n + at[HARMONICS], vectors, k)
        if several:
            orthonormalise(weights, tangents, cycle)


@leaf
def enter_along(run, row, vectors, moving, first):
    """Put deviations (k, 2n) into modal coordinates of a set, one after the other from ``first`` on in ``moving``."""
    own, at, spare, width, states = run.own, run.at, run.at[SPARE], 2 * run.at[WIDTH], 2 * run.at[MODES]
    for k in range(vectors.shape[0]):
        for i in range(states):
            put(own, spare + i, item(vectors, k * states + i))
        add_columns(run.tables, row + at[TO], width, states, own, spare, moving, first + k * width, LANES)


@leaf
def leave_along(run, row, vectors, moving, first):
    """Put modal coordinates of ``enter_along`` back into deviations."""
    own, at, spare, width, states = run.own, run.at, run.at[SPARE], 2 * run.at[WIDTH], 2 * run.at[MODES]
    for k in range(vectors.shape[0]):
        add_columns(run.tables, row + at[FROM], at[STATES], width, moving, first + k * width, own, spare, LANES)
        for i in range(states):
            put(vectors, k * states + i, item(own, spare + i))


@leaf
def jump_along(run, row, level, intervals, count, moving, first):
    """Move modal coordinates of some deviations by 1 to 8 intervals of a level, as ``jump`` moves u."""
    for k in range(count):
        u = first + k * 2 * run.at[WIDTH]
        propagate(run.tables, entries_of(run, row, level, intervals), moving, u, u, run.at[WIDTH])


@leaf
def place_along(run, row, time, count, moving, first):
    """Move them by a time within the shortest interval, as ``place`` moves u."""
    entries, rest = instant_beside(run, row, time)
    for k in range(count):
        u = first + k * 2 * run.at[WIDTH]
        propagate_and_expand(run.tables, entries, row + run.at[GENERATOR], moving, u, rest, u, run.at[WIDTH])


@leaf
def touch(run, j, side, vectors):
    """Saltation of deviations at the touch of a surface: its damper acts at once, for each at its own time."""
    own, n = run.own, run.at[MODES]
    shape, damping = run.at[SHAPES] + j * n, known(run, j, UPPER_DAMPER if side > 0.0 else LOWER_DAMPER)
    for k in range(vectors.shape[0]):
        shift = 0.0
        for i in range(n):
            shift += own[shape + i] * vectors[k, i]
        for i in range(n):
            vectors[k, n + i] -= damping * own[shape + i] * shift


@leaf
def end_cycle(run, weights, row, elapsed, arrays, cycle, events, tangents, rubs):
    """Record a cycle of some events, and carry deviations the rest of the way, which may be none.

    The state is in the work space.
    """
    own, at = run.own, run.at
    if rubs is not None:
        note_deflections(run)
    arrays.events[cycle] = events
    for column in range(2 * at[JOINTS]):
        arrays.peak_force[cycle, column] = own[at[PEAKS] + column]
    if elapsed > 0.0:
        for i in range(2 * at[MODES]):
            own[at[U] + i] = own[at[STATE] + i]
        carry(run, weights, row, elapsed, tangents, cycle, rubs)
        for i in range(2 * at[MODES]):
            own[at[STATE] + i] = own[at[U] + i]
    if tangents.log_growth.shape[1] > 0:
        orthonormalise(weights, tangents, cycle)


@leaf
def keep(bouncing, vectors, kept):
    """Copy bouncing and deviations: an assignment of arrays would compile what it says of shapes that differ."""
    first, columns = bouncing.shape[0], vectors.shape[1]
    for i in range(first):
        kept[i] = bouncing[i]
    for k in range(vectors.shape[0]):
        for i in range(columns):
            kept[first + k * columns + i] = vectors[k, i]


@leaf
def undone(outcome, cycle, code, bouncing, vectors, kept):
    """What ``advance_joints`` returns before a cycle that it can't finish; bouncing and deviations as they were."""
    first, columns = bouncing.shape[0], vectors.shape[1]
    for i in range(first):
        bouncing[i] = kept[i]
    for k in range(vectors.shape[0]):
        for i in range(columns):
            vectors[k, i] = kept[first + k * columns + i]
    return outcome, cycle, code


@register_jitable
def room_for(at, bouncing, tangents):
    """Return memory for what ``advance_joints`` keeps of these while it is in a cycle, and deviations in modal form."""
    return np.empty(bouncing.size + tangents.vectors.size + tangents.vectors.shape[0] * 2 * at[WIDTH])


@leaf
def advance_joints(run, rows, weights, state, bouncing, arrays, event_budget, tangents, kept, rubs):
    """Advance ``state`` (2n + f,) and ``bouncing`` (3m,) in place by whole cycles, one for each row of ``arrays``.

    Every cycle starts at phase zero of the drive; ``tangents`` travel with the motion, and there may be none.
    ``rows`` (product of the digits of all joints,) tell where in the tables the row of each set of pressed surfaces
    begins, -1 where there is none yet; ``weights`` (n + f,) are those of displacements and tangential springs in
    ``orthonormalise``. ``kept`` is from ``room_for``: as a leaf it counts no references, which doubles its speed.
    ``rubs`` is True, or None where no joint has friction: numba then compiles none of it.
    One deviation whose growth is asked for moves along by the tables of the motion. Others are carried from event to
    event by exponentials: those of the matrix of a map, several that are kept orthonormal, and all where anchors of
    friction move.

    Returns
    -------
    (status, cycle, set) : the cycle is the first one not finished, before which state, bouncing and tangents are; with
    NEEDS_SET, the number of the set of pressed surfaces whose tables it needs.
    """
    own, at, m, vectors = run.own, run.at, run.at[JOINTS], tangents.vectors
    deviations, first = vectors.shape[0], bouncing.shape[0] + vectors.size
    follows = deviations > 0 and at[SLIDERS] == 0 and tangents.log_growth.shape[1] == 1
    carries = deviations > 0 and not follows
    for cycle in range(arrays.section.shape[0]):
        keep(bouncing, vectors, kept)
        begin_cycle(run, state, arrays, cycle)
        for k in range(tangents.log_growth.shape[1]):
            tangents.log_growth[cycle, k] = 0.0
        begin_state(run, state, rubs)
        history = arrays.history[cycle]
        contact_time, bounce_time = arrays.contact_time[cycle], arrays.bounce_time[cycle]
        code = pressed_set(run)
        row = rows[code]
        if row < 0:
            return undone(np.int64(status.NEEDS_SET), cycle, code, bouncing, vectors, kept)
        enter(run, row)
        if follows:
            enter_along(run, row, vectors, kept, first)
        read_now(run, row)
        note_now(run)
        for j in range(m):
            if not math.isfinite(own[place_of(run, j)]):
                return undone(np.int64(status.DIVERGED), cycle, code, bouncing, vectors, kept)
        events, sample, steps, most = 0, np.int64(0), STEPS_PER_EVENT * event_budget, MOST_LEVEL
        time, carried, unfinished = 0.0, 0.0, True
        while unfinished:
            steps -= 1
            if steps < 0:
                return undone(np.int64(status.STEP_BUDGET), cycle, code, bouncing, vectors, kept)
            left = run.period - time
            if left <= 0.0:
                break
            bound_fourth(run, row)
            looked = False
            level, h = choose_level(run, row, most, left)
            if h < left:
                look(run, row, level, h)
                whole = int(min(8.0, left / h))
                count = quiet_intervals(run, row, h, whole)
                if code > 0 and count > 0:
                    count = note_peaks(run, h, count)
                if count > 0:
                    if sample < history.shape[0]:
                        sample = write_samples(run, row, time, count * h, sample, history)
                    if code > 0:
                        add_contact_time(run, count * h, contact_time)
                    jump(run, row, level, count, h)
                    if follows:
                        jump_along(run, row, level, count, deviations, kept, first)
                    read_after(run, count)
                    time += count * h
                if count == whole:
                    most = MOST_LEVEL
                    continue
                if level > 0:
                    most = max(level - ZOOM, 0)
                    continue
                looked = True
                if count > 0:
                    read_next(run, count)
                    left = run.period - time
            most = MOST_LEVEL
            shortest = run.tables[row + SHORTEST]
            span = min(shortest, left)
            expanded = not (looked and span == shortest)
            if expanded:
                expand(run, row)
                read_series(run, span)
            changed, towards, instant, expanded = first_change(run, row, span, expanded, run.resolution * shortest)
            if changed >= 0:
                read_series(run, instant)
            if code > 0:
                note_crests(run, row, instant, expanded)
                add_contact_time(run, instant, contact_time)
            if sample < history.shape[0]:
                sample = write_samples(run, row, time, instant, sample, history)
            if instant == shortest:
                jump(run, row, 0, 1, shortest)
            else:
                place(run, row, instant)
            if follows:
                place_along(run, row, instant, deviations, kept, first)
            unfinished = changed >= 0 or span < left
            time += instant
            if changed < 0:
                read_after(run, 1)
                continue
            events += 1
            if events > event_budget:
                return undone(np.int64(status.EVENT_BUDGET), cycle, code, bouncing, vectors, kept)
            touches = towards * own[place_of(run, changed) + 1 + RATES] > 0.0
            if carries:
                carry(run, weights, row, time - carried, tangents, cycle, rubs)
                carried = time
            if follows:
                leave_along(run, row, vectors, kept, first)
            leave(run, row)
            side = towards
            if changed < m:
                side += known(run, changed, SIDE)
                own[at[JOINT] + changed * NUMBERS + SIDE] = towards
            if rubs is not None:
                change_friction(run, changed)
            code = pressed_set(run)
            row = rows[code]
            if row < 0:
                return undone(np.int64(status.NEEDS_SET), cycle, code, bouncing, vectors, kept)
            if towards != 0.0:
                which = UPPER if towards > 0.0 else LOWER
                arrays.impacts[cycle, 2 * changed + which] += 1
                note_touch(bouncing, m, changed, towards, time, bounce_time)
                if rubs is not None and carries:
                    touch_friction(run, changed, towards, touches, instant, vectors)
                if touches and deviations > 0:
                    touch(run, changed, towards, vectors)
            enter(run, row)
            if follows:
                enter_along(run, row, vectors, kept, first)
            read_now(run, row)
            if changed < m:
                note_rounding(run, changed, side)
            note_now(run)
        if sample < history.shape[0]:
            write_samples(run, row, time, run.period, sample, history)
        if follows:
            leave_along(run, row, vectors, kept, first)
        leave(run, row)
        end_cycle(run, weights, row, time - carried if carries else 0.0, arrays, cycle, events, tangents, rubs)
        for i in range(2 * at[MODES]):
            if not math.isfinite(own[at[STATE] + i]):
                return undone(np.int64(status.DIVERGED), cycle, code, bouncing, vectors, kept)
        for i in range(2 * at[MODES]):
            state[i] = own[at[STATE] + i]
        if rubs is not None:
            write_deflections(run, state)
        let_pass(bouncing, m, run.period)
    return status.OK, arrays.section.shape[0], 0
