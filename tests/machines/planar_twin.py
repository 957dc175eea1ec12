r"""The slider crank in the plane once more, in the frame of the rod, which turns at the rate Omega.

A point at s moves by u(s, t) along the rod and w(s, t) across it, small against the nominal motion:

    acceleration along  = a_d + u'' - 2 Omega w' - Omega' w - Omega^2 (s + u)
    acceleration across = a_n + w'' + 2 Omega u' + Omega' (s + u) - Omega^2 w

with a the acceleration of the ball centre plus gravity's reaction. Projected on the rod's shapes q:

    M q'' + (C + 2 Omega G) q' + (K + K_geo + Omega' G - Omega^2 M_t) q = Q - load(a, Omega, Omega')

M holds the central rotary inertias of the end bodies, M_t does not. Rod coordinates and the slider's follow from those
of the scene, q = R(phi) p, with R'' = w^2 (phi_1^2 R_phiphi + phi_2 R_phi), Omega = -w phi_1, Omega' = -w^2 phi_2. So
nothing is differentiated by a Fourier series, and no two terms stand as they do in the package; the modes are shared.
"""

import math
from typing import NamedTuple

import numpy as np

from chaosgym.machines.slider_crank.equations import (
    BALL_ACROSS,
    BALL_ALONG,
    ROD_STRETCH,
    SLIDER_ACROSS,
    SLIDER_PITCH,
    Equations,
)
from tests.machines.connecting_rod import elastic_constants, rods_of

ALONG_A, ACROSS_A, ALONG_B, ACROSS_B, MODES = 0, 1, 2, 3, 4


class Motion(NamedTuple):
    """Rod angle and its derivatives by the crank angle, and per squared crank rate accelerations of pin and slider."""

    phi: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    pin_along: np.ndarray
    pin_across: np.ndarray
    slider: np.ndarray


def planar_motion(machine, angle):
    """Closed form of the nominal motion: sin phi = (r / l) sin th."""
    radius, length = machine.crank_radius, machine.rod_length
    sine, cosine = np.sin(angle), np.cos(angle)
    phi = np.arcsin(radius / length * sine)
    tilt, lean = np.sin(phi), np.cos(phi)
    rate = radius / length * cosine / lean
    acceleration = (-radius / length * sine + rate**2 * tilt) / lean
    return Motion(
        phi,
        rate,
        acceleration,
        -radius * np.cos(angle + phi),
        -radius * np.sin(angle + phi),
        -radius * cosine - length * (lean * rate**2 + tilt * acceleration),
    )


class Rod(NamedTuple):
    """M, M_t, G, C, K of rod coordinates, loads per a_d, a_n, Omega' and -Omega^2, tension and turning of the ends."""

    mass: np.ndarray
    translating: np.ndarray
    gyroscopic: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    load: np.ndarray
    tension: np.ndarray
    end_rotation: np.ndarray


