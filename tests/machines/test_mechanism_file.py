"""The file of a mechanism: templates, what every command takes, and one line for each way in which it can be wrong."""

import json
import pickle
import re
import tomllib
from pathlib import Path

import gymnasium as gym
import jsonschema
import numpy as np
import pytest
from click.testing import CliRunner

import chaosgym
from chaosgym import simulate
from chaosgym.cli import app
from chaosgym.design.peak_impacts import peak_impacts, worn_side
from chaosgym.errors import ChaosgymError, ParameterError, SimulationError
from chaosgym.machines.machine_file import TEMPLATES, schema_text, template

KINDS = [kind for kind in TEMPLATES if kind != "modes"]


def run(*arguments):
    """Run a command in this process; any error but one that chaosgym raises on purpose fails the test."""
    result = CliRunner().invoke(app, [*map(str, arguments)])
    if result.exception and not isinstance(result.exception, SystemExit | ChaosgymError):
        raise result.exception
    return result


def answer(*arguments):
    """JSON object of a command that must succeed."""
    result = run(*arguments, "--json")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


@pytest.fixture
def file_of(tmp_path):
    """Write a template with some texts replaced."""

    def write(kind="slider-crank", *replaced):
        text = template(kind)
        for old, new in replaced:
            assert old in text, old
            text = text.replace(old, new, 1)
        path = tmp_path / "own.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize("kind", KINDS)
def test_templates_run_and_fit_the_schema(kind, file_of):
    """Each template is printed, fits the published schema, is read, and rattles."""
    assert run("new-machine", kind).stdout == template(kind)
    jsonschema.Draft202012Validator(json.loads(schema_text())).validate(tomllib.loads(template(kind)))
    machine = chaosgym.read_machine(file_of(kind))
    assert simulate(machine, 5).peak_force.max() > 0.0
    assert set(machine.tolerances) >= {machine.speed_field, machine.clearance_field}


def test_an_unknown_template_is_answered_with_the_nearest():
    """A misspelt name of a template is told."""
    assert "did you mean four-bar" in str(run("new-machine", "four-bat").exception)


def test_runs_are_split_kept_and_equal(file_of):
    """A split run, a pickled machine and a batch give the same bits as one run of one machine."""
    for kind in ("slider-crank", "four-bar"):
        machine = chaosgym.read_machine(file_of(kind))
        whole, again = simulate(machine, 3), pickle.loads(pickle.dumps(machine.at(machine.speed)))
        first = simulate(again, 1)
        second = simulate(again, 2, first.final_state)
        np.testing.assert_array_equal(np.concatenate([first.peak_force, second.peak_force]), whole.peak_force)
        batch = machine.batch(2)
        for i in range(2):
            batch.start(i, machine)
        np.testing.assert_array_equal(batch.run(np.arange(2), 3).peak_force, np.stack([whole.peak_force] * 2))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["slider-crank", "four-bar"])
def test_exact_propagation_agrees_with_fixed_steps(kind, file_of):
    """Runge-Kutta with 400,000 steps gives the largest forces of the first cycle of guide and pin to 0.05 %."""
    machine = chaosgym.read_machine(file_of(kind))
    fixed = simulate(machine, 1, integrator=chaosgym.RungeKutta4(400_000))
    assert fixed.peak_force.max() == pytest.approx(simulate(machine, 1).peak_force.max(), rel=5e-4)


@pytest.mark.parametrize(
    ("settings", "same"),
    [
        ({"rod_mass_factor": 2.0, "slider_mass_factor": 2.0, "guide_stiffness": 16e6, "guide_damping": 1000.0}, 2.0),
        ({"guide_clearance": 0.1e-3}, 1.0),
    ],
)
def test_forces_scale_with_the_masses(file_of, settings, same):
    """Twice the masses, springs and dampers give twice the forces: factors reach every part of the equations."""
    machine = chaosgym.read_machine(file_of())
    other = chaosgym.machines.parameters.with_settings(machine, settings)
    np.testing.assert_allclose(simulate(other, 3).peak_force, same * simulate(machine, 3).peak_force, rtol=1e-6)


