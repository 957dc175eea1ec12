r"""Equations of small motions of the planar slider crank about its nominal motion.

Rod coordinates (ends and modes, ``connecting_rod``) and the slider's (x_S, y_S, pitch) follow from as few coordinates
p as the scene requires, q = R(phi) p. Ball clearance opens the rod's end A in the frame of the rod, slider clearance
opens the slider across the guide, both in the frames in which the bearing surfaces stand still; a flexible rod adds its
stretch and its modes. Everything stiff, contacts and rod, then has a coordinate of its own: no elastic force depends on
phi, so none jumps where matrices that are held over a bin of crank angle change to those of the next. (The slider's
place along the guide instead of the stretch would make the rod's force jump by (E A / l) y d(tan phi) at every bin.)
With

    R' = w phi_1 R_phi,   R'' = w^2 (phi_1^2 R_phiphi + phi_2 R_phi),   Omega = -w phi_1,   Omega' = -w^2 phi_2

(phi_1, phi_2: derivatives of the rod angle by the crank angle, w: crank rate) the equations of the rod become

    M_p p'' + D_p p' + K_p p = Q_p - f_p
    M_p = R^T M R,   D_p = R^T (2 M R' + (C + 2 Omega G) R)
    K_p = R^T (M R'' + (C + 2 Omega G) R' + (K + K_geo + Omega' G - Omega^2 M_t) R)

Every term is a power of w times a function of the crank angle, so a change of speed costs a weighted sum.

References
----------
Thesis 2.2 (equations 2.4 to 2.8) and 4.3.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.machines.slider_crank.connecting_rod import (
    ACROSS_A,
    ACROSS_B,
    ALONG_A,
    ALONG_B,
    MODES,
    Bar,
    ConnectingRod,
    EndBody,
    connecting_rod,
)
from chaosgym.machines.slider_crank.kinematics import PlanarMotion, planar_motion
from chaosgym.machines.slider_crank.parameters import CrankParameters

Array = NDArray[np.float64]

ELEMENTS = 10
"""Finite elements of the rod, at least: its third natural frequency is right to 0.01 %. More modes take two a mode."""

BALL_ALONG = "ball along the rod"
BALL_ACROSS = "ball across the rod"
ROD_STRETCH = "rod stretch"
SLIDER_ACROSS = "slider across the guide"
SLIDER_PITCH = "slider pitch"
BALL_LATERAL = "ball sideways"
SLIDER_LATERAL = "slider sideways"
SLIDER_ROLL = "slider roll"
SLIDER_YAW = "slider yaw"
BALL_DIRECTIONS = (BALL_ALONG, BALL_ACROSS, BALL_LATERAL)
SLIDER_TURNS = (SLIDER_ROLL, SLIDER_YAW, SLIDER_PITCH)


def degrees_of_freedom(machine: CrankParameters, spatial: bool = False) -> tuple[str, ...]:
    """Names of the coordinates that the scene of a machine requires, in their order.

    ``spatial`` adds the sideways motion that a motor at an angle excites, also where it stands straight.
    """
    spatial = spatial or machine.is_spatial
    names: list[str] = []
    if machine.ball_joint != "ideal":
        names += [BALL_ALONG, BALL_ACROSS]
        names += [BALL_LATERAL] if spatial else []
    if machine.rod == "flexible":
        names.append(ROD_STRETCH)
    if machine.slider_joint != "ideal":
        names.append(SLIDER_ACROSS)
        names += [SLIDER_LATERAL] if spatial else []
    if machine.slider_joint == "instrumented":
        names += SLIDER_TURNS if spatial else (SLIDER_PITCH,)
    if machine.rod == "flexible":
        modes = range(1, 1 + machine.n_modes + machine.fitted_modes)
        names += [f"rod mode {i}" for i in modes]
        names += [f"sideways rod mode {i}" for i in modes] if spatial else []
    return tuple(names)


class Equations(NamedTuple):
    """Matrices of the module's equation at B crank angles, by powers of the crank rate w.

    Attributes
    ----------
    mass : (B, n, n)
    damping : (2, B, n, n)
        D_p = damping[0] + w damping[1].
    stiffness : (3, B, n, n)
        K_p = stiffness[0] + w stiffness[1] + w^2 stiffness[2].
    load : (2, B, n)
        f_p = load[0] + w^2 load[1]: gravity, and inertia of the nominal motion.
    slider_along : (B, n)
        Motion of the slider along the guide per unit coordinate.
    """

    mass: Array
    damping: Array
    stiffness: Array
    load: Array
    slider_along: Array


class _Inertia(NamedTuple):
    """Acceleration of the rod's frame, one row of gravity [m/s^2] and one per squared crank rate, each (2, B)."""

    along: Array
    across: Array
    spin: Array
    centrifugal: Array
    slider_along: Array
    slider_across: Array


