r"""Equations of small motions of a mechanism about its nominal motion, over the crank angle (thesis 2.2).

With the compatibility matrix B of the gaps p, particles r_k of mass m_k and Phi_k = dr_k/dz B, all derivatives by the
crank angle, which turns at the rate w:

    M = sum m Phi^T Phi       D = C + 2 w sum m Phi^T Phi'       K = K_e + w^2 sum m Phi^T Phi'' + K_g
    f = sum m Phi^T (w^2 r'' - g) - Phi^T F

Bodies add their central inertia with the turn in place of the particle. (l, f) = A^-T (sum m dr/dz^T a - F) are the
forces of the nominal motion in every joint, the drive's torque first. With them and the second derivatives of points
and joints, the geometric stiffness is

    K_g = B^T (sum m a . d2r - F . d2r - sum_c (l, f)_c d2c) B

Derivatives by the angle are those of the Fourier series through a uniform grid. Where that is too coarse it is refined.
"""

from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import ParameterError
from chaosgym.machines.mechanism.links import Link, inertia_of, rotation
from chaosgym.machines.mechanism.mechanism import Force, Mechanism, Spring
from chaosgym.machines.mechanism.nominal import Nominal, Revolution, nominal
from chaosgym.machines.mechanism.space import spatial_inertia_of
from chaosgym.machines.mechanism.spatial import SpatialMechanism
from chaosgym.machines.periodic import derivatives

TAIL = 1e-10
"""Share of the largest term of a Fourier series that its last terms may have."""

