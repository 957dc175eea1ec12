"""Links that bend in space: against an exact twin of the thesis' crank, closed forms of a shaft, and the plane."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import chaosgym
from chaosgym import SliderCrank, simulate
from chaosgym.errors import ParameterError
from chaosgym.machines.mechanism.beam import bending_of, fibre_stress
from chaosgym.machines.mechanism.equations import small_motion
from chaosgym.machines.mechanism.joints import LinkJoint
from chaosgym.machines.mechanism.links import Beam
from chaosgym.machines.mechanism.nominal import revolution_of
from chaosgym.machines.mechanism.notes import buckling
from chaosgym.machines.mechanism.space import SpatialBody, spatial_link
from chaosgym.machines.mechanism.spatial import SpatialMechanism
from chaosgym.machines.mechanism.spatial_beam import fibre_stress_around, spatial_beam_link
from chaosgym.machines.slider_crank.mechanism import mechanism_of
from tests.machines.mechanisms import OFFSET, assert_equal
from tests.machines.spatial_twin import BendingMechanism

FILE = Path(__file__).parents[2] / "docs" / "machines" / "slider-crank-thesis-15deg.toml"
BENDING = OFFSET | {"slider_roll_inertia": 5e-4, "rod": "flexible"}


@pytest.mark.parametrize("degrees", [37.0, 100.0, 301.0])
def test_stiffness_is_that_of_the_exact_rod(degrees):
    """M, D, K and f equal those of the nonlinear crank to 1e-9, geometric stiffness included, all bodies off the line.

    The twin differentiates positions of particles by central differences, and knows neither joints nor their forces.
    What the three turns of its slider have among themselves is left out in it.
    """
    machine = SliderCrank(motor_angle=15.0, slider_joint="instrumented", n_modes=2, fitted_modes=2, **BENDING)
    mechanism, theta = mechanism_of(machine), math.radians(degrees)
    beam = mechanism.link("rod").beam
    planes = []
    for about in (True, False):
        ends = []
        for body in ("housing", "yoke"):
            mass, inertia, x, y = (
                getattr(machine, f"{body}_{what}") for what in ("mass", "inertia", "offset_along", "offset_across")
            )
            turning = (mass * x, inertia - (0.0 if about else mass * y**2))
            ends.append(turning if about or body == "housing" else (0.0, 0.0))
        planes.append(bending_of(beam, beam.second_moment, tuple(ends)))
    twin = BendingMechanism(machine, tuple(planes))
    found, exact = small_motion(mechanism, revolution_of(mechanism), np.array([theta])), twin.linearised(theta)
    order = [mechanism.coordinates.index(f"slider {name}") for name in ("across", "sideways", "roll", "yaw", "pitch")]
    order += [k for k, name in enumerate(mechanism.coordinates) if name.startswith("rod ")]
    pick = np.ix_(order, order)
    assert_equal(found.mass[0][pick], exact.mass, 1e-9)
    assert_equal(found.damping[1, 0][pick], exact.damping, 1e-9)
    for power, stiffness, load in zip((0, 2), exact.stiffness, exact.load, strict=True):
        expected = stiffness + twin.elastic * (power == 0)
        mine = found.stiffness[power, 0][pick].copy()
        mine[2:5, 2:5] = expected[2:5, 2:5]
        assert_equal(mine[5:, 5:], expected[5:, 5:], 1e-9)
        weak = np.r_[:5]
        assert_equal(mine[weak], expected[weak], 1e-7)
        assert_equal(mine[:, weak], expected[:, weak], 1e-7)
        assert_equal(found.load[power, 0][order], load, 1e-9)


LENGTH, DIAMETER = 1.2, 0.02
AREA, SECOND = math.pi * DIAMETER**2 / 4.0, math.pi * DIAMETER**4 / 64.0


def shaft(pull):
    """A round shaft between a universal joint and a ball, which a weight of 1 kg pulls along it."""
    x_axis, y_axis, z_axis, none = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
    beam = Beam(LENGTH, AREA, SECOND, 2.1e11, 7850.0, 2, stretches=False, sideways_moment=SECOND)
    return SpatialMechanism(
        (
            spatial_link("hub", {"end": none}, axis=x_axis),
            spatial_beam_link("shaft", beam, {}, axis=x_axis),
            spatial_link("bearing", {"pin": none}, (SpatialBody(1.0, (1e-3, 1e-3, 1e-3)),)),
        ),
        (
            LinkJoint("motor", "revolute", ("ground", "hub"), ("hub", "end"), "", "", (), True, 0.0, x_axis, x_axis),
            LinkJoint("cross", "universal", ("hub", "end"), ("shaft", "start"), first_axis=y_axis, second_axis=z_axis),
            LinkJoint("ball", "spherical", ("shaft", "end"), ("bearing", "pin"), first_axis=x_axis, second_axis=x_axis),
            LinkJoint(
                "guide",
                "prismatic",
                ("ground", "hub"),
                ("bearing", "pin"),
                opened=("across", "sideways"),
                first_axis=x_axis,
                second_axis=x_axis,
            ),
        ),
        {"hub": none},
        (pull, 0.0, 0.0),
    )


@pytest.mark.parametrize("pull", [0.0, 400.0])
def test_a_shaft_turns_critical_where_its_pulled_frequency_is(pull):
    """In axes that turn with it q'' + 2 w J q' + (w_k^2 - w^2) q = 0, in closed form, w_k under the pull of an end.

    w_k^2 = (k pi / l)^4 E I / m + (k pi / l)^2 P / m with m = rho A: tension stiffens both planes, the pull of its own
    weight in the mean by half. So it turns critical at w_k. Ten elements miss the second mode by 0.02 %.
    """
    mechanism = shaft(pull)
    found = small_motion(mechanism, revolution_of(mechanism), np.array([0.3]))
    own = [mechanism.coordinates.index(f"shaft {plane}mode {k}") for k in (1, 2) for plane in ("", "sideways ")]
    pick = np.ix_(own, own)
    line, wave = 7850.0 * AREA, np.array([1.0, 2.0]) * math.pi / LENGTH
    tension = pull * (1.0 + 0.5 * line * LENGTH)
    expected = wave**4 * 2.1e11 * SECOND / line + wave**2 * tension / line
    np.testing.assert_allclose(np.diag(found.stiffness[0, 0][pick]), np.repeat(expected, 2), rtol=3e-4)
    np.testing.assert_allclose(found.mass[0][pick], np.eye(4), atol=1e-9)
    np.testing.assert_allclose(found.stiffness[2, 0][pick], -np.eye(4), atol=1e-9)
    turned = found.damping[1, 0][pick]
    np.testing.assert_allclose(np.abs(turned), 2.0 * np.kron(np.eye(2), [[0.0, 1.0], [1.0, 0.0]]), atol=1e-9)
    np.testing.assert_allclose(turned, -turned.T, atol=1e-9)


def push_in_euler_loads(pull):
    """Of the shaft's end and of its own weight, in eight half waves: EI w4 + (P w')' = 0, pinned at both ends."""
    waves, x = np.arange(1, 9) * math.pi / LENGTH, (np.arange(4000) + 0.5) * (LENGTH / 4000)
    pushed = -pull * (1.0 + 7850.0 * AREA * (LENGTH - x))
    slopes = waves[:, None] * np.cos(waves[:, None] * x)
    work = (slopes * pushed) @ slopes.T * (LENGTH / 4000)
    own = np.sqrt(0.5 * LENGTH * 2.1e11 * SECOND) * waves**2
    return np.linalg.eigvalsh(work / np.outer(own, own))[-1]


