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
from chaosgym.core.matrices import product
from chaosgym.errors import ParameterError
from chaosgym.machines.mechanism.joints import ACROSS, ALONG
from chaosgym.machines.mechanism.mechanism import Mechanism
from chaosgym.machines.mechanism.nominal import Nominal, Revolution, nominal
from chaosgym.machines.mechanism.sums import Sums, between, spring_length

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


class Rubbing(NamedTuple):
    """Forces on J joints with friction, at B crank angles.

    ``rate`` (J, B) of the sliding of each per radian of the crank, or of the turning of a pin; ``motion`` (J, n, B) the
    same per unit of each coordinate; ``forces`` (3, R, B) along the R motions that press them, by powers of the rate,
    of which each joint has the ``rows``; ``answer`` (J, R, B) what a unit of its friction adds to the forces.
    """

    rate: Array
    motion: Array
    forces: Array
    answer: Array
    rows: tuple[list[int], ...]


class Assembled(NamedTuple):
    """Equations of small motions on a grid of G angles of a revolution, by k kinds of pulls: see ``Sums``.

    ``matrices`` (G, 3 + k, n, n): M, both parts of D, and K; empty if only loads are known. ``load`` (G, k, n),
    ``torque`` (G, k). Kinds beyond the powers of the rate are those of forces of 1 N of ``mechanism``. ``slips``
    (G, J, 1 + n + R) and ``presses`` (G, k, R) are ``Rubbing``.
    """

    mechanism: Mechanism
    matrices: Array
    load: Array
    torque: Array
    slips: Array
    presses: Array
    rows: tuple[list[int], ...] = ()

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

    def rubbing_at(self, theta: Array) -> Rubbing:
        """Joints with friction that were named, at crank angles (B,) [rad]."""
        rate, motion, answer = np.split(between(self.slips, theta), [1, 1 + self.load.shape[2]], axis=2)
        forces = self._forced(np.swapaxes(between(self.presses, theta), 0, 1), theta)
        return Rubbing(
            np.moveaxis(rate[..., 0], 0, -1),
            np.moveaxis(motion, 0, -1),
            np.swapaxes(forces, 1, 2),
            np.moveaxis(answer, 0, -1),
            self.rows,
        )

    def _forced(self, found: Array, theta: Array) -> Array:
        """By the three powers of the rate, (3, B, ...), of all kinds of pulls (k, B, ...)."""
        total, first = found[:3].copy(), 3
        for force in self.mechanism.forces:
            for part in force.at(theta).T:
                total[0] += part.reshape(-1, *[1] * (found.ndim - 2)) * found[first]
                first += 1
        return total


def assembled(
    mechanism: Mechanism,
    revolution: Revolution,
    *,
    matrices: bool = True,
    geometric: bool = True,
    rubbing: tuple[str, ...] = (),
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
    rubbing
        Joints whose forces are told, and how they slide along their axis or, if revolute in the plane, turn.

    Raises
    ------
    ParameterError
        If the mechanism is near a change point.
    """
    theta, found = smooth(mechanism, revolution)
    gaps = found.inverse[:, :, mechanism.size - len(mechanism.coordinates) :]
    parts = [force.parts(mechanism.dimensions) for force in mechanism.forces]
    kinds = 3 + sum(parts)
    sums = Sums(mechanism, revolution, found, theta, gaps, kinds=kinds, matrices=matrices, geometric=geometric)
    for link in mechanism.links:
        sums.add_link(link)
        if matrices and link.elastic:
            sums.add_elastic(link)
    for k, force in enumerate(mechanism.forces):
        sums.add_forces(force, 3 + sum(parts[:k]))
    for spring in mechanism.springs:
        sums.add_spring(spring)
    for held in mechanism.torsion:
        sums.add_torsion(held)
    if matrices:
        sums.add_geometric()
    every = np.concatenate([sums.mass[None], sums.damping, sums.stiffness]) if matrices else np.empty((0, 0, 0, 0))
    whole, load, torque = (np.moveaxis(part, 0, 1) for part in (every, sums.load, sums.torque))
    return Assembled(mechanism, whole, load, torque, *_rubbing(sums, gaps.shape[-1], rubbing))


def _rubbing(sums: Sums, n: int, names: tuple[str, ...]) -> tuple[Array, Array, tuple[list[int], ...]]:
    """``slips``, ``presses`` and ``rows`` of some joints, with n coordinates."""
    mechanism, found = sums.mechanism, sums.found
    rows = list(enumerate(mechanism.rows(), mechanism.lead))
    places: list[int] = []
    pressing: list[list[int]] = []
    joints = [joint for name in names for joint in mechanism.joints if joint.name == name]
    for joint in joints:
        # a gap is held in its middle by all that its surfaces can push, a tight joint by what presses its axis
        across = {*joint.opened} or {ACROSS, *([ALONG] if joint.kind == "revolute" else [])}
        own = [k for k, row in rows if row.joint is joint and row.motion in across]
        pressing.append(list(range(len(places), len(places) + len(own))))
        places += own
    slips = np.empty((len(sums.theta), len(joints), 1 + n + len(places)))
    for j, joint in enumerate(joints):
        along = mechanism.along(found.z, joint)[1]
        if joint.kind == "revolute":
            along = mechanism.motions(found.z)[1][:, mechanism.joints.index(joint), 2]
        answer = product(along[:, None], found.inverse)[:, 0]
        slips[:, j] = np.concatenate([answer[:, :1], answer[:, mechanism.size - n :], answer[:, places]], axis=1)
        if mechanism.prescribed:
            slips[:, j, 0] = np.einsum("bz,bz->b", along, mechanism.led(found.inverse, sums.theta))
    return slips, np.einsum("bzc,kbz->bkc", found.inverse[:, :, places], sums.pull), tuple(pressing)


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
    sums = Sums(mechanism, revolution, found, grid, mechanism.led(found.inverse, grid)[:, :, None])
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
