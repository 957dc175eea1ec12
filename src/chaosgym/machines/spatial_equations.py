r"""Which equations govern small motions of the slider crank when the motor stands at an angle?

With the crank plane turned about the vertical, the rod swings in two planes: d from the ball to the slider, n across it
in the yoke's plane of swing (about the slider's pivot axis Z), b = d x n. Everything that has mass is written as
particles at x_i = X_i(th) + Phi_i(th) p, the bar as the integration points of its finite elements, a rotary inertia as
the inertia of the unit vector along the body. Then, th = w t,

    M_p = sum m Phi^T Phi,   D_p = 2 w sum m Phi^T Phi',   K_p = w^2 sum m Phi^T Phi'' + elastic terms
    f_p = sum m Phi^T (w^2 X'' + g Y)

holds every gyroscopic and centrifugal term in any frame; the derivatives by the crank angle are central differences of
eighth order, exact to about 1e-11. In the plane these are the equations of ``crank_equations``, found on another way.

Links of the thesis' table 4.1, base to slider: motor and base 0, crank 1 (radius L1), ball joint 2 and 3 (two
kinematic links without length), connecting rod 4 (length L4, finite elements), yoke 5, slider 6. The offsets H2 and H5
are not in print and zero here: the crank plane turns about its own centre, the yoke's pivot lies on the guide.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.machines.connecting_rod import ConnectingRod, EndBody, connecting_rod
from chaosgym.machines.crank_equations import (
    BALL_ACROSS,
    BALL_ALONG,
    BALL_LATERAL,
    ELEMENTS,
    SLIDER_ACROSS,
    SLIDER_ALONG,
    SLIDER_LATERAL,
    Equations,
    bar_of,
    degrees_of_freedom,
    mode_damping,
    rod_of,
)
from chaosgym.machines.kinematics import crank_pin, slider_position

if TYPE_CHECKING:
    from chaosgym.machines.slider_crank import SliderCrank

Array = NDArray[np.float64]

_SHIFT = 0.02
_FIRST = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280]) / _SHIFT
_SECOND = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560]) / _SHIFT**2
"""Central differences of order eight at shifts of ``_SHIFT`` [rad]."""


class _Rods(NamedTuple):
    """The rod in its two planes of bending: with the yoke that swings along, and with the yoke that stays behind."""

    swing: ConnectingRod
    lateral: ConnectingRod


class _Motion(NamedTuple):
    """Particles at B crank angles.

    ``mass`` (k,); ``position`` (B, k, 3) nominal; ``shape`` (B, k, 3, n) Phi; ``director`` (B, k) 1 for a unit vector
    that carries rotary inertia, 0 for a point; ``strain`` (B, 1 + modes, n) stretch of the rod and its modes per unit
    coordinate; ``slider_along`` (B, n).
    """

    mass: Array
    position: Array
    shape: Array
    director: Array
    strain: Array
    slider_along: Array


def _rods(machine: "SliderCrank") -> _Rods:
    swing = rod_of(machine)
    still = EndBody(machine.yoke_mass, 0.0, 0.0, 0.0)
    housing = EndBody(machine.housing_mass, machine.housing_inertia, machine.housing_offset_along, 0.0)
    modes = len(swing.mode_frequency)
    return _Rods(swing, connecting_rod(bar_of(machine), housing, still, modes, ELEMENTS))


def _motion(machine: "SliderCrank", angle: Array, rods: _Rods) -> _Motion:
    names = degrees_of_freedom(machine, spatial=True)
    n, count, length = len(names), len(angle), machine.rod_length
    tilt = math.radians(machine.motor_angle)
    pin = crank_pin(angle, machine.crank_radius, tilt)
    slider = np.zeros_like(pin)
    slider[:, 0] = slider_position(angle, machine.crank_radius, length, tilt)
    d = (slider - pin) / length
    flat = np.hypot(d[:, 0], d[:, 1])
    across = np.stack([-d[:, 1], d[:, 0], np.zeros(count)], axis=-1) / flat[:, None]
    in_plane = np.stack([across[:, 1], -across[:, 0], np.zeros(count)], axis=-1)
    lateral = np.cross(d, across)

    def column(name: str) -> int | None:
        return names.index(name) if name in names else None

    # ends of the rod in space per unit coordinate
    at_a, at_b = np.zeros((count, 3, n)), np.zeros((count, 3, n))
    for name, axis in ((BALL_ALONG, d), (BALL_ACROSS, across), (BALL_LATERAL, lateral)):
        if (c := column(name)) is not None:
            at_a[:, :, c] = axis
    for name, k in ((SLIDER_ALONG, 0), (SLIDER_ACROSS, 1), (SLIDER_LATERAL, 2)):
        if (c := column(name)) is not None:
            at_b[:, k, c] = 1.0
    if machine.rod == "rigid":
        stretch = np.einsum("bi,bin->bn", d, at_b - at_a)
        at_b[:, 0] -= stretch / d[:, :1]

    modes = len(rods.swing.mode_frequency)
    first = n - 2 * modes
    bend = np.zeros((2, count, 3, n))
    chord = at_b - at_a
    turn = (chord - d[:, :, None] * np.einsum("bi,bin->bn", d, chord)[:, None]) / length
    share = rods.swing.position / length
    bar = at_a[:, None] * (1.0 - share)[:, None, None] + at_b[:, None] * share[:, None, None]
    for rod, axis, start in ((rods.swing, across, first), (rods.lateral, lateral, first + modes)):
        own = slice(start, start + modes)
        bar[..., own] += np.einsum("bi,pm->bpim", axis, rod.mode_shape)
        bend[..., own] += np.einsum("bi,em->ebim", axis, rod.mode_slope)
    at_housing, at_yoke = turn + bend[0], turn + bend[1]

    def swing(direction: Array) -> Array:
        return np.asarray(np.einsum("bi,bin->bn", across, direction))

    x, y = machine.housing_offset_along, machine.housing_offset_across
    housing = at_a + x * at_housing - y * d[:, :, None] * swing(at_housing)[:, None]
    angle_of_yoke = swing(at_yoke) / flat[:, None]
    yx, yy = machine.yoke_offset_along, machine.yoke_offset_across
    yoke_turn = across[:, :, None] * angle_of_yoke[:, None]
    yoke = at_b + yx * yoke_turn - yy * in_plane[:, :, None] * angle_of_yoke[:, None]

    central = [
        machine.housing_inertia - machine.housing_mass * (x**2 + y**2),
        machine.yoke_inertia - machine.yoke_mass * (yx**2 + yy**2),
    ]
    bodies = [
        (machine.housing_mass, pin + x * d + y * across, housing),
        (machine.yoke_mass, slider + yx * in_plane + yy * across, yoke),
        (machine.slider_mass, slider, at_b),
        (central[0], d, at_housing),
        (central[1], in_plane, yoke_turn),
    ]
    points = pin[:, None] + rods.swing.position[:, None] * d[:, None]
    strain = np.zeros((count, 1 + 2 * modes, n))
    strain[:, 0] = np.einsum("bi,bin->bn", d, chord)
    for i in range(2 * modes):
        strain[:, 1 + i, first + i] = 1.0
    return _Motion(
        mass=np.concatenate([rods.swing.line_mass * rods.swing.weight, [mass for mass, _, _ in bodies]]),
        position=np.concatenate([points, np.stack([place for _, place, _ in bodies], axis=1)], axis=1),
        shape=np.concatenate([bar, np.stack([shape for _, _, shape in bodies], axis=1)], axis=1),
        director=np.concatenate([np.zeros(len(share) + 3), np.ones(2)]),
        strain=strain,
        slider_along=at_b[:, 0].copy(),
    )


def spatial_loads(machine: "SliderCrank", crank_angle: Array) -> Array:
    """Load of gravity and, per squared crank rate, of the nominal motion: (2, B, n)."""
    rods = _rods(machine)
    motion = _motion(machine, crank_angle, rods)
    return _load(machine, motion, _derivative(machine, crank_angle, rods, _SECOND))


def _derivative(machine: "SliderCrank", angle: Array, rods: _Rods, weights: Array) -> Array:
    """Derivative of the particles' nominal position, (B, k, 3)."""
    shifts = _SHIFT * np.arange(-4, 5)
    return np.asarray(sum(w * _motion(machine, angle + s, rods).position for w, s in zip(weights, shifts, strict=True)))


