"""Many machines with modal impacts at once: each by its own ``advance``.

A batch of models is a model whose fields have one more axis, the machines, in front. Tables, which are large, stay
where they are, and the batch holds their addresses: machines of one structure share them.
"""

from typing import NamedTuple

import numpy as np
from numba import carray

from chaosgym.core.addresses import pointer
from chaosgym.core.cycle import CycleArrays
from chaosgym.core.kernel import njit
from chaosgym.core.modal_impact import advance_model
from chaosgym.core.modal_model import ModalImpactModel, Regimes, Tables
from chaosgym.core.tangent import no_tangents


class Motions(NamedTuple):
    """Where N machines are: ``coordinates`` (N, n_states), ``bouncing`` (N, 3), as in a ``MotionState``."""

    coordinates: np.ndarray
    bouncing: np.ndarray


class TablesOfMany(NamedTuple):
    """``Tables`` of N machines with R regimes each.

    ``step_phase`` (N,) and ``shortest`` (N, R) are as there; the values, of ``shape`` (N, 2), lie at ``address`` (N,).
    """

    step_phase: np.ndarray
    shortest: np.ndarray
    address: np.ndarray
    shape: np.ndarray


class Settings(NamedTuple):
    """Accuracy and budget of exact events, as in ``ExactEvents``."""

    step_phase: float
    event_tolerance: float
    event_budget: int


@njit(cache=True, inline="always")
def rows_of(arrays, k):
    """Arrays of the machine in row k."""
    return CycleArrays(
        arrays.section[k],
        arrays.tip[k],
        arrays.peak_force[k],
        arrays.impacts[k],
        arrays.contact_time[k],
        arrays.bounce_time[k],
        arrays.events[k],
        arrays.history[k],
        arrays.peak_instant[k],
        arrays.peak_vector[k],
        arrays.channel_peak[k],
    )


@njit(cache=True, inline="always")
def regimes_of(regimes, i):
    """Regimes of machine i."""
    return Regimes(
        regimes.generator[i], regimes.to_modal[i], regimes.from_modal[i], regimes.output[i], regimes.fastest[i]
    )


@njit(cache=True, inline="always")
def tables_of(tables, i):
    """Tables of machine i."""
    shape = tables.shape[i, 0], tables.shape[i, 1]
    return Tables(tables.step_phase[i], tables.shortest[i], carray(pointer(tables.address[i]), shape, np.float64))


@njit(cache=True, inline="always")
def beam_of(batch, regimes, tables, i):
    """Model of machine i."""
    return ModalImpactModel(
        batch.excitation_frequency[i],
        batch.drive[i],
        batch.static_force[i],
        batch.stops[i],
        batch.contact_stiffness[i],
        batch.contact_damping[i],
        batch.stiffness[i],
        batch.damping[i],
        batch.tip_shape[i],
        batch.pressed[i],
        regimes_of(regimes, i),
        batch.rest[i],
        batch.drift[i],
        batch.rest_penetration[i],
        tables_of(tables, i),
    )


@njit(nogil=True)
def advance_beams(first, end, batch, regimes, tables, which, motions, arrays, settings, outcome):
    """Advance the machines ``which`` (k,) of a batch in place by whole cycles; rows of ``arrays`` in that order.

    Writes the status of each into ``outcome`` (k,). Only the rows from ``first`` to before ``end`` are gone through, so
    that each thread has its own.
    """
    for k in range(first, end):
        i = which[k]
        outcome[k] = advance_model(
            beam_of(batch, regimes, tables, i),
            1.0,
            settings.step_phase,
            settings.event_tolerance,
            motions.coordinates[i],
            motions.bouncing[i],
            rows_of(arrays, k),
            settings.event_budget,
            no_tangents(motions.coordinates.shape[1], arrays.section.shape[1]),
        )[0]