def test_forces_are_placed_on_their_bearing(file_of):
    """Along a guide in metres from the shaft, around a pin in degrees: what the Peak Impact Diagram needs."""
    guide, force = chaosgym.read_machine(file_of()), np.array([[0.0, 5.0, 0.0]])
    place, unit = guide.bearing_place(np.array([np.pi]), force)
    assert unit == "m"
    assert place == pytest.approx(0.235 - 0.05)
    pin = chaosgym.read_machine(file_of("four-bar"))
    assert pin.bearing_place(np.zeros(1), force) == (pytest.approx(90.0), "deg")
    assert worn_side(simulate(pin, 1)) is None
    diagram = peak_impacts(simulate(guide, 10))
    assert 0.18 < diagram.location.min() < diagram.location.max() < 0.29


def test_a_wide_gap_is_told(file_of):
    """Beyond 2 % of a link the motion in the gap is not small, and every result says so."""
    machine = chaosgym.read_machine(file_of("four-bar"))
    assert machine.notes == ()
    wide = machine.at(clearance=8e-3)
    (note,) = wide.notes
    assert "knee_clearance is 0.032 of the 0.25 m" in note


def test_a_pin_larger_than_its_links_is_told(file_of):
    """A radius of 9 m in place of 9 mm is noted beside every result, with joint, radius and length."""
    for radius, notes in (("9 mm", 0), ("9 m", 1)):
        rubs = f'name = "wrist"\nfriction = 0.1\nradius = "{radius}"\n{LOOSE}'
        told = chaosgym.read_machine(file_of("slider-crank", ('name = "wrist"', rubs))).notes
        assert len(told) == notes, told
    assert told[0].startswith("wrist_radius of 9 m is more than the 0.235 m that its links reach")


ROD = """points = { pin = "0, 0 mm", wrist = "235, 0 mm" }
[[link.rod.body]]               # any number of rigid bodies
mass = "0.30 kg"
centre = "118, 0 mm"
inertia = "1.4e-3 kg m^2"       # about its own centre
"""
BEAM = """[link.rod.beam]
length = "235 mm"
diameter = "8 mm"
youngs_modulus = "210 GPa"
density = "7850 kg/m^3"
modes = 2
damping_ratio = "1 %"
[[link.rod.body]]
at = "start"
mass = "0.2 kg"
inertia = "1e-4 kg m^2"
"""
BENT = ((ROD, BEAM), ('"rod.pin"', '"rod.start"'), ('"rod.wrist"', '"rod.end"'))


def test_a_link_may_bend(file_of):
    """A beam in place of a rigid rod: its frequencies are shown, and a stiff one moves as a rigid one does."""
    bent = chaosgym.read_machine(file_of("slider-crank", *BENT))
    assert bent.degrees_of_freedom == ("guide across", "guide turn", "rod stretch", "rod mode 1", "rod mode 2")
    assert 200.0 < bent.natural_frequencies[0] < 600.0
    text = file_of("slider-crank", *BENT).read_text(encoding="utf-8")
    path = file_of("slider-crank")
    path.write_text(text.replace("210 GPa", "1e13 Pa").replace("modes = 2", "modes = 1"))
    stiff = simulate(chaosgym.read_machine(path), 3).peak_force.max()
    rod = 7850.0 * np.pi / 4.0 * 0.008**2 * 0.235
    start = f"""points = {{ pin = "0, 0 mm", wrist = "235, 0 mm" }}
body = [
    {{ mass = "0.2 kg", inertia = "1e-4 kg m^2" }},
    {{ mass = "{rod} kg", centre = "117.5, 0 mm", inertia = "{rod * 0.235**2 / 12.0} kg m^2" }},
]
"""
    rigid = simulate(chaosgym.read_machine(file_of("slider-crank", (ROD, start))), 3).peak_force.max()
    assert stiff == pytest.approx(rigid, rel=0.02)


@pytest.mark.parametrize(
    ("replaced", "message"),
    [
        (("modes = 2", "modes = 0"), r"link.rod.beam.modes = 0 is out of range; allowed: whole numbers from 1 to 12"),
        (("diameter", "width"), r"\[link.rod.beam\] lacks height"),
        (('at = "start"', ""), "link.rod.body lacks at"),
        (("density", "dense"), "did you mean density"),
        (('210 GPa"', '210 mm"'), "unknown unit 'mm'"),
    ],
)
def test_what_is_wrong_with_a_beam_is_told(file_of, replaced, message):
    """As of everything else."""
    with pytest.raises(ParameterError, match=message):
        chaosgym.read_machine(file_of("slider-crank", *BENT, replaced))