@pytest.mark.parametrize(("pull", "rate", "buckles"), [(-4300.0, 1.0, False), (-4700.0, 1.0, True), (0.0, 1e3, False)])
def test_a_shaft_buckles_where_euler_says_and_not_by_turning_fast(pull, rate, buckles):
    """Pushed at its end and by its own weight it is told in both planes, with the load and pi^2 E I / l^2.

    At 1000 rad/s it turns far beyond its critical speed: whatever that does, no load pushes it.
    """
    mechanism = shaft(pull)
    told = buckling(mechanism, revolution_of(mechanism), rate)
    share, euler = push_in_euler_loads(pull), math.pi**2 * 2.1e11 * SECOND / LENGTH**2
    assert (share > 1.0) == buckles
    assert abs(share - 1.0) > 0.01
    assert len(told) == 2 * buckles
    for text, plane in zip(told, ("", "sideways "), strict=False):
        assert text.startswith(f"shaft is pushed {plane}beyond its Euler load")
        found = re.search(r": (\S+) N against (\S+) N", text)
        assert [float(value) for value in found.groups()] == pytest.approx([share * euler, euler], rel=2e-3)


BEAM = """[link.rod.beam]
length = "235 mm"
diameter = "6.35 mm"
youngs_modulus = "206.8 GPa"
density = "7833 kg/m^3"
modes = 3
damping_ratio = "5 %"
[[link.rod.body]]
at = "start"
mass = "370.5 g"
centre = "-5.85, 0, 0 mm"
inertia = "0, 545.2095, 545.2095 kg mm^2"

"""


