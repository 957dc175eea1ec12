"""The slider crank with its motor at an angle: two assemblies of the plane, kinematics, and what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from chaosgym.core.binned.model import BinnedModel, TaylorModel
from chaosgym.machines.slider_crank.equations import equations
from chaosgym.machines.slider_crank.joints import InstrumentedSlider
from chaosgym.machines.slider_crank.mechanism import pin_and_pivot
from chaosgym.simulation import simulate
from tests.machines.kinematics import crank_pin, slider_position
from tests.machines.planar_twin import planar_equations
from tests.machines.spatial_twin import RigidMechanism
from tests.plain_modes import PLAIN_CRANK

CRANK = replace(PLAIN_CRANK, matrix_update_interval=5.0)
LOPSIDED = replace(
    CRANK,
    housing_offset_across=0.004,
    yoke_offset_across=-0.006,
    gravity=9.81,
    gravity_angle=20.0,
)
ANGLES = np.radians([0.0, 37.0, 100.0, 205.0, 301.0])


CHANGES = [
    {},
    {"rod": "rigid"},
    {"ball_joint": "spherical"},
    {"ball_joint": "spherical", "rod": "rigid"},
    {"ball_joint": "spherical", "slider_joint": "ideal"},
    {"damping_family": "uniform"},
    {"n_modes": 6, "fitted_modes": 2},
    {"geometric_stiffness": "on"},
    {"geometric_stiffness": "on", "rod": "rigid", "ball_joint": "instrumented"},
    {"slider_joint": "instrumented", "slider_offset_across": 0.01, "geometric_stiffness": "on"},
]


PLAIN_CHANGES = [change for change in CHANGES if "geometric_stiffness" not in change]
"""Those in which the twin leaves nothing out: see ``test_mechanism``."""


def parts(system):
    """All matrices and loads, by powers of the crank rate."""
    return [system.mass, *system.damping, *system.stiffness, *system.load]


@pytest.mark.parametrize("change", [*PLAIN_CHANGES, {"crank_radius": 0.15}, {"crank_radius": 0.235 / 1.001}])
def test_points_in_space_give_the_equations_in_the_frame_of_the_rod(change):
    """In the plane the matrices and loads, by Fourier derivatives, equal the closed form term by term to 5e-12.

    With a rod hardly longer than the crank, whose motion is as abrupt as it may be, to 1e-9.
    """
    machine = replace(LOPSIDED, **change)
    tolerance = 1e-9 if change.get("crank_radius", 0.0) > 0.2 else 5e-12
    for found, expected in zip(
        parts(equations(machine, ANGLES)), parts(planar_equations(machine, ANGLES)), strict=True
    ):
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=tolerance * np.abs(expected).max())


@pytest.mark.parametrize("change", CHANGES)
def test_nothing_couples_sideways_in_the_plane(change):
    """At a billionth of a degree the coordinates of the plane have its equations, and those beside it none of them."""
    planar = replace(LOPSIDED, **change)
    names = replace(planar, motor_angle=1e-9).degrees_of_freedom
    own = [names.index(name) for name in planar.degrees_of_freedom]
    sideways = [i for i in range(len(names)) if i not in own]
    flat, spatial = (parts(equations(replace(planar, motor_angle=angle), ANGLES)) for angle in (0.0, 1e-9))
    for one, other in zip(flat[:-2], spatial[:-2], strict=True):
        np.testing.assert_allclose(other[..., own, :][..., own], one, rtol=0.0, atol=1e-9 * np.abs(one).max())
        assert np.abs(other[..., own, :][..., sideways]).max() <= 1e-9 * np.abs(one).max()
    for one, other in zip(flat[-2:], spatial[-2:], strict=True):
        np.testing.assert_allclose(other[..., own], one, rtol=0.0, atol=1e-10 * np.abs(one).max())
        assert np.abs(other[..., sideways]).max() < 1e-9


def test_a_vanishing_motor_angle_runs_like_the_plane():
    """Three irregular revolutions at a millionth of a degree equal the planar ones, sideways motion included."""
    planar, spatial = simulate(CRANK, 3), simulate(replace(CRANK, motor_angle=1e-6), 3)
    np.testing.assert_allclose(spatial.peak_force, planar.peak_force, rtol=1e-4)


def test_the_vector_loop_closes_in_space():
    """At 25 deg pin and slider are where the closed form has them, to rounding."""
    angle, machine = np.linspace(0.0, 2 * np.pi, 37), replace(CRANK, motor_angle=25.0)
    pin, pivot = pin_and_pivot(machine, angle)
    np.testing.assert_allclose(pin, crank_pin(angle, 0.05, math.radians(25.0)), atol=1e-15)
    np.testing.assert_allclose(pivot[:, 0], slider_position(angle, 0.05, 0.235, math.radians(25.0)), atol=1e-15)


def test_the_rigid_reaction_at_an_angle_is_that_of_newton_and_euler():
    """A straight rod with end masses at 25 deg: the guide's forces follow from the moments about the ball centre."""
    machine = replace(
        LOPSIDED,
        motor_angle=25.0,
        rod="rigid",
        housing_offset_across=0.0,
        yoke_offset_across=0.0,
        yoke_offset_along=0.0,
        yoke_inertia=0.0,
        housing_inertia=0.36 * 0.003**2,
    )
    load = equations(machine, ANGLES).load
    rate = 20.0
    reaction = load[0] + rate**2 * load[1]
    h = 1e-3
    tilt, length = math.radians(25.0), machine.rod_length

    def particles(angle):
        pin = crank_pin(angle, machine.crank_radius, tilt)
        slider = np.zeros_like(pin)
        slider[:, 0] = slider_position(angle, machine.crank_radius, length, tilt)
        share = np.concatenate([(np.arange(2000) + 0.5) / 2000, [1.0, 0.003 / length]])
        return pin[:, None] + share[:, None] * (slider - pin)[:, None]

    bar = machine.density * math.pi * machine.rod_diameter**2 / 4 * length
    mass = np.concatenate([np.full(2000, bar / 2000), [machine.slider_mass + machine.yoke_mass, machine.housing_mass]])
    place = particles(ANGLES)
    acceleration = (particles(ANGLES + h) - 2 * place + particles(ANGLES - h)) / h**2 * rate**2
    gravity = math.radians(machine.gravity_angle)
    acceleration -= 9.81 * np.array([math.sin(gravity), -math.cos(gravity), 0.0])
    pin = crank_pin(ANGLES, machine.crank_radius, tilt)
    arm = place - pin[:, None]
    moment = np.einsum("k,bki->bi", mass, np.cross(arm, acceleration))
    rod = arm[:, 2000]
    # rod x (0, N_y, N_z) = moment; the component along the rod carries nothing
    for b in range(len(ANGLES)):
        matrix = np.stack([np.cross(rod[b], axis) for axis in ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0])], axis=1)
        expected = np.linalg.lstsq(matrix, moment[b], rcond=None)[0]
        np.testing.assert_allclose(reaction[b], expected, rtol=1e-5, atol=1e-5)


