"""Mechanisms in space: against exact twins of the thesis' crank at an angle, the plane, and universal joints."""

import math
from dataclasses import replace

import numpy as np
import pytest

from chaosgym.errors import ParameterError
from chaosgym.machines.mechanism.equations import crank_inertia, small_motion
from chaosgym.machines.mechanism.forces import Spring
from chaosgym.machines.mechanism.joints import LinkJoint
from chaosgym.machines.mechanism.nominal import nominal, revolution_of
from chaosgym.machines.mechanism.space import SpatialBody, spatial_link
from chaosgym.machines.mechanism.spatial import SpatialMechanism
from chaosgym.machines.mechanism.sums import derivatives
from chaosgym.machines.slider_crank.machine import SliderCrank
from chaosgym.machines.slider_crank.mechanism import mechanism_of
from tests.machines.mechanisms import ANGLES, OFFSET, assembled, assert_equal
from tests.machines.spatial_twin import LooseBall, RigidMechanism

LOPSIDED = OFFSET | {"slider_roll_inertia": 5e-4}
SETS = {
    "guide": {},
    "guide that turns": {"slider_joint": "instrumented"},
    "ball": {"slider_joint": "ideal", "ball_joint": "spherical"},
    "both": {"slider_joint": "instrumented", "ball_joint": "spherical"},
}


@pytest.mark.parametrize("degrees", [37.0, 100.0, 301.0])
def test_a_loose_ball_at_an_angle_is_that_of_the_exact_mechanism(degrees):
    """M, D, K and f of the ball's gap at 15 deg, all bodies off their axes, equal the nonlinear ones to 1e-9."""
    machine, theta = SliderCrank(motor_angle=15.0, **LOPSIDED | SETS["ball"]), math.radians(degrees)
    mechanism = mechanism_of(machine)
    found, exact = (
        small_motion(mechanism, revolution_of(mechanism), np.array([theta])),
        LooseBall(machine).linearised(theta),
    )
    assert mechanism.coordinates == ("ball along", "ball across", "ball sideways")
    assert_equal(found.mass[0], exact.mass, 1e-9)
    assert_equal(found.damping[1, 0], exact.damping, 1e-9)
    for power, stiffness, load in zip((0, 2), exact.stiffness, exact.load, strict=True):
        assert_equal(found.stiffness[power, 0], stiffness, 1e-8)
        assert_equal(found.load[power, 0], load, 1e-9)


@pytest.mark.parametrize("degrees", [37.0, 100.0, 301.0])
def test_the_slider_that_turns_is_that_of_the_exact_mechanism(degrees):
    """M, D and f at 25 deg, and stiffness of the slider's translations, are the nonlinear mechanism's, to 1e-7."""
    machine, theta = SliderCrank(motor_angle=25.0, slider_joint="instrumented", **LOPSIDED), math.radians(degrees)
    mechanism = mechanism_of(machine)
    found = small_motion(mechanism, revolution_of(mechanism), np.array([theta]))
    exact = RigidMechanism(machine, 5).linearised(theta)
    assert_equal(found.mass[0], exact.mass, 1e-7)
    assert_equal(found.damping[1, 0], exact.damping, 1e-7)
    for power, stiffness, load in zip((0, 2), exact.stiffness, exact.load, strict=True):
        assert_equal(found.stiffness[power, 0][:2], stiffness[:2], 1e-7)
        assert_equal(found.stiffness[power, 0][:, :2], stiffness[:, :2], 1e-7)
        assert_equal(found.load[power, 0], load, 1e-7)


@pytest.mark.parametrize("name", SETS)
def test_in_the_plane_it_is_the_planar_mechanism(name):
    """With the motor upright M, D, K, f, the drive's torque and what it turns agree to 2e-11, at the ball too."""
    machine = SliderCrank(**LOPSIDED | SETS[name])
    flat, spatial = mechanism_of(machine), mechanism_of(replace(machine, motor_angle=1e-10))
    one, other = assembled(flat), assembled(spatial)
    there = {"slider turn": "slider pitch"}
    own = [spatial.coordinates.index(there.get(each, each)) for each in flat.coordinates]
    pick = np.ix_(own, own)
    assert_equal(other.mass[:, pick[0], pick[1]], one.mass, 2e-11)
    assert_equal(other.damping[1][:, pick[0], pick[1]], one.damping[1], 2e-11)
    for power in (0, 2):
        assert_equal(other.stiffness[power][:, pick[0], pick[1]], one.stiffness[power], 2e-11)
        assert_equal(other.load[power][:, own], one.load[power], 2e-11)
        assert_equal(other.torque[power], one.torque[power], 2e-11)
    inertia = [crank_inertia(each, revolution_of(each), ANGLES) for each in (flat, spatial)]
    assert_equal(inertia[1], inertia[0], 2e-11)


def cardan(angle):
    """A shaft, a second one at an angle [rad], and a third along the first, joined by two universal joints."""
    axis = (math.cos(angle), math.sin(angle), 0.0)
    x_axis, y_axis, z_axis = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    none, end = (0.0, 0.0, 0.0), (0.2, 0.0, 0.0)
    body = (SpatialBody(1.0, (1e-3, 1e-3, 1e-3)),)
    return SpatialMechanism(
        (
            spatial_link("input", {"end": none}, axis=x_axis),
            spatial_link("middle", {"start": none, "end": end}, body, orientation=(0.0, 0.0, angle), axis=x_axis),
            spatial_link("output", {"start": none}, body, axis=x_axis),
        ),
        (
            LinkJoint("motor", "revolute", ("ground", "hub"), ("input", "end"), "", "", (), True, 0.0, x_axis, x_axis),
            LinkJoint(
                "first", "universal", ("input", "end"), ("middle", "start"), first_axis=y_axis, second_axis=z_axis
            ),
            LinkJoint(
                "second", "universal", ("middle", "end"), ("output", "start"), first_axis=z_axis, second_axis=y_axis
            ),
            LinkJoint(
                "bearing",
                "cylindrical",
                ("ground", "far"),
                ("output", "start"),
                opened=("across", "sideways"),
                first_axis=x_axis,
                second_axis=x_axis,
            ),
        ),
        {"hub": none, "far": tuple(0.2 * part for part in axis)},
    )


