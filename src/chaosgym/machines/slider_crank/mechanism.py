"""Links and joints of a slider crank, in the plane or with its motor at an angle: an instance of a mechanism.

Links of the thesis' table 4.1 (theta, L, H, alpha; Hartenberg and Denavit), base to slider:

    0  motor and base     kinematic   0, 0, 0         0 deg
    1  crank              kinematic   L1 = radius     0 deg
    2  ball joint         kinematic   H2              90 deg
    3  ball joint         kinematic   0, 0            90 deg
    4  connecting rod     elements    L4 = length     0 deg
    5  yoke               rigid       0, H5           90 deg
    6  slider             rigid       -               -90 deg

The offsets H2 and H5 are not in print and zero here: the crank plane turns about its own centre, and the yoke's pivot
lies on the guide. The twists say that the axes of consecutive joints cross at right angles: motor, the two turns of the
ball joint that the rod needs, yoke bearing, slider pivot. In the plane the yoke is a body at the rod's end.

References
----------
Thesis 2.2, 4.2 and 4.3.
"""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.machines.mechanism.beam import END, START, beam_link
from chaosgym.machines.mechanism.equations import smooth
from chaosgym.machines.mechanism.joints import ACROSS, ALONG, GROUND, PITCH, ROLL, SIDEWAYS, TURN, YAW, LinkJoint
from chaosgym.machines.mechanism.links import Beam, Body, Link, rigid_link
from chaosgym.machines.mechanism.mechanism import Mechanism
from chaosgym.machines.mechanism.nominal import Revolution, places, refined, revolution_of
from chaosgym.machines.mechanism.space import SpatialBody, spatial_link
from chaosgym.machines.mechanism.spatial import SpatialMechanism
from chaosgym.machines.mechanism.spatial_beam import spatial_beam_link
from chaosgym.machines.slider_crank.parameters import CrankParameters

CRANK, ROD, YOKE, SLIDER, BALL, PIN, PIVOT = "crank", "rod", "yoke", "slider", "ball", "pin", "pivot"
"""Names of links, joints and points."""

X, Y, Z, NONE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)

OPENED = {"ideal": (), "clearance": (ACROSS, SIDEWAYS), "instrumented": (ACROSS, SIDEWAYS, ROLL, YAW, PITCH)}
"""Motions that a slider joint leaves open in space."""


def mechanism_of(machine: CrankParameters) -> Mechanism:
    """Links and joints of a slider crank.

    Examples
    --------
    >>> from chaosgym.machines.slider_crank.mechanism import mechanism_of
    >>> mechanism_of(chaosgym.SliderCrank(rod="rigid")).coordinates
    ('slider across',)
    """
    tilt = math.radians(machine.gravity_angle)
    gravity = machine.gravity * math.sin(tilt), -machine.gravity * math.cos(tilt)
    links, joints = (_in_space if machine.is_spatial else _in_plane)(machine)
    if machine.is_spatial:
        return SpatialMechanism(links, joints, {"shaft": NONE}, (*gravity, 0.0))
    return Mechanism(links, joints, {"shaft": NONE[:2]}, gravity)


def revolution_of_crank(machine: CrankParameters, mechanism: Mechanism) -> Revolution:
    """Nominal motion of a slider crank, which is kept for all that have its lengths and its motor's angle."""
    found = _turning(type(machine), machine.crank_radius, machine.rod_length, machine.motor_angle)

    def wide(values: Array) -> Array:
        whole = np.zeros((*values.shape[:-1], mechanism.size))
        whole[..., mechanism.rigid] = values
        return whole

    return found._replace(z=wide(found.z), tangent=wide(found.tangent), winding=wide(found.winding))


