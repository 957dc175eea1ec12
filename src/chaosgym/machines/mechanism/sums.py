"""What links, springs and forces of a mechanism add to its equations of small motions (``equations``)."""

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.matrices import product
from chaosgym.errors import ParameterError
from chaosgym.machines.mechanism.forces import Force, Spring, TorsionSpring
from chaosgym.machines.mechanism.links import Link, inertia_of, rotation
from chaosgym.machines.mechanism.mechanism import Mechanism
from chaosgym.machines.mechanism.nominal import Nominal, Revolution
from chaosgym.machines.mechanism.space import spatial_inertia_of
from chaosgym.machines.mechanism.spatial import SpatialMechanism


def derivatives(values: Array) -> tuple[Array, Array]:
    """First and second derivative by the angle of values (B, ...) on a uniform grid of a revolution.

    Their Fourier series is their trigonometric interpolation: with enough angles it is exact to rounding (Trefethen,
    Spectral Methods in MATLAB, 2000, chapter 3).
    """
    count = len(values)
    k = np.arange(count // 2 + 1).reshape(-1, *[1] * (values.ndim - 1))
    series = np.fft.rfft(values, axis=0)
    first = 1j * k * series
    if count % 2 == 0:
        first[-1] = 0.0
    return np.fft.irfft(first, count, axis=0), np.fft.irfft(-(k**2) * series, count, axis=0)


def between(values: Array, angle: Array) -> Array:
    """Values (A, ...) at angles (A,) [rad], of values (B, ...) at B equidistant angles from 0 on.

    Examples
    --------
    >>> from chaosgym.machines.mechanism.sums import between
    >>> between(np.cos(2 * np.pi * np.arange(5) / 5), np.array([0.3])) - np.cos(0.3) < 1e-15
    array([ True])
    """
    count = len(values)
    series = np.fft.rfft(values.reshape(count, -1), axis=0) * (2.0 / count)
    series[0] *= 0.5
    if count % 2 == 0:
        series[-1] *= 0.5
    turns = np.vander(np.exp(1j * angle), len(series), increasing=True)
    found = product(turns.real, series.real) - product(turns.imag, series.imag)
    return np.asarray(found.reshape(len(angle), *values.shape[1:]))


def spring_length(mechanism: Mechanism, z: Array, spring: Spring, theta: Array) -> Array:
    """Length (B,) [m] of a spring at coordinates z (B, z).

    Raises
    ------
    ParameterError
        If its ends meet; names the crank angle.
    """
    apart = mechanism.apart(z, spring.first, spring.second)[0]
    length = np.linalg.norm(apart, axis=1)
    if not np.all(length > 1e-9 * max(1.0, float(np.max(np.abs(apart))))):
        where = np.degrees(theta[int(np.argmin(length))] % (2.0 * np.pi))
        raise ParameterError(
            f"the spring between {'.'.join(spring.first)} and {'.'.join(spring.second)} has no length at crank "
            f"angle {where:.0f} deg; allowed: ends that never meet"
        )
    return np.asarray(length)


class Sums:
    """What masses, springs and forces add, at B crank angles, to the motions ``compatible`` (B, z, n).

    Pulls are of k kinds: by the three powers of the crank's rate, then of unit forces. ``mass`` (B, n, n), ``damping``
    (2, B, n, n), ``stiffness`` (k, B, n, n); ``pull`` (k, B, z) what the links resist with in their own coordinates,
    ``bent`` (k, B, z, z) its derivative by the second derivatives of the points, ``curved`` (k, B, n, n) that part of
    it that is summed already.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        revolution: Revolution,
        found: Nominal,
        theta: Array,
        compatible: Array,
        *,
        kinds: int = 3,
        matrices: bool = True,
        geometric: bool = True,
    ) -> None:
        self.geometric = geometric
        self.mechanism, self.found, self.theta, self.matrices = mechanism, found, theta, matrices
        self.winding = revolution.winding
        self.compatible = compatible
        count, size, n = compatible.shape
        self.pull = np.zeros((kinds, count, size))
        if matrices:
            self.mass, self.damping = np.zeros((count, n, n)), np.zeros((2, count, n, n))
            self.stiffness, self.curved = np.zeros((2, kinds, count, n, n))
            self.bent = np.zeros((kinds, count, size, size))

    @property
    def load(self) -> Array:
        """What the gaps feel of all pulls, (k, B, n)."""
        return np.asarray(product(self.pull[:, :, None], self.compatible)[:, :, 0])

    @property
    def torque(self) -> Array:
        """What the drive feels of all pulls, (k, B)."""
        return np.asarray(np.einsum("bz,kbz->kb", self.mechanism.led(self.found.inverse, self.theta), self.pull))

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
        powers = [0, 2]
        pushed = np.zeros((2, len(turn), 4))
        pushed[0, :, :2] = product(back, -np.asarray(self.mechanism.gravity))
        pushed[1, :, :2] = product(back, second[:, :2, None])[..., 0]
        pushed[1, :, 2], pushed[1, :, 3] = spin, -(rate**2)
        pull = product(pushed, inertia.pull)
        pull[1] += spin[:, None] * inertia.turning[2]
        pull[..., :2] = np.einsum("bij,kbj->kbi", turn, pull[..., :2])
        self.pull[powers, ..., own] += pull
        if not self.matrices:
            return
        motion = self.compatible[:, own].copy()
        motion[:, :2] = product(back, motion[:, :2])
        once, twice = derivatives(motion)
        rate, spin = rate[:, None, None], spin[:, None, None]
        mass, transposed = inertia.translating + inertia.turning, np.swapaxes(motion, -1, -2)
        self.mass += product(transposed, product(mass, motion))
        turned, centrifugal = product(inertia.gyroscopic, motion), product(inertia.translating, motion)
        self.damping[1] += product(2.0 * transposed, product(mass, once) + rate * turned)
        curved = product(mass, twice) + 2.0 * rate * product(inertia.gyroscopic, once)
        self.stiffness[2] += product(transposed, curved + spin * turned - rate**2 * centrifugal)
        if self.geometric:
            self.curved[powers] += product(transposed, matrices.tensordot(pushed, inertia.bent, 1), motion)

    def add_spatial(self, link: Link) -> None:
        """Add the particles of a link in space, in axes of the link."""
        own, inertia = self.mechanism.at[link.name], spatial_inertia_of(link)
        turn, count = link.masses.lie.turn(self.found.z[:, own]), len(self.theta)
        back = np.swapaxes(turn, -1, -2)
        spun, swung = (product(back, each) for each in derivatives(turn))
        place = self.found.z[:, own.start : own.start + 3]
        pushed = np.zeros((2, count, 12))
        pushed[0, :, :3] = product(back, -np.asarray(self.mechanism.gravity))
        pushed[1, :, :3] = product(back, derivatives(place)[1][:, :, None])[..., 0]
        pushed[1, :, 3:] = swung.reshape(count, 9)
        powers, rigid = [0, 2], (own.start, own.start + 3)
        pull = product(pushed, inertia.pull)
        for start in (0, 3):
            pull[..., start : start + 3] = product(turn, pull[..., start : start + 3, None])[..., 0]
        self.pull[powers, ..., own] += pull
        if not self.matrices:
            return
        motion = self.compatible[:, own].copy()
        for start, there in zip((0, 3), rigid, strict=True):
            motion[:, start : start + 3] = product(back, self.compatible[:, there : there + 3])
        once, twice = derivatives(motion)
        mass, transposed = np.einsum("iizy->zy", inertia.moments), np.swapaxes(motion, -1, -2)
        spinning, swinging = (matrices.tensordot(each, inertia.moments, 2) for each in (spun, swung))
        self.mass += product(transposed, product(mass, motion))
        self.damping[1] += product(2.0 * transposed, product(mass, once) + product(spinning, motion))
        self.stiffness[2] += product(
            transposed, product(mass, twice) + product(2.0 * spinning, once) + product(swinging, motion)
        )
        if self.geometric:
            self.curved[powers] += product(transposed, matrices.tensordot(pushed, inertia.bent, 1), motion)
        else:
            kept = matrices.tensordot(np.diagonal(swung, axis1=1, axis2=2), link.turning, 1)
            self.curved[2] -= product(transposed, kept, motion)

    def add_elastic(self, link: Link) -> None:
        """Add stiffness and damping of the elastic coordinates of a link, which are the last of p."""
        own = self.mechanism.at[link.name]
        part = self.compatible[:, own.start + link.rigid : own.stop]
        self.stiffness[0] += product(np.swapaxes(part, -1, -2), link.stiffness, part)
        self.damping[0] += product(np.swapaxes(part, -1, -2), link.damping, part)

    def add_forces(self, force: Force, first: int) -> None:
        """Add forces of 1 N along the axes of the ground on a point, or 1 N m, as kinds of pulls from ``first`` on."""
        if force.turns:
            self.pull[first] -= self.mechanism.turn_of(force.point)
            return
        point = force.point
        _, gradient = self.mechanism.point(self.found.z, point)
        for axis, kind in enumerate(range(first, first + self.mechanism.dimensions)):
            self.pull[kind] -= gradient[:, axis]
            if self.matrices:
                vector = np.zeros((len(self.theta), self.mechanism.dimensions))
                vector[:, axis] = -1.0
                self.mechanism.add_bent(self.found.z, point, vector, self.bent[kind])

    def add_spring(self, spring: Spring) -> None:
        """Add a spring and damper between two points."""
        z, mechanism = self.found.z, self.mechanism
        apart, gradient = mechanism.apart(z, spring.first, spring.second)
        length = spring_length(mechanism, z, spring, self.theta)
        unit = apart / length[:, None]
        slope = np.einsum("bi,biz->bz", unit, gradient)
        rate = derivatives(length)[0]
        pulls = (spring.stiffness * (length - spring.free_length), spring.damping * rate)
        for power, pulled in enumerate(pulls):
            self.pull[power] += pulled[:, None] * slope
        if not self.matrices:
            return
        bend = product(np.swapaxes(gradient, -1, -2), gradient) - slope[:, :, None] * slope[:, None]
        bend /= length[:, None, None]
        mechanism.add_bent(z, spring.second, unit, bend)
        mechanism.add_bent(z, spring.first, -unit, bend)
        for power, pulled in enumerate(pulls):
            self.bent[power] += pulled[:, None, None] * bend
        self._add_held(slope, spring.stiffness, spring.damping)

    def _add_held(self, slope: Array, stiffness: float, damping: float) -> None:
        """Add a spring and damper of what grows with the coordinates by ``slope`` (B, z) or (z,)."""
        motion = np.einsum("bz,bzn->bn", np.broadcast_to(slope, self.compatible.shape[:2]), self.compatible)
        change = derivatives(motion)[0]
        self.stiffness[0] += stiffness * motion[:, :, None] * motion[:, None]
        self.damping[0] += damping * motion[:, :, None] * motion[:, None]
        self.stiffness[1] += damping * motion[:, :, None] * change[:, None]

    def add_torsion(self, spring: TorsionSpring) -> None:
        """Add a spring and damper between the turns of two links.

        Raises
        ------
        ParameterError
            If one link turns right round against the other, which would wind the spring up.
        """
        slope = self.mechanism.turn_of(spring.second) - self.mechanism.turn_of(spring.first)
        wound, turn = float(product(self.winding, slope)), product(self.found.z, slope)
        if wound and spring.stiffness:
            raise ParameterError(
                f"the torsion spring between {'.'.join(spring.first)} and {'.'.join(spring.second)} is wound up by "
                f"{wound:g} turns in each revolution; allowed: links that swing, or a damper without stiffness"
            )
        rate = wound + derivatives(turn - wound * self.theta)[0]
        pulls = spring.stiffness * (turn - spring.free_angle), spring.damping * rate
        for power, pulled in enumerate(pulls):
            self.pull[power] += pulled[:, None] * slope
        if self.matrices:
            self._add_held(slope, spring.stiffness, spring.damping)

    def add_geometric(self) -> None:
        """Add the geometric stiffness of all that the others have pulled, or that by which unit vectors stay so."""
        self.stiffness += self.curved
        if self.geometric:
            forces = np.einsum("bzc,kbz->kbc", self.found.inverse, self.pull)
            self.mechanism.add_bent_rows(self.found.z, -forces, self.bent)
            self.stiffness += product(np.swapaxes(self.compatible, -1, -2), self.bent, self.compatible)
