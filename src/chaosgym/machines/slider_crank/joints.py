"""Joints of a slider crank: which surfaces can touch, and how hard they push.

Every joint is a small class that lists its contacts: which motion closes each, which share of the joint's stiffness it
has, and which force it exerts on the body whose joint force is recorded (slider or housing). A contact along a single
row is a channel: its force is piecewise linear, so there are propagators for every set of closed channels. The ball in
a spherical shell turns its force and is left to Taylor series, and so is Hertzian contact.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, Protocol

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core.binned.model import HERTZ, LINEAR
from chaosgym.machines.binned import equations
from chaosgym.machines.slider_crank.equations import (
    BALL_DIRECTIONS,
    SLIDER_ACROSS,
    SLIDER_LATERAL,
    SLIDER_PITCH,
    SLIDER_ROLL,
    SLIDER_YAW,
)
from chaosgym.machines.slider_crank.parameters import CrankParameters


class JointContact(NamedTuple):
    """One surface, or two opposite ones.

    Attributes
    ----------
    motion
        Displacement (R,) that closes it per unit of each coordinate, by the coordinate's name.
    force : (R, 3)
        Force on the recorded body per newton along each row of the displacement.
    share
        Share of the joint's stiffness and damping.
    two_sided
        Whether the opposite displacement meets a surface too.
    slides
        Whether friction acts along the guide.
    sensors
        Names of the sensors that share its force: on its own side, and on the opposite one.
    """

    motion: Mapping[str, Array]
    force: Array
    share: float = 1.0
    two_sided: bool = True
    slides: bool = False
    sensors: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())


class CrankJoint(Protocol):
    """A joint: its contacts, which all have the joint's clearance, and its force sensors."""

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the force sensors."""
        ...

    def __hash__(self) -> int:
        """Equal joints, equal hash: their contacts are kept."""
        ...

    def contacts(self) -> tuple[JointContact, ...]:
        """All contacts of the joint."""
        ...


@dataclass(frozen=True)
class TightJoint:
    """Nothing rattles."""

    sensors: tuple[str, ...] = ()

    def contacts(self) -> tuple[JointContact, ...]:
        """No contact."""
        return ()


@dataclass(frozen=True)
class PlainSlider:
    """A gap around the pivot: above and below, and in space to either side."""

    spatial: bool
    sensors: tuple[str, ...] = ()

    def contacts(self) -> tuple[JointContact, ...]:
        """A pair of surfaces in each direction."""
        vertical = JointContact({SLIDER_ACROSS: _ONE}, np.array([[0.0, -1.0, 0.0]]), slides=True)
        if not self.spatial:
            return (vertical,)
        return vertical, JointContact({SLIDER_LATERAL: _ONE}, np.array([[0.0, 0.0, -1.0]]), slides=True)


@dataclass(frozen=True)
class InstrumentedSlider:
    """Eight sensors around the guide: above, below, left and right at two stations (thesis figure 4.4).

    Opposite sensors stand off the middle of the guide's faces by ``offset``, to either side of it and at the two
    stations the other way round, which keeps the slider from rolling. The tip at (xi, eta, zeta) of a slider that
    moves by (y, z) and turns by (roll, yaw, pitch) moves by

        y + pitch xi - roll zeta   upward,        z + roll eta - yaw xi   sideways

    In the plane of a motor at 0 deg the left and right sensors carry nothing, and opposite ones share their
    displacement; the roll that unequal forces off the middle would give the slider is left out there.
    """

    spatial: bool
    distance: float
    offset: float

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the eight sensors; the front is away from the crank, the left is at -Z."""
        return tuple(
            f"{station} {side}" for station in ("front", "rear") for side in ("upper", "lower", "left", "right")
        )

    def contacts(self) -> tuple[JointContact, ...]:
        """Pairs of sensors in the plane, single sensors in space; the two stations share stiffness and damping."""
        stations = (("front", self.distance), ("rear", -self.distance))
        if self.spatial:
            return tuple(contact for station, xi in stations for contact in self._station(station, xi))
        return tuple(
            JointContact(
                {SLIDER_ACROSS: _ONE, SLIDER_PITCH: xi * _ONE},
                np.array([[0.0, -1.0, 0.0]]),
                0.5,
                slides=True,
                sensors=((f"{station} lower",), (f"{station} upper",)),
            )
            for station, xi in stations
        )

    def _station(self, station: str, xi: float) -> tuple[JointContact, ...]:
        """Four single sensors; each is closed by the motion of its tip against its own side."""
        off = math.copysign(self.offset, xi)

        def sensor(side: str, motion: dict[str, float], force: list[float]) -> JointContact:
            rows = {name: value * _ONE for name, value in motion.items()}
            return JointContact(rows, np.array([force]), 0.5, False, True, ((f"{station} {side}",), ()))

        return (
            sensor("upper", {SLIDER_ACROSS: -1.0, SLIDER_PITCH: -xi, SLIDER_ROLL: off}, [0.0, 1.0, 0.0]),
            sensor("lower", {SLIDER_ACROSS: 1.0, SLIDER_PITCH: xi, SLIDER_ROLL: off}, [0.0, -1.0, 0.0]),
            sensor("left", {SLIDER_LATERAL: 1.0, SLIDER_YAW: -xi, SLIDER_ROLL: off}, [0.0, 0.0, -1.0]),
            sensor("right", {SLIDER_LATERAL: -1.0, SLIDER_YAW: xi, SLIDER_ROLL: off}, [0.0, 0.0, 1.0]),
        )