def bar_of(machine: CrankParameters) -> Bar:
    """The rod without its end bodies."""
    return Bar(machine.rod_length, machine.rod_diameter, machine.youngs_modulus, machine.density)


def rod_of(machine: CrankParameters) -> ConnectingRod:
    """Rod with its end bodies, in the coordinates that the scene requires."""
    housing = EndBody(
        machine.housing_mass, machine.housing_inertia, machine.housing_offset_along, machine.housing_offset_across
    )
    yoke = EndBody(machine.yoke_mass, machine.yoke_inertia, machine.yoke_offset_along, machine.yoke_offset_across)
    return connecting_rod(bar_of(machine), housing, yoke, *modes_of(machine))


def modes_of(machine: CrankParameters) -> tuple[int, int, int]:
    """Modes of the rod that are kept, its finite elements, and the modes that are fitted."""
    if machine.rod == "rigid":
        return 0, ELEMENTS, 0
    return machine.n_modes, max(ELEMENTS, 2 * machine.n_modes), machine.fitted_modes


def mode_damping(machine: CrankParameters, rod: ConnectingRod) -> tuple[Array, Array]:
    """Stiffness and structural damping of stretch and modes, (1 + n_modes,) each, by the machine's damping family."""
    stretch = rod.stiffness[ALONG_B, ALONG_B]
    stiffness = np.concatenate([[stretch], rod.mode_frequency**2])
    if machine.damping_family == "stiffness":
        return stiffness, np.asarray(stiffness * 2.0 * machine.damping_ratio / rod.mode_frequency[0])
    moving = machine.slider_mass + machine.yoke_mass + rod.line_mass * machine.rod_length / 3.0
    inertia = np.concatenate([[moving], np.ones(len(rod.mode_frequency))])
    ratio: float | Array = machine.damping_ratio
    if machine.damping_family == "power":
        ratio = ratio * (np.sqrt(stiffness / inertia) / rod.mode_frequency[0]) ** machine.damping_exponent
    return stiffness, np.asarray(2.0 * ratio * np.sqrt(stiffness * inertia))


def _structural_damping(machine: CrankParameters, rod: ConnectingRod) -> Array:
    """C of the rod coordinates; zero for a rigid rod."""
    damping = np.zeros_like(rod.stiffness)
    if machine.rod == "flexible":
        _, (stretch, *modes) = mode_damping(machine, rod)
        damping[MODES:, MODES:] = np.diag(modes)
        ends = [ALONG_A, ALONG_B]
        damping[np.ix_(ends, ends)] = stretch * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return damping


