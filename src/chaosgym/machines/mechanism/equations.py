r"""Equations of small motions of a mechanism about its nominal motion, over the crank angle (thesis 2.2).

With the compatibility matrix B of the gaps p, particles r_k of mass m_k and Phi_k = dr_k/dz B, all derivatives by the
crank angle, which turns at the rate w:

    M = sum m Phi^T Phi       D = C + 2 w sum m Phi^T Phi'       K = K_e + w^2 sum m Phi^T Phi'' + K_g
    f = sum m Phi^T (w^2 r'' - g) - Phi^T F

Bodies add their central inertia with the turn in place of the particle. (l, f) = A^-T (sum m dr/dz^T a - F) are the
forces of the nominal motion in every joint, the drive's torque first. With them and the second derivatives of points
and joints, the geometric stiffness is

    K_g = B^T (sum m a . d2r - F . d2r - sum_c (l, f)_c d2c) B

All of it is a smooth function of the crank angle, apart from forces that are given over it; these stand beside it as
factors of what forces of 1 N do. So it is found on a uniform grid that is as fine as its Fourier series needs, and that
series gives its derivatives and its values at other angles.
"""

import math
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import ParameterError
from chaosgym.machines.mechanism.mechanism import Mechanism
from chaosgym.machines.mechanism.nominal import Nominal, Revolution, nominal
from chaosgym.machines.mechanism.sums import Sums, spring_length
from chaosgym.machines.periodic import between

TAIL = 1e-10
"""Share of the largest term of a Fourier series that the upper third of its terms may have."""

LEAST_ANGLES, MOST_ANGLES = 48, 6144
"""Angles of a grid, at the least and at the most."""

LEAST_MASS = 1e-10
"""Least eigenvalue of a mass matrix whose diagonal is one."""


class SmallMotion(NamedTuple):
    """Equations of small motions at B crank angles, by powers of the crank rate w; n coordinates.

    Attributes
    ----------
    mass : (B, n, n)
    damping : (2, B, n, n)
    stiffness : (3, B, n, n)
    load : (3, B, n)
        f: what must be overcome, so that M p'' + D p' + K p = -f + contact forces.
    torque : (3, B)
        Torque of the drive in the nominal motion [N m].
    """

    mass: Array
    damping: Array
    stiffness: Array
    load: Array
    torque: Array


