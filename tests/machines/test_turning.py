"""Machines that turn: rad, N m, N m/rad and kg m^2 are read as they are, and are the sliding machine at any radius."""

import json
import math

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp

import chaosgym
from chaosgym.cli import app
from chaosgym.errors import ParameterError
from chaosgym.machines.units import ALTERNATIVES, TURNING, parse_quantity, parse_row

TORSIONAL = """
[structure]
frequencies = ["11 Hz", "0 Hz"]
modal_damping = [["6 1/s", "0 1/s"], ["0 1/s", "1.5 1/s"]]
modal_masses = ["12 kg cm^2", "0.004 kg·m²"]

[structure.shapes]
motor = "1, 0"
load = "0, 1"

[joint]
at = "motor - load"
clearance = "3 arcmin"
stiffness = "0.5 Nm/arcmin"
damping = "0.05 N m s/rad"
preload = "300 N mm"

[[drive]]
at = "motor"
force = "2 N*m"

[operation]
speed = "8 Hz"
speed_range = "4 to 20 Hz"
clearance_range = "1 to 10 arcmin"

[tolerances]
speed = "2 %"
clearance = "0.5 arcmin"
"""
ARCMIN = math.pi / 10_800.0
J_MOTOR, J_LOAD = 1.2e-3, 4e-3
GAP, SPRING, DAMPER, PRELOAD, TORQUE, SPEED = 3 * ARCMIN, 0.5 / ARCMIN, 0.05, 0.3, 2.0, 8.0
RADIUS = 0.05

SLIDING = f"""
[structure]
frequencies = "11, 0 Hz"
modal_damping = [["6 1/s", "0 1/s"], ["0 1/s", "1.5 1/s"]]
modal_masses = "{J_MOTOR / RADIUS**2:.17g}, {J_LOAD / RADIUS**2:.17g} kg"

[structure.shapes]
motor = "1, 0 kg^-1/2"
load = "0, 1"

[joint]
at = "motor - load"
clearance = "{GAP * RADIUS:.17g} m"
stiffness = "{SPRING / RADIUS**2:.17g} N/m"
damping = "{DAMPER / RADIUS**2:.17g} N s/m"
preload = "{PRELOAD / RADIUS:.17g} N"

[[drive]]
at = "motor"
force = "{TORQUE / RADIUS:.17g} N"

[operation]
speed = "8 Hz"
speed_range = "4 to 20 Hz"
clearance_range = "0.01 to 0.1 mm"
"""


