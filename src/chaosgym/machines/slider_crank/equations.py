r"""Equations of small motions of the slider crank about its nominal motion, in the plane and in space.

With points at x_i = X_i(th) + Phi_i(th) p (``motions``), masses m_ij between them, and th = w t,

    M_p p'' + D_p p' + K_p p = Q_p - f_p
    M_p = sum m Phi^T Phi,   D_p = C + 2 w sum m Phi^T Phi',   K_p = K + w^2 (sum m Phi^T Phi'' + kept) + K_geo
    f_p = sum m Phi^T (w^2 X'' + g Y)

holds every gyroscopic and centrifugal term in any frame. C and K of stretch and modes are diagonal and constant; K_geo
is that of ``geometric_stiffness``. Only the coordinates that the scene requires are there: in the plane of a motor that
stands straight none moves sideways.

Everything is a smooth function of the crank angle that repeats after a revolution. It is found at equidistant angles,
as many as its Fourier series needs, and that series gives its derivatives and its values at other angles. Every term is
a power of w times such a function, so a change of speed costs a weighted sum.

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

References
----------
Thesis 2.2 (equations 2.4 to 2.8), 4.2 and 4.3.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.machines.periodic import between, derivatives
from chaosgym.machines.slider_crank.connecting_rod import ConnectingRod, elastic_constants, rods_of
from chaosgym.machines.slider_crank.coordinates import ROD_STRETCH, degrees_of_freedom
from chaosgym.machines.slider_crank.geometric_stiffness import geometric_stiffness
from chaosgym.machines.slider_crank.motions import (
    ALONG_ROD,
    END_A,
    END_B,
    HOUSING,
    Frame,
    Shapes,
    frame_at,
    masses_of,
    positions_of,
    shapes_of,
    slider_inertia,
)
from chaosgym.machines.slider_crank.parameters import CrankParameters

TERMS = 32.0
"""Terms of the Fourier series of a function that is smooth to 1 rad off the real angles; the last one is exp(-32)."""


class Equations(NamedTuple):
    """Matrices of the module's equation at B crank angles, by powers of the crank rate w.

    Attributes
    ----------
    mass : (B, n, n)
    damping : (2, B, n, n)
        D_p = damping[0] + w damping[1].
    stiffness : (3, B, n, n)
        K_p = stiffness[0] + w stiffness[1] + w^2 stiffness[2]; the second is zero.
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


class _Revolution(NamedTuple):
    """Frame, shapes (B angles), mass matrix (k, k) and accelerations (2, B, k, 3) at equidistant crank angles."""

    rods: tuple[ConnectingRod, ...]
    frame: Frame
    shapes: Shapes
    mass: Array
    places: Array
    acceleration: Array

    @property
    def weighted(self) -> Array:
        """Phi^T m, (B, n, 3 k)."""
        point = self.shapes.point
        moved = (self.mass @ point.reshape(*point.shape[:2], -1)).reshape(len(point), -1, point.shape[-1])
        return np.swapaxes(moved, -1, -2)

    @property
    def load(self) -> Array:
        """Load of gravity and, per squared crank rate, of the nominal motion: (2, B, n)."""
        return np.asarray((self.weighted @ self.acceleration.reshape(*self.acceleration.shape[:2], -1, 1))[..., 0])


def _angles(machine: CrankParameters) -> Array:
    """Equidistant crank angles [rad] whose Fourier series is exact to rounding.

    The rod's direction is smooth up to where it would stand across the guide, at a complex crank angle whose imaginary
    part is at least arcosh(l / r).
    """
    terms = TERMS / math.acosh(machine.rod_length / machine.crank_radius) + 4.0
    count = 12 * math.ceil(2.0 * terms / 12.0)
    return np.linspace(0.0, 2.0 * math.pi, count, endpoint=False)