def _coordinate_map(machine: CrankParameters, phi: Array, size: int, orders: int = 3) -> Array:
    """R and its derivatives by phi: (orders, B, size, n); the last three of ``size`` rows are the slider's."""
    names = degrees_of_freedom(machine)
    sine, cosine = np.sin(phi), np.cos(phi)
    secant, tangent = 1.0 / cosine, sine / cosine
    one = (np.ones_like(phi), np.zeros_like(phi), np.zeros_like(phi))
    tan = (tangent, secant**2, 2.0 * tangent * secant**2)
    sec = (secant, secant * tangent, secant * (1.0 + 2.0 * tangent**2))
    x_slider, y_slider, pitch = size - 3, size - 2, size - 1
    # every coordinate but the stretch leaves the rod its length, and its end B follows the guide
    entries = {
        BALL_ALONG: [(ALONG_A, one), (ALONG_B, one), (ACROSS_B, tan), (x_slider, sec)],
        BALL_ACROSS: [(ACROSS_A, one)],
        ROD_STRETCH: [(ALONG_B, one), (ACROSS_B, tan), (x_slider, sec)],
        SLIDER_ACROSS: [(ACROSS_B, sec), (x_slider, tan), (y_slider, one)],
        SLIDER_PITCH: [(pitch, one)],
    }
    modes = [name for name in names if name not in entries]
    entries.update({name: [(MODES + mode, one)] for mode, name in enumerate(modes)})
    mapping = np.zeros((orders, len(phi), size, len(names)))
    for column, name in enumerate(names):
        for row, functions in entries[name]:
            for order in range(orders):
                mapping[order, :, row, column] = functions[order]
    return mapping


def _guide_reaction(load: Array, phi: Array) -> Array:
    """Force [N] of the guide on the slider that holds the nominal motion of a straight rod, (2, B)."""
    x_slider, y_slider = load.shape[-1] - 3, load.shape[-1] - 2
    return np.asarray(load[..., ACROSS_B] / np.cos(phi) + load[..., x_slider] * np.tan(phi) + load[..., y_slider])


def _geometric_stiffness(
    machine: CrankParameters, rod: ConnectingRod, phi: Array, motion: _Inertia, load: Array
) -> Array:
    """K_geo of the rod coordinates from the nominal tension and the offset end bodies: (2, B, m, m)."""
    line, length = rod.line_mass, machine.rod_length
    a, b, spin, centrifugal = motion.along, motion.across, motion.spin, motion.centrifugal
    x, y = machine.yoke_offset_along, machine.yoke_offset_across
    slider = machine.slider_mass * (motion.slider_along * np.cos(phi) - motion.slider_across * np.sin(phi))
    constant = -line * (a * length + 0.5 * centrifugal * length**2) - slider
    constant -= machine.yoke_mass * (a + (length + x) * centrifugal - y * spin)
    constant -= _guide_reaction(load, phi) * np.sin(phi)
    tension = (constant, line * a * length, 0.5 * line * centrifugal * length**2)
    hx, hy = machine.housing_offset_along, machine.housing_offset_across
    turning = (
        -machine.housing_mass * (hx * a + hy * b + (hx**2 + hy**2) * centrifugal),
        -machine.yoke_mass * (x * (a + length * centrifugal) + y * (b + length * spin) + (x**2 + y**2) * centrifugal),
    )
    stiffness = np.einsum("pkb,pij->kbij", np.stack(tension), rod.tension)
    return np.asarray(stiffness + np.einsum("pkb,pij->kbij", np.stack(turning), rod.end_rotation))


def _inertia(machine: CrankParameters, motion: PlanarMotion) -> _Inertia:
    """Nominal accelerations; gravity enters as an upward acceleration of everything."""
    angle = math.radians(machine.gravity_angle)
    up_x, up_y = -machine.gravity * math.sin(angle), machine.gravity * math.cos(angle)
    sine, cosine = np.sin(motion.phi), np.cos(motion.phi)
    none = np.zeros_like(motion.phi)
    return _Inertia(
        along=np.stack([up_x * cosine - up_y * sine, motion.pin_along]),
        across=np.stack([up_x * sine + up_y * cosine, motion.pin_across]),
        spin=np.stack([none, -motion.phi_acceleration]),
        centrifugal=np.stack([none, -(motion.phi_rate**2)]),
        slider_along=np.stack([none + up_x, motion.slider_acceleration]),
        slider_across=np.stack([none + up_y, none]),
    )


def _slider_mass(machine: CrankParameters) -> Array:
    """Mass matrix (3, 3) of the slider about its pivot."""
    x, y = machine.slider_offset_along, machine.slider_offset_across
    slider = machine.slider_mass * np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [-y, x, 0.0]])
    slider[2, 2] = machine.slider_pitch_inertia
    return slider


