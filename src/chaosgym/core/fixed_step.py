r"""Fixed steps of Runge-Kutta for machines with modal impacts: the comparison for exact propagation.

The classical Runge-Kutta method of order four on the equations of ``modal_model``, with the same contact force and no
event location: touch and release are placed to O(h), so each impact gains or loses a little energy.
That can turn a periodic response into chaos and the reverse.
"""

import math

import numpy as np

from chaosgym.core import status
from chaosgym.core.cycle import LOWER, UPPER
from chaosgym.core.events import let_pass, note_touch
from chaosgym.core.kernel import njit

STABILITY_LIMIT = 2.7
"""Largest step times fastest angular frequency; the method grows undamped oscillations from 2.83 on."""

RUNAWAY = 1e9
"""Tip displacement [m] that counts as divergence."""


@njit(cache=True, inline="always")
def pressing_force(penetration, penetration_rate, stiffness, damping):
    """Force [N] of spring and damper of a surface in contact, positive away from it; negative where they would pull.

    ``penetration`` [m] is how far the tip lies beyond the surface, ``penetration_rate`` [m/s] its rate. The law is
    linear, so the rates of both give the rate of the force [N/s].
    """
    return stiffness * penetration + damping * penetration_rate


@njit(cache=True, inline="always")
def contact_force(penetration, penetration_rate, stiffness, damping):
    """Force [N] of a surface on the tip: zero inside the gap, and beyond it as soon as spring and damper would pull."""
    if penetration <= 0.0:
        return 0.0
    return max(0.0, pressing_force(penetration, penetration_rate, stiffness, damping))


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
def surface_force(model, x, v):
    """Contact force on the tip: positive from the upper stop, negative from the lower."""
    k, d = model.contact_stiffness, model.contact_damping
    if x > model.stops[0]:
        return contact_force(x - model.stops[0], v, k[0], d[0])
    return -contact_force(model.stops[1] - x, -v, k[1], d[1])


@njit(cache=True)
def _load(model, phase, load):
    """Modal forces (n,) of drive and static force at a phase of the cycle [rad]."""
    omega = 2.0 * math.pi * model.excitation_frequency
    for i in range(load.shape[0]):
        load[i] = model.static_force[i]
    for g in range(model.drive.shape[1]):
        c, s = math.cos((g + 1) * phase), math.sin((g + 1) * phase)
        for i in range(load.shape[0]):
            load[i] += (model.drive[0, g, 0, i] + omega * omega * model.drive[1, g, 0, i]) * c
            load[i] += (model.drive[0, g, 1, i] + omega * omega * model.drive[1, g, 1, i]) * s


@njit(cache=True)
def _slope(model, state, load, slope):
    """Time derivative of the modal state (2n,)."""
    n = model.stiffness.shape[0]
    x, v = tip_of_state(model, state)
    force = surface_force(model, x, v)
    for i in range(n):
        slope[i] = state[n + i]
        total = load[i] - model.tip_shape[i] * force - model.stiffness[i] * state[i]
        for j in range(n):
            total -= model.damping[i, j] * state[n + j]
        slope[n + i] = total


@njit(cache=True, inline="always")
def _sample(model, state, history, cycle, sample):
    """Write tip displacement, velocity and contact force."""
    x, v = tip_of_state(model, state)
    history[cycle, sample, 0] = x
    history[cycle, sample, 1] = v
    history[cycle, sample, 2] = surface_force(model, x, v)


@njit(cache=True, nogil=True)
def advance_fixed_step(model, state, bouncing, arrays, steps):
    """Advance ``state`` and ``bouncing`` by whole cycles of ``steps`` equal steps; see ``modal_impact.advance``.

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
    inner, load = np.empty(n2), np.empty(n2 // 2)
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
            _load(model, omega * h * step, load)
            _slope(model, state, load, k1)
            _load(model, omega * h * (step + 0.5), load)
            for i in range(n2):
                inner[i] = state[i] + 0.5 * h * k1[i]
            _slope(model, inner, load, k2)
            for i in range(n2):
                inner[i] = state[i] + 0.5 * h * k2[i]
            _slope(model, inner, load, k3)
            for i in range(n2):
                inner[i] = state[i] + h * k3[i]
            _load(model, omega * h * (step + 1), load)
            _slope(model, inner, load, k4)
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
                    note_touch(bouncing, 1, 0, side, (step + 1) * h, arrays.bounce_time[cycle])
            before = force
        while sample < samples:
            _sample(model, state, arrays.history, cycle, sample)
            sample += 1
        arrays.events[cycle] = 0
        if not abs(x) < RUNAWAY:
            return status.DIVERGED, cycle
        let_pass(bouncing, 1, period)
    return status.OK, arrays.section.shape[0]
