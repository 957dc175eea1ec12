r"""Stiffening of a rod that swings in two planes by the forces of the nominal motion.

A tension P(s) along the rod pulls it straight in either plane, and bodies off the rod's ends work against their own
acceleration as they turn. Both are the second-order parts of the motion, times the forces of the nominal motion:

    K_geo = int P (w_n' w_n'^T + w_b' w_b'^T) ds + sum m A . x'',    P(s) = N . d - sum of m A . d beyond s

with slopes w' in both planes, accelerations A that include gravity's reaction, and the guide's reaction N. The second
order x'' of the bodies follows from that of the yoke, which stays across its pivot axis: its swing is

    a = beta_n / cos g - beta_n beta_b sin g / cos^2 g,     and the spin s has   beta_n beta_b tan^2 g.

Left out are products of the slider's own turns with those of the rod: they are bounded by the clearance.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from chaosgym.machines.slider_crank.connecting_rod import ACROSS_A, ACROSS_B, MODES
from chaosgym.machines.slider_crank.spatial_kinematics import AXIS, Frame, Rods, Shapes, slider_offset

if TYPE_CHECKING:
    from chaosgym.machines.slider_crank.parameters import SliderCrank

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


def _tension(machine: "SliderCrank", rods: Rods, frame: Frame, acceleration: Array, guide: Array) -> Array:
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
    machine: "SliderCrank", rods: Rods, frame: Frame, shapes: Shapes, acceleration: Array, guide: Array
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


def _slider_stiffness(machine: "SliderCrank", shapes: Shapes, acceleration: Array) -> Array:
    """Of the slider, whose centre of gravity is off its pivot and turns with it, (2, B, n, n)."""
    turn, offset = shapes.slider_turn, slider_offset(machine)
    pulled = np.einsum("qbi,in->qbn", acceleration, turn)
    arm = np.broadcast_to(offset @ turn, pulled.shape)
    product = pulled[..., :, None] * arm[..., None, :]
    hanging = np.einsum("qbi,i->qb", acceleration, offset)[..., None, None] * (turn.T @ turn)
    return np.asarray(machine.slider_mass * (0.5 * (product + np.swapaxes(product, -1, -2)) - hanging))


def held(machine: "SliderCrank") -> "SliderCrank":
    """The machine with a rigid rod and clearance at the slider alone: its loads are what the guide must carry."""
    return replace(machine, rod="rigid", slider_joint="clearance", ball_joint="ideal", geometric_stiffness="off")
