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
    BALL_DIRECTIONS,
    ELEMENTS,
    ROD_STRETCH,
    SLIDER_ACROSS,
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


class _Frame(NamedTuple):
    """Nominal crank pin and slider pivot, and the axes d, n, b of the rod and the yoke's own, all (B, 3)."""

    pin: Array
    slider: Array
    along: Array
    across: Array
    sideways: Array
    yoke: Array


class _Shapes(NamedTuple):
    """Motion per unit coordinate.

    ``particle`` (B, k, 3, n) Phi; ``strain`` (B, 1 + modes, n) stretch of the rod, and its modes; ``slider_along``
    (B, n).
    """

    particle: Array
    strain: Array
    slider_along: Array


def _rods(machine: "SliderCrank") -> _Rods:
    swing = rod_of(machine)
    still = EndBody(machine.yoke_mass, 0.0, 0.0, 0.0)
    housing = EndBody(machine.housing_mass, machine.housing_inertia, machine.housing_offset_along, 0.0)
    modes = len(swing.mode_frequency)
    return _Rods(swing, connecting_rod(bar_of(machine), housing, still, modes, ELEMENTS))


def _frame(machine: "SliderCrank", angle: Array) -> _Frame:
    tilt = math.radians(machine.motor_angle)
    pin = crank_pin(angle, machine.crank_radius, tilt)
    slider = np.zeros_like(pin)
    slider[:, 0] = slider_position(angle, machine.crank_radius, machine.rod_length, tilt)
    along = (slider - pin) / machine.rod_length
    yoke = along * [1.0, 1.0, 0.0]
    yoke /= np.linalg.norm(yoke, axis=1)[:, None]
    across = np.cross([0.0, 0.0, 1.0], yoke)
    return _Frame(pin, slider, along, across, np.cross(along, across), yoke)


def _masses(machine: "SliderCrank", rods: _Rods) -> tuple[Array, Array]:
    """Masses (k,) of the particles: the bar's points, housing, yoke, slider, and the unit vectors of housing and yoke.

    The second array (k,) is 1 for the two unit vectors, whose mass is a central rotary inertia, and 0 for points.
    """
    housing = machine.housing_offset_along**2 + machine.housing_offset_across**2
    yoke = machine.yoke_offset_along**2 + machine.yoke_offset_across**2
    bodies = [
        machine.housing_mass,
        machine.yoke_mass,
        machine.slider_mass,
        machine.housing_inertia - machine.housing_mass * housing,
        machine.yoke_inertia - machine.yoke_mass * yoke,
    ]
    bar = rods.swing.line_mass * rods.swing.weight
    return np.concatenate([bar, bodies]), np.concatenate([np.zeros(len(bar) + 3), np.ones(2)])


def _positions(machine: "SliderCrank", angle: Array, rods: _Rods) -> Array:
    """Nominal positions (B, k, 3) of the particles, unit vectors included."""
    frame = _frame(machine, angle)
    bar = frame.pin[:, None] + rods.swing.position[:, None] * frame.along[:, None]
    housing = frame.pin + machine.housing_offset_along * frame.along + machine.housing_offset_across * frame.across
    yoke = frame.slider + machine.yoke_offset_along * frame.yoke + machine.yoke_offset_across * frame.across
    return np.concatenate([bar, np.stack([housing, yoke, frame.slider, frame.along, frame.yoke], axis=1)], axis=1)


def _ends(machine: "SliderCrank", frame: _Frame) -> tuple[Array, Array]:
    """Motion (B, 3, n) of the rod's ends A and B per unit coordinate."""
    names = degrees_of_freedom(machine, spatial=True)
    at_a, at_b = np.zeros((2, len(frame.pin), 3, len(names)))
    for name, axis in zip(BALL_DIRECTIONS, (frame.along, frame.across, frame.sideways), strict=True):
        if name in names:
            at_a[:, :, names.index(name)] = axis
    for k, name in ((1, SLIDER_ACROSS), (2, SLIDER_LATERAL)):
        if name in names:
            at_b[:, k, names.index(name)] = 1.0
    # end B follows the guide to where the rod has its length, or is stretched by its own coordinate
    wanted = np.array([float(name == ROD_STRETCH) for name in names])
    at_b[:, 0] = (wanted - np.einsum("bi,bin->bn", frame.along, at_b - at_a)) / frame.along[:, :1]
    return at_a, at_b


