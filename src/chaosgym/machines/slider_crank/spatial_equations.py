r"""Equations of small motions of the slider crank when the motor stands at an angle.

With particles at x_i = X_i(th) + Phi_i(th) p (``spatial_kinematics``) and th = w t,

    M_p = sum m Phi^T Phi,   D_p = 2 w sum m Phi^T Phi',   K_p = w^2 sum m Phi^T Phi'' + elastic terms
    f_p = sum m Phi^T (w^2 X'' + g Y)

holds every gyroscopic and centrifugal term in any frame; the derivatives by the crank angle are central differences of
eighth order, exact to about 1e-11. In the plane these are those of ``equations``, found on another way.

The forces of the nominal motion stiffen the rod: a tension P(s) along it pulls it straight in either plane, and bodies
off its ends work against their own acceleration as they turn. Both are the second-order parts of the motion, times
these forces:

    K_geo = int P (w_n' w_n'^T + w_b' w_b'^T) ds + sum m A . x'',    P(s) = N . d - sum of m A . d beyond s

with slopes w' in both planes, accelerations A that include gravity's reaction, and the guide's reaction N. The second
order x'' of the bodies follows from that of the yoke, which stays across its pivot axis: its swing is

    a = beta_n / cos g - beta_n beta_b sin g / cos^2 g,     and the spin s has   beta_n beta_b tan^2 g.

Left out are products of the slider's own turns with those of the rod: they are bounded by the clearance.

Links of the thesis' table 4.1 (theta, L, H, alpha; Hartenberg and Denavit), base to slider:

    0  motor and base     kinematic   0, 0, 0         0 deg
    1  crank              kinematic   L1 = radius     0 deg
    2  ball joint         kinematic   H2              90 deg
    3  ball joint         kinematic   0, 0            90 deg
    4  connecting rod     elements    L4 = length     0 deg
    5  yoke               rigid       0, H5           90 deg
    6  slider             rigid       -               -90 deg

The offsets H2 and H5 are not in print and zero here: the crank plane turns about its own centre, and the yoke's pivot
lies on the guide. The twists say that the axes of consecutive joints cross at right angles: motor, the two turns of the
ball joint that the rod needs, yoke bearing, slider pivot.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from chaosgym.machines.slider_crank.connecting_rod import ACROSS_A, ACROSS_B, MODES
from chaosgym.machines.slider_crank.equations import Equations, mode_damping
from chaosgym.machines.slider_crank.parameters import CrankParameters
from chaosgym.machines.slider_crank.spatial_kinematics import (
    AXIS,
    Frame,
    Rods,
    Shapes,
    frame_at,
    masses_of,
    positions_at,
    rods_of,
    shapes_at,
    slider_inertia,
    slider_offset,
)

Array = NDArray[np.float64]


def _pair(one: Array, other: Array) -> Array:
    """Hessian of the product of two linear forms (B, n)."""
    product = one[:, :, None] * other[:, None]
    return np.asarray(product + np.swapaxes(product, -1, -2))


def _square(form: Array) -> Array:
    return 0.5 * _pair(form, form)


def _dot(one: Array, other: Array) -> Array:
    """Scalar products (2, B) of accelerations (2, B, 3) with directions (B, 3)."""
    return np.asarray(np.einsum("qbi,bi->qb", one, other))


def _tension(machine: CrankParameters, rods: Rods, frame: Frame, acceleration: Array, guide: Array) -> Array:
    """Coefficients (3, 2, B) of the tension [N] as a polynomial of the place along the rod, as in ``ConnectingRod``."""
    yoke, slider, turning = (acceleration[:, :, k] for k in (-4, -3, -2))
    line, length, first = rods.swing.line_mass, machine.rod_length, rods.swing.position[0]
    spread = _dot(turning, frame.along)
    at_pin = _dot(acceleration[:, :, 0], frame.along) - first * spread
    constant = _dot(guide, frame.along) - machine.yoke_mass * _dot(yoke, frame.along)
    constant -= machine.slider_mass * _dot(slider, frame.along)
    constant -= line * (at_pin * length + 0.5 * spread * length**2)
    return np.stack([constant, line * at_pin * length, 0.5 * line * spread * length**2])


def _rod_stiffness(rods: Rods, frame: Frame, shapes: Shapes, tension: Array) -> Array:
    """Tension against the slopes of both planes, (2, B, n, n)."""
    n, modes = shapes.spin.shape[-1], len(rods.swing.mode_frequency)
    total = np.zeros((2, len(frame.along), n, n))
    for rod, axis, first in ((rods.swing, frame.across, n - 2 * modes), (rods.lateral, frame.sideways, n - modes)):
        to_rod = np.zeros((len(axis), len(rod.mass), n))
        to_rod[:, ACROSS_A] = np.einsum("bi,bin->bn", axis, shapes.end_a)
        to_rod[:, ACROSS_B] = np.einsum("bi,bin->bn", axis, shapes.end_b)
        to_rod[:, MODES:, first : first + modes] = np.eye(modes)
        back = np.swapaxes(to_rod, -1, -2)
        for coefficient, matrix in zip(tension, rod.tension, strict=True):
            total += coefficient[..., None, None] * (back @ matrix @ to_rod)
    return total


def geometric_stiffness(
    machine: CrankParameters, rods: Rods, frame: Frame, shapes: Shapes, acceleration: Array, guide: Array
) -> Array:
    """Geometric stiffness of gravity and, per squared crank rate, of the nominal motion: (2, B, n, n).

    Parameters
    ----------
    machine, rods, frame, shapes
        As ``spatial_kinematics`` has them at B crank angles.
    acceleration : (2, B, k, 3)
        Of the particles: gravity's reaction, and the nominal motion's per squared crank rate.
    guide : (2, B, 3)
        Force [N] of the guide on the slider that holds the nominal motion, likewise.
    """
    housing, yoke, slider, _, yoke_vector = (acceleration[:, :, k] for k in (-5, -4, -3, -2, -1))
    cosine, sine = np.sum(frame.along * frame.yoke, axis=1), -frame.along[:, 2]
    alpha, alpha_b = (np.einsum("bi,bin->bn", axis, shapes.turn_a) for axis in (frame.across, frame.sideways))
    twist = _pair(*(np.einsum("bi,bin->bn", axis, shapes.turn_b) for axis in (frame.across, frame.sideways)))
    hx, hy = machine.housing_mass * machine.housing_offset_along, machine.housing_mass * machine.housing_offset_across
    offset = machine.yoke_offset_along * frame.yoke + machine.yoke_offset_across * frame.across
    central = machine.yoke_inertia - machine.yoke_mass * float(np.sum(offset[0] ** 2))
    turned = machine.yoke_mass * _dot(yoke, np.cross(AXIS, offset)) + central * _dot(yoke_vector, frame.across)

    def times(factor: Array, form: Array) -> Array:
        return np.asarray(factor[..., None, None] * form)

    total = _rod_stiffness(rods, frame, shapes, _tension(machine, rods, frame, acceleration, guide))
    total -= times(hx * _dot(housing, frame.along), _square(alpha) + _square(alpha_b))
    total -= times(hy * _dot(housing, frame.across), _square(alpha) + _square(shapes.spin))
    total -= times(hy * _dot(housing, frame.along), _pair(alpha_b, shapes.spin))
    total += times(hy * _dot(housing, frame.sideways) * (sine / cosine) ** 2, twist)
    total -= times(machine.yoke_mass * _dot(yoke, offset), _square(shapes.swing))
    total -= times(turned * sine / cosine**2, twist)
    return total + _slider_stiffness(machine, shapes, slider)


def _slider_stiffness(machine: CrankParameters, shapes: Shapes, acceleration: Array) -> Array:
    """Of the slider, whose centre of gravity is off its pivot and turns with it, (2, B, n, n)."""
    turn, offset = shapes.slider_turn, slider_offset(machine)
    pulled = np.einsum("qbi,in->qbn", acceleration, turn)
    arm = np.broadcast_to(offset @ turn, pulled.shape)
    product = pulled[..., :, None] * arm[..., None, :]
    hanging = np.einsum("qbi,i->qb", acceleration, offset)[..., None, None] * (turn.T @ turn)
    return np.asarray(machine.slider_mass * (0.5 * (product + np.swapaxes(product, -1, -2)) - hanging))


def held(machine: CrankParameters) -> CrankParameters:
    """The machine with a rigid rod and clearance at the slider alone: its loads are what the guide must carry."""
    return replace(machine, rod="rigid", slider_joint="clearance", ball_joint="ideal", geometric_stiffness="off")


_SHIFT = 0.02
_FIRST = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280]) / _SHIFT
_SECOND = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560]) / _SHIFT**2
"""Central differences of order eight at shifts of ``_SHIFT`` [rad]."""


def _difference(weights: Array, around: list[Array]) -> Array:
    return np.asarray(sum(w * part for w, part in zip(weights, around, strict=True)))


def _shifted(crank_angle: Array) -> list[Array]:
    return [crank_angle + _SHIFT * k for k in range(-4, 5)]


def spatial_loads(machine: CrankParameters, crank_angle: Array) -> Array:
    """Load of gravity and, per squared crank rate, of the nominal motion: (2, B, n)."""
    rods = rods_of(machine)
    around = [positions_at(machine, angle, rods) for angle in _shifted(crank_angle)]
    particle = shapes_at(machine, crank_angle, rods).particle
    return _loads(machine, rods, particle, _accelerations(machine, rods, _difference(_SECOND, around)))


def _accelerations(machine: CrankParameters, rods: Rods, motion: Array) -> Array:
    """Accelerations of the particles: gravity's reaction, and ``motion`` (B, k, 3) per squared crank rate."""
    _, director = masses_of(machine, rods)
    tilt = math.radians(machine.gravity_angle)
    up = machine.gravity * np.array([-math.sin(tilt), math.cos(tilt), 0.0])
    return np.stack([np.broadcast_to((1.0 - director)[:, None] * up, motion.shape), motion])