def test_universal_joints_turn_unevenly_and_two_make_up_for_it():
    """Cardan's error in closed form: the middle shaft turns by atan(tan(th) / cos(angle)) as seen from its cross.

    The third shaft, parallel to the first, turns by th again, right round.
    """
    angle = math.radians(30.0)
    mechanism = cardan(angle)
    revolution = revolution_of(mechanism)
    theta = np.array([0.3, 1.2, 2.5, 4.0, 6.0])
    z = nominal(mechanism, revolution, theta).z
    turns = {name: z[:, mechanism.spin(name)] for name in ("input", "middle", "output")}
    np.testing.assert_allclose(np.mod(turns["output"], 2.0 * math.pi), theta, atol=1e-10)
    expected = np.unwrap(np.arctan2(np.sin(theta) * math.cos(angle), np.cos(theta)))
    other = np.unwrap(np.arctan2(np.sin(theta), np.cos(theta) * math.cos(angle)))
    middle = np.mod(turns["middle"], 2.0 * math.pi)
    error = min(np.abs(middle - np.mod(one, 2.0 * math.pi)).max() for one in (expected, other))
    assert error < 1e-10
    assert np.ptp(middle - theta) > 0.1


def skew_four_bar():
    """A crank about z and a rocker about x, a coupler between them with a universal joint and a ball; all have mass."""
    x_axis, y_axis, z_axis, none = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
    body = (SpatialBody(2.0, (3e-3, 5e-3, 4e-3), (0.1, 0.02, 0.03)),)
    return SpatialMechanism(
        (
            spatial_link("crank", {"shaft": none, "pin": (0.05, 0.0, 0.0)}, body),
            spatial_link("coupler", {"pin": none, "ball": (0.45, 0.0, 0.0)}, body, (0.0, -0.27, 0.98)),
            spatial_link("rocker", {"pivot": none, "ball": (0.0, 0.0, -0.3)}, body, axis=x_axis),
        ),
        (
            LinkJoint(
                "motor", "revolute", ("ground", "hub"), ("crank", "shaft"), "", "", (), True, 0.0, z_axis, z_axis
            ),
            LinkJoint("pin", "universal", ("crank", "pin"), ("coupler", "pin"), first_axis=z_axis, second_axis=y_axis),
            LinkJoint(
                "ball", "spherical", ("coupler", "ball"), ("rocker", "ball"), first_axis=x_axis, second_axis=x_axis
            ),
            LinkJoint(
                "pivot",
                "revolute",
                ("ground", "pivot"),
                ("rocker", "pivot"),
                opened=("across", "sideways"),
                first_axis=x_axis,
                second_axis=x_axis,
            ),
        ),
        {"hub": none, "pivot": (0.3, 0.3, 0.4), "wall": (0.7, 0.4, 0.5)},
        (0.3, -9.0, 2.0),
        springs=(Spring(("ground", "wall"), ("rocker", "ball"), 300.0, 0.2, 7.0),),
    )


def test_torque_of_the_drive_is_the_power_that_links_in_space_take():
    """Torque times speed is the rate of kinetic and potential energy of all particles of a skew four-bar with a spring.

    The energies come from where the particles are, without derivatives of joints or points.
    """
    mechanism, w = skew_four_bar(), 3.0
    revolution = revolution_of(mechanism)
    z = nominal(mechanism, revolution, np.arange(360) * 2.0 * np.pi / 360).z
    kinetic, potential = np.zeros(360), np.zeros(360)
    for link in mechanism.links:
        places = link.masses.moved(z[:, mechanism.at[link.name]])
        kinetic += 0.5 * np.sum(link.mass * np.sum(derivatives(places)[0] ** 2, axis=-1), axis=-1)
        potential -= places @ mechanism.gravity @ link.mass
    coupler, rocker = (mechanism.point(z, (link, "ball"))[0] for link in ("coupler", "rocker"))
    np.testing.assert_allclose(coupler, rocker, atol=1e-12)
    stretch = np.linalg.norm(rocker - mechanism.ground["wall"], axis=1)
    potential += 150.0 * (stretch - 0.2) ** 2
    power = derivatives(w**2 * kinetic + potential)[0] + 7.0 * w * derivatives(stretch)[0] ** 2
    found = small_motion(mechanism, revolution, np.arange(360) * 2.0 * np.pi / 360)
    np.testing.assert_allclose([1.0, w, w**2] @ found.torque, power, atol=1e-9 * np.abs(power).max())
    felt = crank_inertia(mechanism, revolution, np.arange(360) * 2.0 * np.pi / 360)
    np.testing.assert_allclose(0.5 * felt, kinetic, rtol=1e-9)


def test_a_link_that_turns_over_about_another_axis_is_named():
    """The third shaft goes right round about x; with another axis of its own it is refused by name."""
    given = cardan(math.radians(30.0))
    links = (*given.links[:2], spatial_link("output", {"start": (0.0, 0.0, 0.0)}))
    with pytest.raises(ParameterError, match="link output turns by half a turn about another axis"):
        revolution_of(SpatialMechanism(links, given.joints, given.ground))
