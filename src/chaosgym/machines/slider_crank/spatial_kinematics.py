r"""Motions of the bodies of a slider crank in space, nominal and small ones about that.

With the crank plane turned about the vertical, the rod swings in two planes: d from the ball to the slider, n across it
in the yoke's plane of swing (about the slider's pivot axis Z), b = d x n. The yoke carries the rod in a bearing about
n, so its own axis e is d's shadow in the plane across Z: d = cos g e - sin g Z.

Everything that has mass is written as particles at x_i = X_i(th) + Phi_i(th) p: the bar as the integration points of
its finite elements, a rotary inertia as the inertia of the unit vector along the body.

If the slider turns by rho, its pivot axis tilts by t = rho x Z. The yoke stays across that axis and in line with the
rod, so that with the rod's end turning by beta = (beta_n, beta_b)

    e:  a n - (e.t) Z            a = (beta_n + sin g n.t) / cos g       swing of the yoke
    n:  -a e - (n.t) Z,          s = -(n.t + sin g beta_n) / cos g      spin of the rod about d
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.machines.slider_crank.connecting_rod import ConnectingRod, EndBody, connecting_rod
from chaosgym.machines.slider_crank.equations import (
    BALL_DIRECTIONS,
    ROD_STRETCH,
    SLIDER_ACROSS,
    SLIDER_LATERAL,
    SLIDER_TURNS,
    bar_of,
    degrees_of_freedom,
    modes_of,
    rod_of,
)
from chaosgym.machines.slider_crank.kinematics import crank_pin, slider_position
from chaosgym.machines.slider_crank.parameters import CrankParameters

Array = NDArray[np.float64]

AXIS = np.array([0.0, 0.0, 1.0])
"""Z, the slider's pivot axis."""


