"""Mechanisms by hand for tests: the thesis' crank, in the plane and in space, and a four-bar."""

import math

import numpy as np

from chaosgym.machines.mechanism.beam import Beam, beam_link
from chaosgym.machines.mechanism.equations import small_motion
from chaosgym.machines.mechanism.joints import Joint
from chaosgym.machines.mechanism.links import Body, rigid_link
from chaosgym.machines.mechanism.mechanism import Mechanism
from chaosgym.machines.mechanism.nominal import revolution_of
from chaosgym.machines.mechanism.space import SpatialBody, spatial_link
from chaosgym.machines.mechanism.spatial import SpatialMechanism
from chaosgym.machines.mechanism.spatial_beam import spatial_beam_link
from chaosgym.machines.slider_crank.connecting_rod import elastic_constants, rods_of

BINS = 180
ANGLES = (np.arange(BINS) + 0.5) * (2.0 * math.pi / BINS)
"""Middles of bins of 2 deg."""
OFFSET = {
    "rod": "rigid",
    "geometric_stiffness": "on",
    "gravity": 9.81,
    "gravity_angle": 20.0,
    "housing_offset_across": 0.004,
    "yoke_offset_across": -0.003,
    "slider_offset_along": 0.01,
    "slider_offset_across": 0.03,
    "slider_pitch_inertia": 1e-3,
}
"""Keywords of a ``SliderCrank`` whose centres of mass lie off the axes."""


def thesis_crank(machine, ball_frame="rod"):
    """Links and joints of a ``SliderCrank`` in the plane."""
    area, length = math.pi * machine.rod_diameter**2 / 4.0, machine.rod_length
    line = machine.density * area

    def end(at, name):
        mass, inertia, along, across = (
            getattr(machine, f"{name}_{what}") for what in ("mass", "inertia", "offset_along", "offset_across")
        )
        return Body(mass, inertia - mass * (along**2 + across**2), (at + along, across))

    off = machine.slider_offset_along, machine.slider_offset_across
    central = machine.slider_pitch_inertia - machine.slider_mass * (off[0] ** 2 + off[1] ** 2)
    bar = Body(line * length, line * length**3 / 12.0, (length / 2.0, 0.0))
    points = {"start": (0.0, 0.0), "end": (length, 0.0)}
    rod = rigid_link("rod", points, (bar, end(0.0, "housing"), end(length, "yoke")))
    if machine.rod == "flexible":
        second = math.pi * machine.rod_diameter**4 / 64.0
        steel = machine.youngs_modulus, machine.density
        beam = Beam(length, area, second, *steel, machine.n_modes, fitted=machine.fitted_modes)
        rod = beam_link("rod", beam, {"start": (end(0.0, "housing"),), "end": (end(0.0, "yoke"),)})
        rod = rod._replace(damping=np.diag(elastic_constants(machine, rods_of(machine)[0])[1]))
    opened = {"ideal": (), "clearance": ("across",), "instrumented": ("across", "turn")}[machine.slider_joint]
    ball = () if machine.ball_joint == "ideal" else ("along", "across")
    turned = math.radians(machine.gravity_angle)
    return Mechanism(
        (
            rigid_link("crank", {"shaft": (0.0, 0.0), "pin": (machine.crank_radius, 0.0)}),
            rod,
            rigid_link("slider", {"pivot": (0.0, 0.0)}, (Body(machine.slider_mass, central, off),)),
        ),
        (
            Joint("motor", "revolute", ("ground", "shaft"), ("crank", "shaft"), driven=True),
            Joint("ball", "revolute", ("crank", "pin"), ("rod", "start"), frame=ball_frame, opened=ball),
            Joint("yoke", "revolute", ("rod", "end"), ("slider", "pivot")),
            Joint("slider", "prismatic", ("ground", "shaft"), ("slider", "pivot"), opened=opened),
        ),
        {"shaft": (0.0, 0.0)},
        (machine.gravity * math.sin(turned), -machine.gravity * math.cos(turned)),
    )


def four_bar(ground=3.0, crank=1.0, coupler=4.0, rocker=2.5, gravity=9.81, opened=("along", "across"), **other):
    """Four-bar, lengths and masses of Akhadkar, Acary and Brogliato (2016), clearance of coupler and rocker."""

    def bar(name, start, end, length, angle=0.0):
        body = Body(1.0, length**2 / 12.0, (length / 2.0, 0.0))
        return rigid_link(name, {start: (0.0, 0.0), end: (length, 0.0)}, (body,), angle)

    return Mechanism(
        (
            rigid_link("crank", {"shaft": (0.0, 0.0), "pin": (crank, 0.0)}),
            bar("coupler", "pin", "end", coupler, 0.6),
            bar("rocker", "pivot", "end", rocker, 1.2),
        ),
        (
            Joint("motor", "revolute", ("ground", "shaft"), ("crank", "shaft"), driven=True),
            Joint("pin", "revolute", ("crank", "pin"), ("coupler", "pin")),
            Joint("knee", "revolute", ("coupler", "end"), ("rocker", "end"), opened=opened),
            Joint("pivot", "revolute", ("ground", "pivot"), ("rocker", "pivot")),
        ),
        {"shaft": (0.0, 0.0), "pivot": (ground, 0.0)},
        (0.0, -gravity),
        **other,
    )


