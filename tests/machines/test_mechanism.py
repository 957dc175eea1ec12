"""Small motions of any planar mechanism: against the thesis' crank by hand, published angles and closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest

from chaosgym.errors import ParameterError
from chaosgym.machines.mechanism.beam import beam_link
from chaosgym.machines.mechanism.equations import small_motion
from chaosgym.machines.mechanism.forces import Spring
from chaosgym.machines.mechanism.joints import LinkJoint
from chaosgym.machines.mechanism.links import Beam
from chaosgym.machines.mechanism.mechanism import Mechanism
from chaosgym.machines.mechanism.nominal import nominal, revolution_of
from chaosgym.machines.slider_crank.machine import SliderCrank
from chaosgym.machines.slider_crank.mechanism import mechanism_of
from tests.machines.mechanisms import ANGLES, BINS, OFFSET, assembled, assert_equal, four_bar
from tests.machines.planar_twin import planar_equations

NAMES = {
    "ball along": "ball along the rod",
    "ball across": "ball across the rod",
    "slider across": "slider across the guide",
    "slider turn": "slider pitch",
}
COORDINATES = {there: here for here, there in NAMES.items()}


@pytest.mark.parametrize("joint", ["clearance", "instrumented"])
def test_matrices_are_those_of_the_crank_by_hand(joint):
    """M, D, K and f of the rigid crank in the plane, all bodies off their axes, equal those by hand to 1e-11."""
    machine = SliderCrank(**OFFSET, slider_joint=joint)
    mechanism = mechanism_of(machine)
    found, expected = assembled(mechanism), planar_equations(machine, ANGLES)
    assert tuple(NAMES[name] for name in mechanism.coordinates) == machine.degrees_of_freedom
    for part, twin in zip(
        (found.mass, found.damping[1], found.stiffness[0], found.stiffness[2], found.load[0], found.load[2]),
        (expected.mass, expected.damping[1], expected.stiffness[0], expected.stiffness[2], *expected.load),
        strict=True,
    ):
        assert_equal(part, twin, 1e-11)
    assert not found.damping[0].any()
    assert not found.stiffness[1].any()
    assert not found.load[1].any()


FLEXIBLE = OFFSET | {"rod": "flexible"}
OPTIONS = {
    "slider": {},
    "plain modes": {"fitted_modes": 0},
    "fitted modes": {"n_modes": 2, "fitted_modes": 2},
    "instrumented slider": {"slider_joint": "instrumented"},
    "ball": {"slider_joint": "ideal", "ball_joint": "spherical"},
    "both": {"slider_joint": "instrumented", "ball_joint": "instrumented"},
    "uniform damping": {"damping_family": "uniform"},
    "damping of stiffness": {"damping_family": "stiffness"},
    "upright, no offsets": {"gravity_angle": 0.0, "yoke_offset_across": 0.0, "slider_offset_across": 0.0},
    "heavy housing": {"housing_mass": 0.3, "housing_offset_along": 0.01},
    "friction": {"friction_coefficient": 0.1},
}


@pytest.mark.parametrize(
    ("name", "geometric"),
    [(name, on) for name in OPTIONS for on in ("on", "off") if on == "off" or name not in ("ball", "both")],
)
def test_matrices_are_those_of_the_flexible_crank_by_hand(name, geometric):
    """M, D, K, f and the slider's motion along the guide equal those by hand to 2e-11: two codes of finite elements.

    Geometric stiffness, off by default, differs in two terms. The hand leaves out products of stretch and rotation:
    they reach 0.03 % of K's part that grows with speed squared, beside a spring of the stretch that is nine orders of
    magnitude stiffer. And a gap at the crank pin is measured along the nominal rod there, along the moving rod here.
    """
    machine = SliderCrank(**FLEXIBLE | OPTIONS[name] | {"geometric_stiffness": geometric})
    mechanism = mechanism_of(machine)
    found, expected = assembled(mechanism, geometric=geometric == "on"), planar_equations(machine, ANGLES)
    order = [mechanism.coordinates.index(COORDINATES.get(one, one)) for one in machine.degrees_of_freedom]
    assert sorted(order) == list(range(len(mechanism.coordinates)))
    stretch, pick = machine.degrees_of_freedom.index("rod stretch"), np.ix_(order, order)
    left = {0: 1e-7, 2: 1e-3} if geometric == "on" else {}
    for power in range(3):
        same, twin = found.stiffness[power][:, pick[0], pick[1]], expected.stiffness[power]
        if power in left:
            assert np.abs(same - twin)[:, stretch].max() < left[power] * np.abs(twin).max()
            same[:, stretch], same[:, :, stretch] = twin[:, stretch], twin[:, :, stretch]
        assert_equal(same, twin, 2e-11)
    assert_equal(found.mass[:, pick[0], pick[1]], expected.mass, 2e-11)
    for power in range(2):
        assert_equal(found.damping[power][:, pick[0], pick[1]], expected.damping[power], 2e-11)
    for power, load in zip((0, 2), expected.load, strict=True):
        assert_equal(found.load[power][:, order], load, 2e-11)
    gaps = mechanism.size - len(order)
    along = nominal(mechanism, revolution_of(mechanism), ANGLES).inverse[:, mechanism.at["slider"].start, gaps:]
    assert_equal(along[:, order], expected.slider_along, 2e-11)


def test_a_pinned_beam_has_its_frequencies():
    """A steel bar of 4 m and 40 mm: (k pi / l)^2 sqrt(E I / rho A), its first 5.0778 Hz, others to 0.1 %."""
    area, second = math.pi * 0.04**2 / 4.0, math.pi * 0.04**4 / 64.0
    link = beam_link("bar", Beam(4.0, area, second, 2.1e11, 7850.0, 3), {})
    found = np.sqrt(np.diag(link.stiffness)[1:]) / (2.0 * math.pi)
    assert found[0] == pytest.approx(5.0778, abs=1e-4)
    np.testing.assert_allclose(found, found[0] * np.array([1.0, 4.0, 9.0]), rtol=1e-3)


def test_a_gap_at_the_crank_pin_is_that_by_hand_in_other_axes():
    """With the ball's gap in the axes of the crank, which the drive holds, the same after a turn to those of the rod.

    Turned by T(theta), p = T p', the matrices are T' M T, T' (2 M w T' + D T) and T' (M w^2 T'' + D w T' + K T).
    """
    machine = SliderCrank(**OFFSET, slider_joint="instrumented", ball_joint="instrumented")
    mechanism = mechanism_of(machine)
    joints = tuple(joint._replace(frame="crank") if joint.name == "ball" else joint for joint in mechanism.joints)
    mechanism = replace(mechanism, joints=joints)
    found, expected = assembled(mechanism), planar_equations(machine, ANGLES)
    order = [machine.degrees_of_freedom.index(NAMES[name]) for name in mechanism.coordinates]
    rod = -np.arcsin(machine.crank_radius * np.sin(ANGLES) / machine.rod_length)
    # rod axes over crank axes; the ball's motion in rod axes is T times that in crank axes
    turn = ANGLES - rod
    c, s = np.cos(turn), np.sin(turn)
    first = 1.0 + machine.crank_radius * np.cos(ANGLES) / (machine.rod_length * np.cos(rod))
    frequencies = np.fft.rfftfreq(BINS, 1.0 / BINS)
    second = np.fft.irfft(1j * frequencies * np.fft.rfft(first), BINS)
    t, t1, t2 = np.zeros((3, BINS, 4, 4))
    t[:] = np.eye(4)
    t[:, 0, 0], t[:, 0, 1], t[:, 1, 0], t[:, 1, 1] = c, -s, s, c
    around = np.zeros((4, 4))
    around[0, 1], around[1, 0] = -1.0, 1.0
    t1 = first[:, None, None] * around @ t
    t1[:, 2:] = 0.0
    t2 = second[:, None, None] * around @ t + first[:, None, None] ** 2 * around @ around @ t
    t2[:, 2:] = 0.0
    back = np.swapaxes(t, -1, -2)
    m, d = expected.mass[:, order][:, :, order], expected.damping[1][:, order][:, :, order]
    k0, k2 = (expected.stiffness[power][:, order][:, :, order] for power in (0, 2))
    assert_equal(found.mass, back @ m @ t, 1e-11)
    assert_equal(found.damping[1], back @ (2.0 * m @ t1 + d @ t), 1e-11)
    assert_equal(found.stiffness[0], back @ k0 @ t, 1e-11)
    assert_equal(found.stiffness[2], back @ (m @ t2 + d @ t1 + k2 @ t), 1e-11)
    for power, load in zip((0, 2), expected.load, strict=True):
        assert_equal(found.load[power], np.einsum("bij,bi->bj", t, load[:, order]), 1e-11)


def test_nominal_motion_of_a_slider_crank_is_its_closed_form():
    """Rod angle and slider place of a crank of 50 mm and a rod of 235 mm, to 1e-14."""
    machine = SliderCrank()
    mechanism = mechanism_of(machine)
    z = nominal(mechanism, revolution_of(mechanism), ANGLES).z
    angle = -np.arcsin(machine.crank_radius * np.sin(ANGLES) / machine.rod_length)
    place = machine.crank_radius * np.cos(ANGLES) + machine.rod_length * np.cos(angle)
    np.testing.assert_allclose(z[:, mechanism.at["rod"].start + 2], angle, atol=1e-14)
    np.testing.assert_allclose(z[:, mechanism.at["slider"].start], place, atol=1e-14)


def test_a_revolution_may_begin_at_any_crank_angle():
    """Equations at 40 angles from 460 deg on are those from 10 deg on, ten angles later."""
    mechanism = four_bar()
    revolution = revolution_of(mechanism)
    steps = np.arange(40) * 2.0 * np.pi / 40
    here, there = (small_motion(mechanism, revolution, math.radians(first) + steps) for first in (10.0, 460.0))
    for one, other in zip(here, there, strict=True):
        axis = 0 if one is here.mass else 1
        assert_equal(np.roll(one, -10, axis), other, 1e-9)


def test_a_published_four_bar_stands_where_it_is_said_to():
    """Coupler and rocker of siconos' FourBarClearance (Akhadkar, Acary, Brogliato 2016), to the gap of their joints."""
    mechanism = four_bar()
    z = nominal(mechanism, revolution_of(mechanism), np.array([1.570823772407980])).z[0]
    assert z[mechanism.at["coupler"].start + 2] == pytest.approx(0.3532842020624460, abs=2e-6)
    assert z[mechanism.at["rocker"].start + 2] == pytest.approx(1.264872058968431, abs=2e-6)


