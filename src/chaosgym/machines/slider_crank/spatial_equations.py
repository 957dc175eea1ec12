r"""Equations of small motions of the slider crank when the motor stands at an angle.

With particles at x_i = X_i(th) + Phi_i(th) p (``spatial_kinematics``) and th = w t,

    M_p = sum m Phi^T Phi,   D_p = 2 w sum m Phi^T Phi',   K_p = w^2 sum m Phi^T Phi'' + elastic terms
    f_p = sum m Phi^T (w^2 X'' + g Y)

holds every gyroscopic and centrifugal term in any frame; the derivatives by the crank angle are central differences of
eighth order, exact to about 1e-11. In the plane these are the equations of ``crank_equations``, found on another way.
Geometric stiffness, from the second-order parts of the motion, is in ``spatial_tension``.

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
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from chaosgym.machines.slider_crank.equations import Equations, mode_damping
from chaosgym.machines.slider_crank.spatial_kinematics import (
    Rods,
    frame_at,
    masses_of,
    positions_at,
    rods_of,
    shapes_at,
    slider_inertia,
)
from chaosgym.machines.slider_crank.spatial_tension import geometric_stiffness, held

if TYPE_CHECKING:
    from chaosgym.machines.slider_crank.parameters import SliderCrank

Array = NDArray[np.float64]

_SHIFT = 0.02
_FIRST = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280]) / _SHIFT
_SECOND = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560]) / _SHIFT**2
"""Central differences of order eight at shifts of ``_SHIFT`` [rad]."""


def _difference(weights: Array, around: list[Array]) -> Array:
    return np.asarray(sum(w * part for w, part in zip(weights, around, strict=True)))


def _shifted(crank_angle: Array) -> list[Array]:
    return [crank_angle + _SHIFT * k for k in range(-4, 5)]


def spatial_loads(machine: "SliderCrank", crank_angle: Array) -> Array:
    """Load of gravity and, per squared crank rate, of the nominal motion: (2, B, n)."""
    rods = rods_of(machine)
    around = [positions_at(machine, angle, rods) for angle in _shifted(crank_angle)]
    particle = shapes_at(machine, crank_angle, rods).particle
    return _loads(machine, rods, particle, _accelerations(machine, rods, _difference(_SECOND, around)))


def _accelerations(machine: "SliderCrank", rods: Rods, motion: Array) -> Array:
    """Accelerations of the particles: gravity's reaction, and ``motion`` (B, k, 3) per squared crank rate."""
    _, director = masses_of(machine, rods)
    tilt = math.radians(machine.gravity_angle)
    up = machine.gravity * np.array([-math.sin(tilt), math.cos(tilt), 0.0])
    return np.stack([np.broadcast_to((1.0 - director)[:, None] * up, motion.shape), motion])


def _loads(machine: "SliderCrank", rods: Rods, particle: Array, acceleration: Array) -> Array:
    mass, _ = masses_of(machine, rods)
    count, _, _, n = particle.shape
    forces = (mass[:, None] * acceleration).reshape(2, count, 1, -1)
    return np.asarray((forces @ particle.reshape(count, -1, n))[:, :, 0])


def spatial_equations(machine: "SliderCrank", crank_angle: Array) -> Equations:
    """Assemble the equations of motion at given crank angles; see ``crank_equations.Equations``.

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


def _elastic(machine: "SliderCrank", rods: Rods) -> tuple[Array, Array]:
    """Stiffness and structural damping of stretch and modes, diagonal; zero for a rigid rod."""
    size = 1 + 2 * len(rods.swing.mode_frequency)
    if machine.rod == "rigid":
        return np.zeros((size, size)), np.zeros((size, size))
    parts = [mode_damping(machine, rod) for rod in rods]
    axial_stiffness, axial_damping = parts[0][0][0], parts[0][1][0]
    stiffness = np.concatenate([[axial_stiffness], parts[0][0][1:], parts[1][0][1:]])
    damping = np.concatenate([[axial_damping], parts[0][1][1:], parts[1][1][1:]])
    return np.diag(stiffness), np.diag(damping)