def _tail(values: Array) -> float:
    """Share of the upper third of the terms of the Fourier series of values (B, ...) in its largest one."""
    series = np.abs(np.fft.rfft(values, axis=0))
    return float(np.max(series[len(values) // 3 :]) / max(np.max(series), 1e-300))


def _angles(count: int) -> Array:
    return np.asarray(np.arange(count) * (2.0 * np.pi / count), dtype=np.float64)


def smooth(mechanism: Mechanism, revolution: Revolution) -> tuple[Array, Nominal]:
    """Uniform grid of crank angles from 0 on whose Fourier series has all of the nominal motion, and that motion."""
    scale = np.ones(mechanism.size)
    for name, own in mechanism.at.items():
        scale[mechanism.spin(name) : own.stop] = revolution.length
    # a revolution with many steps turns sharply somewhere, or was made on such a grid
    count = max(LEAST_ANGLES, 12 * math.ceil((len(revolution.theta) - 1) / 12.0))
    while True:
        theta = _angles(count)
        found = nominal(mechanism, revolution, theta)
        # turns in radians, gaps in metres: both count by the length that they move a point
        periodic = (found.z - theta[:, None] * revolution.winding) * scale
        parts = [found.inverse * scale[:, None], periodic]
        parts += [1.0 / spring_length(mechanism, found.z, spring, theta)[:, None] for spring in mechanism.springs]
        tail = max(_tail(part) for part in parts)
        if tail < TAIL:
            return theta, found
        if count == MOST_ANGLES:
            break
        # terms fall like those of a geometric series
        falls = math.log(TAIL) / min(math.log(tail), -1e-3)
        count = min(MOST_ANGLES, 12 * math.ceil(count * min(max(1.1 * falls, 1.25), 4.0) / 12.0))
    where = np.degrees(theta[int(np.argmax(found.condition))] % (2.0 * np.pi))
    raise ParameterError(
        f"the mechanism is near a change point at crank angle {where:.0f} deg, where it could go on in two ways; "
        "allowed: dimensions further from it"
    )


class Assembled(NamedTuple):
    """Equations of small motions on a grid of G angles of a revolution, by k kinds of pulls: see ``Sums``.

    ``matrices`` (G, 3 + k, n, n): M, both parts of D, and K; empty if only loads are known. ``load`` (G, k, n),
    ``torque`` (G, k). Kinds beyond the powers of the rate are those of forces of 1 N of ``mechanism``. ``sliding``
    (G, 1 + n) of a joint along its axis, or the turning of a pin in the plane, per radian of the crank and per unit of
    each coordinate; empty without one.
    """

    mechanism: Mechanism
    matrices: Array
    load: Array
    torque: Array
    sliding: Array

    def at(self, theta: Array) -> SmallMotion:
        """Equations at crank angles (B,) [rad]."""
        return SmallMotion(*self.matrices_at(theta), self.load_at(theta), self.torque_at(theta))

    def matrices_at(self, theta: Array) -> tuple[Array, Array, Array]:
        """M, D and K of ``SmallMotion`` at crank angles (B,) [rad]."""
        found = np.swapaxes(between(self.matrices, theta), 0, 1)
        return found[0], found[1:3], self._forced(found[3:], theta)

    def load_at(self, theta: Array) -> Array:
        """Loads (3, B, n) at crank angles (B,) [rad]."""
        return self._forced(np.swapaxes(between(self.load, theta), 0, 1), theta)

    def torque_at(self, theta: Array) -> Array:
        """Torque (3, B) of the drive at crank angles (B,) [rad]."""
        return self._forced(np.swapaxes(between(self.torque, theta), 0, 1), theta)

    def sliding_at(self, theta: Array) -> tuple[Array, Array]:
        """Sliding of the joint per radian of the crank, (B,), and per unit of each coordinate, (B, n)."""
        found = between(self.sliding, theta)
        return found[:, 0], found[:, 1:]

    def _forced(self, found: Array, theta: Array) -> Array:
        """By the three powers of the rate, (3, B, ...), of all kinds of pulls (k, B, ...)."""
        total, first = found[:3].copy(), 3
        for force in self.mechanism.forces:
            for part in force.at(theta).T:
                total[0] += part.reshape(-1, *[1] * (found.ndim - 2)) * found[first]
                first += 1
        return total


def assembled(
    mechanism: Mechanism, revolution: Revolution, *, matrices: bool = True, geometric: bool = True, slides: str = ""
) -> Assembled:
    """Equations of all angles of a revolution.

    Parameters
    ----------
    mechanism, revolution
        The mechanism, and the steps of its nominal motion.
    matrices
        False for loads and torques alone, in a fraction of the time.
    geometric
        Whether the forces of the nominal motion stiffen. Without it the axes of bodies that turn stay unit vectors.
    slides
        Joint whose sliding is told, if any, or whose turning if it is revolute, in the plane.

    Raises
    ------
    ParameterError
        If the mechanism is near a change point.
    """
    theta, found = smooth(mechanism, revolution)
    gaps = found.inverse[:, :, mechanism.size - len(mechanism.coordinates) :]
    kinds = 3 + mechanism.dimensions * len(mechanism.forces)
    sums = Sums(mechanism, revolution, found, theta, gaps, kinds=kinds, matrices=matrices, geometric=geometric)
    for link in mechanism.links:
        sums.add_link(link)
        if matrices and link.elastic:
            sums.add_elastic(link)
    for k, force in enumerate(mechanism.forces):
        sums.add_forces(force.point, 3 + mechanism.dimensions * k)
    for spring in mechanism.springs:
        sums.add_spring(spring)
    if matrices:
        sums.add_geometric()
    sliding = np.empty((len(theta), 0))
    if slides:
        which = next(joint for joint in mechanism.joints if joint.name == slides)
        along = mechanism.along(found.z, which)[1]
        if which.kind == "revolute":
            along = mechanism.motions(found.z)[1][:, mechanism.joints.index(which), 2]
        sliding = (along[:, None] @ found.inverse)[:, 0]
        sliding = np.delete(sliding, np.arange(1, mechanism.size - gaps.shape[-1]), axis=1)
    every = np.concatenate([sums.mass[None], sums.damping, sums.stiffness]) if matrices else np.empty((0, 0, 0, 0))
    whole, load, torque = (np.moveaxis(part, 0, 1) for part in (every, sums.load, sums.torque))
    return Assembled(mechanism, whole, load, torque, sliding)


def small_motion(mechanism: Mechanism, revolution: Revolution, theta: Array) -> SmallMotion:
    """Equations at crank angles (B,) [rad].

    Raises
    ------
    ParameterError
        If the mechanism is near a change point.

    Examples
    --------
    >>> from chaosgym.machines.mechanism.equations import small_motion
    >>> from chaosgym.machines.mechanism.nominal import revolution_of
    >>> crank = chaosgym.read_machine("docs/machines/slider-crank-flores-guide.toml").mechanism
    >>> small_motion(crank, revolution_of(crank), np.linspace(0.0, 6.0, 36)).mass.shape
    (36, 2, 2)
    """
    return assembled(mechanism, revolution).at(theta)


def crank_inertia(mechanism: Mechanism, revolution: Revolution, theta: Array) -> Array:
    """Inertia (B,) [kg m^2] of all links as the crank feels it in the nominal motion: twice their energy at 1 rad/s."""
    grid, found = smooth(mechanism, revolution)
    sums = Sums(mechanism, revolution, found, grid, found.inverse[:, :, :1])
    for link in mechanism.links:
        sums.add_link(link)
    return between(sums.mass[:, 0, 0], theta)


def refuse_massless(mass: Array, names: tuple[str, ...]) -> None:
    """Refuse mass matrices (B, n, n) in which some motion moves no mass."""
    size = np.sqrt(np.maximum(np.einsum("bii->bi", mass), 0.0))
    scaled = mass / np.where(size > 0.0, size, 1.0)[:, :, None] / np.where(size > 0.0, size, 1.0)[:, None]
    sizes, ways = np.linalg.eigh(scaled)
    worst = int(np.argmin(sizes[:, 0]))
    if sizes[worst, 0] > LEAST_MASS:
        return
    # rounding may tie what has no mass to what has
    share = np.abs(ways[worst, :, 0])
    name = names[int(np.argmin(np.where(share > 0.5 * share.max(), size[worst], np.inf)))]
    raise ParameterError(
        f"nothing resists the motion {name!r}: the links that it moves have no mass, or no inertia where they "
        "only turn; allowed: a [[link.NAME.body]] with mass and inertia"
    )