def test_torque_of_the_drive_is_the_power_that_the_links_take():
    """Torque times speed is the rate of kinetic and potential energy of the nominal motion, at any crank angle."""
    mechanism = four_bar(springs=(Spring(("ground", "shaft"), ("rocker", "end"), 300.0, 0.5, 7.0),))
    revolution = revolution_of(mechanism)
    theta = np.arange(360) * 2.0 * np.pi / 360
    z, found = (
        nominal(mechanism, revolution, theta).z,
        small_motion(mechanism, revolution, np.arange(360) * 2.0 * np.pi / 360),
    )
    k, w = np.fft.rfftfreq(360, 1.0 / 360)[:, None], 3.0
    slope = np.fft.irfft(1j * k * np.fft.rfft(z - theta[:, None] * revolution.winding, axis=0), 360, axis=0)
    kinetic, potential = np.zeros(360), np.zeros(360)
    for name, length in (("coupler", 4.0), ("rocker", 2.5)):
        own = mechanism.at[name]
        phi, rate = z[:, own.start + 2], slope[:, own.start + 2]
        vx = slope[:, own.start] - 0.5 * length * np.sin(phi) * rate
        vy = slope[:, own.start + 1] + 0.5 * length * np.cos(phi) * rate
        kinetic += 0.5 * (vx**2 + vy**2 + length**2 / 12.0 * rate**2)
        potential += 9.81 * (z[:, own.start + 1] + 0.5 * length * np.sin(phi))
    phi = z[:, mechanism.at["rocker"].start + 2]
    stretch = np.hypot(3.0 + 2.5 * np.cos(phi), 2.5 * np.sin(phi))
    potential += 150.0 * (stretch - 0.5) ** 2
    change = np.fft.irfft(1j * k[:, 0] * np.fft.rfft(np.stack([w**2 * kinetic + potential, stretch])), 360)
    power = change[0] + 7.0 * w * change[1] ** 2
    np.testing.assert_allclose([1.0, w, w**2] @ found.torque, power, atol=1e-9 * np.abs(power).max())