@pytest.fixture
def bent(tmp_path):
    """The file of the crank at 15 deg with a rod that bends, and without a yoke."""
    before, rest = FILE.read_text().split("[link.rod]")
    yoke = '[link.yoke]\npoints = { pivot = "0, 0, 0 mm" }\n'
    slider = rest[rest.index("[link.slider]") :].replace("rod.ball", "rod.start")
    path = tmp_path / "bent.toml"
    path.write_text(before + BEAM + yoke + slider)
    return path


def test_a_file_bends_like_the_crank_of_the_thesis(bent):
    """Two revolutions from rest at 15 deg with three modes in each plane strike like ``SliderCrank`` to 5e-4.

    Without geometric stiffness it differs by 3e-3. The crank damps its stretch by the mass of its slider too.
    """
    none = {"yoke_mass": 0.0, "yoke_inertia": 0.0, "yoke_offset_along": 0.0}
    plain = {"damping_ratio": 0.05, "damping_family": "uniform", "fitted_modes": 0, "geometric_stiffness": "on"}
    expected = simulate(SliderCrank(motor_angle=15.0, **none, **plain), 2).peak_force
    found = simulate(chaosgym.read_machine(bent), 2).peak_force
    np.testing.assert_allclose(found, expected[:, ::-1], rtol=5e-4)


def test_stress_around_a_rod_is_that_of_its_planes(bent):
    """Above and below it is that of the same modes in the plane, at the sides that of the modes sideways."""
    machine = chaosgym.read_machine(bent)
    link = machine.mechanism.link("rod")
    around = fibre_stress_around(link, link.beam, 0.1, 0.003)
    flat = link._replace(
        stiffness=link.stiffness[:4, :4],
        elastic=link.elastic[:4],
        points={name: place._replace(slope=place.slope[:, 2, :4]) for name, place in link.points.items()},
    )
    np.testing.assert_allclose(around[[0, 8], :4], fibre_stress(flat, link.beam, 0.1, 0.003), rtol=1e-12)
    np.testing.assert_allclose(around[[4, 12], 4:], around[[0, 8], 1:4], rtol=1e-2)
    assert np.abs(around[[0, 8], 4:]).max() < 1e-9 * np.abs(around).max()
    rows = machine.bending_parts["rod"].stress(0.1, 0.003)
    assert rows.shape == (16, len(machine.degrees_of_freedom))
    bent.write_text(bent.read_text().replace('diameter = "6.35 mm"', 'width = "5 mm"\nheight = "6 mm"'))
    with pytest.raises(ParameterError, match="link 'rod' bends in space and is not round"):
        chaosgym.read_machine(bent).bending_parts["rod"].stress(0.1, 0.003)


UNDAMPED = """[ground]
points = {{ shaft = "0, 0, 0 mm" }}
[link.crank.beam]
length = "50 mm"
{section}
[link.rod.beam]
length = "235 mm"
{section}
[link.slider]
points = {{ wrist = "0, 0, 0 mm" }}
body = [{{ mass = "0.45 kg", inertia = "2e-4, 2e-4, 2e-4 kg m^2" }}]
[[joint]]
name = "shaft"
kind = "revolute"
between = ["ground.shaft", "crank.start"]
driven = true
[[joint]]
name = "pin"
kind = "universal"
between = ["crank.end", "rod.start"]
first_axis = [0, 0, 1]
second_axis = [0, 1, 0]
[[joint]]
name = "wrist"
kind = "spherical"
between = ["rod.end", "slider.wrist"]
[[joint]]
name = "guide"
kind = "prismatic"
between = ["ground.shaft", "slider.wrist"]
clearance = "0.1 mm"
stiffness = "8 N/um"
damping = "500 N s/m"
[operation]
speed = "400 rpm"
speed_range = "100 to 800 rpm"
clearance_range = "0.02 to 0.3 mm"
"""
SECTION = """diameter = "8 mm"
youngs_modulus = "200 GPa"
density = "7800 kg/m^3"
modes = 2
damping_ratio = """


def test_two_links_that_bend_undamped_are_told(tmp_path):
    """Crank and rod without damping grow between updates of the matrices; 0.1 % of damping or 1 deg holds them."""
    path = tmp_path / "undamped.toml"
    path.write_text(UNDAMPED.format(section=f"{SECTION}0"))
    undamped = chaosgym.read_machine(path)
    assert "crank and rod bend without damping" in undamped.notes[0]
    peak = simulate(undamped, 50).peak_force.max()
    path.write_text(UNDAMPED.format(section=f"{SECTION}0.001"))
    damped = chaosgym.read_machine(path)
    assert damped.notes == ()
    held = [
        simulate(machine, 50).peak_force.max() for machine in (damped, replace(undamped, matrix_update_interval=1.0))
    ]
    assert max(held) < 200.0 < peak