def rod_of(machine):
    """The rod with its end bodies."""
    own, length = rods_of(machine)[0], machine.rod_length
    size = 2 + own.shape.shape[1]
    share = own.position / length
    across_columns = [ACROSS_A, ACROSS_B, *range(MODES, size)]
    along, across = np.zeros((2, len(share), size))
    along[:, ALONG_A], along[:, ALONG_B] = 1.0 - share, share
    across[:, across_columns] = own.shape
    line = (own.line_mass * own.weight)[:, None]
    translating = along.T @ (line * along) + across.T @ (line * across)
    gyroscopic = across.T @ (line * along) - along.T @ (line * across)
    load = np.stack(
        [
            along.T @ line[:, 0],
            across.T @ line[:, 0],
            *[part.T @ (line[:, 0] * own.position) for part in (across, along)],
        ]
    )
    slope = np.zeros((2, size))
    slope[:, ACROSS_A], slope[:, ACROSS_B], slope[:, MODES:] = -1.0 / length, 1.0 / length, own.end_slope
    inertia = np.zeros((size, size))
    for end, name in enumerate(("housing", "yoke")):
        body, x, y = (getattr(machine, f"{name}_{what}") for what in ("mass", "offset_along", "offset_across"))
        motion = np.zeros((2, size))
        motion[0, (ALONG_A, ALONG_B)[end]] = motion[1, (ACROSS_A, ACROSS_B)[end]] = 1.0
        motion += np.outer([-y, x], slope[end])
        central = getattr(machine, f"{name}_inertia") - body * (x**2 + y**2)
        translating += body * motion.T @ motion
        gyroscopic += body * (np.outer(motion[1], motion[0]) - np.outer(motion[0], motion[1]))
        inertia += central * np.outer(slope[end], slope[end])
        x += end * length
        load += body * np.stack([motion[0], motion[1], x * motion[1] - y * motion[0], x * motion[0] + y * motion[1]])
        load[2] += central * slope[end]
    damping, stiffness = np.zeros((2, size, size))
    if machine.rod == "flexible":
        for found, (stretch, *modes) in zip(
            (stiffness, damping), elastic_constants(machine, rods_of(machine)[0]), strict=True
        ):
            found[MODES:, MODES:] = np.diag(modes)
            ends = [ALONG_A, ALONG_B]
            found[np.ix_(ends, ends)] = stretch * np.array([[1.0, -1.0], [-1.0, 1.0]])
    tension = np.zeros((3, size, size))
    tension[:, np.array(across_columns)[:, None], across_columns] = own.tension
    rotation = slope[:, :, None] * slope[:, None]
    return Rod(translating + inertia, translating, gyroscopic, damping, stiffness, load, tension, rotation)


def coordinate_map(names, phi, size):
    """R and its two derivatives by phi: (3, B, size, n); the last three of ``size`` rows are the slider's."""
    sine, cosine = np.sin(phi), np.cos(phi)
    secant, tangent = 1.0 / cosine, sine / cosine
    one = (np.ones_like(phi), np.zeros_like(phi), np.zeros_like(phi))
    tan = (tangent, secant**2, 2.0 * tangent * secant**2)
    sec = (secant, secant * tangent, secant * (1.0 + 2.0 * tangent**2))
    x_slider, y_slider, pitch = size - 3, size - 2, size - 1
    entries = {
        BALL_ALONG: [(ALONG_A, one), (ALONG_B, one), (ACROSS_B, tan), (x_slider, sec)],
        BALL_ACROSS: [(ACROSS_A, one)],
        ROD_STRETCH: [(ALONG_B, one), (ACROSS_B, tan), (x_slider, sec)],
        SLIDER_ACROSS: [(ACROSS_B, sec), (x_slider, tan), (y_slider, one)],
        SLIDER_PITCH: [(pitch, one)],
    }
    modes = [name for name in names if name not in entries]
    entries.update({name: [(MODES + mode, one)] for mode, name in enumerate(modes)})
    mapping = np.zeros((3, len(phi), size, len(names)))
    for column, name in enumerate(names):
        for row, functions in entries[name]:
            mapping[:, :, row, column] = functions
    return mapping