SPRING = """[[spring]]
between = ["rod.wrist", "slider.wrist"]
stiffness = "1 N/m"
free_length = "0 m"
"""
FORCE = """[[force]]
at = "slider.top"
force = "1 N"
"""
BODY = """[[link.slider.body]]
mass = "0.45 kg"
inertia = "2e-4 kg m^2"
"""
FREE = 'kind = "slot"\nbetween = ["crank.pin"'

LOOSE = 'clearance = "0.1 mm"\nstiffness = "8 N/um"\ndamping = "500 N s/m"'
HERTZIAN = 'clearance = "0.1 mm"\nhertz_stiffness = "1e10 N/m^1.5"\nhertz_damping = "0.1 s/m"'

REFUSED = [
    (('wrist = "235, 0 mm"', 'wrist = "35, 0 mm"'), r"crank can't turn beyond \d+\.\d deg|does not close"),
    (('pin = "50, 0 mm"', 'pin = "0, 0 mm"'), "only the crank turns and no other link moves"),
    (("driven = true", "driven = false"), "0 joints are driven"),
    (('kind = "revolute"\nbetween = ["crank.pin"', FREE), "mobility 2: .*pin 1"),
    (('"rod.pin"]', '"rod.pn"]'), "rod has no point 'pn'; known: pin, wrist"),
    (('"rod.pin"]', '"rodpin"]'), "'rodpin' is no point; allowed: LINK.POINT"),
    (('"rod.pin"]', '"rood.pin"]'), "no link is named 'rood'"),
    ((BODY, ""), "nothing resists the motion 'guide turn'"),
    (('mass = "0.30 kg"', 'mass = "0 kg"'), "link.rod.body.mass = 0 kg is out of range"),
    (('mass = "0.30 kg"', 'mass = "0.30 m"'), "has the unknown unit 'm'"),
    (('wrist = "235, 0 mm"', 'wrist = "235, 0, nan mm"'), "', nan' after its first numbers; allowed: numbers"),
    (('stations = "-40, 40 mm"', 'stations = "-40, 1e12 mm"'), "joint guide.stations = 1e.09 m is out of range"),
    (('inertia = "2e-4 kg m^2"', 'inertia = "2e-100 kg m^2"'), "takes .* steps in a bin; allowed: up to 1e.09"),
    (('mass = "0.30 kg"', 'mas = "0.30 kg"'), "did you mean mass"),
    (('clearance = "0.1 mm"', 'clearance = "-0.1 mm"'), "guide_clearance = -0.0001 m is out of range"),
    (('stiffness = "8 N/um"', ""), r"\[joint guide\] lacks stiffness"),
    (('stations = "-40, 40 mm"', 'stations = "40, 40 mm"'), "stations are at one place"),
    (('clearance = "0.1 mm" ', "# "), "joint guide has .* and no clearance"),
    (('points = { shaft = "0, 0 mm", pin', 'points = { shaft = "0 mm", pin'), "has 1 numbers; allowed: two"),
    (('speed = "400 rpm"', 'speed = "400 mm"'), "unknown unit"),
    (('speed = "400 rpm"', 'speed = "0 rpm"'), "speed = 0 rpm is out of range"),
    (('speed_range = "100 to 800 rpm"', 'speed_range = "800 to 100 rpm"'), "is no range"),
    (('# monitored = "guide"', 'monitored = "wrist"'), "monitored = 'wrist' is not one of guide"),
    (('guide_damping = "30 %"', 'rod_damping = "30 %"'), r"\[tolerances\] has no key 'rod_damping'"),
    (('axis = "0 deg"', "friction = 0.9"), "guide_friction = 0.9 is out of range; allowed: 0 to 0.5"),
    (('axis = "0 deg"', "mu = 0.1"), "friction is Coulomb's, of a guide, a slot or a pin"),
    (
        ('name = "wrist"', 'name = "wrist"\nfriction = 0.1'),
        "joint wrist: friction of a pin needs its radius",
    ),
    (('axis = "0 deg"', 'hertz_stiffness = "1e10 N/m^1.5"'), "joint guide has stiffness and is Hertzian"),
    (('stiffness = "8 N/um"', 'hertz_stiffness = "1e10 N/m"'), "unknown unit 'N/m'"),
    (('name = "wrist"', f'name = "wrist"\nfriction = 0.1\n{LOOSE}'), "friction of a pin needs its radius"),
    (('name = "wrist"', f'name = "wrist"\nradius = "9 mm"\n{LOOSE}'), "a radius has no other meaning; allowed: both"),
    (
        ('name = "wrist"', f'name = "wrist"\nfriction = 0.1\nradius = "0 mm"\n{LOOSE}'),
        "joint wrist: radius = 0 m leaves the friction of a pin without moment; allowed: above 0",
    ),
    (('axis = "0 deg"', 'radius = "9 mm"'), "radius has no meaning in a prismatic joint; leave it out"),
    (('axis = "0 deg"', 'friction = 0.1\nradius = "9 mm"'), "radius has no meaning in a prismatic joint; leave it out"),
    (
        ('axis = "0 deg"', 'diameter = "9 mm"'),
        "no key 'diameter'; a round beam has a diameter, a pin with friction a radius",
    ),
    (("[operation]", "[motor]\n\n[operation]"), r"\[motor\] lacks stall_torque"),
    (("[operation]", "[[cam]]\n\n[operation]"), r"a cam's rise is the \[\[motion\]\] of a tight prismatic joint"),
    (
        ('name = "guide"', 'name = "guide"\nfriction = 0.1\nstatic_friction = 0.2'),
        "joint guide.static_friction needs stribeck_speed; allowed: both, or neither",
    ),
    (
        ('name = "guide"', 'name = "guide"\nfriction = 0.1\nstatic_friction = 0.05\nstribeck_speed = "1 m/s"'),
        "guide_static_friction = 0.05 is out of range; allowed: 0.1, its friction, to 1",
    ),
    (
        ('name = "wrist"', f'name = "wrist"\nexponent = 1.2\n{HERTZIAN}'),
        "does not go with exponent = 1.2; allowed: a unit",
    ),
    (('damping = "500 N s/m"', 'damping = "500 N s/m"\nlaw = "flores"'), "joint guide.law needs a Hertzian surface"),
    (('gravity = "9.81 m/s^2"', "gravity = 9.81"), "has no unit"),
    (('kind = "prismatic"', 'kind = "cam"'), "is not one of revolute, prismatic, slot, weld"),
    (('name = "guide"', 'name = "the guide"'), "name 'the guide' is out of range"),
    (('name = "wrist"', 'name = "pin"'), r"two \[\[joint\]\] have the name 'pin'"),
    (("[operation]", f"{SPRING}\n[operation]"), "spring between rod.wrist and slider.wrist has no length"),
    (("[operation]", f"{FORCE}\n[operation]"), "slider has no point 'top'"),
]