def _body_load(rod: ConnectingRod, slider: Array, inertia: _Inertia) -> Array:
    """Loads (2, B, size) on the coordinates of rod and slider."""
    # coordinates come first while it is summed: loops over crank angles are the long ones
    along, across, spin, centrifugal = (part[:, None, None] for part in rod.load)
    rod_load = along * inertia.along
    rod_load += across * inertia.across
    rod_load += spin * inertia.spin
    rod_load += centrifugal * inertia.centrifugal
    slider_load = slider[0][:, None, None] * inertia.slider_along + slider[1][:, None, None] * inertia.slider_across
    return np.ascontiguousarray(np.moveaxis(np.concatenate([rod_load, slider_load]), 0, -1))


def loads(machine: CrankParameters, crank_angle: Array, rod: ConnectingRod) -> Array:
    """``equations(machine, crank_angle, rod).load`` alone: (2, B, n)."""
    motion = planar_motion(crank_angle, machine.crank_radius, machine.rod_length)
    load = _body_load(rod, _slider_mass(machine), _inertia(machine, motion))
    return np.asarray(np.einsum("bij,kbi->kbj", _coordinate_map(machine, motion.phi, load.shape[-1], 1)[0], load))


def equations(machine: CrankParameters, crank_angle: Array, rod: ConnectingRod | None = None) -> Equations:
    """Assemble the equations of motion at given crank angles.

    Parameters
    ----------
    machine
        The mechanism.
    crank_angle : (B,)
        Crank angles [rad].
    rod
        What ``rod_of(machine)`` returns, if it is at hand.
    """
    rod = rod or rod_of(machine)
    motion = planar_motion(crank_angle, machine.crank_radius, machine.rod_length)
    inertia = _inertia(machine, motion)
    n_rod = len(rod.mass)
    size = n_rod + 3

    def embedded(matrix: Array) -> Array:
        whole = np.zeros((*matrix.shape[:-2], size, size))
        whole[..., :n_rod, :n_rod] = matrix
        return whole

    mass, gyroscopic, translating = embedded(rod.mass), embedded(rod.gyroscopic), embedded(rod.translating_mass)
    damping = embedded(_structural_damping(machine, rod))
    slider = _slider_mass(machine)
    mass[n_rod:, n_rod:] = slider
    load = _body_load(rod, slider, inertia)

    r, r_phi, r_phiphi = _coordinate_map(machine, motion.phi, size)
    rate, acceleration = motion.phi_rate[:, None, None], motion.phi_acceleration[:, None, None]
    r1 = rate * r_phi
    r2 = rate**2 * r_phiphi + acceleration * r_phi
    transposed = np.swapaxes(r, -1, -2)
    static = embedded(rod.stiffness)[None] if machine.rod == "flexible" else np.zeros((1, size, size))
    inertial = -acceleration * gyroscopic - rate**2 * translating
    if machine.geometric_stiffness == "on":
        geometric = embedded(_geometric_stiffness(machine, rod, motion.phi, inertia, load))
        # the slider's centre of gravity is off its pivot and turns with it
        x, y = machine.slider_offset_along, machine.slider_offset_across
        geometric[..., -1, -1] = -machine.slider_mass * (x * inertia.slider_along + y * inertia.slider_across)
        static = static + geometric[0]
        inertial = inertial + geometric[1]
    gyro = -2.0 * rate * gyroscopic
    return Equations(
        mass=transposed @ mass @ r,
        damping=np.stack([transposed @ damping @ r, transposed @ (2.0 * (mass @ r1) + gyro @ r)]),
        stiffness=np.stack(
            [
                transposed @ static @ r,
                transposed @ (damping @ r1),
                transposed @ (mass @ r2 + gyro @ r1 + inertial @ r),
            ]
        ),
        load=np.einsum("bij,kbi->kbj", r, load),
        slider_along=r[:, n_rod].copy(),
    )
