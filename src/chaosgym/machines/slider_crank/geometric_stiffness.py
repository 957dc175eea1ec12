r"""Geometric stiffness of a slider crank: the forces of its nominal motion against the second order of small motions.

A tension P(s) along the rod pulls it straight in either plane, and bodies off its ends work against their own
acceleration as they turn:

    K_geo = int P (w_n' w_n'^T + w_b' w_b'^T) ds + sum m A . x'',    P(s) = N . d - sum of m A . d beyond s

with slopes w' in both planes, accelerations A that include gravity's reaction, and the guide's reaction N. The second
order x'' of the bodies follows from that of the yoke, which stays across its pivot axis: its swing is

    a = beta_n / cos g - beta_n beta_b sin g / cos^2 g,     and the spin s has   beta_n beta_b tan^2 g.

Left out are products of the slider's own turns with those of the rod: they are bounded by the clearance.
"""

import numpy as np

from chaosgym.arrays import Array
from chaosgym.machines.slider_crank.connecting_rod import ConnectingRod
from chaosgym.machines.slider_crank.motions import (
    ALONG_ROD,
    ALONG_YOKE,
    AXIS,
    END_A,
    END_B,
    HOUSING,
    SLIDER,
    YOKE,
    Frame,
    Shapes,
    bending_planes,
    slider_offset,
)
from chaosgym.machines.slider_crank.parameters import CrankParameters


def _pair(one: Array, other: Array) -> Array:
    """Hessian of the product of two linear forms (B, n)."""
    product = one[:, :, None] * other[:, None]
    return np.asarray(product + np.swapaxes(product, -1, -2))


def _square(form: Array) -> Array:
    return 0.5 * _pair(form, form)


def _dot(one: Array, other: Array) -> Array:
    """Scalar products (2, B) of accelerations (2, B, 3) with directions (B, 3)."""
    return np.asarray(np.einsum("qbi,bi->qb", one, other))


def _times(factor: Array, form: Array) -> Array:
    return np.asarray(factor[..., None, None] * form)


def _tension(machine: CrankParameters, rod: ConnectingRod, frame: Frame, acceleration: Array, guide: Array) -> Array:
    """Coefficients (3, 2, B) of the tension [N] as a polynomial of the place along the rod, as in ``ConnectingRod``."""
    line, length = rod.line_mass, machine.rod_length
    spread = _dot(acceleration[:, :, ALONG_ROD], frame.along)
    at_pin = _dot(acceleration[:, :, END_A], frame.along)
    constant = _dot(guide, frame.along) - machine.yoke_mass * _dot(acceleration[:, :, YOKE], frame.along)
    constant -= machine.slider_mass * _dot(acceleration[:, :, SLIDER], frame.along)
    constant -= line * (at_pin * length + 0.5 * spread * length**2)
    return np.stack([constant, line * at_pin * length, 0.5 * line * spread * length**2])


def _rod_stiffness(rods: tuple[ConnectingRod, ...], frame: Frame, shapes: Shapes, tension: Array) -> Array:
    """Tension against the slopes of all planes, (2, B, n, n)."""
    count, _, _, n = shapes.point.shape
    modes = len(rods[0].mode_frequency)
    total = np.zeros((2, count, n, n))
    for rod, axis, first in bending_planes(rods, frame, n):
        to_rod = np.zeros((count, 2 + modes, n))
        for end in (END_A, END_B):
            to_rod[:, end] = np.einsum("bi,bin->bn", axis, shapes.point[:, end])
        to_rod[:, 2:, first : first + modes] = np.eye(modes)
        back = np.swapaxes(to_rod, -1, -2)
        for coefficient, matrix in zip(tension, rod.tension, strict=True):
            total += _times(coefficient, back @ matrix @ to_rod)
    return total


def geometric_stiffness(
    machine: CrankParameters,
    rods: tuple[ConnectingRod, ...],
    frame: Frame,
    shapes: Shapes,
    acceleration: Array,
    guide: Array,
) -> Array:
    """Geometric stiffness of gravity and, per squared crank rate, of the nominal motion: (2, B, n, n).

    Parameters
    ----------
    machine, rods, frame, shapes
        As ``motions`` has them at B crank angles.
    acceleration : (2, B, k, 3)
        Of the points: gravity's reaction, and the nominal motion's per squared crank rate.
    guide : (2, B, 3)
        Force [N] of the guide on the slider that holds the nominal motion, likewise.
    """
    housing, yoke, yoke_vector = (acceleration[:, :, k] for k in (HOUSING, YOKE, ALONG_YOKE))
    cosine, sine = np.sum(frame.along * frame.yoke, axis=1), -frame.along[:, 2]
    alpha, alpha_b = (np.einsum("bi,bin->bn", axis, shapes.turn_a) for axis in (frame.across, frame.sideways))
    twist = _pair(*(np.einsum("bi,bin->bn", axis, shapes.turn_b) for axis in (frame.across, frame.sideways)))
    hx, hy = machine.housing_mass * machine.housing_offset_along, machine.housing_mass * machine.housing_offset_across
    offset = machine.yoke_offset_along * frame.yoke + machine.yoke_offset_across * frame.across
    central = machine.yoke_inertia - machine.yoke_mass * float(np.sum(offset[0] ** 2))
    turned = machine.yoke_mass * _dot(yoke, np.cross(AXIS, offset)) + central * _dot(yoke_vector, frame.across)

    total = _rod_stiffness(rods, frame, shapes, _tension(machine, rods[0], frame, acceleration, guide))
    total -= _times(hx * _dot(housing, frame.along), _square(alpha) + _square(alpha_b))
    total -= _times(hy * _dot(housing, frame.across), _square(alpha) + _square(shapes.spin))
    total -= _times(hy * _dot(housing, frame.along), _pair(alpha_b, shapes.spin))
    total += _times(hy * _dot(housing, frame.sideways) * (sine / cosine) ** 2, twist)
    total -= _times(machine.yoke_mass * _dot(yoke, offset), _square(shapes.swing))
    total -= _times(turned * sine / cosine**2, twist)
    return total + _slider_stiffness(machine, shapes, acceleration[:, :, SLIDER])


def _slider_stiffness(machine: CrankParameters, shapes: Shapes, acceleration: Array) -> Array:
    """Of the slider, whose centre of gravity is off its pivot and turns with it, (2, B, n, n)."""
    turn, offset = shapes.slider_turn, slider_offset(machine)
    pulled = np.einsum("qbi,in->qbn", acceleration, turn)
    arm = np.broadcast_to(offset @ turn, pulled.shape)
    product = pulled[..., :, None] * arm[..., None, :]
    hanging = np.einsum("qbi,i->qb", acceleration, offset)[..., None, None] * (turn.T @ turn)
    return np.asarray(machine.slider_mass * (0.5 * (product + np.swapaxes(product, -1, -2)) - hanging))
