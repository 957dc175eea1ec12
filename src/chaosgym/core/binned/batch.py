"""Many mechanisms at once: each by its own ``advance``.

The large table of a mechanism stays where it is, and its batch holds the address: machines at equal speeds share
it.
"""

import numpy as np
from numba import carray

from chaosgym.core.addresses import pointer
from chaosgym.core.batch import rows_of
from chaosgym.core.binned.cycle import advance as advance_binned
from chaosgym.core.binned.model import BinnedModel, TaylorModel
from chaosgym.core.binned.tables import table_places
from chaosgym.core.binned.taylor import advance as advance_taylor
from chaosgym.core.kernel import njit
from chaosgym.core.tangent import no_tangents
from chaosgym.core.varied import cycle_of


@njit(cache=True, inline="always")
def binned_model_of(batch, i):
    """Model of machine i of a batch that holds the addresses of the tables."""
    m, n = batch.row.shape[1:]
    size = batch.radix[i] ** m * batch.bins[i] * table_places(n, m).length
    return BinnedModel(
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
        batch.share[i],
        batch.two_sided[i],
        batch.radix[i],
        batch.reading[i],
        batch.reach[i],
        batch.display[i],
        batch.anchor[i],
        carray(pointer(batch.table[i]), (size,), np.float64),
    )


@njit(nogil=True)
def advance_binned_machines(first, end, batch, which, motions, arrays, settings, outcome):
    """As ``advance_beams``, for mechanisms."""
    for k in range(first, end):
        i = which[k]
        outcome[k] = advance_binned(
            binned_model_of(batch, i),
            motions.coordinates[i],
            motions.bouncing[i],
            rows_of(arrays, k),
            settings.event_tolerance / batch.contact_rate[i],
            settings.event_budget,
            no_tangents(motions.coordinates.shape[1], 0),
        )[0]


# cycles are looped over in a function of its own, as in ``core.varied``
@njit(cache=True)
def _kick_crank(model, kicks, coordinates, scale, bouncing, arrays, settings, k):
    half = kicks.shape[2]
    for cycle in range(kicks.shape[1]):
        for c in range(coordinates.shape[0]):
            scale[c] = max(scale[c], abs(coordinates[c]))
        for c in range(half):
            coordinates[half + c] += kicks[k, cycle, c] * scale[half + c]
        outcome = advance_binned(
            model,
            coordinates,
            bouncing,
            cycle_of(arrays, k, cycle),
            settings.event_tolerance / model.contact_rate,
            settings.event_budget,
            no_tangents(coordinates.shape[0], 0),
        )[0]
        if outcome != 0:
            return outcome
    return 0


@njit(nogil=True)
def advance_kicked_machines(first, end, batch, which, kicks, motions, scale, arrays, settings, outcome):
    """As ``advance_binned_machines``; before each cycle velocities change by ``kicks`` (k, cycles, n_states / 2).

    These are shares of the largest velocities so far, which ``scale`` (N, n_states) keeps.
    """
    for k in range(first, end):
        i = which[k]
        model = binned_model_of(batch, i)
        outcome[k] = _kick_crank(
            model, kicks, motions.coordinates[i], scale[i], motions.bouncing[i], arrays, settings, k
        )


@njit(cache=True, inline="always")
def taylor_model_of(batch, i):
    """Model of machine i."""
    return TaylorModel(
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
        batch.exponent[i],
        batch.slides[i],
        batch.two_sided[i],
        batch.reading[i],
        batch.monitored[i],
        batch.display[i],
    )


@njit(nogil=True)
def advance_taylor_machines(first, end, batch, which, motions, arrays, settings, outcome):
    """As ``advance_beams``, for mechanisms that move by Taylor series."""
    for k in range(first, end):
        i = which[k]
        outcome[k] = advance_taylor(
            taylor_model_of(batch, i),
            motions.coordinates[i],
            motions.bouncing[i],
            rows_of(arrays, k),
            settings.event_tolerance / batch.contact_rate[i],
            settings.event_budget,
            no_tangents(motions.coordinates.shape[1], 0),
        )[0]