def test_what_can_not_move_as_a_mechanism_is_refused_by_name():
    """A loop that does not close, a crank that can't turn, change points, mobility, drivers, points, springs."""
    whole = four_bar()

    def refused(say, **changes):
        with pytest.raises(ParameterError, match=say) as error:
            assembled(replace(whole, **changes))
        assert "\n" not in str(error.value)

    refused("does not close at crank angle 0", ground={"shaft": (0.0, 0.0), "pivot": (9.0, 0.0)})
    refused("has mobility 3.*motor 2", joints=whole.joints[:3])
    refused("has mobility -1", joints=(*whole.joints, whole.joints[0]._replace(name="again", driven=False)))
    refused("0 joints are driven", joints=(whole.joints[0]._replace(driven=False), *whole.joints[1:]))
    last = whole.joints[3]
    refused(r"2 joints are driven \(motor, pivot\)", joints=(*whole.joints[:3], last._replace(driven=True)))
    refused("no link is named 'rockr'", joints=(*whole.joints[:3], last._replace(second=("rockr", "pivot"))))
    refused("has no point 'top'", joints=(*whole.joints[:3], last._replace(second=("rocker", "top"))))
    refused("joins rocker to itself", joints=(*whole.joints[:3], last._replace(first=("rocker", "end"))))
    with pytest.raises(ParameterError, match=r"crank can't turn beyond \d+\.\d deg"):
        revolution_of(four_bar(crank=1.6, coupler=2.6, rocker=1.9))
    with pytest.raises(ParameterError, match=r"change point at crank angle \d+ deg|comes? back|can't turn"):
        assembled(four_bar(crank=1.4999))
    spring = Spring(("coupler", "end"), ("rocker", "end"), 1.0, 0.0)
    refused("has no length at crank angle", springs=(spring,))


def test_joints_that_hold_the_same_motion_are_named():
    """Two guides in line hold the rod across twice and leave its turn no room: the count is right, the rank not."""
    crank = mechanism_of(SliderCrank())
    guides = (
        *crank.joints[:2],
        LinkJoint("yoke", "prismatic", ("rod", "end"), ("slider", "pivot")),
        LinkJoint("slider", "prismatic", ("ground", "shaft"), ("slider", "pivot")),
    )
    with pytest.raises(ParameterError, match=r"moves in two ways: .*yoke.*slider.* depend on each other"):
        revolution_of(Mechanism(crank.links, guides, crank.ground))