@pytest.mark.parametrize(("replaced", "message"), REFUSED)
def test_what_is_wrong_is_told_in_one_line(file_of, replaced, message):
    """Every mistake is one line that names the file, where it is, and what is allowed."""
    with pytest.raises(ParameterError, match=message) as error:
        chaosgym.read_machine(file_of("slider-crank", replaced))
    assert "\n" not in str(error.value)
    assert "own.toml" in str(error.value)


@pytest.mark.parametrize(("first", "count"), [(0.0, 0), (0.0, -3), (0.0, 10**7), (np.nan, 36), (np.inf, 36)])
def test_equations_at_no_angles_are_refused(file_of, first, count):
    """None at all, more than a computer holds, or from an angle on that is none."""
    given = chaosgym.read_machine(file_of("slider-crank"))
    with pytest.raises(ParameterError, match=r"count = .* is out of range|first = .* rad is out of range"):
        given.equations(first, count)


def test_missing_tables_and_a_mechanism_without_clearance(file_of):
    """Tables that are missing are named; so is a mechanism in which nothing rattles."""
    path = file_of(
        "slider-crank", ('clearance = "0.1 mm"', "#"), ("stations =", "#"), ("stiffness =", "#"), ("damping =", "#")
    )
    with pytest.raises(ParameterError, match="no joint has clearance"):
        chaosgym.read_machine(path)
    path.write_text("[ground]\npoints = {}\n")
    with pytest.raises(ParameterError, match=r"\[link\] is missing"):
        chaosgym.read_machine(path)
    path.write_text("[ground]\n[link.crank]\n[operation]\n[[joints]]\n")
    with pytest.raises(ParameterError, match=r"no table 'joints'; did you mean \[\[joint\]\]\?"):
        chaosgym.read_machine(path)
    path.write_text("[ground]\n[link.crank]\n[operation]\n")
    with pytest.raises(ParameterError, match=r"\[\[joint\]\] is missing"):
        chaosgym.read_machine(path)


