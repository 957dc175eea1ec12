"""The slider crank once more, by other means: Runge-Kutta with continuous matrices, and the exact rigid pendulum."""

import math

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from chaosgym.machines.slider_crank.equations import equations


@njit(cache=True)
def _march(a, f, push, row, k, d, gap, h, samples, out):
    """Classical Runge-Kutta on p'' = a (p, p') + f + push N from rest; stages at every half step of a and f.

    In plain loops, which compile in a fraction of the time of products of matrices.
    """
    n = f.shape[1]
    z, stage_z, slope, total = np.zeros(2 * n), np.zeros(2 * n), np.zeros(2 * n), np.zeros(2 * n)
    peak = 0.0
    for step in range((a.shape[0] - 1) // 2):
        for stage in range(4):
            at = 2 * step + (stage + 1) // 2
            share = 0.5 * ((stage + 1) // 2)
            y = w = 0.0
            for i in range(2 * n):
                stage_z[i] = z[i] + h * share * slope[i] if stage > 0 else z[i]
            for i in range(n):
                y += row[i] * stage_z[i]
                w += row[i] * stage_z[n + i]
            force = 0.0
            if y > gap:
                force = max(0.0, k * (y - gap) + d * w)
            elif y < -gap:
                force = min(0.0, k * (y + gap) + d * w)
            if stage == 0:
                peak = max(peak, abs(force))
                if step % samples == 0:
                    out[step // samples, 0], out[step // samples, 1] = y, w
            for i in range(n):
                slope[i] = stage_z[n + i]
                slope[n + i] = f[at, i] - push[at, i] * force
                for j in range(2 * n):
                    slope[n + i] += a[at, i, j] * stage_z[j]
            for i in range(2 * n):
                total[i] = (0.0 if stage == 0 else total[i]) + (1.0 if stage in (0, 3) else 2.0) * slope[i]
        for i in range(2 * n):
            z[i] += h / 6.0 * total[i]
    return peak


def continuous_twin(machine, degrees, steps, samples):
    """(Displacement, velocity) and peak force of a run from rest with matrices that follow the crank."""
    grid = np.linspace(0.0, 2.0 * math.pi, 721)
    system = equations(machine, grid)
    rate = machine.crank_rate
    inverse = np.linalg.inv(system.mass)
    stiffness = system.stiffness[0] + rate * system.stiffness[1] + rate**2 * system.stiffness[2]
    damping = system.damping[0] + rate * system.damping[1]
    a = -np.concatenate([inverse @ stiffness, inverse @ damping], axis=-1)
    f = -np.einsum("bij,bj->bi", inverse, system.load[0] + rate**2 * system.load[1])
    row = np.array([float(name == "slider across the guide") for name in machine.degrees_of_freedom])
    push = inverse @ row
    at = np.linspace(0.0, math.radians(degrees), 2 * steps + 1)
    spline = [np.ascontiguousarray(CubicSpline(grid, part, axis=0)(at)) for part in (a, f, push)]
    out = np.empty((steps // samples, 2))
    h = math.radians(degrees) / rate / steps
    peak = _march(
        *spline, row, machine.contact_stiffness, machine.contact_damping, machine.slider_clearance, h, samples, out
    )
    return out, peak


def rigid_twin(machine, instants):
    """Displacement (len(instants),) of a rigid rod's slider by the exact, nonlinear pendulum, DOP853."""
    m_rod = machine.density * math.pi * machine.rod_diameter**2 / 4 * machine.rod_length
    r, length, rate = machine.crank_radius, machine.rod_length, machine.crank_rate
    inertia = machine.slider_mass * length**2 + m_rod * length**2 / 3 + machine.housing_inertia + machine.yoke_inertia
    inertia += machine.yoke_mass * (length**2 + 2 * length * machine.yoke_offset_along)
    first = machine.slider_mass * length + m_rod * length / 2 + machine.housing_mass * machine.housing_offset_along
    first += machine.yoke_mass * (length + machine.yoke_offset_along)
    k, d, gap = machine.contact_stiffness, machine.contact_damping, machine.slider_clearance

    def slope(t, state):
        phi, phi_rate = state
        theta = rate * t
        y = r * math.sin(theta) - length * math.sin(phi)
        w = r * rate * math.cos(theta) - length * math.cos(phi) * phi_rate
        force = 0.0
        if y > gap:
            force = max(0.0, k * (y - gap) + d * w)
        elif y < -gap:
            force = min(0.0, k * (y + gap) + d * w)
        moment = first * machine.gravity * math.cos(phi) + force * length * math.cos(phi)
        moment -= first * r * rate**2 * math.sin(theta + phi)
        return [phi_rate, moment / inertia]

    run = solve_ivp(
        slope,
        (0.0, instants[-1]),
        [0.0, r * rate / length],
        method="DOP853",
        t_eval=instants,
        rtol=1e-10,
        atol=1e-13,
        max_step=2e-5,
    )
    return r * np.sin(rate * instants) - length * np.sin(run.y[0])


def rigid_ball_twin(machine, instants):
    """Eccentricity (len(instants), 2) along and across the nominal rod of a ball in a shell, the slider tight, DOP853.

    The exact, nonlinear motion of the slider (x) and of the rod (phi) that swings about it, no offsets.
    """
    m_rod = machine.density * math.pi * machine.rod_diameter**2 / 4 * machine.rod_length
    r, length, rate = machine.crank_radius, machine.rod_length, machine.crank_rate
    total = machine.slider_mass + machine.yoke_mass + machine.housing_mass + m_rod
    first = machine.housing_mass * length + m_rod * length / 2
    inertia = machine.housing_mass * length**2 + m_rod * length**2 / 3 + machine.housing_inertia + machine.yoke_inertia
    k, d, gap = machine.contact_stiffness, machine.contact_damping, machine.ball_clearance

    def eccentricity(t, state):
        x, phi, x_rate, phi_rate = state
        theta = rate * t
        e = np.array([r * np.cos(theta) - x + length * np.cos(phi), r * np.sin(theta) - length * np.sin(phi)])
        e_rate = np.array(
            [
                -r * rate * np.sin(theta) - x_rate - length * np.sin(phi) * phi_rate,
                r * rate * np.cos(theta) - length * np.cos(phi) * phi_rate,
            ]
        )
        return e, e_rate

    def slope(t, state):
        _, phi, x_rate, phi_rate = state
        e, e_rate = eccentricity(t, state)
        size = np.hypot(*e)
        force = np.zeros(2)
        if size > gap:
            force = max(0.0, k * (size - gap) + d * (e @ e_rate) / size) * e / size
        sine, cosine = math.sin(phi), math.cos(phi)
        mass = np.array([[total, first * sine], [first * sine, inertia]])
        load = [
            force[0] - first * cosine * phi_rate**2,
            force[0] * length * sine + force[1] * length * cosine - first * machine.gravity * cosine,
        ]
        return np.concatenate([[x_rate, phi_rate], np.linalg.solve(mass, load)])

    start = [r + length, 0.0, 0.0, r * rate / length]
    run = solve_ivp(
        slope, (0.0, instants[-1]), start, method="DOP853", t_eval=instants, rtol=1e-9, atol=1e-12, max_step=1e-4
    )
    e, _ = eccentricity(instants, run.y)
    phi = np.arcsin(r / length * np.sin(rate * instants))
    return np.column_stack([e[0] * np.cos(phi) - e[1] * np.sin(phi), e[0] * np.sin(phi) + e[1] * np.cos(phi)])
