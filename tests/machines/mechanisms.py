"""Mechanisms by hand for tests."""

import math

import numpy as np

from chaosgym.machines.mechanism import equations
from chaosgym.machines.mechanism.joints import LinkJoint
from chaosgym.machines.mechanism.links import Body, rigid_link
from chaosgym.machines.mechanism.mechanism import Mechanism
from chaosgym.machines.mechanism.nominal import revolution_of

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


def joint(name, kind, first, second, *lines):
    """Text of a [[joint]] of a file between two points, with more lines of it."""
    return "\n".join([f'[[joint]]\nname = "{name}"\nkind = "{kind}"\nbetween = ["{first}", "{second}"]', *lines])


def surface(clearance, stiffness, damping):
    """Lines of a [[joint]] with clearance."""
    return f'clearance = "{clearance}"\nstiffness = "{stiffness}"\ndamping = "{damping}"'


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
            LinkJoint("motor", "revolute", ("ground", "shaft"), ("crank", "shaft"), driven=True),
            LinkJoint("pin", "revolute", ("crank", "pin"), ("coupler", "pin")),
            LinkJoint("knee", "revolute", ("coupler", "end"), ("rocker", "end"), opened=opened),
            LinkJoint("pivot", "revolute", ("ground", "pivot"), ("rocker", "pivot")),
        ),
        {"shaft": (0.0, 0.0), "pivot": (ground, 0.0)},
        (0.0, -gravity),
        **other,
    )


def assembled(mechanism, geometric=True):
    """Equations at the middles of the bins."""
    return equations.assembled(mechanism, revolution_of(mechanism), geometric=geometric).at(ANGLES)


def assert_equal(found, expected, tolerance):
    """Entries agree to a share of the largest one."""
    assert np.abs(found - expected).max() <= tolerance * np.abs(expected).max()
