"""The slider crank in space once more, without any linearisation: exact positions of its particles."""

import math
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from tests.machines.kinematics import crank_pin

STENCIL = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
SECOND = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560])
POINTS = np.arange(-4, 5)
ANGLE_STEP, SHIFT = 0.02, 1e-3


class Equations(NamedTuple):
    """Linearised equations: M, D and K per powers of the crank rate, and the load, as in ``equations``."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    load: np.ndarray


class RigidMechanism:
    """A tight ball joint, and a slider that moves by q = (y, z) or (y, z, roll, yaw, pitch)."""

    def __init__(self, machine, coordinates):
        self.machine, self.size = machine, coordinates
        self.shift = np.full(coordinates, SHIFT)
        gauss, weight = np.polynomial.legendre.leggauss(3)
        self.share = 0.5 * (1.0 + gauss)
        bar = machine.density * math.pi * machine.rod_diameter**2 / 4 * machine.rod_length
        offsets = [
            math.hypot(getattr(machine, f"{body}_offset_along"), getattr(machine, f"{body}_offset_across"))
            for body in ("housing", "yoke")
        ]
        bodies = [machine.housing_mass, machine.yoke_mass, machine.slider_mass]
        central = [
            machine.housing_inertia - machine.housing_mass * offsets[0] ** 2,
            machine.yoke_inertia - machine.yoke_mass * offsets[1] ** 2,
        ]
        self.mass = np.concatenate([0.5 * weight * bar, bodies, central])
        up = math.radians(machine.gravity_angle)
        self.weight = machine.gravity * np.array([-math.sin(up), math.cos(up), 0.0]) * np.ones((len(self.mass), 1))
        self.weight[-2:] = 0.0
        along, across = machine.slider_offset_along, machine.slider_offset_across
        pitch = machine.slider_pitch_inertia - machine.slider_mass * (along**2 + across**2)
        self.turning = np.diag([0.0, 0.0, machine.slider_roll_inertia - machine.slider_mass * across**2, pitch, pitch])
        wide = np.zeros((coordinates, coordinates))
        wide[:5, :5] = self.turning[:coordinates, :coordinates]
        self.turning = wide

    def places(self, theta, q):
        """Positions (B, k, 3) of bar points, housing, yoke, slider, and the unit vectors along rod and yoke."""
        pin = crank_pin(theta, self.machine.crank_radius, math.radians(self.machine.motor_angle))
        return self._placed(pin, q)

    def _placed(self, pin, q):
        """Positions for a rod that begins at ``pin`` (B, 3)."""
        machine = self.machine
        y, z = q[:, 0] - pin[:, 1], q[:, 1] - pin[:, 2]
        x = pin[:, 0] + np.sqrt(machine.rod_length**2 - y**2 - z**2)
        pivot = np.stack([x, q[:, 0], q[:, 1]], axis=1)
        turn = Rotation.from_rotvec(q[:, 2:5] if self.size == 5 else np.zeros((len(q), 3)))
        along = (pivot - pin) / machine.rod_length
        axis = turn.apply([0.0, 0.0, 1.0])
        yoke = along - np.sum(along * axis, axis=1)[:, None] * axis
        yoke /= np.linalg.norm(yoke, axis=1)[:, None]
        across = np.cross(axis, yoke)
        bar = pin[:, None] + machine.rod_length * self.share[:, None] * along[:, None]
        bodies = [
            pin + machine.housing_offset_along * along + machine.housing_offset_across * across,
            pivot + machine.yoke_offset_along * yoke + machine.yoke_offset_across * across,
            pivot + turn.apply([machine.slider_offset_along, machine.slider_offset_across, 0.0]),
            along,
            yoke,
        ]
        return np.concatenate([bar, np.stack(bodies, axis=1)], axis=1)

    def jacobian(self, theta, q):
        """(k, 3, m) at one angle and position."""
        shifts = (POINTS[:, None, None] * np.diag(self.shift)).reshape(-1, self.size)
        around = self.places(np.full(len(shifts), theta), q + shifts).reshape(9, self.size, -1, 3)
        return np.einsum("p,pjki->kij", STENCIL, around) / self.shift

    def along_path(self, theta, q, angle_rate, q_rate):
        """Second derivative (k, 3) of the positions along a straight path of theta and q."""
        step = ANGLE_STEP / abs(angle_rate)
        around = self.places(theta + step * POINTS * angle_rate, q + step * POINTS[:, None] * q_rate)
        return np.einsum("p,pki->ki", SECOND / step**2, around)

    def linearised(self, theta):
        """``Equations`` about the nominal motion at one crank angle."""
        rest, none = np.zeros(self.size), np.zeros(self.size)
        shape = self.jacobian(theta, rest)
        around = np.stack([self.jacobian(theta + ANGLE_STEP * k, rest) for k in POINTS])
        turning = np.einsum("p,pkij->kij", STENCIL / ANGLE_STEP, around)

        def load(q):
            there = self.jacobian(theta, q)
            forces = [self.weight, self.along_path(theta, q, 1.0, none)]
            return np.stack([np.einsum("k,ki,kij->j", self.mass, force, there) for force in forces])

        slopes = [
            sum(STENCIL[k] / shift * load(shift * POINTS[k] * axis) for k in range(9))
            for shift, axis in zip(self.shift, np.eye(self.size), strict=True)
        ]
        stiffness = np.stack(slopes, axis=-1)
        return Equations(
            mass=np.einsum("k,kia,kib->ab", self.mass, shape, shape) + self.turning,
            damping=2.0 * np.einsum("k,kia,kib->ab", self.mass, shape, turning),
            stiffness=np.stack([stiffness[0], stiffness[1]]),
            load=load(rest),
        )

    def run(self, instants):
        """Motion (len(instants), 2) of the slider from rest, pressed by its guide in both directions; DOP853."""
        machine = self.machine
        rate, gap = machine.crank_rate, machine.slider_clearance
        k, d = machine.contact_stiffness, machine.contact_damping

        def slope(t, state):
            q, q_rate = state[:2], state[2:]
            there = self.jacobian(rate * t, q)
            inertia = self.along_path(rate * t, q, rate, q_rate) + self.weight
            force = -np.einsum("k,ki,kij->j", self.mass, inertia, there)
            for axis in range(2):
                side = math.copysign(1.0, q[axis])
                force[axis] -= (
                    side * max(0.0, k * (side * q[axis] - gap) + d * side * q_rate[axis]) * (side * q[axis] > gap)
                )
            mass = np.einsum("k,kia,kib->ab", self.mass, there, there)
            return np.concatenate([q_rate, np.linalg.solve(mass, force)])

        run = solve_ivp(
            slope,
            (0.0, instants[-1]),
            np.zeros(4),
            method="DOP853",
            t_eval=instants,
            rtol=1e-8,
            atol=1e-12,
            max_step=2e-4,
        )
        return run.y[:2].T


class LooseBall(RigidMechanism):
    """The same with a tight slider: q is where the rod begins from the crank pin, along the rod and across it."""

    def __init__(self, machine):
        super().__init__(machine, 3)
        self.turning = np.zeros((3, 3))

    def places(self, theta, q):
        """Positions (B, k, 3) as in ``RigidMechanism``."""
        pin = crank_pin(theta, self.machine.crank_radius, math.radians(self.machine.motor_angle))
        start, tight = pin, np.zeros((len(q), 2))
        # the axes in which it lies are those of the rod that begins there
        for _ in range(20):
            along, yoke = np.moveaxis(self._placed(start, tight)[:, -2:], 1, 0)
            across = np.cross([0.0, 0.0, 1.0], yoke)
            axes = np.stack([along, across, np.cross(along, across)], axis=2)
            start = pin + np.einsum("bij,bj->bi", axes, q)
        return self._placed(start, tight)


def _about(vector):
    """Rotations by vectors (B, 3) [rad]."""
    return Rotation.from_rotvec(vector)


class BendingMechanism(RigidMechanism):
    """The same with a rod that stretches and bends: q = (y, z, roll, yaw, pitch, stretch, modes along y, along z).

    The rod's line keeps its length, apart from the stretch, and its sections do not turn about it. Its frame goes from
    end to end, and its yoke's axis stays in the bearing; so the frame's roll follows from that of the slider.
    """

    def __init__(self, machine, planes):
        self.planes, modes = planes, len(planes[0].squares)
        super().__init__(machine, 6 + 2 * modes)
        self.shift[6:] = 1e-4
        along, weight = planes[0].position, planes[0].weight
        line = machine.density * math.pi * machine.rod_diameter**2 / 4
        self.mass = np.concatenate([line * weight, self.mass[3:]])
        self.weight = np.concatenate([np.repeat(self.weight[:1], len(along), axis=0), self.weight[3:]])
        self.along, elements = along, len(along) // 4
        size = machine.rod_length / elements
        # slopes of every mode as a parabola over each element, from its beginning on
        places = (along.reshape(elements, 4) - size * np.arange(elements)[:, None])[0]
        self.slopes = [
            [
                [np.poly1d(np.polyfit(places, plane.slope[4 * e : 4 * e + 4, k], 2)) for k in range(modes)]
                for e in range(elements)
            ]
            for plane in planes
        ]
        self.short = [self._short(which, places, size) for which in (0, 1)]
        twist = np.zeros((modes, modes))
        for element in zip(*self.slopes, strict=True):
            for i, v in enumerate(element[0]):
                for j, w in enumerate(element[1]):
                    twist[i, j] += (v * w.deriv() - v.deriv() * w).integ()(size)
        self.twist = 0.5 * twist
        squares = np.concatenate([plane.squares for plane in planes])
        stretch = machine.youngs_modulus * math.pi * machine.rod_diameter**2 / 4 / machine.rod_length
        self.elastic = np.diag(np.concatenate([np.zeros(5), [stretch], squares]))

    def _short(self, which, places, size):
        """Integrals of half the products of slopes up to every point, and to the end (p + 1, m, m)."""
        modes = len(self.slopes[which][0])
        found, before = [], np.zeros((modes, modes))
        for element in self.slopes[which]:
            sums = [[(0.5 * v * w).integ() for w in element] for v in element]
            found += [before + [[one(at) for one in row] for row in sums] for at in places]
            before = before + [[one(size) for one in row] for row in sums]
        return np.array([*found, before])

    def places(self, theta, q):
        """Positions (B, k, 3) as in ``RigidMechanism``."""
        machine, modes = self.machine, len(self.planes[0].squares)
        bent = [q[:, 6 : 6 + modes], q[:, 6 + modes :]]
        drawn = sum(np.einsum("bi,pij,bj->bp", own, short, own) for own, short in zip(bent, self.short, strict=True))
        deflection = [own @ plane.deflection.T for own, plane in zip(bent, self.planes, strict=True)]
        ends = [[own @ plane.end_slope[end] for own, plane in zip(bent, self.planes, strict=True)] for end in (0, 1)]
        twist = np.einsum("bi,ij,bj->b", bent[0], self.twist, bent[1])
        none = np.zeros(len(q))
        pin = crank_pin(theta, machine.crank_radius, math.radians(machine.motor_angle))
        length = machine.rod_length + q[:, 5] - drawn[:, -1]
        y, z = q[:, 0] - pin[:, 1], q[:, 1] - pin[:, 2]
        pivot = np.stack([pin[:, 0] + np.sqrt(length**2 - y**2 - z**2), q[:, 0], q[:, 1]], axis=1)
        turn = Rotation.from_rotvec(q[:, 2:5])
        axis = turn.apply([0.0, 0.0, 1.0])
        d = (pivot - pin) / length[:, None]
        n = np.cross([0.0, 0.0, 1.0], d)
        n /= np.linalg.norm(n, axis=1)[:, None]
        b = np.cross(d, n)
        start = _about(np.stack([none, -ends[0][1], ends[0][0]], axis=1))
        end = _about(np.stack([none, -ends[1][1], ends[1][0]], axis=1))
        end = end * _about(np.stack([twist, none, none], axis=1))
        v = end.apply([0.0, 1.0, 0.0])
        zeta = [np.sum(axis * each, axis=1) for each in (d, n, b)]
        cosine, sine = v[:, 1] * zeta[1] + v[:, 2] * zeta[2], v[:, 1] * zeta[2] - v[:, 2] * zeta[1]
        roll = np.arcsin(-v[:, 0] * zeta[0] / np.hypot(cosine, sine)) - np.arctan2(cosine, sine)
        n, b = (
            np.cos(roll)[:, None] * n + np.sin(roll)[:, None] * b,
            np.cos(roll)[:, None] * b - np.sin(roll)[:, None] * n,
        )
        frame = np.stack([d, n, b], axis=2)

        def ground(own):
            return np.einsum("bij,bj->bi", frame, own)

        across = ground(v)
        yoke = np.cross(across, axis)
        place = self.along * (1.0 + q[:, 5:6] / machine.rod_length) - drawn[:, :-1]
        bar = pin[:, None] + np.einsum("bij,jbp->bpi", frame, np.stack([place, *deflection]))
        bodies = [
            pin + ground(start.apply([machine.housing_offset_along, machine.housing_offset_across, 0.0])),
            pivot + machine.yoke_offset_along * yoke + machine.yoke_offset_across * across,
            pivot + turn.apply([machine.slider_offset_along, machine.slider_offset_across, 0.0]),
            ground(start.apply([1.0, 0.0, 0.0])),
            yoke,
        ]
        return np.concatenate([bar, np.stack(bodies, axis=1)], axis=1)
