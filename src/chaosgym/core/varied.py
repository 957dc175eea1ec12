"""Many machines with modal impacts at once, each cycle at a speed of its own, with a small deviation carried along."""

from chaosgym.core.batch import beam_of
from chaosgym.core.cycle import CycleArrays
from chaosgym.core.joints.cycle import advance_joints, room_for
from chaosgym.core.joints.space import JointRun
from chaosgym.core.kernel import njit
from chaosgym.core.modal_impact import put_speed, suited_run, suits
from chaosgym.core.tangent import Tangents


@njit(cache=True, inline="always")
def cycle_of(arrays, k, c):
    """Arrays of cycle c of the machine in row k."""
    return CycleArrays(
        arrays.section[k, c : c + 1],
        arrays.tip[k, c : c + 1],
        arrays.peak_force[k, c : c + 1],
        arrays.impacts[k, c : c + 1],
        arrays.contact_time[k, c : c + 1],
        arrays.bounce_time[k, c : c + 1],
        arrays.events[k, c : c + 1],
        arrays.history[k, c : c + 1],
        arrays.peak_instant[k, c : c + 1],
        arrays.peak_vector[k, c : c + 1],
        arrays.channel_peak[k, c : c + 1],
    )


# Cycles are looped over in functions of their own: in the body of a parallel loop numba reads a speed once.


@njit(cache=True)
def _vary_beam(batch, regimes, tables, i, speeds, motions, vectors, growth, arrays, settings, k):
    phase, resolution = settings.step_phase, settings.event_tolerance / settings.step_phase
    batch.excitation_frequency[i] = speeds[k, 0]
    model = beam_of(batch, regimes, tables, i)
    suited, (values, own, at, rows, weights) = suits(model, model.tables, phase), suited_run(model, phase)
    kept = room_for(at, motions.bouncing[i], Tangents(vectors[i], growth[k]))
    for c in range(speeds.shape[1]):
        if batch.excitation_frequency[i] != speeds[k, c]:
            batch.excitation_frequency[i] = speeds[k, c]
            model, before = beam_of(batch, regimes, tables, i), suited
            suited = suits(model, model.tables, phase)
            if suited and before:
                put_speed(model, at, values, rows, weights)
            else:
                values, own, at, rows, weights = suited_run(model, phase)
        outcome = advance_joints(
            JointRun(values, own, at, 1.0 / model.excitation_frequency, resolution),
            rows,
            weights,
            motions.coordinates[i],
            motions.bouncing[i],
            cycle_of(arrays, k, c),
            settings.event_budget,
            Tangents(vectors[i], growth[k, c : c + 1]),
            kept,
            None,
        )[0]
        if outcome != 0:
            return outcome
    return 0


@njit(nogil=True)
def advance_varied_beams(
    first, end, batch, regimes, tables, which, speeds, motions, vectors, growth, arrays, settings, outcome
):
    """As ``advance_beams``, for a cycle at each of the excitation frequencies ``speeds`` (k, cycles).

    ``vectors`` (N, 1, n_states) are deviations, advanced in place; ``growth`` (k, cycles, 1) receives the logarithm of
    what they grew by. The batch is left at the last speeds.
    """
    for k in range(first, end):
        outcome[k] = _vary_beam(batch, regimes, tables, which[k], speeds, motions, vectors, growth, arrays, settings, k)