MOST_ANGLES = 4096
"""Angles of a grid, at the most."""


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
    """Share of the last terms of the Fourier series of values (B, ...) in its largest one."""
    series = np.abs(np.fft.rfft(values, axis=0))
    return float(np.max(series[-max(2, len(values) // 24) :]) / max(np.max(series), 1e-300))


def _angles(first: float, count: int) -> Array:
    return np.asarray(first + np.arange(count) * (2.0 * np.pi / count), dtype=np.float64)


def _smooth(mechanism: Mechanism, revolution: Revolution, first: float, count: int) -> tuple[Nominal, int]:
    """Nominal motion on a uniform grid from ``first`` on that is a multiple of ``count`` angles, and that multiple."""
    scale = np.ones(mechanism.size)
    for name, own in mechanism.at.items():
        scale[mechanism.spin(name) : own.stop] = revolution.length
    gaps = mechanism.size - len(mechanism.coordinates)
    for times in (1, 2, 4, 8, 16, 32, 64):
        if times > 1 and times * count > MOST_ANGLES:
            break
        theta = _angles(first, times * count)
        found = nominal(mechanism, revolution, theta)
        periodic = found.z - theta[:, None] * revolution.winding
        # turns in radians, gaps in metres: both count by the length that they move a point
        parts = [found.inverse[:, :, gaps:] * scale[:, None], periodic * scale]
        if max(_tail(part) for part in parts if part.size) < TAIL:
            return found, times
    where = np.degrees(theta[int(np.argmax(found.condition))] % (2.0 * np.pi))
    raise ParameterError(
        f"the mechanism is near a change point at crank angle {where:.0f} deg, where it could go on in two ways; "
        "allowed: dimensions further from it"
    )


def small_motion(mechanism: Mechanism, revolution: Revolution, first: float, count: int) -> SmallMotion:
    """Equations at ``count`` crank angles (B,), a uniform grid of a revolution from ``first`` [rad] on.

    Raises
    ------
    ParameterError
        If the mechanism is near a change point.

    Examples
    --------
    >>> from chaosgym.machines.mechanism.equations import small_motion
    >>> from chaosgym.machines.mechanism.nominal import revolution_of
    >>> crank = chaosgym.read_machine("docs/machines/slider-crank-flores-guide.toml").mechanism
    >>> small_motion(crank, revolution_of(crank), first=0.0, count=36).mass.shape
    (36, 2, 2)
    """
    sums, times = _summed(mechanism, revolution, first, count, True)
    sums.add_geometric()
    return SmallMotion(
        mass=sums.mass[::times],
        damping=sums.damping[:, ::times],
        stiffness=sums.stiffness[:, ::times],
        load=sums.load[:, ::times],
        torque=sums.torque[:, ::times],
    )


def loads(mechanism: Mechanism, revolution: Revolution, first: float, count: int) -> Array:
    """``small_motion(mechanism, revolution, first, count).load`` alone, in a fraction of its time.

    Examples
    --------
    >>> from chaosgym.machines.mechanism.equations import loads
    >>> from chaosgym.machines.mechanism.nominal import revolution_of
    >>> crank = chaosgym.read_machine("docs/machines/slider-crank-flores-guide.toml").mechanism
    >>> loads(crank, revolution_of(crank), first=0.0, count=36).shape
    (3, 36, 2)
    """
    sums, times = _summed(mechanism, revolution, first, count, False)
    return sums.load[:, ::times]


def sliding(mechanism: Mechanism, revolution: Revolution, theta: Array, joint: str) -> tuple[Array, Array]:
    """Sliding of a joint along its axis: per radian of the crank, (B,), and per unit of each coordinate, (B, n)."""
    found = nominal(mechanism, revolution, theta)
    along = mechanism.along(found.z, next(each for each in mechanism.joints if each.name == joint))[1]
    every = np.einsum("bz,bzc->bc", along, found.inverse)
    return every[:, 0], every[:, mechanism.size - len(mechanism.coordinates) :]


def crank_inertia(mechanism: Mechanism, revolution: Revolution, first: float, count: int) -> Array:
    """Inertia (B,) [kg m^2] of all links as the crank feels it in the nominal motion: twice their energy at 1 rad/s."""
    found, times = _smooth(mechanism, revolution, first, count)
    sums = _Sums(mechanism, revolution, found, _angles(first, times * count), True, found.inverse[:, :, :1])
    for link in mechanism.links:
        sums.add_link(link)
    return sums.mass[::times, 0, 0]


def drive_torque(mechanism: Mechanism, revolution: Revolution, first: float, count: int) -> Array:
    """``small_motion(mechanism, revolution, first, count).torque`` alone, in a fraction of its time.

    Examples
    --------
    >>> from chaosgym.machines.mechanism.equations import drive_torque
    >>> from chaosgym.machines.mechanism.nominal import revolution_of
    >>> crank = chaosgym.read_machine("docs/machines/slider-crank-flores-guide.toml").mechanism
    >>> drive_torque(crank, revolution_of(crank), first=0.0, count=36).shape
    (3, 36)
    """
    sums, times = _summed(mechanism, revolution, first, count, False)
    return sums.torque[:, ::times]


def _summed(
    mechanism: Mechanism, revolution: Revolution, first: float, count: int, matrices: bool
) -> tuple["_Sums", int]:
    """What all links, forces and springs add at a multiple of ``count`` angles, and that multiple."""
    found, times = _smooth(mechanism, revolution, first, count)
    gaps = found.inverse[:, :, mechanism.size - len(mechanism.coordinates) :]
    sums = _Sums(mechanism, revolution, found, _angles(first, times * count), matrices, gaps)
    for link in mechanism.links:
        sums.add_link(link)
        if matrices and link.elastic:
            sums.add_elastic(link)
    for force in mechanism.forces:
        sums.add_force(force)
    for spring in mechanism.springs:
        sums.add_spring(spring)
    return sums, times


class _Sums:
    """What masses, springs and forces add, at B crank angles, to the motions ``compatible`` (B, z, n).

    ``mass`` (B, n, n), ``damping`` (2, B, n, n), ``stiffness`` (3, B, n, n), ``pull`` (3, B, z) what the links resist
    with in their own coordinates, ``bent`` (3, B, z, z) its derivative by the second derivatives of the points.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        revolution: Revolution,
        found: Nominal,
        theta: Array,
        matrices: bool,
        compatible: Array,
    ) -> None:
        self.mechanism, self.found, self.theta, self.matrices = mechanism, found, theta, matrices
        self.winding = revolution.winding
        self.compatible = compatible
        count, size, n = compatible.shape
        self.pull = np.zeros((3, count, size))
        if matrices:
            self.mass, self.damping = np.zeros((count, n, n)), np.zeros((2, count, n, n))
            self.stiffness, self.bent = np.zeros((3, count, n, n)), np.zeros((3, count, size, size))

    @property
    def load(self) -> Array:
        """What the gaps feel of all pulls, (3, B, n)."""
        return np.asarray((self.pull[:, :, None] @ self.compatible)[:, :, 0])

    @property
    def torque(self) -> Array:
        """What the drive feels of all pulls, (3, B)."""
        return np.asarray(np.einsum("bz,kbz->kb", self.found.inverse[:, :, 0], self.pull))

    def add_link(self, link: Link) -> None:
        """Add the mass of a link, in the plane or in space."""
        if len(link.mass):
            (self.add_spatial if isinstance(self.mechanism, SpatialMechanism) else self.add_masses)(link)

    def add_masses(self, link: Link) -> None:
        """Add the particles of a link and what turns with them, in axes of the link."""
        own, inertia = self.mechanism.at[link.name], inertia_of(link)
        turn = rotation(self.found.z[:, own.start + 2])
        back = np.swapaxes(turn, -1, -2)
        places = self.found.z[:, own.start : own.start + 3] - self.theta[:, None] * self.winding[own][:3]
        first, second = derivatives(places)
        rate, spin = self.winding[own.start + 2] + first[:, 2], second[:, 2]
        pushed = np.zeros((3, len(turn), 4))
        pushed[0, :, :2] = back @ -np.asarray(self.mechanism.gravity)
        pushed[2, :, :2] = (back @ second[:, :2, None])[..., 0]
        pushed[2, :, 2], pushed[2, :, 3] = spin, -(rate**2)
        pull = pushed @ inertia.pull
        pull[2] += spin[:, None] * inertia.turning[2]
        pull[..., :2] = np.einsum("bij,kbj->kbi", turn, pull[..., :2])
        self.pull[..., own] += pull
        if not self.matrices:
            return
        self.bent[..., own, own] += np.tensordot(pushed, inertia.bent, 1)
        motion = self.compatible[:, own].copy()
        motion[:, :2] = back @ motion[:, :2]
        once, twice = derivatives(motion)
        rate, spin = rate[:, None, None], spin[:, None, None]
        mass, transposed = inertia.translating + inertia.turning, np.swapaxes(motion, -1, -2)
        self.mass += transposed @ (mass @ motion)
        turned, centrifugal = inertia.gyroscopic @ motion, inertia.translating @ motion
        self.damping[1] += 2.0 * transposed @ (mass @ once + rate * turned)
        curved = mass @ twice + 2.0 * rate * (inertia.gyroscopic @ once)
        self.stiffness[2] += transposed @ (curved + spin * turned - rate**2 * centrifugal)

    def add_spatial(self, link: Link) -> None:
        """Add the particles of a link in space, in axes of the link."""
        own, inertia = self.mechanism.at[link.name], spatial_inertia_of(link)
        turn, count = link.masses.lie.turn(self.found.z[:, own]), len(self.theta)
        back = np.swapaxes(turn, -1, -2)
        spun, swung = (back @ each for each in derivatives(turn))
        place = self.found.z[:, own.start : own.start + 3]
        pushed = np.zeros((2, count, 12))
        pushed[0, :, :3] = back @ -np.asarray(self.mechanism.gravity)
        pushed[1, :, :3] = (back @ derivatives(place)[1][:, :, None])[..., 0]
        pushed[1, :, 3:] = swung.reshape(count, 9)
        powers, rigid = [0, 2], (own.start, own.start + 3)
        pull = pushed @ inertia.pull
        for start in (0, 3):
            pull[..., start : start + 3] = (turn @ pull[..., start : start + 3, None])[..., 0]
        self.pull[powers, ..., own] += pull
        if not self.matrices:
            return
        motion = self.compatible[:, own].copy()
        for start, there in zip((0, 3), rigid, strict=True):
            motion[:, start : start + 3] = back @ self.compatible[:, there : there + 3]
        once, twice = derivatives(motion)
        mass, transposed = np.einsum("iizy->zy", inertia.moments), np.swapaxes(motion, -1, -2)
        spinning, swinging = (np.tensordot(each, inertia.moments, 2) for each in (spun, swung))
        self.mass += transposed @ (mass @ motion)
        self.damping[1] += 2.0 * transposed @ (mass @ once + spinning @ motion)
        self.stiffness[2] += transposed @ (mass @ twice + 2.0 * spinning @ once + swinging @ motion)
        self.stiffness[powers] += transposed @ np.tensordot(pushed, inertia.bent, 1) @ motion

    def add_elastic(self, link: Link) -> None:
        """Add stiffness and damping of the elastic coordinates of a link, which are the last of p."""
        own = self.mechanism.at[link.name]
        part = self.compatible[:, own.start + link.rigid : own.stop]
        self.stiffness[0] += np.swapaxes(part, -1, -2) @ link.stiffness @ part
        self.damping[0] += np.swapaxes(part, -1, -2) @ link.damping @ part

    def add_force(self, force: Force) -> None:
        """Add a force that acts whatever moves."""
        vector = force.at(self.theta)
        _, gradient = self.mechanism.point(self.found.z, force.point)
        self.pull[0] -= np.einsum("bi,biz->bz", vector, gradient)
        if self.matrices:
            self.mechanism.add_bent(self.found.z, force.point, -vector, self.bent[0])

    def add_spring(self, spring: Spring) -> None:
        """Add a spring and damper between two points."""
        z, mechanism = self.found.z, self.mechanism
        apart, gradient = mechanism.apart(z, spring.first, spring.second)
        length = np.linalg.norm(apart, axis=1)
        if not np.all(length > 1e-9 * max(1.0, float(np.max(np.abs(apart))))):
            where = np.degrees(self.theta[int(np.argmin(length))] % (2.0 * np.pi))
            raise ParameterError(
                f"the spring between {'.'.join(spring.first)} and {'.'.join(spring.second)} has no length at crank "
                f"angle {where:.0f} deg; allowed: ends that never meet"
            )
        unit = apart / length[:, None]
        slope = np.einsum("bi,biz->bz", unit, gradient)
        rate = derivatives(length)[0]
        pulls = (spring.stiffness * (length - spring.free_length), spring.damping * rate)
        for power, pulled in enumerate(pulls):
            self.pull[power] += pulled[:, None] * slope
        if not self.matrices:
            return
        bend = np.swapaxes(gradient, -1, -2) @ gradient - slope[:, :, None] * slope[:, None]
        bend /= length[:, None, None]
        mechanism.add_bent(z, spring.second, unit, bend)
        mechanism.add_bent(z, spring.first, -unit, bend)
        for power, pulled in enumerate(pulls):
            self.bent[power] += pulled[:, None, None] * bend
        motion = np.einsum("bz,bzn->bn", slope, self.compatible)
        change = derivatives(motion)[0]
        self.stiffness[0] += spring.stiffness * motion[:, :, None] * motion[:, None]
        self.damping[0] += spring.damping * motion[:, :, None] * motion[:, None]
        self.stiffness[1] += spring.damping * motion[:, :, None] * change[:, None]

    def add_geometric(self) -> None:
        """Add the geometric stiffness of all that the others have pulled."""
        forces = np.einsum("bzc,kbz->kbc", self.found.inverse, self.pull)
        self.mechanism.add_bent_rows(self.found.z, -forces, self.bent)
        self.stiffness += np.swapaxes(self.compatible, -1, -2) @ self.bent @ self.compatible