def test_sideways_load_grows_with_the_motor_angle():
    """The slider is pushed sideways as soon as the motor stands at an angle, and more at 25 than at 5 deg."""
    small, large = (
        np.abs(equations(replace(CRANK, motor_angle=angle), ANGLES).load[1, :, 2]).max() for angle in (5.0, 25.0)
    )
    assert 0.0 < small < large


@pytest.mark.parametrize("slider_joint", ["clearance", "instrumented"])
@pytest.mark.parametrize("degrees", [37.0, 100.0, 205.0, 301.0])
def test_a_rigid_rod_in_space_is_the_linearised_exact_mechanism(slider_joint, degrees):
    """At 25 deg, all bodies off their pivots: inertia, gyroscopic terms and load of slider motion and turns.

    With geometric stiffness, the stiffness of the slider's translations is exact too.
    """
    machine = replace(
        LOPSIDED,
        motor_angle=25.0,
        rod="rigid",
        slider_joint=slider_joint,
        geometric_stiffness="on",
        slider_offset_across=0.01,
        slider_offset_along=-0.005,
    )
    own = equations(machine, np.radians([degrees]))
    exact = RigidMechanism(machine, len(machine.degrees_of_freedom)).linearised(math.radians(degrees))
    for mine, expected in ((own.mass[0], exact.mass), (own.damping[1, 0], exact.damping), (own.load[:, 0], exact.load)):
        np.testing.assert_allclose(mine, expected, atol=1e-9 * np.abs(expected).max())
    for power, expected in ((0, exact.stiffness[0]), (2, exact.stiffness[1])):
        expected = expected[:2, :2]
        np.testing.assert_allclose(own.stiffness[power, 0, :2, :2], expected, atol=1e-7 * np.abs(expected).max())