class Rods(NamedTuple):
    """The rod in its two planes of bending: with the yoke that swings along, and with the yoke that stays behind."""

    swing: ConnectingRod
    lateral: ConnectingRod


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
    particle : (B, k, 3, n)
        Phi.
    strain : (B, 1 + modes, n)
        Stretch of the rod, and its modes.
    end_a, end_b : (B, 3, n)
        The rod's ends.
    turn_a, turn_b : (B, 3, n)
        Change of the unit vector along the rod at its ends.
    swing, spin : (B, n)
        Turn of the yoke about its pivot, and of the rod about itself.
    slider_turn : (3, n)
        Turn of the slider about X, Y and Z.
    """

    particle: Array
    strain: Array
    end_a: Array
    end_b: Array
    turn_a: Array
    turn_b: Array
    swing: Array
    spin: Array
    slider_turn: Array


def rods_of(machine: CrankParameters) -> Rods:
    """The rod of a machine in both planes."""
    swing = rod_of(machine)
    still = EndBody(machine.yoke_mass, 0.0, 0.0, 0.0)
    housing = EndBody(machine.housing_mass, machine.housing_inertia, machine.housing_offset_along, 0.0)
    return Rods(swing, connecting_rod(bar_of(machine), housing, still, *modes_of(machine)))


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


def masses_of(machine: CrankParameters, rods: Rods) -> tuple[Array, Array]:
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


def slider_inertia(machine: CrankParameters) -> Array:
    """Central moments of inertia (3,) of the slider about X, Y and Z: a block as wide as it is high."""
    along, across = machine.slider_offset_along, machine.slider_offset_across
    roll = machine.slider_roll_inertia - machine.slider_mass * across**2
    pitch = machine.slider_pitch_inertia - machine.slider_mass * (along**2 + across**2)
    return np.array([roll, pitch, pitch])


def slider_offset(machine: CrankParameters) -> Array:
    """Centre of gravity (3,) of the slider from its pivot."""
    return np.array([machine.slider_offset_along, machine.slider_offset_across, 0.0])


def positions_at(machine: CrankParameters, angle: Array, rods: Rods) -> Array:
    """Nominal positions (B, k, 3) of the particles, unit vectors included."""
    frame = frame_at(machine, angle)
    bar = frame.pin[:, None] + rods.swing.position[:, None] * frame.along[:, None]
    housing = frame.pin + machine.housing_offset_along * frame.along + machine.housing_offset_across * frame.across
    yoke = frame.slider + machine.yoke_offset_along * frame.yoke + machine.yoke_offset_across * frame.across
    slider = frame.slider + slider_offset(machine)
    return np.concatenate([bar, np.stack([housing, yoke, slider, frame.along, frame.yoke], axis=1)], axis=1)


def _ends(machine: CrankParameters, frame: Frame) -> tuple[Array, Array]:
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


def _slider_turn(machine: CrankParameters) -> Array:
    """Turn (3, n) of the slider about X, Y and Z per unit coordinate."""
    names = degrees_of_freedom(machine, spatial=True)
    return np.array([[float(name == turn) for name in names] for turn in SLIDER_TURNS])


def shapes_at(machine: CrankParameters, angle: Array, rods: Rods) -> Shapes:
    """Motion per unit coordinate at crank angles (B,) [rad]."""
    frame = frame_at(machine, angle)
    at_a, at_b = _ends(machine, frame)
    count, _, n = at_a.shape
    length, modes = machine.rod_length, len(rods.swing.mode_frequency)
    chord = at_b - at_a
    stretch = np.einsum("bi,bin->bn", frame.along, chord)
    turn_a = (chord - frame.along[:, :, None] * stretch[:, None]) / length
    turn_b = turn_a.copy()
    share = (rods.swing.position / length)[:, None, None]
    bar = at_a[:, None] * (1.0 - share) + at_b[:, None] * share
    strain = np.zeros((count, 1 + 2 * modes, n))
    strain[:, 0] = stretch
    for rod, axis, first in ((rods.swing, frame.across, n - 2 * modes), (rods.lateral, frame.sideways, n - modes)):
        own = slice(first, first + modes)
        bar[..., own] += np.einsum("bi,pm->bpim", axis, rod.mode_shape)
        turn_a[..., own] += np.einsum("bi,m->bim", axis, rod.mode_slope[0])
        turn_b[..., own] += np.einsum("bi,m->bim", axis, rod.mode_slope[1])
    strain[:, 1:, n - 2 * modes :] = np.eye(2 * modes)

    slider_turn = _slider_turn(machine)
    tilt = np.cross(slider_turn, AXIS, axisa=0, axisb=0, axisc=0)
    cosine, sine = np.sum(frame.along * frame.yoke, axis=1)[:, None], -frame.along[:, 2:]
    beta, tilt_across = np.einsum("bi,bin->bn", frame.across, turn_b), frame.across @ tilt
    swing = (beta + sine * tilt_across) / cosine
    spin = -(tilt_across + sine * beta) / cosine
    yoke_turn = frame.across[:, :, None] * swing[:, None] - AXIS[:, None] * (frame.yoke @ tilt)[:, None]

    housing = at_a + machine.housing_offset_along * turn_a
    alpha = np.einsum("bi,bin->bn", frame.across, turn_a)
    housing += machine.housing_offset_across * (
        frame.sideways[:, :, None] * spin[:, None] - frame.along[:, :, None] * alpha[:, None]
    )
    yoke = at_b + machine.yoke_offset_along * yoke_turn
    yoke -= machine.yoke_offset_across * (
        frame.yoke[:, :, None] * swing[:, None] + AXIS[:, None] * tilt_across[:, None]
    )
    slider = at_b + np.cross(slider_turn, slider_offset(machine), axisa=0, axisb=0, axisc=0)
    bodies = np.stack([housing, yoke, slider, turn_a, yoke_turn], axis=1)
    return Shapes(np.concatenate([bar, bodies], axis=1), strain, at_a, at_b, turn_a, turn_b, swing, spin, slider_turn)
