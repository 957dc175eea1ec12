r"""Motions of the bodies of a slider crank, nominal and small ones about that.

With the crank plane turned about the vertical, the rod swings in two planes: d from the ball to the slider, n across it
in the yoke's plane of swing (about the slider's pivot axis Z), b = d x n. The yoke carries the rod in a bearing about
n, so its own axis e is d's shadow in the plane across Z: d = cos g e - sin g Z. In the plane of a motor that stands
straight g = 0, and no coordinate moves along Z.

Everything that has mass is a point at x_i = X_i(th) + Phi_i(th) p: the ends of the bar, and the centres of gravity of
housing, yoke and slider. A mode of the bar moves it by its unit vector, n or b, and a rotary inertia is the inertia of
the unit vector along the body. The inertia of the bar couples its ends and modes, hence a mass matrix between points.

Every coordinate but the stretch leaves the rod its length, and its end B follows the guide. So everything stiff,
contacts and rod, has a coordinate of its own: no elastic force depends on the crank angle, and none jumps where
matrices that are held over a bin change to those of the next. (The slider's place along the guide instead of the
stretch would make the rod's force jump by (E A / l) y d(tan phi) at every bin.)

If the slider turns by rho, its pivot axis tilts by t = rho x Z. The yoke stays across that axis and in line with the
rod, so that with the rod's end turning by beta = (beta_n, beta_b)

    e:  a n - (e.t) Z            a = (beta_n + sin g n.t) / cos g       swing of the yoke
    n:  -a e - (n.t) Z,          s = -(n.t + sin g beta_n) / cos g      spin of the rod about d
"""

import math
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.machines.slider_crank.connecting_rod import ConnectingRod
from chaosgym.machines.slider_crank.coordinates import (
    BALL_DIRECTIONS,
    ROD_STRETCH,
    SLIDER_ACROSS,
    SLIDER_LATERAL,
    SLIDER_TURNS,
    degrees_of_freedom,
)
from chaosgym.machines.slider_crank.kinematics import crank_pin, slider_position
from chaosgym.machines.slider_crank.parameters import CrankParameters

AXIS = np.array([0.0, 0.0, 1.0])
"""Z, the slider's pivot axis."""

END_A, END_B = 0, 1
HOUSING, YOKE, SLIDER, ALONG_ROD, ALONG_YOKE = -5, -4, -3, -2, -1
"""Points, with the bar's modes in the middle; the last two are unit vectors."""


class Frame(NamedTuple):
    """Nominal crank pin and slider pivot, and the axes d, n, b of the rod and e of the yoke, all (B, 3)."""

    pin: Array
    slider: Array
    along: Array
    across: Array
    sideways: Array
    yoke: Array


class Shapes(NamedTuple):
    """Motion per unit coordinate.

    Attributes
    ----------
    point : (B, k, 3, n)
        Phi.
    turn_a, turn_b : (B, 3, n)
        Change of the unit vector along the rod at its ends.
    swing, spin : (B, n)
        Turn of the yoke about its pivot, and of the rod about itself.
    slider_turn : (3, n)
        Turn of the slider about X, Y and Z.
    """

    point: Array
    turn_a: Array
    turn_b: Array
    swing: Array
    spin: Array
    slider_turn: Array


def frame_at(machine: CrankParameters, angle: Array) -> Frame:
    """Nominal frame at crank angles (B,) [rad]."""
    tilt = math.radians(machine.motor_angle)
    pin = crank_pin(angle, machine.crank_radius, tilt)
    slider = np.zeros_like(pin)
    slider[:, 0] = slider_position(angle, machine.crank_radius, machine.rod_length, tilt)
    along = (slider - pin) / machine.rod_length
    yoke = along * [1.0, 1.0, 0.0]
    yoke /= np.linalg.norm(yoke, axis=1)[:, None]
    across = np.cross(AXIS, yoke)
    return Frame(pin, slider, along, across, np.cross(along, across), yoke)


def bending_planes(rods: tuple[ConnectingRod, ...], frame: Frame, size: int) -> list[tuple[ConnectingRod, Array, int]]:
    """Rod, direction (B, 3) of bending, and first of ``size`` coordinates that is a mode, of every plane."""
    modes = len(rods[0].mode_frequency)
    firsts = [size - modes * (len(rods) - plane) for plane in range(len(rods))]
    return list(zip(rods, (frame.across, frame.sideways)[: len(rods)], firsts, strict=True))


def masses_of(machine: CrankParameters, rods: tuple[ConnectingRod, ...]) -> Array:
    """Mass matrix (k, k) of the points [kg], and of the unit vectors of housing and yoke [kg m^2]."""
    rod = rods[0]
    bar = np.hstack([rod.shape[:, :2], *(one.shape[:, 2:] for one in rods)])
    housing = machine.housing_offset_along**2 + machine.housing_offset_across**2
    yoke = machine.yoke_offset_along**2 + machine.yoke_offset_across**2
    bodies = [
        machine.housing_mass,
        machine.yoke_mass,
        machine.slider_mass,
        machine.housing_inertia - machine.housing_mass * housing,
        machine.yoke_inertia - machine.yoke_mass * yoke,
    ]
    count = bar.shape[1]
    mass = np.zeros((count + len(bodies), count + len(bodies)))
    mass[:count, :count] = bar.T @ ((rod.line_mass * rod.weight)[:, None] * bar)
    mass[count:, count:] = np.diag(bodies)
    return mass


