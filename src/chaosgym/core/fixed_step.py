r"""Fixed steps of Runge-Kutta for machines with modal impacts: the comparison for exact propagation.

The classical Runge-Kutta method of order four on q'' = -D q' - K q + phi_f F sin(w t) - phi_t N, with the same contact
force N and no event location: touch and release are placed to O(h), so each impact gains or loses a little energy.
That can turn a periodic response into chaos and the reverse.
"""

import math

import numpy as np
from numba import njit

from chaosgym.core import status
from chaosgym.core.contact import contact_force
from chaosgym.core.cycle import LOWER, UPPER, note_touch
from chaosgym.core.modal_impact import tip_of_state

STABILITY_LIMIT = 2.7
"""Largest step times fastest angular frequency; the method grows undamped oscillations from 2.83 on."""

RUNAWAY = 1e9
"""Tip displacement [m] that counts as divergence."""


@njit(cache=True, inline="always")
def surface_force(model, x, v):
    """Contact force on the tip: positive from the upper surface, negative from the lower."""
    if x > 0.0:
        return contact_force(x - model.clearance, v, model.contact_stiffness, model.contact_damping)
    return -contact_force(-x - model.clearance, -v, model.contact_stiffness, model.contact_damping)


@njit(cache=True)
def _slope(model, state, sine, slope):
    """Time derivative of the modal state (2n,); returns the contact force."""
    n = model.stiffness.shape[0]
    x, v = tip_of_state(model, state)
    force = surface_force(model, x, v)
    for i in range(n):
        slope[i] = state[n + i]
        total = model.force_shape[i] * model.force_amplitude * sine - model.tip_shape[i] * force
        total -= model.stiffness[i] * state[i]
        for j in range(n):
            total -= model.damping[i, j] * state[n + j]
        slope[n + i] = total
    return force


@njit(cache=True, inline="always")
def _sample(model, state, history, cycle, sample):
    """Write tip displacement, velocity and contact force."""
    x, v = tip_of_state(model, state)
    history[cycle, sample, 0] = x
    history[cycle, sample, 1] = v
    history[cycle, sample, 2] = surface_force(model, x, v)


@njit(cache=True, nogil=True)
def advance_fixed_step(model, state, episode, arrays, steps):
    """Advance ``state`` and ``episode`` by whole cycles of ``steps`` equal steps; see ``impact_beam.advance``.

    Peaks and samples are taken at the ends of steps, a sample at the next one after its instant.
    """
    n2 = state.shape[0]
    omega = 2.0 * math.pi * model.excitation_frequency
    period = 1.0 / model.excitation_frequency
    h = period / steps
    fastest = max(model.regimes.fastest[0], model.regimes.fastest[1])
    if h * fastest > STABILITY_LIMIT:
        return status.STEP_TOO_COARSE, 0
    samples = arrays.history.shape[1]
    k1, k2, k3, k4 = np.empty(n2), np.empty(n2), np.empty(n2), np.empty(n2)
    inner = np.empty(n2)
    for cycle in range(arrays.section.shape[0]):
        arrays.section[cycle] = state
        arrays.tip[cycle, 0], arrays.tip[cycle, 1] = tip_of_state(model, state)
        for column in range(2):
            arrays.peak_force[cycle, column] = 0.0
            arrays.impacts[cycle, column] = 0
            arrays.contact_time[cycle, column] = 0.0
            arrays.bounce_time[cycle, column] = 0.0
        sample = 0
        before = surface_force(model, arrays.tip[cycle, 0], arrays.tip[cycle, 1])
        for step in range(steps):
            while sample < samples and sample * steps <= step * samples:
                _sample(model, state, arrays.history, cycle, sample)
                sample += 1
            sine0 = math.sin(omega * h * step)
            sine1 = math.sin(omega * h * (step + 0.5))
            sine2 = math.sin(omega * h * (step + 1))
            _slope(model, state, sine0, k1)
            for i in range(n2):
                inner[i] = state[i] + 0.5 * h * k1[i]
            _slope(model, inner, sine1, k2)
            for i in range(n2):
                inner[i] = state[i] + 0.5 * h * k2[i]
            _slope(model, inner, sine1, k3)
            for i in range(n2):
                inner[i] = state[i] + h * k3[i]
            _slope(model, inner, sine2, k4)
            for i in range(n2):
                state[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
            x, v = tip_of_state(model, state)
            force = surface_force(model, x, v)
            if force != 0.0:
                side = 1.0 if force > 0.0 else -1.0
                column = UPPER if force > 0.0 else LOWER
                arrays.peak_force[cycle, column] = max(arrays.peak_force[cycle, column], abs(force))
                arrays.contact_time[cycle, column] += h
                if before * side <= 0.0:
                    arrays.impacts[cycle, column] += 1
                    note_touch(episode, side, (step + 1) * h, arrays.bounce_time[cycle])
            before = force
        while sample < samples:
            _sample(model, state, arrays.history, cycle, sample)
            sample += 1
        arrays.events[cycle] = 0
        if not abs(x) < RUNAWAY:
            return status.DIVERGED, cycle
        episode.touch[0] -= period
        episode.touch[1] -= period
    return status.OK, arrays.section.shape[0]