def _load(machine: "SliderCrank", motion: _Motion, acceleration: Array) -> Array:
    tilt = math.radians(machine.gravity_angle)
    up = machine.gravity * np.array([-math.sin(tilt), math.cos(tilt), 0.0])
    weight = motion.mass * (1.0 - motion.director)
    gravity = np.einsum("k,bkin,i->bn", weight, motion.shape, up, optimize=True)
    inertia = np.einsum("k,bkin,bki->bn", motion.mass, motion.shape, acceleration, optimize=True)
    return np.stack([gravity, inertia])


def spatial_equations(machine: "SliderCrank", crank_angle: Array) -> Equations:
    """Assemble the equations of motion at given crank angles; see ``crank_equations.Equations``.

    Parameters
    ----------
    machine
        The mechanism; its geometric stiffness is left out.
    crank_angle : (B,)
        Crank angles [rad].
    """
    rods = _rods(machine)
    around = [_motion(machine, crank_angle + _SHIFT * k, rods) for k in range(-4, 5)]
    here = around[4]
    shape1 = sum(w * part.shape for w, part in zip(_FIRST, around, strict=True))
    shape2 = sum(w * part.shape for w, part in zip(_SECOND, around, strict=True))
    strain1 = sum(w * part.strain for w, part in zip(_FIRST, around, strict=True))
    place1 = sum(w * part.position for w, part in zip(_FIRST, around, strict=True))
    place2 = sum(w * part.position for w, part in zip(_SECOND, around, strict=True))
    count, _, _, n = here.shape.shape
    weighted = (here.mass[:, None, None] * here.shape).reshape(count, -1, n).swapaxes(-1, -2)

    def against(shape: Array) -> Array:
        return np.asarray(weighted @ shape.reshape(count, -1, n))

    # a unit vector stays one: the second-order turn of a body that carries rotary inertia
    turning = here.mass * here.director * np.einsum("bki,bki->bk", place1, place1)
    kept = np.einsum("bk,bkin,bkim->bnm", turning, here.shape, here.shape, optimize=True)
    elastic, damping = _elastic(machine, rods)
    back = here.strain.swapaxes(-1, -2)
    return Equations(
        mass=against(here.shape),
        damping=np.stack([back @ damping @ here.strain, 2.0 * against(shape1)]),
        stiffness=np.stack([back @ elastic @ here.strain, back @ damping @ strain1, against(shape2) + kept]),
        load=_load(machine, here, place2),
        slider_along=here.slider_along,
    )


def _elastic(machine: "SliderCrank", rods: _Rods) -> tuple[Array, Array]:
    """Stiffness and structural damping of stretch and modes, diagonal; zero for a rigid rod."""
    size = 1 + 2 * len(rods.swing.mode_frequency)
    if machine.rod == "rigid":
        return np.zeros((size, size)), np.zeros((size, size))
    parts = [mode_damping(machine, rod) for rod in rods]
    axial_stiffness, axial_damping = parts[0][0][0], parts[0][1][0]
    stiffness = np.concatenate([[axial_stiffness], parts[0][0][1:], parts[1][0][1:]])
    damping = np.concatenate([[axial_damping], parts[0][1][1:], parts[1][1][1:]])
    return np.diag(stiffness), np.diag(damping)
