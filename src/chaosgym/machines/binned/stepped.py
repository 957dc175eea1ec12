"""The model by which any machine of bins moves as Taylor series, contact forces included."""

import math
from functools import lru_cache

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core.binned.model import FORCING_TERMS, TaylorModel
from chaosgym.core.matrices import product
from chaosgym.machines.binned.equations import even_powers, largest_rate, whole_steps
from chaosgym.machines.binned.held_machine import HeldMachine, kept_held, structure_of

PIECE_PHASE = 2.0
"""Longest piece of a Taylor series times largest eigenvalue without contact."""

SPAN_PHASE = 5.0
"""Longest span of a Taylor series times largest eigenvalue without contact: stable for modes damped by 0.1 %."""

SPAN_ERROR = 1e-10
"""Last terms [m/s] of the Taylor series of velocities at the end of a span, by default."""

PIN_ROWS = 2
"""Directions of a pin in the plane."""

KEPT_STEPPED = 16
"""Models for Taylor series that are kept: some hundred kB each."""


@lru_cache(maxsize=KEPT_STEPPED)
def stepped_model(machine: HeldMachine, step_phase: float) -> TaylorModel:
    """Model of any machine for Taylor series; kept for the last machines, which a search asks for again and again.

    A closed contact turns by ``step_phase`` / 4 in a piece of a series; half of it leaves a sixteenth of the error.
    """
    inverse_mass, free, forcing, friction, tangent = kept_held(structure_of(machine))
    contacts = machine.contacts
    row = np.concatenate([contact.row for contact in contacts])
    rate = machine.crank_rate
    acceleration = _free_motion(free, forcing, rate)
    first = np.cumsum([0] + [len(contact.row) for contact in contacts])
    answer = np.swapaxes(product(inverse_mass, row.T), -1, -2)
    for at, each in zip(first, contacts, strict=False):
        if each.slides >= 0 and len(each.row) == PIN_ROWS:
            across = np.array([answer[:, at + 1], -answer[:, at]])
            answer[:, at : at + PIN_ROWS] += np.swapaxes(tangent[each.slides][:, None] * across, 0, 1)
    slide = -np.einsum("bij,sbj->bsi", inverse_mass, friction)
    contact = math.sqrt(machine.stiffest * np.max(np.einsum("brn,rn->br", answer, row)))
    bins = len(inverse_mass)
    duration = 2.0 * math.pi / (bins * rate)
    spectrum = largest_rate(acceleration[machine.sampled_bins, : 2 * len(row[0])])
    return TaylorModel(
        bin_duration=duration,
        steps=whole_steps(duration * max(4.0 * contact / step_phase, spectrum / PIECE_PHASE)),
        longest=duration / max(1.0, duration * spectrum / SPAN_PHASE),
        tolerance=SPAN_ERROR * step_phase**4,
        contact_rate=contact,
        acceleration=_with_readings(np.concatenate([acceleration, -answer, slide], axis=1), row),
        first=first,
        row=row,
        gap=np.array([contact.gap for contact in contacts]),
        stiffness=np.array([contact.stiffness for contact in contacts]),
        damping=np.array([contact.damping for contact in contacts]),
        exponent=np.array([contact.exponent for contact in contacts]),
        slides=np.array([contact.slides for contact in contacts]),
        two_sided=np.array([contact.two_sided for contact in contacts]),
        reading=np.concatenate([contact.reading for contact in contacts]),
        monitored=np.array([bool(np.any(contact.reading)) for contact in contacts]),
        display=machine.display,
    )


def _free_motion(free: Array, forcing: Array, rate: float) -> Array:
    """Accelerations without contact at a crank rate, (bins, 2n + 4, n)."""
    driven = even_powers(forcing, rate)
    return np.concatenate([free[0] + rate * free[1] + rate**2 * free[2], driven[0] + rate**2 * driven[1]], axis=1)


def _with_readings(accelerations: Array, row: Array) -> Array:
    """Lanes of ``TaylorModel`` of accelerations (..., n)."""
    from chaosgym.core.lanes import padded

    rows, n = row.shape
    lanes = np.zeros((*accelerations.shape[:-1], padded(rows + n)))
    lanes[..., :rows] = product(accelerations, row.T)
    lanes[..., rows : rows + n] = accelerations
    return lanes


def fastest_rate(machine: HeldMachine, model: TaylorModel) -> float:
    """Largest modulus [1/s] of an eigenvalue with every contact closed."""
    rows, n = model.row.shape
    some = model.acceleration[machine.sampled_bins, :, rows : rows + n]
    pushes = slice(2 * n + FORCING_TERMS, 2 * n + FORCING_TERMS + rows)
    accelerations = some[:, : 2 * n].copy()
    accelerations[:, :n] += product(machine.stiffest * model.row.T, some[:, pushes])
    return largest_rate(accelerations)