@pytest.mark.slow
def test_every_command_and_environment_takes_a_mechanism(file_of, tmp_path, monkeypatch):
    """Simulated, shown, drawn, diagnosed, swept and traded off; environments step and render."""
    monkeypatch.chdir(tmp_path)
    path = file_of("slider-crank")
    machine = chaosgym.read_machine(path)
    assert len(answer("simulate", path, "--cycles", 4, "--plot", "s.png")["peak_force_N"]) == 4
    assert answer("show", path, "--plot", "m.png")["degrees_of_freedom"] == list(machine.degrees_of_freedom)
    assert answer("diagnose", path, "--budget", 200, "--plot", "d.png")["nature"]
    assert answer("tradeoff", path, "--step-check")["nature"]
    assert all(Path(name).stat().st_size > 5000 for name in ("s.png", "m.png", "d.png"))
    low, high = machine.usual_ranges[machine.clearance_field]
    axes = ("--axis", f"{machine.clearance_field}={low}:{high}:2", "--axis", "speed=300:400:2")
    assert answer("sweep", path, *axes, "--budget", 100, "--out", tmp_path / "sweep")["points"] == 4
    short = ("--points", 2, "--cycles", 20, "--budget", 0.05)
    rows = answer("tradeoff", path, *short, "--out", tmp_path)["rows"]
    assert {row["rung"] for row in rows} == set(machine.fidelity_ladder)
    env = gym.make("chaosgym/MachineTolerance-v0", machine=str(path), render_mode="rgb_array")
    first, _ = env.reset(seed=1)
    env.step(env.action_space.sample())
    assert env.render().ndim == 3
    envs = gym.make_vec("chaosgym/MachineTolerance-v0", num_envs=2, machine=str(path))
    np.testing.assert_array_equal(envs.reset(seed=1)[0][0], first)


@pytest.mark.slow
def test_types_and_report_of_a_mechanism(file_of, tmp_path):
    """Dozens of variants within the tolerances: types, the classifier's answer, and the report of a template."""
    path = file_of("slider-crank")
    assert answer("diagnose", path, "--budget", 200, "--types")["nature"]
    assert answer("classify", path)["stage"]
    brief = tmp_path / "brief.toml"
    brief.write_text(run("design", "--template", path).stdout)
    assert answer("design", brief, "--out", tmp_path / "report.html")["machine"]


@pytest.mark.parametrize(("force", "buckles"), [(7000.0, False), (8000.0, True)])
def test_a_rod_pushed_beyond_its_euler_load_is_named(file_of, force, buckles):
    """Push / cos(rod's angle) against pi^2 E I / l^2 = 7546 N: told beside results, and where the motion grows."""
    push = f'[[force]]\nat = "slider.wrist"\ndirection = "180 deg"\nforce = "{force} N"\n\n[operation]'
    slow = ('speed = "400 rpm"', 'speed = "120 rpm"')
    machine = chaosgym.read_machine(file_of("slider-crank", *BENT, ("[operation]", push), slow))
    if not buckles:
        assert machine.notes == ()
        simulate(machine, 3)
        return
    (note,) = machine.notes
    found = re.fullmatch(r"rod is pushed beyond its Euler load, .*: (\S+) N against (\S+) N at .* (\d+) deg", note)
    assert found
    load, euler = force / np.cos(np.arcsin(0.05 / 0.235)), np.pi**2 * 210e9 * np.pi * 0.008**4 / 64.0 / 0.235**2
    assert [float(value) for value in found.groups()] == pytest.approx([load, euler, 90.0], rel=3e-3, abs=5.0)
    with pytest.raises(SimulationError, match=re.escape(note) + "; the motion grew beyond every bound"):
        simulate(machine, 200)


def test_a_force_written_as_a_vector_is_refused(file_of):
    """Two numbers are its components to who writes them: the line has the same force along a direction."""
    message = r"2 numbers, as a vector; .* force = \"500 N\", direction = \"-90 deg\", or at least 3 samples"
    for force, line in (('force = "0, -500 N"', message), ('force = "1 N"\nangle = "30 deg"', "stands in direction")):
        push = f'[[force]]\nat = "slider.wrist"\n{force}\n\n[operation]'
        with pytest.raises(ParameterError, match=line):
            chaosgym.read_machine(file_of("slider-crank", ("[operation]", push)))
