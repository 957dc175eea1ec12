"""The slider crank with its motor at an angle: two assemblies of the plane, kinematics, and what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest

from chaosgym.core.crank_stepper import SteppedCrankModel
from chaosgym.core.slider_crank import SliderCrankModel
from chaosgym.errors import ParameterError
from chaosgym.machines.crank_equations import degrees_of_freedom, equations
from chaosgym.machines.kinematics import crank_pin, slider_position, slider_rate
from chaosgym.machines.slider_crank import THESIS_SLIDER_CRANK
from chaosgym.machines.spatial_equations import spatial_equations, spatial_loads
from chaosgym.simulation import simulate

CRANK = replace(THESIS_SLIDER_CRANK, matrix_update_interval=5.0)
LOPSIDED = replace(
    CRANK, housing_offset_across=0.004, yoke_offset_across=-0.006, gravity=9.81, gravity_angle=20.0,
)  # fmt: skip
ANGLES = np.radians([0.0, 37.0, 100.0, 205.0, 301.0])


@pytest.mark.parametrize(
    "change",
    [
        {}, {"rod": "rigid"}, {"ball_joint": "spherical"}, {"ball_joint": "spherical", "rod": "rigid"},
        {"ball_joint": "spherical", "slider_joint": "ideal"}, {"damping_family": "uniform"},
    ],
)  # fmt: skip
def test_at_zero_motor_angle_particles_give_the_planar_equations(change):
    """Inertia of particles in space equals the planar frame equations term by term, and nothing couples sideways."""
    machine = replace(LOPSIDED, **change)
    planar, spatial = equations(machine, ANGLES), spatial_equations(machine, ANGLES)
    names = degrees_of_freedom(machine, spatial=True)
    own = [names.index(name) for name in degrees_of_freedom(machine)]
    sideways = [i for i in range(len(names)) if i not in own]
    for field in ("mass", "damping", "stiffness"):
        one, other = getattr(planar, field), getattr(spatial, field)
        np.testing.assert_allclose(other[..., own, :][..., own], one, atol=1e-9 * np.abs(one).max())
        assert np.abs(other[..., own, :][..., sideways]).max() < 1e-9 * np.abs(one).max()
    np.testing.assert_allclose(spatial.load[..., own], planar.load, atol=1e-10 * np.abs(planar.load).max())
    assert np.abs(spatial.load[..., sideways]).max() < 1e-12
    np.testing.assert_array_equal(spatial_loads(machine, ANGLES), spatial.load)


def test_a_vanishing_motor_angle_runs_like_the_plane():
    """Three irregular revolutions at a millionth of a degree equal the planar ones, sideways motion included."""
    planar, spatial = simulate(CRANK, 3), simulate(replace(CRANK, motor_angle=1e-6), 3)
    np.testing.assert_allclose(spatial.peak_force, planar.peak_force, rtol=1e-4)


def test_the_vector_loop_closes_in_space():
    """At 25 deg the rod keeps its length, and the slider's velocity is the derivative of its position."""
    angle, tilt = np.linspace(0.0, 2 * np.pi, 37), math.radians(25.0)
    pin, slider = crank_pin(angle, 0.05, tilt), slider_position(angle, 0.05, 0.235, tilt)
    rod = np.stack([slider, 0 * slider, 0 * slider], axis=-1) - pin
    np.testing.assert_allclose(np.linalg.norm(rod, axis=1), 0.235, rtol=1e-14)
    h = 1e-5
    ahead, behind = (slider_position(angle + s, 0.05, 0.235, tilt) for s in (h, -h))
    np.testing.assert_allclose(slider_rate(angle, 0.05, 0.235, tilt), (ahead - behind) / (2 * h), atol=1e-10)


def test_the_rigid_reaction_at_an_angle_is_that_of_newton_and_euler():
    """A straight rod with end masses at 25 deg: the guide's forces follow from the moments about the ball centre."""
    machine = replace(
        LOPSIDED, motor_angle=25.0, rod="rigid", housing_offset_across=0.0, yoke_offset_across=0.0,
        yoke_offset_along=0.0, yoke_inertia=0.0, housing_inertia=0.36 * 0.003**2,
    )  # fmt: skip
    load = spatial_loads(machine, ANGLES)
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
        np.abs(spatial_loads(replace(CRANK, motor_angle=angle), ANGLES)[1, :, 2]).max() for angle in (5.0, 25.0)
    )
    assert 0.0 < small < large


@pytest.mark.parametrize("change", [{"slider_joint": "instrumented"}, {"geometric_stiffness": "on"}])
def test_what_space_does_not_know_is_refused(change):
    """Options that exist only in the plane raise an error at a motor angle; none is silently ignored."""
    with pytest.raises(ParameterError, match=next(iter(change))):
        replace(CRANK, motor_angle=10.0, **change)


def test_a_scene_with_many_contact_sets_is_left_to_the_stepper():
    """Both joints instrumented or gapped in space: six channels, 64 contact sets, run by Runge-Kutta all the same."""
    machine = replace(CRANK, motor_angle=10.0, ball_joint="instrumented", rod="rigid", ball_clearance=0.05e-3)
    assert isinstance(machine.reduce(), SteppedCrankModel)
    assert isinstance(replace(machine, ball_joint="ideal").reduce(), SliderCrankModel)
    record = simulate(machine, 2)
    assert record.impacts.sum() > 0
    assert np.all(np.isfinite(record.section))
