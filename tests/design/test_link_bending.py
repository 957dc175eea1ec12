"""Bending of a mechanism's link: statics of a beam, the whip of a connecting rod, and what a brief may ask."""

import math
import tomllib

import numpy as np
import pytest

import chaosgym
from chaosgym import simulate
from chaosgym.design.brief import brief_from, read_brief, template
from chaosgym.design.study import study
from chaosgym.errors import DesignError, ParameterError
from chaosgym.machines.mechanism.beam import beam_link, fibre_stress
from chaosgym.machines.mechanism.links import Beam
from tests.design.small import small_studies
from tests.machines.mechanisms import joint, surface

LENGTH, CRANK, DIAMETER, MODULUS, DENSITY = 0.235, 0.05, 0.008, 2.1e11, 7850.0
AREA, SECOND = math.pi * DIAMETER**2 / 4.0, math.pi * DIAMETER**4 / 64.0
LINE = DENSITY * AREA

MACHINE = f"""
title = "Slider crank whose rod bends"
[ground]
points = {{ shaft = "0, 0 mm" }}
gravity = "9.81 m/s^2"
gravity_direction = "-90 deg"
[link.crank]
points = {{ shaft = "0, 0 mm", pin = "50, 0 mm" }}
[link.rod.beam]
length = "235 mm"
diameter = "8 mm"
youngs_modulus = "210 GPa"
density = "7850 kg/m^3"
modes = 5
damping_ratio = "5 %"
[link.slider]
points = {{ wrist = "0, 0 mm" }}
[[link.slider.body]]
mass = "0.45 kg"
{joint("motor", "revolute", "ground.shaft", "crank.shaft", "driven = true")}
{joint("pin", "revolute", "crank.pin", "rod.start")}
{joint("wrist", "revolute", "rod.end", "slider.wrist")}
{joint("guide", "prismatic", "ground.shaft", "slider.wrist", surface("0 mm", "8 N/um", "500 N s/m"))}
[operation]
speed = "600 rpm"
speed_range = "5 to 3000 rpm"
clearance_range = "0 to 0.1 mm"
[tolerances]
speed = "2 %"
guide_stiffness = "10 %"
"""

SECTION = """[bending]
link = "rod"
at = "117.5 mm"
fibre = "4 mm"
amplitude = "250 MPa"
cycles = "1 Mcycles"
slope = 5
ultimate = "600 MPa"
"""

CRITERIA = '[criteria]\nload_rating = "5 kN"\nlife = "1000 h"\nreliability = 0.9\n'


@pytest.fixture
def crank(tmp_path):
    """A slider crank that runs tight in its guide."""
    path = tmp_path / "crank.toml"
    path.write_text(MACHINE)
    return path


def moment(speed, gravity, at, theta):
    """Moment [N m] in a pinned rod that pulls its upper fibre: d'Alembert, the motion of rigid links in closed form."""
    turn = speed * math.pi / 30.0
    tilt = np.arcsin(CRANK * np.sin(theta) / LENGTH)
    rate = CRANK * turn * np.cos(theta) / (LENGTH * np.cos(tilt))
    growth = rate**2 * np.tan(tilt) - CRANK * turn**2 * np.sin(theta) / (LENGTH * np.cos(tilt))
    normal = np.stack([np.sin(tilt), np.cos(tilt)])  # of the rod, which points from the crank's pin to the wrist
    pin = -CRANK * turn**2 * np.stack([np.cos(theta), np.sin(theta)]) + [[0.0], [gravity]]
    start = np.sum(pin * normal, axis=0)
    end = start - growth * LENGTH  # the tilt is counted down
    load = -LINE * start, -LINE * end  # up along the normal, linear in between
    return load[0] * at * (LENGTH - at) / 2.0 + (load[1] - load[0]) * at * (LENGTH**2 - at**2) / (6.0 * LENGTH)


@pytest.mark.parametrize(("speed", "gravity", "miss"), [(5.0, 100.0, 0.005), (300.0, 1.0, 0.005), (600.0, 0.0, 0.02)])
@pytest.mark.parametrize("at", [0.1175, 0.06])
def test_the_stress_of_a_rod_is_moment_over_section_modulus(crank, speed, gravity, miss, at):
    """M / W of a pinned rod under its weight, a hundredfold at rest almost, and under its own inertia (its whip).

    The load is linear along the rod, and presses the upper fibre where it acts down. The lowest natural frequency is
    294 Hz, so that at 10 Hz and its harmonics the dynamic answer differs from the static one by a hundredth.
    """
    machine = chaosgym.machines.parameters.with_settings(
        chaosgym.read_machine(crank), {"speed": speed, "gravity_factor": gravity, "matrix_update_interval": 1.0}
    )
    theta = 2.0 * math.pi * np.arange(720) / 720
    rows = machine.bending_parts["rod"].stress(at, DIAMETER / 2.0)
    bent = 0.5 * (rows[0] - rows[1])
    found = simulate(machine.bending_parts["rod"].showing(bent), 1, transient=6, samples_per_cycle=720).history[0, :, 0]
    expected = moment(speed, 9.81 * gravity, at, theta) * DIAMETER / 2.0 / SECOND
    largest = np.abs(expected).max()
    assert np.abs(found - expected).max() < miss * largest


