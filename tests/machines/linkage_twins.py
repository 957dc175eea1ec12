"""Full nonlinear motion of linkages with clearance, by hand in minimal coordinates and by SciPy's DOP853.

Nothing here is taken from the library: neither its compatibility matrices nor its contacts. Each returns the size of
the contact force [N] and the displacement across at equal instants of some cycles from the nominal motion on.
"""

import math

import numpy as np
from scipy.integrate import solve_ivp


def pressed(apart, rate, gap, stiffness, damping, hertz=False):
    """Force of a pin in its hole on the pin, which lies ``apart`` from the hole's middle: linear, or Hertzian."""
    distance = math.hypot(*apart)
    if distance <= gap:
        return np.zeros(len(apart))
    unit, depth = apart / distance, distance - gap
    approach = damping * float(unit @ rate)
    push = stiffness * depth**1.5 * (1.0 + approach) if hertz else stiffness * depth + approach
    return -max(0.0, push) * unit


def _axes(angle):
    return np.array([math.cos(angle), math.sin(angle)]), np.array([-math.sin(angle), math.cos(angle)])


def _pin(time, crank, rate):
    """Place, velocity and acceleration of the crank pin."""
    along, across = _axes(rate * time)
    return crank * along, crank * rate * across, -crank * rate**2 * along


def _solved(slope, start, rate, cycles, samples, steps):
    period = 2.0 * math.pi / rate
    instants = np.arange(cycles * samples) * period / samples
    found = solve_ivp(
        slope, (0.0, instants[-1]), start, "DOP853", instants, rtol=1e-9, atol=1e-13, max_step=period / steps
    )
    assert found.success
    return instants, found.y.T


def wrist_pin(
    rate,
    gap,
    stiffness,
    damping,
    cycles,
    samples,
    crank,
    rod,
    rod_mass,
    rod_inertia,
    slider,
    gravity=9.81,
    hertz=False,
    friction=0.0,
    radius=0.0,
):
    """Slider crank whose wrist pin has clearance: angle of the rod and place of the slider.

    Friction acts at the pin's surface; it fades below 2 % of the largest speed at which the tight rod turns.
    """

    def gap_of(time, state):
        (place, speed, _), (along, across) = _pin(time, crank, rate), _axes(state[0])
        apart = np.array([state[1], 0.0]) - place - rod * along
        return apart, np.array([state[3], 0.0]) - speed - rod * state[2] * across, across

    def slope(time, state):
        apart, change, across = gap_of(time, state)
        force = pressed(apart, change, gap, stiffness, damping, hertz)
        # the pin stands still in the slider, and the rod turns around it
        rub = friction * min(1.0, max(-1.0, -state[2] / (0.02 * crank / rod * rate)))
        moment = rub * radius * math.hypot(*force)
        force = force + rub * np.array([-force[1], force[0]])
        lifted = _pin(time, crank, rate)[2] + np.array([0.0, gravity])
        turn = moment - rod_mass * 0.5 * rod * float(across @ lifted) - rod * float(across @ force)
        return [state[2], state[3], turn / (rod_inertia + rod_mass * rod**2 / 4.0), force[0] / slider]

    start = [0.0, crank + rod, -crank / rod * rate, 0.0]
    instants, states = _solved(slope, start, rate, cycles, samples, 1000)
    both = zip(instants, states, strict=True)
    return np.array([math.hypot(*pressed(*gap_of(t, y)[:2], gap, stiffness, damping, hertz)) for t, y in both]), states


def pin_and_guide(
    rate,
    gaps,
    stiffness,
    damping,
    cycles,
    samples,
    crank,
    rod,
    rod_mass,
    rod_inertia,
    slider,
    radius,
    laws,
):
    """Slider crank with clearance at the wrist pin and in the guide, which holds the slider's turn; both rub.

    ``gaps``, ``stiffness``, ``damping`` and ``laws``, coefficients with the sign of the sliding speed, are those of
    pin and guide. Returns the forces of both.
    """

    def forces(time, state):
        place, speed, _ = _pin(time, crank, rate)
        along, across = _axes(state[0])
        apart = state[1:3] - place - rod * along
        change = state[4:6] - speed - rod * state[3] * across
        pin = pressed(apart, change, gaps[0], stiffness[0], damping[0])
        return pin, pressed(state[2:3], state[5:6], gaps[1], stiffness[1], damping[1])[0], across

    def slope(time, state):
        pin, guide, across = forces(time, state)
        rub = laws[0](-radius * state[3])
        moment = rub * radius * math.hypot(*pin)
        pin = pin + rub * np.array([-pin[1], pin[0]])
        lifted = _pin(time, crank, rate)[2] + np.array([0.0, 9.81])
        turn = moment - rod_mass * 0.5 * rod * float(across @ lifted) - rod * float(across @ pin)
        pull = [pin[0] - laws[1](state[4]) * abs(guide), pin[1] + guide - slider * 9.81]
        return [*state[3:], turn / (rod_inertia + rod_mass * rod**2 / 4.0), *(each / slider for each in pull)]

    start = [0.0, crank + rod, 0.0, -crank / rod * rate, 0.0, 0.0]
    instants, states = _solved(slope, start, rate, cycles, samples, 1000)
    found = [forces(t, y) for t, y in zip(instants, states, strict=True)]
    return np.array([(math.hypot(*pin), abs(guide)) for pin, guide, _ in found]).T