def thesis_crank_in_space(machine):
    """Links and joints of a ``SliderCrank`` whose motor stands at an angle."""
    length, tilt, turned = machine.rod_length, math.radians(machine.motor_angle), math.radians(machine.gravity_angle)
    line = machine.density * math.pi * machine.rod_diameter**2 / 4.0 * length
    slender = line * length**2 / 12.0

    def end(name):
        """A body that turns like a unit vector along the rod."""
        mass, inertia, x, y = (
            getattr(machine, f"{name}_{what}") for what in ("mass", "inertia", "offset_along", "offset_across")
        )
        central = inertia - mass * (x**2 + y**2)
        return SpatialBody(mass, (0.0, central, central), (x, y, 0.0))

    rod = spatial_link(
        "rod",
        {"start": (0.0, 0.0, 0.0), "end": (length, 0.0, 0.0)},
        (SpatialBody(line, (0.0, slender, slender), (length / 2.0, 0.0, 0.0)), end("housing")),
    )
    if machine.rod == "flexible":
        second = math.pi * machine.rod_diameter**4 / 64.0
        steel = line / (machine.density * length), second, machine.youngs_modulus, machine.density
        beam = Beam(length, *steel, machine.n_modes, fitted=machine.fitted_modes, sideways_moment=second)
        rod = spatial_beam_link("rod", beam, {"start": (end("housing"),)}, along={"end": (end("yoke"),)})
        damping = [elastic_constants(machine, one)[1] for one in rods_of(machine)]
        rod = rod._replace(damping=np.diag(np.concatenate([damping[0], *(one[1:] for one in damping[1:])])))
    x, y = machine.slider_offset_along, machine.slider_offset_across
    roll = machine.slider_roll_inertia - machine.slider_mass * y**2
    pitch = machine.slider_pitch_inertia - machine.slider_mass * (x**2 + y**2)
    opened = {"ideal": (), "clearance": ("across", "sideways")}
    opened["instrumented"] = (*opened["clearance"], "roll", "yaw", "pitch")
    ball = () if machine.ball_joint == "ideal" else ("along", "across", "sideways")
    x_axis, y_axis, z_axis = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    none = (0.0, 0.0, 0.0)
    return SpatialMechanism(
        (
            spatial_link(
                "crank", {"shaft": none, "pin": (machine.crank_radius, 0.0, 0.0)}, orientation=(0.0, tilt, 0.0)
            ),
            rod,
            spatial_link("yoke", {"pivot": none}, (end("yoke"),)),
            spatial_link(
                "slider", {"pivot": none}, (SpatialBody(machine.slider_mass, (roll, pitch, pitch), (x, y, 0.0)),)
            ),
        ),
        (
            Joint(
                "motor",
                "revolute",
                ("ground", "shaft"),
                ("crank", "shaft"),
                driven=True,
                first_axis=(math.sin(tilt), 0.0, math.cos(tilt)),
                second_axis=z_axis,
            ),
            Joint(
                "ball",
                "spherical",
                ("crank", "pin"),
                ("rod", "start"),
                opened=ball,
                first_axis=x_axis,
                second_axis=x_axis,
            ),
            Joint("bearing", "revolute", ("rod", "end"), ("yoke", "pivot"), first_axis=y_axis, second_axis=y_axis),
            Joint("yoke", "revolute", ("yoke", "pivot"), ("slider", "pivot"), first_axis=z_axis, second_axis=z_axis),
            Joint(
                "slider",
                "prismatic",
                ("ground", "shaft"),
                ("slider", "pivot"),
                opened=opened[machine.slider_joint],
                first_axis=x_axis,
                second_axis=x_axis,
            ),
        ),
        {"shaft": none},
        (machine.gravity * math.sin(turned), -machine.gravity * math.cos(turned), 0.0),
    )


def assembled(mechanism):
    """Equations at the middles of the bins."""
    return small_motion(mechanism, revolution_of(mechanism), ANGLES)


def assert_equal(found, expected, tolerance):
    """Entries agree to a share of the largest one."""
    assert np.abs(found - expected).max() <= tolerance * np.abs(expected).max()
