"""A machine of a few modes by a general-purpose integrator with event location: the twin of the exact kernel."""

import numpy as np
from scipy.integrate import solve_ivp


def twin_trajectory(model, cycles, samples_per_cycle, max_phase=0.5):
    """Tip displacement, velocity and contact force at equal intervals, (cycles * samples_per_cycle, 3).

    DOP853 at rtol 1e-11 on the modal equations, restarted at every change between gap, contact and detached.
    """
    n = len(model.stiffness)
    omega = 2 * np.pi * model.excitation_frequency
    stops, stiffness, damping = (
        dict(zip((1.0, -1.0), values, strict=True))
        for values in (model.stops, model.contact_stiffness, model.contact_damping)
    )
    p = model.tip_shape
    drive = model.drive[0] + omega**2 * model.drive[1]
    harmonics = np.arange(1, len(drive) + 1)

    def force(y, side):
        return stiffness[side] * side * (p @ y[:n] - stops[side]) + damping[side] * side * (p @ y[n:])

    def slope(t, y, state, side):
        q, v = y[:n], y[n:]
        load = model.static_force - model.stiffness * q - model.damping @ v
        load = load + np.cos(harmonics * omega * t) @ drive[:, 0] + np.sin(harmonics * omega * t) @ drive[:, 1]
        if state == "contact":
            load = load - p * side * force(y, side)
        return np.concatenate([v, load])

    def event(function, direction):
        function.terminal, function.direction = True, direction
        return function

    upper = event(lambda t, y, state, side: p @ y[:n] - stops[1.0], 1)
    lower = event(lambda t, y, state, side: p @ y[:n] - stops[-1.0], -1)
    release = event(lambda t, y, state, side: force(y, side), -1)
    press = event(lambda t, y, state, side: force(y, side), 1)
    back = event(lambda t, y, state, side: side * (p @ y[:n] - stops[side]), -1)
    watched = {"gap": [upper, lower], "contact": [release], "detached": [back, press]}

    instants = np.arange(cycles * samples_per_cycle) / (samples_per_cycle * model.excitation_frequency)
    end = cycles / model.excitation_frequency
    out = np.empty((len(instants), 3))
    t, y, state, side = 0.0, np.zeros(2 * n), "gap", 1.0
    while t < end:
        run = solve_ivp(
            slope,
            (t, end),
            y,
            method="DOP853",
            rtol=1e-11,
            atol=1e-16,
            events=watched[state],
            args=(state, side),
            dense_output=True,
            max_step=max_phase / model.regimes.fastest.max(),
        )
        inside = (instants >= t) & (instants < run.t[-1])
        if inside.any():
            path = run.sol(instants[inside])
            out[inside, 0], out[inside, 1] = p @ path[:n], p @ path[n:]
            out[inside, 2] = [side * force(point, side) if state == "contact" else 0.0 for point in path.T]
        t, y = run.t[-1], run.y[:, -1]
        fired = next((i for i, times in enumerate(run.t_events) if len(times)), None)
        if fired is None:
            break
        if state == "gap":
            state, side = "contact", (1.0 if fired == 0 else -1.0)
        elif state == "contact":
            state = "detached"
        else:
            state = "gap" if fired == 0 else "contact"
    return out