@pytest.fixture
def file(tmp_path):
    """Writes a machine's file."""

    def write(text, name="m.toml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return str(path)

    return write


def test_a_turning_machine_is_the_sliding_one_at_a_radius(file):
    """x = r theta, F = T / r, k = k_t / r^2, m = J / r^2: torques are r times the forces, whatever the radius."""
    turning, sliding = (chaosgym.read_machine(file(text)) for text in (TORSIONAL, SLIDING))
    ours, theirs = (chaosgym.simulate(machine, 40).peak_force for machine in (turning, sliding))
    assert ours.max() > 2.0
    np.testing.assert_allclose(ours, RADIUS * theirs, rtol=1e-8)


def test_a_turning_machine_in_scipy(file):
    """Two inertias, a stop that pushes and never pulls: DOP853 finds the peak torques of five cycles."""
    k_motor = J_MOTOR * (2.0 * math.pi * 11.0) ** 2

    def torques(state):
        angle, rate = state[0] - state[1], state[2] - state[3]
        upper = SPRING * (angle - GAP) + DAMPER * rate if angle > GAP else 0.0
        lower = SPRING * (-angle - GAP) - DAMPER * rate if -angle > GAP else 0.0
        return max(upper, 0.0), max(lower, 0.0)

    def motion(t, state):
        upper, lower = torques(state)
        mesh = upper - lower - PRELOAD
        motor = TORQUE * math.sin(2.0 * math.pi * SPEED * t) - mesh - k_motor * state[0] - 6.0 * J_MOTOR * state[2]
        return [state[2], state[3], motor / J_MOTOR, (mesh - 1.5 * J_LOAD * state[3]) / J_LOAD]

    state, peaks = np.zeros(4), []
    for cycle in range(5):
        span = cycle / SPEED, (cycle + 1) / SPEED
        run = solve_ivp(motion, span, state, method="DOP853", rtol=1e-9, atol=1e-13, max_step=1e-4, dense_output=True)
        state = run.y[:, -1]
        peaks.append(np.max([torques(run.sol(t)) for t in np.linspace(*span, 8001)], axis=0))
    found = chaosgym.simulate(chaosgym.read_machine(file(TORSIONAL)), 5).peak_force
    np.testing.assert_allclose(found, peaks, rtol=2e-4, atol=1e-9)


def test_commands_speak_in_the_units_of_what_turns(file):
    """Fields are in rad and N m, options in arcmin; every result says what its N and m are."""
    path = file(TORSIONAL)

    def run(*arguments):
        done = CliRunner().invoke(app, [*arguments, "--json"])
        assert done.exit_code == 0, done.output
        return json.loads(done.stdout)

    shown = run("show", path, "--clearance-arcmin", "6")
    units = {name: about["unit"] for name, about in shown["provenance"].items()}
    assert shown["parameters"]["clearance"] == pytest.approx(6.0 * ARCMIN)
    assert (units["clearance"], units["offset"], units["preload"]) == ("rad", "rad", "N m")
    assert (units["contact_stiffness"], units["contact_damping"]) == ("N m/rad", "N m s/rad")
    assert shown["notes"] == ["the joint turns; results write N for its N m and m for its rad (mm for mrad)"]
    assert run("simulate", path, "--set", "clearance=0.1 deg", "--cycles", "3")["notes"] == shown["notes"]
    assert CliRunner().invoke(app, ["show", path, "--clearance-mm", "1"]).exit_code == 2
    refused = CliRunner().invoke(app, ["show", path, "--set", "clearance=1 mm"]).exception
    assert "allowed: rad, mrad, deg, arcmin, arcsec" in str(refused)


def test_joints_of_both_kinds(file):
    """A joint that turns beside one that slides keeps its own units; both are named."""
    second = """[[joint]]
name = "rack"
at = "rack"
clearance = "0.1 mm"
stiffness = "1 N/um"
damping = "20 N s/m"

[[joint]]
name = "shaft"
"""
    text = TORSIONAL.replace("[joint]\n", second).replace('load = "0, 1"', 'load = "0, 1"\nrack = "0.02, 0.01"')
    text = text.replace("1 to 10 arcmin", "0.05 to 0.2 mm")
    text = text.replace('clearance = "0.5 arcmin"', 'shaft.clearance = "0.5 arcmin"')
    machine = chaosgym.read_machine(file(text))
    assert type(machine).turning == ("shaft",)
    assert machine.notes[0].startswith("joints that turn: shaft;")
    assert chaosgym.simulate(machine, 3).peak_force.shape == (3, 4)


REFUSED = {
    "a spring of what slides": ([('"0.5 Nm/arcmin"', '"1 N/um"')], "is of what turns and joint"),
    "a force at a point that turns": (
        [('"1, 0"', '"1, 0 kg^-1/2 m^-1"'), ('"2 N*m"', '"2 N"')],
        "drive at 'motor' slides, and the shape of 'motor' is of a point that turns",
    ),
    "a shape in metres": (
        [('"1, 0"', '"1, 0 kg^-1/2"')],
        "drive at 'motor' turns, and the shape",
    ),
    "shapes without a unit": ([('modal_masses = ["12 kg cm^2", "0.004 kg·m²"]', "")], "has no unit"),
    "the range of a gap": ([('"1 to 10 arcmin"', '"0.1 to 1 mm"')], "clearance_range is of a joint that slides"),
    "a tolerance": ([('"0.5 arcmin"', '"0.1 mm"')], "unknown unit 'mm'"),
    "a lower stop": ([("[[drive]]", '[joint.lower]\nstiffness = "1 N/um"\n[[drive]]')], "joint.lower slides"),
    "a gap beyond a turn": ([('"3 arcmin"', '"900 deg"')], "allowed: 0 to 10 rad"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_units_that_do_not_fit_end_in_one_line(file, case):
    """Units of what slides and of what turns are not mixed within a joint, nor between a force and its point."""
    changes, message = REFUSED[case]
    text = TORSIONAL
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    with pytest.raises(ParameterError, match=message) as told:
        chaosgym.read_machine(file(text))
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("1 deg", "rad", 0.017453292519943295),
        ("60 arcmin", "rad", 0.017453292519943295),
        ("3600 arcsec", "rad", 0.017453292519943295),
        ("1 Nm/arcmin", "N m/rad", 3437.7467707849396),
        ("1 N m/deg", "N m/rad", 57.29577951308232),
        ("1 lbf ft", "N m", 1.3558179483314),
        ("12 lbf in", "N m", 1.3558179483314),
        ("10000 g cm2", "kg m^2", 1e-3),
        ("1 kg*cm^2", "kg m^2", 1e-4),
        ("5 mN·m", "N m", 5e-3),
    ],
)
def test_units_of_what_turns(text, unit, value):
    """By the definitions of degree, foot and pound force."""
    assert parse_quantity("x", text, unit) == pytest.approx(value, rel=1e-13)
    assert parse_row("x", [text], unit) == [parse_quantity("x", text, unit)]


def test_every_unit_of_what_slides_has_its_counterpart():
    """And no unit is one of both, which would leave open what moves."""
    for slides, turns in TURNING.items():
        assert not set(ALTERNATIVES.get(slides, {slides: 1.0})) & set(ALTERNATIVES[turns])