def pin_and_pivot(machine: CrankParameters, crank_angle: Array) -> tuple[Array, Array]:
    """Places of crank pin and slider pivot (B, 2), in space (B, 3) [m], at crank angles (B,) [rad], all joints tight.

    Examples
    --------
    >>> from chaosgym.machines.slider_crank.mechanism import pin_and_pivot
    >>> pin, pivot = pin_and_pivot(chaosgym.SliderCrank(), np.zeros(1))
    >>> pivot.round(6)
    array([[0.285, 0.   ]])
    """
    rigid = replace(machine, rod="rigid")
    mechanism = mechanism_of(rigid)
    z = places(mechanism, revolution_of_crank(rigid, mechanism), crank_angle)
    return mechanism.point(z, (CRANK, PIN))[0], mechanism.point(z, (SLIDER, PIVOT))[0]


@lru_cache(maxsize=64)
def _turning(kind: type[CrankParameters], radius: float, length: float, angle: float) -> Revolution:
    mechanism = mechanism_of(kind(crank_radius=radius, rod_length=length, motor_angle=angle, rod="rigid"))
    revolution = revolution_of(mechanism)
    return refined(mechanism, revolution, smooth(mechanism, revolution)[0])


def _offset(machine: CrankParameters, body: str) -> tuple[float, float, float]:
    """Centre of gravity of a body from its joint, and its moment of inertia about that."""
    along, across = (getattr(machine, f"{body}_offset_{way}") for way in ("along", "across"))
    inertia = machine.slider_pitch_inertia if body == SLIDER else getattr(machine, f"{body}_inertia")
    return along, across, inertia - getattr(machine, f"{body}_mass") * (along**2 + across**2)


def _bar(machine: CrankParameters) -> float:
    """Mass [kg] of the bar of the rod."""
    return machine.density * math.pi * machine.rod_diameter**2 / 4.0 * machine.rod_length


HALVES = 0.5 - math.sqrt(1.0 / 12.0), 0.5 + math.sqrt(1.0 / 12.0)
"""Places along a rigid bar, as shares of its length, at which half its mass each moves like all of it."""


def _beam(machine: CrankParameters) -> Beam:
    area, second = math.pi * machine.rod_diameter**2 / 4.0, math.pi * machine.rod_diameter**4 / 64.0
    return Beam(
        machine.rod_length,
        area,
        second,
        machine.youngs_modulus,
        machine.density,
        machine.n_modes,
        fitted=machine.fitted_modes,
        sideways_moment=second,
    )


def _damped(machine: CrankParameters, rod: Link) -> Link:
    """The rod with the structural damping of the machine's family."""
    stiffness = np.diag(rod.stiffness)
    modes = np.sqrt(stiffness[1:])
    # modes of a plane follow on those of another; each family counts from the first of its plane
    first = np.repeat(modes[:: machine.n_modes + machine.fitted_modes], machine.n_modes + machine.fitted_modes)
    lowest = np.concatenate([modes[:1], first])
    if machine.damping_family == "stiffness":
        return rod._replace(damping=np.diag(stiffness * 2.0 * machine.damping_ratio / lowest))
    moving = machine.slider_mass + machine.yoke_mass + _bar(machine) / 3.0
    inertia = np.concatenate([[moving], np.ones(len(modes))])
    ratio: float | Array = machine.damping_ratio
    if machine.damping_family == "power":
        ratio = ratio * matrices.power(np.sqrt(stiffness / inertia) / lowest, machine.damping_exponent)
    return rod._replace(damping=np.diag(2.0 * ratio * np.sqrt(stiffness * inertia)))


