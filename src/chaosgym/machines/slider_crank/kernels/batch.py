"""Many slider cranks at once: each by its own ``advance``, side by side on all threads.

The large table of a slider crank stays where it is, and its batch holds the address: machines at equal speeds share
it.
"""

import numpy as np
from numba import carray, njit, prange, types
from numba.core import cgutils
from numba.extending import intrinsic

from chaosgym.core.batch import episode_of, rows_of
from chaosgym.core.kernel import side_by_side
from chaosgym.core.tangent import no_tangents
from chaosgym.core.varied import cycle_of
from chaosgym.machines.slider_crank.kernels.exact import SliderCrankModel
from chaosgym.machines.slider_crank.kernels.exact import advance as advance_crank
from chaosgym.machines.slider_crank.kernels.propagator import table_places
from chaosgym.machines.slider_crank.kernels.stepped import SteppedCrankModel
from chaosgym.machines.slider_crank.kernels.stepped import advance as advance_stepped_crank


@intrinsic
def pointer(typing_context, address):
    """Turn an integer into a pointer."""

    def build(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return types.voidptr(types.intp), build


@njit(cache=True, inline="always")
def crank_of(batch, i):
    """Model of machine i of a batch that holds the addresses of the tables."""
    m, n = batch.row.shape[1:]
    size = batch.radix[i] ** m * batch.bins[i] * table_places(n, m).length
    return SliderCrankModel(
        batch.bin_duration[i],
        batch.bins[i],
        batch.steps[i],
        batch.contact_rate[i],
        batch.order[i],
        batch.spectrum[i],
        batch.row[i],
        batch.gap[i],
        batch.stiffness[i],
        batch.damping[i],
        batch.two_sided[i],
        batch.radix[i],
        batch.reading[i],
        batch.reach[i],
        batch.display[i],
        batch.anchor[i],
        carray(pointer(batch.table[i]), (size,), np.float64),
    )


@side_by_side
def advance_cranks(batch, which, motions, arrays, settings, outcome):
    """As ``advance_beams``, for slider cranks."""
    for k in prange(which.shape[0]):
        i = which[k]
        outcome[k] = advance_crank(
            crank_of(batch, i),
            motions.coordinates[i],
            episode_of(motions, i),
            rows_of(arrays, k),
            settings.event_tolerance / batch.contact_rate[i],
            settings.event_budget,
            no_tangents(motions.coordinates.shape[1], 0),
        )[0]


# cycles are looped over in a function of its own, as in ``core.varied``
@njit(cache=True)
def _kick_crank(model, kicks, coordinates, scale, episode, arrays, settings, k):
    half = kicks.shape[2]
    for cycle in range(kicks.shape[1]):
        for c in range(coordinates.shape[0]):
            scale[c] = max(scale[c], abs(coordinates[c]))
        for c in range(half):
            coordinates[half + c] += kicks[k, cycle, c] * scale[half + c]
        outcome = advance_crank(
            model,
            coordinates,
            episode,
            cycle_of(arrays, k, cycle),
            settings.event_tolerance / model.contact_rate,
            settings.event_budget,
            no_tangents(coordinates.shape[0], 0),
        )[0]
        if outcome != 0:
            return outcome
    return 0


@side_by_side
def advance_kicked_cranks(batch, which, kicks, motions, scale, arrays, settings, outcome):
    """As ``advance_cranks``; before each cycle velocities change by ``kicks`` (k, cycles, n_states / 2).

    These are shares of the largest velocities so far, which ``scale`` (N, n_states) keeps.
    """
    for k in prange(which.shape[0]):
        i = which[k]
        model, episode = crank_of(batch, i), episode_of(motions, i)
        outcome[k] = _kick_crank(model, kicks, motions.coordinates[i], scale[i], episode, arrays, settings, k)


@njit(cache=True, inline="always")
def stepped_crank_of(batch, i):
    """Model of machine i."""
    return SteppedCrankModel(
        batch.bin_duration[i],
        batch.steps[i],
        batch.longest[i],
        batch.tolerance[i],
        batch.contact_rate[i],
        batch.acceleration[i],
        batch.first[i],
        batch.row[i],
        batch.gap[i],
        batch.stiffness[i],
        batch.damping[i],
        batch.law[i],
        batch.slides[i],
        batch.two_sided[i],
        batch.reading[i],
        batch.monitored[i],
        batch.display[i],
    )


@side_by_side
def advance_stepped_cranks(batch, which, motions, arrays, settings, outcome):
    """As ``advance_beams``, for slider cranks that move by Taylor series."""
    for k in prange(which.shape[0]):
        i = which[k]
        outcome[k] = advance_stepped_crank(
            stepped_crank_of(batch, i),
            motions.coordinates[i],
            episode_of(motions, i),
            rows_of(arrays, k),
            settings.event_tolerance / batch.contact_rate[i],
            settings.event_budget,
        )[0]