def planar_equations(machine, angle):
    """``equations`` in the plane at crank angles (B,)."""
    rod, motion = rod_of(machine), planar_motion(machine, angle)
    n_rod = len(rod.mass)
    size = n_rod + 3

    def embedded(matrix):
        whole = np.zeros((*matrix.shape[:-2], size, size))
        whole[..., :n_rod, :n_rod] = matrix
        return whole

    mass, gyroscopic, translating, damping = map(embedded, (rod.mass, rod.gyroscopic, rod.translating, rod.damping))
    x, y = machine.slider_offset_along, machine.slider_offset_across
    slider = machine.slider_mass * np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [-y, x, 0.0]])
    slider[2, 2] = machine.slider_pitch_inertia
    mass[n_rod:, n_rod:] = slider

    tilt, sine, cosine = math.radians(machine.gravity_angle), np.sin(motion.phi), np.cos(motion.phi)
    up_x, up_y = -machine.gravity * math.sin(tilt), machine.gravity * math.cos(tilt)
    none = np.zeros_like(motion.phi)
    # acceleration of the rod's frame and of the slider: gravity's reaction, and per squared crank rate
    rod_moves = np.stack(
        [
            [up_x * cosine - up_y * sine, motion.pin_along],
            [up_x * sine + up_y * cosine, motion.pin_across],
            [none, -motion.acceleration],
            [none, -(motion.rate**2)],
        ]
    )
    slider_moves = np.stack([[none + up_x, motion.slider], [none + up_y, none]])
    load = np.concatenate(
        [np.einsum("ai,apb->pbi", rod.load, rod_moves), np.einsum("ai,apb->pbi", slider[:2], slider_moves)], axis=-1
    )

    r, r_phi, r_phiphi = coordinate_map(machine.degrees_of_freedom, motion.phi, size)
    rate, acceleration = motion.rate[:, None, None], motion.acceleration[:, None, None]
    r1 = rate * r_phi
    r2 = rate**2 * r_phiphi + acceleration * r_phi
    back = np.swapaxes(r, -1, -2)
    static = embedded(rod.stiffness)[None]
    inertial = -acceleration * gyroscopic - rate**2 * translating
    if machine.geometric_stiffness == "on":
        geometric = embedded(_geometric_stiffness(machine, rod, motion.phi, rod_moves, slider_moves, load))
        geometric[..., -1, -1] = -machine.slider_mass * (x * slider_moves[0] + y * slider_moves[1])
        static, inertial = static + geometric[0], inertial + geometric[1]
    gyro = -2.0 * rate * gyroscopic
    return Equations(
        mass=back @ mass @ r,
        damping=np.stack([back @ damping @ r, back @ (2.0 * (mass @ r1) + gyro @ r)]),
        stiffness=np.stack(
            [
                np.broadcast_to(back @ static @ r, (*back.shape[:2], back.shape[1])),
                back @ (damping @ r1),
                back @ (mass @ r2 + gyro @ r1 + inertial @ r),
            ]
        ),
        load=np.einsum("bij,kbi->kbj", r, load),
        slider_along=r[:, n_rod],
        slider_rate=np.zeros(len(r)),
    )


def _geometric_stiffness(machine, rod, phi, rod_moves, slider_moves, load):
    """K_geo of the rod coordinates from the nominal tension and the offset end bodies: (2, B, m, m)."""
    bar = machine.density * math.pi * machine.rod_diameter**2 / 4.0
    length, (a, b, spin, centrifugal) = machine.rod_length, rod_moves
    x, y, hx, hy = (
        getattr(machine, f"{body}_offset_{way}") for body in ("yoke", "housing") for way in ("along", "across")
    )
    reaction = load[..., ACROSS_B] / np.cos(phi) + load[..., -3] * np.tan(phi) + load[..., -2]
    constant = -bar * (a * length + 0.5 * centrifugal * length**2) - reaction * np.sin(phi)
    constant -= machine.slider_mass * (slider_moves[0] * np.cos(phi) - slider_moves[1] * np.sin(phi))
    constant -= machine.yoke_mass * (a + (length + x) * centrifugal - y * spin)
    tension = (constant, bar * a * length, 0.5 * bar * centrifugal * length**2)
    turning = (
        -machine.housing_mass * (hx * a + hy * b + (hx**2 + hy**2) * centrifugal),
        -machine.yoke_mass * (x * (a + length * centrifugal) + y * (b + length * spin) + (x**2 + y**2) * centrifugal),
    )
    stiffness = np.einsum("pkb,pij->kbij", np.stack(tension), rod.tension)
    return stiffness + np.einsum("pkb,pij->kbij", np.stack(turning), rod.end_rotation)