def _shapes(machine: "SliderCrank", angle: Array, rods: _Rods) -> _Shapes:
    frame = _frame(machine, angle)
    at_a, at_b = _ends(machine, frame)
    count, _, n = at_a.shape
    length, modes = machine.rod_length, len(rods.swing.mode_frequency)
    chord = at_b - at_a
    stretch = np.einsum("bi,bin->bn", frame.along, chord)
    turn = (chord - frame.along[:, :, None] * stretch[:, None]) / length
    share = (rods.swing.position / length)[:, None, None]
    bar = at_a[:, None] * (1.0 - share) + at_b[:, None] * share
    housing_turn, yoke_end_turn = turn, turn.copy()
    strain = np.zeros((count, 1 + 2 * modes, n))
    strain[:, 0] = stretch
    for rod, axis, first in ((rods.swing, frame.across, n - 2 * modes), (rods.lateral, frame.sideways, n - modes)):
        own = slice(first, first + modes)
        bar[..., own] += np.einsum("bi,pm->bpim", axis, rod.mode_shape)
        housing_turn[..., own] += np.einsum("bi,m->bim", axis, rod.mode_slope[0])
        yoke_end_turn[..., own] += np.einsum("bi,m->bim", axis, rod.mode_slope[1])
    strain[:, 1:, n - 2 * modes :] = np.eye(2 * modes)

    def swing(direction: Array) -> Array:
        return np.asarray(np.einsum("bi,bin->bn", frame.across, direction)[:, None])

    # the yoke turns about the slider's pivot axis only, so that the rod's end keeps in its plane
    swing_of_yoke = swing(yoke_end_turn) / np.einsum("bi,bi->b", frame.along, frame.yoke)[:, None, None]
    yoke_turn = frame.across[:, :, None] * swing_of_yoke
    housing = at_a + machine.housing_offset_along * housing_turn
    housing -= machine.housing_offset_across * frame.along[:, :, None] * swing(housing_turn)
    yoke = at_b + machine.yoke_offset_along * yoke_turn
    yoke -= machine.yoke_offset_across * frame.yoke[:, :, None] * swing_of_yoke
    bodies = np.stack([housing, yoke, at_b, housing_turn, yoke_turn], axis=1)
    return _Shapes(np.concatenate([bar, bodies], axis=1), strain, at_b[:, 0].copy())


def _difference(weights: Array, around: list[Array]) -> Array:
    return np.asarray(sum(w * part for w, part in zip(weights, around, strict=True)))


def _shifted(crank_angle: Array) -> list[Array]:
    return [crank_angle + _SHIFT * k for k in range(-4, 5)]


def spatial_loads(machine: "SliderCrank", crank_angle: Array) -> Array:
    """Load of gravity and, per squared crank rate, of the nominal motion: (2, B, n)."""
    rods = _rods(machine)
    around = [_positions(machine, angle, rods) for angle in _shifted(crank_angle)]
    particle = _shapes(machine, crank_angle, rods).particle
    return _loads(machine, rods, particle, _difference(_SECOND, around))


def _loads(machine: "SliderCrank", rods: _Rods, particle: Array, acceleration: Array) -> Array:
    mass, director = _masses(machine, rods)
    tilt = math.radians(machine.gravity_angle)
    up = machine.gravity * np.array([-math.sin(tilt), math.cos(tilt), 0.0])
    count, _, _, n = particle.shape
    flat = particle.reshape(count, -1, n)
    gravity = ((mass * (1.0 - director))[:, None] * up).reshape(1, 1, -1) @ flat
    inertia = (mass[:, None] * acceleration).reshape(count, 1, -1) @ flat
    return np.stack([gravity[:, 0], inertia[:, 0]])


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
    mass, director = _masses(machine, rods)
    around = [_shapes(machine, angle, rods) for angle in _shifted(crank_angle)]
    places = [_positions(machine, angle, rods) for angle in _shifted(crank_angle)]
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
    inertial = against(_difference(_SECOND, particles) + kept)
    return Equations(
        mass=against(here.particle),
        damping=np.stack([back @ damping @ here.strain, 2.0 * against(_difference(_FIRST, particles))]),
        stiffness=np.stack([back @ elastic @ here.strain, back @ damping @ strain1, inertial]),
        load=_loads(machine, rods, here.particle, _difference(_SECOND, places)),
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