def test_a_rigid_rod_rattles_in_space_like_the_exact_mechanism():
    """From rest at 25 deg through impacts on the guide, both ways: within 2 % of the clearance of DOP853's motion."""
    machine = replace(
        CRANK,
        motor_angle=25.0,
        rod="rigid",
        geometric_stiffness="on",
        crank_speed=250.0,
        matrix_update_interval=0.5,
        slider_clearance=0.1e-3,
    )
    samples = 720
    instants = np.arange(1, 120) * (machine.cycle_period / samples)
    history = simulate(machine, 1, samples_per_cycle=samples).history[0, 1:120]
    twin = RigidMechanism(machine, 2).run(instants)
    assert np.abs(twin).max(axis=0) == pytest.approx([machine.slider_clearance] * 2, rel=0.05)
    np.testing.assert_allclose(history[:, 0], twin[:, 0], atol=0.02 * machine.slider_clearance)


@pytest.mark.parametrize("force", [-1000.0, 1000.0, 5000.0])
def test_tension_stiffens_both_planes_of_bending(force):
    """A heavy slider pulls at a bare rod: f = f_0 sqrt(1 + P l^2 / (pi^2 E I)) in either plane (tensioned beam).

    Standing at 90 deg of a motor at 20 deg, the rod's pull is the slider's weight along the guide over its slope.
    """
    machine = replace(
        CRANK,
        motor_angle=20.0,
        crank_radius=0.01,
        housing_mass=0.0,
        housing_inertia=0.0,
        housing_offset_along=0.0,
        yoke_mass=0.0,
        yoke_inertia=0.0,
        yoke_offset_along=0.0,
        slider_mass=100.0,
        gravity=abs(force) / 100.0,
        gravity_angle=math.copysign(90.0, force),
    )
    names = machine.degrees_of_freedom
    first = {"swing": names.index("rod mode 1"), "sideways": names.index("sideways rod mode 1")}
    found = {}
    for switch in ("off", "on"):
        system = equations(replace(machine, geometric_stiffness=switch), np.array([math.pi / 2]))
        for plane, start in first.items():
            own = slice(start, start + machine.n_modes)
            squares = scipy.linalg.eigh(system.stiffness[0, 0][own, own], system.mass[0][own, own], eigvals_only=True)
            found[switch, plane] = squares[0]
    bending = machine.youngs_modulus * math.pi * machine.rod_diameter**4 / 64
    pull = force / math.sqrt(1.0 - (machine.crank_radius / machine.rod_length) ** 2)
    expected = 1.0 + pull * machine.rod_length**2 / (math.pi**2 * bending)
    for plane in first:
        assert found["on", plane] / found["off", plane] == pytest.approx(expected, rel=2e-3)


INSTRUMENTED = replace(CRANK, slider_joint="instrumented", crank_speed=230.0, slider_clearance=0.1e-3)