@dataclass(frozen=True)
class SphericalBall:
    """A ball in a shell: the force turns with the ball (thesis figure 4.6)."""

    spatial: bool
    sensors: tuple[str, ...] = ()

    def contacts(self) -> tuple[JointContact, ...]:
        """One contact, along the ball's eccentricity: minus the motion of the rod's end."""
        names = BALL_DIRECTIONS if self.spatial else BALL_DIRECTIONS[:2]
        axes = np.eye(3)[: len(names), : len(names)]
        return (JointContact(dict(zip(names, -axes, strict=True)), np.eye(3)[: len(names)]),)


@dataclass(frozen=True)
class InstrumentedBall:
    """A ball between four sensors that stand like the faces of a tetrahedron (thesis figure 4.3).

    Two sensors stand in the plane of the mechanism, to either side of ``angle`` [rad] from the rod's axis, the other
    two are mirrored by the plane; in the plane these act as one.
    """

    spatial: bool
    angle: float

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the four sensors: two in the plane, two to either side of it."""
        return ("ball in plane 1", "ball in plane 2", "ball right", "ball left")

    def normals(self) -> Array:
        """Directions (4, 3) in which the ball meets the sensors (along the rod, across it, sideways)."""
        axis = np.array([math.cos(self.angle), math.sin(self.angle), 0.0])
        across = np.array([-math.sin(self.angle), math.cos(self.angle), 0.0])
        sideways = np.array([0.0, 0.0, 1.0])
        lean = math.sqrt(2.0)
        normals = [axis + lean * across, axis - lean * across, -axis + lean * sideways, -axis - lean * sideways]
        return np.array(normals) / math.sqrt(3.0)

    def contacts(self) -> tuple[JointContact, ...]:
        """Four sensors; in the plane the two beside it have one displacement and half the lift."""
        normals = self.normals()
        sensors: list[tuple[str, ...]] = [(name,) for name in self.sensors]
        shares = [1.0] * 4
        if not self.spatial:
            normals = np.array([*normals[:2], normals[2:].mean(axis=0)])
            sensors, shares = [*sensors[:2], self.sensors[2:]], [1.0, 1.0, 2.0]
        names = BALL_DIRECTIONS if self.spatial else BALL_DIRECTIONS[:2]
        # the ball's eccentricity in its housing is minus the motion of the rod's end
        return tuple(
            JointContact(
                {name: -normal[[axis]] for axis, name in enumerate(names)},
                normal[None],
                share,
                False,
                sensors=(own, ()),
            )
            for normal, share, own in zip(normals, shares, sensors, strict=True)
        )


_ONE = np.ones(1)


def slider_joint_of(machine: CrankParameters) -> CrankJoint:
    """Model of the slider joint of a machine."""
    if machine.slider_joint == "clearance":
        return PlainSlider(machine.is_spatial)
    if machine.slider_joint == "instrumented":
        return InstrumentedSlider(machine.is_spatial, machine.sensor_distance, machine.sensor_offset)
    return TightJoint()


def ball_joint_of(machine: CrankParameters) -> CrankJoint:
    """Model of the ball joint of a machine."""
    if machine.ball_joint == "spherical":
        return SphericalBall(machine.is_spatial)
    if machine.ball_joint == "instrumented":
        return InstrumentedBall(machine.is_spatial, math.radians(machine.ball_sensor_angle))
    return TightJoint()


def joints_of(machine: CrankParameters) -> list[equations.Contact]:
    """All contacts of a machine: those of the slider joint, then those of the ball joint."""
    names = machine.degrees_of_freedom
    joints = []
    linear = machine.contact_law == "linear"
    stiffness, damper = (machine.contact_stiffness, machine.contact_damping) if linear else hertz_constants(machine)
    ball = math.sqrt(machine.ball_damping_mass / machine.damped_mass) if machine.ball_damping_mass else 1.0
    for model, clearance, recorded, damping in (
        (slider_joint_of(machine), machine.slider_clearance, machine.monitored_joint == "slider", 1.0),
        (ball_joint_of(machine), machine.ball_clearance, machine.monitored_joint == "ball", ball),
    ):
        for contact in _contacts(model):
            none = np.zeros(len(contact.force))
            row = np.stack([contact.motion.get(name, none) for name in names], axis=1)
            reading = contact.force * recorded
            share = contact.share
            damped = damper * (share * damping) if linear else damper
            rubs = 0 if contact.slides else -1
            surface = clearance, stiffness * share, damped, contact.two_sided, reading, rubs
            joints.append(equations.Contact(row, *surface, exponent=LINEAR if linear else HERTZ))
    return joints


@lru_cache(maxsize=64)
def _contacts(joint: CrankJoint) -> tuple[JointContact, ...]:
    return joint.contacts()


def gaps_of(machine: CrankParameters) -> Array:
    """Clearances [m] of ``joints_of``."""
    slider, ball = len(_contacts(slider_joint_of(machine))), len(_contacts(ball_joint_of(machine)))
    return np.array([machine.slider_clearance] * slider + [machine.ball_clearance] * ball)


def sensor_peaks(machine: CrankParameters, contact_peak: Array) -> Array:
    """Peak force (cycles, sensors) of each sensor from those of the contacts' two sides, (cycles, contacts, 2)."""
    names = machine.sensors
    peaks = np.zeros((len(contact_peak), len(names)))
    contacts = _contacts(slider_joint_of(machine)) + _contacts(ball_joint_of(machine))
    for j, contact in enumerate(contacts):
        for side, sharing in enumerate(contact.sensors):
            for name in sharing:
                peaks[:, names.index(name)] = contact_peak[:, j, side] / len(sharing)
    return peaks


def hertz_constants(machine: CrankParameters) -> tuple[float, float]:
    """K [N/m^1.5] and chi [s/m] with the linear law's secant stiffness and restitution at the reference force.

    Half a swing of the linear law leaves e = exp(-pi zeta / sqrt(1 - zeta^2)) of the speed v at which slider and yoke
    strike; Hunt and Crossley's law leaves about 1 - (2/3) chi v.
    """
    force, linear = machine.hertz_reference_force, machine.contact_stiffness
    struck = machine.slider_mass + machine.yoke_mass
    zeta = machine.contact_damping_ratio * math.sqrt(machine.damped_mass / struck)
    depth = force / linear
    stiffness = force / depth**1.5
    speed = math.sqrt(0.8 * stiffness * depth**2.5 / struck)
    restitution = math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta**2)) if zeta < 1.0 else 0.0
    return stiffness, 1.5 * (1.0 - restitution) / speed
