"""Which surfaces can touch in the joints of a slider crank, and how hard do they push?

A channel is a gap with a surface on one side or on both: the slider's pivot in its guide, a station of sensors, one
flat of an instrumented ball joint. Its force is piecewise linear, so there are propagators for every set of closed
channels. A joint of the stepper is a channel or a ball in a spherical shell, with linear or Hertzian contact.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.machines.crank_equations import (
    BALL_ACROSS,
    BALL_DIRECTIONS,
    SLIDER_ACROSS,
    SLIDER_LATERAL,
    SLIDER_PITCH,
)

if TYPE_CHECKING:
    from chaosgym.machines.slider_crank import SliderCrank

Array = NDArray[np.float64]


class Channels(NamedTuple):
    """Contact channels; see ``SliderCrankModel``. ``slides`` (m,): friction acts along the guide."""

    row: Array
    stiffness: Array
    damping: Array
    two_sided: NDArray[np.bool_]
    reading: Array
    slides: NDArray[np.bool_]


def _unit_row(machine: "SliderCrank", *names: str) -> Array:
    """One row for each name that picks this coordinate, (len(names), n)."""
    return np.array([[float(name == other) for other in machine.degrees_of_freedom] for name in names])


def _slider_channels(machine: "SliderCrank") -> Channels:
    """One gap above and below the pivot, or two stations of sensors that share stiffness and damping.

    A motor at an angle adds the gap to either side.
    """
    row = _unit_row(machine, SLIDER_ACROSS)
    reading = np.array([[0.0, -1.0, 0.0]])
    share = 1.0
    if machine.slider_joint == "instrumented":
        pitch = machine.sensor_distance * _unit_row(machine, SLIDER_PITCH)
        row, reading, share = np.concatenate([row + pitch, row - pitch]), np.repeat(reading, 2, axis=0), 0.5
    elif machine.is_spatial:
        row = _unit_row(machine, SLIDER_ACROSS, SLIDER_LATERAL)
        reading = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
    count = len(row)
    return Channels(
        row=row,
        stiffness=np.full(count, share * machine.contact_stiffness),
        damping=np.full(count, share * machine.contact_damping),
        two_sided=np.ones(count, dtype=bool),
        reading=reading * (machine.monitored_joint == "slider"),
        slides=np.ones(count, dtype=bool),
    )


def _sensor_normals(machine: "SliderCrank") -> Array:
    """Normals (4, 3) of the tetrahedral sensors (along, across, sideways): two in the plane, two mirrored by it."""
    angle = math.radians(machine.ball_sensor_angle)
    axis, across = np.array([math.cos(angle), math.sin(angle), 0.0]), np.array([-math.sin(angle), math.cos(angle), 0.0])
    sideways = np.array([0.0, 0.0, 1.0])
    lean = math.sqrt(2.0)
    normals = [axis + lean * across, axis - lean * across, -axis + lean * sideways, -axis - lean * sideways]
    return np.array(normals) / math.sqrt(3.0)


def _ball_channels(machine: "SliderCrank") -> Channels:
    """Four tetrahedral sensors; in the plane the two that lean to either side of it act as one with half the lift."""
    normal = _sensor_normals(machine)
    sensors = np.ones(4)
    if not machine.is_spatial:
        normal, sensors = np.array([*normal[:2], normal[2:].mean(axis=0)]), np.array([1.0, 1.0, 2.0])
    # the ball's eccentricity in its housing is minus the motion of the rod's end
    names = BALL_DIRECTIONS if machine.is_spatial else BALL_DIRECTIONS[:2]
    return Channels(
        row=-normal[:, : len(names)] @ _unit_row(machine, *names),
        stiffness=machine.contact_stiffness * sensors,
        damping=machine.contact_damping * sensors,
        two_sided=np.zeros(len(sensors), dtype=bool),
        reading=normal * (machine.monitored_joint == "ball"),
        slides=np.zeros(len(sensors), dtype=bool),
    )


def channels_of(machine: "SliderCrank") -> Channels:
    """All channels of a machine: those of the slider joint, then those of an instrumented ball joint."""
    parts = []
    if machine.slider_joint != "ideal":
        parts.append(_slider_channels(machine))
    if machine.ball_joint == "instrumented":
        parts.append(_ball_channels(machine))
    return Channels(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def gaps_of(machine: "SliderCrank") -> Array:
    """Clearances [m] of ``channels_of``."""
    slider = {"ideal": 0, "clearance": 2 if machine.is_spatial else 1, "instrumented": 2}[machine.slider_joint]
    ball = (4 if machine.is_spatial else 3) if machine.ball_joint == "instrumented" else 0
    return np.array([machine.slider_clearance] * slider + [machine.ball_clearance] * ball)


def display_of(machine: "SliderCrank") -> Array:
    """Displacement of the monitored joint: of the slider across the guide, or of the rod's end across the rod."""
    return np.asarray(_unit_row(machine, SLIDER_ACROSS if machine.monitored_joint == "slider" else BALL_ACROSS)[0])


class Joint(NamedTuple):
    """A joint of the stepper; see ``SteppedCrankModel``. ``scale`` multiplies stiffness and damping."""

    row: Array
    gap: float
    scale: float
    two_sided: bool
    reading: Array
    slides: bool


def joints_of(machine: "SliderCrank") -> list[Joint]:
    """Every channel is a joint with one row; a spherical ball joint is one with two."""
    joints = []
    if machine.slider_joint != "ideal" or machine.ball_joint == "instrumented":
        channels, gaps = channels_of(machine), gaps_of(machine)
        joints = [
            Joint(
                row=channels.row[[j]],
                gap=float(gaps[j]),
                scale=float(channels.stiffness[j]) / machine.contact_stiffness,
                two_sided=bool(channels.two_sided[j]),
                reading=channels.reading[[j]],
                slides=bool(channels.slides[j]),
            )
            for j in range(len(gaps))
        ]
    if machine.ball_joint == "spherical":
        names = BALL_DIRECTIONS if machine.is_spatial else BALL_DIRECTIONS[:2]
        reading = np.eye(3)[: len(names)] * (machine.monitored_joint == "ball")
        joints.append(Joint(-_unit_row(machine, *names), machine.ball_clearance, 1.0, True, reading, False))
    return joints


def hertz_constants(machine: "SliderCrank") -> tuple[float, float]:
    """K [N/m^1.5] and chi [s/m] with the linear law's secant stiffness and restitution at the reference force.

    Half a swing of the linear law leaves e = exp(-pi zeta / sqrt(1 - zeta^2)) of the speed v at which slider and yoke
    strike; Hunt and Crossley's law leaves about 1 - (2/3) chi v.
    """
    force, linear, zeta = machine.hertz_reference_force, machine.contact_stiffness, machine.contact_damping_ratio
    depth = force / linear
    stiffness = force / depth**1.5
    speed = math.sqrt(0.8 * stiffness * depth**2.5 / (machine.slider_mass + machine.yoke_mass))
    restitution = math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta**2)) if zeta < 1.0 else 0.0
    return stiffness, 1.5 * (1.0 - restitution) / speed
