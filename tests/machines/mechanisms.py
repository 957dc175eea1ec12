"""Mechanisms by hand for tests: the thesis' crank with a rigid rod, and a four-bar."""

import math

import numpy as np

from chaosgym.machines.mechanism.beam import Beam, beam_link
from chaosgym.machines.mechanism.joints import Joint
from chaosgym.machines.mechanism.links import Body, rigid_link
from chaosgym.machines.mechanism.mechanism import Mechanism
from chaosgym.machines.slider_crank.connecting_rod import elastic_constants, rods_of


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
