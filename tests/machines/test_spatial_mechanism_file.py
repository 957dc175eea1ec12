"""The file of a mechanism in space: the thesis' crank at an angle in it, what commands take, and what is refused."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import jsonschema
import numpy as np
import pytest

import chaosgym
from chaosgym import SliderCrank, simulate
from chaosgym.errors import ParameterError
from chaosgym.machines.machine_file import schema_text
from chaosgym.machines.mechanism.nominal import nominal
from chaosgym.machines.slider_crank.joints import hertz_constants
from tests.machines.test_mechanism_file import answer, run

FILE = Path(__file__).parents[2] / "docs" / "machines" / "slider-crank-thesis-15deg.toml"
PLANE = FILE.with_name("slider-crank-thesis.toml")
CRANK = SliderCrank(motor_angle=15.0, rod="rigid", geometric_stiffness="on")
GUIDE = 'clearance = "0.254 mm"\nstiffness = "15.52 N/um"\ndamping = "1035.43 N s/m"\n'
BALL = 'clearance = "0.127 mm"\nstiffness = "15.52 N/um"\ndamping = "272.94 N s/m"\n'
MOTOR = 'between = ["ground.shaft", "crank.shaft"]'


@pytest.fixture
def file_of(tmp_path):
    """Write the example with some texts replaced."""

    def write(*replaced, path=tmp_path / "own.toml"):
        text = FILE.read_text()
        for old, new in replaced:
            assert old in text, old
            text = text.replace(old, new, 1)
        path.write_text(text)
        return path

    return write


@pytest.mark.parametrize("speed", [120.0, 190.0, 260.0])
@pytest.mark.parametrize(
    ("file", "crank"), [(FILE, CRANK), (PLANE, replace(CRANK, motor_angle=0.0))], ids=["15 deg", "plane"]
)
def test_the_file_rattles_like_the_crank(file, crank, speed):
    """Peak forces of four revolutions from rest equal those of ``SliderCrank``, at 15 deg too, to the digits of a file.

    The crank tells the force on its slider, a file that on the guide: upper and lower change places.
    """
    found, expected = (simulate(given.at(speed), 4).peak_force for given in (chaosgym.read_machine(file), crank))
    np.testing.assert_allclose(found, expected[:, ::-1], rtol=2e-6)


def test_orientations_are_rough(file_of):
    """The crank a tenth of a turn off in every direction, the rod by 30 deg: the loops close all the same."""
    off = ('orientation = "0, 15, 0 deg"', 'orientation = "30, -20, 36 deg"')
    leaning = ("[link.rod]\n", '[link.rod]\norientation = "0, 30, -30 deg"\n')
    found, expected = (simulate(chaosgym.read_machine(path), 2).peak_force for path in (file_of(off, leaning), FILE))
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("surface", "crank"),
    [
        (GUIDE + "friction = 0.1\n", {"friction_coefficient": 0.1}),
        (
            'clearance = "0.254 mm"\nhertz_stiffness = "{} N/m^1.5"\nhertz_damping = "{} s/m"\n',
            {"contact_law": "hertz"},
        ),
    ],
)
def test_friction_and_hertzian_guides_are_those_of_the_crank(surface, crank, file_of):
    """The first revolution from rest, with friction of 0.1 and with Hertz's law, equals ``SliderCrank``'s to 5e-5."""
    machine = SliderCrank(motor_angle=15.0, rod="rigid", geometric_stiffness="on", **crank)
    surface = surface.format(*hertz_constants(machine))
    found = simulate(chaosgym.read_machine(file_of((GUIDE, surface))), 1).peak_force
    np.testing.assert_allclose(found, simulate(machine, 1).peak_force[:, ::-1], rtol=5e-5)


def test_a_ball_in_the_file_strikes_like_that_of_the_crank(file_of):
    """Its first revolution from rest, 168 N at 120 rpm, to 1e-4: its gap is measured along the rod that moves."""
    loose = file_of((GUIDE, ""), ('kind = "spherical"\n', 'kind = "spherical"\n' + BALL), ("guide_cl", "ball_cl"))
    crank = SliderCrank(
        motor_angle=15.0, rod="rigid", geometric_stiffness="on", slider_joint="ideal", ball_joint="spherical"
    ).at(120.0)
    found = simulate(chaosgym.read_machine(loose).at(120.0), 1).peak_force.max()
    assert found == pytest.approx(simulate(crank, 1).peak_force.max(), rel=1e-4)
    assert found == pytest.approx(167.96, abs=0.01)


def test_two_stations_of_a_slider_that_can_not_tilt_are_one_surface(file_of):
    """A slider of 10 kg m^2 carries at stations at -40 and 40 mm, of half the stiffness, the force of one gap."""
    heavy = ('inertia = "60, 200, 200 kg mm^2"', 'inertia = "10, 10, 10 kg m^2"')
    halves = GUIDE.replace("15.52", "7.76").replace("1035.43", "517.715") + 'stations = "-40, 40 mm"\n'
    plain, guided = (chaosgym.read_machine(file_of(heavy, (GUIDE, new))) for new in (GUIDE, halves))
    assert guided.degrees_of_freedom == ("guide across", "guide sideways", "guide yaw", "guide pitch")
    one, two = (simulate(each, 3).peak_force for each in (plain, guided))
    np.testing.assert_allclose(two, one, rtol=1e-4)


def test_stations_are_where_they_are_on_the_slider(file_of):
    """A contact moves with the coordinates as its point of the slider does: up and sideways, at -40 and at 40 mm."""
    ends = 'points = { pivot = "0, 0, 0 mm", rear = "-40, 0, 0 mm", front = "40, 0, 0 mm" }\n[[link.slider.body]]'
    slider = ('points = { pivot = "0, 0, 0 mm" }\n[[link.slider.body]]', ends)
    machine = chaosgym.read_machine(file_of(slider, (GUIDE, GUIDE + 'stations = "-40, 40 mm"\n')))
    mechanism, theta = machine.mechanism, np.array([1.0, 4.0])
    found = nominal(mechanism, machine.revolution, theta)
    rows = [contact.row[0] for contact in machine.contacts]
    for point, pair in (("rear", rows[:2]), ("front", rows[2:])):
        moved = mechanism.point(found.z, ("slider", point))[1] @ found.inverse[:, :, -4:]
        np.testing.assert_allclose(moved[:, 1:], np.broadcast_to(pair, (2, 2, 4)), atol=1e-12)


def test_commands_and_an_environment_take_the_file(tmp_path):
    """It fits the schema, is shown, drawn, run, judged and made into a brief; an agent may drive it."""
    jsonschema.Draft202012Validator(json.loads(schema_text())).validate(tomllib.loads(FILE.read_text()))
    assert answer("show", FILE, "--plot", tmp_path / "poses.png")
    assert (tmp_path / "poses.png").stat().st_size > 10_000
    assert answer("simulate", FILE, "--cycles", 5, "--plot", tmp_path / "run.png")
    assert answer("diagnose", FILE)["nature"] == "periodic"
    assert "guide_clearance" in run("design", "--template", FILE).stdout
    env = gym.make("chaosgym/MachineTolerance-v0", machine=str(FILE))
    observation, _ = env.reset(seed=0)
    assert np.all(np.isfinite(observation))


def test_what_can_not_be_in_space_is_refused_in_one_line(file_of):
    """Kinds and keys of the other sort of mechanism, beams, axes without direction, wrong inertia, mobility."""
    guide = 'first_axis = "1, 0, 0"'

    def refused(say, *replaced):
        with pytest.raises(ParameterError, match=say) as error:
            chaosgym.read_machine(file_of(*replaced))
        assert "\n" not in str(error.value)

    turn = 'orientation = "0, 15, 0 deg"'
    refused("crank.angle has a meaning in the plane only", (turn, 'angle = "15 deg"'))
    refused("orientation has 2 numbers", (turn, 'orientation = "0, 15 deg"'))
    refused("ball is slot, which a mechanism in space has not", ('kind = "spherical"', 'kind = "slot"'))
    refused(r"\[joint ball\] lacks first_axis", ('kind = "spherical"', 'kind = "universal"'))
    refused("mobility -1: 4 links with 6 motions", ('kind = "spherical"', 'kind = "revolute"'))
    refused("guide.axis has no meaning in space", (guide, 'axis = "0 deg"'))
    refused("guide.first_axis has no direction", (guide, 'first_axis = "0, 0, 0"'))
    refused("guide.first_axis has 2 numbers", (guide, 'first_axis = "1, 0"'))
    refused("belong to no body", ("60, 200, 200", "60, 200, 300"))
    refused("body.inertia has 1 numbers", ("60, 200, 200", "60"))
    refused("points.ball has 4 numbers", ('ball = "0, 0, 0 mm"', 'ball = "0, 0, 0, 0 mm"'))
    refused("can't turn beyond 4", ('end = "235, 0, 0 mm"', 'end = "35, 0, 0 mm"'))
    refused("depend on each other", ('first_axis = "0, 1, 0"', 'first_axis = "0, 0, 1"'))
    refused("driven on crank; allowed in space: on the ground", (MOTOR, 'between = ["crank.shaft", "ground.shaft"]'))
    beam = (
        'beam = { length = "0.2 m", diameter = "6 mm", youngs_modulus = "2e11 Pa", density = "8e3 kg/m^3", modes = 2 }'
    )
    points = 'points = { ball = "0, 0, 0 mm", end = "235, 0, 0 mm" }'
    refused("rod.body lacks at: a body of a beam", (points, beam))
    refused("rod.body.at has a meaning at the ends of a beam", ('mass = "370.5 g"', 'mass = "370.5 g"\nat = "end"'))


def test_a_rod_that_spins_between_two_balls_is_named_with_the_remedy(file_of):
    """Its spin is a second mobility; a universal joint in place of one ball holds it, and the mechanism runs."""
    text = FILE.read_text()
    yoke = text[text.index("[link.yoke]") : text.index("[link.slider]")]
    joints = text[text.index('[[joint]]\nname = "bearing"') : text.index('[[joint]]\nname = "guide"')]
    ends = '[[joint]]\nname = "end"\nbetween = ["rod.end", "slider.pivot"]\nkind = {}\n\n'
    with pytest.raises(ParameterError, match="mobility 2") as error:
        chaosgym.read_machine(file_of((yoke, ""), (joints, ends.format('"spherical"'))))
    remedy = 'Nothing holds the spin of rod about the line from ball to end: give one of them kind = "universal"'
    assert str(error.value).endswith(remedy)
    held = '"universal"\nfirst_axis = "0, 1, 0"\nsecond_axis = "0, 0, 1"'
    machine = chaosgym.read_machine(file_of((yoke, ""), (joints, ends.format(held))))
    assert np.all(np.isfinite(simulate(machine, 2).peak_force))


def test_what_belongs_to_space_is_refused_in_the_plane(tmp_path):
    """Spherical joints, axes with three numbers and orientations ask for points with a z."""
    text = (FILE.parent / "slider-crank-flores-guide.toml").read_text()
    for old, new, say in (
        ('kind = "revolute"', 'kind = "spherical"', "or a point with a z, which makes it one in space"),
        ('kind = "prismatic"', 'kind = "prismatic"\nfirst_axis = "1, 0, 0"', "first_axis has a meaning in space only"),
        ("[link.crank]", '[link.crank]\norientation = "0, 0, 3 deg"', "orientation has a meaning in space only"),
    ):
        path = tmp_path / "flat.toml"
        path.write_text(text.replace(old, new, 1))
        with pytest.raises(ParameterError, match=say):
            chaosgym.read_machine(path)
