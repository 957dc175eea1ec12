r"""Fixed steps of Runge-Kutta for a mechanism: the comparison for exact propagation.

The classical Runge-Kutta method of order four on the equations of ``taylor``, any joint and contact law, without
event location: which joints push is judged at every stage, so touch and release are placed to O(h). Matrices are those
of the bin of the angle in which a stage falls.
"""

import numpy as np

from chaosgym.core import status
from chaosgym.core.binned.cycle import RUNAWAY, STEP_BUDGET
from chaosgym.core.binned.record import begin_cycle, note_peak, note_share, write_peaks, write_sample
from chaosgym.core.binned.taylor import judge, note_touch_of
from chaosgym.core.binned.taylor_series import begin, expand, new_series
from chaosgym.core.binned.taylor_view import FORCE, look_first, new_view
from chaosgym.core.cycle import LOWER, UPPER
from chaosgym.core.events import let_pass
from chaosgym.core.fixed_step import STABILITY_LIMIT
from chaosgym.core.kernel import leaf, njit


@leaf
def slope_at(model, instant, z, closed, series, view, dz):
    """dz = (p', p'') at an instant of the revolution; judges the contacts."""
    bins, n = model.acceleration.shape[0], model.row.shape[1]
    b = min(int(instant / model.bin_duration), bins - 1)
    begin(model, z, series)
    judge(model, series, closed, view)
    expand(model, b, instant - b * model.bin_duration, closed, 2, series)
    for i in range(n):
        dz[i], dz[n + i] = z[n + i], 2.0 * series.lanes[2, model.row.shape[0] + i]


@leaf
def note_touches(model, before, closed, direction, bouncing, instant, impacts, bounce_time):
    """Record the joints that push now and did not ``before``."""
    for j in range(closed.shape[0]):
        if closed[j] and not before[j]:
            note_touch_of(model, j, direction, bouncing, instant, impacts, bounce_time)
        before[j] = closed[j]


@leaf
def note_joint_peaks(model, closed, view, channel_peak):
    """Raise the peaks (J, 2) of the joints to their forces."""
    for j in range(channel_peak.shape[0]):
        if closed[j]:
            positive = not model.two_sided[j] or view.direction[model.first[j]] > 0.0
            column = UPPER if positive else LOWER
            channel_peak[j, column] = max(channel_peak[j, column], view.joint[j, FORCE])


@njit(cache=True, nogil=True)
def advance_binned_fixed_step(model, state, bouncing, arrays, steps, fastest):
    """Advance ``state`` and ``bouncing`` by whole revolutions of ``steps`` equal steps; see ``cycle.advance``.

    ``fastest`` is the largest angular frequency with all contacts closed. Peaks and samples are taken at the ends of
    steps.
    """
    n2, joints = state.shape[0], model.gap.shape[0]
    period = model.acceleration.shape[0] * model.bin_duration
    h = period / steps
    if h * fastest > STABILITY_LIMIT:
        return status.STEP_TOO_COARSE, 0
    if steps > STEP_BUDGET:
        return status.STEP_BUDGET, 0
    samples = arrays.history.shape[1]
    k, inner = np.empty((4, n2)), np.empty(n2)
    closed, before = np.zeros(joints, dtype=np.bool_), np.zeros(joints, dtype=np.bool_)
    series, view, peak = new_series(model), new_view(model, model.acceleration.shape[2]), np.zeros((2, 5))
    for cycle in range(arrays.section.shape[0]):
        begin_cycle(model, state, arrays, cycle)
        peak[:] = 0.0
        slope_at(model, 0.0, state, closed, series, view, k[0])
        before[:] = closed
        force = look_first(model, series, closed, view)
        sample = 0
        for step in range(steps):
            now = step * h
            while sample < samples and sample * steps <= step * samples:
                write_sample(model.display, state, force, arrays.history[cycle, sample])
                sample += 1
            for stage in range(1, 4):
                share = h if stage == 3 else 0.5 * h
                for i in range(n2):
                    inner[i] = state[i] + share * k[stage - 1, i]
                slope_at(model, now + share, inner, closed, series, view, k[stage])
            for i in range(n2):
                state[i] += h / 6.0 * (k[0, i] + 2.0 * (k[1, i] + k[2, i]) + k[3, i])
            now = (step + 1) * h
            slope_at(model, min(now, period), state, closed, series, view, k[0])
            earlier, force = force, look_first(model, series, closed, view)
            note_share(earlier, force, h, arrays.contact_time[cycle])
            note_peak(peak, now, force)
            note_joint_peaks(model, closed, view, arrays.channel_peak[cycle])
            impacts, bounce_time = arrays.impacts[cycle], arrays.bounce_time[cycle]
            note_touches(model, before, closed, view.direction, bouncing, now, impacts, bounce_time)
        write_peaks(peak, arrays, cycle)
        arrays.events[cycle] = 0
        for i in range(n2):
            if not abs(state[i]) < RUNAWAY:
                return status.DIVERGED, cycle
        let_pass(bouncing, 1, period)
    return status.OK, arrays.section.shape[0]