def _revolution(machine: CrankParameters) -> _Revolution:
    rods = rods_of(machine)
    frame, mass = frame_at(machine, _angles(machine)), masses_of(machine, rods)
    places = positions_of(machine, frame, len(mass))
    tilt = math.radians(machine.gravity_angle)
    acceleration = np.zeros((2, *places.shape))
    acceleration[1] = derivatives(places)[1]
    # neither modes nor unit vectors have a weight
    heavy = [END_A, END_B, *range(HOUSING, ALONG_ROD)]
    acceleration[0][:, heavy] = machine.gravity * np.array([-math.sin(tilt), math.cos(tilt), 0.0])
    return _Revolution(rods, frame, shapes_of(machine, frame, rods), mass, places, acceleration)


def _held(machine: CrankParameters) -> CrankParameters:
    """The machine with a rigid rod and clearance at the slider alone: its loads are what the guide must carry."""
    return replace(machine, rod="rigid", slider_joint="clearance", ball_joint="ideal", geometric_stiffness="off")


def _elastic(machine: CrankParameters, rods: tuple[ConnectingRod, ...]) -> tuple[Array, Array]:
    """Stiffness and structural damping (n, n) of stretch and modes, diagonal; zero for a rigid rod."""
    names = degrees_of_freedom(machine)
    stiffness, damping = np.zeros((2, len(names)))
    if machine.rod == "flexible":
        parts = [elastic_constants(machine, rod) for rod in rods]
        modes = len(rods) * len(rods[0].mode_frequency)
        for found, which in ((stiffness, 0), (damping, 1)):
            found[names.index(ROD_STRETCH)] = parts[0][which][0]
            found[len(names) - modes :] = np.concatenate([part[which][1:] for part in parts])
    return np.diag(stiffness), np.diag(damping)


def _inertial(around: _Revolution, turning: Array) -> tuple[Array, Array, Array]:
    """Mass matrix, and damping and stiffness by the crank's rate and its square, each (B, n, n)."""
    point, weighted = around.shapes.point, around.weighted
    first, second = derivatives(point)
    count, _, _, n = point.shape
    # a unit vector stays one: the second-order turn of a body that carries rotary inertia
    speed = derivatives(around.places[:, ALONG_ROD:])[0]
    second[:, ALONG_ROD:] += np.sum(speed**2, axis=-1)[..., None, None] * point[:, ALONG_ROD:]
    mass, damping, stiffness = (weighted @ part.reshape(count, -1, n) for part in (point, first, second))
    return mass + turning, 2.0 * damping, stiffness


def equations(machine: CrankParameters, crank_angle: Array, load_angle: Array | None = None) -> Equations:
    """Assemble the equations of motion at given crank angles.

    Parameters
    ----------
    machine
        The mechanism.
    crank_angle : (B,)
        Crank angles [rad].
    load_angle : (L,), optional
        Those of the loads, if they are others.

    Examples
    --------
    >>> from chaosgym.machines.slider_crank.equations import equations
    >>> equations(chaosgym.SliderCrank(rod="rigid"), np.zeros(1)).mass.shape
    (1, 1, 1)
    """
    around = _revolution(machine)
    turn = around.shapes.slider_turn
    mass, damping, stiffness = _inertial(around, turn.T @ (slider_inertia(machine)[:, None] * turn))
    elastic, structural = _elastic(machine, around.rods)
    constant = np.zeros_like(mass)
    if machine.geometric_stiffness == "on":
        guide = np.zeros((2, len(mass), 3))
        reaction = _revolution(_held(machine)).load
        guide[..., 1 : 1 + reaction.shape[-1]] = reaction
        constant, turned = geometric_stiffness(
            machine, around.rods, around.frame, around.shapes, around.acceleration, guide
        )
        stiffness = stiffness + turned
    along = around.shapes.point[:, END_B, 0]
    none = np.zeros_like(constant)
    smooth = np.stack([mass, none, damping, constant, none, stiffness], axis=1)
    mass, *rest = np.swapaxes(between(smooth, crank_angle), 0, 1)
    load = between(np.swapaxes(around.load, 0, 1), crank_angle if load_angle is None else load_angle)
    return Equations(
        mass=mass,
        damping=np.stack([rest[0] + structural, rest[1]]),
        stiffness=np.stack([rest[2] + elastic, *rest[3:]]),
        load=np.swapaxes(load, 0, 1),
        slider_along=between(along, crank_angle),
    )