def _loads(machine: CrankParameters, rods: Rods, particle: Array, acceleration: Array) -> Array:
    mass, _ = masses_of(machine, rods)
    count, _, _, n = particle.shape
    forces = (mass[:, None] * acceleration).reshape(2, count, 1, -1)
    return np.asarray((forces @ particle.reshape(count, -1, n))[:, :, 0])


def spatial_equations(machine: CrankParameters, crank_angle: Array) -> Equations:
    """Assemble the equations of motion at given crank angles; see ``equations.Equations``.

    Parameters
    ----------
    machine
        The mechanism.
    crank_angle : (B,)
        Crank angles [rad].
    """
    rods = rods_of(machine)
    mass, director = masses_of(machine, rods)
    around = [shapes_at(machine, angle, rods) for angle in _shifted(crank_angle)]
    places = [positions_at(machine, angle, rods) for angle in _shifted(crank_angle)]
    particles, here = [part.particle for part in around], around[4]
    strain1 = _difference(_FIRST, [part.strain for part in around])
    count, _, _, n = here.particle.shape
    weighted = (mass[:, None, None] * here.particle).reshape(count, -1, n).swapaxes(-1, -2)

    def against(shape: Array) -> Array:
        return np.asarray(weighted @ shape.reshape(count, -1, n))

    # a unit vector stays one: the second-order turn of a body that carries rotary inertia
    speed = _difference(_FIRST, places)
    kept = (director * np.einsum("bki,bki->bk", speed, speed))[:, :, None, None] * here.particle
    elastic, damping = _elastic(machine, rods)
    back = here.strain.swapaxes(-1, -2)
    acceleration = _accelerations(machine, rods, _difference(_SECOND, places))
    stiffness = [
        back @ elastic @ here.strain,
        back @ damping @ strain1,
        against(_difference(_SECOND, particles) + kept),
    ]
    if machine.geometric_stiffness == "on":
        guide = np.zeros((2, count, 3))
        guide[..., 1:] = spatial_loads(held(machine), crank_angle)
        frame = frame_at(machine, crank_angle)
        geometric = geometric_stiffness(machine, rods, frame, here, acceleration, guide)
        stiffness[0], stiffness[2] = stiffness[0] + geometric[0], stiffness[2] + geometric[1]
    turning = here.slider_turn.T @ (slider_inertia(machine)[:, None] * here.slider_turn)
    return Equations(
        mass=against(here.particle) + turning,
        damping=np.stack([back @ damping @ here.strain, 2.0 * against(_difference(_FIRST, particles))]),
        stiffness=np.stack(stiffness),
        load=_loads(machine, rods, here.particle, acceleration),
        slider_along=here.end_b[:, 0].copy(),
    )


def _elastic(machine: CrankParameters, rods: Rods) -> tuple[Array, Array]:
    """Stiffness and structural damping of stretch and modes, diagonal; zero for a rigid rod."""
    size = 1 + 2 * len(rods.swing.mode_frequency)
    if machine.rod == "rigid":
        return np.zeros((size, size)), np.zeros((size, size))
    parts = [mode_damping(machine, rod) for rod in rods]
    axial_stiffness, axial_damping = parts[0][0][0], parts[0][1][0]
    stiffness = np.concatenate([[axial_stiffness], parts[0][0][1:], parts[1][0][1:]])
    damping = np.concatenate([[axial_damping], parts[0][1][1:], parts[1][1][1:]])
    return np.diag(stiffness), np.diag(damping)