def test_a_rigid_mechanism_says_which_links_bend():
    """The compressor's links are rigid: one line says what a link needs."""
    text = f'machine = "docs/machines/compressor.toml"\n{CRITERIA}{SECTION}'
    with pytest.raises(ParameterError, match=r"link 'rod' does not bend; allowed: a link with a \[link.NAME.beam\]"):
        brief_from(tomllib.loads(text))
    assert "[bending]" not in template("docs/machines/compressor.toml")


def test_a_round_pin_without_gap_leaves_the_stress_as_it_is(crank):
    """The same moment where the wrist's pin is a contact, whose motion is run by Taylor series."""
    contact = 'clearance = "0 mm"\nstiffness = "{} N/um"\ndamping = "{} N s/m"\n'
    wrist, guide = 'between = ["rod.end", "slider.wrist"]\n', contact.format(8, 500)
    text = MACHINE.replace(guide, "").replace(wrist, wrist + contact.format(50, 2000))
    crank.write_text(text.replace("guide_stiffness", "wrist_stiffness"))
    machine = chaosgym.read_machine(crank).at(300.0)
    assert not machine.has_propagators
    rows = machine.bending_parts["rod"].stress(0.1175, DIAMETER / 2.0)
    found = simulate(
        machine.bending_parts["rod"].showing(0.5 * (rows[0] - rows[1])), 1, transient=6, samples_per_cycle=720
    ).history[0, :, 0]
    expected = moment(300.0, 9.81, 0.1175, 2.0 * math.pi * np.arange(720) / 720) * DIAMETER / 2.0 / SECOND
    assert np.abs(found - expected).max() < 0.005 * np.abs(expected).max()


def test_modes_of_a_pinned_beam_have_their_curvatures():
    """phi'' = -(k pi / l)^2 sqrt(2 / m l) sin(k pi x / l); a stretch pulls by E / l a metre, both fibres alike."""
    beam = Beam(LENGTH, AREA, SECOND, MODULUS, DENSITY, 4)
    link = beam_link("rod", beam, {})
    for at in (0.0, 0.06, 0.2):
        stress = fibre_stress(link, beam, at, 0.004)
        k = np.arange(1, 5)
        largest = MODULUS * 0.004 * (k * math.pi / LENGTH) ** 2 * math.sqrt(2.0 / (LINE * LENGTH))
        miss = np.abs(stress[0, 1:] / largest - np.sin(k * math.pi * at / LENGTH))
        assert np.all(miss < [1e-3, 2e-3, 4e-3, 0.015])  # what ten elements leave open
        np.testing.assert_allclose(stress[:, 0], MODULUS / LENGTH)
        np.testing.assert_allclose(stress[1, 1:], -stress[0, 1:])


def test_the_pull_of_a_rod_is_that_of_its_slider(crank):
    """Turned over dead centre at 600 rpm a slider of 0.45 kg pulls its rod by m r w^2 (1 + r / l), over its area."""
    machine = chaosgym.read_machine(crank)
    pull = machine.bending_parts["rod"].stress(0.1, 0.0)[0]
    found = simulate(machine.bending_parts["rod"].showing(pull), 1, transient=6, samples_per_cycle=720).history[0, 0, 0]
    turn = 20.0 * math.pi
    carried = 0.45 + LINE * LENGTH / 2.0  # the outer half of the rod; the stretch is that of its middle
    assert found == pytest.approx(carried * CRANK * turn**2 * (1.0 + CRANK / LENGTH) / AREA, rel=0.05)


def test_a_brief_may_ask_for_a_section_of_a_link(crank):
    """From the template to a criterion; the stress that is told is that of the worse fibre."""
    text = template(str(crank))
    assert '# link = "rod"' in text
    path = crank.parent / "brief.toml"
    path.write_text(f'machine = "crank.toml"\nseries = 8\n{CRITERIA}[changes]\n{SECTION}')
    with small_studies():
        answer = study(read_brief(path), verdict_only=True)
    bent = answer.assessment.bending
    assert bent is not None
    assert "of rod" in bent.told(0.1)[0]
    worst = np.abs(moment(600.0, 9.81, 0.1175, np.linspace(0, 2 * math.pi, 721))).max() * DIAMETER / 2.0 / SECOND
    assert bent.nominal.highest > 0.9 * worst
    assert [check.name for check in answer.assessment.checks if "bending" in check.name] == ["bending life"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('link = "rod"', 'link = "crank"', "link 'crank' does not bend; allowed: rod"),
        ('link = "rod"\n', "", "lacks link"),
        ('"117.5 mm"', '"250 mm"', "section at 0.25 m is outside the link rod; allowed: 0 to 0.235 m"),
        ('fibre = "4 mm"\n', "", "lacks fibre"),
        ('fibre = "4 mm"', 'fibre = "4 mm"\nmodulus = "1 GPa"', "has modulus, which goes with turn or curvatures"),
        ('link = "rod"\nat = "117.5 mm"', 'link = "rod"\nturn = "a"\nspan = "1 mm"', "has link, which goes with at"),
        ("slope = 5\n", "", "lacks slope"),
    ],
)
def test_sections_that_are_none_are_one_line(crank, old, new, message):
    """Links that are rigid, places outside, and what belongs to another kind of machine."""
    assert old in SECTION
    text = f'machine = "{crank}"\n{CRITERIA}{SECTION.replace(old, new)}'
    with pytest.raises((DesignError, ParameterError), match=message) as caught:
        brief_from(tomllib.loads(text))
    assert "\n" not in str(caught.value)
