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
from chaosgym.machines.modal_machine.turning import turning_joints
from chaosgym.units import ALTERNATIVES, TURNING, parse_quantity, parse_row

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
motor = "1, 0"
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


NORMALISED = ('modal_masses = ["12 kg cm^2", "0.004 kg·m²"]', ""), ('"0, 1"', '"0, 1 kg^-1/2 m^-1"')

REFUSED = {
    "a spring of what slides": ([('"0.5 Nm/arcmin"', '"1 N/um"')], "is of what turns and joint"),
    "a force at a point that turns": (
        [*NORMALISED, ('"1, 0"', '"1, 0 kg^-1/2 m^-1"'), ('"2 N*m"', '"2 N"')],
        "drive at 'motor' slides, and the shape of 'motor' is of a point that turns",
    ),
    "a shape in metres": (
        [*NORMALISED, ('"1, 0"', '"1, 0 kg^-1/2"')],
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


def tables(**changed):
    """Tables of a file in which all that has a unit turns, with some of them changed."""
    shapes = {"motor": "1, 0 kg^-1/2 m^-1", "load": "0, 1 kg^-1/2 m^-1", "base": "1, 1 kg^1/2 m"}
    joint = {"at": "motor - load", "clearance": "3 arcmin", "stiffness": "1 N m/rad"}
    drive = {"at": "motor", "force": "2 N m"}
    operation = {"speed": "8 Hz", "clearance_range": "1 to 10 arcmin"}
    return {"structure": {"shapes": shapes}, "joint": joint, "drive": drive, "operation": operation} | changed


SLIDES = {"at": "rack", "clearance": "0.1 mm", "stiffness": "1 N/um"}
TURNS = {"name": "shaft", "at": "motor - load", "clearance": "3 arcmin"}
RANGE_OF_GAPS = {"clearance_range": "0.1 to 1 mm"}


def test_a_table_or_a_list_of_tables():
    """One joint or several, one drive or several, shapes or none: each joint is told by itself."""
    assert turning_joints(tables()) == [True]
    assert turning_joints(tables(drive=[{"at": "motor", "force": "2 N m"}, {"at": "other", "force": "1 N"}])) == [True]
    bare = tables(structure={}, operation={}, joint=[SLIDES, TURNS], drive={"at": "rack", "force": "1 N"})
    assert turning_joints(bare) == [False, True]
    assert turning_joints(tables(joint={"at": "motor", "stops": "one"}, operation={})) == [False]
    somewhere = {"structure": {"shapes": {"base": "1, 1 kg^1/2"}}, "drive": {"force": "2 N m"}}
    assert turning_joints(tables(**somewhere)) == [True], "a force acts at no base"


def test_the_range_of_gaps_is_that_of_the_monitored_joint():
    """By its name, by its number, or the first one."""
    operation = RANGE_OF_GAPS | {"monitored": "joint_1"}
    assert turning_joints(tables(joint=[SLIDES, TURNS], operation=operation)) == [False, True]
    assert turning_joints(tables(joint=[SLIDES, TURNS], operation=RANGE_OF_GAPS)) == [False, True]
    assert turning_joints(tables(joint=[TURNS, SLIDES], operation=RANGE_OF_GAPS | {"monitored": "joint_2"}))[0]
    assert turning_joints(
        tables(joint=[SLIDES, TURNS], operation={"clearance_range": "1, 9 deg", "monitored": "shaft"})
    )
    for joints, watched in (([SLIDES, TURNS], "shaft"), ([TURNS, SLIDES], "none"), ([TURNS, SLIDES], "shaft")):
        with pytest.raises(ParameterError, match="clearance_range is of a joint that slides, and the joint does not"):
            turning_joints(tables(joint=joints, operation=RANGE_OF_GAPS | {"monitored": watched}))


SLIDING_SHAPES = {"motor": "1, 0 kg^-1/2", "load": "0, 1 kg^-1/2", "base": "1, 1 kg^1/2", "a-b": "1, 1 kg^-1/2"}
SLIDING_BASE = {"base": "1, 1 kg^1/2"}
LINE = "{} {}, and the shape of {} is of a point that {}; allowed: a shape in {}"
TURN_SHAPE, TURN_BASE = "kg^-1/2 m^-1", "kg^1/2 m"
WHOLE = {
    "a joint": (
        {"structure": {"shapes": SLIDING_SHAPES}},
        LINE.format("drive at 'motor'", "turns", "'motor'", "slides", TURN_SHAPE),
    ),
    "a joint alone": (
        {"structure": {"shapes": SLIDING_SHAPES}, "drive": {"at": "c", "force": "1 N"}},
        LINE.format("joint at 'motor - load'", "turns", "'motor'", "slides", TURN_SHAPE),
    ),
    "the second point of a sum": (
        {"structure": {"shapes": {"load": "0, 1 kg^-1/2"}}, "joint": TURNS | {"at": "motor+load"}},
        LINE.format("joint at 'motor+load'", "turns", "'load'", "slides", TURN_SHAPE),
    ),
    "the second point of a difference without blanks": (
        {"structure": {"shapes": {"load": "0, 1 kg^-1/2"}}, "joint": TURNS | {"at": "motor-load"}},
        LINE.format("joint at 'motor-load'", "turns", "'load'", "slides", TURN_SHAPE),
    ),
    "a point whose name has a sign": (
        {"structure": {"shapes": SLIDING_SHAPES}, "joint": TURNS | {"at": "a-b"}, "drive": {"at": "c", "force": "1 N"}},
        LINE.format("joint at 'a-b'", "turns", "'a-b'", "slides", TURN_SHAPE),
    ),
    "a compliance": (
        {"structure": {"shapes": SLIDING_SHAPES, "residual": {"at": "load", "compliance": "1 rad/(N m)"}}},
        LINE.format("structure.residual at 'load'", "turns", "'load'", "slides", TURN_SHAPE),
    ),
    "a base that is moved": (
        {"drive": {"displacement": "1 mm"}},
        LINE.format("drive at 'base'", "slides", "'base'", "turns", "kg^1/2"),
    ),
    "a base that is accelerated": (
        {"structure": {"shapes": SLIDING_BASE}, "drive": {"acceleration": "1 rad/s^2"}},
        LINE.format("drive at 'base'", "turns", "'base'", "slides", TURN_BASE),
    ),
    "a base in the unit of a point": (
        {"structure": {"shapes": {"base": "1, 1 kg^-1/2"}}},
        "structure.shapes.base = '1, 1 kg^-1/2' has no unit; write it in kg^1/2, or in kg^1/2 m if it turns (the "
        "unit of a mass beside modal_masses)",
    ),
    "a point without a unit": (
        {"structure": {"shapes": {"motor": "1, 0"}}},
        "structure.shapes.motor = '1, 0' has no unit; write it in kg^-1/2, or in kg^-1/2 m^-1 if it turns (none is "
        "needed beside modal_masses)",
    ),
    "a joint of both": (
        {"joint": TURNS | {"stiffness": "1 N/m"}},
        "joint.clearance = '3 arcmin' is of what turns and joint.stiffness = '1 N/m' of what slides; allowed: one of "
        "the two",
    ),
    "stops of both": (
        {"joint": TURNS | {"lower": {"stiffness": "1 N/m"}}},
        "joint.lower slides and its joint turns; allowed: the same",
    ),
    "matrices in millimetres": (
        {"structure": {"units": "t mm N"}},
        "units = 't mm N' is of a structure that slides; allowed with rad or N m: 'kg m N'",
    ),
}


@pytest.mark.parametrize("case", WHOLE)
def test_each_mixture_is_told_in_whole(case):
    """Table, point and units: what turns, what slides, and what is allowed there."""
    changed, line = WHOLE[case]
    with pytest.raises(ParameterError) as told:
        turning_joints(tables(**changed))
    assert str(told.value) == line


def test_matrices_in_millimetres_go_with_what_slides():
    """A drive that turns is enough to refuse them."""
    millimetres, drive = {"units": "t mm N"}, {"at": "rack", "force": "1 N"}
    assert turning_joints(tables(structure=millimetres, joint=SLIDES, drive=drive, operation={})) == [False]
    with pytest.raises(ParameterError, match="units = 't mm N'"):
        turning_joints(tables(structure=millimetres, joint=SLIDES, operation={}))


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