def knee(rate, gap, stiffness, damping, cycles, samples, ground, crank, coupler, rocker, gravity=9.81):
    """Four-bar of uniform bars of 1 kg with clearance between coupler and rocker: their two angles."""

    def gap_of(time, state):
        place, speed, _ = _pin(time, crank, rate)
        (along, across), (forth, aside) = _axes(state[0]), _axes(state[1])
        apart = np.array([ground, 0.0]) + rocker * forth - place - coupler * along
        return apart, rocker * state[3] * aside - speed - coupler * state[2] * across, across, aside

    def slope(time, state):
        apart, change, across, aside = gap_of(time, state)
        force = pressed(apart, change, gap, stiffness, damping)
        lifted = _pin(time, crank, rate)[2] + np.array([0.0, gravity])
        first = -0.5 * coupler * float(across @ lifted) - coupler * float(across @ force)
        second = -0.5 * rocker * gravity * aside[1] + rocker * float(aside @ force)
        return [state[2], state[3], first / (coupler**2 / 3.0), second / (rocker**2 / 3.0)]

    apart = ground - crank
    along = (coupler**2 - rocker**2 + apart**2) / (2.0 * apart)
    high = math.sqrt(coupler**2 - along**2)
    angles = [math.atan2(high, along), math.atan2(high, along - apart)]
    (_, across), (_, aside) = _axes(angles[0]), _axes(angles[1])
    rates = np.linalg.solve(np.stack([coupler * across, -rocker * aside], axis=1), -_pin(0.0, crank, rate)[1])
    instants, states = _solved(slope, [*angles, *rates], rate, cycles, samples, 1000)
    both = zip(instants, states, strict=True)
    return np.array([math.hypot(*pressed(*gap_of(t, y)[:2], gap, stiffness, damping)) for t, y in both]), states


def guide(
    rate,
    gap,
    stiffness,
    damping,
    cycles,
    samples,
    crank,
    rod,
    half,
    rod_mass,
    rod_inertia,
    slider,
    pitch_inertia,
    friction=0.0,
):
    """Slider crank whose slider, 2 ``half`` long, has clearance in its guide: angles of rod and slider.

    Friction acts on its axis; it fades below 2 % of the largest speed at which the tight slider moves.
    """
    every = np.linspace(0.0, 2.0 * math.pi, 100_001)
    fades = (
        0.02 * np.abs(np.gradient(crank * np.cos(every) + np.sqrt(rod**2 - (crank * np.sin(every)) ** 2), every)).max()
    )

    def touches(time, state):
        phi, pitch, turn, tilt = state
        height = crank * math.sin(rate * time) + rod * math.sin(phi)
        climb = crank * rate * math.cos(rate * time) + rod * turn * math.cos(phi)
        found = []
        for end in (-half, half):
            arm = end * math.cos(pitch)
            y, v = height + end * math.sin(pitch), climb + arm * tilt
            for side in (1.0, -1.0):
                depth = side * y - gap
                push = max(0.0, stiffness * depth + damping * side * v) if depth > 0.0 else 0.0
                found.append((-side * push, arm))
        return found

    def slope(time, state):
        found = touches(time, state)
        across = _axes(state[0])[1]
        lifted = _pin(time, crank, rate)[2] + np.array([0.0, 9.81])
        push, moment = sum(f for f, _ in found), sum(f * arm for f, arm in found)
        slid = -(crank * rate * math.sin(rate * time) + rod * state[2] * math.sin(state[0]))
        rub = -friction * min(1.0, max(-1.0, slid / (fades * rate))) * sum(abs(f) for f, _ in found)
        # slider at the rod's end: its own pull along the rod cancels in the rod's turn
        turn = -(0.5 * rod_mass + slider) * rod * float(across @ lifted) + rod * across[1] * push
        turn += rod * across[0] * rub
        inertia = rod_inertia + (rod_mass / 4.0 + slider) * rod**2
        return [state[2], state[3], turn / inertia, moment / pitch_inertia]

    instants, states = _solved(slope, [0.0, 0.0, -crank / rod * rate, 0.0], rate, cycles, samples, 1500)
    forces = [abs(sum(f for f, _ in touches(t, y))) for t, y in zip(instants, states, strict=True)]
    return np.array(forces), states