def _in_plane(machine: CrankParameters) -> tuple[tuple[Link, ...], tuple[LinkJoint, ...]]:
    length = machine.rod_length

    def body(name: str, place: float) -> Body:
        along, across, inertia = _offset(machine, name)
        return Body(getattr(machine, f"{name}_mass"), inertia, (place + along, across))

    if machine.rod == "flexible":
        rod = _damped(
            machine,
            beam_link(ROD, _beam(machine), {START: (body("housing", 0.0),), END: (body(YOKE, 0.0),)}),
        )
    else:
        bar = (Body(0.5 * _bar(machine), 0.0, (share * length, 0.0)) for share in HALVES)
        bodies = (*bar, body("housing", 0.0), body(YOKE, length))
        rod = rigid_link(ROD, {START: (0.0, 0.0), END: (length, 0.0)}, bodies)
    opened = tuple({PITCH: TURN}.get(way, way) for way in OPENED[machine.slider_joint] if way in (ACROSS, PITCH))
    return (
        rigid_link(CRANK, {"shaft": (0.0, 0.0), PIN: (machine.crank_radius, 0.0)}),
        rod,
        rigid_link(SLIDER, {PIVOT: (0.0, 0.0)}, (body(SLIDER, 0.0),)),
    ), (
        LinkJoint("motor", "revolute", (GROUND, "shaft"), (CRANK, "shaft"), driven=True),
        LinkJoint(BALL, "revolute", (CRANK, PIN), (ROD, START), frame=ROD, opened=_ball(machine)),
        LinkJoint(YOKE, "revolute", (ROD, END), (SLIDER, PIVOT)),
        LinkJoint(SLIDER, "prismatic", (GROUND, "shaft"), (SLIDER, PIVOT), opened=opened),
    )


def _ball(machine: CrankParameters) -> tuple[str, ...]:
    """Motions that the ball joint leaves open."""
    if machine.ball_joint == "ideal":
        return ()
    return (ALONG, ACROSS, SIDEWAYS) if machine.is_spatial else (ALONG, ACROSS)


def _in_space(machine: CrankParameters) -> tuple[tuple[Link, ...], tuple[LinkJoint, ...]]:
    length, tilt = machine.rod_length, math.radians(machine.motor_angle)

    def body(name: str) -> tuple[SpatialBody, ...]:
        """A body that turns like a unit vector along the rod."""
        along, across, inertia = _offset(machine, name)
        return (SpatialBody(getattr(machine, f"{name}_mass"), (0.0, inertia, inertia), (along, across, 0.0)),)

    if machine.rod == "flexible":
        ends = {START: body("housing")}
        rod = _damped(machine, spatial_beam_link(ROD, _beam(machine), ends, along={END: body(YOKE)}))
    else:
        bar = (SpatialBody(0.5 * _bar(machine), centre=(share * length, 0.0, 0.0)) for share in HALVES)
        rod = spatial_link(ROD, {START: NONE, END: (length, 0.0, 0.0)}, (*bar, *body("housing")))
    along, across, pitch = _offset(machine, SLIDER)
    roll = machine.slider_roll_inertia - machine.slider_mass * across**2
    slider = SpatialBody(machine.slider_mass, (roll, pitch, pitch), (along, across, 0.0))

    def joint(
        name: str, kind: str, first: tuple[str, str], second: tuple[str, str], axis: tuple[float, ...]
    ) -> LinkJoint:
        return LinkJoint(name, kind, first, second, first_axis=axis, second_axis=axis)

    motor = joint("motor", "revolute", (GROUND, "shaft"), (CRANK, "shaft"), Z)
    guide = joint(SLIDER, "prismatic", (GROUND, "shaft"), (SLIDER, PIVOT), X)
    return (
        spatial_link(CRANK, {"shaft": NONE, PIN: (machine.crank_radius, 0.0, 0.0)}, orientation=(0.0, tilt, 0.0)),
        rod,
        spatial_link(YOKE, {PIVOT: NONE}, body(YOKE)),
        spatial_link(SLIDER, {PIVOT: NONE}, (slider,)),
    ), (
        motor._replace(driven=True, first_axis=(math.sin(tilt), 0.0, math.cos(tilt))),
        joint(BALL, "spherical", (CRANK, PIN), (ROD, START), X)._replace(opened=_ball(machine)),
        joint("bearing", "revolute", (ROD, END), (YOKE, PIVOT), Y),
        joint(YOKE, "revolute", (YOKE, PIVOT), (SLIDER, PIVOT), Z),
        guide._replace(opened=OPENED[machine.slider_joint]),
    )