def slider_inertia(machine: CrankParameters) -> Array:
    """Central moments of inertia (3,) of the slider about X, Y and Z: a block as wide as it is high."""
    along, across = machine.slider_offset_along, machine.slider_offset_across
    roll = machine.slider_roll_inertia - machine.slider_mass * across**2
    pitch = machine.slider_pitch_inertia - machine.slider_mass * (along**2 + across**2)
    return np.array([roll, pitch, pitch])


def slider_offset(machine: CrankParameters) -> Array:
    """Centre of gravity (3,) of the slider from its pivot."""
    return np.array([machine.slider_offset_along, machine.slider_offset_across, 0.0])


def positions_of(machine: CrankParameters, frame: Frame, count: int) -> Array:
    """Nominal positions (B, k, 3) of ``count`` points; modes are straight."""
    place = np.zeros((len(frame.pin), count, 3))
    place[:, END_A], place[:, END_B] = frame.pin, frame.slider
    place[:, HOUSING] = frame.pin + machine.housing_offset_along * frame.along
    place[:, HOUSING] += machine.housing_offset_across * frame.across
    place[:, YOKE] = frame.slider + machine.yoke_offset_along * frame.yoke + machine.yoke_offset_across * frame.across
    place[:, SLIDER] = frame.slider + slider_offset(machine)
    place[:, ALONG_ROD], place[:, ALONG_YOKE] = frame.along, frame.yoke
    return place


def _ends(names: tuple[str, ...], frame: Frame) -> tuple[Array, Array, Array]:
    """Motion (B, 3, n) of the rod's ends A and B per unit coordinate, and the rod's stretch (n,)."""
    at_a, at_b = np.zeros((2, len(frame.pin), 3, len(names)))
    for name, axis in zip(BALL_DIRECTIONS, (frame.along, frame.across, frame.sideways), strict=True):
        if name in names:
            at_a[:, :, names.index(name)] = axis
    for k, name in ((1, SLIDER_ACROSS), (2, SLIDER_LATERAL)):
        if name in names:
            at_b[:, k, names.index(name)] = 1.0
    stretch = np.array([float(name == ROD_STRETCH) for name in names])
    at_b[:, 0] = (stretch - np.einsum("bi,bin->bn", frame.along, at_b - at_a)) / frame.along[:, :1]
    return at_a, at_b, stretch


def shapes_of(machine: CrankParameters, frame: Frame, rods: tuple[ConnectingRod, ...]) -> Shapes:
    """Motion per unit coordinate at the crank angles of a frame."""
    names = degrees_of_freedom(machine)
    at_a, at_b, stretch = _ends(names, frame)
    count, _, n = at_a.shape
    modes = len(rods[0].mode_frequency)
    point = np.zeros((count, 2 + modes * len(rods) + 5, 3, n))
    point[:, END_A], point[:, END_B] = at_a, at_b
    turn_a = (at_b - at_a - frame.along[:, :, None] * stretch) / machine.rod_length
    turn_b = turn_a.copy()
    for rod, axis, first in bending_planes(rods, frame, n):
        for mode in range(modes):
            point[:, 2 + first + mode - (n - modes * len(rods)), :, first + mode] = axis
        turn_a[..., first : first + modes] += axis[:, :, None] * rod.end_slope[0]
        turn_b[..., first : first + modes] += axis[:, :, None] * rod.end_slope[1]

    slider_turn = np.array([[float(name == turn) for name in names] for turn in SLIDER_TURNS])
    tilt = np.cross(slider_turn, AXIS, axisa=0, axisb=0, axisc=0)
    cosine, sine = np.sum(frame.along * frame.yoke, axis=1)[:, None], -frame.along[:, 2:]
    beta, tilt_across = np.einsum("bi,bin->bn", frame.across, turn_b), frame.across @ tilt
    swing = (beta + sine * tilt_across) / cosine
    spin = -(tilt_across + sine * beta) / cosine
    yoke_turn = frame.across[:, :, None] * swing[:, None] - AXIS[:, None] * (frame.yoke @ tilt)[:, None]
    alpha = np.einsum("bi,bin->bn", frame.across, turn_a)

    point[:, HOUSING] = at_a + machine.housing_offset_along * turn_a
    point[:, HOUSING] += machine.housing_offset_across * (
        frame.sideways[:, :, None] * spin[:, None] - frame.along[:, :, None] * alpha[:, None]
    )
    point[:, YOKE] = at_b + machine.yoke_offset_along * yoke_turn
    point[:, YOKE] -= machine.yoke_offset_across * (
        frame.yoke[:, :, None] * swing[:, None] + AXIS[:, None] * tilt_across[:, None]
    )
    point[:, SLIDER] = at_b + np.cross(slider_turn, slider_offset(machine), axisa=0, axisb=0, axisc=0)
    point[:, ALONG_ROD], point[:, ALONG_YOKE] = turn_a, yoke_turn
    return Shapes(point, turn_a, turn_b, swing, spin, slider_turn)