def sensor_peaks(machine, cycles=2):
    """Peaks (cycles, 4) of the vertical sensors and of those to the left and right, revolution by revolution."""
    record = simulate(machine, cycles)
    sideways = np.array([name.endswith(("left", "right")) for name in machine.sensors])
    return record.sensor_peak[:, ~sideways], record.sensor_peak[:, sideways]


def test_held_pitch_makes_the_instrumented_slider_the_plain_one():
    """With a slider too heavy to pitch the two stations share the force of one gap, in the plane and next to it."""
    held = replace(INSTRUMENTED, slider_pitch_inertia=10.0, slider_roll_inertia=10.0)
    plain = simulate(replace(INSTRUMENTED, slider_joint="clearance"), 4).peak_force
    np.testing.assert_allclose(simulate(held, 4).peak_force, plain, rtol=1e-4)
    for angle, cycles in ((0.0, 4), (1e-6, 1)):
        upright, sideways = sensor_peaks(replace(held, motor_angle=angle), cycles)
        np.testing.assert_allclose(upright, 0.5 * np.tile(plain[:cycles], 2), rtol=1e-3)
        assert np.abs(sideways).max() < 1e-4


def test_left_and_right_sensors_carry_nothing_in_the_plane_and_something_at_an_angle():
    """A slider that pitches: eight sensors on the middle of the faces at a vanishing angle are the planar four.

    At 15 deg the left and right ones are struck too.
    """
    pitching = replace(INSTRUMENTED, slider_offset_along=0.01, sensor_offset=0.0)
    planar, none = sensor_peaks(pitching)
    assert np.ptp(planar[0]) > 5.0
    assert np.all(none == 0.0)
    almost, nearly_none = sensor_peaks(replace(pitching, motor_angle=1e-6))
    np.testing.assert_allclose(almost, planar, rtol=1e-3)
    assert nearly_none.max() < 1e-4
    assert np.all(sensor_peaks(replace(INSTRUMENTED, motor_angle=15.0))[1] > 1.0)


def test_pitch_rolls_a_slider_on_sensors_off_the_middle():
    """Unequal forces at the two stations, 6 mm off the middle, roll the slider against its left and right sensors.

    So the scene of a motor at 0 deg, which knows no roll, is the limit only for sensors on the middle.
    """
    assert sensor_peaks(replace(INSTRUMENTED, slider_offset_across=0.01, motor_angle=1e-6))[1].max() > 5.0


def test_sensors_off_the_middle_keep_the_slider_from_rolling():
    """A turn about the guide either way closes the four sensors of one station, whose forces turn it back."""
    joint = InstrumentedSlider(True, 0.04, 0.006)
    rolls = np.array([contact.motion["slider roll"][0] for contact in joint.contacts()])
    assert rolls == pytest.approx([0.006] * 4 + [-0.006] * 4)
    total = sum(rolls[:4, None] * np.array([contact.force[0] for contact in joint.contacts()[:4]]))
    assert total == pytest.approx([0.0, 0.0, 0.0])


def test_a_scene_with_many_contact_sets_is_left_to_the_stepper():
    """Both joints instrumented or gapped in space: six channels, 64 contact sets, run by Taylor series all the same."""
    machine = replace(CRANK, motor_angle=10.0, ball_joint="instrumented", rod="rigid", ball_clearance=0.05e-3)
    assert isinstance(machine.reduce(), TaylorModel)
    assert isinstance(replace(machine, ball_joint="ideal").reduce(), BinnedModel)
    record = simulate(machine, 2)
    assert record.impacts.sum() > 0
    assert np.all(np.isfinite(record.section))


def test_many_modes_in_space():
    """A motor at an angle takes as many modes as one that stands straight: six give nearly the force of five."""
    five, six = (simulate(replace(PLAIN_CRANK, motor_angle=10.0, n_modes=n), 1).peak_force.max() for n in (5, 6))
    assert six == pytest.approx(five, rel=0.05)
